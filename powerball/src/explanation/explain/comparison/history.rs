//! What the steps of the search decided.
//!
//! Also here: a question that logs leave open.

use super::super::named::Rival;
use super::super::search::Group;
use super::naming::Comparison;
use crate::controller::JointNumber;
use crate::explanation::effects::{Candidate, Effect};
use crate::explanation::rule::Rule;

/// What a step decided.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) number: usize,
    pub(crate) effect: &'static dyn Effect,
    /// Squared errors before it, by joint, (N·m)² summed over rows.
    pub(crate) square_before: Vec<f64>,
    pub(crate) comparison: Comparison,
    /// What an experiment would have to decide.
    pub(crate) question: Option<Question>,
    /// rms on the validation set before it, by joint, N·m.
    pub(crate) before: Vec<f64>,
    /// … and after.
    pub(crate) after: Vec<f64>,
}

/// What the steps decided so far.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// Those whose effects stand.
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
    /// What fits best was not given.
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

    /// The same where the name is not given.
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
