//! The pipeline from the residual of a base model to named effects.
//!
//! [`explain_body`] runs all of it. `prepare` makes rows of the logs and fits the base model; the loop of
//! `find` proposes one effect after the other (`step`) until nothing passes and nothing is taken back;
//! `results` makes the model and the report of the `findings`. Each module uses those above it in this table,
//! never those below:
//!
//! | | |
//! |---|---|
//! | `study` | the rows and the options: what does not change during the search |
//! | `model` | the accepted effects, and the fit with them: what changes |
//! | `named` | the report on an effect |
//! | `search` | candidates screened and tested; settings refined; backward elimination |
//! | `comparison` | **whether a name is given**, what stays open, what is taken back |
//! | `above_band` | ripple that is too fast for the band of the fit, by a test of its own |
//! | `special` | special properties of some logs: one path, another running time, a held body |
//! | `by_log` | differences of one log from the others |
//! | `prepare`, `step` | the base model, with which the search begins, and one step of the loop |
//! | `findings`, `results` | the findings; the model, the report and its figures |
//! | `again` | the same search on fewer logs: which names last |

mod above_band;
mod again;
mod by_log;
mod comparison;
mod findings;
mod model;
mod named;
mod prepare;
mod results;
mod search;
mod special;
mod step;
mod study;

use crate::options::{ExplainError, ExplainOptions};
use above_band::ripple_above_band;
pub use again::FEWEST_LOGS;
use comparison::{History, withhold, withhold_harmful};
pub use comparison::{Hypothesis, Open};
use findings::Findings;
pub use named::{Again, FalsePositives, FitErrors, NamedEffect, Rival};
use powerball_logs::log::Log;
use powerball_logs::regression::RigidArm;
use prepare::{Inertia, Prepared, ValidationOnly, initial_model, prepare};
pub use results::{
    Change, Difference, Evidence, Experiment, Explained, FEATURES, LawCoefficient, LogResult, NextExperiment,
    Shown, State, TorqueCurve, Trajectory, Unattributed, UnnamedLaw, Verdict, contradictions, curves,
};
use search::CandidateKind;
use step::{Outcome, Proposed, accept, drop_words, judge_baseline, propose};

/// Explains what the base model of an arm that is derived already lacks on `logs`, judged on `validate`. The
/// logs are taken as they are: their clocks are joined already, and what is known is taken out of them.
///
/// # Errors
/// [`ExplainError`] where logs hold too little.
pub fn explain_body(
    body: &RigidArm,
    logs: &[Log],
    validate: &[Log],
    options: &ExplainOptions<'_>,
) -> Result<Explained, ExplainError> {
    options.progress.say("preparing signals");
    let found = |inertia, validation_only| -> Result<Findings<'_>, ExplainError> {
        Ok(find(prepare(body, (logs, validate), options, inertia, validation_only)?))
    };
    let mut findings = found(Inertia::Shared, ValidationOnly::TakenOut)?;
    if !findings.initial_fit.validation_only.is_empty() {
        options.progress.say("the same with unchanged validation logs");
        findings = findings.or_as_logged(found(Inertia::Shared, ValidationOnly::Kept)?);
    }
    if findings.study.one_path {
        options.progress.say("one path: joints by themselves");
        findings = findings.or_better(found(Inertia::PerJoint, ValidationOnly::Kept)?);
    }
    options.progress.say("examining the remaining error");
    let mut explained = results::conclude(findings)?;
    if options.leave_one_out {
        let search = |logs: &[Log], options: &ExplainOptions<'_>| explain_body(body, logs, validate, options);
        again::find_again(search, logs, options, &mut explained)?;
    }
    Ok(explained)
}

/// Adds one effect after the other until nothing passes and nothing is taken back; laws without a name where
/// no name passes.
fn find(Prepared { study, base, initial_fit }: Prepared<'_>) -> Findings<'_> {
    let (mut model, mut history, mut among) =
        (initial_model(base, &study), History::default(), CandidateKind::Names);
    for number in 0..study.rule().most_steps {
        study.say(&format!("step {}: screening candidates", number + 1));
        let Proposed { refused, outcome } = propose(&study, &model, number, among);
        if among == CandidateKind::Names {
            history.refused = refused;
        }
        match outcome {
            Outcome::Named(choice) => {
                let step = accept(&study, &mut model, *choice, number);
                study.say(&format!("step {}: {} accepted", number + 1, step.effect.name()));
                history.steps.push(step);
                among = CandidateKind::Names;
            }
            Outcome::Chance(candidates) => {
                study.say(&format!("step {}: the best candidate fits no better than chance", number + 1));
                model.given_up.extend(candidates);
            }
            // Only now the residual after all fitting effects is known.
            Outcome::Nothing => {
                if let Some(taken) = withhold(&study, &mut model, &mut history) {
                    study.say(&format!("{} is not named: {}", taken.effect.name(), taken.why));
                    among = CandidateKind::Names;
                } else if among == CandidateKind::Names && search::is_left(&study, &model) {
                    among = CandidateKind::Laws;
                } else {
                    break;
                }
            }
        }
    }
    while withhold(&study, &mut model, &mut history).is_some() {}
    study.say("testing the zeros of the torques");
    history.steps.extend(judge_baseline(&study, &mut model));
    while withhold_harmful(&study, &mut model, &mut history).is_some() {}
    study.say("refining settings");
    search::refine(&study, &mut model);
    drop_words(&study, &mut model);
    study.say("looking for ripple above the band");
    history.steps.extend(ripple_above_band(&study, &mut model, 2 * study.rule().most_steps));
    study.say("testing time-shift surrogates");
    let false_positives = search::false_positives(&study, &model);
    Findings { study, initial_fit, model, history, false_positives }
}

#[cfg(test)]
mod tests;
