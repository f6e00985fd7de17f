//! External torques without a torque sensor: the momentum observer.

use super::number;
use crate::dynamics::{ArmModel, State};
use nalgebra::{Matrix6, RealField, SMatrix, SVector, Vector6};

/// r = K·(p − ∫(τ + Cᵀ·q̇ − g + r)dt − p(0)) with p = B·q̇ (De Luca and Mattone, *Sensorless robot collision
/// detection and hybrid force/motion control*, ICRA 2005; Haddadin, De Luca, Albu-Schäffer, *Robot
/// collisions: a survey*, T-RO 33, 2017).
///
/// ṙ = K·(τ_ext − r): each joint's external torque through a low pass of its own, for any motion, without
/// acceleration. Errors of the model count as external torque, friction included, so give it τ less the
/// friction of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumObserver<T, const N: usize> {
    /// Angular frequency of the low pass, rad/s.
    pub bandwidth: T,
    momentum: Option<SVector<T, N>>,
    drift: SVector<T, N>,
    external: SVector<T, N>,
}

impl<T: RealField + Copy, const N: usize> MomentumObserver<T, N> {
    /// An observer with a low pass of `bandwidth` rad/s.
    #[must_use]
    pub fn new(bandwidth: T) -> Self {
        let none = SVector::zeros();
        MomentumObserver { bandwidth, momentum: None, drift: none, external: none }
    }

    /// Called once a cycle of `period` s with the present state and the torque on the rigid arm that acted
    /// since the last call (motor torque less friction and effects), N·m. Returns the external torques, N·m.
    /// The first call only initialises.
    ///
    /// Discretised with the exact pole e^(−K·T); Cᵀq̇ − g by the trapezoidal rule. A state that is not a
    /// number changes nothing.
    pub fn advance(
        &mut self,
        model: &impl ArmModel<T, N>,
        state: &State<T, N>,
        torque: &SVector<T, N>,
        period: T,
    ) -> SVector<T, N> {
        let momentum = model.momentum(&state.q, &state.dq);
        let drift = model.coriolis_transpose_times_velocity(&state.q, &state.dq) - model.gravity(&state.q);
        let finite = |x: &SVector<T, N>| x.iter().all(|x| x.is_finite());
        if !(finite(&momentum) && finite(&drift) && finite(torque)) {
            return self.external;
        }
        if let Some(before) = self.momentum {
            let keep = (-self.bandwidth * period).exp();
            let known = torque + (self.drift + drift) * number::<T>(0.5);
            // The mean external torque of the cycle, exactly: Δp/T less what is known.
            let seen = (momentum - before) / period - known;
            self.external = self.external * keep + seen * (T::one() - keep);
        }
        (self.momentum, self.drift) = (Some(momentum), drift);
        self.external
    }

    /// External torques by joint, N·m.
    #[must_use]
    pub fn external(&self) -> &SVector<T, N> {
        &self.external
    }
}

/// Force and moment on the tool's frame that external torques at the joints fit best: (J·Jᵀ +
/// λ²·I)⁻¹·J·τ_ext, N above N·m, in base axes. `damping` is λ² (m², rad²), which bounds what a singular pose
/// cannot tell.
///
/// `None` where J is not a number.
#[must_use]
pub fn tool_force<T: RealField + Copy, const N: usize>(
    jacobian: &SMatrix<T, 6, N>,
    external: &SVector<T, N>,
    damping: T,
) -> Option<Vector6<T>> {
    let square = jacobian * jacobian.transpose() + Matrix6::from_diagonal_element(damping);
    square.cholesky().map(|c| c.solve(&(jacobian * external)))
}

#[cfg(test)]
mod tests {
    use super::super::test_arm::{Planar, Sampled};
    use super::*;
    use crate::dynamics::ToolModel;
    use nalgebra::{Vector3, Vector4};

    /// A swinging arm that is pushed from 1 s on: the low pass of the push, in between nothing.
    #[test]
    fn a_push_is_seen_as_its_low_pass_while_the_arm_moves() {
        let arm = Planar::<3>::default();
        let (w, h) = (50.0, 1e-3);
        let mut observer = MomentumObserver::<f64, 3>::new(w);
        let mut plant = Sampled::new(&arm, Vector3::new(0.3, 0.8, -0.5), Vector3::new(0.5, -0.2, 0.8));
        let push = Vector3::new(1.5, -2.0, 0.7);
        observer.advance(&arm, &plant.state, &Vector3::zeros(), h);
        for k in 0..2000 {
            let t = f64::from(k) * h;
            let torque = arm.gravity(&plant.state.q) + Vector3::new((3.0 * t).sin(), -(2.0 * t).cos(), 0.5);
            plant.external = if k < 1000 { Vector3::zeros() } else { push };
            plant.advance(&torque, h, 4);
            let seen = observer.advance(&arm, &plant.state, &torque, h);
            let since = (f64::from(k) - 999.0).max(0.0) * h;
            let expected = push * (1.0 - (-w * since).exp());
            assert!((seen - expected).norm() < 5e-3, "{t}: {seen} {expected}");
        }
    }

    #[test]
    fn a_force_at_the_tool_is_found_by_least_squares() {
        let arm = Planar::<4>::default();
        let q = Vector4::new(0.5, 0.9, -0.7, 0.6);
        let j = arm.jacobian(&q);
        // A wrench that a planar arm can feel.
        let force = Vector6::new(12.0, -7.0, 0.0, 0.0, 0.0, 1.5);
        let found = tool_force(&j, &(j.transpose() * force), 1e-9).unwrap();
        assert!((found - force).norm() < 1e-4, "{found}");
        // Stretched out along x a force along x cannot be felt; what is found stays bounded.
        let stretched = arm.jacobian(&Vector4::zeros());
        let noise = Vector4::new(0.1, -0.1, 0.1, -0.1);
        assert!(tool_force(&stretched, &noise, 1e-2).unwrap().norm() < 10.0);
    }
}
