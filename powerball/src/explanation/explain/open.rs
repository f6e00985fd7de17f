//! Names that logs leave open, each fitted to them: what an experiment can be designed for and decided by.

use super::family::Family;
use super::forward::Session;
use super::rule;
use crate::explanation::effects::{self, Candidate, Context, Effect};
use crate::identification::estimate::{Design, Fit, Folds, Term, fit, friction_columns};
use crate::logs::regression::{Column, Data};

/// Names for the same residual that the logs do not tell apart, the preferred one first.
#[derive(Debug)]
pub struct Open {
    /// At least two.
    pub hypotheses: Vec<Hypothesis>,
}

/// The base model with all that was accepted and one of the open names.
#[derive(Debug)]
pub struct Hypothesis {
    /// The open name.
    pub name: &'static str,
    /// Its joints, from 0.
    pub joints: Vec<usize>,
    /// All effects of the model, those of the open name last.
    effects: Vec<(usize, Candidate)>,
    /// How many of them are of the open name.
    own: usize,
    /// The columns of the open name on the logs that it was fitted to.
    pub fitted_columns: Vec<Column>,
    /// The model.
    pub fit: Fit,
}

impl Open {
    /// The names.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.hypotheses.iter().map(|h| h.name).collect()
    }
}

impl Hypothesis {
    /// The columns of the open name on some data.
    #[must_use]
    pub fn own_columns(&self, data: &Data<'_>) -> Vec<Column> {
        let context = Context::new(data, &self.fit, &[]);
        columns(&effects::all(), &context, &self.effects[self.effects.len() - self.own..])
    }

    /// The columns of the whole model on some data.
    #[must_use]
    pub fn design(&self, data: &Data<'_>) -> Design {
        let context = Context::new(data, &self.fit, &[]);
        let columns = columns(&effects::all(), &context, &self.effects);
        Design::new(data, &friction_columns(data, &self.fit.shapes), &columns)
    }

    /// What this name explains alone on some data, by joint, N·m.
    #[must_use]
    pub fn own_torque(&self, data: &Data<'_>) -> Vec<Vec<f64>> {
        let columns = self.own_columns(data);
        let first = self.fit.design.size - self.fit.design.extra(0) - columns.len();
        let mut torque: Vec<Vec<f64>> = data.joints.iter().map(|rows| vec![0.0; rows.len()]).collect();
        for (k, column) in columns.iter().enumerate() {
            let coefficient = self.fit.coefficient(first + k);
            for (j, values) in &column.parts {
                torque[*j].iter_mut().zip(values).for_each(|(t, v)| *t += coefficient * v);
            }
        }
        torque
    }

    /// The same name fitted to other data.
    #[must_use]
    pub fn fitted_to(&self, data: &Data<'_>, folds: &Folds) -> Hypothesis {
        let mut effects = self.effects.clone();
        let fit = refitted(data, folds, &effects::all(), &mut effects, &self.fit);
        Hypothesis::new(data, self.name, self.joints.clone(), effects, self.own, fit)
    }

    fn new(
        data: &Data<'_>,
        name: &'static str,
        joints: Vec<usize>,
        effects: Vec<(usize, Candidate)>,
        own: usize,
        fit: Fit,
    ) -> Hypothesis {
        let mut new = Hypothesis { name, joints, effects, own, fitted_columns: Vec::new(), fit };
        new.fitted_columns = new.own_columns(data);
        new
    }
}

fn columns(all: &[Box<dyn Effect>], context: &Context<'_>, of: &[(usize, Candidate)]) -> Vec<Column> {
    of.iter().flat_map(|(effect, candidate)| all[*effect].columns(context, candidate)).collect()
}

/// Fits the base model with some effects; columns that depend on estimates are taken anew, twice.
pub(super) fn refitted(
    data: &Data<'_>,
    folds: &Folds,
    all: &[Box<dyn Effect>],
    found: &mut [(usize, Candidate)],
    start: &Fit,
) -> Fit {
    let once = |found: &mut [(usize, Candidate)], start: &Fit| {
        let context = Context::new(data, start, &start.residual);
        let mut terms: Vec<Term> = Vec::new();
        let mut counts = Vec::new();
        for (effect, candidate) in found.iter() {
            let effect = all[*effect].as_ref();
            let (before, non_negative) = (terms.len(), effect.non_negative());
            let columns = effect.columns(&context, candidate).into_iter();
            terms.extend(columns.map(|column| Term { column, non_negative }));
            counts.push(terms.len() - before);
        }
        let fitted = fit(data, folds, &terms, Some(start));
        let mut first = 0;
        for ((effect, candidate), count) in found.iter_mut().zip(counts) {
            let coefficients: Vec<f64> = (first..first + count).map(|c| fitted.coefficient(c)).collect();
            first += count;
            if let Some(refined) = all[*effect].refined(candidate, &coefficients) {
                *candidate = refined;
            }
        }
        fitted
    };
    let first = once(found, start);
    once(found, &first)
}

/// Why names are open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Why {
    /// A name was given, and another one fits as well.
    Twin,
    /// What fits best was not given.
    Withheld,
    /// Several fit a part, none passes.
    Refused,
}

/// Proposals for the same residual, from one step.
#[derive(Clone, Debug)]
pub(super) struct Question {
    why: Why,
    joints: Vec<usize>,
    proposals: Vec<(usize, Vec<Candidate>)>,
}

impl Question {
    /// A chosen family against its twin.
    pub(super) fn twins(
        families: &[Family],
        chosen: usize,
        twin: Option<&str>,
        joints: &[usize],
    ) -> Option<Question> {
        let twin = families.iter().position(|f| Some(f.name) == twin)?;
        Question::of(families, &[chosen, twin], joints, Why::Twin)
    }

    /// The same where the name is not given.
    pub(super) fn withheld(self) -> Question {
        Question { why: Why::Withheld, ..self }
    }

    /// The two best of the families that were all refused.
    pub(super) fn refused(families: &[Family]) -> Option<Question> {
        let mut best: Vec<(usize, f64, &[usize])> = (families.iter().enumerate())
            .filter_map(|(f, family)| {
                let best = family.members.iter().max_by(|a, b| a.trial.score.total_cmp(&b.trial.score))?;
                let joints = best.candidate.joints.as_slice();
                (best.trial.score >= rule::LEAST_SCORE).then_some((f, best.trial.score, joints))
            })
            .collect();
        best.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (first, _, joints) = *best.first()?;
        let (second, ..) = *best.iter().skip(1).find(|(.., own)| own.iter().any(|j| joints.contains(j)))?;
        Question::of(families, &[first, second], joints, Why::Refused)
    }

    fn of(families: &[Family], which: &[usize], joints: &[usize], why: Why) -> Option<Question> {
        let proposal = |f: &usize| {
            let of_these = |c: &Candidate| c.joints.iter().any(|j| joints.contains(j));
            let candidates: Vec<Candidate> = (families[*f].members.iter())
                .filter(|m| m.trial.score >= rule::LEAST_SCORE && of_these(&m.candidate))
                .map(|m| m.candidate.clone())
                .collect();
            (!candidates.is_empty()).then_some((families[*f].effect, candidates))
        };
        let proposals = which.iter().map(proposal).collect::<Option<Vec<_>>>()?;
        Some(Question { why, joints: joints.to_vec(), proposals })
    }
}

impl Session<'_> {
    /// What stays open after all steps: a name with a twin, else a name that was not given, else, where
    /// something is left without a name, what fits a part of it.
    pub(super) fn open(&self, something_left: bool) -> Option<Open> {
        let standing = |q: &&Question| match q.why {
            Why::Twin => {
                let (effect, candidates) = &q.proposals[0];
                candidates.iter().any(|c| self.has(*effect, c))
            }
            Why::Withheld | Why::Refused => something_left,
        };
        let of_names = self.steps.iter().filter_map(|s| s.question.as_ref());
        let question = of_names.chain(&self.questions).filter(standing).min_by_key(|q| q.why)?;
        let asked = |a: &super::forward::Accepted| {
            question.proposals.iter().any(|(e, _)| *e == a.effect)
                && a.candidate.joints.iter().any(|j| question.joints.contains(j))
        };
        let rest: Vec<(usize, Candidate)> =
            self.accepted.iter().filter(|a| !asked(a)).map(|a| (a.effect, a.candidate.clone())).collect();
        let hypothesis = |(effect, candidates): &(usize, Vec<Candidate>)| {
            let mut all = rest.clone();
            all.extend(candidates.iter().map(|c| (*effect, c.clone())));
            let fit = refitted(&self.data, &self.folds, &self.effects, &mut all, &self.fit);
            let mut joints: Vec<usize> = candidates.iter().flat_map(|c| c.joints.clone()).collect();
            joints.sort_unstable();
            joints.dedup();
            Hypothesis::new(&self.data, self.effects[*effect].name(), joints, all, candidates.len(), fit)
        };
        Some(Open { hypotheses: question.proposals.iter().map(hypothesis).collect() })
    }
}
