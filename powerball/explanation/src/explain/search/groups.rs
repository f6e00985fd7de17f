//! The best candidates of every effect, and which of them may be in the model together and with what was
//! accepted.

use super::super::model::{Accepted, Model};
use super::super::named::TAKEN_BACK;
use super::super::study::Study;
use super::cross_validation::CrossValidation;
use super::evidence::{Evidence, Extent, evidence, refusal};
use super::screen::Screen;
use crate::effects::{self, Candidate, Context, Effect};
use powerball_controller::JointNumber;
use powerball_identification::evidence::{Rows, Trial};
use powerball_logs::parallel;
use std::sync::OnceLock;

/// A candidate group: one effect's best candidates.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) effect: &'static dyn Effect,
    pub(crate) members: Vec<Member>,
}

/// One candidate of a group.
#[derive(Debug)]
pub(crate) struct Member {
    pub(crate) candidate: Candidate,
    pub(crate) trial: Trial,
    /// Filled in once tested.
    pub(crate) evidence: Option<Evidence>,
    pub(crate) refusal: Option<String>,
    /// Whether the validation set can distinguish it from any other error.
    pub(crate) judged: bool,
}

impl Group {
    /// The effect's name.
    pub(crate) fn name(&self) -> &'static str {
        self.effect.name()
    }

    /// The members that act on one of some joints.
    pub(crate) fn on<'g>(&'g self, joints: &'g [JointNumber]) -> impl Iterator<Item = &'g Member> {
        self.members.iter().filter(|m| m.candidate.is_on(joints))
    }

    /// The summed score of what acts on the given joints.
    pub(crate) fn score_on(&self, joints: &[JointNumber]) -> f64 {
        self.on(joints).map(|m| m.trial.score.max(0.0)).sum()
    }

    /// Whether anything of it on the given joints can be judged.
    pub(crate) fn judged_on(&self, joints: &[JointNumber]) -> bool {
        self.on(joints).any(|m| m.judged)
    }

    /// Why its best member on the given joints was refused.
    pub(crate) fn refusal_on(&self, joints: &[JointNumber]) -> Option<String> {
        best(self.on(joints)).and_then(|m| m.refusal.clone())
    }

    /// The group's best member.
    pub(crate) fn best(&self) -> Option<&Member> {
        best(self.members.iter())
    }

    /// The members that were not refused.
    pub(crate) fn passing(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|m| m.refusal.is_none())
    }

    /// Columns of what was not refused.
    pub(crate) fn columns(&self) -> usize {
        self.passing().map(|m| m.trial.columns.len()).sum()
    }

    /// Summed score of what was not refused.
    pub(crate) fn potential(&self) -> f64 {
        self.passing().map(|m| m.trial.score).sum()
    }
}

fn best<'m>(members: impl Iterator<Item = &'m Member>) -> Option<&'m Member> {
    members.max_by(|a, b| a.trial.score.total_cmp(&b.trial.score))
}

/// The kind of candidates to search for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CandidateKind {
    /// Effects that have a name.
    Names,
    /// Laws without one as well, where no name passes.
    Laws,
}

/// Whether the remaining error justifies a search for a law without a name.
pub(crate) fn is_left(study: &Study<'_>, model: &Model) -> bool {
    let context = model.context(study);
    effects::all().iter().any(|effect| !effect.has_name() && !effect.candidates(&context).is_empty())
}

/// The candidate group of every effect, and how many candidates were tried in all.
pub(crate) fn groups(
    study: &Study<'_>,
    model: &Model,
    screen: &Screen<'_>,
    among: CandidateKind,
) -> (Vec<Group>, f64) {
    let mut tests = 0.0;
    let mut groups = Vec::new();
    let asked = effects::all().iter().filter(|e| e.has_name() || among == CandidateKind::Laws);
    let lists: Vec<_> = asked.map(|e| (*e, e.candidates(screen.context))).collect();
    for (effect, candidates) in lists {
        if study.data.per_joint && effect.of_the_body() {
            continue;
        }
        let open: Vec<Candidate> =
            candidates.into_iter().filter(|c| !model.has(c) && !is_ruled_out(study, c)).collect();
        tests += open.iter().map(|c| c.searched.max(1.0)).fold(0.0, f64::max).max(open.len() as f64);
        let mut members = without_repeats(screen, compatible(screen, best_by_joint(screen, open)));
        for member in &mut members {
            if let Some((reason, judged)) = untested_refusal(study, model, screen, member) {
                (member.refusal, member.judged) = (Some(reason), judged);
            }
        }
        if !members.is_empty() {
            groups.push(Group { effect, members });
        }
    }
    (groups, tests)
}

/// The best candidate for each set of joints, its settings moved to better ones near by.
fn best_by_joint(screen: &Screen<'_>, candidates: Vec<Candidate>) -> Vec<Member> {
    let trials = parallel::map(&candidates, |c| screen.try_candidate(c));
    let mut members: Vec<Member> = Vec::new();
    for (candidate, trial) in candidates.into_iter().zip(trials) {
        let Some(trial) = trial.filter(|t| t.score > 0.0) else { continue };
        match members.iter_mut().find(|m| m.candidate.joints == candidate.joints) {
            Some(member) if member.trial.score >= trial.score => {}
            Some(member) => (member.candidate, member.trial) = (candidate, trial),
            None => members.push(Member { candidate, trial, evidence: None, refusal: None, judged: true }),
        }
    }
    let near = |(m, member): (usize, &Member)| {
        let neighbours = member.candidate.effect().neighbours(&member.candidate, 1.0);
        neighbours.into_iter().map(|candidate| (m, candidate)).collect::<Vec<_>>()
    };
    let near: Vec<(usize, Candidate)> = members.iter().enumerate().flat_map(near).collect();
    let trials = parallel::map(&near, |(_, candidate)| screen.try_candidate(candidate));
    for ((m, candidate), trial) in near.into_iter().zip(trials) {
        if let Some(trial) = trial.filter(|trial| trial.score > members[m].trial.score) {
            (members[m].candidate, members[m].trial) = (candidate, trial);
        }
    }
    members
}

/// Members that do not exclude each other: the best one that acts on several joints with what is possible
/// with it, or those of single joints, whichever explain more.
fn compatible(screen: &Screen<'_>, mut members: Vec<Member>) -> Vec<Member> {
    let rule = screen.context.rule;
    members.sort_by(|a, b| b.trial.score.total_cmp(&a.trial.score));
    let choose = |first: &dyn Fn(&Member) -> bool| -> (f64, Vec<usize>) {
        let mut kept: Vec<usize> = Vec::new();
        for m in (0..members.len()).filter(|m| first(&members[*m])) {
            if !kept.iter().any(|k| members[*k].candidate.excludes(&members[m].candidate)) {
                kept.push(m);
            }
        }
        (kept.iter().map(|m| members[*m].trial.score).sum(), kept)
    };
    let (single, wide) = (choose(&|m| m.candidate.joints.len() == 1), choose(&|_| true));
    // One cause for all joints is preferred to one for each.
    let kept = if rule.is_as_good(single.0, wide.0) { wide.1 } else { single.1 };
    let mut at = 0;
    members.retain(|_| {
        at += 1;
        kept.contains(&(at - 1))
    });
    members
}

/// Members with the gain that each adds to the better ones, not with the gain of each alone: the zeros of two
/// encoders on parallel axes are the same effect twice, and their sum would win over a name that is as good
/// as each. Members that add too little are removed. Only effects that act on all joints can be so similar.
fn without_repeats(screen: &Screen<'_>, members: Vec<Member>) -> Vec<Member> {
    let dof = screen.context.data.dof();
    let wide = |m: &Member| m.trial.columns.iter().all(|column| column.parts.len() == dof);
    if members.len() < 2 || !members.iter().all(wide) {
        return members;
    }
    let least = screen.context.rule.least_score;
    let (mut columns, mut gain) = (Vec::new(), 0.0);
    let added = |mut member: Member| {
        if member.trial.score < least {
            // Refused for that, with this reason.
            return Some(member);
        }
        let own = member.trial.columns.len();
        columns.extend(member.trial.columns.iter().cloned());
        let together = screen.base.ask(columns.clone(), 1.0).map_or(gain, |trial| trial.gain);
        let penalty = member.trial.gain - member.trial.score;
        if together - gain - penalty < least {
            columns.truncate(columns.len() - own);
            return None;
        }
        (member.trial.gain, member.trial.score) = (together - gain, together - gain - penalty);
        gain = together;
        Some(member)
    };
    members.into_iter().filter_map(added).collect()
}

/// Why a member need not be tested, and whether it could have been judged.
fn untested_refusal(
    study: &Study<'_>,
    model: &Model,
    screen: &Screen<'_>,
    member: &Member,
) -> Option<(String, bool)> {
    let (rule, candidate) = (study.rule(), &member.candidate);
    if member.trial.score < rule.least_score {
        return Some((format!("explains too little (score {:.1})", member.trial.score), true));
    }
    if study.one_path && candidate.effect().is_function_of_path(candidate, &study.data, rule) {
        let why = "the validation logs run the same path: a function of the path cannot be distinguished \
            there from any other misfit; record another path";
        return Some((why.to_string(), false));
    }
    if model.gave_up(candidate) {
        return Some((TAKEN_BACK.to_string(), true));
    }
    if let Some(name) = would_absorb(model, screen, member) {
        return Some((format!("gains too little to replace {name}"), true));
    }
    only_corrects(model, screen, member).map(|name| (format!("only corrects the law of {name}"), true))
}

/// The accepted effect that would be a part of a law without a name, if its residual is too small for a false
/// name.
fn would_absorb(model: &Model, screen: &Screen<'_>, member: &Member) -> Option<&'static str> {
    let Member { candidate, trial, .. } = member;
    if candidate.effect().has_name() {
        return None;
    }
    let laws = |c: &Candidate| c.effect().placed_laws(screen.context, c);
    let own = laws(candidate);
    let share = screen.context.rule.max_unexplained;
    let joint = candidate.joints[0];
    let absorbed = |a: &&Accepted| {
        let part = a.candidate.is_on(&[joint]) && laws(&a.candidate).iter().any(|law| own.contains(law));
        let explained = a.explained.get(joint.index()).copied().unwrap_or(0.0);
        part && trial.gain < share / (1.0 - share) * explained * model.fit.weights[joint.index()]
    };
    model.accepted.iter().filter(|a| !a.is_baseline()).find(absorbed).map(Accepted::effect).map(|e| e.name())
}

fn is_ruled_out(study: &Study<'_>, candidate: &Candidate) -> bool {
    let name = candidate.effect().name();
    study.options.ruled_out.iter().any(|r| r.effect == name && candidate.is_on(&r.joints))
}

/// Whether one of `event`'s windows begins or ends within `same_event` s of the beginning of one of
/// `earlier`'s.
fn begins_with(earlier: &Candidate, event: &Candidate, same_event: f64) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() < same_event;
    earlier.windows.iter().any(|e| {
        let mut same_log = event.windows.iter().filter(|w| w.log == e.log);
        same_log.any(|w| near(w.from, e.from) || near(w.to, e.from))
    })
}

/// The accepted effect of which a member would only correct the law: on the joints where no accepted effect
/// is large compared with it, it would not count.
fn only_corrects(model: &Model, screen: &Screen<'_>, member: &Member) -> Option<&'static str> {
    let (rule, effect) = (screen.context.rule, member.candidate.effect());
    // An event corrects nothing that lasts; but an event next to the beginning of another one corrects its
    // time.
    let baseline = |a: &Accepted| begins_with(&a.candidate, &member.candidate, rule.longest_block);
    let lasting: Vec<&Accepted> =
        model.accepted.iter().filter(|a| a.candidate.windows.is_empty() || baseline(a)).collect();
    let mut corrected = None;
    let mut rest = 0.0;
    for (joint, gain) in screen.gains(&member.trial, &member.candidate.joints) {
        let small = lasting.iter().find(|a| {
            let alike = a.effect().class() == effect.class() && a.effect() != effect;
            let share = if alike { rule.only_corrects_class } else { rule.negligible };
            let explained = a.explained.get(joint.index()).copied().unwrap_or(0.0);
            gain < share * explained * model.fit.weights[joint.index()]
        });
        match small {
            Some(a) => corrected = Some(a.effect().name()),
            None => rest += gain.max(0.0),
        }
    }
    corrected.filter(|_| rest < rule.least_score)
}

/// The data from which the evidence for members is computed.
pub(crate) struct Tester<'t> {
    pub(crate) study: &'t Study<'t>,
    pub(crate) screen: &'t Screen<'t>,
    /// Candidates that were tried in all.
    pub(crate) tests: f64,
    pub(crate) validation: &'t Rows<'t>,
    /// The model seen on the validation set.
    pub(crate) on_validation: &'t Context<'t>,
    /// The model that is judged.
    pub(crate) model: &'t Model,
    /// The judged model fitted to the validation set, once that is needed.
    pub(crate) cross_validation: OnceLock<CrossValidation>,
}

impl Tester<'_> {
    /// Gathers the evidence for the members of a group that are still open, and judges it.
    pub(crate) fn test(&self, group: &mut Group) {
        let open: Vec<usize> = (0..group.members.len())
            .filter(|m| group.members[*m].refusal.is_none() && group.members[*m].evidence.is_none())
            .collect();
        // An experiment leaves the paths of the other logs on purpose: a fold that holds all of it out would
        // test how the base model extrapolates. The name that the experiment favours is tested stretch by
        // stretch of every log instead.
        let spoken_for = self.study.options.ruled_out.iter().any(|r| r.in_favour_of == group.name());
        let found = parallel::map(&open, |m| {
            let Member { candidate, trial, .. } = &group.members[*m];
            let columns = self.on_validation.columns(candidate);
            let extent = match Extent::of(candidate) {
                Extent::Everywhere if spoken_for => Extent::SomeLogs,
                extent => extent,
            };
            let on_validation = Some((self.validation, columns.as_slice()));
            evidence(self.screen, trial, &candidate.joints, &self.study.folds, extent, on_validation)
        });
        for (m, evidence) in open.into_iter().zip(found) {
            let member = &mut group.members[m];
            let mut evidence = evidence;
            member.refusal = self.judge(&member.candidate, &member.trial, &mut evidence);
            member.evidence = Some(evidence);
        }
    }

    fn judge(&self, candidate: &Candidate, trial: &Trial, evidence: &mut Evidence) -> Option<String> {
        let swap = || CrossValidation::new(self.study, self.model, None);
        let Tester { study, screen, tests, cross_validation, .. } = self;
        Judge { study, screen, tests: *tests, cross_validation, swap: &swap }
            .judge(candidate, trial, evidence)
    }
}

/// Who decides on the evidence for a candidate.
pub(crate) struct Judge<'j> {
    pub(crate) study: &'j Study<'j>,
    pub(crate) screen: &'j Screen<'j>,
    /// Number of candidates that were tried in total.
    pub(crate) tests: f64,
    /// The model without the candidate, fitted to the validation set …
    pub(crate) cross_validation: &'j OnceLock<CrossValidation>,
    /// … and how it is fitted, once it is needed.
    pub(crate) swap: &'j (dyn Fn() -> CrossValidation + Sync),
}

impl Judge<'_> {
    /// Why a candidate is refused: neither many blocks and folds nor both ways round support it.
    pub(crate) fn judge(
        &self,
        candidate: &Candidate,
        trial: &Trial,
        evidence: &mut Evidence,
    ) -> Option<String> {
        let (rule, local) = (self.study.rule(), !candidate.windows.is_empty());
        let refusal = refusal(rule, evidence, self.tests, local)?;
        if local || evidence.score < rule.least_score || evidence.validation_gain < rule.large_gain() {
            return Some(refusal);
        }
        let cross_validation = self.cross_validation.get_or_init(self.swap);
        let both =
            cross_validation.ask(self.study, self.screen, (candidate, trial, evidence.validation_gain));
        let Some(both) = both.filter(|both| both.is_enough(rule, self.tests)) else { return Some(refusal) };
        evidence.p_value = both.p_value;
        None
    }
}
