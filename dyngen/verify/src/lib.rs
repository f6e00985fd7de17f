//! What is printed in a generated file against the Lagrangian: the text is read back, evaluated modulo a
//! prime at random points, and compared.
//!
//! Nothing here is the generator's: the Lagrangian, the sines of its angles and the readers of four languages
//! are this crate's own. What one must trust is in `docs/dyngen.md`.

mod angles;
mod check;
mod dual;
mod friction;
mod functions;
mod lagrangian;
mod language;
mod linkage;
mod matrix;
mod point;
mod read;
mod sums;
#[doc(hidden)]
pub mod text;

pub use check::{Error, Verifier};

use dyngen_arm::Function;
use language::Routines;
use std::collections::BTreeMap;
use std::fmt;

/// For an angle, from 0, the line, and coordinates with their signs.
type Angles = BTreeMap<usize, (usize, Vec<(usize, i64)>)>;

/// What is in a file.
#[derive(Debug, Default)]
struct Source {
    routines: Routines,
    /// Lines and entries.
    constants: BTreeMap<String, (usize, Vec<String>)>,
    /// Modules of frames, with their lines.
    modules: Vec<(String, usize)>,
    /// What comments say of angles that are sums of coordinates.
    angles: Angles,
    /// Terms of friction, as comments list them.
    terms: Vec<String>,
    not_checked: Vec<String>,
    /// Kernels and entry points: each calls a function for many states, and does nothing else.
    kernels: Vec<String>,
    /// Literals of many digits that the head does not explain, with their lines.
    unexplained: Vec<(usize, String)>,
}

/// What a function whose name in C stands behind the arm's is called in the language; `frames` are those of
/// the arm.
fn routine(name: &str, frames: &[String]) -> Option<String> {
    let is_known = |name: &str| Function::parse(name.strip_suffix("_with").unwrap_or(name)).is_some();
    match name {
        "trig_of" => return Some("Trig::new".to_string()),
        name if ["prepare", "friction_columns", "friction"].contains(&name) || is_known(name) => {
            return Some(name.to_string());
        }
        _ => {}
    }
    let inside = |frame: &String| {
        let rest = name.strip_prefix(frame.as_str())?.strip_prefix('_')?;
        is_known(rest).then(|| format!("{frame}::{rest}"))
    };
    frames.iter().find_map(inside)
}

/// What the constant with a function's structure is called among a file's constants.
fn structure_of(function: &str) -> String {
    format!("{function} structure")
}

/// Whether a constant of a file is a function's structure.
fn is_structure(name: &str) -> bool {
    name.ends_with(" structure")
}

/// What cannot be read, or is no generated file of the arm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unreadable {
    /// From 1.
    pub line: usize,
    /// What is wrong there.
    pub message: String,
}

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.line, self.message)
    }
}

impl std::error::Error for Unreadable {}

type Checked<T> = Result<T, Unreadable>;

fn wrong<T>(line: usize, message: &str) -> Checked<T> {
    Err(Unreadable { line, message: message.to_string() })
}

/// What was found in a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Proven functions, in the order of the file's table.
    pub proven: Vec<String>,
    /// Items that were not looked into.
    pub not_checked: Vec<String>,
    /// The first difference; all is proven that can be where there is none.
    pub difference: Option<Difference>,
}

/// Where a file differs from the Lagrangian.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The function or constant.
    pub function: String,
    /// Row and column of its result, from 0; none where it has no value, or another shape.
    pub entry: Option<(usize, usize)>,
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong.
    pub message: String,
}
