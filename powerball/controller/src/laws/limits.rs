//! Limits of torque and of its rate.

use nalgebra::{RealField, SVector};

/// Cuts torques to what joints have and to how fast it may change; the last stage of every controller.
///
/// NaN is replaced by the last torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limiter<T, const N: usize> {
    /// Greatest torque by joint, N·m.
    pub torque: SVector<T, N>,
    /// Greatest change by joint, N·m/s.
    pub rate: SVector<T, N>,
    last: SVector<T, N>,
}

impl<T: RealField + Copy, const N: usize> Limiter<T, N> {
    /// Limits of torque, N·m, and rate, N·m/s; the last torque is `from`.
    #[must_use]
    pub fn new(torque: SVector<T, N>, rate: SVector<T, N>, from: SVector<T, N>) -> Self {
        Limiter { torque, rate, last: from }
    }

    /// The torque that may be sent after a cycle of `period` s.
    pub fn limit(&mut self, asked: &SVector<T, N>, period: T) -> SVector<T, N> {
        for (((last, asked), most), rate) in self.last.iter_mut().zip(asked).zip(&self.torque).zip(&self.rate)
        {
            if asked.is_finite() {
                let step = *rate * period;
                // Not `clamp`, which panics where a bound is not a number.
                let near = asked.max(*last - step).min(*last + step);
                *last = near.max(-*most).min(*most);
            }
        }
        self.last
    }

    /// The torque that was sent last, N·m.
    #[must_use]
    pub fn last(&self) -> &SVector<T, N> {
        &self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn torque_and_rate_hold_and_no_number_changes_nothing() {
        let mut limiter = Limiter::new(Vector2::new(10.0, 2.0), Vector2::new(100.0, 1e3), Vector2::zeros());
        assert_eq!(limiter.limit(&Vector2::new(50.0, -50.0), 0.01), Vector2::new(1.0, -2.0));
        assert_eq!(limiter.limit(&Vector2::new(f64::NAN, f64::INFINITY), 0.01), Vector2::new(1.0, -2.0));
        (0..20).for_each(|_| {
            limiter.limit(&Vector2::new(50.0, 0.0), 0.01);
        });
        assert_eq!(*limiter.last(), Vector2::new(10.0, 0.0));
    }
}
