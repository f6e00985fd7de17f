//! Play in a gear: after a reversal the motor turns through a gap before it drives the link again.

use super::candidate::{by_joint, geometric};
use super::encoder_offset::shifted_torque;
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::regression::Column;
use serde_json::{Value, json};

/// Form 0: the rigid torque is missing while the motor is in the gap after a reversal of its motion. Form 1: the link
/// hangs back by half the gap on the side its load pushes it to.
pub(super) struct Backlash;

/// Step of the numerical derivative by position, rad.
const STEP: f64 = 1e-4;

impl Effect for Backlash {
    fn name(&self) -> &'static str {
        "backlash"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Torque
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on = |j: usize| {
            let gaps = geometric(5e-4, 0.05, 6).into_iter().map(move |gap| Candidate::on(j, 0, vec![gap], 7));
            gaps.chain([Candidate::on(j, 1, vec![0.0], 7)])
        };
        context.moving_joints().flat_map(on).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let (j, gap, n) = (candidate.joints[0], candidate.values[0], context.data.dof());
        let rigid = context.rigid();
        if candidate.form == 0 {
            return vec![context.data.column_on(j, |r, recording| {
                let inside = in_gap(&recording.position(j).collect::<Vec<_>>(), gap);
                let load = rigid[r].iter().skip(j).step_by(n);
                load.zip(inside).map(|(t, inside)| if inside { -t } else { 0.0 }).collect()
            })];
        }
        let difference: Vec<Vec<f64>> = context
            .data
            .recordings
            .iter()
            .zip(rigid)
            .map(|(r, rigid)| {
                let top = rigid.iter().skip(j).step_by(n).fold(0.0f64, |m, t| m.max(t.abs())).max(1e-9);
                let side = |k: usize| (50.0 * rigid[k * n + j] / top).tanh();
                let moved = shifted_torque(context, r, j, |k| -STEP * side(k));
                moved.iter().zip(rigid).map(|(a, b)| (a - b) / STEP).collect()
            })
            .collect();
        vec![context.data.column_over_all(&difference)]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn admissible(&self, candidate: &Candidate, c: &[f64]) -> bool {
        if candidate.form == 0 { (0.1..2.0).contains(&c[0]) } else { c[0] < 0.05 }
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let gap = |f: &Found<'_>| {
            if f.candidate.form == 0 { f.candidate.values[0] } else { 2.0 * f.coefficients[0] }
        };
        json!({ "gap": by_joint(found, gap) })
    }
}

/// Whether the motor has moved less than the gap since its motion last reversed.
fn in_gap(q: &[f64], gap: f64) -> Vec<bool> {
    let (mut turning, mut direction) = (f64::NEG_INFINITY, 0.0);
    let mut extreme = q.first().copied().unwrap_or(0.0);
    q.iter()
        .map(|&x| {
            let step = x - extreme;
            // A reversal counts once it is larger than encoder steps.
            if step * direction < 0.0 && step.abs() > 0.1 * gap {
                (turning, direction, extreme) = (extreme, step.signum(), x);
            } else if direction == 0.0 && step.abs() > gap {
                (direction, extreme) = (step.signum(), x);
            } else if step * direction > 0.0 {
                extreme = x;
            }
            (x - turning).abs() < gap
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::in_gap;

    #[test]
    fn the_gap_is_crossed_once_after_each_reversal() {
        let q: Vec<f64> = (0..=100).map(|k| 0.01 * f64::from(50 - (k - 50i32).abs())).collect();
        let inside = in_gap(&q, 0.055);
        assert!(inside[..51].iter().all(|x| !x), "no gap before the first reversal");
        assert_eq!(inside[51..].iter().filter(|x| **x).count(), 5);
        assert!(inside[60..].iter().all(|x| !x));
    }
}
