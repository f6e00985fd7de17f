//! Counts of a joint's position, from the TOML and from the scales in the drive's file.
//!
//! CiA 402-2 (IEC 61800-7-201): position = internal position · feed constant / (encoder resolution · gear
//! ratio). A turn of the shaft is resolution · gear ratio internal increments, and so feed constant counts. A
//! drive without a feed constant counts the increments themselves.

use super::{Dcf, ImportError, JointTable};
use crate::canopen::Object;

/// Encoder increments / motor revolutions.
const RESOLUTION: u16 = 0x608F;
/// Motor revolutions / shaft revolutions.
const GEAR_RATIO: u16 = 0x6091;
/// Feed, in counts / shaft revolutions.
const FEED: u16 = 0x6092;

/// Fewer counts in a turn than degrees are not a scale of a joint: drives have 1 / 1 if it was never set.
const FEWEST: f64 = 360.0;
/// The TOML's value may be rounded by this share of it.
const ROUNDING: f64 = 1e-4;

/// Counts in a turn of the shaft, and which objects say so.
struct Turn {
    counts: f64,
    source: String,
}

/// A quotient of two parts of an object; a missing second part counts as 1.
fn quotient(drive: &Dcf, index: u16, node: u8) -> Option<Turn> {
    let value = |sub| drive.value(Object::new(index, sub), node);
    let (above, below) = (value(1)?, value(2).unwrap_or(1));
    let source = format!("0x{index:04X} = {above} / {below}");
    (above > 0 && below > 0).then(|| Turn { counts: above as f64 / below as f64, source })
}

/// Counts of a turn from the drive's file.
fn turn(drive: &Dcf, node: u8) -> Option<Turn> {
    if let Some(feed) = quotient(drive, FEED, node) {
        return Some(feed);
    }
    let resolution = quotient(drive, RESOLUTION, node)?;
    Some(match quotient(drive, GEAR_RATIO, node) {
        Some(gear) => Turn {
            counts: resolution.counts * gear.counts,
            source: format!("{} and {}", resolution.source, gear.source),
        },
        None => Turn { source: format!("{} without a gear 0x6091", resolution.source), ..resolution },
    })
}

/// Counts in a degree of a joint, and notes about them.
///
/// # Errors
/// If neither file gives a scale, or it cannot be that of a joint.
pub(super) fn counts_per_degree(
    drive: &Dcf,
    joint: &JointTable,
) -> Result<(f64, Option<String>), ImportError> {
    let node = joint.node;
    match (joint.counts_per_degree, turn(drive, node)) {
        (Some(given), _) if !(given.is_finite() && given != 0.0) => {
            Err(ImportError::Toml(format!("node {node}: counts_per_degree = {given} is not a scale")))
        }
        (Some(given), Some(turn)) if (given.abs() * 360.0 - turn.counts).abs() > ROUNDING * turn.counts => {
            let note = format!(
                "counts_per_degree = {given} is {} counts a turn, the drive's file says {} ({}): the value \
                    of the TOML is used",
                given.abs() * 360.0,
                turn.counts,
                turn.source
            );
            Ok((given, Some(note)))
        }
        (Some(given), _) => Ok((given, None)),
        (None, Some(turn)) if turn.counts >= FEWEST => {
            let degree = turn.counts / 360.0;
            let note = format!(
                "counts_per_degree is not in the TOML; {} counts a turn are taken from the drive's file, \
                    {}. Give counts_per_degree in [[joint]] if there is a gear that the drive does not \
                    know, or if the drive counts in the opposite direction",
                turn.counts, turn.source
            );
            Ok((degree, Some(note)))
        }
        (None, Some(turn)) => Err(ImportError::Mismatch(format!(
            "node {node}: {} counts a turn ({}) are not a valid scale of a joint; give counts_per_degree in \
                [[joint]]",
            turn.counts, turn.source
        ))),
        (None, None) => Err(ImportError::Toml(format!(
            "node {node}: counts_per_degree is missing in [[joint]], and the drive's file has no values of \
             0x608F, 0x6091 or 0x6092 to take it from"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINT: &str = "node = 3\nposition = [-1.0, 1.0]\nvelocity = 1.0\nacceleration = 1.0\n\
        rated_torque = 1.0\ncurrent = 1.0\n";

    fn scaled(objects: &[(&str, &str)], given: &str) -> Result<(f64, Option<String>), ImportError> {
        let section = |(name, value): &(&str, &str)| format!("[{name}]\nDataType=7\nDefaultValue={value}\n");
        let dcf: String = objects.iter().map(section).collect();
        let joint = toml::from_str(&format!("{JOINT}{given}")).unwrap();
        counts_per_degree(&Dcf::parse(dcf.as_bytes()).unwrap(), &joint)
    }

    /// Turns worked out by hand from the standard's formula.
    #[test]
    fn the_scale_is_that_of_the_drives_objects() {
        let encoder = [("608Fsub1", "2000"), ("608Fsub2", "1")];
        let geared = [encoder[0], encoder[1], ("6091sub1", "0x64"), ("6091sub2", "2")];
        let fed = [geared[0], geared[1], geared[2], geared[3], ("6092sub1", "360000")];
        for (objects, turn) in [(&encoder[..], 2000.0), (&geared, 100_000.0), (&fed, 360_000.0)] {
            let (counts, note) = scaled(objects, "").unwrap();
            assert_eq!(counts * 360.0, turn);
            assert!(note.unwrap().contains(&format!("{turn} counts a turn")), "{objects:?}");
            // An equal given value is not reported, with either sign; another one is reported, and counts.
            assert_eq!(scaled(objects, &format!("counts_per_degree = {}", -turn / 360.0)).unwrap().1, None);
            let (counts, note) = scaled(objects, "counts_per_degree = 1234.0").unwrap();
            assert!(counts == 1234.0 && note.unwrap().contains(&format!("says {turn}")), "{objects:?}");
        }
    }

    #[test]
    fn without_a_scale_there_is_no_profile() {
        assert_eq!(scaled(&[], "counts_per_degree = -1000.0").unwrap(), (-1000.0, None));
        let unset = [("608Fsub1", "1"), ("608Fsub2", "1")];
        for (objects, given) in [(&[][..], ""), (&unset, ""), (&[], "counts_per_degree = 0.0")] {
            let refused = scaled(objects, given).unwrap_err().to_string();
            assert!(refused.contains("node 3") && refused.contains("counts_per_degree"), "{refused}");
        }
        assert!(scaled(&[("608Fsub1", "0")], "").unwrap_err().to_string().contains("0x608F"));
    }
}
