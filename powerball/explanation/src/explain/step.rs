//! One step of the search: screen all candidates, test the groups that could be best, compare names, accept.

use super::comparison::{Comparison, Question, Step, compare};
use super::model::{Accepted, Model, Origin};
use super::named::Rival;
use super::search::{
    CandidateKind, Extent, Group, Member, Screen, Tester, eliminate, gains, groups, keep_needed,
    level_by_chance, level_of_search,
};
use super::study::Study;
use crate::effects::{Candidate, Effect, Placed};
use powerball_controller::JointNumber;
use powerball_identification::estimate::{Design, friction_columns, residual_stats};
use powerball_identification::evidence::{Rows, Trial};
use std::sync::OnceLock;

/// The proposal of a step, before the model is changed.
pub(super) struct Proposed {
    /// Effects of which nothing passed, and why.
    pub(super) refused: Vec<Rival>,
    pub(super) outcome: Outcome,
}

/// How a step ended.
pub(super) enum Outcome {
    /// A group passed.
    Named(Box<Choice>),
    /// The best candidate scored no more than surrogates.
    Chance(Vec<Candidate>),
    /// Nothing passed; names that fit a part may be open.
    Nothing,
}

/// A group that is accepted.
pub(super) struct Choice {
    effect: &'static dyn Effect,
    members: Vec<Member>,
    comparison: Comparison,
    question: Option<Question>,
    /// Candidates that were tried in all.
    tested: f64,
    /// rms on the validation set before it, by joint, N·m.
    before: Vec<f64>,
}

/// Screens, tests and compares candidates without a change of the model.
pub(super) fn propose(study: &Study<'_>, model: &Model, number: usize, among: CandidateKind) -> Proposed {
    let context = model.context(study);
    let screen = Screen::new(&context);
    let (mut groups, tests) = groups(study, model, &screen, among);
    let columns = model.columns_on_validation(study);
    let residual = model.fit.residual_on(&study.validation, &columns);
    let design =
        Design::new(&study.validation, &friction_columns(&study.validation, &model.fit.shapes), &columns);
    let validation = Rows { data: &study.validation, design: &design, residual: &residual };
    let on_validation = study.on_validation(&model.fit, &residual);
    let tester = Tester {
        study,
        screen: &screen,
        tests,
        validation: &validation,
        on_validation: &on_validation,
        model,
        cross_validation: OnceLock::new(),
    };
    let best = most_promising(&mut groups, &tester);
    let refused = refused(&groups);
    let Some(best) = best else {
        return Proposed { refused, outcome: Outcome::Nothing };
    };
    let chosen = simplest_as_good(&mut groups, best, &tester);
    let above = above_chance(&screen, &groups[chosen], number);
    if above.is_empty() {
        let chance = groups[chosen].passing().map(|m| m.candidate.clone()).collect();
        return Proposed { refused, outcome: Outcome::Chance(chance) };
    }
    let members = &groups[chosen].members;
    let mut joints: Vec<JointNumber> =
        above.iter().flat_map(|m| members[*m].candidate.joints.clone()).collect();
    joints.sort_unstable();
    joints.dedup();
    let comparison = compare(&screen, &groups, chosen, &joints);
    let question = Question::twins(study.rule(), &groups, chosen, comparison.twin.as_deref(), &joints);
    // Which formula is not a question of names.
    let question = question.filter(|_| groups[chosen].effect.has_name());
    let Group { effect, members } = groups.swap_remove(chosen);
    let kept = members.into_iter().enumerate().filter(|(m, _)| above.contains(m)).map(|(_, member)| member);
    let before = residual_stats(&study.validation, &residual).rms;
    let choice = Choice { effect, members: kept.collect(), comparison, question, tested: tests, before };
    Proposed { refused, outcome: Outcome::Named(Box::new(choice)) }
}

/// The group that scores most once tested. Groups are tested in the order of what they could reach, until
/// none left could beat the best.
fn most_promising(groups: &mut [Group], tester: &Tester<'_>) -> Option<usize> {
    let mut order: Vec<usize> = (0..groups.len()).collect();
    order.sort_by(|a, b| groups[*b].potential().total_cmp(&groups[*a].potential()));
    let mut best: Option<(usize, f64)> = None;
    for g in order {
        if best.is_some_and(|(_, score)| groups[g].potential() <= score) {
            continue;
        }
        tester.test(&mut groups[g]);
        let score = groups[g].potential();
        if score > best.map_or(0.0, |(_, s)| s) {
            best = Some((g, score));
        }
    }
    best.map(|(g, _)| g)
}

/// Prefers an equally good group that needs fewer columns.
fn simplest_as_good(groups: &mut [Group], best: usize, tester: &Tester<'_>) -> usize {
    let rule = tester.study.rule();
    let top = groups[best].potential();
    let mut chosen = best;
    for g in 0..groups.len() {
        let simpler = groups[g].columns() < groups[chosen].columns();
        if g == chosen || !rule.is_as_good(top, groups[g].potential()) || !simpler {
            continue;
        }
        tester.test(&mut groups[g]);
        if rule.is_as_good(top, groups[g].potential()) && groups[g].columns() < groups[chosen].columns() {
            chosen = g;
        }
    }
    chosen
}

/// The reason why the best member does not pass, for every group without a passing member.
fn refused(groups: &[Group]) -> Vec<Rival> {
    let nothing = groups.iter().filter(|g| g.potential() == 0.0);
    let why = |g: &Group| {
        let best = g.best()?;
        let joints = best.candidate.joints.clone();
        let why_not = best.refusal.clone()?;
        Some(Rival { effect: g.name().to_string(), joints, alike: false, why_not })
    };
    nothing.filter_map(why).collect()
}

/// The places of the members of a group that score more than time-shift surrogates do.
fn above_chance(screen: &Screen<'_>, group: &Group, number: usize) -> Vec<usize> {
    let trials: Vec<&Trial> = group.passing().map(|m| &m.trial).collect();
    let seed = number as u64;
    let short = group.passing().any(|m| matches!(Extent::of(&m.candidate), Extent::Short(_)));
    let mut level = level_by_chance(screen, &trials, short, seed);
    // Whether in some logs, and from when on, was looked for: chance is what that search finds.
    if group.passing().any(|m| Extent::of(&m.candidate) == Extent::SomeLogs) {
        level = level.max(level_of_search(screen.context, group.effect, seed));
    }
    let above = |m: &Member| m.refusal.is_none() && m.trial.score > level;
    (0..group.members.len()).filter(|m| above(&group.members[*m])).collect()
}

/// Adds a choice to the model: everything is refitted, and effects that it made unnecessary are removed.
pub(super) fn accept(study: &Study<'_>, model: &mut Model, choice: Choice, number: usize) -> Step {
    let Choice { effect, members, comparison, question, tested, before } = choice;
    let square_before = model.fit.residual.squares();
    let added: Vec<Candidate> = members.iter().map(|m| m.candidate.clone()).collect();
    let first = model.accepted.len();
    let count = members.iter().filter(|m| m.evidence.is_some()).count();
    for member in members {
        let Some(evidence) = member.evidence else { continue };
        model.accepted.push(Accepted {
            candidate: member.candidate,
            origin: Origin::Step { number, columns: member.trial.columns.len() },
            p_value: (evidence.p_value * tested).min(1.0),
            fold_gain: evidence.median_gain(),
            explained: Vec::new(),
        });
    }
    drop_covered(study, model, first);
    let first = model.accepted.len() - count;
    model.refit(study);
    let fell = square_before.iter().zip(model.fit.residual.squares()).map(|(b, a)| (b - a).max(0.0));
    let fell: Vec<f64> = fell.collect();
    model.accepted[first..].iter_mut().for_each(|a| a.explained.clone_from(&fell));
    eliminate(study, model);
    if !effect.has_name() {
        drop_words_for(study, model, number);
    }
    // An effect that does not last is not tried again: it would be accepted and removed for ever.
    let gone = added.into_iter().filter(|candidate| !model.has(candidate)).collect::<Vec<_>>();
    model.given_up.extend(gone);
    let after = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    Step { number, effect, square_before, comparison, question, before, after }
}

/// Takes out what was in the model from the start and is a part of what was accepted from `first` on: a
/// spring at rest elsewhere has the torque sensor's zero in it.
fn drop_covered(study: &Study<'_>, model: &mut Model, first: usize) {
    let context = model.context(study);
    let laws = |a: &Accepted| a.effect().placed_laws(&context, &a.candidate);
    let new: Vec<Vec<Placed>> = model.accepted[first..].iter().flat_map(laws).collect();
    let covered = |a: &Accepted| a.is_baseline() && laws(a).iter().all(|column| new.contains(column));
    let kept: Vec<bool> = model.accepted.iter().map(|a| !covered(a)).collect();
    let mut kept = kept.into_iter();
    model.accepted.retain(|_| kept.next().unwrap_or(true));
}

/// Takes out the names that a law without a name has made small on its joints: they were words for a part of
/// it.
fn drop_words_for(study: &Study<'_>, model: &mut Model, number: usize) {
    let laws: Vec<Accepted> = model.accepted.iter().filter(|a| a.step() == Some(number)).cloned().collect();
    let word = |(a, gain): (&Accepted, f64)| {
        let on = |law: &&Accepted| a.candidate.is_on(&law.candidate.joints);
        let explained = |law: &Accepted| -> f64 {
            let of = |j: &JointNumber| law.explained[j.index()] * model.fit.weights[j.index()];
            law.candidate.joints.iter().map(of).sum()
        };
        laws.iter().filter(on).any(|law| gain < study.rule().only_corrects_class * explained(law))
    };
    let gains = gains(model);
    let gone: Vec<bool> = (model.accepted.iter().zip(gains))
        .map(|(a, gain)| a.effect().has_name() && !a.is_baseline() && word((a, gain)))
        .collect();
    if gone.contains(&true) {
        let mut gone = gone.into_iter();
        model
            .given_up
            .extend(model.accepted.extract_if(.., |_| gone.next() == Some(true)).map(|a| a.candidate));
        model.refit(study);
    }
}

/// Like [`drop_words_for`], for all laws, once their settings fit best.
pub(super) fn drop_words(study: &Study<'_>, model: &mut Model) {
    let law = |a: &Accepted| a.step().filter(|_| !a.effect().has_name());
    let steps: Vec<usize> = model.accepted.iter().filter_map(law).collect();
    if !steps.is_empty() {
        steps.into_iter().for_each(|number| drop_words_for(study, model, number));
        eliminate(study, model);
    }
}

/// Called once everything else is known: effects that were in the model from the start are removed if they
/// are not needed, and get a name if they are. Returns the step of each name.
pub(super) fn judge_baseline(study: &Study<'_>, model: &mut Model) -> Vec<Step> {
    keep_needed(study, model);
    let mut effects: Vec<&'static dyn Effect> = Vec::new();
    for a in model.accepted.iter().filter(|a| a.is_baseline()) {
        if !effects.contains(&a.effect()) {
            effects.push(a.effect());
        }
    }
    let numbers = study.rule().most_steps..;
    effects
        .into_iter()
        .zip(numbers)
        .map(|(effect, number)| name_baseline(study, model, effect, number))
        .collect()
}

fn name_baseline(study: &Study<'_>, model: &mut Model, effect: &'static dyn Effect, number: usize) -> Step {
    let own = |a: &Accepted| a.is_baseline() && a.effect() == effect;
    let which: Vec<usize> = (0..model.accepted.len()).filter(|k| own(&model.accepted[*k])).collect();
    let after = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let fitted: Vec<Accepted> = model.accepted.clone();
    model.accepted.retain(|a| !own(a));
    model.refit(study);
    let context = model.context(study);
    let screen = Screen::new(&context);
    let (mut groups, _) = groups(study, model, &screen, CandidateKind::Names);
    groups.retain(|g| g.effect != effect);
    // An effect that contains it and explains no more is not a rival: a spring at rest elsewhere contains the
    // zero.
    let own: Vec<Vec<Placed>> =
        which.iter().flat_map(|k| effect.placed_laws(&context, &fitted[*k].candidate)).collect();
    let holds =
        |m: &Member| m.candidate.effect().placed_laws(&context, &m.candidate).iter().any(|l| own.contains(l));
    groups.iter_mut().for_each(|g| g.members.retain(|m| !holds(m)));
    let member = |k: &usize| {
        let candidate = fitted[*k].candidate.clone();
        let trial = screen.try_candidate(&candidate)?;
        Some(Member { candidate, trial, evidence: None, refusal: None, judged: true })
    };
    let members: Vec<Member> = which.iter().filter_map(member).collect();
    let mut joints: Vec<JointNumber> =
        which.iter().flat_map(|k| fitted[*k].candidate.joints.clone()).collect();
    joints.sort_unstable();
    groups.push(Group { effect, members });
    let comparison = compare(&screen, &groups, groups.len() - 1, &joints);
    let before = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let square_before = model.fit.residual.squares();
    model.accepted = fitted;
    which.iter().for_each(|k| {
        let columns = model.accepted[*k].columns();
        model.accepted[*k].origin = Origin::Step { number, columns };
    });
    model.refit(study);
    Step { number, effect, square_before, comparison, question: None, before, after }
}
