//! Do 95 % intervals cover the truth in 95 % of the experiments?

use super::plant::{record, sensors, truth};
use crate::estimate::{FrictionLaw, errors, identify, solve_reduced};
use crate::regression::DataOptions;
use crate::summary::Summary;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Counts how often intervals cover, by parameter: by Student's t, and by ±1.96 standard errors. Every experiment has paths
/// and a noise colour of its own.
fn coverage(experiments: u64, logs: usize, periods: usize) -> Vec<(String, [usize; 2], f64)> {
    let (body, truth) = truth();
    let options = DataOptions::default();
    let mut counts: Vec<(String, [usize; 2], f64)> =
        body.names().iter().map(|n| (n.clone(), [0; 2], 0.0)).collect();
    for seed in 0..experiments {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut sensors = sensors();
        // From a tenth of a second, within the band, to three, slower than the motion; stronger than the white part in the band.
        sensors.colour_time = 0.1 * 30f64.powf(rng.random_range(0.0..1.0));
        sensors.coloured.iter_mut().for_each(|s| *s *= 2.0);
        let mut summary = Summary::new(&body, &options);
        for log in record(&sensors, logs, periods, seed) {
            summary.push(&body, &log, &options).unwrap();
        }
        let solution = solve_reduced(&summary, FrictionLaw::Symmetric);
        let found = identify(body.names(), &solution, &errors(&solution));
        for ((count, estimate), truth) in counts.iter_mut().zip(&found.parameters).zip(&truth) {
            let [low, high] = estimate.interval.unwrap();
            let std = estimate.std.unwrap();
            count.1[0] += usize::from(low <= *truth && *truth <= high);
            count.1[1] += usize::from((estimate.value - truth).abs() <= 1.96 * std);
            count.2 += (estimate.value - truth) / std / experiments as f64;
        }
    }
    counts
}

fn share(counts: &[(String, [usize; 2], f64)], experiments: u64, which: usize) -> f64 {
    let covered: usize = counts.iter().map(|(_, c, _)| c[which]).sum();
    covered as f64 / (counts.len() as u64 * experiments) as f64
}

/// A study: `cargo test --release -p powerball --lib coverage -- --ignored --nocapture`.
#[test]
#[ignore = "a study of minutes; the short one below guards what it found"]
fn intervals_cover_the_truth_in_a_hundred_experiments() {
    for (logs, periods) in [(1, 6), (3, 6)] {
        let counts = coverage(100, logs, periods);
        println!("{logs} logs of {} s, 100 experiments", 10 * periods);
        for (name, [t, normal], bias) in &counts {
            println!("  {t:3} % by t, {normal:3} % by ±1.96 std, mean error {bias:5.2} std  {name}");
        }
        let (t, normal) = (share(&counts, 100, 0), share(&counts, 100, 1));
        println!("  all: {:.1} % by t, {:.1} % by ±1.96 std", 100.0 * t, 100.0 * normal);
        assert!((0.90..=0.98).contains(&t) && (0.90..=0.98).contains(&normal));
    }
}

#[test]
fn intervals_cover_the_truth() {
    // 12 experiments of 23 parameters: the share's own standard error is about 2 %.
    let counts = coverage(12, 1, 4);
    let covered = share(&counts, 12, 0);
    assert!((0.89..=0.99).contains(&covered), "{covered}");
}
