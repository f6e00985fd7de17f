//! Studies that take longer than tests may.

mod study;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Studies that take longer than tests may")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// How often `explain` gives the right name, where the truth is known
    Study(study::Arguments),
}

fn main() -> ExitCode {
    let Arguments { command: Command::Study(arguments) } = Arguments::parse();
    match study::run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}
