//! What `explain` reads: an arm, logs, what is known already; and a folder for results.
//!
//! The file also has logs with the mounting of the base that each was recorded in.

use super::Failure;
use super::output::{self, Progress};
use clap::{ArgMatches, Args, Command, FromArgMatches};
use dyngen::Arm;
use powerball_explanation::torque_model::{ModelFile, TorqueModel};
use powerball_identification::mounting::Mounting;
use powerball_identification::{KnownModel, Recorded, Source};
use powerball_logs::log::{ColumnMap, notes_of};
use powerball_logs::regression::RigidArm;
use powerball_logs::tables::allow_memory;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arm and logs.
#[derive(Args, Debug)]
pub(crate) struct Inputs {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    pub arm: PathBuf,
    /// Logs to fit (CSV, Parquet, MCAP, a bag of ROS, npz, mat or HDF5: t, q1…, tau1… or i1…); several, in
    /// the order in which they were recorded.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub log: Vec<PathBuf>,
    #[command(flatten)]
    pub map: MapArgument,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

/// How logs are read: what their columns are, and how much memory one may take.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct MapArgument {
    /// Which column is what, where names do not say it: a TOML file, or a line of it such as
    /// 'joints = ["a", "b"]', 'topic = "/joint_states"' or 'tau.sign = -1'. May be repeated.
    #[arg(long, value_name = "MAP.toml")]
    map: Vec<String>,
    /// Memory limit for one log, such as 2GB or 500MB: a larger log is refused before it is read. Default:
    /// half of the free memory.
    #[arg(long, value_name = "SIZE", value_parser = size)]
    memory: Option<u64>,
}

/// Bytes as a person says them: 500MB, 2GB, 1.5GiB.
fn size(text: &str) -> Result<u64, String> {
    let digits = text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.').len();
    let (number, unit) = text.split_at(digits);
    let unit = match unit.trim().to_ascii_lowercase().as_str() {
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "kib" => 1024.0,
        "mib" => 1_048_576.0,
        "gib" => 1_073_741_824.0,
        _ => 0.0,
    };
    let bytes = number.parse().unwrap_or(0.0) * unit;
    match bytes >= 1.0 {
        true => Ok(bytes as u64),
        false => Err("must be a number and kB, MB, GB, TB, KiB, MiB or GiB, such as 2GB".to_string()),
    }
}

impl MapArgument {
    /// The map of all that was given; from then on logs are read within the given memory.
    pub(crate) fn read(&self) -> Result<ColumnMap, Failure> {
        self.memory.into_iter().for_each(allow_memory);
        ColumnMap::said(&self.map).map_err(Failure::Unusable)
    }
}

/// An arm with what is known of it beforehand.
pub(crate) struct Known {
    /// The arm as the model has it.
    pub arm: Arm,
    model: Option<ModelFile>,
}

impl Known {
    /// Reads an arm file and, where there is one, a model of the arm.
    pub(crate) fn read(arm: &Path, model: Option<&Path>) -> Result<Known, Failure> {
        let arm = Arm::read(arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let Some(file) = model else { return Ok(Known { arm, model: None }) };
        let model = ModelFile::read(file).map_err(|e| Failure::Unusable(e.to_string()))?;
        let arm = model.arm(&arm, Mounting::Filed).map_err(Failure::Unusable)?;
        Ok(Known { arm, model: Some(model) })
    }

    /// The model, if it is one of this arm.
    pub(crate) fn model(self, body: &RigidArm) -> Result<Option<TorqueModel>, Failure> {
        let checked = self.model.map(|model| model.checked(body)).transpose();
        checked.map_err(|e| Failure::Unusable(e.to_string()))
    }
}

/// Reads the logs and makes the folder of the results.
pub(crate) fn recorded(
    inputs: &Inputs,
    validate: &[PathBuf],
    arm: &Arm,
    progress: &Progress,
) -> Result<Recorded, Failure> {
    progress.say("reading logs");
    let [fit, validate] = sources(inputs, validate)?;
    let mut read = Recorded::read(arm, &fit, &validate)?;
    read.warnings.splice(0..0, notes_of(arm));
    output::make_folder(&inputs.out)?;
    Ok(read)
}

/// The logs to fit and those for validation, with the map of their columns.
pub(crate) fn sources(inputs: &Inputs, validate: &[PathBuf]) -> Result<[Vec<Source<'static>>; 2], Failure> {
    let map = Arc::new(inputs.map.read()?);
    let of =
        |files: &[PathBuf]| files.iter().map(|file| Source::file(file).mapped(Arc::clone(&map))).collect();
    Ok([of(&inputs.log), of(validate)])
}

// Logs with the mounting of the base that each was recorded in.

/// Logs to fit and to judge by. A mounting on the command line counts for the files after it.
#[derive(Clone, Debug)]
pub(crate) struct MountedLogs {
    pub log: Vec<Source<'static>>,
    pub validate: Vec<Source<'static>>,
}

impl MountedLogs {
    /// Reads the columns of all logs by `map`.
    pub(crate) fn mapped(self, map: ColumnMap) -> MountedLogs {
        let map = Arc::new(map);
        let mapped = |of: Vec<Source<'static>>| of.into_iter().map(|s| s.mapped(Arc::clone(&map))).collect();
        MountedLogs { log: mapped(self.log), validate: mapped(self.validate) }
    }
}

/// As they stand on the command line.
#[derive(Args, Debug)]
struct Options {
    /// Logs to fit (CSV, Parquet, MCAP, a bag of ROS, npz, mat or HDF5: t, q1…, tau1… or i1…), or their
    /// summaries from `powerball summarize`.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    log: Vec<PathBuf>,
    /// Logs on which the fit is judged, on another path.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    validate: Vec<PathBuf>,
    /// How the base stood for the logs that are named after it: `filed`, ROLL,PITCH in degrees from there, or
    /// gravity in its frame as X,Y,Z in m/s². Repeat it, and --log and --validate after it, for logs of
    /// several mountings; before the first one logs are as filed. A summary knows its own.
    #[arg(long, value_name = "MOUNTING", allow_hyphen_values = true)]
    mounting: Vec<Mounting>,
}

impl Args for MountedLogs {
    fn augment_args(command: Command) -> Command {
        Options::augment_args(command)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Options::augment_args_for_update(command)
    }
}

impl FromArgMatches for MountedLogs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let Options { log, validate, mounting } = Options::from_arg_matches(matches)?;
        let places = |of: &str| matches.indices_of(of).into_iter().flatten().collect::<Vec<usize>>();
        let mountings: Vec<(usize, Mounting)> = places("mounting").into_iter().zip(mounting).collect();
        let mounted = |(at, file): (usize, PathBuf)| {
            let before = mountings.iter().rev().find(|(place, _)| *place < at);
            Source { mounting: before.map(|(_, mounting)| *mounting), ..Source::file(file) }
        };
        let files = |of: &str, files: Vec<PathBuf>| places(of).into_iter().zip(files).map(mounted).collect();
        Ok(MountedLogs { log: files("log", log), validate: files("validate", validate) })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = MountedLogs::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod mounted_tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn a_size_has_a_unit() {
        for (text, bytes) in [("2GB", 2_000_000_000), ("500 mb", 500_000_000), ("1.5GiB", 1_610_612_736)] {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        for text in ["", "2", "GB", "0GB", "-1GB", "2 parsecs"] {
            assert!(size(text).is_err(), "{text}");
        }
    }

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        logs: MountedLogs,
    }

    #[test]
    fn a_mounting_counts_for_the_files_after_it() {
        let line = "x --log a b --validate c --mounting 90,0 --log d --mounting -90,0 --validate e --log f g";
        let logs = Line::parse_from(line.split(' ')).logs;
        let turned = |roll| Some(Mounting::Turned { roll, pitch: 0.0 });
        let of = |files: &[Source<'_>]| -> Vec<(String, Option<Mounting>)> {
            files.iter().map(|f| (f.name(), f.mounting)).collect()
        };
        let expected =
            [("a", None), ("b", None), ("d", turned(90.0)), ("f", turned(-90.0)), ("g", turned(-90.0))];
        assert_eq!(of(&logs.log), expected.map(|(f, m)| (f.to_string(), m)));
        assert_eq!(of(&logs.validate), [("c", None), ("e", turned(-90.0))].map(|(f, m)| (f.to_string(), m)));
        assert!(Line::try_parse_from(["x", "--mounting", "90,0"]).is_err());
    }
}
