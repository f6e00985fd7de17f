//! The commands. Exit codes: 0 done, 1 refused with the reason, 2 wrong use or unreadable input.

mod check;
mod describe;
mod digits;
mod eval;
mod export;
mod generate;
mod import;
mod inspect;
mod shell;
mod verify;

use clap::{Parser, Subcommand, ValueEnum};
use dyngen::base::SetKind;
use dyngen::{Arm, Model};
use std::fmt::Display;
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// From a DH table to the dynamics of a robot arm: exact base parameters and allocation-free Rust, proven
/// equal to the Lagrangian.
#[derive(Parser)]
#[command(version, after_help = "Example: dyngen describe arm.toml && dyngen generate arm.toml -o arm.rs")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Exit with 0 instead of 3 if the arm file cannot be an arm, such as links in millimetres.
    #[arg(long, global = true)]
    accept: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Kinematics, parameters with their class, the sets with their relations, operation counts.
    Describe(describe::Args),
    /// Writes the arm's functions as source code: Rust, C, CUDA or WGSL.
    Generate(generate::Args),
    /// Makes an arm file, with inertial values next to it, from a serial chain of a URDF.
    Import(import::Args),
    /// Writes identified values into a copy of the file that an arm was imported from.
    Export(export::Args),
    /// Shows a function's expressions after a pass of the optimiser, with what each pass costs.
    Inspect(inspect::Args),
    /// Evaluates a function at the states of a CSV file.
    Eval(eval::Args),
    /// Says whether a real arm can have given parameter values, and shows the pose where not.
    Check(check::Args),
    /// Proves what is printed in a generated file equal to the Lagrangian of its arm.
    Verify(verify::Args),
    /// Prints what completes this program's words in a shell.
    Completions(shell::Completions),
    /// Writes man pages of this program and its commands.
    Man(shell::Man),
}

/// A parameter set on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum Set {
    /// Exact for the numbers in the file.
    Minimal,
    /// Exact for every size of the arm; pins of bars are numbers.
    Symbolic,
    /// The file's [[grouping]].
    Published,
    /// Every parameter that the symmetries leave.
    Full,
}

impl From<Set> for SetKind {
    fn from(set: Set) -> Self {
        match set {
            Set::Minimal => SetKind::Minimal,
            Set::Symbolic => SetKind::Symbolic,
            Set::Published => SetKind::Published,
            Set::Full => SetKind::Full,
        }
    }
}

/// Why a command ended without its result.
struct Failure {
    code: u8,
    message: String,
}

impl Failure {
    /// The input was read, but the answer is no.
    fn refused(message: impl Display) -> Self {
        Failure { code: 1, message: message.to_string() }
    }

    /// Wrong use, or an input that cannot be read.
    fn input(message: impl Display) -> Self {
        Failure { code: 2, message: message.to_string() }
    }
}

/// Runs the command line.
pub(crate) fn main() -> ExitCode {
    let Cli { command, accept } = Cli::parse();
    let result = match command {
        Command::Describe(args) => describe::run(&args),
        Command::Generate(args) => generate::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
    };
    match result {
        // What was written is of no arm, as was reported.
        Ok(code) if code == ExitCode::SUCCESS && DOUBTFUL.load(Ordering::Relaxed) && !accept => {
            ExitCode::from(3)
        }
        Ok(code) => code,
        Err(failure) => {
            eprintln!("{}", failure.message);
            ExitCode::from(failure.code)
        }
    }
}

/// Whether an arm that was read can be none: then no result of it should be used.
static DOUBTFUL: AtomicBool = AtomicBool::new(false);

/// Reads an arm; what its author may not have meant goes to standard error.
fn arm(path: &Path) -> Result<Arm, Failure> {
    let arm = Arm::read(path).map_err(Failure::input)?;
    for doubt in arm.doubts() {
        DOUBTFUL.store(true, Ordering::Relaxed);
        eprintln!("{}: do not use this result: {doubt}; --accept takes it as it is", path.display());
    }
    for note in arm.notes() {
        eprintln!("{}: note: {note}", path.display());
    }
    Ok(arm)
}

/// Reads an arm and derives its model; what that costs is reported where a person waits for it.
fn model(path: &Path) -> Result<Model, Failure> {
    let arm = arm(path)?;
    let progress = Progress::new(&arm);
    progress.say("deriving the parameter sets");
    Model::derive(arm).map_err(Failure::refused)
}

/// A line on standard error that says what is being done, where a person looks at it.
struct Progress {
    /// What the arm is and how long it may take; none where nobody looks.
    what: Option<String>,
}

impl Progress {
    fn new(arm: &Arm) -> Progress {
        let n = arm.links();
        let general = arm.joints.iter().filter(|joint| joint.alpha.quarter_turns().is_none()).count();
        // Of arms of 2 to 20 joints in both conventions.
        let seconds = 0.012 * (n * n) as f64 * (1.0 + general as f64 / 9.0);
        let what = format!("{n} joints, {general} general twists, about {:.0} s", seconds.ceil());
        Progress { what: std::io::stderr().is_terminal().then_some(what) }
    }

    fn say(&self, step: &str) {
        if let Some(what) = &self.what {
            eprint!("\r\x1b[K{what}: {step} …");
        }
    }
}

/// The line is gone when its work is done.
impl Drop for Progress {
    fn drop(&mut self) {
        if self.what.is_some() {
            eprint!("\r\x1b[K");
        }
    }
}

/// Whether two paths lead to one file that is there.
fn same_file(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Writes to standard output; a reader that went away is no error.
fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::input(format!("standard output cannot be written: {e}")))
        }
        _ => Ok(()),
    }
}
