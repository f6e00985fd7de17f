//! The probability of a name as a curve, fitted to one half of the drawn arms and judged on the other, and on
//! the names of every other set of cases.
//!
//! Logistic regression on what `explain` knows of a name (D. R. Cox, "The regression analysis of binary
//! sequences", 1958), by Newton's method with a small ridge.

use super::judge::{Named, Outcome};
use super::reliability::wilson;
use faer::Mat;
use faer::linalg::solvers::Solve;
use powerball::explanation::explain::{Evidence, FEATURES};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

/// Names in a bin of the reliability table.
const BIN: usize = 20;
/// Newton's steps, and how hard coefficients are held back (a prior of standard deviation 3).
const STEPS: usize = 50;
const RIDGE: f64 = 1.0 / 9.0;

/// Where the names come from and go to.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Results of `study`, whose names are written to the table first; those of other sets stay in it
    #[arg(long)]
    results: Option<PathBuf>,
    /// The table of names
    #[arg(long, default_value = "docs/results/names.csv")]
    names: PathBuf,
}

/// A name with what is known of it, and whether it is right.
struct Case {
    evidence: Evidence,
    features: [f64; FEATURES],
    unattributed: bool,
    right: bool,
}

const HEAD: &str = "set,case,effect,right,margin,alike,own_share,leftover,unattributed,fitted_time";

/// The set to which the curve is fitted: effects on arms drawn by lot.
const FITTED: &str = "drawn";

/// Prints the curve that fits the names of every other drawn case, how it does on the others, and how the
/// curve in use does on other sets.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: {e}", arguments.names.display());
    if let Some(results) = &arguments.results {
        let mut outcomes = super::read(results)?;
        outcomes.sort_by_key(|outcome| {
            let number = outcome.case.rsplit('/').next().and_then(|seed| seed.parse::<u64>().ok());
            (outcome.table.clone(), number)
        });
        let lines: Vec<String> =
            outcomes.iter().flat_map(|o| o.named.iter().filter_map(|named| line(o, named))).collect();
        let set = |line: &str| line.split(',').next().unwrap_or_default().to_string();
        let replaced: BTreeSet<String> = lines.iter().map(|line| set(line)).collect();
        let old = fs::read_to_string(&arguments.names).unwrap_or_default();
        let kept = old.lines().skip(1).filter(|line| !replaced.contains(&set(line))).map(String::from);
        let table: Vec<String> = std::iter::once(HEAD.to_string()).chain(kept).chain(lines).collect();
        fs::write(&arguments.names, table.join("\n") + "\n").map_err(failed)?;
    }
    let text = fs::read_to_string(&arguments.names).map_err(failed)?;
    let mut halves: [Vec<Case>; 2] = [Vec::new(), Vec::new()];
    let mut others: BTreeMap<String, Vec<Case>> = BTreeMap::new();
    let (mut last, mut half) = (String::new(), 0);
    for (k, line) in text.lines().enumerate().skip(1) {
        let (set, name, case) =
            case(line).ok_or_else(|| format!("{}: line {}: no name", arguments.names.display(), k + 1))?;
        if set != FITTED {
            others.entry(set.to_string()).or_default().push(case);
            continue;
        }
        // The names of one arm are of one half.
        if name != last {
            (half, last) = (1 - half, name.to_string());
        }
        halves[half].push(case);
    }
    let [judge, fit] = halves;
    print!("{}", curve(&fit, &judge));
    let in_use = |case: &Case| case.evidence.probability();
    for (set, cases) in &others {
        println!("\nthe curve in use on the {} names of the set {set}:\n", cases.len());
        print!("{}\nBrier score {:.4}\n", reliability(cases, &in_use), brier(cases, &in_use));
    }
    Ok(())
}

/// The set of a case: what is put into measured logs is of one set at any size.
fn set(outcome: &Outcome) -> &str {
    match outcome.table.as_str() {
        "measured-small" => "measured",
        table => table,
    }
}

fn line(outcome: &Outcome, named: &Named) -> Option<String> {
    let right = u8::from(outcome.names_truth(named));
    let alike = u8::from(!named.alike.is_empty());
    let unattributed = u8::from(named.joints.iter().any(|joint| outcome.left_on.contains(joint)));
    let Named { effect, margin, own_share, leftover, .. } = named;
    let (own_share, time) = ((*own_share)?, outcome.fitted_time);
    Some(format!(
        "{},{},{effect},{right},{margin:.4},{alike},{own_share:.4},{leftover:.4},{unattributed},{time:.1}",
        set(outcome),
        outcome.case
    ))
}

/// The set and the case of a line, and what the curve reads of it.
fn case(line: &str) -> Option<(&str, &str, Case)> {
    let cells: Vec<&str> = line.split(',').collect();
    let [set, name, _, right, margin, alike, _, leftover, unattributed, ..] = cells[..] else { return None };
    let evidence =
        Evidence { margin: margin.parse().ok()?, alike: alike == "1", leftover: leftover.parse().ok()? };
    let [unattributed, right] = [unattributed, right].map(|flag| flag == "1");
    Some((set, name, Case { evidence, features: evidence.features(), unattributed, right }))
}

/// The coefficients, and how the curve that they make does on names that were not fitted, compared with three
/// constants and with one.
fn curve(fit: &[Case], judge: &[Case]) -> String {
    let coefficients = fitted(fit);
    let mut out = format!("fitted to {} names: {coefficients:.3?}\n\n", fit.len());
    let curve = |case: &Case| probability(&coefficients, &case.features);
    out.push_str(&reliability(judge, &curve));
    let _ = writeln!(
        out,
        "\n\
         Brier score on the {} names that were not fitted: {:.4}; of the curve in use {:.4}; of three \
         constants {:.4}; of one, the share of the other half, {:.4}",
        judge.len(),
        brier(judge, &curve),
        brier(judge, &|case| case.evidence.probability()),
        brier(judge, &constants),
        brier(judge, &|_| share(fit))
    );
    out
}

/// What was stated before there was a curve.
fn constants(case: &Case) -> f64 {
    match case {
        Case { evidence: Evidence { alike: true, .. }, .. } => 0.5,
        Case { unattributed: true, .. } => 0.88,
        _ => 0.97,
    }
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

/// Names in order of the curve's probability, in bins of equal size.
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
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

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
            let evidence = Evidence { margin: 1.0, alike: false, leftover: 0.0 };
            Case { evidence, features, unattributed: false, right }
        };
        let cases: Vec<Case> = (0..4000).map(draw).collect();
        for (found, truth) in fitted(&cases).iter().zip(truth) {
            assert!((found - truth).abs() < 0.25, "{found} {truth}");
        }
        let curve = |case: &Case| probability(&truth, &case.features);
        assert!(brier(&cases, &curve) < brier(&cases, &|_| share(&cases)));
    }
}
