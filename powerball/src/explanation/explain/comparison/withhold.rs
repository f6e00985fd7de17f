//! Names that are taken back: they turn out not to be told apart or not to be there.

use super::super::model::{Accepted, Model};
use super::super::study::Study;
use super::constancy::inconstant;
use super::history::{History, Step};
use super::question::Question;
use crate::controller::JointNumber;
use crate::explanation::effects::Effect;
use crate::identification::estimate::{noise_floor, residual_stats};

/// What was taken back, and why.
pub(crate) struct Withheld {
    pub(crate) effect: &'static dyn Effect,
    pub(crate) why: &'static str,
}

/// Takes back what, now that everything that fits is in the model, is not what it is called: an effect
/// that is missing at some pace; or one that is not told apart from its rivals and beside which much is
/// left, so that something else is there. It stays as a rival of what comes.
pub(crate) fn withhold(study: &Study<'_>, model: &mut Model, history: &mut History) -> Option<Withheld> {
    let (taken, why) = if let Some(a) = impossible(study, model) {
        (vec![model.accepted.remove(a)], IMPOSSIBLE)
    } else if let Some(a) = inconstant(study, model) {
        (vec![model.accepted.remove(a)], "what it says of some pace of motion is not there")
    } else if let Some(a) = harmful(study, model) {
        (vec![model.accepted.remove(a)], HARMS)
    } else {
        let step = history.steps.iter().rev().find(|s| is_weak(study, model, s))?.number;
        let taken = model.accepted.extract_if(.., |a| a.step == Some(step)).collect();
        (taken, "others fit as well and much is left")
    };
    take_back(study, model, history, taken, why)
}

/// Takes back what cannot be and what makes the error on the logs to judge on larger, and nothing else.
pub(crate) fn withhold_harmful(
    study: &Study<'_>,
    model: &mut Model,
    history: &mut History,
) -> Option<Withheld> {
    let (taken, why) = match impossible(study, model) {
        Some(a) => (a, IMPOSSIBLE),
        None => (harmful(study, model)?, HARMS),
    };
    let taken = vec![model.accepted.remove(taken)];
    take_back(study, model, history, taken, why)
}

/// Why something goes out that cannot be as it would have to be.
const IMPOSSIBLE: &str = "its figures cannot be";
/// Why something goes out that makes the error on the logs to judge on larger.
const HARMS: &str = "with it the error on the logs to judge on is larger";

fn take_back(
    study: &Study<'_>,
    model: &mut Model,
    history: &mut History,
    taken: Vec<Accepted>,
    why: &'static str,
) -> Option<Withheld> {
    let Accepted { step, .. } = *taken.first()?;
    let effect = taken.first()?.effect();
    // What was found beside it on its joints may be there because of it, and is asked again.
    let joints: Vec<JointNumber> = taken.iter().flat_map(|a| a.candidate.joints.clone()).collect();
    model.accepted.retain(|a| a.step <= step || !a.candidate.is_on(&joints));
    model.given_up.extend(taken.into_iter().map(|a| a.candidate));
    let stands = |s: &Step| model.accepted.iter().any(|a| a.step == Some(s.number));
    let gone = history.steps.extract_if(.., |s| !stands(s));
    history.questions.extend(gone.filter_map(|s| s.question).map(Question::withheld));
    model.refit(study);
    Some(Withheld { effect, why })
}

/// The accepted effect that cannot be there with the coefficients that it came to have.
fn impossible(study: &Study<'_>, model: &Model) -> Option<usize> {
    let context = model.context(study);
    let mut found = model.accepted.iter().zip(model.coefficients());
    found.position(|(a, coefficients)| !a.effect().possible(&context, &a.candidate, &coefficients))
}

/// The accepted effect without which the logs to judge on are predicted clearly better, on its joints or on all: what one
/// joint gains others may lose, since they share their parameters.
fn harmful(study: &Study<'_>, model: &Model) -> Option<usize> {
    let error = |left: &[Vec<f64>], joints: &[JointNumber]| -> f64 {
        let square = |j: &JointNumber| left[j.index()].iter().map(|e| e * e).sum::<f64>();
        joints.iter().map(square).filter(|s| *s > 0.0).map(f64::ln).sum::<f64>() / joints.len() as f64
    };
    let all: Vec<JointNumber> = (0..study.data.dof()).map(JointNumber::from_index).collect();
    let with = model.residual_on_validation(study);
    let found = (0..model.accepted.len()).rev().filter(|k| model.accepted[*k].step.is_some());
    found.into_iter().find(|k| {
        let joints = &model.accepted[*k].candidate.joints;
        let without = model.without(study, *k).residual_on_validation(study);
        [joints, &all]
            .iter()
            .any(|on| error(&without, on) < error(&with, on) - study.rule().max_validation_loss)
    })
}

/// Whether a step's name is not told apart from others and leaves much.
fn is_weak(study: &Study<'_>, model: &Model, step: &Step) -> bool {
    step.comparison.distinct_margin < study.rule().least_margin
        && model.accepted.iter().any(|a| a.step == Some(step.number))
        && share_left(study, model, step) > study.rule().max_unexplained
}

/// The share of the excess over the noise floor that stayed on a step's joints, each counting alike: a name
/// must explain every joint that it is given on.
fn share_left(study: &Study<'_>, model: &Model, step: &Step) -> f64 {
    let rms = |j: usize, square: f64| (square / study.data.joints[j].len().max(1) as f64).sqrt();
    let before: Vec<f64> = step.square_before.iter().enumerate().map(|(j, s)| rms(j, *s)).collect();
    let after = residual_stats(&study.data, &model.fit.residual).rms;
    let floor = noise_floor(&study.data);
    let joints = &step.comparison.joints;
    let shares: f64 = joints.iter().map(|j| leftover(&before, &after, &floor, &[*j])).sum();
    shares / joints.len().max(1) as f64
}

/// Share of the excess over the floor that stays: (after² − floor²)/(before² − floor²) over some joints
/// together, each in units of its floor.
#[must_use]
pub(crate) fn leftover(before: &[f64], after: &[f64], floor: &[f64], joints: &[JointNumber]) -> f64 {
    let excess = |rms: &[f64]| -> f64 {
        let of = |j: &JointNumber| ((rms[j.index()] / floor[j.index()]).powi(2) - 1.0).max(0.0);
        joints.iter().filter(|j| floor[j.index()] > 0.0).map(of).sum()
    };
    let old = excess(before);
    if old > 0.0 { (excess(after) / old).min(1.0) } else { 0.0 }
}
