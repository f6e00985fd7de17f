//! From a drive's DCF (or EDS) and one TOML of the arm to a Rust file of constant tables, offline.
//!
//! The result is checked: every mapped object is in the dictionary with its size and may be mapped, the
//! bit rate is one that the drive has, and what the driver writes to make the drives watch it exists.
//! `powerball profile` is the command.

mod arm;
mod dcf;
mod scale;
mod write;

pub use arm::{Arm, JointTable, Mapped, ModeTable, VelocityScaleTable, Watch};
pub use dcf::{Access, Dcf, DcfError, Number, Value, Variable};

use crate::canopen::objects::{CONSUMER_HEARTBEAT, PRODUCER_HEARTBEAT, SYNC_COB_ID};
use crate::canopen::pdo::{Entry, Mapping};
use crate::cia402::{objects, schunk};

/// Why a profile cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The DCF.
    #[error("{0}")]
    Dcf(DcfError),
    /// An overlay, counted from 0.
    #[error("{1}")]
    Overlay(usize, DcfError),
    /// An error in the TOML: the message of its parser (with line and column), or a value that is impossible.
    #[error("{0}")]
    Toml(String),
    /// The drive's file lacks this.
    #[error("{0}")]
    Drive(String),
    /// The two files do not fit together.
    #[error("{0}")]
    Mismatch(String),
}

impl From<DcfError> for ImportError {
    fn from(error: DcfError) -> ImportError {
        ImportError::Dcf(error)
    }
}

/// Says something of a file that is not an error.
fn say(note: &str) {
    tracing::warn!(target: "powerball::bus", "{note}");
}

/// Rust source with the constants `DICTIONARY` and `constant` (a `Profile`) for the arm of `toml` with the
/// drives of `dcf` and its `overlays`. `source` is named in the file's head.
///
/// # Errors
/// Where one of the files cannot be read, with the line, or where they contradict each other.
pub fn rust_source(
    dcf: &[u8],
    overlays: &[Vec<u8>],
    toml: &str,
    constant: &str,
    source: &str,
) -> Result<String, ImportError> {
    let mut drive = Dcf::parse(dcf)?;
    for (k, overlay) in overlays.iter().enumerate() {
        let read = Dcf::parse(overlay).and_then(|overlay| drive.overlay(&overlay));
        read.map_err(|error| ImportError::Overlay(k, error))?;
    }
    let arm: Arm = toml::from_str(toml).map_err(|error| ImportError::Toml(error.to_string()))?;
    check(&drive, &arm)?;
    write::source(&drive, &arm, constant, source)
}

fn mismatch<T>(message: String) -> Result<T, ImportError> {
    Err(ImportError::Mismatch(message))
}

/// Whether the drive can do what the arm's file wants of it.
fn check(drive: &Dcf, arm: &Arm) -> Result<(), ImportError> {
    if !drive.offers(arm.bitrate) {
        let rate = arm.bitrate / 1000;
        return mismatch(format!("the DCF does not offer {} bit/s (BaudRate_{rate} is not 1)", arm.bitrate));
    }
    if let Some(other) = drive.bitrate.filter(|rate| *rate != arm.bitrate) {
        return mismatch(format!(
            "bitrate = {}: the DCF configures its drive for {other} bit/s ([DeviceCommissioning])",
            arm.bitrate
        ));
    }
    if arm.rate == 0 || !1_000_000u32.is_multiple_of(arm.rate) {
        return Err(ImportError::Toml(format!("rate = {}: a divisor of 1000000 Hz is expected", arm.rate)));
    }
    let is_schunk = drive.info.get("vendorname").is_some_and(|name| name.to_uppercase().contains("SCHUNK"));
    if is_schunk && arm.watch.sync_timeout_factor.is_none() {
        return mismatch("a drive of SCHUNK needs sync_timeout_factor in [watch]".into());
    }
    let written = [CONSUMER_HEARTBEAT, PRODUCER_HEARTBEAT, SYNC_COB_ID, objects::MODE];
    let of_schunk = arm.watch.sync_timeout_factor.map(|_| schunk::SYNC_TIMEOUT_FACTOR);
    for object in written.into_iter().chain(of_schunk) {
        match drive.variables.get(&object) {
            Some(variable) if matches!(variable.access, Access::ReadWrite | Access::WriteOnly) => {}
            _ => {
                let lacks = format!("no writable {object}, which the driver needs");
                return match object {
                    schunk::SYNC_TIMEOUT_FACTOR => {
                        mismatch(format!("sync_timeout_factor is SCHUNK's, and the DCF has {lacks}"))
                    }
                    _ => Err(ImportError::Drive(lacks)),
                };
            }
        }
    }
    let mut nodes: Vec<u8> = arm.joint.iter().map(|joint| joint.node).chain([arm.master]).collect();
    nodes.sort_unstable();
    if nodes.windows(2).any(|pair| pair[0] == pair[1]) {
        let twice = "two joints, or a joint and the master, have the same node id";
        return Err(ImportError::Toml(twice.into()));
    }
    if nodes.iter().any(|node| !(1..=127).contains(node)) {
        return Err(ImportError::Toml("node ids are 1 … 127".into()));
    }
    Ok(())
}

/// A PDO of the arm's file with the sizes of the drive's.
fn mapping(drive: &Dcf, mapped: &[Mapped], what: &str) -> Result<Mapping, ImportError> {
    let mut entries = Vec::new();
    for item in mapped {
        let bits = match (drive.variables.get(&item.object), item.bits) {
            (Some(variable), _) if !variable.mappable => {
                return mismatch(format!(
                    "{what}: {} cannot be in a PDO (PDOMapping=0 in the DCF)",
                    item.object
                ));
            }
            (Some(variable), stated) => match (variable.bits(), stated) {
                (Some(bits), None) => bits,
                (Some(bits), Some(stated)) if bits == stated => bits,
                (bits, stated) => {
                    return mismatch(format!("{what}: {} has {bits:?} bits, not {stated:?}", item.object));
                }
            },
            (None, Some(bits)) => bits,
            (None, None) => {
                return mismatch(format!(
                    "{what}: the DCF has no {}; give its number of bits, as in \"6071/16\"",
                    item.object
                ));
            }
        };
        entries.push(Entry::new(item.object, bits));
    }
    Mapping::new(&entries).map_err(|error| ImportError::Toml(format!("{what}: {error}")))
}

#[cfg(test)]
mod tests;
