//! What each estimator is there for.

use super::plant::{record, sensors, truth};
use crate::estimate::{
    FrictionKind, Solution, StandardErrors, solve_instrumental, solve_reduced, solve_robust, standard_errors,
};
use chacha20::ChaCha8Rng;
use powerball_logs::log::Log;
use powerball_logs::regression::{DataOptions, RigidArm};
use powerball_logs::summary::Summary;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

fn weighted(body: &RigidArm, logs: &[Log]) -> Solution {
    let options = DataOptions::default();
    let mut summary = Summary::new(body, &options);
    for log in logs {
        summary.push(body, log, &options).unwrap();
    }
    solve_reduced(&summary, FrictionKind::Symmetric)
}

/// Error of the inertial parameters in the standard errors of a fit without faults, rms.
fn miss(solution: &Solution, truth: &[f64], clean: &StandardErrors) -> f64 {
    let terms =
        solution.inertial().iter().zip(truth).zip(&clean.std).filter_map(|((x, t), s)| Some((x - t) / (*s)?));
    (terms.clone().map(|z| z * z).sum::<f64>() / terms.count() as f64).sqrt()
}

/// One torque sample in twenty is anything within the joint's limits, and twice something pushes the arm.
#[test]
fn knocks_do_not_bend_the_robust_fit() {
    let (body, truth) = truth();
    let mut logs = record(&sensors(), 2, 3, 11);
    let clean = weighted(&body, &logs);
    let clean_errors = standard_errors(&clean);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for log in &mut logs {
        for (torque, limit) in log.torque.iter_mut().zip([60.0, 60.0, 60.0, 20.0, 10.0, 10.0]) {
            for tau in torque.iter_mut() {
                if rng.random_bool(0.05) {
                    *tau = limit * rng.random_range(-1.0..1.0);
                }
            }
            for from in [1500, 3700] {
                // 0.3 s at 200 Hz.
                torque[from..from + 60].iter_mut().for_each(|tau| *tau += 0.5 * limit);
            }
        }
    }
    let bent = weighted(&body, &logs);
    let robust = solve_robust(&body, &logs, &DataOptions::default(), FrictionKind::Symmetric).unwrap();
    let [clean, bent, held] = [&clean, &bent, &robust.solution].map(|s| miss(s, &truth, &clean_errors));
    println!("clean {clean:.2}, weighted {bent:.2}, robust {held:.2}");
    assert!(clean < 2.0 && bent > 4.0 && held < 2.0, "clean {clean}, weighted {bent}, robust {held}");
    assert!(robust.doubted.iter().all(|d| (0.03..0.10).contains(d)), "{:?}", robust.doubted);
}

/// Logs without faults are fitted as least squares fits them.
#[test]
fn without_knocks_the_robust_fit_is_the_weighted_one() {
    let (body, truth) = truth();
    let logs = record(&sensors(), 1, 3, 12);
    let clean = weighted(&body, &logs);
    let robust = solve_robust(&body, &logs, &DataOptions::default(), FrictionKind::Symmetric).unwrap();
    let clean_errors = standard_errors(&clean);
    assert!(miss(&robust.solution, clean.inertial(), &clean_errors) < 0.5);
    assert!(miss(&robust.solution, &truth, &clean_errors) < 2.0);
}

/// Noise of 0.8 mrad on every position: least squares is biased by many standard errors, instruments are not.
#[test]
fn instruments_are_not_biased_by_noisy_positions() {
    let (body, truth) = truth();
    let mut logs = record(&sensors(), 3, 6, 21);
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for log in &mut logs {
        for q in log.q.iter_mut().flatten() {
            let noise: f64 = StandardNormal.sample(&mut rng);
            *q += 1.2e-3 * noise;
        }
    }
    let start = weighted(&body, &logs);
    let (unbiased, unbiased_errors) =
        solve_instrumental(&body, &logs, &DataOptions::default(), &start).unwrap();
    let [biased, unbiased] =
        [(&start, &standard_errors(&start)), (&unbiased, &unbiased_errors)].map(|(s, e)| miss(s, &truth, e));
    println!("least squares {biased:.2}, instrumental {unbiased:.2} standard errors");
    assert!(biased > 3.0 && unbiased < 2.0, "least squares {biased}, instrumental {unbiased}");
}
