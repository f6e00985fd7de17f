//! Reduced logs say what the logs say.

use super::plant::{record, sensors, truth};
use crate::estimate::{
    Folds, FrictionKind, Solution, fit, reduce_in_bands, solve_in_band, solve_reduced, stats_of,
};
use powerball_logs::regression::{Data, DataOptions};
use powerball_logs::signal::Band;
use powerball_logs::summary::{BANDS, Bands, Summary, SummaryError};

/// The fit of summaries is that of the rows themselves, which knows no interpolation of steepnesses.
#[test]
fn a_reduced_fit_is_the_fit_of_the_rows() {
    let (body, _) = truth();
    let options = DataOptions::default();
    let logs = record(&sensors(), 2, 3, 31);
    let mut summary = Summary::new(&body, &options);
    for log in &logs {
        summary.push(&body, log, &options).unwrap();
    }
    let reduced = solve_reduced(&summary, FrictionKind::Symmetric);
    let data = Data::new(&body, &logs, &options).unwrap();
    let direct = fit(&data, &Folds::new(&data), &[], None);
    let errors = crate::estimate::standard_errors(&reduced);
    for (c, (a, b)) in reduced.theta.iter().zip(&direct.theta).enumerate() {
        // The weights' colour is estimated from slow octaves here, from means over a second there.
        let Some(std) = errors.std[c] else { continue };
        assert!((a - b).abs() < 0.3 * std.max(1e-6), "{c}: {a} {b} ± {std}");
    }
}

/// Written, read, merged in any order: the same answer; a long log is worked on in parts.
#[test]
fn summaries_join_to_the_answer_of_their_logs() {
    let (body, _) = truth();
    let options = DataOptions::default();
    let mut logs = record(&sensors(), 2, 3, 32);
    logs.extend(record(&sensors(), 1, 20, 33));
    let one = |k: usize| {
        let mut summary = Summary::new(&body, &options);
        summary.push(&body, &logs[k], &options).unwrap();
        Summary::from_bytes(&summary.to_bytes()).unwrap().0
    };
    let joined = |order: [usize; 3]| {
        let mut all = Summary::new(&body, &options);
        order.iter().for_each(|k| all.merge(&one(*k)).unwrap());
        all
    };
    let (a, b) = (joined([0, 1, 2]), joined([2, 0, 1]));
    assert_eq!(a.to_bytes(), joined([0, 1, 2]).to_bytes());
    let (a, b) = (solve_reduced(&a, FrictionKind::Asymmetric), solve_reduced(&b, FrictionKind::Asymmetric));
    for (x, y) in a.theta.iter().zip(&b.theta) {
        approx::assert_relative_eq!(x, y, max_relative = 1e-6, epsilon = 1e-7);
    }
    // 202 s at 200 Hz: parts have no seams.
    let long = one(2);
    let expected = (logs[2].t.len() as f64 - 120.0) / Band::new(BANDS[0], 200.0).decimation as f64;
    assert!((long.samples as f64 - expected).abs() < 4.0, "{} {expected}", long.samples);
}

/// A joint whose model sinks under its noise is fitted in a narrower band, the others as wide as before;
/// summaries on disk say so too, and logs say it together.
#[test]
fn a_noisy_joint_asks_for_a_narrower_band() {
    let (body, _) = truth();
    let options = DataOptions::default();
    let reduced = |noise: f64, seed: u64| -> Bands {
        let mut noisy = sensors();
        noisy.white[4] += noise;
        let mut all = Bands::new(&body, &options);
        for log in record(&noisy, 2, 3, seed) {
            let (bands, notes) = reduce_in_bands(&body, &log, &options).unwrap();
            assert!(notes.is_empty());
            all.merge(&bands).unwrap();
        }
        all
    };
    let quiet = reduced(0.0, 35);
    assert_eq!(solve_in_band(&quiet, FrictionKind::Symmetric).bands, [0; 6]);
    let noisy = reduced(1.0, 35);
    let found = solve_in_band(&noisy, FrictionKind::Symmetric);
    assert!(found.bands[4] > 0 && found.bands.iter().sum::<usize>() == found.bands[4], "{:?}", found.bands);
    assert_eq!(BANDS[0] / BANDS[1], 2.0);
    let read = Bands::from_bytes(&noisy.to_bytes()).unwrap();
    assert_eq!(read, noisy);
    assert_eq!(solve_in_band(&read, FrictionKind::Symmetric).solution.theta, found.solution.theta);
    // White noise of the rows is what the narrower band leaves of it.
    let rms = |solution: &Solution| stats_of(solution, &solution.theta).rms[4];
    let wide = solve_reduced(noisy.widest(), FrictionKind::Symmetric);
    let share = (BANDS[found.bands[4]] / BANDS[0]).sqrt();
    approx::assert_relative_eq!(rms(&found.solution), share * rms(&wide), max_relative = 0.1);
    assert!(Bands::from_bytes(&noisy.widest().to_bytes()).is_err());
}

/// What a solution leaves of another log is the same from that log's rows and from its summary.
#[test]
fn a_log_that_took_no_part_judges_the_fit() {
    use crate::estimate::{known, residual_stats};

    let (body, _) = truth();
    let options = DataOptions::default();
    let logs = record(&sensors(), 2, 3, 34);
    let one = |k: usize| {
        let mut summary = Summary::new(&body, &options);
        summary.push(&body, &logs[k], &options).unwrap();
        summary
    };
    let solution = solve_reduced(&one(0), FrictionKind::Symmetric);
    let there = solution.on(&one(1)).unwrap();
    let reduced = stats_of(&there, &there.theta);
    let data = Data::new(&body, &logs[1..], &options).unwrap();
    let gammas: Vec<[f64; 5]> = (0..6).map(|j| solution.friction(j)).collect();
    let fit = known(&data, solution.inertial(), &gammas);
    let direct = residual_stats(&data, &fit.residual_on(&data, &[]));
    for j in 0..6 {
        approx::assert_relative_eq!(reduced.rms[j], direct.rms[j], max_relative = 1e-3);
        approx::assert_relative_eq!(reduced.relative[j], direct.relative[j], max_relative = 1e-3);
    }
    let other = Summary::new(&body, &DataOptions { cutoff: 5.0, ..options });
    assert!(solution.on(&other).is_err());
}

#[test]
fn damage_and_other_arms_are_named() {
    let (body, _) = truth();
    let options = DataOptions::default();
    let empty = Summary::new(&body, &options);
    let bytes = empty.to_bytes();
    let unreadable = |bytes: &[u8]| matches!(Summary::from_bytes(bytes), Err(SummaryError::Unreadable(_)));
    assert!(unreadable(b"t,q1") && unreadable(&bytes[..bytes.len() - 1]) && unreadable(&bytes[..100]));
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    assert!(unreadable(&flipped));
    let other = Summary::new(&body, &DataOptions { cutoff: 5.0, ..options });
    let refused = Summary::new(&body, &options).merge(&other).unwrap_err();
    assert!(refused.to_string().contains("band is 5 Hz"), "{refused}");
}
