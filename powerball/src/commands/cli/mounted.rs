//! Logs with the mounting of the base that each was recorded in.

use crate::identification::Source;
use crate::identification::mounting::Mounting;
use crate::logs::log::ColumnMap;
use clap::{ArgMatches, Args, Command, FromArgMatches};
use std::path::PathBuf;
use std::sync::Arc;

/// Logs to fit and to judge by. A mounting on the command line counts for the files after it.
#[derive(Clone, Debug)]
pub(crate) struct MountedLogs {
    pub log: Vec<Source<'static>>,
    pub validate: Vec<Source<'static>>,
}

impl MountedLogs {
    /// The same, the columns of all read so.
    pub(crate) fn mapped(self, map: ColumnMap) -> MountedLogs {
        let map = Arc::new(map);
        let mapped = |of: Vec<Source<'static>>| of.into_iter().map(|s| s.mapped(Arc::clone(&map))).collect();
        MountedLogs { log: mapped(self.log), validate: mapped(self.validate) }
    }
}

/// As they stand on the command line.
#[derive(Args, Debug)]
struct Options {
    /// Logs to fit (CSV, Parquet, MCAP, rosbag2, npz or mat: t, q1…, tau1… or i1…), or their summaries from
    /// `powerball summarize`.
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
mod tests {
    use super::*;
    use clap::Parser;

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
