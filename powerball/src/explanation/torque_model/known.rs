//! The next identification: what is known is taken out of the logs, and what is found comes to it.

use super::{Additions, LogChanges, NamedTerm, TorqueModel};
use crate::controller::JointNumber;
use crate::controller::correction::{Law, Term};
use crate::logs::log::Log;
use crate::logs::regression::{DataOptions, Recording, RigidArm};
use crate::logs::signal::resample::median_step;

impl TorqueModel {
    /// Leaves in logs what a base model is to be fitted to: true positions, torques at their own time,
    /// without the terms, which stay as they are known. `body` is the arm with the model's changes.
    pub fn take_out(&self, body: &RigidArm, logs: &mut [Log]) {
        self.additions.log_changes.clean(logs);
        if self.additions.terms.is_empty() {
            return;
        }
        let right = Additions { log_changes: LogChanges::default(), ..self.additions.clone() };
        let with = TorqueModel { additions: right, ..self.clone() };
        let without = TorqueModel { additions: Additions::default(), ..self.clone() };
        let smoothing = DataOptions::default().smoothing;
        for (index, log) in logs.iter_mut().enumerate() {
            let Some(step) = median_step(&log.t) else { continue };
            for piece in log.pieces.clone() {
                // A piece without a grid is too short for any fit.
                let Some(recording) = Recording::new(log, index, piece.clone(), step, smoothing) else {
                    continue;
                };
                let never = |_| false;
                let [more, less] = [&with, &without].map(|m| m.torque(body, &recording, &never));
                let grid: Vec<f64> =
                    (0..recording.len()).map(|k| recording.start + k as f64 * step).collect();
                for (j, torque) in log.torque.iter_mut().enumerate() {
                    let own = more.iter().zip(&less).skip(j).step_by(recording.dof);
                    let added: Vec<f64> = own.map(|(a, b)| a - b).collect();
                    for k in piece.clone() {
                        torque[k] -= between(&grid, &added, log.t[k]);
                    }
                }
            }
        }
    }
}

impl Additions {
    /// What was known together with what was then found on logs from which it had been taken out.
    #[must_use]
    pub fn and(&self, found: &Additions) -> Additions {
        let mut known = self.clone();
        for (joint, offset) in found.log_changes.encoder_offset.iter().enumerate() {
            known.put_zero_right(JointNumber::from_index(joint), *offset);
        }
        known.terms.extend(found.terms.iter().cloned());
        known.join();
        known.payloads.extend(found.payloads.iter().cloned());
        known.log_changes = self.log_changes.and(&found.log_changes);
        known.arm_changes.gravity = found.arm_changes.gravity.or(known.arm_changes.gravity);
        known.arm_changes.not_zero.extend(found.arm_changes.not_zero.iter().cloned());
        known
    }

    /// The same torque with terms that were fitted at logged positions of a joint written for true ones,
    /// `offset` rad less.
    pub(crate) fn put_zero_right(&mut self, joint: JointNumber, offset: f64) {
        let joint = joint.index();
        let mut constants = Vec::new();
        for NamedTerm { effect, term } in self.terms.iter().filter(|t| t.term.joint == joint) {
            if term.law == Law::Position {
                let term = Term { law: Law::Constant, coefficient: term.coefficient * offset, ..*term };
                constants.push(NamedTerm { effect: effect.clone(), term });
            }
        }
        self.terms.extend(constants);
        let waves: Vec<(usize, f64, f64)> = (self.terms.iter().enumerate())
            .filter(|(_, t)| t.term.joint == joint)
            .filter_map(|(k, t)| match t.term.law {
                Law::Cosine { order } => Some((k, order, 1.0)),
                Law::Sine { order } => Some((k, order, -1.0)),
                _ => None,
            })
            .collect();
        // a·cos(k(x + o)) = a·cos(ko)·cos(kx) − a·sin(ko)·sin(kx), and a·sin(k(x + o)) likewise.
        for (k, order, sign) in waves {
            let NamedTerm { effect, term } = self.terms[k].clone();
            let (sin, cos) = (order * offset).sin_cos();
            self.terms[k].term.coefficient = term.coefficient * cos;
            let law = if sign > 0.0 { Law::Sine { order } } else { Law::Cosine { order } };
            let term = Term { law, coefficient: -sign * term.coefficient * sin, ..term };
            self.terms.push(NamedTerm { effect, term });
        }
        self.join();
    }

    /// Terms of one effect with the same law at the same joint become one.
    fn join(&mut self) {
        let mut joined: Vec<NamedTerm> = Vec::new();
        for t in self.terms.drain(..) {
            let twin = |o: &&mut NamedTerm| {
                o.effect == t.effect && o.term.joint == t.term.joint && o.term.law == t.term.law
            };
            match joined.iter_mut().find(twin) {
                Some(other) => other.term.coefficient += t.term.coefficient,
                None => joined.push(t),
            }
        }
        self.terms = joined;
    }
}

impl LogChanges {
    /// Puts logs right: true positions, torques at their own time.
    fn clean(&self, logs: &mut [Log]) {
        for log in logs {
            for (j, q) in log.q.iter_mut().enumerate() {
                q.iter_mut().for_each(|q| *q -= self.offset(j));
            }
            for (j, torque) in log.torque.iter_mut().enumerate().filter(|(j, _)| self.late(*j) != 0.0) {
                let logged = torque.clone();
                for piece in &log.pieces {
                    for k in piece.clone() {
                        torque[k] =
                            between(&log.t[piece.clone()], &logged[piece.clone()], log.t[k] + self.late(j));
                    }
                }
            }
        }
    }
}

/// A signal at a time between its samples; at its ends what is there.
fn between(t: &[f64], x: &[f64], at: f64) -> f64 {
    let next = t.partition_point(|t| *t < at).clamp(1, t.len().max(2) - 1);
    match (t.get(next - 1), t.get(next)) {
        (Some(a), Some(b)) if b > a => {
            let share = ((at - a) / (b - a)).clamp(0.0, 1.0);
            x[next - 1] * (1.0 - share) + x[next] * share
        }
        _ => x[next - 1],
    }
}
