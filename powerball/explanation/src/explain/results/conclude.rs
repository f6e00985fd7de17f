//! The result from the findings.
//!
//! The module also reports what these logs cannot show, and what to record instead.

use super::super::comparison::{Comparison, Step, leftover, open};
use super::super::findings::Findings;
use super::super::model::{Accepted, Model, Own};
use super::super::named::{FitErrors, NamedEffect, Rival};
use super::super::special::pushes_at_rest;
use super::super::study::Study;
use super::compose::{Composed, compose, compose_per_joint};
use super::explainable::explainable;
use super::explained::{Change, Explained, NextExperiment, curves, shown};
use super::logs::logs;
use super::unattributed::{effective_samples, unattributed};
use super::unnamed::laws;
use super::verdict::{Evidence, verdict};
use crate::effects::{Effect, Figures, Found, Settings, contact_wrench};
use crate::options::{ExplainError, RuledOut};
use crate::torque_model::RestPush;
use dyngen::arm::JointKind;
use powerball_controller::JointNumber;
use powerball_identification::estimate::distribution::f_tail;
use powerball_identification::estimate::{noise_floor, over_blocks, residual_stats};
use powerball_logs::regression::{Data, FEWEST_ROWS};
use std::ops::Range;
use std::sync::Arc;

/// Makes the result.
pub(crate) fn conclude(findings: Findings<'_>) -> Result<Explained, ExplainError> {
    let validation_only = &findings.initial_fit.validation_only;
    let composed = match findings.study.data.per_joint {
        true => compose_per_joint(&findings.study, &findings.model)?,
        false => compose(&findings.study, &findings.model, validation_only)?,
    };
    let Composed { model: torque_model, arm, held, fitted, held_out } = composed;
    let arm = arm.as_ref().unwrap_or(findings.study.data.body);
    let (study, model, history) = (&findings.study, &findings.model, &findings.history);
    let before = &findings.initial_fit;
    let after = FitErrors {
        fit: residual_stats(&study.data, &fitted),
        validate: residual_stats(&study.validation, &held_out),
    };
    let at_rest = pushes_at_rest(study, (&torque_model, arm), &held, &after.validate.rms);
    let floor = noise_floor(&study.data);
    let left = |joints: &[JointNumber]| leftover(&before.errors.fit.rms, &after.fit.rms, &floor, joints);
    let mut named: Vec<NamedEffect> = validation_only.iter().map(|effect| effect.named.clone()).collect();
    named.extend(named_effects(study, model, &history.steps, &left));
    add_pushes_at_rest(&mut named, &at_rest, &findings, &after);
    not_named_elsewhere(&mut named);
    let (unattributed, unexplained, dependencies) =
        unattributed(study, model, history, &floor, &after, &named);
    let left = unattributed.as_ref().map_or(&[][..], |rest| &rest.joints);
    let time = study.fitted_time() / study.rule().least_time;
    for effect in &mut named {
        effect.probability = Evidence::of(effect, time).probability();
    }
    let open = open(study, model, history, left);
    let held_out_change = changes(&study.validation, &before.residual, &held_out);
    let resting = (0..study.data.dof()).filter(|j| study.data.joints[*j].len() < FEWEST_ROWS);
    Ok(Explained {
        unusable: Vec::new(),
        resting: resting.map(JointNumber::from_index).collect(),
        verdict: verdict(study, &held_out_change, &after.validate, &floor, &dependencies),
        logs: logs(&findings, &at_rest),
        arm: study.data.body.arm().name.clone(),
        arm_file: None,
        sliding: study.data.body.arm().joints.iter().map(|j| j.kind == JointKind::Prismatic).collect(),
        conventions: None,
        transmission: None,
        held_out_change,
        before: before.errors.clone(),
        noise_floor: floor,
        explainable: explainable(study, &fitted, &held_out),
        effects: named,
        laws: laws(study, model, &history.steps),
        band: [0.0, study.data.band.cutoff],
        bands: study.data.joints.iter().map(|joint| joint.band.cutoff).collect(),
        fitted_time: study.fitted_time(),
        effective_samples: effective_samples(&study.data, &model.fit.residual),
        unattributed,
        next_experiment: open.as_ref().map(|open| NextExperiment::not_designed(open.names())),
        experiment: None,
        // An experiment moves a body.
        open: open.filter(|_| !study.data.per_joint).map(Arc::new),
        warnings: warnings(&findings).into_iter().chain(unexplained).collect(),
        curves: curves(&study.validation, &before.residual, &held_out),
        shown: shown(study, model),
        model: torque_model,
        false_positives: findings.false_positives,
        after,
    })
}

/// The accepted effects, each once with all of its joints, in the order in which they were added.
fn named_effects(
    study: &Study<'_>,
    model: &Model,
    steps: &[Step],
    left: &dyn Fn(&[JointNumber]) -> f64,
) -> Vec<NamedEffect> {
    let mut order: Vec<&'static dyn Effect> = Vec::new();
    let mut accepted: Vec<&Accepted> = model.accepted.iter().collect();
    accepted.sort_by_key(|a| a.step());
    for effect in accepted.into_iter().map(Accepted::effect).filter(|effect| effect.has_name()) {
        if !order.contains(&effect) {
            order.push(effect);
        }
    }
    order.into_iter().filter_map(|effect| named_effect(study, model, steps, effect, left)).collect()
}

fn named_effect(
    study: &Study<'_>,
    model: &Model,
    steps: &[Step],
    effect: &'static dyn Effect,
    left: &dyn Fn(&[JointNumber]) -> f64,
) -> Option<NamedEffect> {
    let coefficients = model.coefficients();
    let shares = model.own();
    let which = (0..model.accepted.len()).filter(|k| model.accepted[*k].effect() == effect);
    let mut own: Vec<(&Accepted, &Vec<f64>, &Own, usize)> =
        which.map(|k| (&model.accepted[k], &coefficients[k], &shares[k], k)).collect();
    own.sort_by_key(|(a, ..)| a.candidate.joints.clone());
    let own = || own.iter().copied();
    let found: Vec<Found<'_>> =
        own().map(|(a, c, ..)| Found { candidate: &a.candidate, coefficients: c }).collect();
    let mut joints: Vec<JointNumber> = found.iter().flat_map(|f| f.candidate.joints.clone()).collect();
    joints.sort_unstable();
    joints.dedup();
    let mut logs: Vec<String> = Vec::new();
    for window in found.iter().flat_map(|f| &f.candidate.windows) {
        if !logs.contains(&window.log) {
            logs.push(window.log.clone());
        }
    }
    let mut steps = steps.iter().filter(|s| s.effect == effect);
    let first = steps.next()?;
    let last = steps.next_back().unwrap_or(first);
    Some(NamedEffect {
        effect: effect.name().to_string(),
        figures: effect.figures(&model.context(study), &found),
        relative_std: own().map(|(_, _, own, k)| model.size_error(study, k, own.relative_std)).collect(),
        rms_before: joints.iter().map(|j| first.before[j.index()]).collect(),
        rms_after: joints.iter().map(|j| last.after[j.index()]).collect(),
        p_value: own().map(|(a, ..)| a.p_value).fold(0.0, f64::max),
        held_out_gain: own().map(|(a, ..)| a.fold_gain).collect(),
        logs,
        again: None,
        in_some_logs: false,
        // The remaining error is known only when all names are.
        probability: f64::NAN,
        margin: first.comparison.margin,
        leftover: left(&joints),
        own_share: own().map(|(_, _, own, _)| own.share).fold(1.0, f64::min),
        class: effect.class().name().to_string(),
        rivals: rivals(&study.options.ruled_out, &first.comparison, effect.name()),
        joints,
    })
}

/// A named effect is not a rival of another name on the same joint.
fn not_named_elsewhere(named: &mut [NamedEffect]) {
    let given = named.to_vec();
    for NamedEffect { rivals, joints, .. } in named {
        rivals.retain(|rival| !given.iter().any(|other| other.is(&rival.effect, joints)));
    }
}

/// Pushes while the arm stood still are one effect with those on the way. No error of a row falls by them,
/// since rows at rest are in no error.
fn add_pushes_at_rest(
    named: &mut Vec<NamedEffect>,
    pushes: &[RestPush],
    findings: &Findings<'_>,
    after: &FitErrors,
) {
    if pushes.is_empty() {
        return;
    }
    let own = contact_wrench::Figures {
        end_time: pushes.iter().map(|p| p.to).collect(),
        force: pushes.iter().map(|p| p.force.to_vec()).collect(),
        point: pushes.iter().map(|p| p.point.clone()).collect(),
        start_time: pushes.iter().map(|p| p.from).collect(),
    };
    let mut logs: Vec<String> = pushes.iter().map(|p| p.log.clone()).collect();
    logs.dedup();
    let known = named.iter_mut().find_map(|effect| match &mut effect.figures {
        Figures::ContactWrench(figures) => Some((figures, &mut effect.logs)),
        _ => None,
    });
    if let Some((figures, known)) = known {
        figures.end_time.extend(own.end_time);
        figures.force.extend(own.force);
        figures.point.extend(own.point);
        figures.start_time.extend(own.start_time);
        known.extend(logs.into_iter().filter(|log| !known.contains(log)).collect::<Vec<_>>());
        return;
    }
    let effect = Settings::from(contact_wrench::Settings::Constant).effect();
    // By chance: the least of them, in standard deviations beyond what friction hides.
    let beyond = pushes.iter().map(|p| p.beyond).fold(f64::INFINITY, f64::min);
    named.push(NamedEffect {
        effect: effect.name().to_string(),
        figures: own.into(),
        relative_std: Vec::new(),
        rms_before: after.validate.rms.clone(),
        rms_after: after.validate.rms.clone(),
        p_value: f_tail(beyond * beyond, 1.0, 100.0),
        held_out_gain: Vec::new(),
        logs,
        again: None,
        in_some_logs: false,
        probability: f64::NAN,
        margin: pushes.iter().map(|p| p.size).fold(f64::INFINITY, f64::min),
        leftover: pushes.iter().map(|p| 1.0 - p.share).sum::<f64>() / pushes.len() as f64,
        own_share: 1.0,
        class: effect.class().name().to_string(),
        rivals: Vec::new(),
        joints: (0..findings.study.data.dof()).map(JointNumber::from_index).collect(),
    });
}

/// The next best names, and what an experiment has ruled out on the same joints.
fn rivals(ruled_out: &[RuledOut], comparison: &Comparison, name: &str) -> Vec<Rival> {
    let on_these = |r: &&RuledOut| r.effect != name && r.joints.iter().any(|j| comparison.joints.contains(j));
    let out = |r: &RuledOut| {
        let why_not = r.why_not.clone();
        Rival { effect: r.effect.clone(), joints: r.joints.clone(), alike: false, why_not }
    };
    comparison.rivals.iter().cloned().chain(ruled_out.iter().filter(on_these).map(out)).collect()
}

/// How the errors change, by joint that moves.
fn changes(data: &Data<'_>, before: &[Vec<f64>], after: &[Vec<f64>]) -> Vec<Change> {
    let of = |j: usize| {
        let square = |residual: &[f64]| residual.iter().map(|r| r * r).sum::<f64>();
        let block = |rows: &Range<usize>| (square(&after[j][rows.clone()]), square(&before[j][rows.clone()]));
        let (ratio, half) = over_blocks(&data.blocks.iter().map(|b| block(&b.rows[j])).collect::<Vec<_>>());
        let change = |square: f64| square.max(0.0).sqrt() - 1.0;
        let interval = [change(ratio - half), change(ratio + half)];
        Change { joint: JointNumber::from_index(j), rms: change(ratio), interval }
    };
    (0..data.dof()).filter(|j| !data.joints[*j].is_empty()).map(of).collect()
}

// Effects that these logs cannot show, and what to record instead.

/// Warning if each joint was fitted by itself.
const PER_JOINT: &str = "the logs repeat one path, and separate models of the joints predict the held-out \
    logs better than one rigid body for all joints: each joint was given inertial parameters of its own, an \
    offset and a slope with its position. All errors here are of these models, and effects of the body \
    (payload, base tilt, broken symmetries) were not considered; model.json holds one body for all joints, \
    whose errors are larger";
/// Warning if the validation logs repeat the fitted path.
const ONE_PATH: &str = "the logs of --validate run the same path as those of --log: what depends on \
    positions (springs, zeros, gravity, broken symmetries, slow ripple) was not considered; record another \
    path";
/// Accepted surrogates that may be chance, whatever their share.
const FEW: usize = 2;

/// Everything that a reader should know before believing the result.
pub(crate) fn warnings(findings: &Findings<'_>) -> Vec<String> {
    let (study, fit, rule) = (&findings.study, &findings.model.fit, findings.study.rule());
    let mut warnings: Vec<String> = Vec::new();
    for note in study.data.notes.iter().chain(&study.validation.notes) {
        if !warnings.contains(note) {
            warnings.push(note.clone());
        }
    }
    // Prior knowledge of an arm is not a measurement.
    let measured = fit.gram.all(&fit.weights).solver(|c| fit.free[c]);
    let is_seen =
        |c: usize| measured.kept().iter().any(|k| *k < fit.design.inertial && k % fit.design.set == c);
    let names = study.data.body.names().iter().enumerate();
    let unseen: Vec<&str> = names.filter(|(c, _)| !is_seen(*c)).map(|(_, name)| name.as_str()).collect();
    if !unseen.is_empty() {
        warnings.push(format!(
            "these logs do not determine {}: an effect that resembles them cannot be distinguished from \
             them; record a motion that excites them (powerball excite)",
            unseen.join("; ")
        ));
    }
    let seconds = study.fitted_time();
    if seconds < rule.least_time {
        warnings.push(format!(
            "the logs to fit hold {seconds:.0} s: too little to distinguish small effects from chance; \
                record several paths of 20 s or more"
        ));
    }
    if study.data.per_joint {
        warnings.push(PER_JOINT.to_string());
    }
    if study.one_path {
        warnings.push(ONE_PATH.to_string());
    }
    warnings.extend(findings.initial_fit.clock.note().map(str::to_string));
    let chance = &findings.false_positives;
    if chance.accepted as f64 > rule.negligible * chance.surrogates as f64 && chance.accepted > FEW {
        warnings.push(format!(
            "false positives: {} of {} time-shifted surrogates were accepted. The error that remains on \
                these logs is large and smooth, and names given here may be wrong; see the unattributed \
                part, and check that the logs and the arm file belong together",
            chance.accepted, chance.surrogates
        ));
    }
    warnings
}
