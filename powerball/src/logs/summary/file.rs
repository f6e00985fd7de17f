//! Summaries on disk: one line of JSON that says what it is, then the factors, packed.

use super::{Columns, Identity, NODES, OCTAVES, Powers, RFactor, Steepness, Summary, fnv, packed};
use serde::{Deserialize, Serialize};
use std::fmt;

/// First word of every summary.
const FORMAT: &str = "powerball summary";
/// Raised whenever a reader of the version before would misread.
const VERSION: u32 = 6;

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
    #[serde(rename = "silent")]
    inactive: Vec<Option<String>>,
    /// By joint and octave.
    rows: Vec<Vec<u64>>,
    spectrum: Vec<Powers>,
    /// Bytes that follow.
    bytes: usize,
    /// Of them.
    checksum: String,
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
        let numbers = packed::write(&self.joints);
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
            inactive: self.inactive.clone(),
            rows: self.joints.iter().map(|j| j.levels().iter().map(RFactor::rows).collect()).collect(),
            spectrum: self.spectrum.clone(),
            bytes: numbers.len(),
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
        let joints = head.steepness.len();
        let (numbers, after) = numbers.split_at(head.bytes.min(numbers.len()));
        // Zeros take little room in the file: what says that there are billions is damaged.
        let shaped = head.nodes == NODES
            && joints <= MOST_JOINTS
            && head.parameters.len() <= 16 * MOST_JOINTS
            && head.octaves == OCTAVES
            && head.rows.len() == joints
            && head.inactive.len() == joints
            && head.spectrum.len() == joints
            && head.rows.iter().all(|r| r.len() == OCTAVES)
            && numbers.len() == head.bytes;
        if !shaped || format!("{:016x}", fnv(numbers)) != head.checksum {
            return Err(unreadable("it is torn or damaged: summarize the log anew"));
        }
        let joints = packed::read(width, &head.rows, numbers)
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
        let (logs, samples, inactive, spectrum) = (head.logs, head.samples, head.inactive, head.spectrum);
        Ok((Summary { identity, logs, samples, inactive, joints, spectrum }, after))
    }
}
