//! A joint whose zero is off: the arm is not where the log says.

use super::candidate::by_joint;
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::regression::{Column, Recording};
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
        let shifted = |r: &Recording| shifted_torque(context, r, j, |_| -offset);
        let difference: Vec<Vec<f64>> = context
            .data
            .recordings
            .iter()
            .zip(context.rigid())
            .map(|(r, rigid)| shifted(r).iter().zip(rigid).map(|(a, b)| (a - b) / offset).collect())
            .collect();
        vec![context.data.column_over_all(&difference)]
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

/// Rigid torque with one joint's position moved by `shift` of the sample.
pub(super) fn shifted_torque(
    context: &Context<'_>,
    r: &Recording,
    joint: usize,
    shift: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let n = r.dof;
    let mut q = r.q.clone();
    for k in 0..r.len() {
        q[k * n + joint] += shift(k);
    }
    context.data.body.torque(&q, &r.v, &r.a, context.fit.inertial())
}
