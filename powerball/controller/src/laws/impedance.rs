//! Joint impedance: springs and dampers at the joints.

use super::number;
use crate::dynamics::{ArmModel, Reference, State};
use nalgebra::{RealField, SMatrix, SVector};

/// τ = K·(q_r − q) + D·(q̇_r − q̇) + B(q)·q̈_r + C(q, q̇)·q̇_r + g(q): PD+ (Paden and Panja, *Globally
/// asymptotically stable PD+ controller*, Int. J. Control 47, 1988), as impedance of Hogan (*Impedance
/// Control*, 1985).
///
/// V = ½·ėᵀB·ė + ½·eᵀK·e has V̇ = −ėᵀD·ė − ėᵀτ_ext, because Ḃ − 2C is skew: the arm is passive towards what
/// touches it for K, D ≥ 0, and errors vanish without contact. Sampled and late this holds up to the
/// stiffness at which [`super::largest_pole`] reaches 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointImpedance<T, const N: usize> {
    /// K, N·m/rad.
    pub stiffness: SVector<T, N>,
    /// D, N·m·s/rad.
    pub damping: SVector<T, N>,
}

impl<T: RealField + Copy, const N: usize> JointImpedance<T, N> {
    /// Springs that let each joint, with its own inertia at a pose, swing at `bandwidth` rad/s with the
    /// damping ratio `ratio`: K = ω²·B_jj, D = 2·ζ·ω·B_jj.
    #[must_use]
    pub fn of_inertia(inertia: &SMatrix<T, N, N>, bandwidth: T, ratio: T) -> Self {
        let own = inertia.diagonal();
        JointImpedance {
            stiffness: own * (bandwidth * bandwidth),
            damping: own * (number::<T>(2.0) * ratio * bandwidth),
        }
    }

    /// The torque, N·m, of rigid arm and springs; the state of a late controller as for
    /// [`ComputedTorque`](super::ComputedTorque::torque).
    #[must_use]
    pub fn torque(
        &self,
        model: &impl ArmModel<T, N>,
        state: &State<T, N>,
        reference: &Reference<T, N>,
    ) -> SVector<T, N> {
        let springs = self.stiffness.component_mul(&(reference.q - state.q))
            + self.damping.component_mul(&(reference.dq - state.dq));
        // C(q, x)·y is symmetric in x and y for Christoffel's C, so two of its squares give it.
        let square = |dq: SVector<T, N>| model.coriolis_times_velocity(&state.q, &dq);
        let coriolis =
            (square(state.dq + reference.dq) - square(state.dq - reference.dq)) * number::<T>(0.25);
        springs + model.mass_matrix(&state.q) * reference.ddq + coriolis + model.gravity(&state.q)
    }

    /// K and D as matrices.
    #[must_use]
    pub fn stiffness_and_damping(&self) -> [SMatrix<T, N, N>; 2] {
        [&self.stiffness, &self.damping].map(SMatrix::from_diagonal)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_arm::{Planar, Sampled};
    use super::*;
    use nalgebra::Vector3;

    /// ½q̇ᵀBq̇ + ½eᵀKe of an arm that is thrown, without the law's own friction or the arm's.
    #[test]
    fn energy_never_grows_at_a_fixed_reference() {
        let arm = Planar::<3>::default();
        let law = JointImpedance {
            stiffness: Vector3::new(30.0, 20.0, 10.0),
            damping: Vector3::new(2.0, 1.0, 0.5),
        };
        let goal = Reference::at_rest(Vector3::new(0.3, -0.4, 0.8));
        let mut plant = Sampled::new(&arm, Vector3::new(0.9, 0.2, -0.3), Vector3::new(2.0, -3.0, 4.0));
        let energy = |s: &State<f64, 3>| {
            let e = goal.q - s.q;
            0.5 * s.dq.dot(&arm.momentum(&s.q, &s.dq)) + 0.5 * e.dot(&law.stiffness.component_mul(&e))
        };
        let start = energy(&plant.state);
        let mut before = start;
        for _ in 0..40_000 {
            plant.advance(&law.torque(&arm, &plant.state, &goal), 1e-4, 1);
            let now = energy(&plant.state);
            assert!(now <= before + 1e-6 * start, "{now} after {before}");
            before = now;
        }
        assert!(before < 0.05 * start, "{before} of {start}");
    }

    /// Sampled at 200 Hz and a cycle late, pressed with the second joint against a wall of 20 kN·m/rad. On a
    /// wall without any loss the delay keeps it bouncing by some mm; a wall with a loss holds it.
    #[test]
    fn contact_with_a_stiff_wall_stays_bounded() {
        let arm = Planar::<3>::default();
        let q0 = Vector3::new(0.2, 0.4, 0.3);
        let law = JointImpedance::of_inertia(&arm.mass_matrix(&q0), 8.0, 1.0);
        let goal = Reference::at_rest(q0 + Vector3::new(0.0, 0.3, 0.0));
        let press = |loss: f64| {
            let mut plant = Sampled::new(&arm, q0, Vector3::zeros());
            plant.wall = Some((q0[1] + 0.1, 20_000.0, loss));
            let mut waiting = law.torque(&arm, &plant.state, &Reference::at_rest(q0));
            let (mut fastest, mut farthest) = (0.0f64, 0.0f64);
            for _ in 0..2000 {
                let next = law.torque(&arm, &plant.state, &goal);
                plant.advance(&waiting, 0.005, 100);
                waiting = next;
                fastest = fastest.max(plant.state.dq.norm());
                farthest = farthest.max(plant.state.q[1] - (q0[1] + 0.1));
            }
            (fastest, farthest, plant.state)
        };
        let (fastest, farthest, _) = press(0.0);
        assert!(fastest < 1.5 && farthest < 5e-3, "{fastest} rad/s, {farthest} rad");
        let (fastest, farthest, state) = press(20.0);
        let contact = state.q[1] - (q0[1] + 0.1);
        assert!(fastest < 1.5 && farthest < 5e-3, "{fastest} rad/s, {farthest} rad");
        assert!(contact > 0.0 && state.dq.norm() < 1e-6, "{contact} {state:?}");
    }
}
