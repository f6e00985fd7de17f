//! What the base model leaves of each log when it is fitted to the others, compared with a plain model on the
//! same rows.

use super::textbook::{Plain, Squares};
use dyngen::Arm;
use powerball::identification::estimate::{
    FrictionKind, ResidualStats, reduce_in_bands, solve_in_band, solve_reduced, stats_of,
};
use powerball::logs::log::read_logs;
use powerball::logs::regression::{DataOptions, RigidArm};
use powerball::logs::summary::{BANDS, Bands, Octaves, Powers, Summary};
use std::path::PathBuf;

/// Which logs, and how they are seen.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The arm file
    #[arg(long)]
    arm: PathBuf,
    /// The logs: each is held out once
    #[arg(long, num_args = 2.., required = true)]
    log: Vec<PathBuf>,
}

/// Prints what is left of each joint's torque: log by log, their mean, and all samples together.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = Arm::read(&arguments.arm).map_err(|e| e.to_string())?;
    let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
    let (logs, _) = read_logs(&arguments.log, &arm).map_err(|e| e.to_string())?;
    let names: Vec<String> =
        logs.iter().map(|l| l.file.rsplit('/').next().unwrap_or_default().to_string()).collect();
    let reduced = |log| {
        let reduced = reduce_in_bands(&body, log, &DataOptions::default());
        reduced.map(|(bands, _)| bands).map_err(|e| e.to_string())
    };
    let logs = logs.iter().map(reduced).collect::<Result<Vec<Bands>, String>>()?;
    let mut tables: Vec<[Vec<Squares>; 2]> = vec![Default::default(); BANDS.len() + 1];
    println!(
        "In each octave between bands, the model's power over that of what it leaves, by joint; and the \
            bands' ends"
    );
    for (k, held_out) in logs.iter().enumerate() {
        let mut others = Bands::new(&body, &DataOptions::default());
        for (_, other) in logs.iter().enumerate().filter(|(other, _)| *other != k) {
            others.merge(other).map_err(|e| e.to_string())?;
        }
        let asked = solve_in_band(&others, FrictionKind::Symmetric).bands;
        print_row(&names[k], &others, &asked);
        let common = (0..BANDS.len()).map(|band| vec![band; arm.dof()]);
        for (bands, [base, rival]) in std::iter::once(asked).chain(common).zip(&mut tables) {
            let (others, held_out) = (others.of_joints(&bands), held_out.of_joints(&bands));
            let solution = solve_reduced(&others, FrictionKind::Symmetric);
            let there = solution.on(&held_out).map_err(|e| e.to_string())?;
            base.push(squares(&stats_of(&there, &there.theta), &held_out));
            rival.push(Plain::fit(&others).squares(&held_out));
        }
    }
    let titles = std::iter::once("the bands that the fitted logs ask for".to_string())
        .chain(BANDS.iter().map(|band| format!("0 to {band} Hz")));
    for (title, [base, rival]) in titles.zip(&tables) {
        println!("\nHeld-out error over torque by joint, {title}: Eq. 16");
        table(&names, base);
        println!("The same rows, plain: rigid body, rotors, Coulomb, viscous and constant friction");
        table(&names, rival);
    }
    Ok(())
}

/// Prints what the bands were chosen by.
fn print_row(name: &str, others: &Bands, asked: &[usize]) {
    for octave in 0..BANDS.len() - 1 {
        let ratio = |powers: &Powers| format!("{:5.1}", powers[octave][0] / powers[octave][1]);
        let ratios: Vec<String> = others.spectrum().iter().map(ratio).collect();
        println!(
            "without {name:<16}{:>4} to {:>2} Hz: {}",
            BANDS[octave + 1],
            BANDS[octave],
            ratios.join(" ")
        );
    }
    let ends: Vec<String> = asked.iter().map(|band| format!("{:5}", BANDS[*band])).collect();
    println!("{:<40}{} Hz", "", ends.join(" "));
}

fn squares(spread: &ResidualStats, held_out: &Summary) -> Squares {
    let joints = spread.rms.iter().zip(&spread.relative).zip(&held_out.joints);
    let of_joint = |((rms, share), octaves): ((&f64, &f64), &Octaves)| {
        let rows = octaves.rows() as f64;
        (rows * rms * rms, rows * (rms / share).powi(2))
    };
    joints.map(of_joint).collect()
}

fn table(names: &[String], logs: &[Squares]) {
    let line = |name: &str, share: &dyn Fn(usize) -> f64| {
        let shares: Vec<String> = (0..logs[0].len()).map(|j| format!("{:5.1} %", 100.0 * share(j))).collect();
        println!("{name:<24}{}", shares.join(" "));
    };
    let share = |log: &Squares, j: usize| (log[j].0 / log[j].1).sqrt();
    for (name, log) in names.iter().zip(logs) {
        line(name, &|j| share(log, j));
    }
    line("mean of the logs", &|j| logs.iter().map(|log| share(log, j)).sum::<f64>() / logs.len() as f64);
    line("all samples together", &|j| {
        let sum = |of: fn(&(f64, f64)) -> f64| logs.iter().map(|log| of(&log[j])).sum::<f64>();
        (sum(|s| s.0) / sum(|s| s.1)).sqrt()
    });
}
