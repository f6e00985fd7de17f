//! Arms from other descriptions: a serial chain of a URDF becomes an arm file with inertial values beside it.
//!
//! 1. `chain`: from the tree of links to one chain: fixed joints merged, everything at q = 0 in the root
//!    link's frame.
//! 2. `frames`: Denavit–Hartenberg frames on the joint axes, by their common normals.
//! 3. `text`: the arm file, with the bodies' inertia moved into the new frames.
//!
//! Joint positions keep their meaning: q of the arm file is the URDF's q, for position limits too.

mod chain;
mod frames;
mod pose;
mod text;

use crate::arm::{Arm, Convention, Parameter};
use std::fmt;

/// How to read a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The link that ends the chain; may be left out where the URDF is one chain already.
    pub tip: Option<String>,
    /// The convention of the arm file.
    pub convention: Convention,
    /// Angles this close to a multiple of pi/12 are taken for it, rad.
    pub angle_tolerance: f64,
}

impl Default for Options {
    /// The whole chain, modified convention, 1e-9 rad.
    fn default() -> Self {
        Options { tip: None, convention: Convention::Modified, angle_tolerance: 1e-9 }
    }
}

/// An arm that was imported.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The arm, as reading [`Imported::text`] gives it.
    pub arm: Arm,
    /// The arm file.
    pub text: String,
    /// The values of all parameters that the arm keeps, in order, SI units.
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
    /// It is one, but not of a serial arm: every reason that was found.
    Refused(Vec<String>),
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
    let refused = |reasons: Vec<String>| {
        ImportError::Refused(reasons.into_iter().map(|reason| format!("{file}: {reason}")).collect())
    };
    let robot = read(text).map_err(|e| ImportError::Unreadable(format!("{file}: not a URDF: {e}")))?;
    let chain = chain::chain(&robot, options).map_err(refused)?;
    let frames = frames::place(&chain, options).map_err(|reason| refused(vec![reason]))?;
    let text = text::arm_file(&chain, &frames, file, options);
    let arm = Arm::parse(&text, file)
        .map_err(|e| refused(e.0.into_iter().map(|d| format!("as an arm file: {}", d.message)).collect()))?;
    let base = frames.base.rows();
    Ok(Imported { arm, text, values: text::values(&chain, &frames), base, notes: chain.notes })
}

/// A larger file is no robot.
const LARGEST_FILE: usize = 64 << 20;
/// A deeper document is no URDF, and XML readers follow nesting by recursion.
const DEEPEST: usize = 100;

fn read(text: &str) -> Result<urdf_rs::Robot, String> {
    if text.len() > LARGEST_FILE {
        return Err("larger than 64 MiB".to_string());
    }
    let mut depth = 0usize;
    for piece in text.split('<').skip(1) {
        let tag = piece.split('>').next().unwrap_or("");
        match tag.as_bytes().first() {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'?' | b'!') => {}
            _ if tag.ends_with('/') => {}
            _ => depth += 1,
        }
        if depth > DEEPEST {
            return Err(format!("elements are nested more than {DEEPEST} deep"));
        }
    }
    urdf_rs::read_from_string(text).map_err(|e| e.to_string())
}
