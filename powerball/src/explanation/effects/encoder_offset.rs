//! A joint whose zero is off: the arm is not where the log says.

use super::candidate::by_joint;
use super::{Axis, Candidate, Class, Context, Effect, Found, Part};
use crate::logs::regression::{Column, Recording};
use serde_json::{Value, json};

/// τ = (τ_rigid(q − o) − τ_rigid(q))/o with coefficient o: logged position = true position + o.
pub(super) struct EncoderOffset;

/// The offset at which the first secant is taken, rad.
const FIRST: f64 = 0.01;
/// Larger offsets are mounting errors that everybody sees.
const MOST: f64 = 0.5;

impl Effect for EncoderOffset {
    fn name(&self) -> &'static str {
        "encoder_offset"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        context.moving_joints().map(|j| Candidate::on(j, 0, vec![FIRST], 1)).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let (j, offset) = (candidate.joints[0], candidate.values[0]);
        let shifted = |r: &Recording| {
            let mut q = r.q.clone();
            q.iter_mut().skip(j).step_by(r.dof).for_each(|q| *q -= offset);
            context.fit.rigid_torque(context.data.body, &q, &r.v, &r.a)
        };
        let difference: Vec<Vec<f64>> = context
            .data
            .recordings
            .iter()
            .zip(context.rigid())
            .map(|(r, rigid)| shifted(r).iter().zip(rigid).map(|(a, b)| (a - b) / offset).collect())
            .collect();
        vec![context.data.column_over_all(&difference)]
    }

    fn part(&self, _: &Context<'_>, _: &Candidate, c: &[f64]) -> Part {
        Part::EncoderOffset(c[0])
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c[0].abs() < MOST
    }

    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let offset = c[0].clamp(-MOST, MOST);
        (offset.abs() > 1e-5).then(|| Candidate { values: vec![offset], ..candidate.clone() })
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({ "offset": by_joint(found, |f| f.coefficients[0]) })
    }
}
