//! The torque of a planned motion: the feed-forward torque of a controller.

use super::{Additions, ArmChanges, LogChanges, Payload, TorqueModel};
use dyngen::SetKind;
use dyngen::arm::{Parameter, ParameterKind};
use powerball_controller::JointNumber;
use powerball_controller::correction::{Law, Term};
use powerball_identification::NumericArm;
use powerball_logs::motion::Motion;
use powerball_logs::regression::{Recording, RigidArm};

/// Torques of a planned motion by what causes them, n values a sample, N·m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlannedTorque {
    /// The rigid arm at its links' true places, with the payload that stayed to the end of the logs.
    pub rigid: Vec<f64>,
    /// Eq. 16.
    pub friction: Vec<f64>,
    /// Torque of the effects, in addition to the rigid arm and friction.
    pub effects: Vec<f64>,
}

impl TorqueModel {
    /// The torque of a motion that begins `running` s after the arm began to work, as cold as when it was
    /// recorded. `body` is the arm with the model's changes. A delay of logs is not included; terms of a
    /// measured temperature count as 0.
    #[must_use]
    pub fn planned(&self, body: &RigidArm, motion: &Motion, running: f64) -> PlannedTorque {
        let recording = Recording {
            log: 0,
            start: 0.0,
            clock: running,
            rate: 1.0 / motion.period,
            q: motion.q.clone(),
            v: motion.dq.clone(),
            a: motion.ddq.clone(),
            torque: Vec::new(),
            temperature: None,
            smoothing: 0.0,
            dof: motion.dof(),
        };
        let mut whole = self.clone();
        whole.additions.log_changes.delay.clear();
        let held = whole.held_payload().is_some();
        let bare = whole.base();
        let mut loaded = bare.clone();
        loaded.additions.payloads.clone_from(&whole.additions.payloads);
        let of = |model: &TorqueModel| model.torque(body, &recording, &|_| held);
        let [bare, loaded, all] = [&bare, &loaded, &whole].map(of);
        let n = motion.dof();
        let places: Vec<f64> =
            motion.q.iter().enumerate().map(|(k, q)| q - self.additions.log_changes.offset(k % n)).collect();
        let unloaded = body.torque(&places, &motion.dq, &motion.ddq, &self.inertial());
        let less = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        let friction = less(&bare, &unloaded);
        PlannedTorque { rigid: less(&loaded, &friction), effects: less(&all, &loaded), friction }
    }

    /// The payload that stayed to the end of the logs: it counts as held now.
    #[must_use]
    pub fn held_payload(&self) -> Option<&Payload> {
        self.additions.payloads.last().filter(|p| p.end_time.iter().all(Option::is_none))
    }

    /// The rigid arm for control laws, with the payload that it holds, at its encoders' positions; `None`
    /// where it has not `N` joints. `body` is the arm with the model's changes.
    ///
    /// # Errors
    /// Those of [`dyngen::Model::function`].
    pub fn numeric_arm<const N: usize>(
        &self,
        body: &RigidArm,
    ) -> Result<Option<NumericArm<N>>, dyngen::Error> {
        let offset = std::array::from_fn(|j| self.additions.log_changes.offset(j));
        let Some(arm) = NumericArm::new(body.model(), &self.inertial(), offset)? else { return Ok(None) };
        let Some(payload) = self.held_payload() else { return Ok(Some(arm)) };
        // A body on any link, without the symmetries that the arm's own links are declared to have.
        let mut open = body.arm().clone();
        open.groupings.clear();
        (0..open.bodies()).for_each(|body| open.declared_zero_mut(body).clear());
        let model = dyngen::Model::derive(open)?;
        let mut all = vec![0.0; model.arm().all_parameters().len()];
        let link = payload.link.map_or(N - 1, JointNumber::index);
        let first = Parameter { link, kind: ParameterKind::M }.index();
        for (place, value) in all.iter_mut().skip(first).zip(payload.parameters()) {
            *place = value;
        }
        let values = model.set_values(model.set(SetKind::Minimal)?, &all);
        Ok(NumericArm::new(&model, &values, offset)?.map(|held| arm.holding(held)))
    }

    /// This model's parameters and friction without the effects; the arm's changes and its encoders' zeros
    /// stay.
    #[must_use]
    pub fn base(&self) -> TorqueModel {
        let mut base = self.clone();
        let arm_changes: ArmChanges = std::mem::take(&mut base.additions.arm_changes);
        let encoder_offset = std::mem::take(&mut base.additions.log_changes.encoder_offset);
        base.additions = Additions {
            arm_changes,
            log_changes: LogChanges { encoder_offset, ..LogChanges::default() },
            ..Additions::default()
        };
        base
    }

    /// The terms that depend on positions alone, constant torques among them: a hand-guided arm is
    /// compensated for them in addition to its weight.
    #[must_use]
    pub fn holding_terms(&self) -> Vec<Term<f64>> {
        let of_position = |law: &Law<f64>| {
            matches!(
                law,
                Law::Constant
                    | Law::Position
                    | Law::Cosine { .. }
                    | Law::Sine { .. }
                    | Law::OtherPosition { .. }
                    | Law::PositionProduct { .. }
                    | Law::CosineOfTwo { .. }
                    | Law::SineOfTwo { .. }
            )
        };
        self.terms().into_iter().map(|t| t.term).filter(|term| of_position(&term.law)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;
    use powerball_controller::dynamics::ArmModel;
    use powerball_identification::estimate::ParameterEstimate;
    use powerball_virtual_arm::lwa4p;

    /// The payload by the columns of the regressor and by the minimal set of an arm without symmetries.
    #[test]
    fn planned_torque_and_control_laws_hold_the_same_payload() {
        let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
        let all: Vec<f64> = lwa4p::links().iter().flat_map(|b| b.parameters()).collect();
        let values = body.model().set_values(body.model().set(SetKind::Minimal).unwrap(), &all);
        let entry = |(name, value): (&String, f64)| {
            let json = serde_json::json!({"name": name, "value": value, "std": 0.0, "relative_std": 0.0});
            serde_json::from_value::<ParameterEstimate>(json).unwrap()
        };
        let friction = powerball_controller::friction::TABLE_2.iter().enumerate().map(|(j, g)| {
            let [a, b, c, d, e] = g;
            let json = serde_json::json!({"joint": j + 1, "gamma1": a, "gamma2": b, "gamma3": c, "gamma4": d, "gamma5": e});
            serde_json::from_value(json).unwrap()
        });
        let mut model = TorqueModel {
            arm: String::new(),
            set: "minimal".to_string(),
            parameters: body.names().iter().zip(values).map(entry).collect(),
            friction: friction.collect(),
            joint_bands: Vec::new(),
            additions: Additions::default(),
            colour: None,
        };
        let payload = |end: Option<f64>| Payload {
            mass: 2.0,
            com: [0.05, -0.03, 0.12],
            link: None,
            logs: Vec::new(),
            start_time: Vec::new(),
            end_time: vec![end],
        };
        let mut motion = Motion::new(6, 0.005);
        motion.push([0.3, -0.7, 1.1, 0.4, -1.2, 2.0].map(|q: f64| [q, 0.4 * q.cos(), 2.0 * q.sin()]));
        motion.push([0.4, -0.6, 1.0, 0.5, -1.1, 1.9].map(|q: f64| [q, 0.3 * q.sin(), -1.5 * q.cos()]));
        let mut rigid = Vec::new();
        for held in [false, true] {
            model.additions.payloads = vec![payload((!held).then_some(3.0))];
            let arm: NumericArm<6> = model.numeric_arm(&body).unwrap().unwrap();
            let planned = model.planned(&body, &motion, 0.0);
            for (k, [q, dq, ddq]) in motion.samples().enumerate() {
                let [q, dq, ddq] = [q, dq, ddq].map(SVector::<f64, 6>::from_column_slice);
                let torque =
                    arm.mass_matrix(&q) * ddq + arm.coriolis_times_velocity(&q, &dq) + arm.gravity(&q);
                for j in 0..6 {
                    approx::assert_relative_eq!(
                        planned.rigid[6 * k + j],
                        torque[j],
                        epsilon = 1e-9,
                        max_relative = 1e-9
                    );
                    assert!(planned.effects[6 * k + j].abs() < 1e-9);
                }
            }
            rigid.push(planned.rigid);
        }
        assert!(rigid[0].iter().zip(&rigid[1]).any(|(a, b)| (a - b).abs() > 1.0));
    }
}
