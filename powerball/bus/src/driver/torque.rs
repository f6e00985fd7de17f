//! The torque that set-points require of the joints, from a model of the arm: a check that limits of single
//! joints cannot make.

use super::cause::Rejection;
use super::demand::ControlMode;
use super::joint::Joint;
use super::profile::Profile;
use core::fmt;
use powerball_controller::JointNumber;

/// Inverse dynamics: what the joints need, N·m, for positions (rad), velocities (rad/s) and accelerations
/// (rad/s²).
type InverseDynamics<const N: usize> =
    dyn Fn(&[f64; N], &[f64; N], &[f64; N]) -> [f64; N] + Send + Sync + 'static;

/// A model of the arm's torque for the guard of set-points: its inverse dynamics, gravity and friction
/// included.
///
/// A function of the arm's generated code, or a closure over one with identified parameters; the driver calls
/// it once a cycle, so it must be quick, and on a controller it must not allocate.
#[derive(Clone, Copy)]
pub struct TorqueGuard<const N: usize> {
    model: &'static InverseDynamics<N>,
    margin: f64,
}

impl<const N: usize> TorqueGuard<N> {
    /// A guard with an arm's inverse dynamics (rad, rad/s, rad/s² → N·m).
    pub const fn new(inverse_dynamics: &'static InverseDynamics<N>) -> Self {
        TorqueGuard { model: inverse_dynamics, margin: 0.0 }
    }

    /// Allows a person to push the arm in current mode, with up to this part of each joint's torque.
    #[must_use]
    pub const fn with_push(self, part: f64) -> Self {
        TorqueGuard { margin: part, ..self }
    }

    /// The part of each joint's torque that a push may have.
    pub(super) const fn margin(&self) -> f64 {
        self.margin
    }

    /// N·m by joint.
    pub fn torque(&self, q: &[f64; N], dq: &[f64; N], ddq: &[f64; N]) -> [f64; N] {
        (self.model)(q, dq, ddq)
    }

    /// Whether the joints have the torque that `setpoints` require of them after those that have left.
    ///
    /// Interpolated positions are checked with the velocity and the acceleration of their differences,
    /// velocities with theirs where the joints are, targets of profile position at rest there: the drive
    /// plans the way. A current is a torque itself, and bounded as one.
    pub(super) fn check(
        &self,
        profile: &Profile<N>,
        mode: ControlMode,
        joints: &[Joint; N],
        setpoints: &[f64; N],
    ) -> Result<(), Rejection> {
        let period = profile.period_seconds();
        let (mut q, mut dq, mut ddq) = (*setpoints, [0.0; N], [0.0; N]);
        let places = q.iter_mut().zip(&mut dq).zip(&mut ddq);
        for (((q, dq), ddq), joint) in places.zip(joints) {
            match mode {
                ControlMode::Current => return Ok(()),
                ControlMode::ProfilePosition => {}
                ControlMode::InterpolatedPosition => {
                    *dq = (*q - joint.demand.last()) / period;
                    *ddq = (*dq - joint.demand.velocity(period)) / period;
                }
                ControlMode::Velocity => {
                    let velocity = core::mem::replace(q, joint.position);
                    (*dq, *ddq) = (velocity, (velocity - joint.demand.last()) / period);
                }
            }
        }
        let torques = self.torque(&q, &dq, &ddq);
        for (j, (torque, limits)) in torques.iter().zip(&profile.joints).enumerate() {
            // A model that gives NaN does not support the set-point.
            if torque.abs().partial_cmp(&limits.torque).is_none_or(core::cmp::Ordering::is_gt) {
                return Err(Rejection::Torque(JointNumber::from_index(j), *torque, limits.torque));
            }
        }
        Ok(())
    }
}

impl<const N: usize> fmt::Debug for TorqueGuard<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("TorqueGuard")
    }
}

#[cfg(test)]
mod tests {
    use super::super::demand::Demand;
    use super::super::lwa4p::LWA4P;
    use super::*;

    /// A pendulum on joint 1 and nothing else: 10 N·m sin q, 2 N·m·s/rad, 4 kg·m².
    static PENDULUM: TorqueGuard<6> = TorqueGuard::new(&|q, dq, ddq| {
        [10.0 * q[0].sin() + 2.0 * dq[0] + 4.0 * ddq[0], 0.0, 0.0, 0.0, 0.0, 0.0]
    });

    fn arm(last: f64, before: f64, position: f64) -> [Joint; 6] {
        let mut joints = LWA4P.joints.map(|joint| Joint::new(&joint, 1, 1));
        joints[0].demand = Demand::at_rest(before);
        joints[0].demand.push(last);
        joints[0].position = position;
        joints
    }

    fn judge(mode: ControlMode, joints: &[Joint; 6], value: f64, limit: f64) -> Option<f64> {
        let mut profile = LWA4P;
        profile.joints[0].torque = limit;
        let mut setpoints = [0.0; 6];
        setpoints[0] = value;
        match PENDULUM.check(&profile, mode, joints, &setpoints) {
            Ok(()) => None,
            Err(Rejection::Torque(j, torque, reported)) => {
                assert_eq!((j.index(), reported), (0, limit));
                Some(torque)
            }
            Err(other) => panic!("{other}"),
        }
    }

    /// Torques by hand: differences of positions, of velocities, and none.
    #[test]
    fn the_torque_is_that_of_the_motion_that_the_set_points_describe() {
        let near = |reported: Option<f64>, expected: f64| {
            let reported = reported.unwrap_or_else(|| panic!("{expected} N·m were let through"));
            assert!((reported - expected).abs() < 1e-6, "{reported} {expected}");
        };
        let (q, v, a) = (0.3f64, 0.2, 3.0);
        let (last, before) = (q - v * 0.005, q - 2.0 * v * 0.005 + a * 0.005 * 0.005);
        let expected = 10.0 * q.sin() + 2.0 * v + 4.0 * a;
        let joints = arm(last, before, 0.0);
        near(judge(ControlMode::InterpolatedPosition, &joints, q, expected - 1e-3), expected);
        assert_eq!(judge(ControlMode::InterpolatedPosition, &joints, q, expected + 1e-3), None);
        let joints = arm(v - a * 0.005, 0.0, q);
        near(judge(ControlMode::Velocity, &joints, v, expected - 1e-3), expected);
        assert_eq!(judge(ControlMode::Velocity, &joints, v, expected + 1e-3), None);
        let joints = arm(0.0, 0.0, 0.0);
        near(judge(ControlMode::ProfilePosition, &joints, q, 1.0), 10.0 * q.sin());
        assert_eq!(judge(ControlMode::Current, &joints, 5.0, 1e-9), None);
    }

    #[test]
    fn a_model_without_an_answer_lets_nothing_through() {
        let model: TorqueGuard<6> = TorqueGuard::new(&|_, _, _| [f64::NAN; 6]);
        let judged = model.check(&LWA4P, ControlMode::InterpolatedPosition, &arm(0.0, 0.0, 0.0), &[0.0; 6]);
        assert!(matches!(judged, Err(Rejection::Torque(..))));
    }
}
