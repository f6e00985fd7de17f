//! The arm as its file describes it: kinematics, declared symmetries, rotors, limits.

mod bar;
mod linkage;
mod loops;
mod mimic;
pub mod parameter;
mod read;
mod servo;
pub mod sum;
mod table;
pub mod transmission;

use crate::diagnostic::Diagnostics;
pub use crate::exact::angle::Angle;
use crate::exact::rational::{self, Rational};
pub use bar::Bar;
pub use linkage::{Hinge, Linkage};
pub use mimic::{Drive, Mimic};
use nalgebra::{Rotation3, Vector3};
use num_traits::{One, Zero};
pub use parameter::{Parameter, ParameterKind};
pub use read::is_name;
pub use servo::Servo;
use std::fmt;
use std::path::Path;
pub use transmission::Transmission;

/// The most joints an arm may have.
pub const MAX_JOINTS: usize = 20;

/// Which Denavit–Hartenberg convention the table follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// Frame i at the far end of link i: T = Rz(theta) Tz(d) Tx(a) Ty(b) Rx(alpha).
    Standard,
    /// Craig's: frame i on joint i: T = Tx(a) Ty(b) Rx(alpha) Rz(theta) Tz(d).
    Modified,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// q is added to theta, rad.
    Revolute,
    /// q is added to d, m.
    Prismatic,
}

/// One row of the DH table with what else is known of the joint and its link.
#[derive(Clone, PartialEq)]
pub struct Joint {
    /// The joint's name, where the file gives one: as in the URDF, and in the logs of others.
    pub name: Option<String>,
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Link length, m.
    pub a: Rational,
    /// What a row shifts along y in addition to `a`, before the twist, m: zero in a table of four numbers a
    /// row. Where axes are almost parallel, whose common normal is far away, it lets frames stay near the
    /// arm.
    pub b: Rational,
    /// Link twist.
    pub alpha: Angle,
    /// Link offset, m; the constant added to q of a prismatic joint.
    pub d: Rational,
    /// Joint angle; the constant added to q of a revolute joint.
    pub theta: Angle,
    /// Inertial parameters of the link that are declared zero.
    pub zero: Vec<ParameterKind>,
    /// Gear ratio; without it the joint has no rotor inertia.
    pub rotor_ratio: Option<Rational>,
    /// Lower and upper limit, rad or m.
    pub position: Option<[f64; 2]>,
    /// Largest velocity, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Largest acceleration, rad/s² or m/s².
    pub acceleration: Option<f64>,
    /// Largest torque, N·m or N.
    pub torque: Option<f64>,
    /// Torque at the joint for each ampere, N·m/A.
    pub torque_constant: Option<f64>,
    /// The joint that it follows, where it does not move on its own.
    pub mimic: Option<Mimic>,
    /// The frame in which a robot description has the link, in the frame of the table, where it is another:
    /// points of the link are reported in it.
    pub link_frame: Option<Placement>,
    /// The joint's drive, where that is a position servo.
    pub servo: Option<Servo>,
}

/// What the file does not say is left out, as for [`Arm`].
impl fmt::Debug for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = f.debug_struct("Joint");
        if let Some(name) = &self.name {
            text.field("name", name);
        }
        text.field("kind", &self.kind).field("a", &self.a);
        if !self.b.is_zero() {
            text.field("b", &self.b);
        }
        text.field("alpha", &self.alpha)
            .field("d", &self.d)
            .field("theta", &self.theta)
            .field("zero", &self.zero)
            .field("rotor_ratio", &self.rotor_ratio)
            .field("position", &self.position)
            .field("velocity", &self.velocity)
            .field("acceleration", &self.acceleration)
            .field("torque", &self.torque)
            .field("torque_constant", &self.torque_constant);
        if let Some(mimic) = &self.mimic {
            text.field("mimic", mimic);
        }
        if let Some(frame) = &self.link_frame {
            text.field("link_frame", frame);
        }
        if let Some(servo) = &self.servo {
            text.field("servo", servo);
        }
        text.finish()
    }
}

/// One entry of a published parameter set: a name and the exact sum of parameters it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Grouping {
    /// The name in the publication.
    pub name: String,
    /// The sum, in the order of the parameters.
    pub terms: Vec<(Parameter, Rational)>,
}

/// Where a frame stands in another, as a URDF says it.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Origin of the frame, m.
    pub xyz: [Rational; 3],
    /// Roll, pitch and yaw: R = Rz(yaw)·Ry(pitch)·Rx(roll).
    pub rpy: [Angle; 3],
}

impl Placement {
    /// A point of the frame that it stands in, as it sees it, m.
    pub fn see(&self, point: [f64; 3]) -> [f64; 3] {
        let [roll, pitch, yaw] = self.rpy.each_ref().map(|angle| angle.radians());
        let origin = Vector3::from(self.xyz.each_ref().map(rational::to_f64));
        let rotation = Rotation3::from_euler_angles(roll, pitch, yaw);
        rotation.inverse_transform_vector(&(Vector3::from(point) - origin)).into()
    }
}

/// A frame that is fixed on a link: where kinematics can be asked for, as at the tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The frame's name.
    pub name: String,
    /// The link that carries it, from 0.
    pub link: usize,
    /// Where it stands in the link's frame.
    pub placement: Placement,
}

/// A serial arm.
#[derive(Clone, PartialEq)]
pub struct Arm {
    /// The arm's name.
    pub name: String,
    /// The convention of the DH table.
    pub convention: Convention,
    /// Gravity in frame 0, m/s².
    pub gravity: [Rational; 3],
    /// The joints from the base outwards, 1 to [`MAX_JOINTS`].
    pub joints: Vec<Joint>,
    /// Frame 0 in the robot's root link, where it is another. Kinematics is then that of the root link;
    /// gravity and dynamics are those of frame 0.
    pub base: Option<Placement>,
    /// The tool's frame in the last link's, where it is another: where forward kinematics and the Jacobian
    /// look. It has no inertia of its own.
    pub tool: Option<Placement>,
    /// The link that carries the tool, from 0, where it is another than the last (see [`Arm::at_frame`]).
    pub tool_link: Option<usize>,
    /// Other frames, in the order of the file.
    pub frames: Vec<Frame>,
    /// A published parameter set, empty where the file has none.
    pub groupings: Vec<Grouping>,
    /// Motors that turn with several joints, empty where each turns with its own.
    pub transmissions: Vec<Transmission>,
    /// Bars of closed loops, whose bodies come after the links of the chain.
    pub bars: Vec<Bar>,
}

/// What the file does not say is left out: generated files state a hash of this text, which does not change
/// with what arm files can say since.
impl fmt::Debug for Arm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = f.debug_struct("Arm");
        text.field("name", &self.name)
            .field("convention", &self.convention)
            .field("gravity", &self.gravity)
            .field("joints", &self.joints)
            .field("tool", &self.tool)
            .field("groupings", &self.groupings);
        if let Some(base) = &self.base {
            text.field("base", base);
        }
        if !self.transmissions.is_empty() {
            text.field("transmissions", &self.transmissions);
        }
        if !self.bars.is_empty() {
            text.field("bars", &self.bars);
        }
        if let Some(link) = self.tool_link {
            text.field("tool_link", &link);
        }
        if !self.frames.is_empty() {
            text.field("frames", &self.frames);
        }
        text.finish()
    }
}

impl Arm {
    /// Reads an arm file.
    ///
    /// # Errors
    /// Every error of the file at once, each with its place.
    pub fn read(path: &Path) -> Result<Arm, Diagnostics> {
        let name = path.display().to_string();
        let text = crate::file::text(path)
            .map_err(|e| Diagnostics::whole_file(&name, format!("the arm file cannot be read: {e}")))?;
        Self::parse(&text, &name)
    }

    /// Reads an arm from text; `file` names it in errors.
    ///
    /// # Errors
    /// Every error of the text at once, each with its place.
    pub fn parse(text: &str, file: &str) -> Result<Arm, Diagnostics> {
        read::parse(text, file)
    }

    /// This arm with its tool at one of its frames: what functions give for the tool they then give for the
    /// frame.
    pub fn at_frame(&self, name: &str) -> Option<Arm> {
        let frame = self.frames.iter().find(|frame| frame.name == name)?;
        let (tool, tool_link) = (Some(frame.placement.clone()), Some(frame.link));
        Some(Arm { tool, tool_link, ..self.clone() })
    }

    /// Hash of the arm's description, the same on every machine (FNV-1a, 64 bits): what a generated file
    /// states about its arm.
    pub fn hash(&self) -> u64 {
        let step = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        format!("{self:?}").bytes().fold(0xcbf2_9ce4_8422_2325, step)
    }

    /// The link that carries the tool, from 0.
    pub fn tool_carrier(&self) -> usize {
        self.tool_link.unwrap_or(self.links() - 1)
    }

    /// The number of joints that move on their own: of coordinates q. Joints that follow others are links
    /// without a coordinate.
    pub fn dof(&self) -> usize {
        self.moving_joints().count()
    }

    /// The names of the joints that move on their own, in order: where the file gives none, the joint's
    /// number among them from 1, as logs have it.
    pub fn joint_names(&self) -> Vec<String> {
        let name = |(i, joint): (usize, &Joint)| joint.name.clone().unwrap_or_else(|| (i + 1).to_string());
        self.moving_joints().enumerate().map(name).collect()
    }

    /// Whether the file names a joint.
    pub fn has_joint_names(&self) -> bool {
        self.joints.iter().any(|joint| joint.name.is_some())
    }

    /// The parameters that the declared symmetries and missing rotors leave, in order: the set `full`.
    pub fn kept_parameters(&self) -> Vec<Parameter> {
        self.all_parameters().into_iter().filter(|p| self.keeps(*p)).collect()
    }

    /// All eleven parameters of every link of the chain, then of every bar, in order.
    pub fn all_parameters(&self) -> Vec<Parameter> {
        (0..self.bodies()).flat_map(|link| ParameterKind::ALL.map(|kind| Parameter { link, kind })).collect()
    }

    /// Whether a parameter is neither declared zero nor a rotor inertia of a joint without rotor.
    pub fn keeps(&self, parameter: Parameter) -> bool {
        if let Some(bar) = self.bar(parameter.link) {
            return parameter.kind != ParameterKind::Im && !bar.zero.contains(&parameter.kind);
        }
        self.joints.get(parameter.link).is_some_and(|joint| match parameter.kind {
            ParameterKind::Im => joint.rotor_ratio.is_some(),
            kind => !joint.zero.contains(&kind),
        })
    }

    /// The matrix of the motors' velocities, n × n by rows: motor i turns at Σ_j M_ij q̇_j on the joint's
    /// side of its gear (before the gear ratio); rad/s or m/s. Torques go the other way: τ = Mᵀ·τ_motors.
    ///
    /// The identity where the file has no `[[transmission]]`. Rotors are in the model already; friction sits
    /// on these velocities as well, and whoever adds it takes them from here.
    pub fn motor_velocity_matrix(&self) -> Vec<Vec<Rational>> {
        let n = self.links();
        let unit = |i: usize, j: usize| if i == j { Rational::one() } else { Rational::zero() };
        let mut matrix: Vec<Vec<Rational>> = (0..n).map(|i| (0..n).map(|j| unit(i, j)).collect()).collect();
        for block in &self.transmissions {
            for (motor, row) in block.joints.iter().zip(&block.matrix) {
                for (joint, factor) in block.joints.iter().zip(row) {
                    matrix[*motor][*joint] = factor.clone();
                }
            }
        }
        matrix
    }

    /// [`Arm::motor_velocity_matrix`] in numbers.
    pub fn motor_velocity_matrix_f64(&self) -> Vec<Vec<f64>> {
        let number = |row: Vec<Rational>| row.iter().map(rational::to_f64).collect();
        self.motor_velocity_matrix().into_iter().map(number).collect()
    }

    /// The chain of a standard table in the modified convention, with frame i on joint i and every parameter
    /// kept: the same axes and the same motion, but its links' parameters are expressed in other frames. It
    /// has no tool.
    pub fn on_joints(&self) -> Arm {
        let mut arm =
            Arm { convention: Convention::Modified, tool: None, frames: Vec::new(), ..self.clone() };
        let flat = || (Rational::zero(), Rational::zero(), Angle::PiMultiple(Rational::zero()));
        let rows = self.joints.iter().map(|joint| (joint.a.clone(), joint.b.clone(), joint.alpha.clone()));
        for (joint, row) in arm.joints.iter_mut().zip(std::iter::once(flat()).chain(rows)) {
            (joint.a, joint.b, joint.alpha) = row;
            joint.zero = Vec::new();
            joint.link_frame = None;
        }
        arm
    }

    /// The joints that a motor turns with and by how much, where that is not its own joint alone, by one.
    pub fn coupled_motor(&self, motor: usize) -> Option<Vec<(usize, Rational)>> {
        self.transmissions.iter().find_map(|block| {
            let row = &block.matrix[block.joints.iter().position(|joint| *joint == motor)?];
            let entries = block.joints.iter().copied().zip(row.iter().cloned());
            let mut entries: Vec<(usize, Rational)> =
                entries.filter(|(_, factor)| !factor.is_zero()).collect();
            entries.sort_by_key(|(joint, _)| *joint);
            (entries != [(motor, Rational::one())]).then_some(entries)
        })
    }

    /// The lengths of the links together, m.
    pub fn length(&self) -> f64 {
        let value = rational::to_f64;
        self.joints.iter().map(|j| value(&j.a).hypot(value(&j.b)).hypot(value(&j.d))).sum()
    }

    /// What no arm is: most likely a number in another unit. What is computed with it should not be used.
    pub fn doubts(&self) -> Vec<String> {
        let value = rational::to_f64;
        let mut doubts = Vec::new();
        let length = self.length();
        if length > LONGEST_ARM {
            doubts.push(format!(
                "the links are {length:.0} m long together: give a, b and d in metres (mm look like this)"
            ));
        }
        let gravity = self.gravity.iter().map(|g| value(g).powi(2)).sum::<f64>().sqrt();
        if gravity > STRONGEST_GRAVITY {
            doubts.push(format!(
                "gravity is {gravity:.0} m/s²: give it in m/s² (mm/s² look like this; on Earth it is 9.81)"
            ));
        }
        doubts
    }

    /// Things about the file that are no errors but that its author may not have meant.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (i, joint) in self.joints.iter().enumerate() {
            for (key, angle) in [("alpha", &joint.alpha), ("theta", &joint.theta)] {
                if let Some(text) = angle.looks_rounded() {
                    notes.push(format!("joint {}: {key} = {text}", i + 1));
                }
            }
            if let Some([low, high]) =
                joint.position.filter(|p| joint.kind == JointKind::Revolute && degrees(p))
            {
                notes.push(format!(
                    "joint {}: position = [{low}, {high}] is in rad; as degrees that would be [{:.4}, {:.4}]",
                    i + 1,
                    low.to_radians(),
                    high.to_radians()
                ));
            }
        }
        notes
    }
}

/// No arm is longer, m.
const LONGEST_ARM: f64 = 50.0;
/// On no planet is gravity stronger, m/s²: 25 on Jupiter.
const STRONGEST_GRAVITY: f64 = 100.0;

/// Whether a joint's limits look as if they were degrees: whole numbers beyond what a joint turns.
fn degrees(position: &[f64; 2]) -> bool {
    position.iter().all(|x| x.fract() == 0.0) && position.iter().any(|x| x.abs() >= 30.0)
}
