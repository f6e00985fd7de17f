//! A textbook's fit: rigid body, rotors, Coulomb, viscous and constant friction by least squares. Whatever is
//! explained must predict other logs at least as well.

use dyngen::Arm;
use faer::Mat;
use powerball::identification::estimate::{Solver, reduce_in_bands};
use powerball::logs::log::{Log, read_logs};
use powerball::logs::regression::{DataOptions, RigidArm};
use powerball::logs::summary::{Bands, Octaves, RFactor, Summary};
use std::fs;
use std::path::PathBuf;

/// Which logs, and what is compared.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The arm file
    #[arg(long)]
    arm: PathBuf,
    /// Logs to fit
    #[arg(long, num_args = 1.., required = true)]
    log: Vec<PathBuf>,
    /// Logs to judge on
    #[arg(long, num_args = 1.., required = true)]
    validate: Vec<PathBuf>,
    /// An explained.json of the same logs, whose errors are set next to these
    #[arg(long)]
    explained: Option<PathBuf>,
}

/// Prints what the fit leaves of each joint's torque on the logs to judge on, up to 10 Hz.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = Arm::read(&arguments.arm).map_err(|e| e.to_string())?;
    let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
    let read = |paths: &[PathBuf]| read_logs(paths, &arm).map(|(logs, _)| logs).map_err(|e| e.to_string());
    let textbook = held_out(&body, &read(&arguments.log)?, &read(&arguments.validate)?)?;
    let line = |name: &str, values: &[f64]| {
        // A joint that says nothing has no error.
        let percent =
            |v: &f64| if v.is_finite() { format!("{:6.1}", 100.0 * v) } else { format!("{:>6}", "-") };
        let values: Vec<String> = values.iter().map(percent).collect();
        println!("{name:<28}{} %", values.join(" "));
    };
    line("textbook, held out", &textbook);
    let Some(path) = &arguments.explained else { return Ok(()) };
    let explained = relative(path)?;
    if explained.len() != textbook.len() {
        let (there, here) = (explained.len(), textbook.len());
        return Err(format!("{}: has errors of {there} joints, the arm has {here}", path.display()));
    }
    line("explained, held out", &explained);
    let mut ratios: Vec<f64> = explained.iter().zip(&textbook).map(|(e, t)| e / t).collect();
    line("explained over textbook", &ratios);
    ratios.retain(|r| r.is_finite());
    ratios.sort_by(f64::total_cmp);
    if let Some(median) = ratios.get(ratios.len() / 2) {
        println!("median joint {:.0} %, worst {:.0} %", 100.0 * median, 100.0 * ratios[ratios.len() - 1]);
    }
    Ok(())
}

/// What the fit to some logs leaves of others, as shares of torque, by joint.
pub(crate) fn held_out(body: &RigidArm, logs: &[Log], validate: &[Log]) -> Result<Vec<f64>, String> {
    let summary = |logs: &[Log]| -> Result<Summary, String> {
        let mut all = Bands::new(body, &DataOptions::default());
        for log in logs {
            let (bands, _) =
                reduce_in_bands(body, log, &DataOptions::default()).map_err(|e| e.to_string())?;
            all.merge(&bands).map_err(|e| e.to_string())?;
        }
        Ok(all.of_joints(&vec![0; body.arm().dof()]))
    };
    let left = Plain::fit(&summary(logs)?).squares(&summary(validate)?);
    Ok(left.iter().map(|(error, torque)| (error / torque).sqrt()).collect())
}

/// The held-out errors of an explained.json, as shares of torque, by joint.
fn relative(path: &PathBuf) -> Result<Vec<f64>, String> {
    let failed = |e: String| format!("{}: {e}", path.display());
    let text = fs::read_to_string(path).map_err(|e| failed(e.to_string()))?;
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
    let shares = json["after"]["validate"]["relative"].as_array();
    let shares = shares.ok_or_else(|| failed("has no after.validate.relative".into()))?;
    Ok(shares.iter().map(|share| share.as_f64().unwrap_or(f64::NAN)).collect())
}

/// Sums of squares of errors and of torques of one log, by joint.
pub(crate) type Squares = Vec<(f64, f64)>;

/// The plain model: linear, joints weighted by what they leave.
pub(crate) struct Plain {
    /// The minimal set, then viscous, constant and Coulomb friction by joint.
    theta: Vec<f64>,
}

/// Columns of its friction.
const FRICTION: usize = 3;

impl Plain {
    pub(crate) fn fit(summary: &Summary) -> Plain {
        let (p, torque) = (summary.identity.parameters.len(), summary.columns().torque());
        let size = p + FRICTION * summary.joints.len();
        let joints: Vec<RFactor> = summary.joints.iter().map(Octaves::total).collect();
        let mut plain = Plain { theta: vec![0.0; size] };
        for _ in 0..4 {
            let (mut gram, mut right) = (Mat::<f64>::zeros(size, size), vec![0.0; size]);
            let left = plain.squares(summary);
            for (j, rows) in joints.iter().enumerate().filter(|(j, _)| left[*j].0 > 0.0) {
                let weight = rows.rows() as f64 / left[j].0;
                let dot = |a: usize, b: usize| -> f64 {
                    rows.column(a).iter().zip(rows.column(b)).map(|(x, y)| x * y).sum()
                };
                let columns = columns(summary, j);
                for (a, at) in &columns {
                    right[*at] += weight * dot(*a, torque);
                    columns.iter().for_each(|(b, to)| gram[(*at, *to)] += weight * dot(*a, *b));
                }
            }
            plain.theta = Solver::new(&gram, |_| true).solve(&right);
        }
        plain
    }

    /// What it leaves of a summary's rows.
    pub(crate) fn squares(&self, summary: &Summary) -> Squares {
        let of_joint = |(j, octaves): (usize, &Octaves)| {
            let rows = octaves.total();
            let torque = rows.column(summary.columns().torque());
            let mut left = torque.to_vec();
            for (column, at) in columns(summary, j) {
                left.iter_mut().zip(rows.column(column)).for_each(|(l, c)| *l -= self.theta[at] * c);
            }
            let sum = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
            (sum(&left), sum(torque))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_read_by_joint_and_what_lacks_them_is_reported() {
        let file = std::env::temp_dir().join(format!("textbook_{}.json", std::process::id()));
        fs::write(&file, r#"{"after": {"validate": {"relative": [0.25, null]}}}"#).unwrap();
        let read = relative(&file).unwrap();
        assert!(read[0] == 0.25 && read[1].is_nan(), "{read:?}");
        fs::write(&file, r#"{"after": {}}"#).unwrap();
        let why = relative(&file).unwrap_err();
        fs::remove_file(&file).unwrap();
        assert!(why.contains("textbook_") && why.contains("after.validate.relative"), "{why}");
    }
}
