//! An effect without a name, as a formula.

use super::super::comparison::Step;
use super::super::model::{Accepted, Model};
use super::super::study::Study;
use crate::effects::{Figures, Found};
use powerball_controller::JointNumber;
use powerball_identification::estimate::residual_stats;
use serde::Serialize;

/// A torque without a name that joints feel, as a formula that holds on logs that were not fitted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnnamedLaw {
    /// The law as text: `tau2 = c1·q2·q3 + …`; tau in N·m, positions and velocities in rad and rad/s (m and
    /// m/s where a joint slides).
    pub formula: String,
    /// The formula for LaTeX.
    pub latex: String,
    /// The joints that feel it.
    pub joints: Vec<JointNumber>,
    /// The law's coefficients, in order.
    pub coefficients: Vec<LawCoefficient>,
    /// The change of the rms error on the validation set by it, by joint: with it over without it, less 1.
    pub held_out_change: Vec<f64>,
    /// 1 less the probability of as much by chance, over all that was tried: that something of these signals
    /// is there, not that no other formula fits as well.
    pub probability: f64,
    /// The named effect that came nearest.
    pub nearest: Option<String>,
}

impl UnnamedLaw {
    /// A sentence with the formula, its numbers and its effect on the error.
    #[must_use]
    pub fn sentence(&self) -> String {
        let number = |c: &LawCoefficient| format!("{} = {:.4} ± {:.1e} {}", c.name, c.value, c.std, c.unit);
        let numbers: Vec<String> = self.coefficients.iter().map(number).collect();
        let change = self.held_out_change.iter().map(|change| format!("{:+.0} %", 100.0 * change));
        let nearest = self.nearest.as_ref().map(|name| format!("; the nearest name is {name}"));
        format!(
            "{} with {}: the error on the other path changes by {}{}",
            self.formula,
            numbers.join(", "),
            change.collect::<Vec<_>>().join(", "),
            nearest.unwrap_or_default()
        )
    }
}

/// A coefficient of a law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawCoefficient {
    /// Name as in the formula.
    pub name: String,
    /// The coefficient's value.
    pub value: f64,
    /// The standard error of the value.
    pub std: f64,
    /// The unit of the value.
    pub unit: &'static str,
}

/// The laws without a name, in the order in which they were found.
pub(crate) fn laws(study: &Study<'_>, model: &Model, steps: &[Step]) -> Vec<UnnamedLaw> {
    let context = model.context(study);
    let with = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let errors = model.errors();
    let of = |(k, (a, place)): (usize, (&Accepted, std::ops::Range<usize>))| {
        let coefficients = &model.fit.theta[place.clone()];
        let found = Found { candidate: &a.candidate, coefficients };
        let Figures::UnnamedLaw(figures) = a.effect().figures(&context, &[found]) else { return None };
        let formula = figures.formulas.into_iter().next()?;
        let without =
            residual_stats(&study.validation, &model.without(study, k).residual_on_validation(study)).rms;
        let step = steps.iter().find(|step| Some(step.number) == a.step());
        let coefficient = |(n, (value, unit)): (usize, (&f64, &'static str))| LawCoefficient {
            name: format!("c{}", n + 1),
            value: *value,
            std: errors(place.start + n).unwrap_or(0.0),
            unit,
        };
        Some(UnnamedLaw {
            formula: formula.formula,
            latex: formula.latex,
            joints: a.candidate.joints.clone(),
            coefficients: coefficients.iter().zip(formula.units).enumerate().map(coefficient).collect(),
            held_out_change: a
                .candidate
                .joints
                .iter()
                .map(|j| with[j.index()] / without[j.index()] - 1.0)
                .collect(),
            probability: 1.0 - a.p_value,
            nearest: step.and_then(|step| step.comparison.rivals.first()).map(|rival| rival.effect.clone()),
        })
    };
    let unnamed =
        model.accepted.iter().zip(model.places()).enumerate().filter(|(_, (a, _))| !a.effect().has_name());
    unnamed.filter_map(of).collect()
}
