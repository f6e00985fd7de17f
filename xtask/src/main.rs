//! Studies that take longer than tests may.

mod compare;
mod conventions;
mod held_out;
mod known_truth;
mod stories;
mod study;
mod subsets;
mod textbook;
mod watch;

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
    /// What the columns of logs are taken to be
    Conventions(conventions::Arguments),
    /// How often `explain` gives the right name, where the truth is known
    Study(study::Arguments),
    /// How often names with such evidence are right: fits the curve, and judges it on cases that were not
    /// fitted
    Probability(study::ProbabilityArguments),
    /// Logs with known truth as files, and the score of any program that explains them
    Benchmark(study::BenchmarkArguments),
    /// What the base model leaves of each log when it is fitted to the others
    HeldOut(held_out::Arguments),
    /// What a textbook's fit leaves of other logs, and how `explain` compares
    Textbook(textbook::Arguments),
    /// How often `compare` calls equal arms different, and sees what changed
    Compare(compare::Arguments),
    /// What `explain` reports about measured logs in which others, or a draw, put something, as a page
    KnownTruth(known_truth::Arguments),
    /// Whether names that three logs give are taken back by all of them
    Subsets(subsets::Arguments),
    /// What `explain` finds in the measured logs, case by case, as a page with figures
    Stories(stories::Arguments),
    /// How soon `watch` sees a change, whether it names it right, and how often it is wrong
    Watch(watch::Arguments),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Conventions(arguments) => conventions::run(&arguments),
        Command::Study(arguments) => study::run(&arguments),
        Command::Probability(arguments) => study::probability(&arguments),
        Command::Benchmark(arguments) => study::benchmark(&arguments),
        Command::HeldOut(arguments) => held_out::run(&arguments),
        Command::Textbook(arguments) => textbook::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::KnownTruth(arguments) => known_truth::run(&arguments),
        Command::Subsets(arguments) => subsets::run(&arguments),
        Command::Stories(arguments) => stories::run(&arguments),
        Command::Watch(arguments) => watch::run(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}
