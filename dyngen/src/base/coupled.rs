//! Rotors of motors that turn with several joints, along the chain.
//!
//! With μ = Σ mⱼ q̇ⱼ the motor's velocity, ω the angular velocity of the link that carries it about its axis
//! and k its ratio, twice its energy for a unit of inertia is 2 k μ ω + k² μ². That is whole only at the last
//! of its joints. Up to the motor's own joint μ is carried, and its products with the link's angular
//! velocity; from there on the energy so far, which a further joint changes by (rate)·mⱼ q̇ⱼ + (square)·(mⱼ
//! q̇ⱼ)².

use crate::arm::Arm;
use crate::exact::algebra::Algebra;
use crate::exact::polynomial::{Numerator, PolynomialRing};
use crate::exact::rational::Rational;

/// Variables that a coupled motor adds to a motion.
pub(super) const CARRIED: usize = 4;

/// A motor that turns with several joints.
#[derive(Clone, Debug)]
pub(super) struct CoupledMotor {
    /// The motor's own joint.
    pub(super) motor: usize,
    /// The last joint that it depends on.
    pub(super) last: usize,
    row: Vec<(usize, Rational)>,
}

/// The carried quantities of a motor: variables of the motion before a joint, or their values after a step.
#[derive(Clone, Debug)]
pub(super) struct Carried<V> {
    /// μ so far, up to the motor's own joint; then zero.
    pub(super) velocity: V,
    /// Twice the energy so far, from the motor's own joint on; before zero.
    pub(super) energy: V,
    /// Rate of the energy with μ, 2 k ω + 2 k² μ.
    pub(super) rate: V,
    /// k²
    pub(super) square: V,
}

impl CoupledMotor {
    /// The coupled motors of an arm whose joints have rotors.
    pub(super) fn all(arm: &Arm) -> Vec<CoupledMotor> {
        let of = |motor: usize| {
            arm.joints[motor].rotor_ratio.as_ref()?;
            let row = arm.coupled_motor(motor)?;
            let last = row.iter().map(|(joint, _)| *joint).chain([motor]).max()?;
            Some(CoupledMotor { motor, last, row })
        };
        (0..arm.dof()).filter_map(of).collect()
    }

    /// The step of a joint on the carried quantities, where the link before it turns at `omega` about its
    /// axis.
    pub(super) fn step(
        &self,
        ring: &PolynomialRing<Rational>,
        joint: usize,
        before: &Carried<Numerator>,
        (omega, velocity, ratio): (&Numerator, &Numerator, &Numerator),
    ) -> Carried<Numerator> {
        let zero = || ring.integer(0);
        if joint > self.last {
            return Carried { velocity: zero(), energy: zero(), rate: zero(), square: zero() };
        }
        let factor = self.row.iter().find(|(j, _)| *j == joint).map(|(_, factor)| factor.clone());
        let own = factor.map_or(zero(), |factor| ring.mul(&ring.constant(factor), velocity));
        let twice = |x: &Numerator| ring.add(x, x);
        if joint < self.motor {
            let velocity = ring.add(&before.velocity, &own);
            return Carried { velocity, energy: zero(), rate: zero(), square: zero() };
        }
        if joint == self.motor {
            let velocity = ring.add(&before.velocity, &own);
            let spin = ring.mul(ratio, &velocity);
            let energy = ring.mul(&spin, &ring.add(&twice(omega), &spin));
            let rate = twice(&ring.mul(ratio, &ring.add(omega, &spin)));
            return Carried { velocity: zero(), energy, rate, square: ring.mul(ratio, ratio) };
        }
        let square = before.square.clone();
        let change = ring.mul(&square, &own);
        let energy = ring.add(&before.energy, &ring.mul(&own, &ring.add(&before.rate, &change)));
        Carried { velocity: zero(), energy, rate: ring.add(&before.rate, &twice(&change)), square }
    }
}
