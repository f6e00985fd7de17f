//! The probability of a name as a curve, fitted to the names of all sets of cases, and judged on each set by
//! the curve that is fitted to the others.
//!
//! Logistic regression on what `explain` knows of a name (D. R. Cox, "The regression analysis of binary
//! sequences", 1958), by Newton's method with a small ridge.

use super::judge::{Named, Outcome};
use super::reliability::wilson;
use faer::Mat;
use faer::linalg::solvers::Solve;
use powerball::explanation::Rule;
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
#[derive(Clone)]
struct Case {
    evidence: Evidence,
    features: [f64; FEATURES],
    right: bool,
}

const HEAD: &str = "set,case,effect,right,margin,alike,own_share,leftover,unattributed,fitted_time";

/// Prints the curve that fits all names, and how stated probabilities compare with how often names are right:
/// by set, those of the curve in use and of a curve fitted to the other sets.
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
    let mut sets: BTreeMap<String, Vec<Case>> = BTreeMap::new();
    for (k, line) in text.lines().enumerate().skip(1) {
        let (set, case) =
            case(line).ok_or_else(|| format!("{}: line {}: no name", arguments.names.display(), k + 1))?;
        sets.entry(set.to_string()).or_default().push(case);
    }
    print!("{}", judged(&sets));
    Ok(())
}

/// The set of a case: its table, or the measured arm whose logs it is of.
fn set(outcome: &Outcome) -> &str {
    match outcome.table.as_str() {
        "measured-arms" => outcome.case.split('/').nth(2).unwrap_or_default(),
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

/// The set of a line, and what the curve reads of it.
fn case(line: &str) -> Option<(&str, Case)> {
    let cells: Vec<&str> = line.split(',').collect();
    let [set, _, _, right, margin, alike, _, leftover, _, time] = cells[..] else { return None };
    let evidence = Evidence {
        margin: margin.parse().ok()?,
        alike: alike == "1",
        leftover: leftover.parse().ok()?,
        time: time.parse::<f64>().ok()? / Rule::default().least_time,
    };
    Some((set, Case { evidence, features: evidence.features(), right: right == "1" }))
}

/// The coefficients, and how the curve does by set.
fn judged(sets: &BTreeMap<String, Vec<Case>>) -> String {
    let all: Vec<Case> = sets.values().flatten().cloned().collect();
    let mut out = format!("fitted to {} names: {:.3?}\n\n", all.len(), fitted(&all));
    out.push_str(
        "| set | names | right | 95 % interval | stated by the curve in use | by one fitted to the other sets | \
         Brier scores of these | of the others' share |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mut left_out: Vec<(f64, bool)> = Vec::new();
    for (set, cases) in sets {
        let others: Vec<Case> =
            sets.iter().filter(|(other, _)| *other != set).flat_map(|(_, c)| c.clone()).collect();
        let coefficients = fitted(&others);
        let curve = |case: &Case| probability(&coefficients, &case.features);
        let in_use = |case: &Case| case.evidence.probability();
        let right = cases.iter().filter(|case| case.right).count();
        let [low, high] = wilson(right, cases.len()).map(|share| 100.0 * share);
        let mean =
            |curve: &dyn Fn(&Case) -> f64| 100.0 * cases.iter().map(curve).sum::<f64>() / cases.len() as f64;
        let _ = writeln!(
            out,
            "| `{set}` | {} | {:.0} % | {low:.0} to {high:.0} % | {:.0} % | {:.0} % | {:.3}, {:.3} | {:.3} |",
            cases.len(),
            100.0 * share(cases),
            mean(&in_use),
            mean(&curve),
            brier(cases, &in_use),
            brier(cases, &curve),
            brier(cases, &|_| share(&others))
        );
        left_out.extend(cases.iter().map(|case| (curve(case), case.right)));
    }
    let _ = write!(out, "\nall sets, each by the curve fitted to the others:\n\n{}", reliability(left_out));
    out
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

/// Names with their probability and whether they are right, in order of it, in bins of equal size.
fn reliability(mut sorted: Vec<(f64, bool)>) -> String {
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
            let evidence = Evidence { margin: 1.0, alike: false, leftover: 0.0, time: 1.0 };
            Case { evidence, features, right }
        };
        let cases: Vec<Case> = (0..4000).map(draw).collect();
        for (found, truth) in fitted(&cases).iter().zip(truth) {
            assert!((found - truth).abs() < 0.25, "{found} {truth}");
        }
        let curve = |case: &Case| probability(&truth, &case.features);
        assert!(brier(&cases, &curve) < brier(&cases, &|_| share(&cases)));
    }

    /// A set whose names are right less often shows it by the curve of the others, which it did not shape.
    #[test]
    fn a_set_is_judged_by_the_curve_of_the_others() {
        let evidence = Evidence { margin: 2.0, alike: false, leftover: 0.1, time: 1.0 };
        let names = |right: usize| -> Vec<Case> {
            (0..100).map(|k| Case { evidence, features: evidence.features(), right: k < right }).collect()
        };
        let sets = BTreeMap::from([("easy", 90), ("hard", 40)].map(|(set, n)| (set.to_string(), names(n))));
        let table = judged(&sets);
        let line = |set: &str| table.lines().find(|l| l.contains(set)).unwrap_or_default().to_string();
        let cells = |set: &str| line(set).split('|').map(|c| c.trim().to_string()).collect::<Vec<_>>();
        assert_eq!((cells("easy")[3].as_str(), cells("hard")[3].as_str()), ("90 %", "40 %"));
        assert_eq!((cells("easy")[6].as_str(), cells("hard")[6].as_str()), ("40 %", "90 %"));
    }
}
