//! Do 95 % intervals cover the truth in 95 % of the experiments?

use super::plant::{record, record_slow, sensors, truth};
use crate::estimate::{
    FrictionKind, InBand, Uncertainty, estimates, friction_row, reduce_in_bands, solve_in_band,
    standard_errors,
};
use chacha20::ChaCha8Rng;
use powerball_controller::friction::TanhFriction;
use powerball_logs::regression::DataOptions;
use powerball_logs::summary::{BANDS, Bands};
use rand::{RngExt, SeedableRng};

/// Stronger than the white part in the band.
const COLOUR: f64 = 2.0;

/// By parameter: how often intervals cover, by Student's t and by ±1.96 standard errors, and the mean error
/// over the standard error.
type Counts = Vec<(String, [usize; 2], f64)>;

/// Counts, and how many joints stood in each band. Every experiment has paths and a noise colour of its own,
/// and its joints the bands that its logs ask for; its coloured part is `colour` times as strong as that of
/// the sensors.
fn coverage(experiments: u64, logs: usize, periods: usize, colour: f64) -> (Counts, [usize; BANDS.len()]) {
    let (body, truth) = truth();
    let options = DataOptions::default();
    let mut counts: Counts = body.names().iter().map(|n| (n.clone(), [0; 2], 0.0)).collect();
    let mut in_band = [0; BANDS.len()];
    for seed in 0..experiments {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut sensors = sensors();
        // From a tenth of a second, within the band, to three, slower than the motion.
        sensors.colour_time = 0.1 * 30f64.powf(rng.random_range(0.0..1.0));
        sensors.coloured.iter_mut().for_each(|s| *s *= colour);
        let mut reduced = Bands::new(&body, &options);
        for log in record(&sensors, logs, periods, seed) {
            reduced.merge(&reduce_in_bands(&body, &log, &options).unwrap().0).unwrap();
        }
        let InBand { solution, bands } = solve_in_band(&reduced, FrictionKind::Symmetric);
        bands.iter().for_each(|band| in_band[*band] += 1);
        let found = estimates(body.names(), &solution, &standard_errors(&solution));
        for ((count, estimate), truth) in counts.iter_mut().zip(&found.parameters).zip(&truth) {
            let [low, high] = estimate.interval.unwrap();
            let std = estimate.std.unwrap();
            count.1[0] += usize::from(low <= *truth && *truth <= high);
            count.1[1] += usize::from((estimate.value - truth).abs() <= 1.96 * std);
            count.2 += (estimate.value - truth) / std / experiments as f64;
        }
    }
    (counts, in_band)
}

fn share(counts: &[(String, [usize; 2], f64)], experiments: u64, which: usize) -> f64 {
    let covered: usize = counts.iter().map(|(_, c, _)| c[which]).sum();
    covered as f64 / (counts.len() as u64 * experiments) as f64
}

/// A study: `cargo test --release -p powerball-identification --lib coverage -- --ignored --nocapture`.
#[test]
#[ignore = "a study of minutes; the short one below guards what it found"]
fn intervals_cover_the_truth_in_a_hundred_experiments() {
    for (logs, periods, colour) in [(1, 6, COLOUR), (3, 6, COLOUR), (1, 6, 0.0)] {
        let (counts, in_band) = coverage(100, logs, periods, colour);
        println!(
            "{logs} logs of {} s, colour {colour}, 100 experiments; joints in {BANDS:?} Hz: {in_band:?}",
            10 * periods
        );
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
    let (counts, _) = coverage(12, 1, 4, COLOUR);
    let covered = share(&counts, 12, 0);
    assert!((0.89..=0.99).contains(&covered), "{covered}");
}

/// Friction of one term: both terms of the fit have nearly one steepness on some joints, and their
/// coefficients cancel each other at every velocity.
#[test]
fn friction_of_one_term_has_errors_at_every_velocity() {
    let (body, _) = truth();
    let options = DataOptions::default();
    let friction = [3.0, 4.0, 2.0, 2.0, 1.0, 1.0].map(|level| TanhFriction::new([level, 9.0, 0.0, 9.0, 1.0]));
    let (mut of_one_steepness, mut squares) = (0, Vec::new());
    for seed in 0..6 {
        let mut reduced = Bands::new(&body, &options);
        for log in record_slow(1.0, friction.to_vec(), &sensors(), 1, seed) {
            reduced.merge(&reduce_in_bands(&body, &log, &options).unwrap().0).unwrap();
        }
        let InBand { solution, .. } = solve_in_band(&reduced, FrictionKind::Symmetric);
        let errors = Uncertainty::of(body.names(), &solution, &standard_errors(&solution));
        for (joint, shape) in solution.shapes.iter().enumerate() {
            of_one_steepness += usize::from((shape[0] / shape[1]).ln().abs() < 0.11);
            for velocity in [0.05, 0.2, 0.5] {
                let row = friction_row(*shape, velocity);
                let of = |i: usize, k: usize| {
                    row[i] * row[k] * errors.covariance(errors.friction(joint, i), errors.friction(joint, k))
                };
                let variance: f64 =
                    (0..5).flat_map(|i| (0..5).map(move |k| (i, k))).map(|(i, k)| of(i, k)).sum();
                assert!(variance > 0.0, "seed {seed}, joint {joint}, {velocity} rad/s: {variance}");
                let found = TanhFriction::new(solution.friction(joint)).torque(velocity);
                squares.push((found - friction[joint].torque(velocity)).powi(2) / variance);
            }
        }
    }
    assert!(of_one_steepness > 0, "no joint has the case that this test is for");
    squares.sort_by(f64::total_cmp);
    let (median, most) = (squares[squares.len() / 2], squares[squares.len() - 1]);
    // Of a normal error: 0.45 in the median, 9 is exceeded three times in a thousand.
    assert!((0.1..1.5).contains(&median) && most < 25.0, "{median} {most}");
}
