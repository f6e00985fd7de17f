//! One joint's friction curves side by side.
//!
//! Two questions are asked of a curve: is it off at any of a few velocities, and is viscous friction another
//! one? The second takes all velocities together (generalised least squares on a line through zero), and sees what
//! no single velocity tells: errors of the curves at several velocities are those of the same few coefficients.
//! Half of a joint's share of the level goes to each.

use super::difference::Difference;
use super::result::FrictionDifference;
use super::side::Side;
use crate::identification::estimate::Solver;
use faer::Mat;

/// Friction is compared at these shares of the rms velocity: where it breaks loose, where it bends, and where
/// the joint is as fast as it gets.
const VELOCITIES: [f64; 5] = [0.1, 0.3, 0.7, 1.2, 1.8];
/// rad/s, where the logs' velocities are not known.
const ORDINARY: f64 = 0.5;

/// The friction of one joint in both fits.
pub(super) struct Curves {
    /// Joint, from 0.
    joint: usize,
    points: Vec<Point>,
    /// How much steeper `b`'s curve is, where the covariance of both tells it.
    steeper: Option<Difference>,
}

/// A velocity, both frictions there and their difference.
struct Point {
    velocity: f64,
    a: f64,
    b: f64,
    difference: Difference,
}

impl Curves {
    /// Of every joint whose friction both know.
    pub(super) fn of(a: &Side, b: &Side) -> Vec<Curves> {
        let known = |j: &usize| a.knows_friction(*j) && b.knows_friction(*j);
        (0..a.friction.len()).filter(known).map(|j| Curves::of_joint(a, b, j)).collect()
    }

    fn of_joint(a: &Side, b: &Side, joint: usize) -> Curves {
        let top = match (a.velocity(joint), b.velocity(joint)) {
            (Some(a), Some(b)) => a.min(b),
            (one, other) => one.or(other).unwrap_or(ORDINARY),
        };
        let at = |share: f64| {
            let velocity = share * top;
            let (own, other) = (a.friction_at(joint, velocity), b.friction_at(joint, velocity));
            Point { velocity, a: own.0, b: other.0, difference: Difference::of(own, other) }
        };
        let points: Vec<Point> = VELOCITIES.into_iter().map(at).collect();
        let steeper = steeper(a, b, joint, &points);
        Curves { joint, points, steeper }
    }

    /// The mean over velocities of squared differences over their variance: 1 where the curves differ as their errors
    /// say.
    pub(super) fn surprise(&self) -> Option<f64> {
        let of = |p: &Point| p.difference.value.powi(2) / p.difference.variance;
        let all: Vec<f64> = self.points.iter().map(of).filter(|z| z.is_finite()).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }

    /// How many numbers are compared.
    pub(super) fn points(&self) -> usize {
        self.points.len()
    }

    /// What differs: intervals miss with probability `p` each, and equal curves are called different with
    /// probability `share`.
    pub(super) fn difference(&self, p: f64, share: f64) -> FrictionDifference {
        let of = |what: &dyn Fn(&Point) -> f64| self.points.iter().map(what).collect::<Vec<f64>>();
        let relative = |[low, high]: [f64; 2], size: f64| match size.abs() {
            0.0 => [f64::NEG_INFINITY, f64::INFINITY],
            size => [low / size, high / size],
        };
        let surest =
            self.points.iter().min_by(|x, y| x.difference.p_value().total_cmp(&y.difference.p_value()));
        let at_points = surest.map_or(1.0, |s| self.points.len() as f64 * s.difference.p_value());
        let on_the_line = self.steeper.map_or(1.0, Difference::p_value);
        let asked = if self.steeper.is_some() { 2.0 } else { 1.0 };
        let change = match (surest, self.steeper, self.points.last()) {
            // Seen in the slope alone: what it makes of the friction where the joint is fastest.
            (_, Some(steeper), Some(fast)) if asked * at_points >= share && asked * on_the_line < share => {
                relative(steeper.interval(share / asked).map(|end| end * fast.velocity), fast.a)
            }
            (Some(surest), ..) => {
                relative(surest.difference.interval(share / (asked * self.points.len() as f64)), surest.a)
            }
            _ => [0.0; 2],
        };
        let p_value = (asked * at_points.min(on_the_line)).min(1.0);
        FrictionDifference {
            joint: self.joint + 1,
            velocities: of(&|r| r.velocity),
            a: of(&|r| r.a),
            b: of(&|r| r.b),
            difference: of(&|r| r.difference.value),
            interval: self.points.iter().map(|r| r.difference.interval(p)).collect(),
            change,
            p_value,
            differs: p_value < share,
        }
    }
}

/// The slope of the difference as a line through zero, N·m·s/rad, by generalised least squares.
fn steeper(a: &Side, b: &Side, joint: usize, points: &[Point]) -> Option<Difference> {
    let velocities: Vec<f64> = points.iter().map(|r| r.velocity).collect();
    let (own, other) =
        (a.friction_covariance(joint, &velocities)?, b.friction_covariance(joint, &velocities)?);
    let covariance = Mat::from_fn(points.len(), points.len(), |i, k| own[i][k] + other[i][k]);
    let weighted = Solver::new(&covariance, |_| true).solve(&velocities);
    let sum = |x: &dyn Fn(usize) -> f64| (0..points.len()).map(|k| weighted[k] * x(k)).sum::<f64>();
    let known = sum(&|k| velocities[k]);
    (known > 0.0 && known.is_finite()).then(|| Difference {
        value: sum(&|k| points[k].difference.value) / known,
        variance: known.recip(),
        freedom: points.iter().map(|r| r.difference.freedom).fold(f64::INFINITY, f64::min),
    })
}
