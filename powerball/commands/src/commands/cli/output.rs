//! Results on disk and on the terminal.

use super::{Failure, replace};
use crate::report::{Files, band_of, files};
use clap::Args;
use powerball_controller::JointNumber;
use powerball_identification::conventions::Conventions;
use powerball_identification::estimate::ResidualStats;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Whether `--quiet` was given to this process.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Switches [`print`] and [`notice`] off.
pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether [`print`] and [`notice`] are switched off.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// The target of events whose words stand on standard error anyhow: how far a computation has come, and how
/// it ended.
pub(super) const SHOWN: &str = "powerball::shown";

/// What a command is doing, on standard error: as it happens where a person looks at it, and as a table of
/// times at its end where `--timings` asks for one.
pub(crate) struct Progress {
    shown: bool,
    phases: Option<Mutex<Vec<Phase>>>,
}

/// What was being done from when on.
struct Phase {
    what: String,
    clock: Instant,
    processor: Duration,
}

impl Phase {
    fn from_now(what: &str) -> Phase {
        Phase { what: what.to_string(), clock: Instant::now(), processor: processor() }
    }
}

/// Processor time that this program has taken, all its threads together.
#[cfg(all(unix, feature = "cli"))]
fn processor() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.try_into().unwrap_or(0))
}

/// Processor time is not known here.
#[cfg(not(all(unix, feature = "cli")))]
fn processor() -> Duration {
    Duration::ZERO
}

impl Progress {
    pub(crate) fn new() -> Progress {
        Progress { shown: std::io::stderr().is_terminal() && !is_quiet(), phases: None }
    }

    /// As [`Self::new`], with times by phase on standard error when it ends.
    pub(crate) fn timed(timings: bool) -> Progress {
        let phases = timings.then(|| Mutex::new(vec![Phase::from_now("reading the arm file")]));
        Progress { phases, ..Progress::new() }
    }

    pub(crate) fn say(&self, what: &str) {
        if self.shown {
            eprintln!("  {what} …");
        }
        tracing::info!(target: SHOWN, "{what}");
        if let Some(mut phases) = self.phases.as_ref().and_then(|phases| phases.lock().ok()) {
            phases.push(Phase::from_now(what));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        let Some(mut phases) = self.phases.as_ref().and_then(|phases| phases.lock().ok()) else { return };
        phases.push(Phase::from_now(""));
        eprint!("{}", times(&phases));
    }
}

/// A table of phases: what lies between the start of each and of the next one.
fn times(phases: &[Phase]) -> String {
    let line = |clock: Duration, processor: Duration, what: &str| {
        format!("{:9.3} {:11.3}  {what}\n", clock.as_secs_f64(), processor.as_secs_f64())
    };
    let mut text = String::from("  clock s processor s  what\n");
    for (phase, next) in phases.iter().zip(phases.iter().skip(1)) {
        text.push_str(&line(
            next.clock - phase.clock,
            next.processor.saturating_sub(phase.processor),
            &phase.what,
        ));
    }
    if let (Some(first), Some(last)) = (phases.first(), phases.last()) {
        text.push_str(&line(
            last.clock - first.clock,
            last.processor.saturating_sub(first.processor),
            "in all",
        ));
    }
    text
}

/// Makes a folder for results, where it is missing; refused where files of their names in it are none of
/// them.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Failure> {
    replace::check_folder(folder)?;
    files::make_folder(folder).map_err(Failure::Unusable)
}

/// As [`make_folder`], for a command whose results are many files: refused where one of these names is there
/// and no page of this command. A first page is written, by which the command knows the folder as its own
/// after it was stopped.
#[cfg(feature = "cli")]
pub(crate) fn make_own_folder(
    folder: &Path,
    names: &[&str],
    title: &str,
    words: &str,
) -> Result<(), Failure> {
    replace::own_folder::check(folder, names)?;
    make_folder(folder)?;
    let mut page = crate::report::Page::new(title);
    page.paragraph(words);
    write(folder, "report.html", page.to_html().as_bytes())
}

/// Writes a file of a folder whole or not at all: a reader never sees half of it.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    write_file(&folder.join(name), bytes)
}

/// As [`write()`], for a path.
pub(crate) fn write_file(target: &Path, bytes: &[u8]) -> Result<(), Failure> {
    replace::check(target, Some(bytes))?;
    files::write_whole(target, bytes).map_err(Failure::Unusable)
}

/// Writes the files of a result into a folder.
pub(crate) fn write_all(result: &Files, folder: &Path) -> Result<(), Failure> {
    make_folder(folder)?;
    result.write(folder).map_err(Failure::Unusable)
}

/// Serialises a result.
pub(crate) fn json(value: &impl serde::Serialize) -> Result<String, Failure> {
    files::json(value).map_err(Failure::Refused)
}

/// How much a command prints.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Verbosity {
    /// Print more: what is done with the arm, on standard error, and every note and all evidence of a result.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Print nothing but errors and what --json, --word or --timings asks for: the exit code is the answer.
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

/// The line that stands for notes that are not printed; none where there are none.
pub(crate) fn notes(count: usize) -> Option<String> {
    match count {
        0 => None,
        1 => Some("1 note: --verbose or the page".to_string()),
        _ => Some(format!("{count} notes: --verbose or the page")),
    }
}

/// Whether a result that should not be used is taken nevertheless.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Accept {
    /// Exit with 0 instead of 3 if the result is unreliable: columns or arm file are not as declared, a joint
    /// does not move or is predicted no better than by its mean (docs/exit_codes.md).
    #[arg(long)]
    accept: bool,
}

impl Accept {
    /// The failure that a result is which should not be used, and why.
    pub(crate) fn judge(self, unusable: &[String]) -> Result<(), Failure> {
        match self.accept || unusable.is_empty() {
            true => Ok(()),
            false => Err(Failure::Doubtful(format!("{}; --accept takes it as it is", unusable.join("; ")))),
        }
    }
}

/// The first lines of a result: why it should not be used, and what there is to be reported about the columns
/// (`all` of it, or where they are not taken as they stand). That columns are wrong is the first reason, and
/// its line says how.
pub(crate) fn first_lines(unusable: &[String], columns: Option<&Conventions>, all: bool) -> Vec<String> {
    let differ = columns.is_some_and(Conventions::differ);
    let verdict = columns.filter(|c| all || c.is_remarkable()).map(Conventions::verdict);
    let others = unusable.get(usize::from(differ)..).unwrap_or_default();
    let others = (!others.is_empty()).then(|| format!("Do not use this result: {}.", others.join("; ")));
    let lines = if differ { [verdict, others] } else { [others, verdict] };
    lines.into_iter().flatten().collect()
}

/// Prints words for people on standard output, unless the command is quiet.
pub(crate) fn print(text: &str) {
    if !is_quiet() {
        data(text);
    }
}

/// Prints on standard output what another program reads; a closed pipe is no error.
pub(crate) fn data(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Prints words for people on standard error, unless the command is quiet.
pub(crate) fn notice(text: &str) {
    if !is_quiet() {
        eprintln!("{text}");
    }
}

/// The foot of a page: time (UTC), version and command.
pub(crate) fn signature() -> String {
    let now = jiff::Timestamp::now().strftime("%Y-%m-%d %H:%M UTC");
    format!("{now}, powerball {}: {}", env!("CARGO_PKG_VERSION"), command_line())
}

/// The command of this process, as it can be typed again.
pub(crate) fn command_line() -> String {
    typed(std::env::args())
}

fn typed(arguments: impl Iterator<Item = String>) -> String {
    let quoted = |word: String| match word.contains(|c: char| c.is_whitespace() || c == '\'') {
        true => format!("'{}'", word.replace('\'', "'\\''")),
        false => word,
    };
    let words = std::iter::once("powerball".to_string()).chain(arguments.skip(1).map(quoted));
    words.collect::<Vec<_>>().join(" ")
}

/// Errors by joint as a table with the band that they are in; several spreads side by side.
pub(crate) fn table(columns: &[(&str, &ResidualStats)]) -> String {
    let mut text = String::from("joint");
    for (name, _) in columns {
        text.push_str(&format!("  {name:>26}"));
    }
    text.push_str("  band, Hz");
    let joints = columns.iter().map(|(_, s)| s.rms.len()).max().unwrap_or(0);
    for j in 0..joints {
        text.push_str(&format!("\n{:>5}", JointNumber::from_index(j).number()));
        for (_, stats) in columns {
            let cell = format!("{:.4} N·m  {:5.1} %", stats.rms[j], 100.0 * stats.relative[j]);
            text.push_str(&format!("  {cell:>26}"));
        }
        let band = columns.iter().find_map(|(_, s)| s.band.get(j)).map_or(String::new(), |b| band_of(*b));
        text.push_str(&format!("  {band:>8}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_between_one_phase_and_the_next() {
        let start = Instant::now();
        let at = |what: &str, seconds, processor| Phase {
            what: what.to_string(),
            clock: start + Duration::from_millis(seconds),
            processor: Duration::from_millis(processor),
        };
        let text = times(&[at("reading", 0, 100), at("fitting", 250, 300), at("", 1250, 2200)]);
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(
            lines,
            [
                "    0.250       0.200  reading",
                "    1.000       1.900  fitting",
                "    1.250       2.100  in all"
            ]
        );
    }

    #[test]
    #[cfg(all(unix, feature = "cli"))]
    fn work_takes_processor_time() {
        let (before, began) = (processor(), Instant::now());
        while began.elapsed() < Duration::from_millis(30) {
            std::hint::spin_loop();
        }
        assert!(processor() > before);
    }

    #[test]
    fn a_page_says_when_and_how_it_was_made() {
        let words = ["/bin/powerball", "verify", "--out", "a b"].map(String::from);
        assert_eq!(typed(words.into_iter()), "powerball verify --out 'a b'");
        let signature = signature();
        let (head, _) = signature.split_once(" UTC, powerball ").unwrap();
        let (day, time) = head.split_once(' ').unwrap();
        assert_eq!((day.len(), time.len()), (10, 5), "{head}");
    }
}
