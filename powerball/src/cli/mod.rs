//! The commands. Exit codes: 0 done, 1 the data or the arm refused it with the reason, 2 wrong use or unreadable
//! input.

mod excite;

use clap::{Parser, Subcommand, ValueEnum};
use dyngen::{Arm, Model, SetKind};
use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

/// Identification of robot arms: from exciting trajectories to named effects.
#[derive(Parser)]
#[command(version, after_help = "Example: powerball excite --arm arm.toml --out path.csv")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Searches an exciting trajectory within the arm's limits and writes it.
    Excite(excite::Args),
}

/// A parameter set on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum Set {
    /// Exact for the numbers in the file.
    Minimal,
    /// Exact for every size of the arm.
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
    let result = match Cli::parse().command {
        Command::Excite(args) => excite::run(&args),
    };
    match result {
        Ok(code) => code,
        Err(failure) => {
            eprintln!("{}", failure.message);
            ExitCode::from(failure.code)
        }
    }
}

/// Reads an arm and derives its model; what its author may not have meant goes to standard error.
fn model(path: &Path) -> Result<Model, Failure> {
    let arm = Arm::read(path).map_err(Failure::input)?;
    for note in arm.notes() {
        eprintln!("{}: note: {note}", path.display());
    }
    Model::derive(arm).map_err(Failure::refused)
}

/// Writes a file, or says why not.
fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text)
        .map_err(|e| Failure::input(format!("{} cannot be written: {e}", path.display())))
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
