//! How the joints are commanded, and the last commands of one joint: the set-points that have left, newest
//! first.

use core::fmt;

/// How the joints are commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ControlMode {
    /// Profile position: the drive plans the way to a target (rad).
    ProfilePosition,
    /// Velocity (rad/s).
    Velocity,
    /// Interpolated position: one point (rad) each SYNC.
    InterpolatedPosition,
    /// Current (A).
    Current,
}

impl ControlMode {
    /// All of them.
    pub const ALL: [ControlMode; 4] = [
        ControlMode::ProfilePosition,
        ControlMode::Velocity,
        ControlMode::InterpolatedPosition,
        ControlMode::Current,
    ];

    /// Whether set-points are positions.
    pub const fn is_position(self) -> bool {
        matches!(self, ControlMode::ProfilePosition | ControlMode::InterpolatedPosition)
    }
}

impl fmt::Display for ControlMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ControlMode::ProfilePosition => "profile position",
            ControlMode::Velocity => "velocity",
            ControlMode::InterpolatedPosition => "interpolated position",
            ControlMode::Current => "current",
        })
    }
}

/// Number of set-points that are kept. A drive follows its interpolation points some cycles late: the joint
/// is where one of the last of them was.
pub(super) const KEPT: usize = 8;

/// The set-points of one joint that have left, in rad, rad/s or A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Demand {
    points: [f64; KEPT],
}

impl Demand {
    /// Nothing but `value` for as long as is kept.
    pub(super) const fn at_rest(value: f64) -> Demand {
        Demand { points: [value; KEPT] }
    }

    /// Records the set-point that is sent next.
    pub(super) fn push(&mut self, value: f64) {
        self.points.rotate_right(1);
        if let Some(newest) = self.points.first_mut() {
            *newest = value;
        }
    }

    /// The last one.
    pub(super) const fn last(&self) -> f64 {
        self.points[0]
    }

    /// Velocity of the last step, per s of `period`.
    pub(super) fn velocity(&self, period: f64) -> f64 {
        (self.points[0] - self.points[1]) / period
    }

    /// The extrapolated position for a cycle without a new one: with the last velocity and acceleration,
    /// within the limits of both. It does not reverse: a joint that slows down comes to rest, and a joint at
    /// rest stays. A joint that could no longer come to rest before the end of its range (`position`, rad)
    /// brakes.
    pub(super) fn next(&self, period: f64, position: [f64; 2], velocity: f64, acceleration: f64) -> f64 {
        let v = self.velocity(period);
        let before = (self.points[1] - self.points[2]) / period;
        let most = acceleration * period;
        // Not `clamp`, which panics where a bound is not a number.
        let change = (v - before).max(-most).min(most);
        let mut next = (v + change).max(-velocity).min(velocity);
        let (last, [low, high]) = (self.points[0], position);
        let rest = rest(last + next * period, next, acceleration);
        if next > 0.0 && rest > high || next < 0.0 && rest < low {
            next = v - v.max(-most).min(most);
        }
        let next = last + if next * v > 0.0 { next * period } else { 0.0 };
        // Nothing outside its range goes further out.
        next.max(low.min(last)).min(high.max(last))
    }

    /// How far `actual` is from where a drive with any delay up to [`KEPT`] cycles would be: from the range
    /// of the last set-points. 0 within it, negative below it.
    pub(super) fn error(&self, actual: f64) -> f64 {
        let low = self.points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.points.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        actual - actual.max(low).min(high)
    }
}

/// Position at which a joint comes to rest that is at `position` (rad) with `velocity` (rad/s) and brakes
/// with `acceleration` (rad/s²).
pub(super) fn rest(position: f64, velocity: f64, acceleration: f64) -> f64 {
    position + velocity * velocity.abs() / (2.0 * acceleration)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: [f64; 2] = [-10.0, 10.0];

    /// Without any new set-point a joint that is on its way to the end of its range comes to rest before it,
    /// and never brakes harder than it may.
    #[test]
    fn what_goes_on_comes_to_rest_within_its_range() {
        let (period, acceleration) = (0.005, 4.0);
        for velocity in [0.02, 0.3, 1.2] {
            for side in [1.0, -1.0] {
                let mut demand = Demand::at_rest(0.0);
                let way = rest(0.0, velocity, acceleration) + 0.01;
                (0..KEPT).rev().for_each(|k| demand.push(side * (1.0 - way - velocity * period * k as f64)));
                let mut v = side * velocity;
                for _ in 0..400 {
                    demand.push(demand.next(period, [-1.0, 1.0], 1.2, acceleration));
                    let now = demand.velocity(period);
                    assert!((now - v).abs() <= acceleration * period * (1.0 + 1e-6), "{v} {now}");
                    v = now;
                }
                assert!(
                    v.abs() < 1e-9 && (0.95..=1.0).contains(&(side * demand.last())),
                    "{v} {}",
                    demand.last()
                );
            }
        }
    }

    #[test]
    fn what_is_missed_goes_on_as_it_went() {
        let period = 0.005;
        let mut demand = Demand::at_rest(0.0);
        let path = |k: i32| 0.5 * 2.0 * (period * f64::from(k)).powi(2);
        (1..=20).for_each(|k| demand.push(path(k)));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(demand.next(period, WIDE, 1.0, 4.0), path(21));
        // Within both limits, and not back.
        near(demand.next(period, WIDE, 0.1, 4.0), path(20) + 0.1 * period);
        near(demand.next(period, WIDE, 1.0, 0.0), path(20) + demand.velocity(period) * period);
        let mut slowing = Demand::at_rest(0.0);
        [0.0001, 0.00011].into_iter().for_each(|q| slowing.push(q));
        near(slowing.next(period, WIDE, 1.0, 100.0), 0.00011);
        near(Demand::at_rest(0.3).next(period, WIDE, 1.0, 4.0), 0.3);
    }

    #[test]
    fn a_late_follower_has_no_error_and_a_stuck_one_has_all_of_it() {
        let mut demand = Demand::at_rest(0.0);
        for k in 1..=20 {
            demand.push(0.01 * f64::from(k));
        }
        assert_eq!(demand.last(), 0.2);
        // Three cycles late, and ahead or behind by more than what is kept.
        assert_eq!(demand.error(0.17), 0.0);
        assert!((demand.error(0.25) - 0.05).abs() < 1e-12);
        assert!((demand.error(0.0) + 0.13).abs() < 1e-12);
    }
}
