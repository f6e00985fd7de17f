//! Inverse dynamics by the Newton–Euler recursion along the chain.

use super::bars;
use super::body::Vector;
use super::moments::Moments;
use super::motion::{Drive, LinkMotion, StageMotion, axis_rate, motions};
use super::regroup::LinkBody;
use super::stage::{Chain, Stage, back_z, plus, scaled};
use super::wrench::{Wrench, lever};
use crate::arm::JointKind;
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// The generalised force on a coordinate of a stage.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// The coordinate's torque or force.
    pub torque: Expr,
    /// The wrench of its link about the link's origin, in the link's axes; of the last link of a stage with
    /// all beyond. Of a prismatic joint that before its turn.
    pub wrench: Wrench,
    /// The force on all beyond a link that is not the last of its stage: in its axes, or in those before the
    /// stage if the form turns vectors there.
    pub later: Vector,
}

/// Both passes of the recursion.
#[derive(Clone, Debug)]
pub struct Passes {
    /// Torques of the joints.
    pub torques: Vec<Expr>,
    /// How the frames of each stage move.
    pub motions: Vec<StageMotion>,
    /// The generalised forces on the coordinates of each stage.
    pub felt: Vec<Vec<Felt>>,
}

/// The torques that a motion needs: τ = B(q)·q̈ + C(q, q̇)·q̇ + g(q).
pub fn inverse_dynamics(b: &Builder, chain: &Chain, bodies: &[LinkBody], drive: &Drive) -> Vec<Expr> {
    newton_euler(b, chain, bodies, drive).torques
}

/// The motion outwards, forces and moments inwards.
pub fn newton_euler(b: &Builder, chain: &Chain, bodies: &[LinkBody], drive: &Drive) -> Passes {
    let motions = motions(b, chain, drive);
    let (of_bars, of_hinges) = bars::wrenches(b, chain, &motions, drive);
    let mut felt = Vec::with_capacity(chain.stages.len());
    let mut torques = vec![Expr::ZERO; chain.dof()];
    // What acts on joints directly: of motors that turn with several, and of bars that joints turn.
    let mut directly = of_hinges;
    let mut outer = Wrench::NONE;
    for (stage, motion) in chain.stages.iter().zip(&motions).rev() {
        let (own, mut before) = match stage.kind {
            JointKind::Revolute => revolute(b, chain, stage, motion, (bodies, &of_bars), &outer),
            JointKind::Prismatic => prismatic(b, stage, motion, (bodies, &of_bars), &outer),
        };
        // A joint's torque moves its own link and all after it.
        let (mut sum, mut wheels, mut spin) = (Expr::ZERO, Expr::ZERO, Expr::ZERO);
        let alpha = motion.before.alpha_z(b);
        for (k, member) in stage.members.iter().enumerate().rev() {
            let body = &bodies[member.joint];
            sum = b.add(&sum, &own[k].torque);
            let mut torque = b.add(&sum, &wheels);
            if let Some(ratio) = member.ratio {
                let rotor = b.mul(&ratio, &body.rotor);
                let ddq = motion.motor_acceleration(b, k);
                let inner = k.checked_sub(1).map_or(Expr::ZERO, |inner| motion.accelerations[inner]);
                let turning = b.add(&b.mul(&ratio, &ddq), &b.add(&alpha, &inner));
                let of_motor = b.mul(&rotor, &turning);
                match member.coupled {
                    Some(_) => member.add_coupled_torque(b, of_motor, &mut directly),
                    None => torque = b.add(&torque, &of_motor),
                }
                // It turns the link before: within the stage that is what the inner coordinates feel.
                let carrier = if stage.kind == JointKind::Revolute { &mut sum } else { &mut spin };
                *carrier = b.add(carrier, &b.mul(&rotor, &ddq));
                let (velocity, reference) = motion.motor_rates(b, k);
                let turned = axis_rate(b, &motion.before, velocity, reference);
                before.moment = plus(b, &before.moment, &scaled(b, rotor, &turned));
            }
            if body.flywheel != Expr::ZERO {
                let wheel = body.flywheel;
                let turning = b.mul(&wheel, &b.add(&alpha, &motion.accelerations[k]));
                wheels = b.add(&wheels, &turning);
                torque = b.add(&torque, &turning);
                spin = b.add(&spin, &b.mul(&wheel, &motion.accelerations[k]));
                let turned = axis_rate(b, &motion.before, motion.velocities[k], motion.reference[k]);
                before.moment = plus(b, &before.moment, &scaled(b, wheel, &turned));
            }
            torques[member.joint] = if member.reversed { -torque } else { torque };
        }
        if stage.kind == JointKind::Revolute {
            before.moment[2] = sum;
        }
        before.moment[2] = b.add(&before.moment[2], &spin);
        outer = before.turned_back_x(b, stage.twist);
        felt.push(own);
    }
    felt.reverse();
    let torques = torques.iter().zip(&directly).map(|(own, more)| b.add(own, more)).collect();
    Passes { torques, motions, felt }
}

/// The force on each coordinate of the stage, and the wrench before the stage about its first origin.
fn revolute(
    b: &Builder,
    chain: &Chain,
    stage: &Stage,
    motion: &StageMotion,
    (bodies, of_bars): (&[LinkBody], &[Wrench]),
    outer: &Wrench,
) -> (Vec<Felt>, Wrench) {
    let nothing = Felt { torque: Expr::ZERO, wrench: Wrench::NONE, later: super::body::ZERO };
    let mut own = vec![nothing; stage.members.len()];
    // The force on all links from one on: in that link's axes, or in those before the stage.
    let (mut force, mut before) = (super::body::ZERO, Wrench::NONE);
    for (k, member) in stage.members.iter().enumerate().rev() {
        let (body, link) = (&bodies[member.joint], &motion.links[k]);
        let mut here = moments_wrench(b, &body.moments, link).plus(b, &of_bars[member.joint]);
        let end = scaled(b, body.end_mass, &link.next);
        let last = k + 1 == stage.members.len();
        if last {
            let carried = Wrench { force: plus(b, &outer.force, &end), ..*outer };
            here = here.plus(b, &carried.shifted(b, &member.reach));
            own[k] = Felt { torque: here.moment[2], wrench: here, ..nothing };
        } else if chain.form.link_to_link {
            let later = plus(b, &back_z(b, stage.members[k + 1].step, &force), &end);
            let torque = b.add(&here.moment[2], &lever(b, &member.reach, &later));
            own[k] = Felt { torque, wrench: here, later };
            here =
                here.plus(b, &Wrench { force: later, moment: super::body::ZERO }.shifted(b, &member.reach));
        } else {
            let later = plus(b, &before.force, &back_z(b, member.angle, &end));
            let reach = stage.reach_before(b, k);
            let torque = b.add(&here.moment[2], &lever(b, &reach, &later));
            own[k] = Felt { torque, wrench: here, later };
            let carried = Wrench { force: later, moment: before.moment };
            before = Wrench { moment: carried.shifted(b, &reach).moment, force: later };
        }
        before.moment = plus(b, &before.moment, &back_z(b, member.angle, &here.moment));
        if chain.form.link_to_link {
            force = here.force;
            before.force = back_z(b, member.angle, &force);
        } else {
            before.force = plus(b, &before.force, &back_z(b, member.angle, &here.force));
        }
    }
    (own, before)
}

/// The force that the joint feels, and the wrench before it about the point of its axis in the link before.
fn prismatic(
    b: &Builder,
    stage: &Stage,
    motion: &StageMotion,
    (bodies, of_bars): (&[LinkBody], &[Wrench]),
    outer: &Wrench,
) -> (Vec<Felt>, Wrench) {
    let (member, link) = (&stage.members[0], &motion.links[0]);
    let body = &bodies[member.joint];
    let end = scaled(b, body.end_mass, &link.next);
    let carried = Wrench { force: plus(b, &outer.force, &end), ..*outer }.shifted(b, &member.reach);
    let own = moments_wrench(b, &body.moments, link).plus(b, &of_bars[member.joint]);
    let here = own.plus(b, &carried);
    let turned =
        Wrench { force: back_z(b, member.angle, &here.force), moment: back_z(b, member.angle, &here.moment) };
    let before = turned.shifted(b, &[Expr::ZERO, Expr::ZERO, stage.shift]);
    (vec![Felt { torque: before.force[2], wrench: turned, later: super::body::ZERO }], before)
}

/// The wrench of a body's motion: f = m a + U s, n = Σ J_ij e_i×(U e_j) + s×a.
pub fn moments_wrench(b: &Builder, moments: &Moments<Expr>, link: &LinkMotion) -> Wrench {
    let mut wrench = Wrench::NONE;
    // First moments across the axis need U's diagonal unchanged.
    let diagonal_unused = moments.first[0] == Expr::ZERO && moments.first[1] == Expr::ZERO;
    for (entry, value) in moments.entries().into_iter().enumerate() {
        if value != Expr::ZERO {
            let mut unit = entry_wrench(b, entry, link);
            if entry == 9 && diagonal_unused {
                unit.moment[2] = -link.spin.squares_across(b);
            }
            let part =
                Wrench { force: scaled(b, value, &unit.force), moment: scaled(b, value, &unit.moment) };
            wrench = wrench.plus(b, &part);
        }
    }
    wrench
}

/// The wrench of a unit of one entry of a body's moments about the origin.
pub fn entry_wrench(b: &Builder, entry: usize, link: &LinkMotion) -> Wrench {
    let u = &link.spin.rows;
    let [ax, ay, az] = link.acceleration;
    let zero = Expr::ZERO;
    let moment = |moment: Vector| Wrench { force: super::body::ZERO, moment };
    let first = |axis: usize, moment: Vector| Wrench { force: link.spin.column(axis), moment };
    match entry {
        0 => Wrench { force: link.acceleration, moment: super::body::ZERO },
        1 => first(0, [zero, -az, ay]),
        2 => first(1, [az, zero, -ax]),
        3 => first(2, [-ay, ax, zero]),
        4 => moment([zero, -u[2][0], u[1][0]]),
        5 => moment([u[2][1], zero, -u[0][1]]),
        6 => moment([-u[1][2], u[0][2], zero]),
        7 => moment([b.sub(&u[2][2], &u[1][1]), u[0][1], -u[0][2]]),
        8 => moment([-u[1][0], b.sub(&u[0][0], &u[2][2]), u[1][2]]),
        _ => moment([u[2][0], -u[2][1], b.sub(&u[1][1], &u[0][0])]),
    }
}
