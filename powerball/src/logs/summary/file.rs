//! Summaries on disk: one line of JSON that says what it is, then the factors as little-endian doubles, where zeros that
//! follow each other are one zero and their count: a short log fills a part of its factors.

use super::{Columns, Identity, NODES, OCTAVES, Octaves, Powers, RFactor, Steepness, Summary, fnv};
use serde::{Deserialize, Serialize};
use std::fmt;

/// First word of every summary.
const FORMAT: &str = "powerball summary";
/// Raised whenever a reader of the version before would misread.
const VERSION: u32 = 5;

/// No arm has more joints.
const MOST_JOINTS: usize = 64;

/// Why a summary is of no use here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SummaryError {
    /// It is no summary, or a damaged one: why.
    Unreadable(String),
    /// It is of something else: what differs.
    Differs(String),
}

impl fmt::Display for SummaryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SummaryError::Unreadable(why) | SummaryError::Differs(why) => write!(f, "{why}"),
        }
    }
}

impl std::error::Error for SummaryError {}

/// The first line.
#[derive(Serialize, Deserialize)]
struct Head {
    format: String,
    version: u32,
    arm: String,
    /// Hexadecimal.
    arm_hash: String,
    /// In the base frame, m/s²: how the base was mounted.
    gravity: [f64; 3],
    set: String,
    parameters: Vec<String>,
    /// Hz.
    band: f64,
    /// Hz.
    smoothing: f64,
    /// By joint, s/rad: the range over which the saturating columns interpolate.
    steepness: Vec<[f64; 2]>,
    nodes: usize,
    octaves: usize,
    /// Name and seconds.
    logs: Vec<(String, f64)>,
    samples: u64,
    /// By joint: why a log said nothing of it.
    silent: Vec<Option<String>>,
    /// By joint and octave.
    rows: Vec<Vec<u64>>,
    spectrum: Vec<Powers>,
    /// Doubles that follow.
    doubles: usize,
    /// Of them.
    checksum: String,
}

/// Numbers with zeros that follow each other as one zero and their count.
fn squeezed(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut out, mut zeros) = (Vec::new(), 0u32);
    let close = |out: &mut Vec<f64>, zeros: &mut u32| {
        if *zeros > 0 {
            out.extend([0.0, f64::from(std::mem::take(zeros))]);
        }
    };
    for x in numbers {
        if x == 0.0 {
            zeros += 1;
        } else {
            close(&mut out, &mut zeros);
            out.push(x);
        }
    }
    close(&mut out, &mut zeros);
    out
}

/// The numbers again; `None` unless there are `count`.
fn unsqueezed(squeezed: &[f64], count: usize) -> Option<Vec<f64>> {
    let mut out = Vec::with_capacity(count);
    let mut rest = squeezed.iter();
    while let Some(x) = rest.next() {
        let zeros = if *x == 0.0 { *rest.next()? } else { 0.0 };
        if *x != 0.0 {
            out.push(*x);
        } else if zeros >= 1.0 && zeros <= (count - out.len()) as f64 {
            out.resize(out.len() + zeros as usize, 0.0);
        } else {
            return None;
        }
        if out.len() > count {
            return None;
        }
    }
    (out.len() == count).then_some(out)
}

impl Identity {
    /// Whether two are of the same thing, and what differs.
    pub(crate) fn same_as(&self, other: &Identity) -> Result<(), SummaryError> {
        let differs = |what: String| Err(SummaryError::Differs(what));
        if self.arm != other.arm {
            return differs(format!("it is of the arm '{}', not of '{}'", other.arm, self.arm));
        }
        if self.hash == other.hash && self.gravity != other.gravity {
            return differs(format!(
                "its base was mounted otherwise: gravity was {:?} m/s² in its frame, not {:?}",
                other.gravity, self.gravity
            ));
        }
        if self.parameters != other.parameters {
            return differs(format!(
                "its arm '{}' had another parameter set ({} parameters; {} here): summarize the log anew \
                    with this arm file",
                self.arm,
                other.parameters.len(),
                self.parameters.len()
            ));
        }
        if self.hash != other.hash || self.steepness != other.steepness {
            return differs(format!(
                "its arm file said something else of '{}' than this one does (a length, angle, limit, ratio \
                    or torque constant): summarize the log anew with this arm file",
                self.arm
            ));
        }
        for (what, a, b) in
            [("band", self.cutoff, other.cutoff), ("smoothing", self.smoothing, other.smoothing)]
        {
            if a != b {
                return differs(format!("its {what} is {b} Hz, not {a} Hz: summarize the log anew"));
            }
        }
        Ok(())
    }
}

impl Summary {
    /// The bytes of a file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let levels = || self.joints.iter().flat_map(|j| j.levels());
        let numbers: Vec<u8> =
            squeezed(levels().flat_map(|t| t.packed())).into_iter().flat_map(f64::to_le_bytes).collect();
        let id = &self.identity;
        let head = Head {
            format: FORMAT.into(),
            version: VERSION,
            arm: id.arm.clone(),
            arm_hash: format!("{:016x}", id.hash),
            gravity: id.gravity,
            set: "minimal".into(),
            parameters: id.parameters.clone(),
            band: id.cutoff,
            smoothing: id.smoothing,
            steepness: id.steepness.iter().map(|s| s.range().into()).collect(),
            nodes: NODES,
            octaves: OCTAVES,
            logs: self.logs.clone(),
            samples: self.samples,
            silent: self.silent.clone(),
            rows: self.joints.iter().map(|j| j.levels().iter().map(RFactor::rows).collect()).collect(),
            spectrum: self.spectrum.clone(),
            doubles: numbers.len() / 8,
            checksum: format!("{:016x}", fnv(&numbers)),
        };
        // A head of text and finite numbers always is JSON.
        let mut bytes = serde_json::to_vec(&head).unwrap_or_default();
        bytes.push(b'\n');
        bytes.extend(numbers);
        bytes
    }

    /// Whether bytes begin as a summary does.
    #[must_use]
    pub fn is_summary(bytes: &[u8]) -> bool {
        bytes.starts_with(format!("{{\"format\":\"{FORMAT}\"").as_bytes())
    }

    /// From bytes that begin with a summary's; also those after it.
    ///
    /// # Errors
    /// [`SummaryError::Unreadable`] where they are no summary, of another version, or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Summary, &[u8]), SummaryError> {
        let unreadable = |why: &str| SummaryError::Unreadable(why.to_string());
        if !Summary::is_summary(bytes) {
            return Err(unreadable("is no summary that `powerball summarize` wrote"));
        }
        let line =
            bytes.iter().position(|b| *b == b'\n').ok_or_else(|| unreadable("its first line is torn"))?;
        let (head, numbers) = (&bytes[..line], &bytes[line + 1..]);
        let version: Option<u64> =
            serde_json::from_slice::<serde_json::Value>(head).ok().and_then(|head| head["version"].as_u64());
        if version != Some(u64::from(VERSION)) {
            return Err(unreadable("another version of powerball wrote it: summarize the log anew"));
        }
        let head: Head = serde_json::from_slice(head)
            .map_err(|e| SummaryError::Unreadable(format!("its first line is damaged: {e}")))?;
        let hash =
            u64::from_str_radix(&head.arm_hash, 16).map_err(|_| unreadable("its arm_hash is no number"))?;
        let width = Columns { inertial: head.parameters.len() }.width();
        let each = RFactor::packed_len(width);
        let joints = head.steepness.len();
        let length = head.doubles.saturating_mul(8);
        let after = numbers.get(length..).unwrap_or_default();
        let numbers = &numbers[..length.min(numbers.len())];
        // Zeros take no room in the file: what says that there are billions is damaged.
        let shaped = head.nodes == NODES
            && joints <= MOST_JOINTS
            && head.parameters.len() <= 16 * MOST_JOINTS
            && head.octaves == OCTAVES
            && head.rows.len() == joints
            && head.silent.len() == joints
            && head.spectrum.len() == joints
            && head.rows.iter().all(|r| r.len() == OCTAVES)
            && numbers.len() == length;
        if !shaped || format!("{:016x}", fnv(numbers)) != head.checksum {
            return Err(unreadable("it is torn or damaged: summarize the log anew"));
        }
        let doubles: Vec<f64> =
            numbers.chunks_exact(8).filter_map(|b| Some(f64::from_le_bytes(b.try_into().ok()?))).collect();
        let doubles = unsqueezed(&doubles, each * OCTAVES * joints)
            .ok_or_else(|| unreadable("its factors do not fit its first line"))?;
        let mut parts = doubles.chunks_exact(each.max(1));
        let joints = head
            .rows
            .iter()
            .map(|rows| {
                let levels = rows
                    .iter()
                    .map(|rows| RFactor::from_packed(width, parts.next()?, *rows))
                    .collect::<Option<Vec<_>>>()?;
                Octaves::from_levels(levels)
            })
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| unreadable("its factors do not fit its first line"))?;
        let identity = Identity {
            arm: head.arm,
            hash,
            gravity: head.gravity,
            parameters: head.parameters,
            cutoff: head.band,
            smoothing: head.smoothing,
            steepness: head.steepness.iter().map(|[low, high]| Steepness::between(*low, *high)).collect(),
        };
        let (logs, samples, silent, spectrum) = (head.logs, head.samples, head.silent, head.spectrum);
        Ok((Summary { identity, logs, samples, silent, joints, spectrum }, after))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_counted_and_come_back() {
        for numbers in [vec![], vec![0.0; 7], vec![1.0, 0.0, 0.0, -2.0, 0.0], vec![3.0, 4.0]] {
            let small = squeezed(numbers.iter().copied());
            assert_eq!(unsqueezed(&small, numbers.len()), Some(numbers.clone()), "{small:?}");
            assert_eq!(unsqueezed(&small, numbers.len() + 1), None);
        }
        // Damaged counts are refused, whatever they are.
        for wrong in [f64::NAN, -1.0, 0.0, 1e300, f64::INFINITY] {
            assert_eq!(unsqueezed(&[1.0, 0.0, wrong], 3), None, "{wrong}");
        }
        assert_eq!(unsqueezed(&[1.0, 0.0], 3), None);
    }
}
