//! The next identification: the known torque is subtracted from the logs, and new effects are added to the
//! model.
//!
//! The module also makes the known model for the next identification or verification, and applies a model's
//! changes to the arm of the file.

use super::file::read_text;
use super::{Additions, ArmChanges, FileError, LogChanges, NamedTerm, TorqueModel};
use dyngen::Arm;
use dyngen::arm::{Parameter, ParameterKind};
use dyngen::exact::rational;
use powerball_controller::JointNumber;
use powerball_controller::correction::{Law, Term};
use powerball_identification::KnownModel;
use powerball_identification::mounting::Mounting;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataOptions, Recording, RigidArm, Signals};
use powerball_logs::signal::resample::{linear_at, median_step, smooth_at};
use std::path::{Path, PathBuf};

impl TorqueModel {
    /// Removes the known torque from logs, so that a base model can be fitted: positions become true ones,
    /// torques get their own time, and the terms, which keep their known values, are subtracted. `body` is
    /// the arm with the model's changes.
    pub fn take_out(&self, body: &RigidArm, logs: &mut [Log]) {
        let Some(motors) = body.motors() else { return self.take_out_of(body, logs) };
        for log in logs {
            let mut turned = [motors.log(log)];
            self.take_out_of(body, &mut turned);
            *log = motors.log_of_joints(&turned[0]);
        }
    }

    /// Like [`Self::take_out`], for logs of motors.
    fn take_out_of(&self, body: &RigidArm, logs: &mut [Log]) {
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
                        torque[k] -= linear_at(&grid, &added, log.t[k]);
                    }
                }
            }
        }
    }
}

impl Additions {
    /// Adds the effects that were found on logs without the known torque to the known ones.
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

    /// Keeps the torque and writes terms that were fitted at logged positions of a joint for true ones,
    /// `offset` rad less.
    pub(crate) fn put_zero_right(&mut self, joint: JointNumber, offset: f64) {
        let moved = |NamedTerm { effect, term, std }: NamedTerm| {
            let parts = at_true_position(&term, joint.index(), offset).into_iter();
            parts.map(move |part| {
                // A term that becomes two terms shares an error that neither has alone.
                let std = std.filter(|_| part == term);
                NamedTerm { effect: effect.clone(), term: part, std }
            })
        };
        self.terms = self.terms.drain(..).flat_map(moved).collect();
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
                Some(other) => {
                    other.term.coefficient += t.term.coefficient;
                    other.std = other.std.zip(t.std).map(|(a, b)| a.hypot(b));
                }
                None => joined.push(t),
            }
        }
        self.terms = joined;
    }
}

/// A term that was fitted at logged positions of a joint written for true ones, `offset` rad less: a sum.
fn at_true_position(term: &Term<f64>, joint: usize, offset: f64) -> Vec<Term<f64>> {
    let part = |factor: f64, law: Law<f64>| Term { coefficient: factor * term.coefficient, law, ..*term };
    let position = |of: usize| match of == term.joint {
        true => Law::Position,
        false => Law::OtherPosition { other: of },
    };
    let by = |of: usize| if of == joint { offset } else { 0.0 };
    // cos(x + o) = cos o·cos x − sin o·sin x, sin(x + o) = cos o·sin x + sin o·cos x.
    let turned = |by: f64, law: Law<f64>, other: Law<f64>, sign: f64| {
        vec![part(by.cos(), law), part(sign * by.sin(), other)]
    };
    let phase = |[i, k]: [usize; 2], [a, b]: [f64; 2]| a * by(i) + b * by(k);
    let mut parts = match term.law {
        Law::Position => vec![*term, part(by(term.joint), Law::Constant)],
        Law::OtherPosition { other } => vec![*term, part(by(other), Law::Constant)],
        Law::PositionProduct { joints: [i, k] } => vec![
            *term,
            part(by(i), position(k)),
            part(by(k), position(i)),
            part(by(i) * by(k), Law::Constant),
        ],
        Law::Cosine { order } => turned(order * by(term.joint), term.law, Law::Sine { order }, -1.0),
        Law::Sine { order } => turned(order * by(term.joint), term.law, Law::Cosine { order }, 1.0),
        Law::DirectionCosine { order, steepness } => {
            turned(order * by(term.joint), term.law, Law::DirectionSine { order, steepness }, -1.0)
        }
        Law::DirectionSine { order, steepness } => {
            turned(order * by(term.joint), term.law, Law::DirectionCosine { order, steepness }, 1.0)
        }
        Law::CosineOfTwo { joints, orders } => {
            turned(phase(joints, orders), term.law, Law::SineOfTwo { joints, orders }, -1.0)
        }
        Law::SineOfTwo { joints, orders } => {
            turned(phase(joints, orders), term.law, Law::CosineOfTwo { joints, orders }, 1.0)
        }
        _ => vec![*term],
    };
    let unmoved = |part: &Term<f64>| part.law == term.law;
    parts.retain(|part| part.coefficient != 0.0 || unmoved(part));
    parts
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
                    let (t, x) = (&log.t[piece.clone()], &logged[piece.clone()]);
                    for (torque, at) in torque[piece.clone()].iter_mut().zip(t) {
                        *torque = smooth_at(t, x, at + self.late(j));
                    }
                }
            }
        }
    }
}

// A model of an arm as what the next identification or verification knows.

/// A model from a file, which errors name.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    /// The model.
    pub model: TorqueModel,
    /// The model's file.
    pub file: PathBuf,
}

impl ModelFile {
    /// Reads `model.json` or `identified.json`.
    ///
    /// # Errors
    /// Those of [`TorqueModel::read`].
    pub fn read(file: &Path) -> Result<ModelFile, FileError> {
        ModelFile::parse(&read_text(file)?, file)
    }

    /// Like [`ModelFile::read`], from the text of a file; `file` is its name in errors.
    ///
    /// # Errors
    /// The errors of [`TorqueModel::parse`].
    pub fn parse(text: &str, file: &Path) -> Result<ModelFile, FileError> {
        let model = TorqueModel::parse(text, file)?;
        Ok(ModelFile { model, file: file.to_path_buf() })
    }

    /// The model with its parameters and joints in the order of a body's.
    ///
    /// # Errors
    /// Those of [`TorqueModel::checked`].
    pub fn checked(self, body: &RigidArm) -> Result<TorqueModel, FileError> {
        self.model.in_set_of(body).checked(body.names(), body.dof(), &self.file)
    }
}

impl KnownModel for ModelFile {
    fn arm(&self, arm: &Arm, mounting: Mounting) -> Result<Arm, String> {
        let changes = &self.model.additions.arm_changes;
        if mounting != Mounting::Filed && changes.gravity.is_some() {
            return Err(format!(
                "{}: the tilt of the base is known only for the mounting of the arm file, not for other \
                    mountings",
                self.file.display()
            ));
        }
        changes.of(arm).map_err(|e| format!("{}: {e}", self.file.display()))
    }

    fn in_set_of(&self, body: &RigidArm) -> Result<Box<dyn KnownModel>, String> {
        let model = self.clone().checked(body).map_err(|e| e.to_string())?;
        Ok(Box::new(ModelFile { model, ..self.clone() }))
    }

    fn take_out(&self, body: &RigidArm, logs: &mut [Log]) {
        self.model.take_out(body, logs);
    }

    fn residual(&self, body: &RigidArm, data: &Data<'_>) -> Signals {
        self.model.residual(body, data, &[])
    }
}

// The arm of the file as a model has it.

/// The reason why the changes of a model cannot be applied to an arm.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unchanged {
    /// A name that is not one of the arm's parameters.
    #[error("arm_changes.not_zero: '{0}' is no parameter of this arm")]
    NoParameter(String),
    /// Gravity that is not a number.
    #[error("arm_changes.gravity must be three finite numbers")]
    Gravity,
}

impl ArmChanges {
    /// The arm with the changes of the model.
    ///
    /// # Errors
    /// [`Unchanged`] if the changes are those of another arm.
    pub fn of(&self, arm: &Arm) -> Result<Arm, Unchanged> {
        let mut arm = arm.clone();
        if let Some(gravity) = self.gravity {
            let [x, y, z] = gravity.map(rational::from_f64);
            let (Some(x), Some(y), Some(z)) = (x, y, z) else { return Err(Unchanged::Gravity) };
            arm.gravity = [x, y, z];
        }
        for name in &self.not_zero {
            let parameter = Parameter::parse(name).filter(|p| p.link < arm.bodies());
            let Parameter { link, kind } = parameter.ok_or_else(|| Unchanged::NoParameter(name.clone()))?;
            arm.declared_zero_mut(link).retain(|zero| *zero != kind);
            // A published grouping does not know the parameter.
            arm.groupings.clear();
        }
        Ok(arm)
    }

    /// Whether the arm is as its file says.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == ArmChanges::default()
    }
}

/// The arm with nothing declared zero at its last link that a payload may fill.
#[must_use]
pub(super) fn with_open_hand(arm: &Arm) -> Arm {
    let mut arm = arm.clone();
    if let Some(last) = arm.joints.last_mut() {
        last.zero.retain(|kind| *kind == ParameterKind::Im);
    }
    arm.groupings.clear();
    arm
}
