//! The line of a recording about one cycle.
//!
//! The module also has the progress that is shown while the arm moves, and a writer with its own thread.

use powerball_bus::canopen::Micros;
use powerball_bus::driver::{Counters, Driver};
use powerball_logs::log::{LogFile, TORQUE_LATE};
use std::fmt;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

/// The time of a log: a given value, s, at the first of its SYNCs, and from there on what the bus's clock
/// measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LogTime {
    start: f64,
    first: Option<Micros>,
}

impl LogTime {
    /// A log, or a part of one, that begins at `start`, s.
    #[must_use]
    pub fn from(start: f64) -> LogTime {
        LogTime { start, first: None }
    }

    /// The time of a SYNC in the log, s. The first requested one is the beginning of the log.
    pub fn at(&mut self, sync: Micros) -> f64 {
        let since = sync.saturating_sub(*self.first.get_or_insert(sync));
        self.start + since as f64 * 1e-6
    }
}

/// Which columns a recording has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Columns {
    /// `t`, `q1…qn` (rad) and `tau1…taun` (N·m).
    Torques,
    /// In addition, all that was sent and received: `ref1…refn`, the set-points (rad); `dq1…dqn`, as the
    /// drives report it (rad/s); `status1…statusn`, the statuswords; `answer1…answern`, from SYNC to the
    /// joint's data (s); and `late`, `skipped`, `dropped`, how many SYNCs and set-points were so since the
    /// recording began.
    Everything,
}

impl Columns {
    /// The first line of a log of `n` joints.
    pub(crate) fn header(self, n: usize) -> String {
        let (joint, once): (&[&str], &[&str]) = match self {
            Columns::Torques => (&["q", "tau"], &[]),
            Columns::Everything => {
                (&["q", "tau", "ref", "dq", "status", "answer"], &["late", "skipped", "dropped"])
            }
        };
        let numbered = joint.iter().flat_map(|name| (1..=n).map(move |j| format!("{name}{j}")));
        let names = ["t".to_string()].into_iter().chain(numbered).chain(once.iter().map(ToString::to_string));
        names.collect::<Vec<_>>().join(",") + "\n"
    }

    /// The line of the present cycle at `t`, s, in which `reference` (rad) was given; counts from `begin` on.
    pub(super) fn line<const N: usize>(
        self,
        line: &mut String,
        t: f64,
        driver: &Driver<N>,
        reference: &[f64],
        begin: &Counters,
    ) {
        let joints = driver.joints();
        line.clear();
        // Writing to a string cannot fail.
        let _ = write!(line, "{t:.6}");
        let mut cell = |value: std::fmt::Arguments<'_>| {
            let _ = write!(line, ",{value}");
        };
        // A digit finer than the encoders' step.
        joints.iter().for_each(|joint| cell(format_args!("{:.7}", joint.position)));
        joints.iter().for_each(|joint| cell(format_args!("{:.4}", joint.torque)));
        if self == Columns::Everything {
            reference.iter().for_each(|q| cell(format_args!("{q:.7}")));
            joints.iter().for_each(|joint| cell(format_args!("{:.6}", joint.velocity)));
            joints.iter().for_each(|joint| cell(format_args!("{}", joint.status.map_or(0, |s| s.0))));
            let since = |at: Micros| at.saturating_sub(driver.synced_at()) as f64 * 1e-6;
            joints.iter().for_each(|joint| cell(format_args!("{:.6}", since(joint.answered_at))));
            let now = driver.counters();
            let counts = [now.late - begin.late, now.skipped - begin.skipped, now.dropped - begin.dropped];
            counts.iter().for_each(|count| cell(format_args!("{count}")));
        }
        line.push('\n');
    }
}

/// The log of an arm that moves by whatever law, with [all columns](Columns::Everything): a whole line a
/// cycle, written by a thread of its own. Dropped it is closed too: what was recorded counts, whatever ended
/// it.
#[derive(Debug)]
pub struct MotionLog {
    time: LogTime,
    /// The counters at the beginning, once the header is written.
    begin: Option<Counters>,
    line: String,
    out: Option<Behind<LogFile>>,
}

impl MotionLog {
    /// A log as [`LogFile::create`] makes it. What was there before stays until the first line.
    ///
    /// # Errors
    /// Where the file cannot be made.
    pub fn create(path: &Path) -> io::Result<MotionLog> {
        let (file, _) = LogFile::create(path)?;
        Ok(MotionLog {
            time: LogTime::default(),
            begin: None,
            line: String::new(),
            out: Some(Behind::new(file)),
        })
    }

    /// The line of the present cycle, in which `reference` (rad) was where the joints should be. `late` is by
    /// how much the torques are later than the positions, s, where that is known: the same in all lines.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn take<const N: usize>(
        &mut self,
        driver: &Driver<N>,
        reference: &[f64],
        late: Option<f64>,
    ) -> io::Result<()> {
        let Some(out) = &mut self.out else { return Ok(()) };
        if self.begin.is_none() {
            let header = Columns::Everything.header(N);
            let more = late.map_or(String::new(), |_| format!(",{TORQUE_LATE}"));
            out.write_all(format!("{}{more}\n", header.trim_end()).as_bytes())?;
        }
        let begin = self.begin.get_or_insert(*driver.counters());
        let t = self.time.at(driver.synced_at());
        Columns::Everything.line(&mut self.line, t, driver, reference, begin);
        if let Some(late) = late {
            self.line.pop();
            // Writing to a string cannot fail.
            let _ = writeln!(self.line, ",{late:.6}");
        }
        out.write_all(self.line.as_bytes())
    }

    /// Waits until all lines are written.
    ///
    /// # Errors
    /// Where they cannot be.
    pub fn close(mut self) -> io::Result<()> {
        let recorded = self.begin.is_some();
        let ended = self.end();
        if recorded { ended } else { Ok(()) }
    }

    fn end(&mut self) -> io::Result<()> {
        let Some(out) = self.out.take() else { return Ok(()) };
        let (file, written) = out.close();
        written.and_then(|()| file.map_or(Ok(()), LogFile::close))
    }
}

impl Drop for MotionLog {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

// The progress that is shown while the arm moves.

/// How far a motion has come.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordProgress {
    /// Samples that were given, and all there are.
    pub samples: [usize; 2],
    /// Positions of the joints, rad.
    pub position: Vec<f64>,
    /// The greatest distance of a joint from its set-point now, rad.
    pub error: f64,
    /// SYNCs that were late since the master began.
    pub late: u64,
    /// Joints' data that was missing since then, in cycles.
    pub missing: u64,
}

impl fmt::Display for RecordProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [done, all] = self.samples;
        let share = 100 * done / all.max(1);
        write!(f, "{share:3} % of {all} samples, at (")?;
        for (j, q) in self.position.iter().enumerate() {
            write!(f, "{}{q:.3}", if j == 0 { "" } else { ", " })?;
        }
        let RecordProgress { error, late, missing, .. } = self;
        write!(f, ") rad, {:.1} mrad off, {late} cycles late, {missing} without data", 1e3 * error)
    }
}

// A writer behind a thread of its own: the cycle hands over a line and never waits for a disk.

/// Lines that may wait. At 200 Hz these are 20 s; a disk that is silent for longer holds the cycle up, and a
/// cycle that is held up stops the arm.
const WAITING: usize = 4000;

/// A writer whose data another thread writes, completely and in order, with one call for each call here. An
/// error there is the error of a later call here. Dropping it waits until everything is written, as
/// [`close`](Behind::close) does.
#[derive(Debug)]
pub struct Behind<W: Write + Send + 'static> {
    lines: Option<SyncSender<Vec<u8>>>,
    thread: Option<JoinHandle<(W, io::Result<()>)>>,
    done: Option<W>,
}

impl<W: Write + Send + 'static> Behind<W> {
    /// Begins a thread that writes to `writer`.
    pub fn new(mut writer: W) -> Behind<W> {
        let (lines, waiting) = sync_channel::<Vec<u8>>(WAITING);
        let write = move || {
            // It waits for disks, and must not do so with the priority of the cycle.
            #[cfg(target_os = "linux")]
            powerball_bus::transport::realtime::resign();
            let done = waiting.iter().try_for_each(|line| writer.write_all(&line));
            let done = done.and_then(|()| writer.flush());
            (writer, done)
        };
        Behind { lines: Some(lines), thread: Some(thread::spawn(write)), done: None }
    }

    /// Waits until everything is written.
    fn finish(&mut self) -> io::Result<()> {
        self.lines = None;
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let (writer, done) = thread.join().map_err(|_| io::Error::other("the log's thread has panicked"))?;
        self.done = Some(writer);
        done
    }

    /// Waits until everything is written, and gives the writer back, where its thread lived, together with
    /// the error that ended it.
    pub fn close(mut self) -> (Option<W>, io::Result<()>) {
        let done = self.finish();
        (self.done.take(), done)
    }
}

impl<W: Write + Send + 'static> Drop for Behind<W> {
    fn drop(&mut self) {
        let _ = self.finish();
    }
}

impl<W: Write + Send + 'static> Write for Behind<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let gone = || io::Error::other("the log is closed");
        if self.lines.as_ref().ok_or_else(gone)?.send(bytes.to_vec()).is_ok() {
            return Ok(bytes.len());
        }
        self.finish().and_then(|()| Err(gone()))
    }

    /// What was handed over is written as soon as it can be; [`close`](Behind::close) waits for it.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod behind_tests {
    use super::*;

    #[test]
    fn everything_is_written_in_order() {
        let mut log = Behind::new(Vec::new());
        (0..10_000).for_each(|k| log.write_all(format!("{k}\n").as_bytes()).unwrap());
        let (written, done) = log.close();
        done.unwrap();
        let expected: String = (0..10_000).map(|k| format!("{k}\n")).collect();
        assert_eq!(String::from_utf8(written.unwrap()).unwrap(), expected);
    }

    /// Takes this many bytes, then the disk is full.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_is_reported() {
        let mut log = Behind::new(Full(10));
        let reported = (0..100_000).find_map(|_| log.write_all(b"1234\n").err()).unwrap();
        assert_eq!(reported.kind(), io::ErrorKind::StorageFull);
        assert!(log.write_all(b"5").is_err());
    }
}
