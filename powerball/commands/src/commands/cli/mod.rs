//! The `powerball` command: one file a subcommand.
//!
//! With the feature `offline` alone it has what needs files and nothing else, and runs in a browser.

mod compare;
#[cfg(feature = "cli")]
mod events;
mod excite;
mod explain;
mod export;
mod exported_arm;
mod fmu;
mod generate;
mod identify;
mod inputs;
mod log;
#[cfg(feature = "cli")]
mod log_with_model;
#[cfg(feature = "cli")]
mod online;
mod output;
mod replace;
mod servos;
#[cfg(feature = "cli")]
mod shell;
mod summarize;
mod verify;

use clap::{Parser, Subcommand};
use powerball_identification::IdentifyError;
use std::process::ExitCode;

/// Identify a robot arm's torque model from logs, and explain what it lacks.
#[derive(Debug, Parser)]
#[command(name = "powerball", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    verbosity: output::Verbosity,
    #[cfg(feature = "cli")]
    #[command(flatten)]
    events: events::Events,
    /// Write over files that this command may not have made, and over logs.
    #[arg(long, global = true)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[cfg(feature = "cli")]
    #[command(flatten)]
    Online(online::Command),
    /// Show what is in log files and what they are taken to be.
    Log(log::LogCommand),
    /// Search an exciting trajectory within the arm's limits and write it.
    Excite(excite::Excite),
    /// Fit the minimal inertial set and the friction of every joint to logs.
    Identify(identify::Identify),
    /// Find the nearest parameters that a real arm can have to given values.
    Consistent(identify::ConsistentCommand),
    /// Reduce logs to triangular factors, which `identify` takes in place of the logs.
    Summarize(summarize::Summarize),
    /// Judge an identified model on logs that it has not seen.
    Verify(verify::Verify),
    /// Compare two fits: what differs significantly, the difference in torque, and why.
    Compare(compare::Compare),
    /// Find, name and add what the model lacks on logs; judged on another path.
    Explain(explain::Explain),
    /// Write a model with its effects as one Rust file for a controller.
    Generate(generate::Generate),
    /// Write what was found in another program's form: a load for a robot's controller, the arm for a
    /// simulator.
    Export(export::Export),
    #[cfg(feature = "cli")]
    /// Print what completes this program's words in a shell.
    Completions(shell::Completions),
    #[cfg(feature = "cli")]
    /// Write man pages of this program and its commands.
    Man(shell::Man),
}

impl Cli {
    /// Runs the command; what happens meanwhile is seen where `--events` says.
    fn run(self) -> Result<(), Failure> {
        #[cfg(feature = "cli")]
        let _written_before_the_end = {
            // Where signals cannot be listened to, a limit ends the program as it does any other.
            let _ = powerball_bus::transport::file_limit_is_an_error();
            self.events.listen(self.verbosity)?
        };
        tracing::info!(target: output::SHOWN, version = env!("CARGO_PKG_VERSION"), "{}", output::command_line());
        let done = self.command.run(self.verbosity);
        record_end(&done);
        done
    }
}

impl Command {
    fn run(self, verbosity: output::Verbosity) -> Result<(), Failure> {
        match self {
            #[cfg(feature = "cli")]
            Command::Online(command) => command.run(),
            Command::Log(command) => command.run(),
            Command::Excite(command) => command.run(),
            Command::Identify(command) => command.run(verbosity),
            Command::Consistent(command) => command.run(),
            Command::Summarize(command) => command.run(),
            Command::Verify(command) => command.run(),
            Command::Compare(command) => command.run(),
            Command::Explain(command) => command.run(verbosity),
            Command::Generate(command) => command.run(),
            Command::Export(command) => command.run(),
            #[cfg(feature = "cli")]
            Command::Completions(command) => command.run(),
            #[cfg(feature = "cli")]
            Command::Man(command) => command.run(),
        }
    }
}

/// The last event: how it ended. A person reads it on standard error anyhow.
fn record_end(done: &Result<(), Failure>) {
    match done {
        Ok(()) => tracing::info!(target: output::SHOWN, exit = 0, "done"),
        Err(failure @ Failure::Negative) => {
            tracing::info!(target: output::SHOWN, exit = failure.code(), "done")
        }
        Err(failure @ Failure::Doubtful(reason)) => {
            tracing::warn!(target: output::SHOWN, exit = failure.code(), "{reason}");
        }
        Err(failure) => tracing::error!(target: output::SHOWN, exit = failure.code(), "{}", failure.reason()),
    }
}

/// Why a command did not do what it was asked for.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The data or the arm refused it: exit code 1.
    Refused(String),
    /// Wrong use or unreadable input: exit code 2.
    Unusable(String),
    /// The result is written and should not be built on: exit code 3.
    Doubtful(String),
    /// What was asked is not so, and that was printed: exit code 1.
    #[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "`watch` alone answers so"))]
    Negative,
}

impl Failure {
    /// The exit code.
    fn code(&self) -> u8 {
        match self {
            Failure::Refused(_) | Failure::Negative => 1,
            Failure::Unusable(_) => 2,
            Failure::Doubtful(_) => 3,
        }
    }

    /// Why; empty where that was printed.
    pub(crate) fn reason(&self) -> &str {
        match self {
            Failure::Refused(reason) | Failure::Unusable(reason) | Failure::Doubtful(reason) => reason,
            Failure::Negative => "",
        }
    }
}

impl From<IdentifyError> for Failure {
    fn from(e: IdentifyError) -> Self {
        if e.is_input() { Failure::Unusable(e.to_string()) } else { Failure::Refused(e.to_string()) }
    }
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    // clap itself exits with 2 on wrong use.
    let cli = Cli::parse();
    crate::report::sign(output::signature());
    if cli.force {
        replace::replace_all();
    }
    if cli.verbosity.quiet {
        output::be_quiet();
    }
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.reason().is_empty() {
                eprintln!("powerball: {}", failure.reason());
            }
            ExitCode::from(failure.code())
        }
    }
}
