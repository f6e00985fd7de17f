//! Computed torque: inverse dynamics with a PD of the acceleration.

use super::number;
use crate::dynamics::{ArmModel, Reference, State};
use nalgebra::{RealField, SMatrix, SVector};

/// τ = B(q)·(q̈_r + K_p·e + K_d·ė) + C(q, q̇)·q̇ + g(q) with e = q_r − q (Siciliano, Sciavicco, Villani,
/// Oriolo: *Robotics*, §8.5.2; Spong, Hutchinson, Vidyasagar, §8.3).
///
/// With the true model ë + K_d·ė + K_p·e = 0 at each joint: exponentially stable for positive gains. A model
/// that is wrong by Δτ leaves e = (B·K_p)⁻¹·Δτ at rest. Sampled and late it is stable where
/// [`super::largest_pole`] says so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComputedTorque<T, const N: usize> {
    /// K_p, 1/s².
    pub proportional: SVector<T, N>,
    /// K_d, 1/s.
    pub derivative: SVector<T, N>,
}

impl<T: RealField + Copy, const N: usize> ComputedTorque<T, N> {
    /// Critically damped errors of `bandwidth` rad/s at every joint: K_p = ω², K_d = 2ω.
    #[must_use]
    pub fn of_bandwidth(bandwidth: T) -> Self {
        ComputedTorque {
            proportional: SVector::from_element(bandwidth * bandwidth),
            derivative: SVector::from_element(bandwidth * number(2.0)),
        }
    }

    /// The default for a cycle of `period` s: ω = 0.1/period. With a hold and a cycle of delay 58° of phase
    /// margin are left.
    #[must_use]
    pub fn for_period(period: T) -> Self {
        Self::of_bandwidth(number::<T>(0.1) / period)
    }

    /// The torque, N·m, of rigid arm and feedback.
    ///
    /// A controller that acts a cycle late gives the reference of the time at which its torque acts, and the
    /// state carried on to there along the reference: `q` = that reference's position less the error that was
    /// measured.
    #[must_use]
    pub fn torque(
        &self,
        model: &impl ArmModel<T, N>,
        state: &State<T, N>,
        reference: &Reference<T, N>,
    ) -> SVector<T, N> {
        let error = reference.q - state.q;
        let rate = reference.dq - state.dq;
        let acceleration =
            reference.ddq + self.proportional.component_mul(&error) + self.derivative.component_mul(&rate);
        model.mass_matrix(&state.q) * acceleration
            + model.coriolis_times_velocity(&state.q, &state.dq)
            + model.gravity(&state.q)
    }

    /// B·K_p and B·K_d: stiffness, N·m/rad, and damping, N·m·s/rad, at a pose.
    #[must_use]
    pub fn stiffness_and_damping(&self, inertia: &SMatrix<T, N, N>) -> [SMatrix<T, N, N>; 2] {
        [&self.proportional, &self.derivative].map(|gain| inertia * SMatrix::from_diagonal(gain))
    }
}

/// An integrator of errors that does not wind up: it waits where the torque is cut, unless the error leads
/// away from the limit (conditional integration; Åström and Hägglund: *PID Controllers*, §3.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrator<T, const N: usize> {
    /// N·m for each rad·s; 0 switches a joint's off.
    pub gain: SVector<T, N>,
    /// Greatest torque that it may hold, N·m.
    pub bound: SVector<T, N>,
    held: SVector<T, N>,
}

impl<T: RealField + Copy, const N: usize> Integrator<T, N> {
    /// One that holds nothing yet.
    #[must_use]
    pub fn new(gain: SVector<T, N>, bound: SVector<T, N>) -> Self {
        Integrator { gain, bound, held: SVector::zeros() }
    }

    /// The integrator's torque, N·m.
    #[must_use]
    pub fn torque(&self) -> &SVector<T, N> {
        &self.held
    }

    /// A cycle of `period` s with an error e = q_r − q, rad, in which `asked` was requested and `sent` was
    /// sent.
    pub fn advance(&mut self, error: &SVector<T, N>, asked: &SVector<T, N>, sent: &SVector<T, N>, period: T) {
        for j in 0..N {
            let cut = asked[j] - sent[j];
            let more = self.held[j] + self.gain[j] * error[j] * period;
            if cut * error[j] <= T::zero() && more.is_finite() {
                self.held[j] = more.max(-self.bound[j]).min(self.bound[j]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Limiter;
    use super::super::test_arm::{Planar, Sampled};
    use super::*;
    use nalgebra::{Vector1, Vector3};

    /// Both joints of the error's equation: e of a continuous controller is (1 + ωt)·e₀·exp(−ωt).
    #[test]
    fn errors_decay_as_their_equation_says_whatever_the_arm_does() {
        let arm = Planar::<3>::default();
        let law = ComputedTorque::<f64, 3>::of_bandwidth(12.0);
        let wave = |t: f64| Reference {
            q: Vector3::new(t.sin(), (1.3 * t).cos(), 0.5 * t),
            dq: Vector3::new(t.cos(), -1.3 * (1.3 * t).sin(), 0.5),
            ddq: Vector3::new(-t.sin(), -1.69 * (1.3 * t).cos(), 0.0),
        };
        let begin = wave(0.0);
        let off = Vector3::new(0.1, -0.2, 0.15);
        let mut plant = Sampled::new(&arm, begin.q - off, begin.dq + 0.0 * off);
        let (h, w) = (1e-4, 12.0);
        // ė(0) = 0 needs no change of the velocity.
        for k in 0..3000 {
            let t = f64::from(k) * h;
            let e = wave(t).q - plant.state.q;
            let expected = off * (1.0 + w * t) * (-w * t).exp();
            assert!((e - expected).norm() < 2e-3, "{t}: {e} {expected}");
            let torque = law.torque(&arm, &plant.state, &wave(t));
            plant.advance(&torque, h, 1);
        }
    }

    #[test]
    fn sampled_and_a_cycle_late_the_default_gains_hold_a_pose() {
        let arm = Planar::<3>::default();
        let law = ComputedTorque::for_period(0.005);
        let goal = Reference::at_rest(Vector3::new(0.4, 0.8, -0.5));
        let mut plant = Sampled::new(&arm, Vector3::new(0.0, 0.5, 0.2), Vector3::zeros());
        let mut waiting = law.torque(&arm, &plant.state, &goal);
        for _ in 0..400 {
            let next = law.torque(&arm, &plant.state, &goal);
            plant.advance(&waiting, 0.005, 10);
            waiting = next;
        }
        assert!((plant.state.q - goal.q).norm() < 1e-6 && plant.state.dq.norm() < 1e-6, "{:?}", plant.state);
    }

    /// A torque limit holds a joint away from its goal for 10 s; once free it comes back without overshooting
    /// by more than it would have after 0 s.
    #[test]
    fn an_integrator_does_not_wind_up_at_a_limit() {
        let overshoot = |held_for: usize, anti_windup: bool| {
            let mut integrator = Integrator::new(Vector1::new(60.0), Vector1::new(1e6));
            let (mut q, mut dq, mut most) = (0.0f64, 0.0f64, 0.0f64);
            for k in 0..held_for + 3000 {
                let free = k >= held_for;
                let mut limiter = Limiter::new(
                    Vector1::new(if free { 1e3 } else { 5.0 }),
                    Vector1::new(1e9),
                    Vector1::zeros(),
                );
                let error = Vector1::new(1.0 - q);
                let asked = 100.0 * error - Vector1::new(20.0 * dq) + integrator.torque();
                let sent = limiter.limit(&asked, 1e-3);
                let judged = if anti_windup { sent } else { asked };
                integrator.advance(&error, &asked, &judged, 1e-3);
                if free {
                    dq += sent[0] * 1e-3;
                    q += dq * 1e-3;
                    most = most.max(q - 1.0);
                }
            }
            most
        };
        let fresh = overshoot(0, true);
        assert!((overshoot(10_000, true) - fresh).abs() < 1e-6);
        assert!(overshoot(10_000, false) > 5.0 * fresh.max(0.1));
    }
}
