//! Export: identified values in a copy of the robot description that the arm was imported from, or in a new
//! one that has only the arm's bodies and joints.

mod body;
mod dcmotor;
mod edit;
mod known;
mod mjcf;
mod sdf;
mod servo;
mod share;
mod term;
mod tree;
mod urdf;
mod usd;

pub use known::{Friction, Known};
pub use mjcf::mjcf;
pub use sdf::sdf;
pub use servo::Servo;
pub use term::{Law, Term};
pub use urdf::{Exported, urdf};
pub use usd::usd;

use crate::Arm;
use crate::import::{ImportError, Options, Source};

/// A URDF or a MuJoCo model from the disk with what is known of the arm in it, whichever it is.
///
/// # Errors
/// Those of [`urdf()`] and [`mjcf()`], with the files and lines of what the model includes.
pub fn source(source: &Source, arm: &Arm, known: &Known, options: &Options) -> Result<Exported, ImportError> {
    let write = if source.is_mjcf() { mjcf } else { urdf };
    let exported = write(&source.text, &source.file, arm, known, options);
    let mut exported = exported.map_err(|e| match e {
        ImportError::Unreadable(reason) => ImportError::Unreadable(source.placed(&reason)),
        ImportError::Refused(reasons) => {
            ImportError::Refused(reasons.iter().map(|reason| source.placed(reason)).collect())
        }
    })?;
    if !source.included().is_empty() {
        let files = source.included().join(", ");
        exported.notes.push(format!("the new file holds {files}, which the model includes"));
    }
    Ok(exported)
}
