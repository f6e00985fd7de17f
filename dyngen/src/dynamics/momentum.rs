//! Momentum, kinetic energy, and the velocity terms that momentum gives without a matrix.
//!
//! For an arm at rest, the Newton–Euler recursion maps accelerations as momentum maps velocities: its
//! accelerations are then velocities, its wrenches momenta p and h.

use super::body::Vector;
use super::composite::z_cross;
use super::inverse::{Felt, newton_euler};
use super::motion::Drive;
use super::regroup::LinkBody;
use super::spin::Spin;
use super::stage::{Chain, plus};
use crate::arm::JointKind;
use crate::exact::algebra::Algebra;
use crate::exact::rational;
use crate::graph::{Builder, Expr};

fn as_accelerations(velocities: &[Expr]) -> Drive {
    let rest = vec![Expr::ZERO; velocities.len()];
    Drive { velocities: rest.clone(), reference: rest, accelerations: velocities.to_vec(), gravity: false }
}

/// The generalised momentum B·q̇ = ∂T/∂q̇.
pub fn momentum(b: &Builder, chain: &Chain, bodies: &[LinkBody], velocities: &[Expr]) -> Vec<Expr> {
    newton_euler(b, chain, bodies, &as_accelerations(velocities)).torques
}

/// T = ½ q̇ᵀ·B·q̇.
pub fn kinetic_energy(b: &Builder, chain: &Chain, bodies: &[LinkBody], velocities: &[Expr]) -> Expr {
    let momentum = momentum(b, chain, bodies, velocities);
    let terms = velocities.iter().zip(&momentum).map(|(velocity, p)| b.mul(velocity, p));
    let twice = terms.fold(Expr::ZERO, |sum, term| b.add(&sum, &term));
    b.mul(&b.constant(&rational::ratio(1, 2)), &twice)
}

/// Cᵀ·q̇, which for Christoffel symbols is ∂T/∂q (what a momentum observer needs).
///
/// It is Σ m ẋ·J̇ over all points: for a coordinate that turns about z, −z·(ω×h + v×p); where it only
/// displaces what is beyond by t = z×p, also ṫ times the momentum there.
pub fn coriolis_transpose_times_velocity(
    b: &Builder,
    chain: &Chain,
    bodies: &[LinkBody],
    velocities: &[Expr],
) -> Vec<Expr> {
    let passes = newton_euler(b, chain, bodies, &as_accelerations(velocities));
    let mut result = vec![Expr::ZERO; chain.dof()];
    let along_z = |u: &Vector, v: &Vector| b.sub(&b.mul(&u[0], &v[1]), &b.mul(&u[1], &v[0]));
    for ((stage, motion), felt) in chain.stages.iter().zip(&passes.motions).zip(&passes.felt) {
        let mut sum = Expr::ZERO;
        for (k, member) in stage.members.iter().enumerate().rev() {
            let (link, Felt { wrench, later, .. }) = (&motion.links[k], &felt[k]);
            let own = match stage.kind {
                JointKind::Revolute => {
                    let turned = along_z(&turning(b, &link.spin), &wrench.moment);
                    -b.add(&turned, &along_z(&link.acceleration, &wrench.force))
                }
                JointKind::Prismatic => -along_z(&turning(b, &motion.before), &wrench.force),
            };
            sum = b.add(&sum, &own);
            if k + 1 < stage.members.len() {
                let (omega, reach) = match chain.form.link_to_link {
                    true => (turning(b, &link.spin), member.reach),
                    false => {
                        let [x, y, z] = turning(b, &motion.before);
                        ([x, y, b.add(&z, &motion.accelerations[k])], stage.reach_before(b, k))
                    }
                };
                let z_rate = [omega[1], -omega[0], Expr::ZERO];
                let t_rate = plus(b, &b.cross(&z_rate, &reach), &z_cross(&b.cross(&omega, &reach)));
                sum = b.add(&sum, &b.dot(&t_rate, later));
            }
            result[member.joint] = if member.reversed { -sum } else { sum };
        }
    }
    result
}

/// The angular velocity if velocities are used as accelerations.
fn turning(b: &Builder, spin: &Spin) -> Vector {
    std::array::from_fn(|axis| spin.alpha(b, axis))
}
