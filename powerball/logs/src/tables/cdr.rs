//! Messages of ROS as their bytes are: CDR of both versions (ROS 2) and the serialisation of ROS 1.
//!
//! Crates that read CDR know its first version alone, with types that are known when they are compiled
//! (`cdr`, `cdr-encoding`), or build a tree of each message (`re_ros_msg`, which needs a newer Rust than this
//! workspace).

use super::schema::Bits;
use std::borrow::Cow;

/// A number of values or letters beyond this is not a message of joints.
const MOST_OF_A_TYPE: usize = 1 << 28;

/// The bytes of a message, read from the front.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
    /// Numbers stand at multiples of their size up to this: 8 in CDR, 4 in XCDR2, 1 in ROS 1.
    alignment: usize,
    /// Whether messages begin with their size: types of XCDR2 that may grow.
    delimited: bool,
}

impl<'a> Cdr<'a> {
    /// A message of ROS 2: two bytes say how it is encoded, two more are options.
    pub(super) fn ros2(message: &'a [u8]) -> Result<Cdr<'a>, String> {
        let (little, alignment, delimited) = match message.get(..2) {
            Some([0, kind @ (0 | 1)]) => (kind % 2 == 1, 8, false),
            Some([0, kind @ (6 | 7)]) => (kind % 2 == 1, 4, false),
            Some([0, kind @ (8 | 9)]) => (kind % 2 == 1, 4, true),
            Some([0, 2 | 3 | 10 | 11]) => {
                return Err("is a list of parameters (a mutable type), which is not read".into());
            }
            Some(_) => return Err("is no CDR".into()),
            None => return Err("is torn".into()),
        };
        let bytes = message.get(4..).ok_or("is torn")?;
        Ok(Cdr { bytes, at: 0, little, alignment, delimited })
    }

    /// A message of ROS 1.
    pub(super) fn ros1(message: &'a [u8]) -> Cdr<'a> {
        Cdr { bytes: message, at: 0, little: true, alignment: 1, delimited: false }
    }

    fn is_ros1(&self) -> bool {
        self.alignment == 1
    }

    fn slice(&mut self, size: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(size).ok_or("is torn")?;
        let bytes = self.bytes.get(self.at..end).ok_or("is torn")?;
        self.at = end;
        Ok(bytes)
    }

    fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size.min(self.alignment));
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.align(N);
        let mut out = [0; N];
        out.copy_from_slice(self.slice(N)?);
        if !self.little {
            out.reverse();
        }
        Ok(out)
    }

    fn u32(&mut self) -> Result<u32, String> {
        self.take().map(u32::from_le_bytes)
    }

    /// How many values a list has.
    pub(super) fn count(&mut self) -> Result<usize, String> {
        let count = self.u32()? as usize;
        if count > MOST_OF_A_TYPE { Err("is torn".into()) } else { Ok(count) }
    }

    /// A number of `size` bytes.
    pub(super) fn number(&mut self, size: usize, bits: Bits) -> Result<f64, String> {
        self.align(size);
        let mut own = [0; 8];
        own[..size].copy_from_slice(self.slice(size)?);
        if !self.little {
            own[..size].reverse();
        }
        let unsigned = u64::from_le_bytes(own);
        let unused = 64 - 8 * size as u32;
        Ok(match (bits, size) {
            (Bits::Float, 4) => f64::from(f32::from_bits(unsigned as u32)),
            (Bits::Float, _) => f64::from_bits(unsigned),
            (Bits::Signed, _) => (((unsigned << unused) as i64) >> unused) as f64,
            (Bits::Unsigned, _) => unsigned as f64,
        })
    }

    /// Passes over `count` numbers of `size` bytes.
    pub(super) fn skip(&mut self, count: usize, size: usize) -> Result<(), String> {
        if count > 0 {
            self.align(size);
            self.slice(count.saturating_mul(size))?;
        }
        Ok(())
    }

    pub(super) fn string(&mut self) -> Result<Cow<'a, str>, String> {
        let length = self.count()?;
        let bytes = self.slice(length)?;
        // CDR counts a zero at the end.
        Ok(String::from_utf8_lossy(bytes.strip_suffix(b"\0").unwrap_or(bytes)))
    }

    pub(super) fn strings(&mut self) -> Result<Vec<Cow<'a, str>>, String> {
        self.begin_list()?;
        (0..self.count()?).map(|_| self.string()).collect()
    }

    /// A list of what `each` reads.
    pub(super) fn list<T>(
        &mut self,
        mut each: impl FnMut(&mut Self) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        (0..self.count()?).map(|_| each(self)).collect()
    }

    /// Before a list of anything but numbers: XCDR2 says there how many bytes it has.
    pub(super) fn begin_list(&mut self) -> Result<(), String> {
        if self.alignment == 4 { self.u32().map(|_| ()) } else { Ok(()) }
    }

    /// Before a message; where it ends, if that is stated.
    pub(super) fn begin_message(&mut self) -> Result<Option<usize>, String> {
        if !self.delimited {
            return Ok(None);
        }
        let size = self.u32()? as usize;
        Ok(Some(self.at.saturating_add(size)))
    }

    /// After it: what a newer type may have added is passed over.
    pub(super) fn end_message(&mut self, end: Option<usize>) -> Result<(), String> {
        match end {
            Some(end) if end < self.at || end > self.bytes.len() => Err("is torn".into()),
            Some(end) => {
                self.at = end;
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// A message without a field, which ROS 2 gives one.
    pub(super) fn pass_empty(&mut self) -> Result<(), String> {
        if self.is_ros1() { Ok(()) } else { self.skip(1, 1) }
    }

    /// `builtin_interfaces/Time`, or ROS 1's time, s.
    pub(super) fn time(&mut self) -> Result<f64, String> {
        let end = self.begin_message()?;
        let seconds = self.take()?;
        let seconds = match self.is_ros1() {
            true => f64::from(u32::from_le_bytes(seconds)),
            false => f64::from(i32::from_le_bytes(seconds)),
        };
        let time = seconds + 1e-9 * f64::from(self.u32()?);
        self.end_message(end)?;
        Ok(time)
    }

    /// `std_msgs/Header`: its time stamp, s.
    pub(super) fn header(&mut self) -> Result<f64, String> {
        let end = self.begin_message()?;
        if self.is_ros1() {
            self.u32()?;
        }
        let time = self.time()?;
        self.string()?;
        self.end_message(end)?;
        Ok(time)
    }
}

/// A message of ROS 2 while it is written, little end first.
#[cfg(feature = "mcap")]
pub(super) struct CdrWriter(Vec<u8>);

#[cfg(feature = "mcap")]
impl CdrWriter {
    /// Begins with `std_msgs/Header` of a time, s.
    pub(super) fn header(t: f64) -> CdrWriter {
        let mut message = CdrWriter(Vec::new());
        let nanoseconds = (1e9 * t).round() as i64;
        message.put((nanoseconds.div_euclid(1_000_000_000) as i32).to_le_bytes());
        message.put((nanoseconds.rem_euclid(1_000_000_000) as u32).to_le_bytes());
        message.string("");
        message
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        self.0.resize(self.0.len().next_multiple_of(N), 0);
        self.0.extend_from_slice(&bytes);
    }

    fn string(&mut self, value: &str) {
        self.put((value.len() as u32 + 1).to_le_bytes());
        self.0.extend_from_slice(value.as_bytes());
        self.0.push(0);
    }

    pub(super) fn strings(&mut self, values: &[String]) {
        self.put((values.len() as u32).to_le_bytes());
        values.iter().for_each(|value| self.string(value));
    }

    pub(super) fn numbers(&mut self, values: &[f64]) {
        self.put((values.len() as u32).to_le_bytes());
        values.iter().for_each(|value| self.put(value.to_le_bytes()));
    }

    /// The bytes, after the two that say how they are encoded and two of options.
    pub(super) fn done(self) -> Vec<u8> {
        [vec![0, 1, 0, 0], self.0].concat()
    }
}
