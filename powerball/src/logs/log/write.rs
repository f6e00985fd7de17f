//! Logs as files: the samples that were taken, in SI units, under their plain names.

use super::{Log, LogFile};
use std::io::{self, Write};
use std::path::Path;

impl Log {
    /// Writes the log: CSV, or Parquet or MCAP where the name of the file ends so. Temperatures and motors'
    /// torques that are there go with it; velocities do not, as they are not kept.
    ///
    /// # Errors
    /// What the file system says.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let (mut file, _) = LogFile::create(path)?;
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
            clock: self.clock,
        };
        self.pieces.iter().map(piece).collect()
    }
}
