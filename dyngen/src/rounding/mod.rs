//! By how much emitted code may be off, for every state within the limits of the arm file.
//!
//! Emitted code does the operations of the graph in the graph's order, so what each of them rounds is known:
//! at most half a unit in the last place of its result. A derivative of the output by that error, over
//! intervals, says what it does to the output; the sum over all operations is a bound. It is sound without
//! terms of second order, because intervals hold the rounded values too (the mean value theorem, as in
//! `program.rs`). The states are split where the bound is largest.
//!
//! Intervals: Moore, *Interval Analysis* (1966). Rounding errors by derivatives: Linnainmaa, "Taylor
//! expansion of the accumulated rounding error" (1976); with interval or symbolic remainder: Darulova and
//! Kuncak (Rosa, 2014), Solovyev et al. (FPTaylor, 2015).

mod angle;
mod bodies;
mod deviation;
mod energy;
mod factors;
mod gradient;
mod interval;
mod known;
mod limits;
mod norms;
mod payload;
mod precision;
mod program;
mod search;
mod slopes;
mod task;
#[cfg(test)]
mod tests;

use crate::consistency;
use crate::dynamics::function::Argument;
use crate::dynamics::{Function, FunctionGraph};
use crate::model::Model;
use crate::parameters::SetKind;
use factors::{Factors, PosedMatrix};
use known::Facts;
use limits::Limits;
use program::Program;
use std::sync::OnceLock;
use task::Task;

/// Bounds of one function by output, row by row: of |emitted − exact|, in the outputs' units. Infinite where
/// a divisor may be zero for all that intervals show.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// In `f32`.
    pub single: Vec<f64>,
    /// In `f64`.
    pub double: Vec<f64>,
    /// The poses for which they hold; `None` where these are all poses within the limits.
    pub poses: Option<Where>,
}

/// The poses for which bounds of Λ and J̄ hold: where J is far enough from losing rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Where {
    /// The largest entries of Λ's diagonal, kg and kg·m², in base axes.
    pub largest_inertia: Vec<f64>,
    /// The share of poses within the limits, drawn at random, at which all six entries are no larger.
    pub share: f64,
}

impl Where {
    /// In words.
    pub fn text(&self) -> String {
        let diagonal: Vec<String> = self.largest_inertia.iter().map(ToString::to_string).collect();
        format!(
            "at poses where no entry of Λ's diagonal is above [{}] kg and kg·m²: {:.0} % of the poses within \
             the limits",
            diagonal.join(", "),
            100.0 * self.share
        )
    }
}

/// Bounds for a function of an arm. `parameters` are the values of its set; where there are none, each
/// parameter is within ±1 in SI units. So is each number of the vector e, of the wrench f, of a payload and
/// of a direction. The payload of `forward_dynamics_with_payload` is one that a body can have.
///
/// What the function is given counts as exact. The same input gives the same bounds on every machine but for
/// what sines of the standard library do to their last digits.
///
/// # Errors
/// The limit that the arm file lacks, or why pivots of B may be zero, in words.
pub fn bounds(model: &Model, built: &FunctionGraph, parameters: Option<&[f64]>) -> Result<Bounds, String> {
    Bounder::new(model, parameters).bounds(built)
}

/// Bounds for the functions of an arm: what they share is computed once.
#[derive(Debug)]
pub struct Bounder<'a> {
    model: &'a Model,
    parameters: Option<&'a [f64]>,
    /// Values of the full set.
    links: Option<&'a [f64]>,
    factors: OnceLock<Result<Factors, String>>,
    /// With a payload.
    loaded: OnceLock<Result<Factors, String>>,
    task: OnceLock<Result<Task, String>>,
}

impl<'a> Bounder<'a> {
    /// For values of the minimal set, as [`bounds`].
    pub fn new(model: &'a Model, parameters: Option<&'a [f64]>) -> Self {
        let (factors, loaded, task) = Default::default();
        Bounder { model, parameters, links: None, factors, loaded, task }
    }

    /// With the same values in the full set: each link is then known as a body, and more arms have bounds of
    /// functions that divide by pivots of B. The bounds hold only if both are values of the same arm.
    #[must_use]
    pub fn with_links(self, values: Option<&'a [f64]>) -> Self {
        Bounder { links: values, ..self }
    }

    /// As [`bounds`].
    ///
    /// # Errors
    /// As [`bounds`].
    pub fn bounds(&self, built: &FunctionGraph) -> Result<Bounds, String> {
        let Bounder { model, parameters, .. } = *self;
        let limits = Limits::new(model.arm(), parameters);
        if let Some(missing) = limits.missing(built.arguments()) {
            return Err(missing);
        }
        if built.graph.operations(&built.outputs).sqrt > 0 {
            return Err("the square root that its loop needs has no bound".to_string());
        }
        let divisor = divisor(built.function);
        let task = match divisor {
            Some(Divisor::Task) => Some(self.task(&limits)?),
            _ => None,
        };
        let facts = match divisor {
            Some(divisor) => Some(self.facts(built, divisor, task, &limits)?),
            None => None,
        };
        let programs: Option<Vec<Program>> = (0..built.outputs.len())
            .map(|output| Program::new(model, built, output, facts.as_ref()))
            .collect();
        let programs = programs.ok_or("its parameters are prepared")?;
        let operations: usize = programs.iter().map(Program::len).sum();
        let effort = if facts.is_some() { SOLVED } else { EFFORT[usize::from(parameters.is_some())] };
        let evaluations = (effort / operations.max(1)).min(MOST);
        let poses = task.map(|task| task.poses.clone());
        let mut bounds = Bounds { single: Vec::new(), double: Vec::new(), poses };
        for program in &programs {
            let ranges: Option<Vec<_>> = program.variables.iter().map(|v| limits.range(*v)).collect();
            let splits: Vec<bool> = program.variables.iter().map(|v| v.0 != Argument::Parameters).collect();
            let ranges = ranges.ok_or("a parameter has no value")?;
            let [single, double] = search::bound(program, &ranges, &splits, evaluations);
            bounds.single.push(single);
            bounds.double.push(double);
        }
        Ok(bounds)
    }

    /// What is known of a function that divides by pivots of B.
    fn facts<'f>(
        &'f self,
        built: &FunctionGraph,
        divisor: Divisor,
        task: Option<&'f Task>,
        limits: &Limits<'_>,
    ) -> Result<Facts<'f>, String> {
        let set = self.model.set(SetKind::Minimal).map_err(|e| e.to_string())?;
        if built.parameters != set.parameters.len() {
            return Err("B is proven positive for the minimal set alone".to_string());
        }
        let factors = match divisor {
            Divisor::Loaded => self.loaded(limits)?,
            Divisor::Pivots | Divisor::Task => self.unloaded(limits)?,
        };
        Facts::new(self.model, built, factors, task.map(|task| &task.factors))
            .ok_or_else(|| "its solve is not recognised".to_string())
    }

    fn unloaded(&self, limits: &Limits<'_>) -> Result<&Factors, String> {
        self.factors.get_or_init(|| self.factors(limits)).as_ref().map_err(Clone::clone)
    }

    fn loaded(&self, limits: &Limits<'_>) -> Result<&Factors, String> {
        let loaded = || {
            let most = self.matrix(Function::MassMatrix, limits)?.largest_diagonal();
            let most = most.ok_or("B(q) has no bound")?;
            payload::factors(self.unloaded(limits)?, &most, &self.jacobian(limits)?)
                .ok_or_else(|| "B(q) has no bound".to_string())
        };
        self.loaded.get_or_init(loaded).as_ref().map_err(Clone::clone)
    }

    fn task(&self, limits: &Limits<'_>) -> Result<&Task, String> {
        let task = || {
            let values = self.parameters.ok_or(ANY)?;
            Task::new(self.model, values, &self.jacobian(limits)?, self.unloaded(limits)?)
        };
        self.task.get_or_init(task).as_ref().map_err(Clone::clone)
    }

    /// The largest sizes of J's entries.
    fn jacobian(&self, limits: &Limits<'_>) -> Result<Vec<f64>, String> {
        let sizes = self.matrix(Function::Jacobian, limits)?.largest_sizes();
        sizes.ok_or_else(|| "the Jacobian has no bound".to_string())
    }

    fn matrix(&self, function: Function, limits: &Limits<'_>) -> Result<PosedMatrix, String> {
        let built = self.model.function(function, SetKind::Minimal).map_err(|e| e.to_string())?;
        PosedMatrix::new(self.model, &built, limits).ok_or_else(|| "a parameter has no value".to_string())
    }

    fn factors(&self, limits: &Limits<'_>) -> Result<Factors, String> {
        let Bounder { model, parameters: Some(values), .. } = *self else { return Err(ANY.to_string()) };
        let mass = self.matrix(Function::MassMatrix, limits)?;
        if let Some(rough) = mass.factors(ROUGH, BOXES) {
            return Ok(mass.factors(FINE, BOXES).unwrap_or(rough));
        }
        let of_bodies = match (self.links, model.set(SetKind::Full)) {
            (Some(links), Ok(set)) => bodies::factors(model.arm(), set, links, &mass)
                .map_err(|why| format!("nor do the links as bodies prove it: {why}")),
            _ => Err("values of every link's ten parameters may prove it".to_string()),
        };
        of_bodies.map_err(|why| match self.worst(values) {
            Ok((smallest, pose)) if smallest <= 0.0 => format!(
                "B(q) is not positive definite with these values: its smallest eigenvalue is {smallest:.2e} \
                 at q = {pose}"
            ),
            Ok((smallest, pose)) => format!(
                "B(q) is not proven positive definite within the limits: the smallest eigenvalue that was \
                 found is {smallest:.2e} at q = {pose}; {why}"
            ),
            Err(why) => why,
        })
    }

    /// The smallest eigenvalue of B, and at which pose.
    fn worst(&self, values: &[f64]) -> Result<(f64, String), String> {
        let found = consistency::smallest_eigenvalue(self.model, SetKind::Minimal, values);
        let (smallest, pose) = found.map_err(|e| e.to_string())?;
        let pose: Vec<String> = pose.iter().map(|q| format!("{q:.3}")).collect();
        Ok((smallest, format!("[{}]", pose.join(", "))))
    }
}

/// By what a function divides that is no sum of masses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Divisor {
    /// Pivots of B.
    Pivots,
    /// Pivots of Λ⁻¹ too.
    Task,
    /// Pivots of B with a payload.
    Loaded,
}

impl Divisor {
    /// Whether bounds hold for some states within the limits alone: poses, or payloads.
    fn is_restricted(self) -> bool {
        matches!(self, Divisor::Task | Divisor::Loaded)
    }
}

fn divisor(function: Function) -> Option<Divisor> {
    use Function::*;
    match function {
        MassMatrixInverse
        | ForwardDynamics
        | AccelerationByPosition
        | AccelerationByVelocity
        | TaskInertiaInverse => Some(Divisor::Pivots),
        TaskInertia | ConsistentInverse => Some(Divisor::Task),
        ForwardDynamicsWithPayload => Some(Divisor::Loaded),
        _ => None,
    }
}

/// Why there is no bound without values.
const ANY: &str =
    "with parameters within ±1 SI unit B(q) need not be positive definite: --values gives those of an arm";

/// Norms of E that parts of the poses have at most: where that is enough to prove B positive, and what close
/// bounds need.
const ROUGH: f64 = 0.5;
const FINE: f64 = 0.2;

/// Parts of the poses that proving B positive is worth.
const BOXES: usize = 100_000;

/// Operations over intervals for one function: some 5 ms without values, some 50 ms where values are given,
/// since then close bounds are what is asked for. The tenth part makes bounds 1.1 times as large in the
/// median of 7444 outputs of 20 arms, 1.4 times in one of ten.
const EFFORT: [usize; 2] = [200_000, 2_000_000];

/// Of functions that divide by pivots of B, less than a second each.
const SOLVED: usize = 20_000_000;

/// Bounds of parts of the states that an output is worth at most.
const MOST: usize = 4000;
