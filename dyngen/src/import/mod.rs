//! Arms from other descriptions: a serial chain of a URDF becomes an arm file with inertial values next to
//! it.
//!
//! 0. `source`: the file's letters and what it includes; `urdf`, `mjcf`: its links and joints.
//! 1. `tree`, `chain`: from the tree of links to one chain: fixed joints merged, everything at q = 0 in the
//!    root link's frame.
//! 2. `rounding`: the nearest arm with right angles and without residues of lengths.
//!    `change`: what that does to the tip and to the mass matrix.
//! 3. `frames`: Denavit–Hartenberg frames on the joint axes, by their common normals.
//! 4. `text`: the arm file, with the bodies' inertia moved into the new frames.
//!
//! Joint positions keep their meaning: q of the arm file is the URDF's q, for position limits too.

pub(crate) mod chain;
mod change;
mod equality;
mod frames;
mod loops;
pub(crate) mod mjcf;
mod numbers;
mod orientation;
pub(crate) mod pose;
pub(crate) mod rounding;
mod shapes;
mod source;
pub(crate) mod text;
mod tree;
pub(crate) mod urdf;

use crate::arm::{Arm, Convention, Parameter};
use change::Change;
pub use source::Source;
use std::fmt;

/// How to read a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The link that stands still, and in whose frame everything is given; the root where it is left out.
    pub base: Option<String>,
    /// Joints that are held at a position, rad or m: they become part of what they are fixed to.
    pub lock: Vec<(String, f64)>,
    /// The link that ends the chain; may be left out where the URDF is one chain already.
    pub tip: Option<String>,
    /// The convention of the arm file.
    pub convention: Convention,
    /// Angles this close to a multiple of pi/12 are taken for it, rad.
    pub angle_tolerance: f64,
    /// Whether every digit counts: else numbers that are rounded are taken for what they were rounded from.
    pub exact: bool,
}

impl Default for Options {
    /// The whole chain, modified convention, 1e-9 rad, rounded numbers as they were meant.
    fn default() -> Self {
        Options {
            base: None,
            lock: Vec::new(),
            tip: None,
            convention: Convention::Modified,
            angle_tolerance: 1e-9,
            exact: false,
        }
    }
}

/// An arm that was imported.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The arm, as reading [`Imported::text`] gives it.
    pub arm: Arm,
    /// The arm file.
    pub text: String,
    /// The values of all parameters that the arm keeps, in order, SI units; none where no link has an
    /// inertia.
    pub values: Vec<(Parameter, f64)>,
    /// Frame 0 in the root link's frame: a homogeneous transform, row by row, m.
    pub base: [[f64; 4]; 4],
    /// What was left out or may surprise.
    pub notes: Vec<String>,
}

impl Imported {
    /// The values as a file for `--values`: `{"m1": 2.5, …}`.
    pub fn values_json(&self) -> String {
        let lines: Vec<String> =
            self.values.iter().map(|(p, value)| format!("  \"{p}\": {value:?}")).collect();
        format!("{{\n{}\n}}\n", lines.join(",\n"))
    }
}

/// Why there is no arm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImportError {
    /// The text is no URDF.
    Unreadable(String),
    /// A robot description, but not of a serial arm: every reason that was found.
    Refused(Vec<String>),
}

impl ImportError {
    /// A refusal whose reasons name the file.
    pub(crate) fn refused(file: &str, reasons: Vec<String>) -> ImportError {
        ImportError::Refused(reasons.into_iter().map(|reason| format!("{file}: {reason}")).collect())
    }
}

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ImportError::Unreadable(reason) => f.write_str(reason),
            ImportError::Refused(reasons) => f.write_str(&reasons.join("\n")),
        }
    }
}

impl std::error::Error for ImportError {}

/// The serial arm of a URDF; `file` names the text in errors.
///
/// # Errors
/// What is wrong, or why this is no arm, with the names of links and joints.
pub fn urdf(text: &str, file: &str, options: &Options) -> Result<Imported, ImportError> {
    read_as("a URDF", urdf::read, &Source::of_text(text, file), options)
}

/// The serial arm of a MuJoCo model (MJCF); `file` names the text in errors.
///
/// An armature becomes a rotor with the gear ratio of the joint's actuator, or 100 where the file has none.
/// MuJoCo leaves out that a rotor turns with the link that carries it: k·Im, a hundredth of the armature
/// then.
///
/// # Errors
/// As [`urdf`]. Models that include other files are read by [`source`].
pub fn mjcf(text: &str, file: &str, options: &Options) -> Result<Imported, ImportError> {
    read_as("a MuJoCo model", mjcf::read, &Source::of_text(text, file), options)
}

/// The serial arm of a URDF or of a MuJoCo model, whichever the text is.
///
/// # Errors
/// As [`urdf`].
pub fn any(text: &str, file: &str, options: &Options) -> Result<Imported, ImportError> {
    source(&Source::of_text(text, file), options)
}

/// The serial arm of a URDF or of a MuJoCo model from the disk.
///
/// # Errors
/// As [`urdf`].
pub fn source(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    if source.is_mjcf() {
        read_as("a MuJoCo model", mjcf::read, source, options)
    } else {
        read_as("a URDF", urdf::read, source, options)
    }
}

fn read_as(
    what: &str,
    read: fn(&str) -> Result<urdf::Robot, String>,
    source: &Source,
    options: &Options,
) -> Result<Imported, ImportError> {
    let robot = read(&source.text).map_err(|e| unreadable(what, &source.file, &source.placed(&e)))?;
    imported(robot, source, options)
}

fn unreadable(what: &str, file: &str, reasons: &str) -> ImportError {
    let lines: Vec<String> =
        reasons.lines().map(|line| format!("{file}: cannot be read as {what}: {line}")).collect();
    ImportError::Unreadable(lines.join("\n"))
}

fn imported(robot: urdf::Robot, source: &Source, options: &Options) -> Result<Imported, ImportError> {
    let file = source.file.as_str();
    let placed = |said: Vec<String>| said.iter().map(|line| source.placed(line)).collect();
    let refused = |reasons| ImportError::refused(file, placed(reasons));
    let mut chain = chain::chain(&robot, options).map_err(refused)?;
    if !options.exact {
        chain = meant(&robot, chain, options).map_err(refused)?;
    }
    if options.exact {
        let snapped = rounding::snapped(&robot, &chain.read, options.angle_tolerance);
        let said = snapped.into_iter().map(|joint| {
            format!("within {:e} rad: {joint} (--angle-tolerance 0 keeps it)", options.angle_tolerance)
        });
        chain.notes.extend(said);
    }
    chain.notes = placed(chain.notes);
    chain.notes.splice(0..0, source.outside().iter().cloned());
    chain.notes.extend(text::unseen_names(&chain));
    chain.notes.iter_mut().for_each(|note| *note = text::plain(note));
    let frames = frames::place(&chain, options).map_err(|reason| refused(vec![reason]))?;
    let text = text::arm_file(&chain, &frames, file, options);
    let arm = Arm::parse(&text, file)
        .map_err(|e| refused(e.0.into_iter().map(|d| format!("as an arm file: {}", d.message)).collect()))?;
    let base = frames.base.rows();
    let heavy = chain.joints.iter().any(|joint| !joint.masses.is_empty());
    let values = if heavy { text::values(&chain, &frames, &arm) } else { Vec::new() };
    Ok(Imported { arm, text, values, base, notes: chain.notes })
}

/// The chain with rounded numbers taken for what they were rounded from, which its notes say.
fn meant(robot: &urdf::Robot, written: chain::Chain, options: &Options) -> Result<chain::Chain, Vec<String>> {
    let (nearest, moved) = rounding::nearest(robot, &written.read);
    let mut chain = chain::chain(&nearest, options)?;
    if !moved.is_empty() {
        let change = Change::between(&written, &chain);
        chain.notes.extend(moved.into_iter().map(|joint| format!("taken as meant: {joint}")));
        chain.notes.push(format!(
            "these numbers are rounded; taken as meant they {} over the joints' ranges (--exact keeps every \
            digit)",
            in_words(&change)
        ));
    }
    Ok(chain)
}

/// What changes, and by how much at most.
fn in_words(change: &Change) -> String {
    let Change { distance, turn, inertia, torque, acceleration } = *change;
    let all = [
        (1e3 * distance, "move the tip by at most", "mm"),
        (1e3 * turn, "turn it by at most", "mrad"),
        (torque, "change the torque that holds the arm still by at most", "N·m"),
        (acceleration, "change how the arm falls from rest by at most", "rad/s² (m/s²)"),
        (100.0 * inertia, "change M by at most", "% of √(M_ii M_jj)"),
    ];
    let changed = all.into_iter().filter(|(size, ..)| *size > 0.0);
    let words: Vec<String> =
        changed.map(|(size, what, unit)| format!("{what} {} {unit}", short(size))).collect();
    if words.is_empty() {
        "change nothing that torques or the tip show".to_string()
    } else {
        words.join(", ")
    }
}

/// A size to three digits.
fn short(x: f64) -> String {
    if x >= 0.01 { format!("{x:.3}") } else { format!("{x:.2e}") }
}
