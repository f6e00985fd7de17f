//! Messages of ROS as their bytes are: CDR (ROS 2) and the serialisation of ROS 1.

/// A number of values or letters beyond this is no message of joints.
const MOST_OF_A_TYPE: usize = 1 << 16;

/// The bytes of a message, read from the front.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
    /// Numbers stand at multiples of their size up to this: 8 in CDR, 4 in XCDR2, 1 in ROS 1.
    alignment: usize,
}

impl<'a> Cdr<'a> {
    /// A message of ROS 2: two bytes say how it is encoded, two more are options.
    pub(super) fn ros2(message: &'a [u8]) -> Result<Cdr<'a>, String> {
        let (little, alignment) = match message.get(..2) {
            Some([0, 0]) => (false, 8),
            Some([0, 1]) => (true, 8),
            Some([0, 6]) => (false, 4),
            Some([0, 7]) => (true, 4),
            _ => return Err("is not plain CDR".into()),
        };
        let bytes = message.get(4..).ok_or("is torn")?;
        Ok(Cdr { bytes, at: 0, little, alignment })
    }

    /// A message of ROS 1.
    pub(super) fn ros1(message: &'a [u8]) -> Cdr<'a> {
        Cdr { bytes: message, at: 0, little: true, alignment: 1 }
    }

    fn is_ros1(&self) -> bool {
        self.alignment == 1
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let step = N.min(self.alignment);
        let at = self.at.next_multiple_of(step);
        let bytes = self.bytes.get(at..at + N).ok_or("is torn")?;
        self.at = at + N;
        let mut out = [0; N];
        out.copy_from_slice(bytes);
        if !self.little {
            out.reverse();
        }
        Ok(out)
    }

    fn u32(&mut self) -> Result<u32, String> {
        self.take().map(u32::from_le_bytes)
    }

    fn count(&mut self) -> Result<usize, String> {
        let count = self.u32()? as usize;
        if count > MOST_OF_A_TYPE { Err("is torn".into()) } else { Ok(count) }
    }

    pub(super) fn string(&mut self) -> Result<String, String> {
        let length = self.count()?;
        let bytes = self.bytes.get(self.at..self.at + length).ok_or("is torn")?;
        self.at += length;
        // CDR counts a zero at the end.
        let text = bytes.strip_suffix(b"\0").unwrap_or(bytes);
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    pub(super) fn strings(&mut self) -> Result<Vec<String>, String> {
        (0..self.count()?).map(|_| self.string()).collect()
    }

    pub(super) fn numbers(&mut self) -> Result<Vec<f64>, String> {
        (0..self.count()?).map(|_| self.take().map(f64::from_le_bytes)).collect()
    }

    /// A list of what `each` reads.
    pub(super) fn list<T>(
        &mut self,
        each: impl Fn(&mut Self) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        (0..self.count()?).map(|_| each(self)).collect()
    }

    /// `std_msgs/Header`: its time stamp, s.
    pub(super) fn header(&mut self) -> Result<f64, String> {
        if self.is_ros1() {
            self.u32()?;
        }
        let seconds = self.take().map(i32::from_le_bytes)?;
        let nanoseconds = self.u32()?;
        self.string()?;
        Ok(f64::from(seconds) + 1e-9 * f64::from(nanoseconds))
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
