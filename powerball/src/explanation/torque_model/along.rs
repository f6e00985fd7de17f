//! The model along logs: the same laws in the same order as in the controller's code.

use super::TorqueModel;
use crate::controller::JointNumber;
use crate::controller::correction::{Law, Memory, Term, add_torques};
use crate::controller::friction::TanhFriction;
use crate::explanation::effects::{PASSES, SOFT, Window, each_instant, move_link, time_delay};
use crate::logs::parallel;
use crate::logs::regression::{Data, Recording, RigidArm, Signals};
use dyngen::arm::ParameterKind;

impl TorqueModel {
    /// Measured less predicted torque, by joint and row, N·m. `body` is the arm with the model's changes; the
    /// last link holds the model's latest payload during the windows `held`.
    #[must_use]
    pub fn residual(&self, body: &RigidArm, data: &Data<'_>, held: &[Window]) -> Signals {
        let recordings: Vec<usize> = (0..data.recordings.len()).collect();
        let torque = parallel::map(&recordings, |r| {
            let recording = &data.recordings[*r];
            let log = &data.logs[recording.log];
            let here: Vec<&Window> = held.iter().filter(|w| w.log == *log).collect();
            self.torque(body, recording, &|t| here.iter().any(|w| t >= w.from && t <= w.to))
        });
        data.residual(&torque)
    }

    /// The torque along one recording, n a sample, N·m as logged; `held` says by the log's time whether the
    /// payload is there.
    #[must_use]
    pub fn torque(&self, body: &RigidArm, recording: &Recording, held: &dyn Fn(f64) -> bool) -> Vec<f64> {
        let n = recording.dof;
        let mut true_places = recording.clone();
        for (k, q) in true_places.q.iter_mut().enumerate() {
            *q -= self.additions.log_changes.offset(k % n);
        }
        let recording = &true_places;
        let motors = [recording.q.clone(), recording.v.clone(), recording.a.clone()];
        let at_motors = self.rigid(body, &motors, recording, held);
        let terms: Vec<Term<f64>> = self.terms().iter().map(|t| t.term).collect();
        let mut rigid = at_motors.clone();
        let moving: Vec<&Term<f64>> = terms.iter().filter(|t| t.law.moves_link()).collect();
        let passes = if moving.is_empty() { 0 } else { PASSES };
        for _ in 0..passes {
            let mut motion = motors.clone();
            for term in &moving {
                // Only what gives way does so under the load that it has there; play has a side.
                let load = if term.law == Law::Compliance { &rigid } else { &at_motors };
                move_link(&mut motion, recording, load, term.joint, term.law, (term.coefficient, SOFT));
            }
            rigid = self.rigid(body, &motion, recording, held);
        }
        let laws: Vec<TanhFriction<f64>> = self.gammas().into_iter().map(TanhFriction::new).collect();
        let friction: Vec<f64> =
            recording.v.iter().enumerate().map(|(k, v)| laws[k % n].torque(*v)).collect();
        let mut torque: Vec<f64> = rigid.iter().zip(&friction).map(|(r, f)| r + f).collect();
        let mut memory = vec![Memory::default(); terms.len()];
        each_instant(recording, &rigid, &friction, |k, now| {
            add_torques(&terms, &mut memory, now, &mut torque[k * n..(k + 1) * n]);
        });
        for j in (0..n).filter(|j| self.additions.log_changes.late(*j) != 0.0) {
            let shift = self.additions.log_changes.late(j) * recording.rate;
            let own: Vec<f64> = torque.iter().skip(j).step_by(n).copied().collect();
            for (k, value) in torque.iter_mut().skip(j).step_by(n).enumerate() {
                *value = time_delay::at(&own, k as f64 - shift);
            }
        }
        torque
    }

    /// The torque of the rigid arm and what it holds.
    fn rigid(
        &self,
        body: &RigidArm,
        [q, v, a]: &[Vec<f64>; 3],
        recording: &Recording,
        held: &dyn Fn(f64) -> bool,
    ) -> Vec<f64> {
        let mut torque = body.torque(q, v, a, &self.inertial());
        let n = recording.dof;
        let time = |k: usize| recording.start + k as f64 / recording.rate;
        let holds: Vec<bool> = (0..recording.len()).map(|k| held(time(k))).collect();
        let Some(payload) = self.additions.payloads.last().filter(|_| holds.contains(&true)) else {
            return torque;
        };
        let added = payload.parameters();
        let first = payload.link.map_or(body.dof() - 1, JointNumber::index) * ParameterKind::ALL.len();
        let of_link: Vec<usize> = (first..first + added.len()).collect();
        let Some(columns) = body.parameter_columns(&of_link, q, v, a) else { return torque };
        for (row, columns) in columns.chunks_exact(added.len()).enumerate().filter(|(row, _)| holds[row / n])
        {
            torque[row] += columns.iter().zip(&added).map(|(c, p)| c * p).sum::<f64>();
        }
        torque
    }
}
