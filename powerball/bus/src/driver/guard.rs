//! Conditions that a set-point must meet before it is sent, and a whole path before the arm moves.

use super::cause::Rejection;
use super::demand::{ControlMode, Demand, rest};
use super::profile::{JointProfile, Profile, Reactions};
use powerball_controller::JointNumber;

/// The guard of one joint in one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guard<'a> {
    pub(super) mode: ControlMode,
    pub(super) joint: JointNumber,
    pub(super) profile: &'a JointProfile,
    pub(super) reactions: &'a Reactions,
    /// SYNC period, s.
    pub(super) period: f64,
    /// The set-points that left.
    pub(super) demand: &'a Demand,
    /// Measured position, rad.
    pub(super) position: f64,
}

impl Guard<'_> {
    /// Whether `value` (rad, rad/s or A by the mode) may leave.
    pub(super) fn check(&self, value: f64) -> Result<(), Rejection> {
        let (j, limits) = (self.joint, self.profile);
        if !value.is_finite() {
            return Err(Rejection::NotFinite(j));
        }
        match self.mode {
            ControlMode::ProfilePosition => self.inside(value),
            ControlMode::InterpolatedPosition => {
                self.inside(value)?;
                self.step(value, limits.velocity * self.period * self.reactions.step_factor)?;
                self.accelerate(value)?;
                self.stoppable(value)
            }
            ControlMode::Velocity => {
                if value.abs() > limits.velocity {
                    return Err(Rejection::Velocity(j, value, limits.velocity));
                }
                // Where the joint would come to rest if it braked now; only what leads outwards is rejected.
                self.outwards(value, rest(self.position, value, limits.acceleration))?;
                self.step(value, limits.acceleration * self.period * self.reactions.step_factor)
            }
            ControlMode::Current => {
                if value.abs() > limits.current {
                    return Err(Rejection::Current(j, value, limits.current));
                }
                self.outwards(value, self.position)?;
                self.step(value, limits.current * self.reactions.current_step)
            }
        }
    }

    fn inside(&self, position: f64) -> Result<(), Rejection> {
        let ([low, high], margin) = (self.profile.position, self.reactions.position_margin);
        // A joint that stands outside may be moved back: never further out than it is.
        let low = low.min(self.position) - margin;
        let high = high.max(self.position) + margin;
        match position {
            q if q < low => Err(Rejection::Position(self.joint, q, low)),
            q if q > high => Err(Rejection::Position(self.joint, q, high)),
            _ => Ok(()),
        }
    }

    fn outwards(&self, value: f64, position: f64) -> Result<(), Rejection> {
        let ([low, high], margin) = (self.profile.position, self.reactions.position_margin);
        if value < 0.0 && position < low - margin {
            Err(Rejection::Position(self.joint, position, low - margin))
        } else if value > 0.0 && position > high + margin {
            Err(Rejection::Position(self.joint, position, high + margin))
        } else {
            Ok(())
        }
    }

    /// The second difference of positions. What two counts of the encoder make of it is rounding.
    fn accelerate(&self, value: f64) -> Result<(), Rejection> {
        let limit = self.profile.acceleration * self.reactions.step_factor + self.rounding() / self.period;
        let velocity = (value - self.demand.last()) / self.period;
        let acceleration = (velocity - self.demand.velocity(self.period)) / self.period;
        if acceleration.abs() > limit {
            return Err(Rejection::Acceleration(self.joint, acceleration, limit));
        }
        Ok(())
    }

    /// Velocity that the rounding of positions to counts can feign, rad/s.
    fn rounding(&self) -> f64 {
        2.0 / (self.profile.units.counts_per_radian.abs() * self.period)
    }

    /// After this point the joint can still come to rest within its range, whatever comes next, or nothing.
    fn stoppable(&self, value: f64) -> Result<(), Rejection> {
        let velocity = (value - self.demand.last()) / self.period;
        let slower = (velocity.abs() - self.rounding()).max(0.0).copysign(velocity);
        let limit = self.profile.acceleration * self.reactions.step_factor;
        self.outwards(velocity, rest(value, slower, limit))
    }

    fn step(&self, value: f64, limit: f64) -> Result<(), Rejection> {
        let step = value - self.demand.last();
        if step.abs() > limit { Err(Rejection::Jump(self.joint, step, limit)) } else { Ok(()) }
    }
}

/// Whether the driver accepts a whole path in interpolated position mode, sample by sample, from rest at its
/// first sample to rest at its last. The guard is the one that checks each set-point when it is sent.
///
/// # Errors
/// The first sample, from 0, that it does not accept, and the reason. One past the last means that the path
/// does not end at rest.
pub fn check_path<const N: usize>(
    profile: &Profile<N>,
    path: impl IntoIterator<Item = [f64; N]>,
) -> Result<(), (usize, Rejection)> {
    let mut demands: Option<[Demand; N]> = None;
    let mut check = |k: usize, sample: &[f64; N]| {
        let demands = demands.get_or_insert_with(|| sample.map(Demand::at_rest));
        for (j, ((joint, demand), value)) in profile.joints.iter().zip(&mut *demands).zip(sample).enumerate()
        {
            let number = JointNumber::from_index(j);
            // No joint stands outside its limits before the arm moves: within them means strictly.
            let position = 0.5 * (joint.position[0] + joint.position[1]);
            let (mode, reactions) = (ControlMode::InterpolatedPosition, &profile.reactions);
            let period = profile.period_seconds();
            Guard { mode, joint: number, profile: joint, reactions, period, demand, position }
                .check(*value)
                .map_err(|rejection| (k, rejection))?;
            demand.push(*value);
        }
        Ok(())
    };
    let (mut count, mut last) = (0, None);
    for sample in path {
        check(count, &sample)?;
        (count, last) = (count + 1, Some(sample));
    }
    last.map_or(Ok(()), |last| check(count, &last))
}

#[cfg(test)]
mod tests {
    use super::super::lwa4p::LWA4P;
    use super::*;

    const FIRST: JointNumber = JointNumber::from_index(0);

    /// The guard of a joint that rested at `last`.
    fn guard(mode: ControlMode, last: f64, position: f64) -> Guard<'static> {
        moving(mode, Box::leak(Box::new(Demand::at_rest(last))), position)
    }

    fn moving(mode: ControlMode, demand: &Demand, position: f64) -> Guard<'_> {
        let profile = &LWA4P.joints[0];
        Guard { mode, joint: FIRST, profile, reactions: &LWA4P.reactions, period: 0.005, demand, position }
    }

    #[test]
    fn not_a_number_never_leaves() {
        for mode in ControlMode::ALL {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert_eq!(guard(mode, 0.0, 0.0).check(value), Err(Rejection::NotFinite(FIRST)));
            }
        }
    }

    /// Set-points that have moved by `step` each cycle for a while, the last one at 0.1.
    fn run_up(step: f64) -> Demand {
        let mut demand = Demand::at_rest(0.1);
        (0..8).rev().for_each(|k| demand.push(0.1 - step * f64::from(k)));
        demand
    }

    #[test]
    fn interpolated_steps_end_at_the_greatest_velocity() {
        let step = LWA4P.joints[0].velocity * 0.005;
        let demand = run_up(step);
        let guard = moving(ControlMode::InterpolatedPosition, &demand, 0.1);
        assert_eq!(guard.check(0.1 + step), Ok(()));
        assert!(matches!(guard.check(0.1 + 1.1 * step), Err(Rejection::Jump(FIRST, ..))));
    }

    /// ± 3 mrad a cycle is slow enough for every limit of the velocity, and 480 rad/s².
    #[test]
    fn interpolated_points_must_not_accelerate_too_much() {
        let mode = ControlMode::InterpolatedPosition;
        let bound = LWA4P.joints[0].acceleration;
        let after = |step: f64, acceleration: f64| {
            let demand = run_up(step);
            moving(mode, &demand, 0.1).check(0.1 + step + acceleration * 0.005 * 0.005)
        };
        for step in [0.0, 0.003, -0.003] {
            for sign in [1.0, -1.0] {
                assert_eq!(after(step, sign * bound), Ok(()));
                let much = after(step, sign * 1.5 * bound);
                assert!(matches!(much, Err(Rejection::Acceleration(FIRST, ..))), "{much:?}");
            }
        }
        assert!(matches!(guard(mode, 0.1, 0.1).check(0.103), Err(Rejection::Acceleration(..))));
        let demand = run_up(0.003);
        let back = moving(mode, &demand, 0.1).check(0.097);
        assert!(
            matches!(back, Err(Rejection::Acceleration(_, a, _)) if (a + 240.0).abs() < 1e-6),
            "{back:?}"
        );
    }

    /// At full velocity the way to rest is 0.17 rad: nearer to the end of the range such a point does not
    /// leave.
    #[test]
    fn interpolated_points_leave_room_to_come_to_rest() {
        let joint = &LWA4P.joints[0];
        let (v, high) = (joint.velocity, joint.position[1]);
        let way = v * v / (2.0 * 1.05 * joint.acceleration);
        let at = |q: f64| {
            let mut demand = Demand::at_rest(q);
            (1..8).rev().for_each(|k| demand.push(q - v * 0.005 * f64::from(k)));
            moving(ControlMode::InterpolatedPosition, &demand, q).check(q)
        };
        assert_eq!(at(high - way), Ok(()));
        assert!(matches!(at(high - 0.97 * way), Err(Rejection::Position(..))), "{:?}", at(high - 0.97 * way));
    }

    #[test]
    fn a_whole_path_is_checked_before_the_arm_moves() {
        let swing = |amplitude: f64, steps: usize| {
            (0..=steps).map(move |k| {
                let w = core::f64::consts::TAU * k as f64 / 400.0;
                [0.0, 0.0, amplitude * (1.0 - w.cos()), 0.0, 0.0, 0.0]
            })
        };
        assert_eq!(check_path(&LWA4P, swing(0.4, 400)), Ok(()));
        // 9.87 rad/s² for each rad of amplitude; and a path that ends while it moves.
        let third = JointNumber::from_index(2);
        let (k, why) = check_path(&LWA4P, swing(0.7, 400)).unwrap_err();
        assert!(matches!(why, Rejection::Acceleration(j, ..) if j == third) && k <= 2, "{k}: {why}");
        let (k, why) = check_path(&LWA4P, swing(0.38, 100)).unwrap_err();
        assert!(matches!(why, Rejection::Acceleration(j, ..) if j == third) && k == 101, "{k}: {why}");
        let far = (0..3).map(|_| [0.0, 0.0, 2.8, 0.0, 0.0, 0.0]);
        assert!(matches!(check_path(&LWA4P, far), Err((0, Rejection::Position(j, ..))) if j == third));
    }

    #[test]
    fn a_joint_outside_its_limits_may_only_come_back() {
        let high = LWA4P.joints[0].position[1];
        let guard = |mode, last| guard(mode, last, high + 0.02);
        let positions = guard(ControlMode::InterpolatedPosition, high + 0.02);
        assert_eq!(positions.check(high + 0.0199), Ok(()));
        assert!(matches!(positions.check(high + 0.021), Err(Rejection::Position(..))));
        let velocities = guard(ControlMode::Velocity, 0.0);
        assert_eq!(velocities.check(-0.01), Ok(()));
        assert!(matches!(velocities.check(0.01), Err(Rejection::Position(..))));
        assert!(matches!(guard(ControlMode::Current, 0.0).check(0.01), Err(Rejection::Position(..))));
    }

    /// At velocity v a joint needs v²/2a to stop: the guard sees the limit that far ahead.
    #[test]
    fn velocities_are_rejected_where_the_joint_could_not_stop_before_its_limit() {
        let joint = &LWA4P.joints[0];
        let v = joint.velocity;
        let way = v * v / (2.0 * joint.acceleration);
        let at = |q| guard(ControlMode::Velocity, v, q).check(v);
        assert_eq!(at(joint.position[1] - 1.01 * way), Ok(()));
        assert!(matches!(at(joint.position[1] - 0.99 * way), Err(Rejection::Position(..))));
    }
}
