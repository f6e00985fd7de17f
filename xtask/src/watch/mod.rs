//! How soon a watch sees a change and whether it names it right, how often it is wrong, and what it reports
//! about measured logs.

mod draw;
mod measured;
mod noise;
mod study;

use dyngen::Arm;
use powerball::explanation::torque_model::TorqueModel;
use powerball::explanation::watch::{Event, Watch, WatchOptions};
use powerball::explanation::{ExplainOptions, explain};
use powerball::logs::log::Log;
use powerball::logs::regression::RigidArm;
use std::path::PathBuf;

/// What is asked.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Changes of each kind on the virtual arm
    #[arg(long, default_value_t = 40)]
    draws: usize,
    /// Size of a change: rms of its torque over that of its joint
    #[arg(long, default_value_t = 0.05)]
    size: f64,
    /// Hours of simulated noise
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Draws everything
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The folder with measured logs; without it none is asked
    #[arg(long)]
    data: Option<PathBuf>,
}

/// Prints all tables.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    if let Some(data) = &arguments.data {
        measured::run(data)?;
    }
    if arguments.draws > 0 {
        study::run(arguments)?;
    }
    Ok(())
}

/// All events of a log.
fn events(body: &RigidArm, model: &TorqueModel, options: &WatchOptions, log: &Log) -> Vec<Event> {
    let mut watch = Watch::new(body, model, options, &log.file);
    let mut found: Vec<Event> = log.samples().flat_map(|sample| watch.push(&sample)).collect();
    found.extend(watch.finish());
    for note in watch.notes() {
        println!("  note: {note}");
    }
    found
}

/// The model that `explain` makes of logs, and the arm with it.
fn explained(arm: &Arm, fit: &[Log], validate: &[Log]) -> Result<(RigidArm, TorqueModel), String> {
    let found = explain(arm, fit, validate, &ExplainOptions::default()).map_err(|e| e.to_string())?;
    let changed = found.model.additions.arm_changes.of(arm).map_err(|e| e.to_string())?;
    let body = RigidArm::new(&changed).map_err(|e| e.to_string())?;
    for (j, colour) in found.model.colour.iter().flat_map(|colour| colour.joints.iter().enumerate()) {
        match colour {
            Some(c) => println!("joint {}: σ {:.4} N·m, margin {:.3}", j + 1, c.deviation, c.margin),
            None => println!("joint {}: not watched", j + 1),
        }
    }
    Ok((body, found.model))
}
