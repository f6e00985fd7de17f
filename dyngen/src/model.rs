//! An arm with its exact parameter sets, from which every function is made.

use crate::arm::{Arm, Parameter};
use crate::base::Sets;
use crate::dynamics::angles::Angles;
use crate::dynamics::build::{self, Subject};
use crate::dynamics::function::Kind;
use crate::dynamics::regroup::{Known, Order, Regrouping};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::elimination::Unproven;
use crate::exact::rational::{self, Rational};
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{angle_symbols, joint_symbols};
use crate::optimize::{PASSES, Pass};
use crate::parameters::span::Sum;
use crate::parameters::{Combination, ParameterSet, SetKind};
use crate::prove::{self, Disagreement};
use std::fmt;
use std::sync::OnceLock;

/// An arm with what was derived of it.
#[derive(Clone, Debug)]
pub struct Model {
    arm: Arm,
    angles: Angles,
    symbols: AngleSymbols,
    sets: Sets,
    /// For each kind of set the ways in which functions sum its parameters up, once they are requested.
    regroupings: [OnceLock<Vec<Regrouping>>; 4],
}

/// Why a model or one of its functions is not to be had.
#[derive(Clone, Debug)]
pub enum Error {
    /// The exact elimination was not certified.
    Unproven(Unproven),
    /// The arm has no such set: its file has no `[[grouping]]`.
    NoPublishedSet,
    /// The published sums change the torque: what they lose, and why.
    NotExact(Vec<(Parameter, String)>),
    /// A friction term that does not fit the arm.
    Friction(String),
    /// Values that do not fit a set.
    Values(String),
    /// A function does not agree with the Lagrangian.
    Disagreement(Disagreement),
    /// Joints that follow others, where every joint must move on its own: which.
    Mimics(String),
    /// A function of an arm whose tool cannot accelerate in every direction.
    Missing(Function),
    /// A function that depends on parameters that no torque shows, for a set that leaves them out.
    NeedsEveryParameter(Function),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Unproven(e) => e.fmt(f),
            Error::NoPublishedSet => write!(
                f,
                "the arm file has no [[grouping]], so there is no published set: choose full, minimal or \
                    symbolic"
            ),
            Error::NotExact(lost) => {
                write!(f, "the published sums do not keep the torque, so no code can be proven for them:")?;
                lost.iter().try_for_each(|(_, reason)| write!(f, "\n  {reason}"))
            }
            Error::Values(reason) | Error::Friction(reason) | Error::Mimics(reason) => f.write_str(reason),
            Error::Disagreement(e) => e.fmt(f),
            Error::Missing(function) => write!(
                f,
                "the arm has no {function}: its tool cannot accelerate in every direction, whatever its \
                 joints do; take task_inertia_inverse, which every arm has"
            ),
            Error::NeedsEveryParameter(function) => write!(
                f,
                "{function} depends on masses that affect no torque: choose the set that has every \
                    parameter, --parameters full"
            ),
        }
    }
}

impl std::error::Error for Error {}

impl From<Unproven> for Error {
    fn from(e: Unproven) -> Self {
        Error::Unproven(e)
    }
}

impl From<Disagreement> for Error {
    fn from(e: Disagreement) -> Self {
        Error::Disagreement(e)
    }
}

impl Model {
    /// Derives the Lagrangian of an arm and its parameter sets.
    ///
    /// # Errors
    /// [`Error::Unproven`] where a number of the arm is a multiple of the proof's prime.
    pub fn derive(arm: Arm) -> Result<Model, Error> {
        let symbols = angle_symbols(&arm);
        let sets = Sets::derive(&arm, &symbols)?;
        Ok(Model { angles: Angles::new(&arm), arm, symbols, sets, regroupings: Default::default() })
    }

    /// An arm for kinematics only: no parameter set but `full` is derived, so that the model is made at once,
    /// whatever the arm's angles. Only the functions of [`Function::is_kinematic`] are available.
    pub fn kinematic(arm: Arm) -> Model {
        let symbols = angle_symbols(&arm);
        let sets = Sets::underived(&arm, &symbols);
        Model { angles: Angles::new(&arm), arm, symbols, sets, regroupings: Default::default() }
    }

    /// This model with its tool at one of its frames (see [`Arm::at_frame`]); the parameter sets are the
    /// same.
    pub fn at_frame(&self, name: &str) -> Option<Model> {
        Some(Model { arm: self.arm.at_frame(name)?, ..self.clone() })
    }

    /// The arm.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// The angles whose sine and cosine functions use.
    pub fn angles(&self) -> &Angles {
        &self.angles
    }

    /// All sets with the relations between parameters.
    pub fn sets(&self) -> &Sets {
        &self.sets
    }

    /// The arm's angles whose sine and cosine are kept as symbols.
    pub fn symbols(&self) -> &AngleSymbols {
        &self.symbols
    }

    /// One set.
    ///
    /// # Errors
    /// [`Error::NoPublishedSet`] where the file has no grouping.
    pub fn set(&self, kind: SetKind) -> Result<&ParameterSet, Error> {
        self.sets.get(kind).ok_or(Error::NoPublishedSet)
    }

    /// The functions that the arm has for a set.
    pub fn functions(&self, kind: SetKind) -> impl Iterator<Item = Function> {
        let full = self.has_full_rank();
        let of_set = move |f: &Function| kind == SetKind::Full || !f.needs_every_parameter();
        Function::ALL.into_iter().filter(move |f| full || !f.needs_full_rank()).filter(of_set)
    }

    fn has_full_rank(&self) -> bool {
        prove::has_full_rank(&self.arm, &self.symbols, &self.sets)
    }

    /// A function for a set as expressions that are proven equal to the Lagrangian.
    ///
    /// # Errors
    /// [`Error::NotExact`] for published sums that lose parameters, [`Error::Disagreement`] where the proof
    /// fails.
    pub fn function(&self, function: Function, kind: SetKind) -> Result<FunctionGraph, Error> {
        self.proven(function, kind, None, PASSES)
    }

    /// A function after the given passes alone, proven like any other: to look into the optimiser, or to try
    /// a pass.
    ///
    /// # Errors
    /// Those of [`Model::function`].
    pub fn function_after(
        &self,
        function: Function,
        kind: SetKind,
        passes: &[(&str, Pass)],
    ) -> Result<FunctionGraph, Error> {
        self.proven(function, kind, None, passes)
    }

    /// A function with the values of a set's parameters baked in, proven like any other.
    ///
    /// # Errors
    /// Those of [`Model::function`], and [`Error::Values`] where the values do not fit the set.
    pub fn baked_function(
        &self,
        function: Function,
        kind: SetKind,
        values: &[f64],
    ) -> Result<FunctionGraph, Error> {
        let set = self.set(kind)?;
        if values.len() != set.parameters.len() {
            let count = set.parameters.len();
            return Err(Error::Values(format!(
                "the {kind} set has {count} parameters, {} values were given",
                values.len()
            )));
        }
        // Every finite f64 is a rational number.
        let exact: Option<Vec<Rational>> = values.iter().map(|x| rational::from_f64(*x)).collect();
        let exact = exact.ok_or_else(|| Error::Values("a parameter value is not finite".to_string()))?;
        self.proven(function, kind, Some(&exact), PASSES)
    }

    fn proven(
        &self,
        function: Function,
        kind: SetKind,
        baked: Option<&[Rational]>,
        passes: &[(&str, Pass)],
    ) -> Result<FunctionGraph, Error> {
        if function.needs_full_rank() && !self.has_full_rank() {
            return Err(Error::Missing(function));
        }
        if function.needs_every_parameter() && kind != SetKind::Full {
            return Err(Error::NeedsEveryParameter(function));
        }
        let set = self.set(kind)?;
        if !set.exact {
            return Err(Error::NotExact(set.lost.clone()));
        }
        let subject = Subject {
            arm: &self.arm,
            angles: &self.angles,
            symbols: &self.symbols,
            field: &self.sets.field,
            minimal: &self.sets.minimal,
        };
        let regroupings = || {
            self.regroupings[kind as usize].get_or_init(|| {
                let of = |order| {
                    Regrouping::new(
                        &self.arm,
                        &self.symbols,
                        &self.sets.field,
                        Known { minimal: &self.sets.minimal, on_joints: self.sets.on_joints.as_ref() },
                        set,
                        order,
                    )
                };
                // With symbols eliminations are slow, and two rules must do.
                let orders =
                    Order::all().step_by(if joint_symbols(&self.arm) > 0 { Order::RULES } else { 1 });
                orders.map(of).collect()
            })
        };
        // Only recursions over bodies sum parameters up.
        let regroupings = if function.kind() == Kind::Dynamics { &regroupings()[..] } else { &[] };
        let built = build::build(function, &subject, set, regroupings, baked, passes);
        prove::prove(&self.arm, &self.symbols, &self.sets, set, &built, baked)?;
        Ok(built)
    }

    /// The sums of a set's parameters, in numbers.
    pub fn sums(&self, set: &ParameterSet) -> Vec<Sum> {
        let sum = |terms: &Combination| terms.iter().map(|(p, c)| (*p, self.sets.field.value(c))).collect();
        set.parameters.iter().map(|p| sum(&p.terms)).collect()
    }

    /// The values of a set's parameters for given values of all parameters, eleven a link in the order of
    /// [`Arm::all_parameters`].
    pub fn set_values(&self, set: &ParameterSet, all: &[f64]) -> Vec<f64> {
        let sum = |terms: &Combination| {
            terms
                .iter()
                .map(|(p, c)| self.sets.field.value(c) * all.get(p.index()).copied().unwrap_or(0.0))
                .sum()
        };
        set.parameters.iter().map(|p| sum(&p.terms)).collect()
    }
}
