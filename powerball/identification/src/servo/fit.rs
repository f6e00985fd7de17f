//! Output error: constants for which the simulated positions lie nearest to the measured ones.
//!
//! Levenberg–Marquardt on the soft absolute value 2c²·(√(1 + (r/c)²) − 1) of each error r (Triggs et al.,
//! *Bundle Adjustment*, 2000, section 4 for its weights): an error below c counts as a square, one above it
//! as its size, so that a joint that stops elsewhere does not decide the fit alone. Derivatives are central
//! differences: dry friction leaves small steps in the positions, and a step that is too short sees nothing
//! else.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use powerball_logs::parallel;

/// c, rad: about one degree.
const SOFT: f64 = 0.02;
/// Steps of the derivatives, in the parameters' own scales.
const DIFFERENCE: f64 = 3e-3;
/// A step that lowers the objective by less than this share has arrived.
const SETTLED: f64 = 1e-4;
/// Trials of a larger damping.
const TRIALS: usize = 8;
/// An error that is no number counts as this, rad.
const LOST: f64 = 10.0;

/// A parameter that is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// About how large it is: its unit in the fit.
    pub scale: f64,
    /// The value stays at or above this.
    pub least: f64,
}

/// What is fitted: the errors of each stretch of samples at given values.
pub trait Errors: Sync {
    /// Stretches, which are computed side by side.
    fn stretches(&self) -> usize;

    /// Simulated less measured positions of one, rad.
    fn of(&self, stretch: usize, values: &[f64]) -> Vec<f64>;
}

/// Where a fit has come to.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The parameters.
    pub values: Vec<f64>,
    /// The mean soft square of the errors, rad².
    pub objective: f64,
    /// The errors by stretch, rad.
    pub errors: Vec<Vec<f64>>,
}

/// The errors of all stretches.
#[must_use]
pub fn errors(of: &impl Errors, values: &[f64]) -> Vec<Vec<f64>> {
    let stretches: Vec<usize> = (0..of.stretches()).collect();
    let finite = |x: f64| if x.is_finite() { x.clamp(-LOST, LOST) } else { LOST };
    parallel::map(&stretches, |k| of.of(*k, values).into_iter().map(finite).collect())
}

/// The mean soft square of errors, rad².
#[must_use]
pub fn objective(errors: &[Vec<f64>]) -> f64 {
    let soft = |r: &f64| 2.0 * SOFT * SOFT * ((1.0 + (r / SOFT).powi(2)).sqrt() - 1.0);
    let count = errors.iter().map(Vec::len).sum::<usize>().max(1);
    errors.iter().flatten().map(soft).sum::<f64>() / count as f64
}

/// The weight of an error in the normal equations.
#[must_use]
pub fn weight(error: f64) -> f64 {
    1.0 / (1.0 + (error / SOFT).powi(2)).sqrt()
}

/// From a start to the nearest minimum, in at most `steps`.
#[must_use]
pub fn fit(of: &impl Errors, start: &[f64], free: &[Free], steps: usize) -> Fitted {
    let mut at = fitted(of, start.to_vec());
    let mut damping = 1e-2;
    for _ in 0..steps {
        let slopes = slopes(of, &at.values, free);
        let (normal, right) = normal_equations(&slopes, &at.errors, free.len());
        let before = at.objective;
        for _ in 0..TRIALS {
            let mut damped = normal.clone();
            for i in 0..free.len() {
                damped[(i, i)] += damping * normal[(i, i)] + f64::MIN_POSITIVE.sqrt();
            }
            let step = damped.llt(Side::Lower).ok().map(|factor| factor.solve(&right));
            let next = step.map(|step| {
                let moved = at.values.iter().zip(free).enumerate();
                fitted(of, moved.map(|(i, (x, f))| (x - f.scale * step[(i, 0)]).max(f.least)).collect())
            });
            if let Some(next) = next.filter(|next| next.objective < at.objective) {
                (at, damping) = (next, (0.3 * damping).max(1e-9));
                break;
            }
            damping *= 4.0;
        }
        if before - at.objective < SETTLED * before {
            break;
        }
    }
    at
}

fn fitted(of: &impl Errors, values: Vec<f64>) -> Fitted {
    let errors = errors(of, &values);
    Fitted { objective: objective(&errors), values, errors }
}

/// How the errors change with each parameter, in its scale: by parameter and stretch.
#[must_use]
pub fn slopes(of: &impl Errors, values: &[f64], free: &[Free]) -> Vec<Vec<Vec<f64>>> {
    let of_parameter = |(i, f): (usize, &Free)| -> Vec<Vec<f64>> {
        let moved = |by: f64| {
            let mut values = values.to_vec();
            values[i] = (values[i] + by * f.scale).max(f.least);
            (values[i], errors(of, &values))
        };
        let ((low, below), (high, above)) = (moved(-DIFFERENCE), moved(DIFFERENCE));
        let step = (high - low) / f.scale;
        let slope = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| (a - b) / step).collect();
        above.iter().zip(&below).map(slope).collect()
    };
    free.iter().enumerate().map(of_parameter).collect()
}

/// JᵀWJ and JᵀWr.
#[must_use]
pub fn normal_equations(slopes: &[Vec<Vec<f64>>], errors: &[Vec<f64>], size: usize) -> (Mat<f64>, Mat<f64>) {
    let (mut normal, mut right) = (Mat::zeros(size, size), Mat::zeros(size, 1));
    for (k, errors) in errors.iter().enumerate() {
        let weights: Vec<f64> = errors.iter().map(|r| weight(*r)).collect();
        for i in 0..size {
            let own = &slopes[i][k];
            right[(i, 0)] += own.iter().zip(errors).zip(&weights).map(|((s, r), w)| w * s * r).sum::<f64>();
            for j in 0..=i {
                let other = &slopes[j][k];
                normal[(i, j)] +=
                    own.iter().zip(other).zip(&weights).map(|((a, b), w)| w * a * b).sum::<f64>();
                normal[(j, i)] = normal[(i, j)];
            }
        }
    }
    (normal, right)
}
