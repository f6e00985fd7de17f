//! One effect at a time: screen, test, accept, refit everything, until nothing passes.

use super::curves::curves;
use super::evidence::{Evidence, Extent, Path, evidence};
use super::leftover::{depends_on, effective_samples, leftover};
use super::naming::{Comparison, compare};
use super::other_path::payload_on;
use super::placebo::placebos;
use super::result::{Errors, Explained, FalsePositives, NamedEffect, Rival, Unattributed};
use super::rule;
use super::screen::{Screen, Trial};
use crate::effects::{self, Candidate, Context, Effect, Found};
use crate::estimate::{Design, Fit, Folds, Solver, Term, fit, friction_columns, noise_floor, spread};
use crate::log::Log;
use crate::parallel;
use crate::regression::{Column, Data, DataError, DataOptions, RigidBody};
use std::fmt;

/// Why logs cannot be explained.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ExplainError {
    /// The logs to fit.
    Fit(DataError),
    /// The logs of the other path.
    Validate(DataError),
}

impl fmt::Display for ExplainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ExplainError::Fit(e) => write!(f, "--log: {e}"),
            ExplainError::Validate(e) => write!(f, "--validate: {e}"),
        }
    }
}

impl std::error::Error for ExplainError {}

/// One effect's best candidates.
#[derive(Debug)]
pub(super) struct Family {
    /// Its place among the effects.
    effect: usize,
    /// Its name.
    pub(super) name: &'static str,
    members: Vec<Member>,
}

#[derive(Debug)]
struct Member {
    candidate: Candidate,
    trial: Trial,
    /// Filled in once tested.
    evidence: Option<Evidence>,
    refusal: Option<String>,
}

impl Family {
    /// The summed score of what acts on the given joints.
    #[must_use]
    pub(super) fn score_on(&self, joints: &[usize]) -> f64 {
        self.members
            .iter()
            .filter(|m| m.candidate.joints.iter().any(|j| joints.contains(j)))
            .map(|m| m.trial.score.max(0.0))
            .sum()
    }

    /// Why its best member on the given joints was refused.
    #[must_use]
    pub(super) fn refusal_on(&self, joints: &[usize]) -> Option<String> {
        self.members
            .iter()
            .filter(|m| m.candidate.joints.iter().any(|j| joints.contains(j)))
            .max_by(|a, b| a.trial.score.total_cmp(&b.trial.score))
            .and_then(|m| m.refusal.clone())
    }

    /// Columns of what was not refused.
    fn columns(&self) -> usize {
        self.members.iter().filter(|m| m.refusal.is_none()).map(|m| m.trial.columns.len()).sum()
    }

    fn potential(&self) -> f64 {
        self.members.iter().filter(|m| m.refusal.is_none()).map(|m| m.trial.score).sum()
    }
}

/// An accepted effect on its joints.
#[derive(Debug)]
struct Accepted {
    effect: usize,
    candidate: Candidate,
    /// Columns among the terms.
    columns: usize,
    p_value: f64,
    fold_gain: f64,
    /// Squared error that fell when it was accepted, by joint, (N·m)² summed over rows.
    explained: Vec<f64>,
}

/// How a step ended.
enum Stepped {
    /// An effect was accepted.
    Accepted(&'static str),
    /// What fitted best could not be told from its rivals and left much.
    Withdrawn,
}

/// What a step decided.
#[derive(Debug)]
struct Step {
    effect: usize,
    comparison: Comparison,
    before: Vec<f64>,
    after: Vec<f64>,
}

fn extent(candidate: &Candidate) -> Extent {
    match candidate.windows.as_slice() {
        [] => Extent::Everywhere,
        windows if windows.iter().any(|w| w.to.is_finite()) => Extent::Short,
        _ => Extent::SomeLogs,
    }
}

/// Two events this close count as one whose time is a little off, s.
const BESIDE: f64 = 2.0;

/// Whether one of `event`'s windows begins or ends beside the beginning of one of `earlier`'s.
fn begins_beside(earlier: &Candidate, event: &Candidate) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() < BESIDE;
    earlier.windows.iter().any(|e| {
        let mut same_log = event.windows.iter().filter(|w| w.log == e.log);
        same_log.any(|w| near(w.from, e.from) || near(w.to, e.from))
    })
}

/// Placebos whose scores a step's choice must exceed.
const STEP_PLACEBOS: usize = 60;
/// Placebos that state the false-positive rate.
const FINAL_PLACEBOS: usize = 200;

/// An explanation in progress.
pub struct Session<'a> {
    /// What is in logs of the other path only; its torque is taken out of them.
    held: Option<NamedEffect>,
    data: Data<'a>,
    other: Data<'a>,
    folds: Folds,
    effects: Vec<Box<dyn Effect>>,
    accepted: Vec<Accepted>,
    steps: Vec<Step>,
    fit: Fit,
    false_positives: FalsePositives,
    refused: Vec<Rival>,
    /// Accepted once and taken out again.
    given_up: Vec<(usize, Candidate)>,
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
    progress("preparing signals");
    let data = Data::new(body, logs, options).map_err(ExplainError::Fit)?;
    let mut other = Data::new(body, validate, options).map_err(ExplainError::Validate)?;
    progress("fitting the base model");
    let folds = Folds::new(&data);
    let base = fit(&data, &folds, &[], None);
    let held_out = base.residual_on(&other, &[]);
    let before = Errors { fit: spread(&data, &base.residual), validate: spread(&other, &held_out) };
    let held =
        payload_on(body, logs, validate, options, &base, &mut other).map_err(ExplainError::Validate)?;
    let mut session = Session {
        held,
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
    };
    for step in 0..rule::MOST_STEPS {
        progress(&format!("step {}: screening candidates", step + 1));
        match session.step(step) {
            None => break,
            Some(Stepped::Accepted(name)) => progress(&format!("step {}: {name} accepted", step + 1)),
            Some(Stepped::Withdrawn) => {
                progress(&format!("step {}: what fits best cannot be named", step + 1))
            }
        }
    }
    progress("asking placebos");
    session.count_false_positives();
    progress("looking at what is left");
    Ok(session.result(before, &held_out))
}

impl Session<'_> {
    /// One step of the loop; `None` where nothing passes.
    fn step(&mut self, step: usize) -> Option<Stepped> {
        let other_residual = self.fit.residual_on(&self.other, &self.other_columns(&self.fit));
        let (chosen, comparison, members, tested) = {
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
            let (mut chosen, top) = best?;
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
                return None;
            }
            let mut joints: Vec<usize> =
                members.iter().flat_map(|m| families[chosen].members[*m].candidate.joints.clone()).collect();
            joints.sort_unstable();
            joints.dedup();
            let comparison = compare(&families, chosen, &joints);
            let family = families.swap_remove(chosen);
            let kept: Vec<Member> = family
                .members
                .into_iter()
                .enumerate()
                .filter(|(m, _)| members.contains(m))
                .map(|(_, member)| member)
                .collect();
            (family.effect, comparison, kept, tests)
        };
        let squares =
            |fit: &Fit| -> Vec<f64> { fit.residual.iter().map(|r| r.iter().map(|v| v * v).sum()).collect() };
        let square_before = squares(&self.fit);
        let earlier = self.accepted.len();
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
            });
        }
        self.refit();
        if comparison.margin < rule::LEAST_MARGIN
            && self.share_left(&square_before, &comparison.joints) > rule::MUCH_LEFT
        {
            // Not named; it stays as a rival of what comes.
            self.accepted.truncate(earlier);
            self.given_up.extend(added.into_iter().map(|c| (chosen, c)));
            self.refit();
            return Some(Stepped::Withdrawn);
        }
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
            effect: chosen,
            comparison,
            before: spread(&self.other, &other_residual).rms,
            after: spread(&self.other, &after).rms,
        });
        Some(Stepped::Accepted(self.effects[chosen].name()))
    }

    /// The share of the excess over the noise floor that stayed on some joints, given the squared errors before.
    fn share_left(&self, before: &[f64], joints: &[usize]) -> f64 {
        let rms = |j: usize, square: f64| (square / self.data.joints[j].len().max(1) as f64).sqrt();
        let before: Vec<f64> = before.iter().enumerate().map(|(j, s)| rms(j, *s)).collect();
        let after = spread(&self.data, &self.fit.residual).rms;
        leftover(&before, &after, &noise_floor(&self.data), joints)
    }

    /// Asks placebos of every kind on the final residual: where nothing is missing any more, what passes is chance.
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

    /// The best candidate of every effect and joint, and how many were tried in all.
    fn families(&self, screen: &Screen<'_>, tests: &mut f64) -> Vec<Family> {
        let lists: Vec<(usize, Vec<Candidate>)> =
            (0..self.effects.len()).map(|e| (e, self.effects[e].candidates(screen.context))).collect();
        let mut families = Vec::new();
        for (e, candidates) in lists {
            let effect = self.effects[e].as_ref();
            let open: Vec<Candidate> = candidates.into_iter().filter(|c| !self.has(e, c)).collect();
            *tests += open.iter().map(|c| c.searched.max(1.0)).fold(0.0, f64::max).max(open.len() as f64);
            let trials = parallel::map(&open, |c| screen.try_candidate(effect, c));
            let mut members: Vec<Member> = Vec::new();
            for (candidate, trial) in open.into_iter().zip(trials) {
                let Some(trial) = trial.filter(|t| t.score > 0.0) else { continue };
                match members.iter_mut().find(|m| m.candidate.joints == candidate.joints) {
                    Some(member) if member.trial.score >= trial.score => {}
                    Some(member) => (member.candidate, member.trial) = (candidate, trial),
                    None => members.push(Member { candidate, trial, evidence: None, refusal: None }),
                }
            }
            for member in &mut members {
                for candidate in effect.neighbours(&member.candidate) {
                    if let Some(trial) = screen.try_candidate(effect, &candidate)
                        && trial.score > member.trial.score
                    {
                        (member.candidate, member.trial) = (candidate, trial);
                    }
                }
            }
            let mut members = self.compatible(e, members);
            for member in &mut members {
                if member.trial.score < rule::LEAST_SCORE {
                    member.refusal = Some(format!("explains too little (score {:.1})", member.trial.score));
                } else if self.gave_up(e, &member.candidate) {
                    member.refusal = Some("did not last, or could not be told from its rivals".to_string());
                } else if let Some(name) = self.mends(screen, e, member) {
                    member.refusal = Some(format!("only mends the law of {name}"));
                }
            }
            if !members.is_empty() {
                families.push(Family { effect: e, name: effect.name(), members });
            }
        }
        families
    }

    /// Members that do not exclude each other: the best one that acts on several joints with what goes beside it, or those of
    /// single joints, whichever explain more.
    fn compatible(&self, effect: usize, mut members: Vec<Member>) -> Vec<Member> {
        members.sort_by(|a, b| b.trial.score.total_cmp(&a.trial.score));
        let choose = |first: &dyn Fn(&Member) -> bool| -> (f64, Vec<usize>) {
            let mut kept: Vec<usize> = Vec::new();
            let order = (0..members.len()).filter(|m| first(&members[*m]));
            for m in order {
                let excluded = |k: &usize| self.same(effect, &members[*k].candidate, &members[m].candidate);
                if !kept.iter().any(excluded) {
                    kept.push(m);
                }
            }
            (kept.iter().map(|m| members[*m].trial.score).sum(), kept)
        };
        let (single, wide) = (choose(&|m| m.candidate.joints.len() == 1), choose(&|_| true));
        let kept = if single.0 > wide.0 { single.1 } else { wide.1 };
        let mut at = 0;
        members.retain(|_| {
            at += 1;
            kept.contains(&(at - 1))
        });
        members
    }

    fn has(&self, effect: usize, candidate: &Candidate) -> bool {
        self.accepted.iter().any(|a| a.effect == effect && self.same(effect, &a.candidate, candidate))
    }

    fn gave_up(&self, effect: usize, candidate: &Candidate) -> bool {
        let again = |c: &Candidate| c.joints == candidate.joints && self.same(effect, c, candidate);
        self.given_up.iter().any(|(e, c)| *e == effect && again(c))
    }

    /// Whether two candidates of an effect are the same thing twice, so that one excludes the other. Several ripples, contacts
    /// and the like are not; a delay of all joints and one of a single joint are.
    fn same(&self, effect: usize, a: &Candidate, b: &Candidate) -> bool {
        let joints = a.joints == b.joints;
        match (self.effects[effect].name(), a.values.first(), b.values.first()) {
            ("position_ripple", Some(x), Some(y)) => joints && (x - y).abs() < 0.5,
            ("joint_coupling", Some(x), Some(y)) => joints && x == y,
            ("broken_symmetry", ..) => joints && a.form == b.form,
            ("contact_wrench", ..) => a.windows == b.windows,
            _ => a.joints.iter().any(|j| b.joints.contains(j)),
        }
    }

    /// The accepted effect of which a member would only mend the law: on the joints where no accepted effect is large
    /// beside it, it would not count.
    fn mends(&self, screen: &Screen<'_>, effect: usize, member: &Member) -> Option<&'static str> {
        let class = self.effects[effect].class();
        // An event mends nothing that lasts; but an event beside the beginning of another one mends its time.
        let lasting: Vec<&Accepted> = (self.accepted.iter())
            .filter(|a| a.candidate.windows.is_empty() || begins_beside(&a.candidate, &member.candidate))
            .collect();
        let mut mended = None;
        let mut rest = 0.0;
        for (j, gain) in screen.gains(&member.trial, &member.candidate.joints) {
            let small = lasting.iter().find(|a| {
                let alike = self.effects[a.effect].class() == class && a.effect != effect;
                let share = if alike { rule::MENDS_ONLY } else { rule::MENDS_ANY };
                let explained = a.explained.get(j).copied().unwrap_or(0.0);
                gain < share * explained * self.fit.weights[j]
            });
            match small {
                Some(a) => mended = Some(self.effects[a.effect].name()),
                None => rest += gain.max(0.0),
            }
        }
        mended.filter(|_| rest < rule::LEAST_SCORE)
    }

    fn test(
        &self,
        screen: &Screen<'_>,
        family: &mut Family,
        tests: f64,
        path: &Path<'_>,
        other: &Context<'_>,
    ) {
        let effect = self.effects[family.effect].as_ref();
        let open: Vec<usize> = (0..family.members.len())
            .filter(|m| family.members[*m].refusal.is_none() && family.members[*m].evidence.is_none())
            .collect();
        let found = parallel::map(&open, |m| {
            let member = &family.members[*m];
            let columns = effect.columns(other, &member.candidate);
            let extent = extent(&member.candidate);
            evidence(
                screen,
                &member.trial,
                &member.candidate.joints,
                &self.folds,
                extent,
                Some((path, &columns)),
            )
        });
        for (m, evidence) in open.into_iter().zip(found) {
            let member = &mut family.members[m];
            member.refusal = rule::refusal(&evidence, tests, !member.candidate.windows.is_empty());
            member.evidence = Some(evidence);
        }
    }

    /// The accepted effects' columns on the data of a context.
    fn columns(&self, context: &Context<'_>) -> Vec<Column> {
        self.accepted.iter().flat_map(|a| self.effects[a.effect].columns(context, &a.candidate)).collect()
    }

    fn other_columns(&self, fit: &Fit) -> Vec<Column> {
        let none: Vec<Vec<f64>> = vec![Vec::new(); self.other.dof()];
        self.columns(&Context::new(&self.other, fit, &none))
    }

    /// Refits everything; columns that depend on estimates are taken anew, twice.
    fn refit(&mut self) {
        for _ in 0..2 {
            let terms: Vec<Term> = {
                let context = Context::new(&self.data, &self.fit, &self.fit.residual);
                self.accepted
                    .iter()
                    .flat_map(|a| {
                        let effect = self.effects[a.effect].as_ref();
                        let non_negative = effect.non_negative();
                        let columns = effect.columns(&context, &a.candidate);
                        columns.into_iter().map(move |column| Term { column, non_negative })
                    })
                    .collect()
            };
            self.fit = fit(&self.data, &self.folds, &terms, Some(&self.fit));
            let mut first = 0;
            for a in &mut self.accepted {
                let coefficients: Vec<f64> =
                    (first..first + a.columns).map(|c| self.fit.coefficient(c)).collect();
                first += a.columns;
                if let Some(refined) = self.effects[a.effect].refined(&a.candidate, &coefficients) {
                    a.candidate = refined;
                }
            }
        }
    }

    /// Takes out what later additions made unneeded.
    fn prune(&mut self) {
        loop {
            let (gram, right, square) = self.fit.gram.sum(&self.fit.weights, |_| true);
            let error = |without: &dyn Fn(usize) -> bool| {
                let theta = Solver::new(&gram, |c| self.fit.free[c] && !without(c)).solve(&right);
                square - theta.iter().zip(&right).map(|(x, r)| x * r).sum::<f64>()
            };
            let full = error(&|_| false);
            let mut first = 0;
            let mut weakest: Option<(usize, f64)> = None;
            for (k, a) in self.accepted.iter().enumerate() {
                let columns = self.fit.design.extra(first)..self.fit.design.extra(first) + a.columns;
                first += a.columns;
                let penalty =
                    rule::PER_COEFFICIENT * a.columns as f64 + 2.0 * a.candidate.searched.max(1.0).ln();
                let score = error(&|c| columns.contains(&c)) - full - penalty;
                if score < rule::LEAST_SCORE && weakest.is_none_or(|(_, w)| score < w) {
                    weakest = Some((k, score));
                }
            }
            let Some((k, _)) = weakest else { return };
            self.accepted.remove(k);
            self.refit();
        }
    }

    fn coefficients(&self) -> Vec<Vec<f64>> {
        let mut first = 0;
        self.accepted
            .iter()
            .map(|a| {
                let c = (first..first + a.columns).map(|c| self.fit.coefficient(c)).collect();
                first += a.columns;
                c
            })
            .collect()
    }

    fn result(mut self, before: Errors, base_residual: &[Vec<f64>]) -> Explained {
        let residual = self.fit.residual_on(&self.other, &self.other_columns(&self.fit));
        let after =
            Errors { fit: spread(&self.data, &self.fit.residual), validate: spread(&self.other, &residual) };
        let curves = curves(&self.other, base_residual, &residual);
        let floor = noise_floor(&self.data);
        let context = Context::new(&self.data, &self.fit, &self.fit.residual);
        let coefficients = self.coefficients();
        let mut named: Vec<NamedEffect> = self.held.take().into_iter().collect();
        let mut order: Vec<usize> = Vec::new();
        for a in &self.accepted {
            if !order.contains(&a.effect) {
                order.push(a.effect);
            }
        }
        for e in order {
            let mine: Vec<usize> =
                (0..self.accepted.len()).filter(|k| self.accepted[*k].effect == e).collect();
            let found: Vec<Found<'_>> = mine
                .iter()
                .map(|k| Found { candidate: &self.accepted[*k].candidate, coefficients: &coefficients[*k] })
                .collect();
            let mut joints: Vec<usize> = found.iter().flat_map(|f| f.candidate.joints.clone()).collect();
            joints.sort_unstable();
            joints.dedup();
            let steps: Vec<&Step> = self.steps.iter().filter(|s| s.effect == e).collect();
            let (Some(first), Some(last)) = (steps.first(), steps.last()) else { continue };
            let mut logs: Vec<String> =
                found.iter().flat_map(|f| f.candidate.windows.iter().map(|w| w.log.clone())).collect();
            logs.dedup();
            let effect = self.effects[e].as_ref();
            named.push(NamedEffect {
                effect: effect.name().to_string(),
                parameters: effect.parameters(&context, &found),
                rms_before: joints.iter().map(|j| first.before[*j]).collect(),
                rms_after: joints.iter().map(|j| last.after[*j]).collect(),
                p_value: mine.iter().map(|k| self.accepted[*k].p_value).fold(0.0, f64::max),
                held_out_gain: mine.iter().map(|k| self.accepted[*k].fold_gain).collect(),
                logs,
                margin: first.comparison.margin,
                leftover: leftover(&before.fit.rms, &after.fit.rms, &floor, &joints),
                class: effect.class().name().to_string(),
                rivals: first.comparison.rivals.clone(),
                joints: joints.iter().map(|j| j + 1).collect(),
            });
        }
        let unattributed = self.unattributed(&context, &floor, &after);
        let next_experiment = self.steps.iter().find_map(|s| {
            let twin = s.comparison.twin.as_ref()?;
            let name = self.effects[s.effect].name();
            Some(serde_json::json!({
                "to_tell_apart": [name, twin],
                "advice": format!("record the joints concerned on a path with other positions, speeds and loads than these logs: {name} and {twin} explain them equally well"),
            }))
        });
        let effective_samples = effective_samples(&self.data, &self.fit.residual);
        self.false_positives.rate =
            self.false_positives.accepted as f64 / (self.false_positives.placebos.max(1)) as f64;
        Explained {
            arm: self.data.body.arm().name.clone(),
            before,
            after,
            noise_floor: floor,
            effects: named,
            band: [0.0, self.data.band.cutoff],
            effective_samples,
            unattributed,
            next_experiment,
            false_positives: self.false_positives.clone(),
            warnings: self.data.notes.iter().chain(&self.other.notes).cloned().collect(),
            curves,
        }
    }

    /// The joints whose residual still depends on something.
    fn unattributed(&self, context: &Context<'_>, floor: &[f64], after: &Errors) -> Option<Unattributed> {
        let candidates: Vec<usize> = context
            .moving_joints()
            .filter(|j| after.fit.rms[*j] > 1.2 * floor[*j] && self.fit.inflation[*j] > 2.0)
            .collect();
        let found = parallel::map(&candidates, |j| depends_on(context, *j));
        let mut signals: Vec<(String, f64)> = Vec::new();
        let mut joints = Vec::new();
        for (j, list) in candidates.iter().zip(found) {
            if list.is_empty() {
                continue;
            }
            joints.push(*j);
            for (name, share) in list {
                match signals.iter_mut().find(|(n, _)| *n == name) {
                    Some((_, s)) => *s = s.max(share),
                    None => signals.push((name, share)),
                }
            }
        }
        signals.sort_by(|a, b| b.1.total_cmp(&a.1));
        (!joints.is_empty()).then(|| Unattributed {
            rms: joints.iter().map(|j| after.fit.rms[*j]).collect(),
            joints: joints.iter().map(|j| j + 1).collect(),
            depends_on: signals.into_iter().map(|(name, _)| name).collect(),
            considered: self.refused.clone(),
        })
    }
}
