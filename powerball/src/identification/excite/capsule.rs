//! Capsules: line segments with a radius, and how far two of them are apart.

use nalgebra::Vector3;

/// The axis of a capsule, from one end to the other, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// One end.
    pub from: Vector3<f64>,
    /// The other.
    pub to: Vector3<f64>,
}

impl Segment {
    /// Length, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.to - self.from).norm()
    }

    /// The point at a share of the way.
    #[must_use]
    pub fn at(&self, share: f64) -> Vector3<f64> {
        self.from + (self.to - self.from) * share
    }

    /// What is left when lengths (m) are cut off at both ends; `None` where nothing is.
    #[must_use]
    pub fn cut(&self, at_from: f64, at_to: f64) -> Option<Segment> {
        let length = self.length();
        (at_from + at_to < length || at_from + at_to == 0.0).then(|| {
            let share = |cut: f64| if length > 0.0 { cut / length } else { 0.0 };
            Segment { from: self.at(share(at_from)), to: self.at(1.0 - share(at_to)) }
        })
    }

    /// Shortest distance to another segment, m.
    ///
    /// The square of the distance is a convex quadratic of the two places along the segments, so its minimum
    /// over the unit square is that of the lines, or lies on an edge, where it is the nearest place to an
    /// end.
    #[must_use]
    pub fn distance(&self, other: &Segment) -> f64 {
        let (u, v, w) = (self.to - self.from, other.to - other.from, self.from - other.from);
        let (a, b, c, d, e) = (u.dot(&u), u.dot(&v), v.dot(&v), u.dot(&w), v.dot(&w));
        let determinant = a * c - b * b;
        let inside = (determinant > 1e-12 * a * c)
            .then(|| ((b * e - c * d) / determinant, (a * e - b * d) / determinant));
        if let Some((s, t)) = inside.filter(|(s, t)| (0.0..=1.0).contains(s) && (0.0..=1.0).contains(t)) {
            return (w + u * s - v * t).norm();
        }
        let ends = [
            other.distance_to(&self.from),
            other.distance_to(&self.to),
            self.distance_to(&other.from),
            self.distance_to(&other.to),
        ];
        ends.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Shortest distance to a point, m.
    #[must_use]
    pub fn distance_to(&self, point: &Vector3<f64>) -> f64 {
        let along = self.to - self.from;
        let square = along.norm_squared();
        let share =
            if square > 0.0 { ((point - self.from).dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
        (point - self.at(share)).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Against the distance of many points on both, which is never below the truth and little above it.
    #[test]
    fn distances_are_those_of_the_nearest_of_many_points() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        const POINTS: usize = 200;
        for case in 0..300 {
            let mut point = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let mut a = Segment { from: point(), to: point() };
            let mut b = Segment { from: point(), to: point() };
            match case % 6 {
                // Points, parallels, one line, a common end.
                0 => a.to = a.from,
                1 => b.to = b.from + (a.to - a.from) * 0.7,
                2 => b = Segment { from: a.at(1.3), to: a.at(1.9) },
                3 => b.from = a.to,
                _ => {}
            }
            let places = || (0..=POINTS).map(|k| k as f64 / POINTS as f64);
            let sampled = places()
                .flat_map(|s| places().map(move |t| (s, t)))
                .map(|(s, t)| (a.at(s) - b.at(t)).norm())
                .fold(f64::INFINITY, f64::min);
            let exact = a.distance(&b);
            let grid = (a.length() + b.length()) / POINTS as f64;
            assert!(exact <= sampled + 1e-12 && sampled <= exact + grid, "{case}: {exact} {sampled}");
            approx::assert_abs_diff_eq!(exact, b.distance(&a), epsilon = 1e-9);
        }
    }

    #[test]
    fn a_segment_is_cut_from_both_ends() {
        let line = Segment { from: Vector3::zeros(), to: Vector3::new(0.0, 0.0, 2.0) };
        let rest = line.cut(0.5, 0.25).unwrap();
        assert_eq!((rest.from.z, rest.to.z), (0.5, 1.75));
        assert!(line.cut(1.5, 0.5).is_none());
        assert_eq!(line.cut(0.0, 0.0), Some(line));
    }
}
