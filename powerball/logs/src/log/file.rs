//! A log while it is written: whatever moment the program dies at, what was written can be read.
//!
//! Lines of CSV need nothing after them. A Parquet file is none before its last bytes, so it is made of such
//! lines: they are written to `NAME.parquet.csv`, and closing the log makes `NAME.parquet` of them, whole or
//! not at all. Where a program died before that, the lines are still there, a log like any other; the next
//! log of that name puts them into a Parquet file of their own first. So it is with MCAP.
//!
//! The file also has logs as files.

use super::Log;
use crate::tables::NOT_WRITTEN;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A log that is being written, line by line.
#[derive(Debug)]
pub struct LogFile {
    path: PathBuf,
    lines: PathBuf,
    file: File,
    started: bool,
    /// Bytes that were written, and those of whole lines.
    length: u64,
    whole: u64,
    joints: Vec<String>,
}

impl LogFile {
    /// Begins a log at `path`: Parquet or MCAP where its name ends in `.parquet` or `.mcap`, CSV else. What
    /// was there before stays until the first line is written. Also gives the file that took up what an
    /// earlier log of this name left when its program died.
    ///
    /// # Errors
    /// What the file system says, and a format that this build does not have.
    pub fn create(path: &Path) -> io::Result<(LogFile, Option<PathBuf>)> {
        Self::create_for(path, &[])
    }

    /// As [`LogFile::create`], with the names that an MCAP gives the joints, in chain order; `joint1` and so
    /// on where there are none.
    ///
    /// # Errors
    /// As [`LogFile::create`].
    pub fn create_for(path: &Path, joints: &[String]) -> io::Result<(LogFile, Option<PathBuf>)> {
        let made = Made::of(path);
        let built = match made {
            Some(Made::Parquet) => cfg!(feature = "parquet"),
            Some(Made::Mcap) => cfg!(feature = "mcap"),
            None => true,
        };
        if !built {
            return Err(io::Error::other(NOT_WRITTEN));
        }
        let lines = if made.is_some() { with_more(path, ".csv") } else { path.to_path_buf() };
        let recovered = if made.is_some() { recover(path, &lines, joints)? } else { None };
        let file = OpenOptions::new().create(true).append(true).open(&lines)?;
        let (path, joints) = (path.to_path_buf(), joints.to_vec());
        Ok((LogFile { path, lines, file, started: false, length: 0, whole: 0, joints }, recovered))
    }

    /// Ends the log.
    ///
    /// # Errors
    /// What the file system says (the lines are then still there), and where nothing was written.
    pub fn close(mut self) -> io::Result<()> {
        self.file.flush()?;
        if !self.started {
            if self.file.metadata()?.len() == 0 {
                fs::remove_file(&self.lines)?;
            }
            return Err(io::Error::other("nothing was recorded"));
        }
        if self.lines != self.path {
            convert(&self.lines, &self.path, &self.joints)?;
            fs::remove_file(&self.lines)?;
        }
        Ok(())
    }
}

impl Write for LogFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.started {
            self.file.set_len(0)?;
            self.started = true;
        }
        // Whole lines or nothing: what does not fit is taken away, up to the last line that did.
        if let Err(e) = self.file.write_all(bytes) {
            let _ = self.file.set_len(self.whole);
            return Err(e);
        }
        self.length += bytes.len() as u64;
        if let Some(end) = bytes.iter().rposition(|byte| *byte == b'\n') {
            self.whole = self.length - (bytes.len() - 1 - end) as u64;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// What is made of lines when a log ends.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Made {
    Parquet,
    Mcap,
}

impl Made {
    fn of(path: &Path) -> Option<Made> {
        let ending = path.extension()?.to_string_lossy().to_lowercase();
        [("parquet", Made::Parquet), ("mcap", Made::Mcap)]
            .into_iter()
            .find(|(own, _)| *own == ending)
            .map(|m| m.1)
    }

    /// The number of rows; an MCAP gets its layouts next to it.
    fn convert(self, lines: File, joints: &[String], out: File, target: &Path) -> io::Result<usize> {
        match self {
            Made::Parquet => crate::tables::columnar::from_csv(lines, out),
            #[cfg(feature = "mcap")]
            Made::Mcap => {
                use crate::tables::{layouts, mcap_from_csv};
                let written = mcap_from_csv(lines, joints, io::BufWriter::new(out))?;
                if written.rows > 0 {
                    let (joints, velocities) = (written.joints.as_slice(), written.velocities);
                    layouts::write(target, layouts::Held { joints, velocities, torques: false })?;
                }
                Ok(written.rows)
            }
            #[cfg(not(feature = "mcap"))]
            Made::Mcap => {
                let _ = (joints, target);
                Err(io::Error::other(NOT_WRITTEN))
            }
        }
    }
}

fn with_more(path: &Path, more: &str) -> PathBuf {
    let mut name: OsString = path.as_os_str().to_owned();
    name.push(more);
    PathBuf::from(name)
}

/// Lines that a dead program left become a file of the format under a name that is still free.
fn recover(path: &Path, lines: &Path, joints: &[String]) -> io::Result<Option<PathBuf>> {
    if !lines.exists() {
        return Ok(None);
    }
    let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    let free = (1..).map(|k| path.with_extension(format!("interrupted-{k}.{ending}"))).find(|p| !p.exists());
    let Some(target) = free else { return Ok(None) };
    let rows = convert(lines, &target, joints)?;
    fs::remove_file(lines)?;
    Ok((rows > 0).then_some(target))
}

/// Lines of CSV to a file of the target's format, whole or not at all; the number of rows. Without rows there
/// is no file.
fn convert(lines: &Path, target: &Path, joints: &[String]) -> io::Result<usize> {
    let part = with_more(target, &format!(".{}.part", std::process::id()));
    let made = Made::of(target).unwrap_or(Made::Parquet);
    let written = made.convert(File::open(lines)?, joints, File::create(&part)?, target);
    match written {
        Ok(rows) if rows > 0 => fs::rename(&part, target).map(|()| rows),
        other => {
            let _ = fs::remove_file(&part);
            other
        }
    }
}

// Logs as files: the samples that were taken, in SI units, under their plain names.

impl Log {
    /// Writes the log: CSV, or Parquet or MCAP where the name of the file ends so. Temperatures and motors'
    /// torques that are there go with it; velocities do not, as they are not kept.
    ///
    /// # Errors
    /// What the file system says.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        self.write_for(path, &[])
    }

    /// As [`Log::write`], with the names that an MCAP gives the joints.
    ///
    /// # Errors
    /// As [`Log::write`].
    pub fn write_for(&self, path: &Path, joints: &[String]) -> io::Result<()> {
        let (file, _) = LogFile::create_for(path, joints)?;
        let lines = file.lines.clone();
        let written = self.write_into(file);
        // The samples are still here: half of them in a file are of no use.
        if written.is_err() {
            let _ = fs::remove_file(lines);
        }
        written
    }

    fn write_into(&self, mut file: LogFile) -> io::Result<()> {
        let groups = self.groups();
        let mut line = String::from("t");
        for (stem, signals) in &groups {
            (1..=signals.len()).for_each(|j| line.push_str(&format!(",{stem}{j}")));
        }
        line.push('\n');
        let mut lines = io::BufWriter::new(&mut file);
        lines.write_all(line.as_bytes())?;
        for (k, t) in self.t.iter().enumerate() {
            line.clear();
            line.push_str(&t.to_string());
            for x in groups.iter().flat_map(|(_, signals)| signals.iter()) {
                line.push(',');
                line.push_str(&x[k].to_string());
            }
            line.push('\n');
            lines.write_all(line.as_bytes())?;
        }
        lines.flush()?;
        drop(lines);
        file.close()
    }

    fn groups(&self) -> Vec<(&'static str, &Vec<Vec<f64>>)> {
        let optional = [("temp", &self.temperature), ("motor", &self.motor)];
        let there = optional.into_iter().filter_map(|(stem, signals)| Some((stem, signals.as_ref()?)));
        [("q", &self.q), ("tau", &self.torque)].into_iter().chain(there).collect()
    }

    /// The log's pieces without a gap, each a log.
    #[must_use]
    pub fn whole_pieces(&self) -> Vec<Log> {
        let cut = |x: &Vec<Vec<f64>>, range: &std::ops::Range<usize>| -> Vec<Vec<f64>> {
            x.iter().map(|signal| signal[range.clone()].to_vec()).collect()
        };
        let piece = |range: &std::ops::Range<usize>| Log {
            file: self.file.clone(),
            t: self.t[range.clone()].to_vec(),
            q: cut(&self.q, range),
            torque: cut(&self.torque, range),
            temperature: self.temperature.as_ref().map(|x| cut(x, range)),
            motor: self.motor.as_ref().map(|x| cut(x, range)),
            pieces: std::iter::once(0..range.len()).collect(),
            doubts: self.doubts.clone(),
            clock: self.clock,
        };
        self.pieces.iter().map(piece).collect()
    }
}

#[cfg(test)]
#[cfg(feature = "parquet")]
mod tests {
    use super::*;
    use crate::log::read_log;

    const HEADER: &str = "t,q1,q2,tau1,tau2\n";

    fn arm() -> dyngen::Arm {
        let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";
        let text =
            format!("name = \"two\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n{joint}{joint}");
        dyngen::Arm::parse(&text, "two.toml").unwrap()
    }

    fn line(k: usize) -> String {
        let t = 0.005 * k as f64;
        format!("{t:.4},{:.7},{:.7},{:.4},{:.4}\n", t.sin(), t.cos(), 3.0 * t.sin(), t.cos() - 0.2)
    }

    /// A log that was closed says what the same lines as CSV say; one that was not is found by the next.
    #[test]
    fn closed_and_abandoned_logs_can_be_read() {
        let folder = std::env::temp_dir().join(format!("powerball_log_file_{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (parquet, csv) = (folder.join("a.parquet"), folder.join("a.csv"));
        let begin = |path: &Path| LogFile::create(path).unwrap();
        // More than one row group.
        for path in [&parquet, &csv] {
            let (mut log, recovered) = begin(path);
            assert!(recovered.is_none());
            log.write_all(HEADER.as_bytes()).unwrap();
            (0..70_000).for_each(|k| log.write_all(line(k).as_bytes()).unwrap());
            log.close().unwrap();
        }
        let read = |path: &Path| read_log(path, &arm(), &mut Vec::new()).unwrap();
        let (a, b) = (read(&parquet), read(&csv));
        assert_eq!((a.t, a.q, a.torque), (b.t, b.q, b.torque));
        assert!(fs::metadata(&parquet).unwrap().len() < fs::metadata(&csv).unwrap().len());

        // The program dies in the middle of a line.
        let (mut log, _) = begin(&parquet);
        log.write_all(HEADER.as_bytes()).unwrap();
        (0..500).for_each(|k| log.write_all(line(k).as_bytes()).unwrap());
        log.write_all(b"2.5,0.1,0").unwrap();
        drop(log);
        let lines = folder.join("a.parquet.csv");
        assert_eq!(read(&lines).t.len(), 500);
        assert_eq!(read(&parquet).t.len(), 70_000);
        let (log, recovered) = begin(&parquet);
        let recovered = recovered.unwrap();
        assert_eq!(recovered, folder.join("a.interrupted-1.parquet"));
        assert_eq!(read(&recovered).t.len(), 500);
        // Nothing was recorded: that is reported, and what was there stays.
        assert!(log.close().unwrap_err().to_string().contains("nothing was recorded"));
        assert!(begin(&csv).0.close().is_err());
        assert_eq!((read(&parquet).t.len(), read(&csv).t.len()), (70_000, 70_000));
        assert!(!lines.exists() && begin(&parquet).1.is_none());
        fs::remove_dir_all(&folder).unwrap();
    }
}
