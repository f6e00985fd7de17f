//! The torque that a path needs, compared with the joints' limits.

use super::Error;
use super::constraints::JointLimits;
use super::shape::{Shape, poses};
use dyngen::arm::{Arm, ParameterKind};
use dyngen::exact::rational::to_f64;
use dyngen::{Evaluator, Function, Model, SetKind, Values};
use nalgebra::Vector3;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::Motors;
use std::f64::consts::PI;
use std::path::Path;

/// Dynamic parameters of a link.
const PER_LINK: usize = ParameterKind::ALL.len();

/// kg/m³: a module of aluminium, motor, gear and air.
const DENSITY: f64 = 1500.0;
/// An arm can hold itself: its weight takes at most this share of a joint's torque in any pose.
const OWN_WEIGHT: f64 = 0.4;
/// A rotor takes about this share of a joint's torque at the joint's largest acceleration.
const ROTOR: f64 = 0.1;

/// The masses of the arm's links, from a model or estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct Masses {
    /// All parameters, eleven a link, SI units.
    pub parameters: Vec<f64>,
    /// γ1 … γ5 of Eq. 16 by joint, where they are known.
    pub friction: Option<Vec<[f64; 5]>>,
    /// Share of every torque limit that stays unused, for what is not known.
    pub reserve: f64,
    /// A sentence about the source of the masses.
    pub origin: String,
}

impl Masses {
    /// Reads a file of an arm, whose text [`Masses::parse`] takes.
    ///
    /// # Errors
    /// Those of [`Masses::parse`], and a file that cannot be read.
    pub fn read(path: &Path, arm: &Arm) -> Result<Masses, Error> {
        let file = path.display().to_string();
        let text =
            dyngen::file::text(path).map_err(|e| Error::Setting(format!("{file}: cannot be read: {e}")))?;
        Masses::parse(&text, &file, &Model::derive(arm.clone())?)
    }

    /// Reads the text of a values file (`{"parameter": number, …}`, as `dyngen` takes it), or of an
    /// identified.json, whose consistent parameters and friction are taken.
    ///
    /// # Errors
    /// Missing values of the file, or names that the arm does not have.
    pub fn parse(text: &str, file: &str, model: &Model) -> Result<Masses, Error> {
        let wrong = |what: String| Error::Setting(format!("{file}: {what}"));
        let json: serde_json::Value =
            serde_json::from_str(text).map_err(|e| wrong(format!("is no JSON: {e}")))?;
        let identified =
            json.get("consistent").and_then(|c| Some((c.get("parameters")?, c.get("friction")?)));
        let (parameters, friction) = match identified {
            Some((parameters, friction)) => {
                let friction = serde_json::from_value::<Vec<[f64; 5]>>(friction.clone())
                    .ok()
                    .filter(|friction| friction.len() == model.arm().dof())
                    .ok_or_else(|| wrong("its friction is not five numbers for each joint".to_string()))?;
                (parameters.to_string(), Some(friction))
            }
            None => (text.to_string(), None),
        };
        let (kind, values) = Values::parse(&parameters, file)
            .and_then(|values| values.recognise(model))
            .map_err(|e| Error::Setting(e.to_string()))?;
        // Whatever the set, its carriers move like it.
        let mut all = vec![0.0; model.arm().all_parameters().len()];
        for (parameter, value) in model.set(kind)?.parameters.iter().zip(values) {
            for (carrier, coefficient) in &parameter.carriers {
                all[carrier.index()] += model.sets().field.value(coefficient) * value;
            }
        }
        let (reserve, what) = match friction {
            Some(_) => (0.0, "masses and friction"),
            None => (0.3, "masses, and 30 % of each limit is left for friction, which it does not give"),
        };
        Ok(Masses { parameters: all, friction, reserve, origin: format!("{file} gives {what}") })
    }

    /// A guess for an arm of which nothing but its file is known: its capsules, filled with the density of
    /// modules but never so heavy that the arm could not hold itself, and rotors that fit the joints' torque
    /// and acceleration.
    ///
    /// # Errors
    /// Those of [`Load::new`].
    pub fn guess(model: &Model, shape: &Shape, limits: &[JointLimits]) -> Result<Masses, Error> {
        let arm = model.arm();
        let mut masses = Masses {
            parameters: bodies(arm, shape, limits),
            friction: None,
            reserve: 0.0,
            origin: String::new(),
        };
        let load = Load::new(model, &masses, limits)?;
        let still = vec![0.0; arm.dof()];
        let heaviest = poses(limits).flat_map(|q| load.shares(&q, &still, &still)).fold(0.0f64, f64::max);
        let lighter = (OWN_WEIGHT / heaviest).min(1.0);
        masses.parameters.iter_mut().for_each(|x| *x *= lighter);
        for (i, joint) in arm.joints.iter().enumerate() {
            let ratio = joint.rotor_ratio.as_ref().map(to_f64);
            if let (Some(k), Some(torque), Some(acceleration)) = (ratio, joint.torque, joint.acceleration) {
                masses.parameters[PER_LINK * i + ParameterKind::Im as usize] =
                    ROTOR * torque / (acceleration * k * k);
            }
        }
        let total: f64 = masses.parameters.iter().step_by(PER_LINK).sum();
        masses.reserve = 0.5;
        masses.origin = format!(
            "no model was given: links are taken as solid capsules of {:.0} kg/m³ ({total:.1} kg in all), \
                and half of each limit is left for friction and the error of this estimate",
            DENSITY * lighter
        );
        Ok(masses)
    }
}

/// Every link's capsules of even density about its frame's origin; a link without length is a ball.
fn bodies(arm: &Arm, shape: &Shape, limits: &[JointLimits]) -> Vec<f64> {
    let n = arm.dof();
    let radius = shape.radius();
    let middle: Vec<f64> = limits.iter().map(|l| 0.5 * (l.position[0] + l.position[1])).collect();
    let frames = powerball_logs::chain::Chain::new(arm).poses(&middle);
    // Bars are thin rods: without a model they weigh nothing.
    let mut all = vec![0.0; arm.all_parameters().len()];
    let mut add = |link: usize, mass: f64, at: Vector3<f64>| {
        // A ball's own inertia, moved to the frame's origin.
        let own = 0.4 * mass * radius * radius;
        let row = &mut all[PER_LINK * link..PER_LINK * (link + 1)];
        row[0] += mass;
        (0..3).for_each(|i| row[1 + i] += mass * at[i]);
        let square = at.norm_squared();
        for (k, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            row[4 + k] += if i == j { own + mass * (square - at[i] * at[i]) } else { mass * at[i] * at[j] };
        }
    };
    for link in 0..n {
        add(link, DENSITY * 4.0 / 3.0 * PI * radius.powi(3), Vector3::zeros());
    }
    for (link, axis) in shape.segments(&middle).filter(|(link, _)| *link > 0) {
        let (rotation, origin) = &frames[link - 1];
        let mass = DENSITY * PI * radius * radius * axis.length();
        // Three points of Gauss have a rod's mass, centre and inertia.
        for (place, weight) in [(-0.6f64.sqrt(), 5.0), (0.0, 8.0), (0.6f64.sqrt(), 5.0)] {
            let at = rotation.transpose() * (axis.at(0.5 + 0.5 * place) - origin);
            add(link - 1, mass * weight / 18.0, at);
        }
    }
    all
}

/// The torques of an arm in one mounting.
#[derive(Clone, Debug)]
pub struct Load {
    torque: Evaluator,
    values: Vec<f64>,
    friction: Vec<TanhFriction<f64>>,
    /// Where a transmission couples joints: friction sits on these.
    motors: Option<Motors>,
    /// N·m; no limit is infinite.
    limits: Vec<f64>,
}

impl Load {
    /// The torques of a model (its gravity is the mounting's); `limits` already leave their margin.
    ///
    /// # Errors
    /// Those of [`Evaluator::new`].
    pub fn new(model: &Model, masses: &Masses, limits: &[JointLimits]) -> Result<Load, Error> {
        let set = model.set(SetKind::Minimal)?;
        Ok(Load {
            torque: Evaluator::new(model, Function::InverseDynamics, SetKind::Minimal)?,
            values: model.set_values(set, &masses.parameters),
            friction: masses.friction.iter().flatten().map(|gamma| TanhFriction::new(*gamma)).collect(),
            motors: Motors::of(model.arm()),
            limits: limits
                .iter()
                .map(|limit| limit.torque.map_or(f64::INFINITY, |t| t * (1.0 - masses.reserve)))
                .collect(),
        })
    }

    /// Torques, n a sample, N·m.
    #[must_use]
    pub fn torques(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; q.len()];
        self.torque.evaluate(q, dq, ddq, &self.values, &mut out);
        if self.friction.is_empty() {
            return out;
        }
        let laws = self.friction.iter().cycle();
        let spent =
            |v: &[f64]| -> Vec<f64> { v.iter().zip(laws.clone()).map(|(v, law)| law.torque(*v)).collect() };
        let friction = match &self.motors {
            None => spent(dq),
            Some(motors) => motors.joint_torques(&spent(&motors.positions(dq))),
        };
        out.iter_mut().zip(friction).for_each(|(tau, friction)| *tau += friction);
        out
    }

    /// Torques as shares of what may be used of their limits, n a sample; 0 where there is no limit.
    #[must_use]
    pub fn shares(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let mut torques = self.torques(q, dq, ddq);
        torques.iter_mut().zip(self.limits.iter().cycle()).for_each(|(tau, limit)| *tau = tau.abs() / limit);
        torques
    }

    /// The usable part of each joint's torque limit, N·m; infinite if there is none.
    #[must_use]
    pub fn limits(&self) -> &[f64] {
        &self.limits
    }
}
