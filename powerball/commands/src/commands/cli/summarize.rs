//! `powerball summarize`: a log as the sufficient statistics of its fit, R factors.

use super::inputs::MapArgument;
use super::{Failure, output};
use clap::Args;
use dyngen::Arm;
use powerball_identification::mounting::Mounting;
use powerball_identification::{Source, Summarized, summarize};
use powerball_logs::Progress;
use powerball_logs::regression::DataOptions;
use powerball_logs::summary::BANDS;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// Reduce logs to triangular factors, which `powerball identify` takes in place of the logs.
///
/// A summary is of one size however long the logs were, and holds all that a fit needs of them: the rows of
/// every joint for any friction steepness, octave by octave, in three bands. Joined summaries give the result
/// of all their logs. A summary belongs to one arm file and is refused with another.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball summarize --arm arm.toml --log a.csv --out a.summary\n  powerball \
        identify --arm arm.toml --log a.summary b.summary c.csv --out result"
)]
pub(crate) struct Summarize {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// Logs (CSV, Parquet, MCAP, a bag of ROS, npz, mat or HDF5), or summaries to join.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    log: Vec<PathBuf>,
    #[command(flatten)]
    map: MapArgument,
    /// How the base stood for these logs: `filed`, ROLL,PITCH in degrees from there, or gravity in its frame
    /// as X,Y,Z in m/s². Logs of another mounting go into a summary of their own, and `identify` joins them.
    #[arg(long, value_name = "MOUNTING", allow_hyphen_values = true)]
    mounting: Option<Mounting>,
    /// The summary to write.
    #[arg(long, value_name = "SUMMARY")]
    out: PathBuf,
    /// Print what was written as one JSON object on standard output.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    accept: output::Accept,
}

/// The result of the command.
#[derive(Serialize)]
struct Written {
    arm: String,
    set: &'static str,
    /// How the base stood, where it was not as the arm file says.
    #[serde(skip_serializing_if = "Option::is_none")]
    mounting: Option<String>,
    logs: Vec<String>,
    seconds: f64,
    /// By joint.
    rows: Vec<u64>,
    bytes: usize,
    /// Why it should not be used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    unusable: Vec<String>,
    /// The ends of the bands, Hz.
    bands: [f64; BANDS.len()],
    warnings: Vec<String>,
}

impl Summarize {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let map = Arc::new(self.map.read()?);
        let source = |file: &PathBuf| {
            let source = Source { mounting: self.mounting, ..Source::file(file) };
            source.mapped(Arc::clone(&map))
        };
        let Summarized { mounting, bands, unusable, warnings } =
            summarize(&arm, self.log.iter().map(source), &DataOptions::default(), Progress::to(&say))?;
        let bytes = bands.to_bytes();
        let summary = bands.widest();
        output::write_file(&self.out, &bytes)?;
        let written = Written {
            arm: summary.identity.arm.clone(),
            set: "minimal",
            mounting: (mounting != Mounting::Filed).then(|| mounting.to_string()),
            logs: summary.logs.iter().map(|(name, _)| name.clone()).collect(),
            seconds: summary.logs.iter().map(|(_, seconds)| seconds).sum(),
            rows: summary.joints.iter().map(|j| j.rows()).collect(),
            bytes: bytes.len(),
            bands: BANDS,
            unusable,
            warnings,
        };
        if self.json {
            output::data(&output::json(&written)?);
            return self.accept.judge(&written.unusable);
        }
        output::first_lines(&written.unusable, None, false).iter().for_each(|line| output::print(line));
        for warning in &written.warnings {
            output::print(&format!("note: {warning}"));
        }
        output::print(&format!(
            "{}: {} logs, {:.0} s, up to {} rows a joint, in {} kB",
            self.out.display(),
            written.logs.len(),
            written.seconds,
            written.rows.iter().max().unwrap_or(&0),
            written.bytes / 1000
        ));
        self.accept.judge(&written.unusable)
    }
}
