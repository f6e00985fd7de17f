//! An inertial parameter that the arm file declares zero and that is not.

use super::{Axis, Candidate, Class, Context, Effect, Found, Part};
use crate::logs::regression::Column;
use serde_json::{Value, json};

/// The torque column of one declared-zero parameter, which acts on all joints up to its link.
pub(super) struct BrokenSymmetry;

impl Effect for BrokenSymmetry {
    fn name(&self) -> &'static str {
        "broken_symmetry"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn of_the_body(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let zero = context.data.declared_zero();
        let on = |(k, p): (usize, &dyngen::arm::Parameter)| Candidate::on(p.link, k, Vec::new(), zero.len());
        zero.iter().enumerate().map(on).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        context.data.declared_zero_columns().get(candidate.form).cloned().into_iter().collect()
    }

    fn part(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Part {
        Part::Parameter(context.data.declared_zero()[candidate.form], c[0])
    }

    fn parameters(&self, context: &Context<'_>, found: &[Found<'_>]) -> Value {
        let zero = context.data.declared_zero();
        let names: Vec<String> = found.iter().map(|f| zero[f.candidate.form].to_string()).collect();
        let values: Vec<f64> = found.iter().map(|f| f.coefficients[0]).collect();
        json!({ "parameters": names, "values": values })
    }
}
