//! The best candidates of every effect, and which of them may stand beside each other and beside what was
//! accepted.

use super::evidence::{Evidence, Extent, Path, evidence};
use super::forward::{Accepted, Session};
use super::one_path::cannot_be_judged;
use super::rule;
use super::screen::{Screen, Trial};
use crate::explanation::effects::{Candidate, Context};
use crate::logs::parallel;

/// One effect's best candidates.
#[derive(Debug)]
pub(super) struct Family {
    /// Its place among the effects.
    pub(super) effect: usize,
    /// Its name.
    pub(super) name: &'static str,
    pub(super) members: Vec<Member>,
}

/// One candidate of an effect.
#[derive(Debug)]
pub(super) struct Member {
    pub(super) candidate: Candidate,
    pub(super) trial: Trial,
    /// Filled in once tested.
    pub(super) evidence: Option<Evidence>,
    pub(super) refusal: Option<String>,
    /// Whether the logs to judge on can tell it from any other misfit.
    pub(super) judged: bool,
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

    /// Whether anything of it on the given joints can be judged.
    #[must_use]
    pub(super) fn judged_on(&self, joints: &[usize]) -> bool {
        self.members.iter().any(|m| m.judged && m.candidate.joints.iter().any(|j| joints.contains(j)))
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
    pub(super) fn columns(&self) -> usize {
        self.members.iter().filter(|m| m.refusal.is_none()).map(|m| m.trial.columns.len()).sum()
    }

    /// Summed score of what was not refused.
    pub(super) fn potential(&self) -> f64 {
        self.members.iter().filter(|m| m.refusal.is_none()).map(|m| m.trial.score).sum()
    }
}

fn extent(candidate: &Candidate) -> Extent {
    let windows = &candidate.windows;
    let lasting = windows.iter().map(|w| w.to - w.from).filter(|seconds| seconds.is_finite());
    match lasting.reduce(f64::max) {
        Some(seconds) => Extent::Short(seconds),
        None if windows.is_empty() => Extent::Everywhere,
        None => Extent::SomeLogs,
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

impl Session<'_> {
    /// The best candidate of every effect and joint, and how many were tried in all.
    pub(super) fn families(&self, screen: &Screen<'_>, tests: &mut f64) -> Vec<Family> {
        let lists: Vec<(usize, Vec<Candidate>)> =
            (0..self.effects.len()).map(|e| (e, self.effects[e].candidates(screen.context))).collect();
        let mut families = Vec::new();
        for (e, candidates) in lists {
            let effect = self.effects[e].as_ref();
            if self.data.joints_apart && effect.of_the_body() {
                continue;
            }
            let open: Vec<Candidate> = (candidates.into_iter())
                .filter(|c| !self.has(e, c) && !self.is_ruled_out(effect.name(), c))
                .collect();
            *tests += open.iter().map(|c| c.searched.max(1.0)).fold(0.0, f64::max).max(open.len() as f64);
            let trials = parallel::map(&open, |c| screen.try_candidate(effect, c));
            let mut members: Vec<Member> = Vec::new();
            for (candidate, trial) in open.into_iter().zip(trials) {
                let Some(trial) = trial.filter(|t| t.score > 0.0) else { continue };
                match members.iter_mut().find(|m| m.candidate.joints == candidate.joints) {
                    Some(member) if member.trial.score >= trial.score => {}
                    Some(member) => (member.candidate, member.trial) = (candidate, trial),
                    None => {
                        members.push(Member {
                            candidate,
                            trial,
                            evidence: None,
                            refusal: None,
                            judged: true,
                        });
                    }
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
                } else if let Some(reason) =
                    self.one_path.then(|| cannot_be_judged(effect, &member.candidate, &self.data)).flatten()
                {
                    (member.refusal, member.judged) = (Some(reason), false);
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

    /// Members that do not exclude each other: the best one that acts on several joints with what goes beside
    /// it, or those of single joints, whichever explain more.
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
        // One cause for all joints is preferred to one for each.
        let as_good = single.0 - (rule::AS_GOOD * single.0).max(rule::AS_GOOD_SCORE);
        let kept = if as_good > wide.0 { single.1 } else { wide.1 };
        let mut at = 0;
        members.retain(|_| {
            at += 1;
            kept.contains(&(at - 1))
        });
        members
    }

    pub(super) fn has(&self, effect: usize, candidate: &Candidate) -> bool {
        self.accepted.iter().any(|a| a.effect == effect && self.same(effect, &a.candidate, candidate))
    }

    fn is_ruled_out(&self, name: &str, candidate: &Candidate) -> bool {
        let here = |joints: &[usize]| candidate.joints.iter().any(|j| joints.contains(j));
        self.told.ruled_out.iter().any(|r| r.effect == name && here(&r.joints))
    }

    fn gave_up(&self, effect: usize, candidate: &Candidate) -> bool {
        let again = |c: &Candidate| c.joints == candidate.joints && self.same(effect, c, candidate);
        self.given_up.iter().any(|(e, c)| *e == effect && again(c))
    }

    /// Whether two candidates of an effect are the same thing twice, so that one excludes the other. Several
    /// ripples, contacts and the like are not; a delay of all joints and one of a single joint are.
    pub(super) fn same(&self, effect: usize, a: &Candidate, b: &Candidate) -> bool {
        let joints = a.joints == b.joints;
        match (self.effects[effect].name(), a.values.first(), b.values.first()) {
            ("position_ripple", Some(x), Some(y)) => joints && (x - y).abs() < 0.5,
            ("joint_coupling", Some(x), Some(y)) => joints && x == y,
            ("broken_symmetry", ..) => joints && a.form == b.form,
            ("contact_wrench", ..) => a.windows.iter().any(|w| b.windows.contains(w)),
            _ => a.joints.iter().any(|j| b.joints.contains(j)),
        }
    }

    /// The accepted effect of which a member would only mend the law: on the joints where no accepted effect
    /// is large beside it, it would not count.
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

    /// Gathers the evidence for the members of a family that are still open, and judges it.
    pub(super) fn test(
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
            // An experiment leaves the paths of the other logs on purpose: a fold that holds all of it out
            // asks how the base model extrapolates. What the experiment speaks for is asked stretch by
            // stretch of every log instead.
            let spoken_for = self.told.ruled_out.iter().any(|r| r.in_favour_of == effect.name());
            let extent = match extent(&member.candidate) {
                Extent::Everywhere if spoken_for => Extent::SomeLogs,
                extent => extent,
            };
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
}
