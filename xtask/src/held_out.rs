//! What the base model leaves of each log when it is fitted to the others, beside a plain model on the same rows.

use dyngen::Arm;
use faer::Mat;
use powerball::estimate::{FrictionLaw, Solver, solve_reduced, spread_of};
use powerball::log::read_logs;
use powerball::regression::{DataOptions, RigidBody};
use powerball::summary::{Octaves, Summary, Triangle};
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
    /// Bands to judge in, Hz
    #[arg(long, num_args = 1.., default_values_t = [DataOptions::default().cutoff])]
    band: Vec<f64>,
}

/// Sums of squares of errors and of torques of one log, by joint.
type Squares = Vec<(f64, f64)>;

/// Prints what is left of each joint's torque: log by log, their mean, and all samples together.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = Arm::read(&arguments.arm).map_err(|e| e.to_string())?;
    let body = RigidBody::new(&arm).map_err(|e| e.to_string())?;
    let (logs, _) = read_logs(&arguments.log, &arm).map_err(|e| e.to_string())?;
    let names: Vec<&str> = logs.iter().map(|l| l.file.rsplit('/').next().unwrap_or_default()).collect();
    for cutoff in &arguments.band {
        let options = DataOptions { cutoff: *cutoff, ..DataOptions::default() };
        let reduced = |log| {
            let mut summary = Summary::new(&body, &options);
            summary.push(&body, log, &options).map(|_| summary).map_err(|e| e.to_string())
        };
        let summaries = logs.iter().map(reduced).collect::<Result<Vec<Summary>, String>>()?;
        let (mut base, mut rival) = (Vec::new(), Vec::new());
        for (k, held_out) in summaries.iter().enumerate() {
            let mut others = Summary::new(&body, &options);
            for (_, other) in summaries.iter().enumerate().filter(|(other, _)| *other != k) {
                others.merge(other).map_err(|e| e.to_string())?;
            }
            let solution = solve_reduced(&others, FrictionLaw::Symmetric);
            let there = solution.on(held_out).map_err(|e| e.to_string())?;
            let spread = spread_of(&there, &there.theta);
            base.push(squares(held_out, &spread.rms));
            rival.push(squares(held_out, &Plain::fit(&others).rms(held_out)));
        }
        for (title, logs) in [
            ("Eq. 16", &base),
            ("rigid, rotors, Coulomb, viscous and constant friction, on the same rows", &rival),
        ] {
            println!("\n{title}: held-out error over torque by joint, 0 to {cutoff} Hz");
            table(&names, logs);
        }
    }
    Ok(())
}

fn squares(held_out: &Summary, rms: &[f64]) -> Squares {
    let torque = held_out.columns().torque();
    let of_joint = |(octaves, rms): (&Octaves, &f64)| {
        let power: f64 = octaves.total().column(torque).iter().map(|x| x * x).sum();
        (rms * rms * octaves.rows() as f64, power)
    };
    held_out.joints.iter().zip(rms).map(of_joint).collect()
}

fn table(names: &[&str], logs: &[Squares]) {
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

/// The plain model: linear, joints weighted by what they leave.
struct Plain {
    /// The minimal set, then viscous, constant and Coulomb friction by joint.
    theta: Vec<f64>,
}

/// Columns of its friction.
const FRICTION: usize = 3;

impl Plain {
    fn fit(summary: &Summary) -> Plain {
        let joints: Vec<Triangle> = summary.joints.iter().map(Octaves::total).collect();
        let p = summary.identity.parameters.len();
        let size = p + FRICTION * joints.len();
        let mut plain = Plain { theta: vec![0.0; size] };
        for _ in 0..4 {
            let rms = plain.rms(summary);
            let mut gram = Mat::<f64>::zeros(size, size);
            let mut right = vec![0.0; size];
            for (j, rows) in joints.iter().enumerate().filter(|(j, _)| rms[*j] > 0.0) {
                let weight = rms[j].powi(-2);
                let dot = |a: usize, b: usize| -> f64 {
                    rows.column(a).iter().zip(rows.column(b)).map(|(x, y)| x * y).sum()
                };
                let columns = columns(summary, j);
                for (a, at) in &columns {
                    right[*at] += weight * dot(*a, summary.columns().torque());
                    columns.iter().for_each(|(b, to)| gram[(*at, *to)] += weight * dot(*a, *b));
                }
            }
            plain.theta = Solver::new(&gram, |_| true).solve(&right);
        }
        plain
    }

    /// rms of what it leaves, by joint.
    fn rms(&self, summary: &Summary) -> Vec<f64> {
        let of_joint = |(j, octaves): (usize, &Octaves)| {
            let rows = octaves.total();
            let mut left = rows.column(summary.columns().torque()).to_vec();
            for (column, at) in columns(summary, j) {
                left.iter_mut().zip(rows.column(column)).for_each(|(l, c)| *l -= self.theta[at] * c);
            }
            (left.iter().map(|l| l * l).sum::<f64>() / rows.rows().max(1) as f64).sqrt()
        };
        summary.joints.iter().enumerate().map(of_joint).collect()
    }
}

/// The columns of a joint's rows that the plain model takes, and where their coefficients stand.
fn columns(summary: &Summary, joint: usize) -> Vec<(usize, usize)> {
    let (p, columns) = (summary.identity.parameters.len(), summary.columns());
    // The first node is the steepest: a step for all that is measurable.
    let friction = [columns.viscous(), columns.constant(), columns.node(0)];
    let friction = friction.into_iter().enumerate().map(|(k, c)| (c, p + FRICTION * joint + k));
    (0..p).map(|c| (c, c)).chain(friction).collect()
}
