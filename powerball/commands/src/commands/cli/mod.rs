//! The `powerball` command: one file a subcommand.

mod bus;
mod compare;
mod demo;
mod envelope;
mod events;
mod excite;
mod explain;
mod export;
mod exported_arm;
mod float;
mod fmu;
mod follow;
mod friction;
mod generate;
mod identify;
mod inputs;
mod listen;
mod live_server;
mod log;
mod model_on_bus;
mod output;
mod profile;
mod record;
mod replace;
mod serve;
mod servos;
mod shell;
mod summarize;
mod verify;
mod virtual_arm;
mod warm_up;
mod watch;

use clap::{Parser, Subcommand};
use events::Events;
use powerball_identification::IdentifyError;
use std::process::ExitCode;

/// Identify a robot arm's torque model from logs, and explain what it lacks.
#[derive(Debug, Parser)]
#[command(name = "powerball", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    events: Events,
    /// Write over files that this command may not have made, and over logs.
    #[arg(long, global = true)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The whole loop on the built-in virtual arm: record, identify, explain, compare with the truth.
    Demo(demo::DemoCommand),
    /// Look at the drives on a CAN bus, read and write their objects, enable, stop and move them.
    Bus(bus::BusCommand),
    /// Put the virtual arm on a bus for others.
    VirtualArm(virtual_arm::VirtualArmCommand),
    /// Follow a trajectory on a bus and log it.
    Record(record::RecordCommand),
    /// Follow a trajectory with a torque model; tracking error with it and with a base model. Never run on hardware.
    Follow(follow::FollowCommand),
    /// Take weight and friction off the hand that guides the arm. Never run on hardware.
    Float(float::FloatCommand),
    /// Swing the arm until its friction has settled.
    WarmUp(warm_up::WarmUp),
    /// Measure every joint's friction at constant velocities and fit its law.
    Friction(friction::Friction),
    /// Make an arm's constant tables for the bus driver from its drives' DCF and one TOML.
    Profile(profile::ProfileCommand),
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
    /// Write what was found in another program's form: a load for a robot's controller, the arm for a simulator.
    Export(export::Export),
    /// Report when a model no longer holds, along logs or a stream: since when, on which joints and why.
    Watch(watch::WatchCommand),
    /// Print what completes this program's words in a shell.
    Completions(shell::Completions),
    /// Write man pages of this program and its commands.
    Man(shell::Man),
}

impl Command {
    fn run(self, verbosity: output::Verbosity) -> Result<(), Failure> {
        match self {
            Command::Demo(command) => command.run(),
            Command::Bus(command) => command.run(),
            Command::VirtualArm(command) => command.run(),
            Command::Record(command) => command.run(),
            Command::Follow(command) => command.run(),
            Command::Float(command) => command.run(),
            Command::WarmUp(command) => command.run(),
            Command::Friction(command) => command.run(),
            Command::Profile(command) => command.run(),
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
            Command::Watch(command) => command.run(),
            Command::Completions(command) => command.run(),
            Command::Man(command) => command.run(),
        }
    }
}

/// The last event: how it ended. A person reads it on standard error anyhow.
fn record_end(done: &Result<(), Failure>) {
    match done {
        Ok(()) => tracing::info!(target: events::SHOWN, exit = 0, "done"),
        Err(failure @ Failure::Negative) => {
            tracing::info!(target: events::SHOWN, exit = failure.code(), "done")
        }
        Err(failure @ Failure::Doubtful(reason)) => {
            tracing::warn!(target: events::SHOWN, exit = failure.code(), "{reason}");
        }
        Err(failure) => tracing::error!(target: events::SHOWN, exit = failure.code(), "{}", failure.reason()),
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
    // Where signals cannot be listened to, a limit ends the program as it does any other.
    let _ = powerball_bus::transport::file_limit_is_an_error();
    if cli.force {
        replace::replace_all();
    }
    let listening = cli.events.listen();
    tracing::info!(target: events::SHOWN, version = env!("CARGO_PKG_VERSION"), "{}", output::command_line());
    let done = listening.and_then(|guards| {
        let done = cli.command.run(cli.events.verbosity());
        record_end(&done);
        // All lines are written before the program ends.
        drop(guards);
        done
    });
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.reason().is_empty() {
                eprintln!("powerball: {}", failure.reason());
            }
            ExitCode::from(failure.code())
        }
    }
}
