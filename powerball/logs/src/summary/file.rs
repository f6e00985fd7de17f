//! Summaries on disk: one line of JSON that describes the summary, then the packed factors.
//!
//! The module also packs factors into bits.

use super::{Columns, Identity, NODES, OCTAVES, Octaves, Powers, RFactor, Steepness, Summary, fnv};
use serde::{Deserialize, Serialize};

/// First word of every summary.
const FORMAT: &str = "powerball summary";
/// Raised whenever a reader of the version before would misread.
const VERSION: u32 = 6;

/// No arm has more joints.
const MOST_JOINTS: usize = 64;

/// Why a summary is of no use here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SummaryError {
    /// The file is not a summary, or it is damaged: the reason.
    #[error("{0}")]
    Unreadable(String),
    /// The summary does not belong to this arm or these options: the difference.
    #[error("{0}")]
    Differs(String),
}

/// The first line.
#[derive(Serialize, Deserialize)]
struct Head {
    format: String,
    version: u32,
    arm: String,
    /// Hexadecimal.
    arm_hash: String,
    /// Gravity in the base frame, m/s²: the mounting of the base.
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
    /// By joint: the reason why a log has no information about it.
    #[serde(rename = "silent")]
    inactive: Vec<Option<String>>,
    /// By joint and octave.
    rows: Vec<Vec<u64>>,
    spectrum: Vec<Powers>,
    /// Bytes that follow.
    bytes: usize,
    /// Checksum of these bytes.
    checksum: String,
}

impl Identity {
    /// Whether two are of the same thing, and what differs.
    pub fn same_as(&self, other: &Identity) -> Result<(), SummaryError> {
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
        let numbers = write(&self.joints);
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

    /// Reads a summary from the beginning of `bytes`; also returns the bytes after it.
    ///
    /// # Errors
    /// [`SummaryError::Unreadable`] if they are not a summary, of another version, or damaged.
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
        let hash = u64::from_str_radix(&head.arm_hash, 16)
            .map_err(|_| unreadable("its arm_hash is not a number"))?;
        let width = Columns { inertial: head.parameters.len() }.width();
        let joints = head.steepness.len();
        let (numbers, after) = numbers.split_at(head.bytes.min(numbers.len()));
        // Zeros take little space in the file: a file that claims billions of rows is damaged.
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
        let joints = read(width, &head.rows, numbers)
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
        let joint_bands = vec![identity.cutoff; joints.len()];
        Ok((Summary { identity, logs, samples, inactive, joints, joint_bands, spectrum }, after))
    }
}

// Factors as bits. A log's factors are rounded to multiples of a step of each column ([`Octaves::round`]), so
// they are whole numbers of few digits; factors of logs that were joined are doubles. Both come back to the
// bit.
//
// By joint: the step of each column, as its power of two in 16 bits; then by octave and row of the factor the
// bits that each of its numbers takes, in 7 bits, and the numbers of all columns that are not zero
// throughout: in two's complement, or as doubles where they take 64.

/// Digits that a whole number may have, with its sign; others are doubles.
const MOST: u32 = 52;
/// Bits of a double, and of what says how many there are.
const DOUBLE: u32 = 64;
const HEADER: u32 = 7;
/// Marks a column that is zero, in place of a step.
const NOTHING: i16 = i16::MIN;

/// The bytes of the factors of some joints.
pub(super) fn write(joints: &[Octaves]) -> Vec<u8> {
    let mut bits = Writer::default();
    for octaves in joints {
        let steps: Vec<i16> = (0..octaves.levels()[0].width()).map(|k| step(octaves, k)).collect();
        steps.iter().for_each(|step| bits.push(u64::from(step.cast_unsigned()), 16));
        for level in octaves.levels() {
            for row in 0..level.width() {
                let used = (row..level.width()).filter(|k| steps[*k] != NOTHING);
                let numbers: Vec<(f64, i16)> = used.map(|k| (level.column(k)[row], steps[k])).collect();
                let whole: Option<Vec<i64>> = numbers.iter().map(|(x, step)| whole(*x, *step)).collect();
                match whole {
                    Some(whole) => {
                        let width = whole.iter().map(|x| digits(*x)).max().unwrap_or(0);
                        bits.push(width.into(), HEADER);
                        whole.iter().for_each(|x| bits.push(x.cast_unsigned(), width));
                    }
                    None => {
                        bits.push(DOUBLE.into(), HEADER);
                        numbers.iter().for_each(|(x, _)| bits.push(x.to_bits(), DOUBLE));
                    }
                }
            }
        }
    }
    bits.bytes
}

/// The factors again, of `width` columns, by joint and octave of these numbers of rows; `None` where the
/// bytes are others'.
pub(super) fn read(width: usize, rows: &[Vec<u64>], bytes: &[u8]) -> Option<Vec<Octaves>> {
    let mut bits = Reader { bytes, at: 0 };
    // This many joints would take more bits than there are.
    if rows.len().checked_mul(OCTAVES * width * HEADER as usize)? > 8 * bytes.len() {
        return None;
    }
    let mut joints = Vec::with_capacity(rows.len());
    for rows in rows {
        let steps: Vec<i16> =
            (0..width).map(|_| Some((bits.take(16)? as u16).cast_signed())).collect::<Option<_>>()?;
        let mut levels = Vec::with_capacity(rows.len());
        for rows in rows {
            let mut numbers = Vec::with_capacity(RFactor::packed_len(width));
            for row in 0..width {
                let each = u32::try_from(bits.take(HEADER)?).ok()?;
                for step in &steps[row..] {
                    let number = match each {
                        _ if *step == NOTHING => 0.0,
                        DOUBLE => f64::from_bits(bits.take(DOUBLE)?),
                        0..=MOST => signed(bits.take(each)?, each) as f64 * power(*step),
                        _ => return None,
                    };
                    numbers.push(number);
                }
            }
            levels.push(RFactor::from_packed(width, &numbers, *rows)?);
        }
        joints.push(Octaves::from_levels(levels)?);
    }
    // What is left fills a byte.
    (bytes.len() == bits.at.div_ceil(8)).then_some(joints)
}

/// The largest power of two of which all numbers of a column are multiples.
fn step(octaves: &Octaves, column: usize) -> i16 {
    let numbers = octaves.levels().iter().flat_map(|level| level.column(column));
    let steps = numbers.filter(|x| **x != 0.0).map(|x| {
        let (exponent, fraction) = (x.to_bits() >> 52 & 0x7ff, x.to_bits() & ((1 << 52) - 1));
        // Below the smallest normal number there is no leading one.
        let places = if exponent == 0 { fraction } else { fraction | 1 << 52 };
        places.trailing_zeros() as i16 + exponent.max(1) as i16 - 1075
    });
    steps.min().unwrap_or(NOTHING)
}

fn power(step: i16) -> f64 {
    2f64.powi(step.into())
}

/// A number as a multiple of a step; `None` where it takes too many digits, or is one that only a double can
/// be.
fn whole(x: f64, step: i16) -> Option<i64> {
    let multiple = x / power(step);
    let short = multiple.abs() < (1i64 << (MOST - 1)) as f64 && multiple * power(step) == x;
    (short && !(x == 0.0 && x.is_sign_negative())).then_some(multiple as i64)
}

/// Bits of a number in two's complement, 0 for 0.
fn digits(x: i64) -> u32 {
    if x == 0 { 0 } else { 65 - if x < 0 { !x } else { x }.leading_zeros() }
}

fn signed(bits: u64, width: u32) -> i64 {
    if width == 0 { 0 } else { (bits << (64 - width)).cast_signed() >> (64 - width) }
}

#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
    /// Bits of the last byte that are used; 0 where it is full.
    used: u32,
}

impl Writer {
    /// The lowest `count` bits, the lowest first.
    fn push(&mut self, mut bits: u64, mut count: u32) {
        while count > 0 {
            if self.used == 0 {
                self.bytes.push(0);
            }
            let room = (8 - self.used).min(count);
            let part = (bits & ((1 << room) - 1)) as u8;
            if let Some(last) = self.bytes.last_mut() {
                *last |= part << self.used;
            }
            (bits, count, self.used) = (bits >> room, count - room, (self.used + room) % 8);
        }
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    /// In bits.
    at: usize,
}

impl Reader<'_> {
    fn take(&mut self, count: u32) -> Option<u64> {
        let (mut bits, mut have) = (0, 0);
        while have < count {
            let used = (self.at % 8) as u32;
            let room = (8 - used).min(count - have);
            let part = u64::from(self.bytes.get(self.at / 8)? >> used) & ((1 << room) - 1);
            bits |= part << have;
            (have, self.at) = (have + room, self.at + room as usize);
        }
        Some(bits)
    }
}

#[cfg(test)]
mod packed_tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    /// Factors of random rows, the second column zero throughout.
    fn factors(seed: u64) -> Octaves {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw =
            |scale: f64| (0..90).map(|_| scale * rng.random_range(-1.0..1.0)).collect::<Vec<f64>>();
        let columns = [draw(1e3), vec![0.0; 90], draw(1e-5), draw(1.0)];
        let mut octaves = Octaves::new(4);
        octaves.push(&columns.each_ref().map(Vec::as_slice));
        octaves
    }

    fn rows(joints: &[Octaves]) -> Vec<Vec<u64>> {
        joints.iter().map(|j| j.levels().iter().map(RFactor::rows).collect()).collect()
    }

    #[test]
    fn factors_come_back_to_the_bit() {
        let exact = factors(1);
        let mut rounded = factors(2);
        rounded.round();
        let strange = {
            let numbers =
                [1.5, f64::MIN_POSITIVE / 8.0, 1e300, -0.0, f64::NAN, -1.0, 3.0, f64::INFINITY, 2.0, 1.0];
            let level = RFactor::from_packed(4, &numbers, 4).unwrap();
            Octaves::from_levels(vec![level; OCTAVES]).unwrap()
        };
        let joints = [exact, rounded, Octaves::new(4), strange];
        let bytes = write(&joints);
        let read = read(4, &rows(&joints), &bytes).unwrap();
        for (a, b) in joints.iter().zip(&read) {
            for (a, b) in a.levels().iter().zip(b.levels()) {
                let bits = |f: &RFactor| f.packed().into_iter().map(f64::to_bits).collect::<Vec<_>>();
                assert_eq!((bits(a), a.rows()), (bits(b), b.rows()));
            }
        }
    }

    #[test]
    fn what_is_rounded_takes_half_the_room() {
        let exact = factors(3);
        let mut rounded = exact.clone();
        rounded.round();
        let (a, b) = (write(std::slice::from_ref(&exact)).len(), write(std::slice::from_ref(&rounded)).len());
        assert!(3 * b < 2 * a, "{a} {b}");
        // Rounded once more it is the same, and nothing moved by more than the step.
        let mut again = rounded.clone();
        again.round();
        assert_eq!(again, rounded);
        for (level, other) in exact.levels().iter().zip(rounded.levels()) {
            for k in 0..4 {
                let length = exact.total().column(k).iter().map(|x| x * x).sum::<f64>().sqrt();
                for (x, y) in level.column(k).iter().zip(other.column(k)) {
                    assert!((x - y).abs() <= length * 2f64.powi(-28), "{k}: {x} {y}");
                }
            }
        }
    }

    #[test]
    fn other_bytes_are_refused() {
        let joints = [factors(4)];
        let (bytes, rows) = (write(&joints), rows(&joints));
        assert!(read(4, &rows, &bytes[..bytes.len() - 1]).is_none());
        assert!(read(4, &rows, &[bytes.as_slice(), &[0]].concat()).is_none());
        assert!(read(5, &rows, &bytes).is_none());
        assert!(read(4, &vec![rows[0].clone(); 1 << 20], &bytes).is_none());
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..200 {
            let noise: Vec<u8> = (0..bytes.len()).map(|_| rng.random()).collect();
            // Whatever comes of it, it comes to an end.
            let _ = read(4, &rows, &noise);
        }
    }
}
