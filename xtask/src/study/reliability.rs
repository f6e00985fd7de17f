//! Whether names are right as often as their probability says.

use super::judge::Outcome;
use std::fmt::Write as _;
use std::ops::Range;

/// Bins of probabilities.
const BINS: [Range<f64>; 4] = [0.0..0.6, 0.6..0.8, 0.8..0.93, 0.93..1.01];

/// The reliability table: what was stated against what was true.
pub(super) fn table(outcomes: &[&Outcome]) -> String {
    let mut out = String::from(
        "| probability that was stated, mean | names | right | 95 % interval |\n|---|---|---|---|\n",
    );
    for bin in BINS {
        let mut stated = 0.0;
        let (mut names, mut right) = (0usize, 0usize);
        for outcome in outcomes {
            for named in &outcome.named {
                let Some(probability) = named.probability.filter(|p| bin.contains(p)) else { continue };
                stated += probability;
                names += 1;
                right += usize::from(outcome.names_truth(named));
            }
        }
        if names > 0 {
            let [low, high] = wilson(right, names).map(|share| 100.0 * share);
            let mean = 100.0 * stated / names as f64;
            let share = 100.0 * right as f64 / names as f64;
            let _ = writeln!(out, "| {mean:.0} % | {names} | {share:.0} % | {low:.0} to {high:.0} % |");
        }
    }
    out
}

/// Wilson's interval of a share, 95 %.
pub(super) fn wilson(right: usize, all: usize) -> [f64; 2] {
    const Z: f64 = 1.96;
    let (n, p) = (all as f64, right as f64 / all as f64);
    let (middle, scale) = (p + Z * Z / (2.0 * n), 1.0 + Z * Z / n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(middle - half) / scale, (middle + half) / scale]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_holds_its_share_and_is_that_of_a_table() {
        // Newcombe 1998, example 2: 15 of 148.
        let [low, high] = wilson(15, 148);
        assert!((low - 0.0624).abs() < 1e-4 && (high - 0.1605).abs() < 1e-4, "{low} {high}");
    }
}
