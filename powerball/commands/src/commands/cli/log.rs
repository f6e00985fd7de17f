//! `powerball log`: the content of a file and its interpretation.

use super::inputs::MapArgument;
use super::{Failure, output, replace};
use crate::report::inspected;
use clap::{Args, ValueEnum};
use dyngen::Arm;
use powerball_logs::log::{Inspected, InspectedTable, Log, inspect};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Show what is in log files and what they are taken to be: topics, columns, units, rates, gaps, doubts;
/// with --out as a page with figures.
///
/// CSV, Parquet, LeRobot datasets, MCAP, bags of ROS 1 and 2 (also their folders), npz, npy, mat and HDF5.
/// With an arm also the log that `identify` would read. Exit code 1 where a file is not a log of that arm.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball log recording.mcap --out looked\n  \
        powerball log bag_0.db3 --arm arm.toml --map 'joints = [\"shoulder_pan_joint\", \
        \"shoulder_lift_joint\"]'\n  \
        powerball log run.csv --arm arm.toml --model result/identified.json --to mcap -o run.mcap")]
pub(crate) struct LogCommand {
    /// The files.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    map: MapArgument,
    /// The arm file (TOML) whose logs they are.
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// Write the log that was found as another file, in SI units and under plain names; needs --arm.
    #[arg(long, value_enum, value_name = "FORMAT", requires_all = ["arm", "out"])]
    to: Option<Target>,
    /// A folder for report.html, the same with figures, and log.json; with --to the file to write.
    #[arg(short, long, value_name = "OUT")]
    out: Option<PathBuf>,
    /// A model, identified.json or model.json: an MCAP then has measured, predicted and residual torque of
    /// each joint next to each other, in the band of the fit.
    #[arg(long, value_name = "FILE.json", requires = "to")]
    model: Option<PathBuf>,
    /// Print what was found as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Target {
    Mcap,
    Parquet,
    Csv,
}

/// The result of the command.
#[derive(Serialize)]
struct Written {
    files: Vec<Inspected>,
}

impl LogCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let unusable = |e: &dyn std::fmt::Display| Failure::Unusable(e.to_string());
        let arm = self.arm.as_deref().map(Arm::read).transpose().map_err(|e| unusable(&e))?;
        let map = self.map.read()?;
        let inspected =
            self.files.iter().map(|file| inspect(file, &map, arm.as_ref()).map_err(|e| unusable(&e)));
        let files = inspected.collect::<Result<Vec<_>, _>>()?;
        match (&self.out, self.to) {
            (Some(folder), None) => {
                output::write_all(&inspected::files(&files).map_err(Failure::Unusable)?, folder)?;
            }
            _ => self.write(&files, arm.as_ref())?,
        }
        let refused: Vec<String> = files.iter().flat_map(|file| file.refused.clone()).collect();
        if self.json {
            output::data(&output::json(&Written { files })?);
        } else {
            files.iter().for_each(|file| output::print(&text(file)));
        }
        if refused.is_empty() { Ok(()) } else { Err(Failure::Refused(refused.join("\n"))) }
    }

    /// The log as another file, if requested.
    fn write(&self, files: &[Inspected], arm: Option<&Arm>) -> Result<(), Failure> {
        let (Some(to), Some(out), Some(arm)) = (self.to, &self.out, arm) else { return Ok(()) };
        let unusable = |what: &str| Err(Failure::Unusable(format!("{}: {what}", out.display())));
        let [file] = files else { return unusable("holds one log: give one file") };
        let ending = out.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match to {
            Target::Mcap if ending != "mcap" => {
                return unusable("--to mcap writes a file that ends in .mcap");
            }
            Target::Parquet if ending != "parquet" => {
                return unusable("--to parquet writes a file that ends in .parquet");
            }
            Target::Csv if ["mcap", "parquet"].contains(&ending.as_str()) => {
                return unusable("--to csv writes a file that ends in .csv");
            }
            Target::Parquet | Target::Csv if self.model.is_some() => {
                return unusable("with --model an MCAP is written: --to mcap");
            }
            _ => {}
        }
        match &file.log {
            Some(log) => write(log, arm, self.model.as_deref(), out),
            // Why it is not a log is reported below.
            None => Ok(()),
        }
    }
}

fn text(file: &Inspected) -> String {
    let format = serde_json::to_value(file.format).ok().and_then(|f| f.as_str().map(str::to_string));
    let mut lines = vec![format!("{}: {}", file.file, format.unwrap_or_default())];
    for table in &file.tables {
        table_lines(table, &mut lines);
    }
    for pair in &file.alignment {
        let a = pair.alignment;
        lines.push(format!(
            "  {} and {} overlap for {:.2} s; their samples are {:.1} ms apart (median), {:.1} ms at most",
            pair.a,
            pair.b,
            a.overlap,
            1e3 * a.median,
            1e3 * a.largest
        ));
    }
    if let Some(log) = &file.taken_as {
        let with = if log.motor { ", with torques on the motors' side" } else { "" };
        lines.push(format!(
            "  a log of {}: {} samples in {:.2} s, {} without a gap{with}",
            log.arm,
            log.samples,
            log.duration,
            if log.pieces == 1 { "one piece".to_string() } else { format!("{} pieces", log.pieces) }
        ));
        for (j, (q, tau)) in log.positions.iter().zip(&log.torques).enumerate() {
            lines.push(format!(
                "    joint {}: q {:.3} to {:.3}, torque {:.3} to {:.3}",
                j + 1,
                q[0],
                q[1],
                tau[0],
                tau[1]
            ));
        }
    }
    lines.extend(file.warnings.iter().map(|doubt| format!("  note: {doubt}")));
    lines.join("\n")
}

fn table_lines(table: &InspectedTable, lines: &mut Vec<String>) {
    let name = if table.name.is_empty() { String::new() } else { format!("{} ", table.name) };
    let mut line = format!("  {name}({}): {} samples", table.kind, table.samples);
    if let (Some(duration), Some(rate)) = (table.duration, table.rate) {
        line.push_str(&format!(", {duration:.2} s, {rate:.1} Hz"));
    }
    if let Some(clock) = &table.clock {
        line.push_str(&format!(", time: {clock}"));
    }
    lines.push(line);
    if let Some(doubt) = &table.clock_doubt {
        lines.push(format!("    time of receipt is used: {doubt}"));
    }
    if let Some(delay) = table.delay {
        lines.push(format!("    received {:.1} ms after their time stamps (median)", 1e3 * delay));
    }
    if table.gaps > 0 {
        let longest = table.longest_step.unwrap_or(0.0);
        lines.push(format!("    {} gaps, the longest {longest:.3} s", table.gaps));
    }
    if table.not_rising > 0 {
        lines.push(format!("    {} time stamps do not increase", table.not_rising));
    }
    if !table.joints.is_empty() {
        lines.push(format!("    joints: {}", table.joints.join(", ")));
    }
    let mut aside = Vec::new();
    for column in &table.columns {
        let Some(quantity) = column.quantity else {
            aside.push(column.name.as_str());
            continue;
        };
        let unit = column.unit.as_ref().map_or(String::new(), |unit| format!(" [{unit}?]"));
        let of = column.joint.as_ref().map_or(String::new(), |joint| format!(" of {joint}"));
        let range = column.min.zip(column.max);
        let range = range.map_or("no numbers".into(), |(min, max)| format!("{min:.4} to {max:.4}"));
        let holes = match column.missing {
            0 => String::new(),
            count => format!(", {count} samples without a number"),
        };
        lines.push(format!("    {}: {quantity}{of}{unit}, {range}{holes}", column.name));
    }
    if !aside.is_empty() {
        lines.push(format!("    left aside: {}", aside.join(", ")));
    }
}

// `powerball log --to`: a log as another file, with what a model predicts next to it.

/// Writes a log; with a model as MCAP that has measured, predicted and residual torque next to each other.
pub(super) fn write(log: &Log, arm: &Arm, model: Option<&Path>, out: &Path) -> Result<(), Failure> {
    replace::check_log(out, &[Path::new(&log.file)])?;
    let failed = |e: std::io::Error| Failure::Unusable(format!("{}: cannot be written: {e}", out.display()));
    match model {
        None => log.write_for(out, &joint_names(arm)).map_err(failed),
        #[cfg(feature = "cli")]
        Some(model) => super::log_with_model::write(log, arm, model, out),
        #[cfg(not(feature = "cli"))]
        Some(_) => Err(failed(std::io::Error::other("MCAP is not built into this program"))),
    }
}

/// The names of an arm's joints in an MCAP: those of the arm file, else `joint1` and so on.
pub(super) fn joint_names(arm: &Arm) -> Vec<String> {
    match arm.moving_joints().all(|joint| joint.name.is_some()) {
        true => arm.joint_names(),
        false => (1..=arm.dof()).map(|j| format!("joint{j}")).collect(),
    }
}
