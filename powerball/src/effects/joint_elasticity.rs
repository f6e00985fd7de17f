//! A joint that gives way under its torque: the link is not where the motor's encoder says.

use super::candidate::by_joint;
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::regression::Column;
use crate::signal::{Butterworth, difference};
use serde_json::{Value, json};

/// q_link = q − τ/K: the change of rigid torque on all joints for 1/K, to first order.
pub(super) struct JointElasticity;

/// The deflection that the difference is taken with, rad at the largest torque.
const STEP: f64 = 1e-4;
/// The deflection is smoothed to this before it is differentiated twice, Hz: torques are noisy derivatives already.
const SMOOTHING: f64 = 5.0;

impl Effect for JointElasticity {
    fn name(&self) -> &'static str {
        "joint_elasticity"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        context.moving_joints().map(|j| Candidate::on(j, 0, Vec::new(), 1)).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let (j, n) = (candidate.joints[0], context.data.dof());
        let top = context
            .rigid()
            .iter()
            .flat_map(|t| t.iter().skip(j).step_by(n))
            .fold(1e-9f64, |m, t| m.max(t.abs()));
        let epsilon = STEP / top;
        let rate = context.data.rate();
        let filter = Butterworth::low_pass(2, SMOOTHING.min(0.3 * rate), rate);
        let difference: Vec<Vec<f64>> = context
            .data
            .recordings
            .iter()
            .zip(context.rigid())
            .map(|(r, rigid)| {
                let torque: Vec<f64> = rigid.iter().skip(j).step_by(n).map(|t| -epsilon * t).collect();
                let shift = filter.as_ref().map_or(torque.clone(), |f| f.zero_phase(&torque));
                let dv = difference::derivative(&shift, 1.0 / rate);
                let da = difference::second_derivative(&shift, 1.0 / rate);
                let (mut q, mut v, mut a) = (r.q.clone(), r.v.clone(), r.a.clone());
                for k in 0..r.len() {
                    q[k * n + j] += shift[k];
                    v[k * n + j] += dv[k];
                    a[k * n + j] += da[k];
                }
                let moved = context.data.body.torque(&q, &v, &a, context.fit.inertial());
                moved.iter().zip(rigid).map(|(a, b)| (a - b) / epsilon).collect()
            })
            .collect();
        vec![context.data.column_over_all(&difference)]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({ "stiffness": by_joint(found, |f| 1.0 / f.coefficients[0].max(1e-12)) })
    }
}
