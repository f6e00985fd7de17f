//! The model as one Rust file for a controller: no `std`, no allocation, nothing needed but nalgebra.

use super::c_api::Behind;
use super::known::with_open_hand;
use super::{TorqueModel, Unchanged};
use dyngen::arm::{Parameter, ParameterKind};
use dyngen::emit::c_api::checked_prefix;
use dyngen::emit::{self, Options};
use dyngen::{Arm, Function, Model, SetKind};
use powerball_controller::{correction, friction};
use powerball_logs::log::Motors;
use std::fmt::{self, Write};

/// The scalar of a controller's code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scalar {
    /// Single precision: a microcontroller's.
    F32,
    /// Double precision.
    #[default]
    F64,
}

impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Scalar::F32 => "f32",
            Scalar::F64 => "f64",
        })
    }
}

/// A model's code with an API for callers in C.
#[derive(Clone, Debug)]
pub struct ForC {
    /// The file in Rust, with the `extern "C"` functions.
    pub source: String,
    /// The header.
    pub header: String,
}

/// Why there is no code.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SourceError {
    /// The model's changes are those of another arm.
    #[error("{0}")]
    Changes(Unchanged),
    /// The generator failed: code that cannot be proven is not emitted.
    #[error("{0}")]
    Generator(dyngen::Error),
    /// No name in C can begin so.
    #[error("{0}")]
    Prefix(String),
    /// Motors that turn with several joints, for code that knows none.
    #[error("the arm file couples joints by a transmission, which an FMU does not have here")]
    Coupled,
}

impl TorqueModel {
    /// Effects that a controller cannot compensate, a sentence each.
    #[must_use]
    pub fn not_compensated(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (j, delay) in self.additions.log_changes.delay.iter().enumerate().filter(|(_, d)| **d != 0.0) {
            notes.push(format!(
                "joint {}: measured torque is {:.2} ms late; no torque makes up for that: compare it with \
                    the torque of so much earlier, or \
                 take the reference so much ahead",
                j + 1,
                1e3 * delay
            ));
        }
        for t in self.terms() {
            let (joint, size) = (t.term.joint + 1, t.term.coefficient);
            let what = match t.term.law {
                correction::Law::Compliance => format!("gives way by {size:e} rad for 1 N·m"),
                correction::Law::HangingBack { .. } => {
                    format!("hangs by {size:e} rad to the side of its load")
                }
                _ => continue,
            };
            notes.push(format!(
                "joint {joint}: {what}; the torque below has its part of the position, not that of its \
                    velocity and acceleration: \
                 give the motor a reference ahead of the link's by as much"
            ));
        }
        notes
    }

    /// The file for an arm file's arm: dynamics with the model's values baked in, friction, terms, and
    /// `TorqueModel::torque`, which puts them together. `functions` are emitted in addition to the inverse
    /// dynamics.
    ///
    /// # Errors
    /// [`SourceError`].
    pub fn source(&self, arm: &Arm, scalar: Scalar, functions: &[Function]) -> Result<String, SourceError> {
        let arm = self.additions.arm_changes.of(arm).map_err(SourceError::Changes)?;
        let all = [&[Function::InverseDynamics], functions].concat();
        let rigid = dynamics(&arm, all, |_| self.inertial())?;
        let payload = match self.additions.payloads.last() {
            None => None,
            Some(payload) => {
                Some(dynamics(&with_open_hand(&arm), vec![Function::InverseDynamics], |model| {
                    let mut all = vec![0.0; model.arm().all_parameters().len()];
                    let first = Parameter { link: model.arm().dof() - 1, kind: ParameterKind::M }.index();
                    let held = payload.parameters();
                    all[first..first + held.len()].copy_from_slice(&held);
                    model.set(SetKind::Minimal).map(|set| model.set_values(set, &all)).unwrap_or_default()
                })?)
            }
        };
        let mut text = self.head(&arm);
        // Writing to a String cannot fail.
        let _ = self.tables(&mut text, scalar);
        let motors = Motors::of(&arm);
        text.push_str(&motors.as_ref().map(coordinates).unwrap_or_default());
        let moves = self.terms().iter().any(|t| t.term.law.moves_link());
        text.push_str(&api(payload.is_some(), moves, motors.is_some()));
        let module = |doc: &str, name: &str, body: &str| format!("\n{doc}pub mod {name} {{\n{body}}}\n");
        text.push_str(&module("/// The rigid arm.\n", "rigid", &rigid));
        if let Some(payload) = payload {
            text.push_str(&module("/// What the payload adds to the rigid arm.\n", "payload", &payload));
        }
        text.push_str(&module("", "friction", friction::SOURCE));
        text.push_str(&module("", "correction", correction::SOURCE));
        Ok(text)
    }

    /// Like [`Self::source`], with `extern "C"` functions whose names begin with `prefix`, and a header for
    /// them.
    ///
    /// The model is the caller's own memory, so there is no allocation; no pointer is kept.
    ///
    /// # Errors
    /// [`SourceError`]: also where `prefix` cannot begin a name in C.
    pub fn source_for_c(
        &self,
        arm: &Arm,
        scalar: Scalar,
        functions: &[Function],
        prefix: &str,
    ) -> Result<ForC, SourceError> {
        checked_prefix(prefix).map_err(SourceError::Prefix)?;
        let source = self.source(arm, scalar, functions)?;
        let behind = Behind {
            arm: &arm.name,
            scalar: scalar.to_string(),
            joints: self.friction.len(),
            parameters: self.parameters.len(),
            terms: self.terms().len(),
            payload: !self.additions.payloads.is_empty(),
            functions,
        };
        let api = behind.api(prefix);
        Ok(ForC { source: source + &api.module, header: api.header })
    }

    fn head(&self, arm: &Arm) -> String {
        let mut lines = vec![
            format!(
                "@generated by powerball {} for the arm '{}'. Do not edit: identify or explain anew and",
                env!("CARGO_PKG_VERSION"),
                arm.name
            ),
            "generate again.".to_string(),
            "Needs: nalgebra 0.35 (default-features = false and feature libm where there is no std)."
                .to_string(),
        ];
        lines.extend(self.not_compensated().into_iter().map(|note| format!("Note: {note}.")));
        lines.iter().map(|line| format!("// {line}\n")).collect()
    }

    fn tables(&self, text: &mut String, scalar: Scalar) -> fmt::Result {
        let law = if self.terms().is_empty() { "" } else { "Law, " };
        writeln!(
            text,
            "
use correction::{{Corrector, Instant, {law}Term}};
use friction::TanhFriction;
use nalgebra::SVector;

/// The scalar of everything here.
pub type Real = {scalar};

/// Number of joints.
pub const JOINTS: usize = rigid::JOINTS;

/// Number of terms beyond rigid torque and friction.
pub const TERMS: usize = {};

/// Friction of every joint (Eq. 16).
#[allow(clippy::excessive_precision)]
pub const FRICTION: [TanhFriction<Real>; JOINTS] = [",
            self.terms().len()
        )?;
        for [g1, g2, g3, g4, g5] in self.gammas() {
            writeln!(
                text,
                "    TanhFriction {{ gamma1: {g1:?}, gamma2: {g2:?}, gamma3: {g3:?}, gamma4: \
                    {g4:?}, gamma5: {g5:?} }},"
            )?;
        }
        let offsets: Vec<f64> =
            (0..self.friction.len()).map(|j| self.additions.log_changes.offset(j)).collect();
        writeln!(
            text,
            "];

/// What the encoders show too much, rad.
#[allow(clippy::excessive_precision)]
pub const ENCODER_OFFSET: [Real; JOINTS] = {offsets:?};

/// What the rigid arm with friction lacks. Joints count from 0.
#[allow(clippy::excessive_precision)]
pub const CORRECTIONS: [Term<Real>; TERMS] = ["
        )?;
        for t in &self.terms() {
            let term = &t.term;
            writeln!(
                text,
                "    // {}\n    Term {{ joint: {}, coefficient: {:?}, law: Law::{:?} }},",
                t.effect, term.joint, term.coefficient, term.law
            )?;
        }
        writeln!(text, "];")
    }
}

/// The inverse dynamics of an arm with values of its minimal set baked in.
fn dynamics(
    arm: &Arm,
    functions: Vec<Function>,
    values: impl Fn(&Model) -> Vec<f64>,
) -> Result<String, SourceError> {
    let model = Model::derive(arm.clone()).map_err(SourceError::Generator)?;
    let values = Some(values(&model));
    let options = Options { parameters: SetKind::Minimal, functions, values, ..Options::default() };
    emit::source(&model, &options).map_err(SourceError::Generator)
}

/// Between joints and motors, where a transmission couples joints: everything but the rigid arm is of motors.
fn coordinates(motors: &Motors) -> String {
    let [velocities, back] = [motors.matrix(), motors.inverse()]
        .map(|rows| rows.iter().map(|row| format!("\n    {row:?},")).collect::<String>());
    format!(
        "
/// Motor i turns at the sum over joints j of `MOTOR_VELOCITIES[i][j]` times their velocities, on the joint's
/// side of its gear. Friction, encoders and corrections are of the motors.
#[allow(clippy::excessive_precision)]
pub const MOTOR_VELOCITIES: [[Real; JOINTS]; JOINTS] = [{velocities}
];

/// The inverse of `MOTOR_VELOCITIES`.
#[allow(clippy::excessive_precision)]
const JOINT_VELOCITIES: [[Real; JOINTS]; JOINTS] = [{back}
];

/// A matrix times a column.
fn times(matrix: &[[Real; JOINTS]; JOINTS], x: &SVector<Real, JOINTS>) -> SVector<Real, JOINTS> {{
    SVector::from_fn(|i, _| matrix[i].iter().zip(x.iter()).map(|(m, x)| m * x).sum())
}}

/// A transposed matrix times a column.
fn transposed_times(matrix: &[[Real; JOINTS]; JOINTS], x: &SVector<Real, JOINTS>) -> SVector<Real, JOINTS> {{
    SVector::from_fn(|j, _| matrix.iter().zip(x.iter()).map(|(row, x)| row[j] * x).sum())
}}
"
    )
}

/// The field of the payload, its value at the start, and the torque of the rigid arm with it.
fn payload_pieces(payload: bool) -> (&'static str, &'static str, &'static str) {
    if !payload {
        return ("", "", "rigid::inverse_dynamics(q, dq, ddq)");
    }
    let rigid = "match self.holds_payload {
            true => rigid::inverse_dynamics(q, dq, ddq) + payload::inverse_dynamics(q, dq, ddq),
            false => rigid::inverse_dynamics(q, dq, ddq),
        }";
    (
        "\n    /// Whether the last link holds the payload.\n    pub holds_payload: bool,",
        ", holds_payload: false",
        rigid,
    )
}

/// Where a transmission couples joints, the terms are of motors and the rigid arm of joints.
struct MotorPieces {
    /// From the motion of the joints to that of the motors.
    to_motors: &'static str,
    /// From the motors' torque to the joints'.
    to_joints: &'static str,
    /// From the motion of the motors to that of the joints, and what comes before the rigid arm's torque.
    of_motors: &'static str,
    /// Whose torque it is, in words.
    whose: &'static str,
    /// From the rigid arm's torque on the joints to that on the motors.
    on_motors: &'static str,
}

fn motor_pieces(coupled: bool) -> MotorPieces {
    if !coupled {
        return MotorPieces {
            to_motors: "",
            to_joints: "torque",
            of_motors: "\n        ",
            whose: "rigid arm at true positions",
            on_motors: "",
        };
    }
    MotorPieces {
        to_motors: "
        let [q, dq, ddq] = [q, dq, ddq].map(|x| times(&MOTOR_VELOCITIES, x));
        let (dq, ddq) = (&dq, &ddq);",
        to_joints: "transposed_times(&MOTOR_VELOCITIES, &torque)",
        of_motors: "
        let [q, dq, ddq] = [q, dq, ddq].map(|x| times(&JOINT_VELOCITIES, x));
        let (q, dq, ddq) = (&q, &dq, &ddq);
        let torque = ",
        whose: "rigid arm on its motors, at their true positions",
        on_motors: ";\n        transposed_times(&JOINT_VELOCITIES, &torque)",
    }
}

/// The struct that a controller calls; `coupled`: a transmission couples joints.
fn api(payload: bool, moves: bool, coupled: bool) -> String {
    let (field, held, rigid) = payload_pieces(payload);
    let again = match moves {
        true => {
            "
        let mut link = place;
        self.corrector.move_links(rigid.as_slice(), link.as_mut_slice());
        let rigid = self.rigid(&link, dq, ddq);"
        }
        false => "",
    };
    let MotorPieces { to_motors, to_joints, of_motors, whose, on_motors } = motor_pieces(coupled);
    format!(
        "
/// The torque model with what its terms remember from sample to sample.
#[derive(Clone, Debug)]
pub struct TorqueModel {{
    corrector: Corrector<Real, TERMS>,{field}
}}

impl Default for TorqueModel {{
    fn default() -> Self {{
        TorqueModel {{ corrector: Corrector::new(CORRECTIONS){held} }}
    }}
}}

impl TorqueModel {{
    /// The torques of a motion, friction and corrections included, N·m in the units of the logs that the
    /// model is of.
    ///
    /// Call it once a sample, in the order of time.
    ///
    /// * `q`: positions as the encoders show them, rad
    /// * `dq`: velocities, rad/s
    /// * `ddq`: accelerations, rad/s²
    /// * `running`: time since the arm began to work, as cold as when it was recorded, s
    /// * `temperature`: of the joints, °C; may be empty where no term asks for it
    #[must_use]
    pub fn torque(
        &mut self,
        q: &SVector<Real, JOINTS>,
        dq: &SVector<Real, JOINTS>,
        ddq: &SVector<Real, JOINTS>,
        running: Real,
        temperature: &[Real],
    ) -> SVector<Real, JOINTS> {{{to_motors}
        let place = q - SVector::from(ENCODER_OFFSET);
        let rigid = self.rigid(&place, dq, ddq);{again}
        let mut friction = *dq;
        for (torque, law) in friction.iter_mut().zip(&FRICTION) {{
            *torque = law.torque(*torque);
        }}
        let now = Instant {{
            q: place.as_slice(),
            dq: dq.as_slice(),
            ddq: ddq.as_slice(),
            rigid: rigid.as_slice(),
            friction: friction.as_slice(),
            temperature,
            running,
        }};
        let mut torque = rigid + friction;
        self.corrector.add_torques(&now, torque.as_mut_slice());
        {to_joints}
    }}

    /// The torque of the {whose}.
    fn rigid(
        &self,
        q: &SVector<Real, JOINTS>,
        dq: &SVector<Real, JOINTS>,
        ddq: &SVector<Real, JOINTS>,
    ) -> SVector<Real, JOINTS> {{{of_motors}{rigid}{on_motors}
    }}
}}
"
    )
}
