//! The probability of a name as a curve, fitted to one half of the cases and judged on the other.
//!
//! Logistic regression on what `explain` knows of a name (D. R. Cox, "The regression analysis of binary sequences", 1958),
//! by Newton's method with a small ridge.

use super::judge::{Named, Outcome};
use super::reliability::wilson;
use faer::Mat;
use faer::linalg::solvers::Solve;
use std::fmt::Write as _;

/// What is known of a name besides what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Evidence {
    /// Its penalised gain over that of the next best name.
    margin: f64,
    /// Whether another name fits as well.
    alike: bool,
    /// The share of its squared torque that no other column can take over.
    own_share: f64,
    /// Share of the excess over noise that stays on its joints.
    leftover: f64,
    /// How long the fitted logs are, s.
    fitted_time: f64,
}

/// Numbers that the curve is linear in.
const FEATURES: usize = 6;

/// A larger margin says no more.
const LARGEST_MARGIN: f64 = 20.0;
/// Nor does a smaller share of its own.
const LEAST_SHARE: f64 = 0.01;

impl Evidence {
    /// What the logit of the probability is linear in: 1, whether another name fits as well, the logarithms of the margin
    /// and of the own share, what is left over, the logarithm of the time in minutes.
    fn features(&self) -> [f64; FEATURES] {
        [
            1.0,
            f64::from(u8::from(self.alike)),
            self.margin.clamp(1.0, LARGEST_MARGIN).ln(),
            self.own_share.clamp(LEAST_SHARE, 1.0).ln(),
            self.leftover.clamp(0.0, 1.0),
            (self.fitted_time / 60.0).clamp(0.1, 10.0).ln(),
        ]
    }
}

/// Names in a bin of the reliability table.
const BIN: usize = 20;
/// Newton's steps, and how hard coefficients are held back (a prior of standard deviation 3).
const STEPS: usize = 50;
const RIDGE: f64 = 1.0 / 9.0;

/// A name with what is known of it, and whether it is right.
struct Case {
    features: [f64; FEATURES],
    stated: f64,
    right: bool,
}

/// Fits the curve to the outcomes in odd places, and prints its coefficients and how it does on the others.
pub(super) fn curve(outcomes: &[Outcome]) -> String {
    let mut halves: [Vec<Case>; 2] = [Vec::new(), Vec::new()];
    for (k, outcome) in outcomes.iter().enumerate() {
        halves[k % 2].extend(outcome.named.iter().filter_map(|named| case(outcome, named)));
    }
    let [judge, fit] = halves;
    let coefficients = fitted(&fit);
    let mut out = format!("fitted to {} names: {coefficients:.3?}\n\n", fit.len());
    let curve = |case: &Case| probability(&coefficients, &case.features);
    out.push_str(&reliability(&judge, &curve));
    let _ = writeln!(
        out,
        "\nBrier score on the {} names that were not fitted: {:.4}, of what was stated {:.4}, of their mean {:.4}",
        judge.len(),
        brier(&judge, &curve),
        brier(&judge, &|case| case.stated),
        brier(&judge, &|_| share(&fit))
    );
    out
}

fn case(outcome: &Outcome, named: &Named) -> Option<Case> {
    let evidence = Evidence {
        margin: named.margin,
        alike: !named.alike.is_empty(),
        own_share: named.own_share?,
        leftover: named.leftover,
        fitted_time: outcome.fitted_time,
    };
    let right = outcome.names_truth(named);
    Some(Case { features: evidence.features(), stated: named.probability?, right })
}

fn probability(coefficients: &[f64; FEATURES], features: &[f64; FEATURES]) -> f64 {
    let sum: f64 = coefficients.iter().zip(features).map(|(c, x)| c * x).sum();
    1.0 / (1.0 + (-sum).exp())
}

/// The coefficients of the logistic regression.
fn fitted(cases: &[Case]) -> [f64; FEATURES] {
    let mut coefficients = [0.0; FEATURES];
    for _ in 0..STEPS {
        let mut gradient = Mat::<f64>::zeros(FEATURES, 1);
        let mut curvature = Mat::<f64>::zeros(FEATURES, FEATURES);
        for case in cases {
            let p = probability(&coefficients, &case.features);
            for i in 0..FEATURES {
                gradient[(i, 0)] += (f64::from(u8::from(case.right)) - p) * case.features[i];
                for k in 0..FEATURES {
                    curvature[(i, k)] += p * (1.0 - p) * case.features[i] * case.features[k];
                }
            }
        }
        // The constant is not held back.
        for i in 0..FEATURES {
            curvature[(i, i)] += if i == 0 { 1e-9 } else { RIDGE };
            gradient[(i, 0)] -= if i == 0 { 0.0 } else { RIDGE * coefficients[i] };
        }
        let step = curvature.partial_piv_lu().solve(&gradient);
        coefficients.iter_mut().enumerate().for_each(|(i, c)| *c += step[(i, 0)].clamp(-2.0, 2.0));
    }
    coefficients
}

/// Names in order of what the curve says of them, in bins of equal size.
fn reliability(cases: &[Case], curve: &dyn Fn(&Case) -> f64) -> String {
    let mut sorted: Vec<(f64, bool)> = cases.iter().map(|case| (curve(case), case.right)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out = String::from("| probability, mean | names | right | 95 % interval |\n|---|---|---|---|\n");
    let bins = (sorted.len() / BIN).clamp(1, 10);
    for bin in 0..bins {
        let of = &sorted[bin * sorted.len() / bins..(bin + 1) * sorted.len() / bins];
        let right = of.iter().filter(|(_, right)| *right).count();
        let mean = of.iter().map(|(p, _)| p).sum::<f64>() / of.len().max(1) as f64;
        let [low, high] = wilson(right, of.len()).map(|share| 100.0 * share);
        let _ = writeln!(
            out,
            "| {:.0} % | {} | {:.0} % | {low:.0} to {high:.0} % |",
            100.0 * mean,
            of.len(),
            100.0 * right as f64 / of.len() as f64
        );
    }
    out
}

fn brier(cases: &[Case], curve: &dyn Fn(&Case) -> f64) -> f64 {
    let square = |case: &Case| (curve(case) - f64::from(u8::from(case.right))).powi(2);
    cases.iter().map(square).sum::<f64>() / cases.len().max(1) as f64
}

fn share(cases: &[Case]) -> f64 {
    cases.iter().filter(|case| case.right).count() as f64 / cases.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Cases drawn by a curve give its coefficients back, within their errors.
    #[test]
    fn a_curve_is_found_again() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut truth = [0.0; FEATURES];
        (truth[0], truth[1], truth[2]) = (1.0, 2.0, -1.0);
        let draw = |_| {
            let mut features = [0.0; FEATURES];
            features.iter_mut().for_each(|x| *x = rng.random_range(-1.0..1.0));
            features[0] = 1.0;
            let right = rng.random_bool(probability(&truth, &features));
            Case { features, stated: 0.9, right }
        };
        let cases: Vec<Case> = (0..4000).map(draw).collect();
        for (found, truth) in fitted(&cases).iter().zip(truth) {
            assert!((found - truth).abs() < 0.25, "{found} {truth}");
        }
        let curve = |case: &Case| probability(&truth, &case.features);
        assert!(brier(&cases, &curve) < brier(&cases, &|case| case.stated));
    }
}
