//! What one joint was told last: the set-points that have left, newest first.

/// So many set-points are kept. A drive follows its interpolation points some cycles late: the joint is where one
/// of the last of them was.
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

    /// The next set-point leaves.
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

    /// Where positions go on to, for a cycle in which nothing new came: with the velocity and the acceleration that they
    /// had, within the limits of both. Not back: what slows down comes to rest.
    pub(super) fn next(&self, period: f64, velocity: f64, acceleration: f64) -> f64 {
        let v = self.velocity(period);
        let before = (self.points[1] - self.points[2]) / period;
        // Not `clamp`, which panics where a bound is no number.
        let change = (v - before).max(-acceleration * period).min(acceleration * period);
        let next = (v + change).max(-velocity).min(velocity);
        self.points[0] + if next * v < 0.0 { 0.0 } else { next * period }
    }

    /// How far `actual` is from where a drive with any delay up to [`KEPT`] cycles would be: from the range of the
    /// last set-points. 0 within it, negative below it.
    pub(super) fn error(&self, actual: f64) -> f64 {
        let low = self.points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.points.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        actual - actual.max(low).min(high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missed_goes_on_as_it_went() {
        let period = 0.005;
        let mut demand = Demand::at_rest(0.0);
        let path = |k: i32| 0.5 * 2.0 * (period * f64::from(k)).powi(2);
        (1..=20).for_each(|k| demand.push(path(k)));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(demand.next(period, 1.0, 4.0), path(21));
        // Within both limits, and not back.
        near(demand.next(period, 0.1, 4.0), path(20) + 0.1 * period);
        near(demand.next(period, 1.0, 0.0), path(20) + demand.velocity(period) * period);
        let mut slowing = Demand::at_rest(0.0);
        [0.0001, 0.00011].into_iter().for_each(|q| slowing.push(q));
        near(slowing.next(period, 1.0, 100.0), 0.00011);
        near(Demand::at_rest(0.3).next(period, 1.0, 4.0), 0.3);
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
