//! What was found becomes the next model: the arm as it is, the logs put right, the terms known.

use super::plant::{Noise, Truth, arm, record};
use crate::explain::{Explained, explain_body};
use crate::torque_model::{Additions, Scalar, TorqueModel};
use crate::{ExplainError, ExplainOptions, explain};
use powerball_identification::estimate::{Folds, fit, residual_stats};
use powerball_logs::log::common_clock;
use powerball_logs::regression::{Data, DataOptions, RigidArm};

/// Whether a model holds what the plant has.
type Holds = fn(&Additions) -> bool;

/// With what was found taken out, the base model alone must do on the changed arm what the whole model did:
/// its fit is another, with other columns, and knows nothing of the explanation.
#[test]
fn a_base_model_beside_what_is_known_does_as_well_as_the_whole() {
    beside_what_is_known(|truth| matches!(truth, Truth::TimeDelay | Truth::BrokenSymmetry));
}

#[test]
#[ignore = "at length: half a minute; the one above guards it"]
fn a_base_model_beside_what_is_known_does_as_well_as_the_whole_at_length() {
    beside_what_is_known(|truth| !matches!(truth, Truth::TimeDelay | Truth::BrokenSymmetry));
}

fn beside_what_is_known(wanted: impl Fn(Truth) -> bool) {
    let body = RigidArm::new(&arm()).unwrap();
    let (result, options) = (ExplainOptions::default(), DataOptions::default());
    let given = |list: &[f64]| list.iter().any(|x| *x != 0.0);
    let parts: [(Truth, Holds); 5] = [
        (Truth::EncoderOffset, |a| a.log_changes.encoder_offset.iter().any(|o| (o - 0.03).abs() < 0.003)),
        (Truth::TimeDelay, |a| a.log_changes.delay.iter().all(|d| (d - 0.006).abs() < 0.0006)),
        (Truth::BaseTilt, |a| a.arm_changes.gravity.is_some_and(|g| (g[1] - 0.02 * 9.81).abs() < 0.02)),
        (Truth::BrokenSymmetry, |a| a.arm_changes.not_zero.len() == 1),
        (Truth::TorqueConstant, |a| a.terms.iter().any(|t| t.effect == "torque_constant")),
    ];
    for (truth, part) in parts.into_iter().filter(|(truth, _)| wanted(*truth)) {
        let mut logs = record(body.arm(), truth, 1.0, Noise::White, 7, 22.0, 3);
        let explained = explain_body(&body, &logs[..5], &logs[5..], &result).unwrap();
        assert_eq!(explained.effects[0].effect, truth.name());
        let model = &explained.model;
        assert!(part(&model.additions), "{truth:?}: {:?}", model.additions);
        assert_eq!(given(&model.additions.log_changes.delay), truth == Truth::TimeDelay);

        let changed = RigidArm::new(&model.additions.arm_changes.of(body.arm()).unwrap()).unwrap();
        assert_eq!(model.parameters.len(), changed.names().len());
        model.take_out(&changed, &mut logs);
        let [data, other] = [&logs[..5], &logs[5..]].map(|logs| Data::new(&changed, logs, &options).unwrap());
        let next = fit(&data, &Folds::new(&data), &[], None);
        let rms = residual_stats(&other, &next.residual_on(&other, &[])).rms;
        let (before, after) = (&explained.before.validate.rms, &explained.after.validate.rms);
        for j in 0..body.dof() {
            assert!(rms[j] < 1.03 * after[j], "{truth:?}, joint {}: {} {}", j + 1, rms[j], after[j]);
        }
        let fall = |x: &[f64]| x.iter().zip(before).map(|(x, b)| x / b).fold(1.0, f64::min);
        assert!(fall(&rms) < 0.9, "{truth:?}: {before:?} {rms:?}");
        // And code of it can be proven.
        assert!(model.source(body.arm(), Scalar::F64, &[]).is_ok());
    }
}

/// `explain` joins the clocks of logs and takes out what is known, and what is known comes back into the
/// model.
#[test]
fn explain_needs_nothing_prepared() {
    let body = RigidArm::new(&arm()).unwrap();
    let mut logs = record(body.arm(), Truth::Temperature, 1.0, Noise::White, 7, 22.0, 3);
    common_clock(&mut logs);
    // It also checks what the columns are.
    let json = |explained: &Explained| Explained { conventions: None, ..explained.clone() };
    let json = |explained: &Explained| serde_json::to_value(json(explained)).unwrap();
    let prepared = explain_body(&body, &logs[..5], &logs[5..], &ExplainOptions::default()).unwrap();
    let is_warm = |explained: &Explained| explained.effects.iter().any(|e| e.effect == "temperature");
    assert!(is_warm(&prepared));

    logs.iter_mut().for_each(|log| log.clock = 0.0);
    let api = |known: Option<TorqueModel>| {
        let options = ExplainOptions { known, ..ExplainOptions::default() };
        explain(body.arm(), &logs[..5], &logs[5..], &options)
    };
    let explained = api(None).unwrap();
    assert!(explained.conventions.is_some());
    assert_eq!(json(&explained), json(&prepared));

    let again = api(Some(explained.model.clone())).unwrap();
    assert!(!is_warm(&again), "{:?}", again.effects);
    assert!(again.model.additions.terms.iter().any(|t| t.effect == "temperature"));

    let mut another = explained.model;
    another.parameters.truncate(1);
    assert!(matches!(api(Some(another)), Err(ExplainError::Known(_))));
}
