//! Results on disk and on the terminal.

use super::Failure;
use crate::controller::JointNumber;
use crate::identification::conventions::Conventions;
use crate::identification::estimate::ResidualStats;
use crate::report::files;
use clap::Args;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime};

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
#[cfg(unix)]
fn processor() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.try_into().unwrap_or(0))
}

/// Processor time is not known here.
#[cfg(not(unix))]
fn processor() -> Duration {
    Duration::ZERO
}

impl Progress {
    pub(crate) fn new() -> Progress {
        Progress { shown: std::io::stderr().is_terminal(), phases: None }
    }

    /// The same, with times by phase on standard error when it ends.
    pub(crate) fn timed(timings: bool) -> Progress {
        let phases = timings.then(|| Mutex::new(vec![Phase::from_now("reading the arm file")]));
        Progress { phases, ..Progress::new() }
    }

    pub(crate) fn say(&self, what: &str) {
        if self.shown {
            eprintln!("  {what} …");
        }
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

/// A line on standard error, where a person looks at it, that is written over by the next one: how far a motion has
/// come. A line feed ends it when nothing more is told.
pub(crate) fn live<T: std::fmt::Display>() -> impl FnMut(&T) {
    let mut line = Line { shown: std::io::stderr().is_terminal(), started: false };
    move |what| line.show(what)
}

struct Line {
    shown: bool,
    started: bool,
}

impl Line {
    fn show(&mut self, what: &impl std::fmt::Display) {
        if self.shown {
            self.started = true;
            let _ = write!(std::io::stderr(), "\r\x1b[K  {what}");
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if self.started {
            let _ = writeln!(std::io::stderr());
        }
    }
}

/// Makes a folder for results, where it is missing.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Failure> {
    files::make_folder(folder).map_err(Failure::Unusable)
}

/// Writes a file of a folder whole or not at all: a reader never sees half of it.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    write_file(&folder.join(name), bytes)
}

/// The same for a path.
pub(crate) fn write_file(target: &Path, bytes: &[u8]) -> Result<(), Failure> {
    files::write_whole(target, bytes).map_err(Failure::Unusable)
}

/// Serialises a result.
pub(crate) fn json(value: &impl serde::Serialize) -> Result<String, Failure> {
    files::json(value).map_err(Failure::Refused)
}

/// How much a command prints.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Verbosity {
    /// Print every note and all evidence.
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Print nothing but errors.
    #[arg(short, long, conflicts_with = "json")]
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

/// Whether a result that should not be built on is taken nevertheless.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Accept {
    /// End with 0 instead of 3 where columns or arm file are not what they are said to be, or a joint is predicted no
    /// better than by its mean.
    #[arg(long)]
    accept: bool,
}

impl Accept {
    /// The failure that such a result is. `useless` are the joints that are predicted no better than by their mean.
    pub(crate) fn judge(self, columns: Option<&Conventions>, useless: &[JointNumber]) -> Result<(), Failure> {
        let mut why: Vec<String> = Vec::new();
        if columns.is_some_and(Conventions::differ) {
            why.push("the columns or the arm file are not what they are said to be".to_string());
        }
        if !useless.is_empty() {
            let list: Vec<String> = useless.iter().map(ToString::to_string).collect();
            why.push(format!(
                "the torque of joint {} is predicted no better than by its mean",
                list.join(", ")
            ));
        }
        match self.accept || why.is_empty() {
            true => Ok(()),
            false => Err(Failure::Doubtful(format!("{}; --accept takes it as it is", why.join(", and ")))),
        }
    }
}

/// Prints to standard output; a closed pipe is no error.
pub(crate) fn print(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// The foot of a page: version, command and time (UTC).
pub(crate) fn signature(arguments: impl Iterator<Item = String>, now: SystemTime) -> String {
    let seconds = now.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let time = jiff::Timestamp::from_second(i64::try_from(seconds).unwrap_or(0)).unwrap_or_default();
    let quoted = |word: &String| match word.contains(|c: char| c.is_whitespace() || c == '\'') {
        true => format!("'{}'", word.replace('\'', "'\\''")),
        false => word.clone(),
    };
    let command: Vec<String> = arguments.skip(1).map(|word| quoted(&word)).collect();
    format!(
        "{} UTC, powerball {}: powerball {}",
        time.strftime("%Y-%m-%d %H:%M"),
        env!("CARGO_PKG_VERSION"),
        command.join(" ")
    )
}

/// Errors by joint as a table; several spreads side by side.
pub(crate) fn table(columns: &[(&str, &ResidualStats)]) -> String {
    let mut text = String::from("joint");
    for (name, _) in columns {
        text.push_str(&format!("  {name:>26}"));
    }
    let joints = columns.iter().map(|(_, s)| s.rms.len()).max().unwrap_or(0);
    for j in 0..joints {
        text.push_str(&format!("\n{:>5}", JointNumber::from_index(j).number()));
        for (_, stats) in columns {
            let cell = format!("{:.4} N·m  {:5.1} %", stats.rms[j], 100.0 * stats.relative[j]);
            text.push_str(&format!("  {cell:>26}"));
        }
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
    #[cfg(unix)]
    fn work_takes_processor_time() {
        let (before, began) = (processor(), Instant::now());
        while began.elapsed() < Duration::from_millis(30) {
            std::hint::spin_loop();
        }
        assert!(processor() > before);
    }

    /// Times by `date -u -d @SECONDS`.
    #[test]
    fn a_page_says_when_and_how_it_was_made() {
        let signed = |seconds| {
            let words = ["/bin/powerball", "verify", "--out", "a b"].map(String::from);
            signature(words.into_iter(), SystemTime::UNIX_EPOCH + Duration::from_secs(seconds))
        };
        let rest = format!("UTC, powerball {}: powerball verify --out 'a b'", env!("CARGO_PKG_VERSION"));
        for (seconds, time) in [
            (0, "1970-01-01 00:00"),
            (951_782_399, "2000-02-28 23:59"),
            (951_868_800, "2000-03-01 00:00"),
            (1_709_208_000, "2024-02-29 12:00"),
            (4_107_542_400, "2100-03-01 00:00"),
        ] {
            assert_eq!(signed(seconds), format!("{time} {rest}"));
        }
    }
}
