//! Names that logs leave open, each fitted to them: what an experiment can be designed for and decided by.

use super::super::model::{Accepted, Model, refitted};
use super::super::study::Study;
use super::history::{History, Question, Why};
use crate::controller::JointNumber;
use crate::explanation::effects::{Candidate, Context};
use crate::explanation::rule::Rule;
use crate::identification::estimate::{Design, Fit, Folds, friction_columns};
use crate::logs::regression::{Column, Data, Signals};

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
    /// Its joints.
    pub joints: Vec<JointNumber>,
    /// All effects of the model, those of the open name last.
    candidates: Vec<Candidate>,
    /// How many of them are of the open name.
    own: usize,
    /// The columns of the open name on the logs that it was fitted to.
    pub fitted_columns: Vec<Column>,
    /// The model.
    pub fit: Fit,
    /// The thresholds that it was found with.
    rule: Rule,
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
        let context = Context::for_columns(data, &self.fit, &self.rule);
        columns(&context, &self.candidates[self.candidates.len() - self.own..])
    }

    /// The columns of the whole model on some data.
    #[must_use]
    pub fn design(&self, data: &Data<'_>) -> Design {
        let context = Context::for_columns(data, &self.fit, &self.rule);
        let columns = columns(&context, &self.candidates);
        Design::new(data, &friction_columns(data, &self.fit.shapes), &columns)
    }

    /// What this name explains alone on some data, by joint, N·m.
    #[must_use]
    pub fn own_torque(&self, data: &Data<'_>) -> Signals {
        let columns = self.own_columns(data);
        let first = self.fit.design.size - self.fit.design.extra(0) - columns.len();
        let own: Vec<f64> = (first..first + columns.len()).map(|k| self.fit.coefficient(k)).collect();
        let mut torque = Signals::zeros(data);
        torque.add(&columns, &own);
        torque
    }

    /// The same name fitted to other data.
    #[must_use]
    pub fn fitted_to(&self, data: &Data<'_>, folds: &Folds) -> Hypothesis {
        let mut candidates = self.candidates.clone();
        let fit = refitted(data, folds, &mut candidates, &self.fit, &self.rule, None);
        let mut new = Hypothesis {
            joints: self.joints.clone(),
            candidates,
            fitted_columns: Vec::new(),
            fit,
            rule: self.rule.clone(),
            ..*self
        };
        new.fitted_columns = new.own_columns(data);
        new
    }
}

fn columns(context: &Context<'_>, of: &[Candidate]) -> Vec<Column> {
    of.iter().flat_map(|candidate| context.columns(candidate)).collect()
}

/// What stays open after all steps: a name with a twin, else a name that was not given for what is left on some joints
/// without one.
pub(crate) fn open(
    study: &Study<'_>,
    model: &Model,
    history: &History,
    left: &[JointNumber],
) -> Option<Open> {
    let standing = |q: &&Question| match q.why {
        Why::Twin => {
            q.proposals[0].iter().any(|c| model.has(c)) && !q.proposals[1].iter().any(|c| model.has(c))
        }
        Why::Withheld => q.joints.iter().any(|joint| left.contains(joint)),
    };
    let of_names = history.steps.iter().filter_map(|s| s.question.as_ref());
    let question = of_names.chain(&history.questions).filter(standing).min_by_key(|q| q.why)?;
    let asked = |a: &Accepted| {
        let same = |c: &Candidate| c.effect() == a.effect();
        question.proposals.iter().flatten().any(same) && a.candidate.is_on(&question.joints)
    };
    let rest: Vec<Candidate> =
        model.accepted.iter().filter(|a| !asked(a)).map(|a| a.candidate.clone()).collect();
    let hypothesis = |own: &Vec<Candidate>| {
        let mut candidates: Vec<Candidate> = rest.iter().chain(own).cloned().collect();
        let made = Some(&study.made);
        let fit = refitted(&study.data, &study.folds, &mut candidates, &model.fit, study.rule(), made);
        let mut joints: Vec<JointNumber> = own.iter().flat_map(|c| c.joints.clone()).collect();
        joints.sort_unstable();
        joints.dedup();
        let mut new = Hypothesis {
            name: own[0].effect().name(),
            joints,
            candidates,
            own: own.len(),
            fitted_columns: Vec::new(),
            fit,
            rule: study.rule().clone(),
        };
        new.fitted_columns = new.own_columns(&study.data);
        new
    };
    Some(Open { hypotheses: question.proposals.iter().map(hypothesis).collect() })
}
