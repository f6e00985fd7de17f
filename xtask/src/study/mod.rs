//! How often `explain` gives the right name, on logs whose truth is known.
//!
//! Each case is one line of a file of results, so that a study can be stopped and taken up again, and tables
//! are made of the lines.

mod alike;
mod arms;
mod benchmark;
mod case;
mod experiment;
mod judge;
mod law;
mod measured;
mod page;
mod probability;
mod reliability;
#[cfg(test)]
mod tests;

pub(crate) use benchmark::{Arguments as BenchmarkArguments, run as benchmark};
use case::{Case, Table};
use judge::Outcome;
use measured::Measured;
pub(crate) use probability::{Arguments as ProbabilityArguments, run as probability};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashSet};
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::ops::Range;
use std::path::PathBuf;

/// What to study.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Tables to fill; all where none is named
    #[arg(long, value_enum, value_delimiter = ',')]
    table: Vec<Table>,
    /// Seeds, as FIRST..END; every table has a number of its own otherwise
    #[arg(long, value_parser = range)]
    seeds: Option<Range<u64>>,
    /// Kinds of truth; all of a table where none is named
    #[arg(long, value_delimiter = ',')]
    kind: Vec<String>,
    /// The results, one line a case; cases that it holds are not run again
    #[arg(long, default_value = "target/study.jsonl")]
    results: PathBuf,
    /// The folder of the measured logs, for the tables of injections
    #[arg(long, default_value = "../shared/data")]
    measured: PathBuf,
    /// Only make the tables of what the file of results holds
    #[arg(long)]
    tables_only: bool,
    /// Write the tables into this page, between its markers
    #[arg(long)]
    write: Option<PathBuf>,
}

fn range(text: &str) -> Result<Range<u64>, String> {
    let (first, end) = text.split_once("..").ok_or("write FIRST..END, as in 0..10")?;
    let number = |text: &str| text.parse::<u64>().map_err(|e| format!("{text}: {e}"));
    Ok(number(first)?..number(end)?)
}

/// Runs what is missing and prints the tables.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let mut outcomes = read(&arguments.results)?;
    if !arguments.tables_only {
        let done: HashSet<String> = outcomes.iter().map(|o| o.case.clone()).collect();
        if let Some(folder) = arguments.results.parent() {
            fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        }
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&arguments.results)
            .map_err(|e| format!("{}: {e}", arguments.results.display()))?;
        let tables = if arguments.table.is_empty() { Table::all() } else { arguments.table.clone() };
        let bench = experiment::Bench::new()?;
        let mut measured = BTreeMap::new();
        for table in tables {
            for case in Case::all(table, arguments.seeds.clone()) {
                let wanted =
                    arguments.kind.is_empty() || arguments.kind.iter().any(|k| case.kinds.contains(k));
                if !wanted || done.contains(&case.name()) {
                    continue;
                }
                let outcome = if table.measured() {
                    let key = (table == Table::MeasuredArms, case.folder);
                    if let Entry::Vacant(place) = measured.entry(key) {
                        place.insert(Measured::read(&arguments.measured, table, case.folder)?);
                    }
                    measured[&key].as_ref().map_or(Ok(None), |arm| arm.run(&case))?
                } else {
                    bench.run(&case)?
                };
                let Some(outcome) = outcome else { continue };
                println!("{}", outcome.line());
                let text = serde_json::to_string(&outcome).map_err(|e| e.to_string())?;
                writeln!(file, "{text}").map_err(|e| format!("{}: {e}", arguments.results.display()))?;
                outcomes.push(outcome);
            }
        }
    }
    let tables = page::tables(&outcomes);
    print!("{tables}");
    match &arguments.write {
        Some(path) => page::write(path, &tables),
        None => Ok(()),
    }
}

fn read(path: &PathBuf) -> Result<Vec<Outcome>, String> {
    let Ok(text) = fs::read_to_string(path) else { return Ok(Vec::new()) };
    let line = |(k, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|e| format!("{}: line {}: {e}", path.display(), k + 1))
    };
    text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()).map(line).collect()
}
