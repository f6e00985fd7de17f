//! Hand guiding: weight and friction are compensated, and an arm at rest is not pushed.

use super::number;
use crate::dynamics::{ArmModel, State};
use crate::friction::TanhFriction;
use nalgebra::{RealField, SVector};

/// How friction of one joint is taken off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Softening<T> {
    /// κ, 0 to 1: share of the friction that is taken off in motion.
    pub share: T,
    /// v₀, rad/s: half of it is taken off at this velocity.
    pub fade: T,
    /// Level of the hold at rest, N·m: a weight that the model is wrong by does not move the joint up to
    /// here.
    pub hold: T,
    /// The way after which the hold has built up, rad.
    pub give: T,
}

impl<T: RealField + Copy> Softening<T> {
    /// Settings that suit a joint's friction: κ = 0.85; v₀ a fifth of the velocity at which its larger part
    /// saturates, so that no ridge of friction is left below; a hold of 5 % of its level over 1 mrad.
    #[must_use]
    pub fn of(friction: &TanhFriction<T>) -> Self {
        let first = friction.gamma1.abs() >= friction.gamma3.abs();
        let steepness = if first { friction.gamma2 } else { friction.gamma4 };
        Softening {
            share: number(0.85),
            fade: number::<T>(0.2) / steepness.abs().max(number(1.0)),
            hold: (friction.gamma1.abs() + friction.gamma3.abs()) * number(0.05),
            give: number(1e-3),
        }
    }
}

/// τ = g(q) + κ·w(q̇)·f(q̇) − h: weight compensation, friction of the direction in which the joint begins to
/// move, faded in by w = |q̇|/(|q̇| + v₀), and a hold h that yields (Armstrong-Hélouvry, Dupont, Canudas de
/// Wit, *A survey of models … with friction*, Automatica 30, 1994, §5: why friction must not be taken off at
/// rest by the sign of a velocity that is noise).
///
/// The direction that a hand intends is that in which the joint creeps: drives have no torque sensor, and a
/// momentum observer sees a joint that sticks at rest. At q̇ = 0 the compensation and its slope vanish, so
/// noise of the velocity pushes nothing. With κ·f below the true friction f_t in both directions the joint
/// stays dissipative: q̇·(κ·w·f − f_t) ≤ 0. The hold is an elastic slider (Prandtl): a spring hold/give whose
/// end slips at `hold`, which stores no more than hold·give/2 and takes energy whenever it slips. So the arm
/// is passive towards the hand; what it needs is about (1 − κ)·f + hold. Sampled and late, κ·∂f/∂q̇ acts
/// against the same slope of the true friction: steady for κ < 1 as long as the slope times the cycle is less
/// than the joint's inertia (tested at 200 Hz). A lighter joint with steep friction creeps: run it faster, or
/// take a smaller share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandGuiding<T, const N: usize> {
    /// Eq. 16 by joint.
    pub friction: [TanhFriction<T>; N],
    /// How it is taken off.
    pub softening: [Softening<T>; N],
    /// The slider's place, rad, once the joints were seen.
    anchor: Option<SVector<T, N>>,
}

impl<T: RealField + Copy, const N: usize> HandGuiding<T, N> {
    /// Takes `softening` of `friction` off.
    #[must_use]
    pub fn new(friction: [TanhFriction<T>; N], softening: [Softening<T>; N]) -> Self {
        HandGuiding { friction, softening, anchor: None }
    }

    /// The torque, N·m; once a cycle.
    pub fn torque(&mut self, model: &impl ArmModel<T, N>, state: &State<T, N>) -> SVector<T, N> {
        let anchor = self.anchor.get_or_insert(state.q);
        let mut torque = model.gravity(&state.q);
        for j in 0..N {
            let (soft, v) = (&self.softening[j], state.dq[j]);
            let faded = v.abs() / (v.abs() + soft.fade);
            torque[j] += soft.share * faded * self.friction[j].torque(v);
            // The slider follows at the distance at which it slips.
            let way = (state.q[j] - anchor[j]).max(-soft.give).min(soft.give);
            if soft.give > T::zero() && way.is_finite() {
                anchor[j] = state.q[j] - way;
                torque[j] -= soft.hold * way / soft.give;
            }
        }
        torque
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_arm::{Planar, Sampled};
    use super::*;
    use nalgebra::{SVector, Vector2};

    const FRICTION: f64 = 2.0;

    fn law(share: f64, hold: f64) -> HandGuiding<f64, 2> {
        let friction = TanhFriction::new([FRICTION, 500.0, 0.0, 1.0, 0.0]);
        HandGuiding::new([friction; 2], [Softening { share, fade: 4e-4, hold, give: 1e-3 }; 2])
    }

    /// 200 Hz, a cycle late, as on the bus; `weight` is what the model of gravity is wrong by at joint 1.
    fn run(
        law: &mut HandGuiding<f64, 2>,
        hand: f64,
        weight: f64,
        dq: Vector2<f64>,
        seconds: f64,
    ) -> [Vector2<f64>; 2] {
        let arm = Planar::<2>::default();
        let q0 = Vector2::new(0.3, 0.5);
        let mut plant = Sampled::new(&arm, q0, dq);
        plant.friction = FRICTION;
        plant.external = Vector2::new(hand + weight, 0.0);
        let mut waiting = arm.gravity(&q0);
        for _ in 0..(seconds / 0.005) as usize {
            let next = law.torque(&arm, &plant.state);
            plant.advance(&waiting, 0.005, 100);
            waiting = next;
        }
        [plant.state.q - q0, plant.state.dq]
    }

    #[test]
    fn a_resting_arm_stays_although_its_weight_is_not_quite_known() {
        let [moved, _] = run(&mut law(0.85, 0.2), 0.0, 0.1, Vector2::zeros(), 20.0);
        assert!(moved.norm() < 1.5e-3, "{moved}");
        // Without the hold the same arm creeps away: the test can fail.
        let [moved, _] = run(&mut law(0.85, 0.0), 0.0, 0.1, Vector2::zeros(), 20.0);
        assert!(moved.norm() > 1.5e-3, "{moved}");
    }

    #[test]
    fn a_hand_needs_a_fraction_of_the_friction() {
        let hand = 0.4 * FRICTION;
        let moved = |share, hold| run(&mut law(share, hold), hand, 0.0, Vector2::zeros(), 1.0)[0][0];
        assert!(moved(0.85, 0.2) > 0.1, "{}", moved(0.85, 0.2));
        assert!(moved(0.0, 0.0) < 5e-3, "{}", moved(0.0, 0.0));
    }

    #[test]
    fn the_defaults_follow_the_larger_part_of_the_friction() {
        let soft = Softening::of(&TanhFriction::new([0.05, 11.0, 0.3, 800.0, 0.4]));
        approx::assert_relative_eq!(soft.fade, 2.5e-4, max_relative = 1e-12);
        approx::assert_relative_eq!(soft.hold, 0.0175, max_relative = 1e-12);
    }

    #[test]
    fn thrown_it_comes_to_rest() {
        let [_, dq] = run(&mut law(0.85, 0.2), 0.0, 0.0, Vector2::new(1.0, -1.5), 6.0);
        assert!(dq.norm() < 1e-3, "{dq}");
    }

    /// Work of the law's friction and hold over random closed motions of a joint: never given, up to what the
    /// spring stores.
    #[test]
    fn what_is_taken_off_never_exceeds_the_friction() {
        use rand::{RngExt, SeedableRng};
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let mut law = law(rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let waves: [[f64; 3]; 3] = std::array::from_fn(|_| {
                [rng.random_range(0.0..0.1), rng.random_range(0.2..9.0), rng.random_range(0.0..6.0)]
            });
            let (h, mut work) = (1e-3, 0.0);
            let arm = Planar::<2>::default();
            for k in 0..5000 {
                let t = f64::from(k) * h;
                let q: f64 = waves.iter().map(|[a, w, p]| a * (w * t + p).sin()).sum();
                let v: f64 = waves.iter().map(|[a, w, p]| a * w * (w * t + p).cos()).sum();
                let state = State { q: SVector::from([q, 0.0]), dq: SVector::from([v, 0.0]) };
                let push = law.torque(&arm, &state)[0] - arm.gravity(&state.q)[0];
                work += (push - FRICTION * (500.0 * v).tanh()) * v * h;
                assert!(work < 1.0 * 1e-3, "{work} J were given at {t} s");
            }
        }
    }
}
