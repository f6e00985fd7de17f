//! Arms on position servos, whose logs hold set-points and positions and no torque.
//!
//! The closed loop of each joint is simulated next to the measured motion of the others, and its constants
//! are those whose positions lie nearest to the measured ones ([`fit`]). Which constants the positions show
//! at all: without any known mass or motor, torques are known as shares of the torque at full duty only (the
//! equation of motion may be multiplied by any number); one known body, or `torque_constant`, `resistance`
//! and `supply` of the motor, makes all of them absolute. With unknown bodies the armature is part of them;
//! where the drive is never switched off, back-EMF and viscous friction are known as their sum.

mod body;
pub mod constants;
pub mod fit;
mod input;
mod problem;
mod result;
pub mod simulate;
#[cfg(test)]
mod tests;
mod uncertainty;

use crate::identify::IdentifyError;
use constants::{ALL, Constant, Found};
use dyngen::arm::{JointKind, ParameterKind};
use dyngen::{Arm, SetKind, Values};
use fit::{Fitted, Free, errors, slopes};
pub use input::{ServoInput, are_of_servos};
use powerball_controller::JointNumber;
use powerball_logs::Progress;
use powerball_logs::log::ServoLog;
use powerball_logs::regression::RigidArm;
pub use problem::{Known, Problem, Role};
pub use result::{Along, IdentifiedServos, JointServo, PositionStats, ServoFriction, no_torques};
pub use uncertainty::standard_errors;

/// Delays of the goal that are tried for its error, s.
const DELAYS: [f64; 2] = [0.3, 0.005];
/// The space between two pieces in a figure, s.
const BETWEEN: f64 = 0.2;

/// An arm on servos with what is known of its bodies.
#[derive(Debug)]
pub struct ServoArm {
    /// The arm's functions.
    pub body: RigidArm,
    /// Values of the minimal inertial set, where they are known.
    pub values: Option<Vec<f64>>,
    /// What a mass of 1 kg at the end of the arm adds to them.
    pub payload: Vec<f64>,
    /// Where the end of the arm is in its last frame: the tool, else the frame itself, m.
    pub tool: [f64; 3],
}

impl ServoArm {
    /// Of an arm file, and values of its inertial parameters where they are known.
    ///
    /// # Errors
    /// Arms that are not simulated here (prismatic joints, motors that turn with several joints), and values
    /// that are not the arm's.
    pub fn new(arm: &Arm, values: Option<&Values>) -> Result<ServoArm, IdentifyError> {
        if let Some(j) = arm.moving_joints().position(|joint| joint.kind == JointKind::Prismatic) {
            return Err(IdentifyError::Known(format!(
                "joint {} is prismatic: position servos are simulated on revolute joints only",
                j + 1
            )));
        }
        if !arm.transmissions.is_empty() {
            return Err(IdentifyError::Known(
                "the arm file has a [[transmission]]: position servos are simulated where each motor turns \
                one joint"
                    .into(),
            ));
        }
        let body = RigidArm::new(arm)?;
        let set = body.model().set(SetKind::Minimal)?;
        let of_set = |values: &Values| without_rotors(arm, values).of_set(body.model(), set);
        let values = values.map(of_set).transpose().map_err(|e| IdentifyError::Known(e.to_string()))?;
        let payload = body.model().set_values(set, &point_mass(arm));
        Ok(ServoArm { body, values, payload, tool: tool(arm) })
    }

    /// What is known of a joint.
    #[must_use]
    pub fn known(&self, joint: usize) -> Known<'_> {
        let servo = self.body.arm().moving_joints().nth(joint).and_then(|joint| joint.servo.clone());
        Known { servo: servo.unwrap_or_default(), values: self.values.as_deref(), payload: &self.payload }
    }
}

fn tool(arm: &Arm) -> [f64; 3] {
    arm.tool.as_ref().map_or([0.0; 3], |tool| tool.xyz.each_ref().map(dyngen::exact::rational::to_f64))
}

/// Values of the bodies alone: an armature is rotor and gear together, whether the arm file gives it or the
/// logs do.
fn without_rotors(arm: &Arm, values: &Values) -> Values {
    let all = arm.all_parameters();
    let rotors: Vec<String> =
        all.iter().filter(|p| p.kind == ParameterKind::Im).map(ToString::to_string).collect();
    values.with_zero(|name| rotors.iter().any(|rotor| rotor == name))
}

/// All parameters of 1 kg where the arm's last frame or its tool is.
fn point_mass(arm: &Arm) -> Vec<f64> {
    let mut all = vec![0.0; arm.all_parameters().len()];
    let [x, y, z] = tool(arm);
    let own = [1.0, x, y, z, y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y];
    let link = arm.tool_carrier() * ParameterKind::ALL.len();
    all[link..link + own.len()].copy_from_slice(&own);
    all
}

/// A joint that was fitted.
#[derive(Debug)]
pub struct Joint<'l> {
    /// The joint in the logs to fit, with what was found.
    pub problem: Problem<'l>,
    /// The fit.
    pub fitted: Fitted,
    /// The scales in which it was done.
    pub free: Vec<Free>,
    /// The standard error of each value.
    pub std: Vec<Option<f64>>,
}

impl<'l> Joint<'l> {
    /// Fits a joint's servo to logs.
    ///
    /// # Errors
    /// Where no log has a piece that is long enough.
    pub fn fit(arm: &ServoArm, logs: &'l [ServoLog], joint: usize) -> Result<Joint<'l>, IdentifyError> {
        let problem = Problem::new(&arm.body, logs, joint, &arm.known(joint)).ok_or_else(too_short)?;
        Ok(Joint::solve(problem))
    }

    /// Fits what is free in a problem.
    #[must_use]
    pub fn solve(mut problem: Problem<'l>) -> Joint<'l> {
        let (fitted, free) = problem.solve();
        let (problem, fitted, free) = problem.without_limits(fitted, free);
        let slopes = slopes(&problem, &fitted.values, &free);
        let std = standard_errors(&slopes, &fitted.errors, &free, problem.block());
        Joint { problem, fitted, free, std }
    }

    /// The delay with which the goal is nearest to the position, s.
    #[must_use]
    pub fn goal_delay(&self) -> f64 {
        let [most, step] = DELAYS;
        let delays = (0..=(most / step) as usize).map(|k| k as f64 * step);
        let error = |delay: &f64| rms(&self.problem.goal_errors(*delay));
        delays.min_by(|a, b| error(a).total_cmp(&error(b))).unwrap_or(0.0)
    }
}

fn too_short() -> IdentifyError {
    IdentifyError::NothingUsable(vec![
        "no log has half a second of samples without a gap: record longer, or see `powerball log`"
            .to_string(),
    ])
}

/// The root of the mean square of errors, rad.
#[must_use]
pub fn rms(errors: &[Vec<f64>]) -> f64 {
    let count = errors.iter().map(Vec::len).sum::<usize>().max(1);
    (errors.iter().flatten().map(|r| r * r).sum::<f64>() / count as f64).sqrt()
}

/// Fits the servo and the friction of every joint to logs of set-points and positions, and judges them on
/// other logs, `validate`, where there are any.
///
/// # Errors
/// Arms and logs that cannot be used: why.
pub fn identify_servos(
    arm: &ServoArm,
    logs: &[ServoLog],
    validate: &[ServoLog],
    progress: Progress<'_>,
) -> Result<IdentifiedServos, IdentifyError> {
    let dof = arm.body.dof();
    let mut result = IdentifiedServos {
        unusable: crate::usable::servo_doubts(arm.body.arm(), logs.iter().chain(validate)),
        arm: arm.body.arm().name.clone(),
        set: result::SET,
        parameters: Vec::new(),
        friction: Vec::new(),
        servo: Vec::new(),
        fit: PositionStats::default(),
        validate: (!validate.is_empty()).then(PositionStats::default),
        warnings: Vec::new(),
        along: Vec::new(),
    };
    if validate.is_empty() {
        result
            .warnings
            .push("no log was given to --validate: the errors below are those of the fit itself".into());
    }
    for j in 0..dof {
        progress.say(&format!("fitting the servo of joint {}", j + 1));
        let joint = Joint::fit(arm, logs, j)?;
        let delay = joint.goal_delay();
        add(&mut result.fit, &joint.fitted.errors, &joint.problem.goal_errors(delay));
        let held_out = joint.problem.in_logs(&arm.body, validate, j);
        let left = errors(&held_out, &[]);
        if let Some(stats) = &mut result.validate {
            add(stats, &left, &held_out.goal_errors(delay));
        }
        report(&mut result, arm, &joint, j);
        let (shown, left) =
            if validate.is_empty() { (&joint.problem, &joint.fitted.errors) } else { (&held_out, &left) };
        result.along.push(along(shown, left));
    }
    let judged = result.validate.as_ref().unwrap_or(&result.fit);
    let numbers = |which: &dyn Fn(usize) -> bool| -> Vec<String> {
        (0..dof).filter(|j| which(*j)).map(|j| (j + 1).to_string()).collect()
    };
    let off = numbers(&|j| result.fit.goal_error[j].is_none());
    let useless =
        numbers(&|j| judged.goal_error[j].is_some_and(|goal_error| judged.position_error[j] >= goal_error));
    if !off.is_empty() {
        result.unusable.push(off_in_all(&off.join(", ")));
    }
    if !useless.is_empty() {
        result.unusable.push(format!(
            "the position of joint {} is predicted no better than by its goal with a delay",
            useless.join(", ")
        ));
    }
    Ok(result)
}

/// Why a drive that is never switched on cannot be identified.
#[must_use]
pub fn off_in_all(joints: &str) -> String {
    format!(
        "the drive of joint {joints} is switched off (torque_enable) in all logs to fit: record some with it \
         switched on"
    )
}

/// The root of the mean square of the errors of a goal, rad; `None` where the drive was always switched off,
/// which has no goal.
#[must_use]
pub fn goal_error(errors: &[Vec<f64>]) -> Option<f64> {
    errors.iter().any(|own| !own.is_empty()).then(|| rms(errors))
}

fn add(stats: &mut PositionStats, left: &[Vec<f64>], goal: &[Vec<f64>]) {
    stats.position_error.push(rms(left));
    stats.goal_error.push(goal_error(goal));
    stats.samples = stats.samples.max(left.iter().map(Vec::len).sum());
}

/// Puts what was found of a joint into the result.
fn report(result: &mut IdentifiedServos, arm: &ServoArm, joint: &Joint<'_>, j: usize) {
    let (known, constants) = (arm.known(j), &joint.problem.constants);
    let number = JointNumber::from_index(j);
    let absolute = known.is_absolute();
    let of_role = |role: Role| joint.problem.roles.iter().position(|own| *own == role);
    let mut hidden = Vec::new();
    let mut parameters = Vec::new();
    for (constant, name, _) in ALL {
        let value = constants.of(constant);
        let fitted = of_role(Role::Constant(constant));
        let ideal = constants::Constants::ideal().of(constant);
        let is_unit = constant == Constant::Torque && !absolute;
        if (fitted.is_none() && value == ideal && !is_unit) || !value.is_finite() {
            continue;
        }
        let std = fitted.and_then(|at| joint.std[at]);
        // A torque that no log reaches has a standard error as large as it is.
        let is_hidden = match constant {
            Constant::Torque => !Values::is_shown(value, std),
            _ => std.is_none(),
        };
        hidden.extend((fitted.is_some() && is_hidden).then_some(name));
        let unit = constant.unit(absolute).to_string();
        parameters.push(Found { name: name.to_string(), value, std, unit, known: fitted.is_none() });
    }
    for (at, role) in joint.problem.roles.iter().enumerate() {
        if let Role::Inertial(c) = role {
            let own = &arm.body.names()[*c];
            let name =
                if arm.body.dof() == 1 { own.clone() } else { format!("{own} (joint {number} alone)") };
            let unit = if absolute { "SI" } else { "SI, for each N·m of torque at full duty" }.to_string();
            let (value, std) = (joint.fitted.values[at], joint.std[at]);
            result.parameters.push(Found { name, value, std, unit, known: false });
        }
    }
    if !hidden.is_empty() {
        result.warnings.push(format!(
            "joint {number}: these logs do not show {} alone: record steps and fast paths, and one where the \
            drive is switched off",
            hidden.join(", ")
        ));
    }
    if !absolute {
        result.warnings.push(format!(
            "joint {number}: nothing says how large torques are: they are shares of the torque at full duty; \
             give the arm's masses (--values) or torque_constant, resistance and supply in [joint.servo]"
        ));
    }
    result.friction.push(ServoFriction {
        joint: number,
        coulomb: constants.of(Constant::Coulomb),
        viscous: constants.of(Constant::Viscous),
        load: constants.of(Constant::Load),
    });
    result.servo.push(JointServo { joint: number, absolute, parameters });
}

fn along(problem: &Problem<'_>, left: &[Vec<f64>]) -> Along {
    let mut along = Along::default();
    for (track, left) in problem.tracks().iter().zip(left) {
        let shift = along.t.last().map_or(0.0, |t| t + BETWEEN) - track.t[0];
        along.t.extend(track.t.iter().map(|t| t + shift));
        along.measured.extend_from_slice(track.q);
        along.simulated.extend(track.q.iter().zip(left).map(|(q, r)| q + r));
        along.goal.extend_from_slice(track.goal);
    }
    along
}
