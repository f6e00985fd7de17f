//! Names that logs leave open, each fitted to them, for the design and the decision of an experiment.
//!
//! The module also keeps the decisions of the steps.

use super::super::model::{Accepted, Model, refitted};
use super::super::named::Rival;
use super::super::search::Group;
use super::super::study::Study;
use super::naming::Comparison;
use crate::effects::{Candidate, Context, Effect};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_identification::estimate::{Design, Fit, Folds, friction_columns};
use powerball_logs::regression::{Column, Data, Signals};

/// Names for the same residual that the logs cannot distinguish, the preferred one first.
#[derive(Debug)]
pub struct Open {
    /// At least two hypotheses.
    pub hypotheses: Vec<Hypothesis>,
}

/// The base model with all that was accepted and one of the open names.
#[derive(Debug)]
pub struct Hypothesis {
    /// The open name.
    pub name: &'static str,
    /// The joints of the open name.
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

    /// Residual of the whole model on some data, by joint and row, N·m.
    #[must_use]
    pub fn residual_on(&self, data: &Data<'_>) -> Signals {
        let context = Context::for_columns(data, &self.fit, &self.rule);
        self.fit.residual_on(data, &columns(&context, &self.candidates))
    }

    /// The torque that this name explains alone on some data, by joint, N·m.
    #[must_use]
    pub fn own_torque(&self, data: &Data<'_>) -> Signals {
        let columns = self.own_columns(data);
        let first = self.fit.design.size - self.fit.design.extra(0) - columns.len();
        let own: Vec<f64> = (first..first + columns.len()).map(|k| self.fit.coefficient(k)).collect();
        let mut torque = Signals::zeros(data);
        torque.add(&columns, &own);
        torque
    }

    /// This name fitted to other data.
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

/// The open question after all steps: a name with an equal rival, else a name that was not given for the
/// residual of joints without a name.
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

// The decisions of the steps of the search, and the question that logs leave open.

/// The decision of a step.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) number: usize,
    pub(crate) effect: &'static dyn Effect,
    /// Squared errors before it, by joint, (N·m)² summed over rows.
    pub(crate) square_before: Vec<f64>,
    pub(crate) comparison: Comparison,
    /// The question for an experiment.
    pub(crate) question: Option<Question>,
    /// rms on the validation set before it, by joint, N·m.
    pub(crate) before: Vec<f64>,
    /// … and after.
    pub(crate) after: Vec<f64>,
}

/// The decisions of the steps so far.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// Steps whose effects are still in the model.
    pub(crate) steps: Vec<Step>,
    /// Names that steps left open.
    pub(crate) questions: Vec<Question>,
    /// Effects that the last step refused, and why.
    pub(crate) refused: Vec<Rival>,
}

// A question that logs leave open: which of two names is right.

/// Why names are open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Why {
    /// A name was given, and another one fits as well.
    Twin,
    /// The best candidate was not given as a name.
    Withheld,
}

/// Proposals for the same residual, from one step.
#[derive(Clone, Debug)]
pub(crate) struct Question {
    pub(crate) why: Why,
    /// The joints that it is about.
    pub(crate) joints: Vec<JointNumber>,
    /// The candidates of each name.
    pub(crate) proposals: Vec<Vec<Candidate>>,
}

impl Question {
    /// A chosen group against its twin.
    pub(crate) fn twins(
        rule: &Rule,
        groups: &[Group],
        chosen: usize,
        twin: Option<&str>,
        joints: &[JointNumber],
    ) -> Option<Question> {
        let twin = groups.iter().position(|g| Some(g.name()) == twin)?;
        Question::of(rule, [&groups[chosen], &groups[twin]], joints, Why::Twin)
    }

    /// This question, for a name that is not given.
    pub(crate) fn withheld(self) -> Question {
        Question { why: Why::Withheld, ..self }
    }

    fn of(rule: &Rule, which: [&Group; 2], joints: &[JointNumber], why: Why) -> Option<Question> {
        let proposal = |group: &Group| {
            let enough = group.on(joints).filter(|m| m.trial.score >= rule.least_score);
            let candidates: Vec<Candidate> = enough.map(|m| m.candidate.clone()).collect();
            (!candidates.is_empty()).then_some(candidates)
        };
        let proposals = which.into_iter().map(proposal).collect::<Option<Vec<_>>>()?;
        Some(Question { why, joints: joints.to_vec(), proposals })
    }
}
