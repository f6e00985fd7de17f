//! A correction of what has no name may help and may not hurt.

use super::numbered;
use super::plant::{Noise, Truth, arm, record};
use crate::effects::Context;
use crate::explain::explain_body;
use crate::explain::results::correction::correct;
use crate::explain::results::unattributed::depends_on;
use crate::{ExplainOptions, Rule};
use powerball_identification::estimate::{Folds, fit};
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataOptions, RigidArm};

/// Adds to joint 2's torque what no effect of the library is, and no function of two positions: a bump over the product
/// of two and a third one.
fn disturbed(mut logs: Vec<Log>, size: f64) -> Vec<Log> {
    for log in &mut logs {
        for k in 0..log.t.len() {
            log.torque[1][k] += size
                * (1.0 - ((log.q[0][k] * log.q[3][k] + 0.5 * log.q[4][k] - 0.2) / 0.5).powi(2)).max(-1.0);
        }
    }
    logs
}

#[test]
fn a_curve_is_kept_where_it_helps_and_named_by_nothing() {
    let body = RigidArm::new(&arm()).unwrap();
    let logs = disturbed(record(body.arm(), Truth::Clean, 0.0, Noise::White, 7, 22.0, 5), 2.0);
    let (to_fit, held_out) = logs.split_at(5);
    let run = |correct_unattributed: bool| {
        let options = ExplainOptions { correct_unattributed, ..ExplainOptions::default() };
        explain_body(&body, to_fit, held_out, &options).unwrap()
    };
    let (without, with) = (run(false), run(true));
    let rest = without.unattributed.expect("nothing in the library is this");
    assert!(rest.joints.contains(&numbered(&[2])[0]) && rest.correction.is_none());
    // It is no part of the model: names and errors are the same.
    assert_eq!(without.after.validate, with.after.validate);
    assert_eq!(without.effects.len(), with.effects.len());
    for c in with.unattributed.unwrap().correction.unwrap() {
        assert!(c.rms_after < c.rms_before && c.fold_gains.iter().all(|g| *g > 0.0), "{c:?}");
        assert!(c.curves.iter().all(|curve| curve.torque.iter().all(|t| t.is_finite())));
    }
}

#[test]
fn what_the_held_out_path_contradicts_is_not_kept() {
    let body = RigidArm::new(&arm()).unwrap();
    let clean = record(body.arm(), Truth::Clean, 0.0, Noise::White, 7, 22.0, 6);
    let torque = |logs: &mut [Log], sign: f64| {
        for log in logs {
            for k in 0..log.t.len() {
                log.torque[2][k] += sign * (4.0 * log.q[2][k]).sin();
            }
        }
    };
    // Fitted logs and held-out ones that agree, then held-out ones where the same torque has the other sign.
    let helps = |sign: f64| {
        let (mut to_fit, mut held_out) = (clean[..5].to_vec(), clean[5..].to_vec());
        torque(&mut to_fit, 1.0);
        torque(&mut held_out, sign);
        let options = DataOptions::default();
        let data = Data::new(&body, &to_fit, &options).unwrap();
        let other = Data::new(&body, &held_out, &options).unwrap();
        let folds = Folds::new(&data);
        let base = fit(&data, &folds, &[], None);
        let held = base.residual_on(&other, &[]);
        let rule = Rule::default();
        let here = Context::new(&data, &base, &base.residual, &rule);
        let there = Context::new(&other, &base, &held, &rule);
        let signals = depends_on(&here, 2);
        assert!(signals.iter().any(|(name, _)| name == "q3"), "{signals:?}");
        correct(&here, &there, &folds, 2, &signals)
    };
    let kept = helps(1.0).expect("the torque is there on both");
    assert!(kept.rms_after < 0.9 * kept.rms_before, "{kept:?}");
    assert!(helps(-1.0).is_none());
}
