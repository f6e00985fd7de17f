//! One effect at a time: screen, test, accept, refit everything, until nothing passes.

use super::evidence::Path;
use super::family::Member;
use super::naming::{Comparison, compare};
use super::one_path::repeats;
use super::open::{Question, refitted};
use super::other_path::payload_on;
use super::placebo::placebos;
use super::result::{Errors, Explained, FalsePositives, NamedEffect, Rival};
use super::rule;
use super::running_time::{self, Clock};
use super::screen::{Screen, Trial};
use crate::explanation::effects::{self, Candidate, Context, Effect};
use crate::identification::estimate::{Design, Fit, Folds, fit, friction_columns, spread};
use crate::logs::log::Log;
use crate::logs::regression::{Column, Data, DataError, DataOptions, RigidBody};
use std::fmt;

/// Why logs cannot be explained.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ExplainError {
    /// The logs to fit.
    Fit(DataError),
    /// The logs of the other path.
    Validate(DataError),
    /// The arm that was found has no model.
    Arm(String),
}

impl fmt::Display for ExplainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ExplainError::Fit(e) => write!(f, "--log: {e}"),
            ExplainError::Validate(e) => write!(f, "--validate: {e}"),
            ExplainError::Arm(e) => f.write_str(e),
        }
    }
}

impl std::error::Error for ExplainError {}

/// An accepted effect on its joints.
#[derive(Debug)]
pub(super) struct Accepted {
    pub(super) effect: usize,
    pub(super) candidate: Candidate,
    /// Columns among the terms.
    pub(super) columns: usize,
    pub(super) p_value: f64,
    pub(super) fold_gain: f64,
    /// Squared error that fell when it was accepted, by joint, (N·m)² summed over rows.
    pub(super) explained: Vec<f64>,
    /// The step that accepted it.
    pub(super) step: usize,
}

/// How a step ended.
enum Stepped {
    /// An effect was accepted.
    Accepted(&'static str),
    /// What fitted best scored no more than placebos do.
    Chance,
}

/// What a step decided.
#[derive(Debug)]
pub(super) struct Step {
    pub(super) number: usize,
    pub(super) effect: usize,
    /// Squared errors before it, by joint, (N·m)² summed over rows.
    pub(super) square_before: Vec<f64>,
    pub(super) comparison: Comparison,
    /// What an experiment would have to decide.
    pub(super) question: Option<Question>,
    pub(super) before: Vec<f64>,
    pub(super) after: Vec<f64>,
}

/// Placebos whose scores a step's choice must exceed.
const STEP_PLACEBOS: usize = 60;
/// Placebos that state the false-positive rate.
const FINAL_PLACEBOS: usize = 200;

/// An explanation in progress.
pub struct Session<'a> {
    /// Errors of the base model, and what it leaves on the other path.
    pub(super) before: Errors,
    pub(super) base_residual: Vec<Vec<f64>>,
    /// What is in logs of the other path only; its torque is taken out of them.
    pub(super) held: Option<NamedEffect>,
    pub(super) data: Data<'a>,
    pub(super) other: Data<'a>,
    /// Whether the other logs run the path of the fitted ones.
    pub(super) one_path: bool,
    /// When the logs are taken to have been recorded.
    pub(super) clock: Clock,
    pub(super) folds: Folds,
    pub(super) effects: Vec<Box<dyn Effect>>,
    pub(super) accepted: Vec<Accepted>,
    pub(super) steps: Vec<Step>,
    pub(super) fit: Fit,
    pub(super) false_positives: FalsePositives,
    pub(super) refused: Vec<Rival>,
    /// Accepted once and taken out again.
    pub(super) given_up: Vec<(usize, Candidate)>,
    /// What it was told beside the logs.
    pub(super) told: Options,
    /// Names that steps left open.
    pub(super) questions: Vec<Question>,
}

/// A name that an experiment has ruled out on some joints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RuledOut {
    /// The name.
    pub effect: String,
    /// The joints, from 0.
    pub joints: Vec<usize>,
    /// The name that the experiment speaks for instead.
    pub in_favour_of: String,
    /// What showed it.
    pub why_not: String,
}

impl fmt::Debug for Session<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session").field("accepted", &self.accepted).finish_non_exhaustive()
    }
}

/// Explains what the base model lacks on `logs`, judged on `validate`. `progress` is told what is being done.
///
/// # Errors
/// [`ExplainError`] where logs hold too little.
pub fn explain(
    body: &RigidBody,
    logs: &[Log],
    validate: &[Log],
    options: &DataOptions,
    progress: &dyn Fn(&str),
) -> Result<Explained, ExplainError> {
    explain_with(body, logs, validate, options, &Options::default(), progress)
}

/// What an explanation is told beside the logs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Names that an experiment has ruled out.
    pub ruled_out: Vec<RuledOut>,
    /// Whether what stays without a name is corrected where that helps.
    pub correct_unattributed: bool,
}

/// As [`explain`], with more to be told.
///
/// # Errors
/// As [`explain`].
pub fn explain_with(
    body: &RigidBody,
    logs: &[Log],
    validate: &[Log],
    options: &DataOptions,
    told: &Options,
    progress: &dyn Fn(&str),
) -> Result<Explained, ExplainError> {
    progress("preparing signals");
    let mut session = Session::begin(body, logs, validate, options, told, false, progress)?;
    session.run(progress);
    if session.one_path {
        progress("one path: joints by themselves");
        let mut apart = Session::begin(body, logs, validate, options, told, true, progress)?;
        apart.run(progress);
        if apart.predicts_better_than(&session) {
            session = apart;
        }
    }
    progress("looking at what is left");
    session.result()
}

impl<'a> Session<'a> {
    /// Fits the base model; `apart` gives every joint inertial parameters of its own.
    pub(super) fn begin(
        body: &'a RigidBody,
        logs: &[Log],
        validate: &[Log],
        options: &DataOptions,
        told: &Options,
        apart: bool,
        progress: &dyn Fn(&str),
    ) -> Result<Session<'a>, ExplainError> {
        let mut data = Data::new(body, logs, options).map_err(ExplainError::Fit)?;
        let mut other = Data::new(body, validate, options).map_err(ExplainError::Validate)?;
        data.take_apart(apart);
        other.take_apart(apart);
        progress("fitting the base model");
        let folds = Folds::new(&data);
        let base = fit(&data, &folds, &[], None);
        let held_out = base.residual_on(&other, &[]);
        let before = Errors { fit: spread(&data, &base.residual), validate: spread(&other, &held_out) };
        let held = match apart {
            true => None,
            false => payload_on(body, logs, validate, options, &base, &mut other)
                .map_err(ExplainError::Validate)?,
        };
        let one_path = repeats(&data, &other);
        let clock = running_time::settle(logs, validate, &mut data, &base, &mut other);
        Ok(Session {
            before,
            base_residual: held_out,
            held,
            one_path,
            clock,
            data,
            other,
            folds,
            effects: effects::all(),
            accepted: Vec::new(),
            steps: Vec::new(),
            fit: base,
            false_positives: FalsePositives { family_wise: rule::FAMILY_WISE, ..FalsePositives::default() },
            refused: Vec::new(),
            given_up: Vec::new(),
            told: told.clone(),
            questions: Vec::new(),
        })
    }
}

impl Session<'_> {
    /// Adds one effect after the other until nothing passes.
    pub(super) fn run(&mut self, progress: &dyn Fn(&str)) {
        for step in 0..rule::MOST_STEPS {
            progress(&format!("step {}: screening candidates", step + 1));
            match self.step(step) {
                Some(Stepped::Accepted(name)) => progress(&format!("step {}: {name} accepted", step + 1)),
                Some(Stepped::Chance) => {
                    progress(&format!("step {}: what fits best fits no better than placebos", step + 1));
                }
                // Only now is it known what is left beside all that fits.
                None => match self.withhold() {
                    Some((name, why)) => progress(&format!("{name} is not named: {why}")),
                    None => break,
                },
            }
        }
        while self.withhold().is_some() {}
        progress("improving settings");
        self.improve_settings();
        progress("asking placebos");
        self.count_false_positives();
    }

    /// One step of the loop; `None` where nothing passes.
    fn step(&mut self, step: usize) -> Option<Stepped> {
        let other_residual = self.fit.residual_on(&self.other, &self.other_columns(&self.fit));
        let (chosen, comparison, question, members, tested) = {
            let context = Context::new(&self.data, &self.fit, &self.fit.residual);
            let screen = Screen::new(&context);
            let mut tests = 0.0;
            let mut families = self.families(&screen, &mut tests);
            let path = Path {
                data: &self.other,
                design: Design::new(
                    &self.other,
                    &friction_columns(&self.other, &self.fit.shapes),
                    &self.other_columns(&self.fit),
                ),
                residual: other_residual.clone(),
            };
            let other_context = Context::new(&self.other, &self.fit, &other_residual);
            // Families are tested in the order of what they could reach, until none left could beat the best.
            let mut order: Vec<usize> = (0..families.len()).collect();
            order.sort_by(|a, b| families[*b].potential().total_cmp(&families[*a].potential()));
            let mut best: Option<(usize, f64)> = None;
            for f in order {
                if best.is_some_and(|(_, score)| families[f].potential() <= score) {
                    continue;
                }
                self.test(&screen, &mut families[f], tests, &path, &other_context);
                let score = families[f].potential();
                if score > best.map_or(0.0, |(_, s)| s) {
                    best = Some((f, score));
                }
            }
            self.refused = families
                .iter()
                .filter(|f| f.potential() == 0.0)
                .filter_map(|f| {
                    let best = f.members.iter().max_by(|a, b| a.trial.score.total_cmp(&b.trial.score))?;
                    let why_not = best.refusal.clone()?;
                    Some(Rival { effect: f.name.to_string(), why_not })
                })
                .collect();
            let Some((mut chosen, top)) = best else {
                self.questions.extend(Question::refused(&families));
                return None;
            };
            // What needs fewer columns and is as good is preferred.
            let least = top - (rule::AS_GOOD * top).max(rule::AS_GOOD_SCORE);
            for f in 0..families.len() {
                if f == chosen
                    || families[f].potential() < least
                    || families[f].columns() >= families[chosen].columns()
                {
                    continue;
                }
                self.test(&screen, &mut families[f], tests, &path, &other_context);
                if families[f].potential() >= least && families[f].columns() < families[chosen].columns() {
                    chosen = f;
                }
            }
            let passing: Vec<&Member> =
                families[chosen].members.iter().filter(|m| m.refusal.is_none()).collect();
            let trials: Vec<(&Trial, &[usize])> =
                passing.iter().map(|m| (&m.trial, m.candidate.joints.as_slice())).collect();
            let placebos = placebos(&screen, &trials, &self.folds, tests, STEP_PLACEBOS, step as u64);
            let mut scores = placebos.scores;
            scores.sort_by(f64::total_cmp);
            let level =
                scores.get((scores.len() as f64 * rule::PLACEBO_LEVEL) as usize).copied().unwrap_or(0.0);
            let members: Vec<usize> = (0..families[chosen].members.len())
                .filter(|m| {
                    let member = &families[chosen].members[*m];
                    member.refusal.is_none() && member.trial.score > level
                })
                .collect();
            if members.is_empty() {
                let chance = passing
                    .iter()
                    .map(|m| (families[chosen].effect, m.candidate.clone()))
                    .collect::<Vec<_>>();
                self.given_up.extend(chance);
                return Some(Stepped::Chance);
            }
            let mut joints: Vec<usize> =
                members.iter().flat_map(|m| families[chosen].members[*m].candidate.joints.clone()).collect();
            joints.sort_unstable();
            joints.dedup();
            let comparison = compare(&screen, &families, chosen, &joints);
            let question = Question::twins(&families, chosen, comparison.twin.as_deref(), &joints);
            let family = families.swap_remove(chosen);
            let kept: Vec<Member> = family
                .members
                .into_iter()
                .enumerate()
                .filter(|(m, _)| members.contains(m))
                .map(|(_, member)| member)
                .collect();
            (family.effect, comparison, question, kept, tests)
        };
        let squares =
            |fit: &Fit| -> Vec<f64> { fit.residual.iter().map(|r| r.iter().map(|v| v * v).sum()).collect() };
        let square_before = squares(&self.fit);
        let added: Vec<Candidate> = members.iter().map(|m| m.candidate.clone()).collect();
        for member in members {
            let Some(evidence) = member.evidence else { continue };
            let mut gains = evidence.fold_gains.clone();
            gains.sort_by(f64::total_cmp);
            self.accepted.push(Accepted {
                effect: chosen,
                columns: member.trial.columns.len(),
                candidate: member.candidate,
                p_value: (evidence.p_value * tested).min(1.0),
                fold_gain: gains.get(gains.len() / 2).copied().unwrap_or(0.0),
                explained: Vec::new(),
                step,
            });
        }
        self.refit();
        let fell: Vec<f64> =
            square_before.iter().zip(squares(&self.fit)).map(|(b, a)| (b - a).max(0.0)).collect();
        for a in self.accepted.iter_mut().filter(|a| a.explained.is_empty()) {
            a.explained.clone_from(&fell);
        }
        self.prune();
        // What does not last is not tried again: it would be accepted and taken out for ever.
        for candidate in added {
            if !self.has(chosen, &candidate) {
                self.given_up.push((chosen, candidate));
            }
        }
        let after = self.fit.residual_on(&self.other, &self.other_columns(&self.fit));
        self.steps.push(Step {
            number: step,
            effect: chosen,
            square_before,
            comparison,
            question,
            before: spread(&self.other, &other_residual).rms,
            after: spread(&self.other, &after).rms,
        });
        Some(Stepped::Accepted(self.effects[chosen].name()))
    }

    /// Asks placebos of every kind on the final residual: where nothing is missing any more, what passes is
    /// chance.
    fn count_false_positives(&mut self) {
        let context = Context::new(&self.data, &self.fit, &self.fit.residual);
        let screen = Screen::new(&context);
        let mut tests = 0.0;
        let families = self.families(&screen, &mut tests);
        let trials: Vec<(&Trial, &[usize])> = families
            .iter()
            .flat_map(|f| &f.members)
            .filter(|m| m.candidate.windows.is_empty())
            .map(|m| (&m.trial, m.candidate.joints.as_slice()))
            .collect();
        let found = placebos(&screen, &trials, &self.folds, tests, FINAL_PLACEBOS, 99);
        self.false_positives.placebos = found.scores.len();
        self.false_positives.accepted = found.accepted;
    }

    /// The accepted effects' columns on the data of a context.
    fn columns(&self, context: &Context<'_>) -> Vec<Column> {
        self.accepted.iter().flat_map(|a| self.effects[a.effect].columns(context, &a.candidate)).collect()
    }

    pub(super) fn other_columns(&self, fit: &Fit) -> Vec<Column> {
        let none: Vec<Vec<f64>> = vec![Vec::new(); self.other.dof()];
        self.columns(&Context::new(&self.other, fit, &none))
    }

    /// Refits everything; columns that depend on estimates are taken anew, twice.
    pub(super) fn refit(&mut self) {
        let mut found: Vec<(usize, Candidate)> =
            self.accepted.iter().map(|a| (a.effect, a.candidate.clone())).collect();
        self.fit = refitted(&self.data, &self.folds, &self.effects, &mut found, &self.fit);
        for (a, (_, candidate)) in self.accepted.iter_mut().zip(found) {
            a.candidate = candidate;
        }
        self.look_into_other_logs();
    }
}
