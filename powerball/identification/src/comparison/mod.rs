//! Two fits side by side: which parameters and friction curves truly differ, their difference in torque, and
//! a sentence about the cause.
//!
//! Two fits never give the same numbers. The covariance of both decides which differ: intervals that hold
//! simultaneously at one stated level (Bonferroni's, over every parameter and every point of the friction
//! curves that is compared), and by a few questions that share the level: inertia, each joint's friction,
//! each constant torque. So equal arms are reported as different in that share of comparisons and not in that
//! share of numbers. Friction is compared as a curve: its five coefficients make up for each other, the
//! torque at a velocity does not.

mod cause;
mod differences;
mod result;
mod side;
mod strokes;

pub use result::{
    Cause, CompareError, CompareOptions, Comparison, ConstantDifference, FrictionDifference,
    ParameterDifference, TorqueDifference,
};
pub use side::Side;
pub use strokes::Stroke;

use differences::Differences;

/// Compares two fits of one arm file; differences are `b` less `a`.
///
/// # Errors
/// [`CompareError`]: fits of other arms or parameter sets, or without standard errors.
pub fn compare(a: &Side, b: &Side, options: &CompareOptions) -> Result<Comparison, CompareError> {
    let differences = Differences::new(a, b, options)?;
    let causes = cause::causes(a, &differences);
    let sentence = cause::sentence(&differences, &causes);
    let Differences { level, comparisons, parameters, friction, constants, torque, warnings, .. } =
        differences;
    let differ = parameters.iter().any(|p| p.differs)
        || friction.iter().any(|f| f.differs)
        || constants.iter().any(|c| c.differs);
    Ok(Comparison {
        a: a.name.clone(),
        b: b.name.clone(),
        arm: a.arm.clone(),
        differ,
        level,
        comparisons,
        parameters,
        friction,
        constants,
        torque_difference: torque,
        causes,
        sentence,
        unusable: [a, b]
            .iter()
            .flat_map(|side| side.unusable.iter().map(|why| format!("{}: {why}", side.name)))
            .collect(),
        warnings,
    })
}

#[cfg(test)]
mod tests;
