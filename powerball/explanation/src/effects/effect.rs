//! The trait that every effect implements.

use super::{Axis, Candidate, Context, Figures, Found, Window};
use crate::rule::Rule;
use dyngen::arm::Parameter;
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use powerball_logs::regression::{Column, Data};
use std::fmt;
use std::ops::Range;

/// Effects of one class look alike: a wrong law of one is easily corrected by another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// A function of a joint's velocity and its history.
    Friction,
    /// A function of the joints' positions.
    Position,
    /// A function of the torque that the model itself predicts, or of its timing.
    Dynamics,
    /// During some time.
    Event,
}

impl Class {
    /// The class in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Class::Friction => "depends on velocity and its history",
            Class::Position => "depends on position",
            Class::Dynamics => "depends on the torque and its timing",
            Class::Event => "depends on time",
        }
    }
}

/// A law at a joint, and how much of the column's coefficient it has there.
pub type Placed = (JointNumber, Law<f64>, f64);

/// The form of an effect in a model of the arm.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// Torques: its laws with their coefficients (see [`Effect::placed_laws`]).
    Laws,
    /// A rigid arm with another value of a parameter that was assumed zero.
    Parameter(Parameter, f64),
    /// A rigid arm under another gravity, m/s² in the base frame, and the changes of all its parameters that
    /// this gravity shows; empty if there are none.
    Gravity([f64; 3], Vec<f64>),
    /// A body that a link may carry (the last one where none is named): mass in kg and centre in m, in its
    /// frame.
    Payload(f64, [f64; 3], Option<JointNumber>),
    /// Logs whose position of the candidate's joints is this much above the true one, rad.
    EncoderOffset(f64),
    /// Logs whose torque of the candidate's joints is late by this much, s.
    Delay(f64),
    /// Nothing that lasts.
    Event,
}

/// A physical term that a model may lack.
///
/// An effect is called with its own candidates; for another effect's candidate it returns nothing (no
/// columns, no laws, nothing near it).
pub trait Effect: Sync {
    // Properties of the effect.

    /// The effect's name in results.
    fn name(&self) -> &'static str;

    /// The class of effects with which it is easily confused.
    fn class(&self) -> Class;

    /// Whether it has a name. The search tries an effect without a name only if no named effect passes, and
    /// reports it as a formula.
    fn has_name(&self) -> bool {
        true
    }

    /// Whether the instants at which it sets in are known only roughly, so that nothing is known of its
    /// fast part.
    fn abrupt(&self) -> bool {
        self.class() == Class::Event
    }

    /// Whether it is a part of its joint's friction: a change of the whole friction changes it too.
    fn is_friction(&self) -> bool {
        self.class() == Class::Friction
    }

    /// Whether it is a property of the multibody model that all joints share.
    fn of_the_body(&self) -> bool {
        false
    }

    /// Whether it depends on the running time through all logs, so that it can say when they were recorded.
    fn needs_running_time(&self) -> bool {
        false
    }

    /// Whether it may be in validation logs only, as a body that is held in those: it is then learnt there.
    fn may_be_in_validation_only(&self) -> bool {
        false
    }

    /// Of a candidate that a single log may have while the others have not (a zero, a delay): by what its
    /// coefficient is multiplied to be its figure, and the coefficients that are possible.
    fn change_of_a_log(&self, _candidate: &Candidate) -> Option<(f64, Range<f64>)> {
        None
    }

    /// Whether it is a function of the path alone, so that logs which repeat one path cannot distinguish it
    /// from any other error: functions of positions, of the torque of the rigid arm and of the motion of
    /// other joints are; warming and friction at the joint's own velocity are not.
    fn is_function_of_path(&self, _candidate: &Candidate, _data: &Data<'_>, _rule: &Rule) -> bool {
        matches!(self.class(), Class::Position | Class::Dynamics)
    }

    /// Whether two of its candidates describe the same cause, so that one excludes the other. By default an
    /// effect is once on a joint: a delay of all joints and one of a single joint exclude each other.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.joints.iter().any(|j| b.joints.contains(j))
    }

    // How it is looked for.

    /// Candidates that are in the model from the start, so that no other effect is judged without them:
    /// effects that every arm may have, such as the zero of a torque sensor. They get a name at the end, if
    /// they are needed.
    fn baseline(&self, _context: &Context<'_>) -> Vec<Candidate> {
        Vec::new()
    }

    /// The ways in which it could show in these data, worth a look each.
    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate>;

    /// Settings near a candidate's, at a share of the usual distance: 1 where a search has just found it,
    /// less where it is refined.
    fn neighbours(&self, _candidate: &Candidate, _share: f64) -> Vec<Candidate> {
        Vec::new()
    }

    /// The laws of a candidate at its first joint, one a column; none where it is not a torque of a joint.
    fn laws(&self, _context: &Context<'_>, _candidate: &Candidate) -> Vec<Law<f64>> {
        Vec::new()
    }

    /// By column the laws that share its coefficient: those of [`laws`](Self::laws), or those of a torque
    /// that several joints feel.
    fn placed_laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Vec<Placed>> {
        let laws = self.laws(context, candidate);
        laws.into_iter().map(|law| vec![(candidate.joints[0], law, 1.0)]).collect()
    }

    /// The columns of a candidate on the context's data; the same on every data set.
    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        self.placed_laws(context, candidate).iter().map(|laws| context.placed_column(laws)).collect()
    }

    /// Whether no coefficient may be negative (friction dissipates).
    fn non_negative(&self) -> bool {
        false
    }

    /// Whether the coefficients are physically possible.
    fn admissible(&self, _candidate: &Candidate, _coefficients: &[f64]) -> bool {
        true
    }

    /// Whether a model may have it with these coefficients, in addition to all others: friction that warmth
    /// changes stays friction.
    fn possible(&self, _context: &Context<'_>, _candidate: &Candidate, _coefficients: &[f64]) -> bool {
        true
    }

    /// A better candidate near an accepted one: columns that depend on estimates are computed again from
    /// there.
    fn refined(&self, _candidate: &Candidate, _coefficients: &[f64]) -> Option<Candidate> {
        None
    }

    // The report on an accepted effect.

    /// The gradient of the size whose standard error is given, by coefficient; the size is linear along the
    /// coefficients themselves. `None` where it is the factor of the whole torque.
    fn size(&self, _candidate: &Candidate, _coefficients: &[f64]) -> Option<Vec<f64>> {
        None
    }

    /// The candidate's effect without an assumption that its law makes; `None` where it makes none. By the
    /// difference of the two sizes the standard error is larger.
    fn otherwise(&self, _candidate: &Candidate) -> Option<Candidate> {
        None
    }

    /// The windows of the effect in the context's logs, and those in which it continues in logs that were not
    /// fitted.
    fn windows(&self, _context: &Context<'_>, candidate: &Candidate) -> Vec<Window> {
        candidate.windows.clone()
    }

    /// The evidence of logs that were not fitted for an accepted candidate that may be in some logs and not
    /// in others; `context` holds their residual without it.
    fn seen_in(
        &self,
        _context: &Context<'_>,
        _candidate: &Candidate,
        _coefficients: &[f64],
    ) -> Option<Candidate> {
        None
    }

    /// The form of an accepted candidate in a model of the arm.
    fn part(&self, _context: &Context<'_>, _candidate: &Candidate, _coefficients: &[f64]) -> Part {
        Part::Laws
    }

    /// The signal over which a joint's residual shows it.
    fn shown_by(&self, candidate: &Candidate) -> Axis;

    /// The physical reading of all that was found of this effect, as in the results; at least one was found.
    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> Figures;
}

impl fmt::Debug for dyn Effect + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl PartialEq for dyn Effect + '_ {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}
