//! `powerball excite`: from an arm file to a trajectory.

use super::Failure;
use super::output::{self, Progress};
use crate::excite::{Error, Excitation, Figures, Limits, Settings, optimise};
use crate::motion::Motion;
use clap::{Args, ValueEnum};
use dyngen::{Arm, Model, SetKind};
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

/// A parameter set on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
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

/// Search an exciting trajectory (Eq. 17 to 20) within the arm's limits and write it.
#[derive(Args, Debug)]
#[command(
    after_help = "Example: powerball excite --arm arm.toml --out path.csv --period 10 --harmonics 4\n\n\
    The file has the columns t, q1…qn, dq1…dqn, ddq1…ddqn in rad and s, from rest to rest."
)]
pub(crate) struct Excite {
    /// The arm file; every joint needs `position`, `velocity` and `acceleration` in it.
    #[arg(long)]
    arm: PathBuf,
    /// The parameter set whose regressor is to be well conditioned.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
    /// Where the trajectory is written, CSV.
    #[arg(long)]
    out: PathBuf,
    /// Duration of one period of the Fourier series, s.
    #[arg(long, default_value_t = 10.0)]
    period: f64,
    /// Harmonics of each joint.
    #[arg(long, default_value_t = 4)]
    harmonics: usize,
    /// How often the path is run through.
    #[arg(long, default_value_t = 2)]
    periods: usize,
    /// Share of range, speed and acceleration that stays unused.
    #[arg(long, default_value_t = 0.05)]
    margin: f64,
    /// Weight of 1/σ_min against the condition number.
    #[arg(long, default_value_t = 1.0)]
    weight: f64,
    /// How many paths are tried.
    #[arg(long, default_value_t = 2000)]
    evaluations: usize,
    /// Samples a second.
    #[arg(long, default_value_t = 200.0)]
    rate: f64,
    /// Seed of the search; the same seed finds the same path.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Prints one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl Excite {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if !(self.rate.is_finite() && self.rate > 0.0) {
            return Err(Failure::Unusable("--rate must be above 0".to_string()));
        }
        let progress = Progress::new();
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        for note in arm.notes() {
            eprintln!("powerball: {}: {note}", self.arm.display());
        }
        progress.say("deriving and proving the arm's regressor");
        let refused = |e: Error| match e {
            Error::Setting(what) => Failure::Unusable(what),
            other => Failure::Refused(other.to_string()),
        };
        let model = Model::derive(arm).map_err(|e| refused(e.into()))?;
        let settings = Settings {
            harmonics: self.harmonics,
            fundamental: std::f64::consts::TAU / self.period,
            periods: self.periods,
            margin: self.margin,
            lambda2: self.weight,
            evaluations: self.evaluations,
            seed: self.seed,
            ..Settings::default()
        };
        progress.say("searching");
        let found = optimise(&model, self.parameters.into(), &settings).map_err(refused)?;
        let motion = found.path.sample(self.rate);
        let limits = Limits::of(model.arm(), 0.0).map_err(|e| refused(e.into()))?;
        let (folder, name) = (self.out.parent(), self.out.file_name().and_then(|name| name.to_str()));
        let (Some(folder), Some(name)) = (folder, name) else {
            return Err(Failure::Unusable(format!("--out {} names no file", self.out.display())));
        };
        output::write(folder, name, motion.to_csv().as_bytes())?;
        let peaks = peaks(&motion);
        if self.json {
            output::print(&self.in_json(&found, &motion, &peaks));
        } else {
            output::print(self.in_words(&found, &motion, &peaks, &limits).trim_end());
        }
        Ok(())
    }

    fn in_json(&self, found: &Excitation, motion: &Motion, peaks: &[[f64; 4]]) -> String {
        let joints: Vec<_> = peaks
            .iter()
            .zip(&found.path.joints)
            .map(|([low, high, speed, acceleration], series)| {
                json!({"position": [low, high], "velocity": speed, "acceleration": acceleration,
                   "middle": series.middle, "a": series.a, "b": series.b})
            })
            .collect();
        let figures = |f: &Figures| json!({"condition": f.condition, "least_singular_value": f.least});
        let object = json!({
            "out": self.out, "samples": motion.len(), "duration": motion.duration(),
            "fundamental": found.path.fundamental, "figures": figures(&found.figures),
            "random_start": figures(&found.usual), "joints": joints,
        });
        object.to_string()
    }

    fn in_words(&self, found: &Excitation, motion: &Motion, peaks: &[[f64; 4]], limits: &Limits) -> String {
        let mut out = String::new();
        let (good, usual) = (&found.figures, &found.usual);
        let _ = writeln!(
            out,
            "{}: {} samples, {:.2} s from rest to rest\n\
         condition number of the regressor {:.2} (a random path: {:.1}), smallest singular value {:.3} ({:.3})\n",
            self.out.display(),
            motion.len(),
            motion.duration(),
            good.condition,
            usual.condition,
            good.least,
            usual.least
        );
        let _ = writeln!(
            out,
            "joint   position [rad]     of limit        speed  of limit   acceleration  of limit"
        );
        for (i, ([low, high, speed, acceleration], limit)) in peaks.iter().zip(&limits.0).enumerate() {
            let [lowest, highest] = limit.position;
            let _ = writeln!(
                out,
                "{:>5}  {low:>6.2} … {high:<6.2}  {lowest:>6.2} … {highest:<6.2}  {speed:>6.2}    {:>6.2}      {acceleration:>9.2}    {:>6.2}",
                i + 1,
                limit.velocity,
                limit.acceleration
            );
        }
        out
    }
}

/// Lowest and highest position, largest speed and acceleration of each joint.
fn peaks(motion: &Motion) -> Vec<[f64; 4]> {
    let mut peaks = vec![[f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0]; motion.dof()];
    for [q, dq, ddq] in motion.samples() {
        for (i, [low, high, speed, acceleration]) in peaks.iter_mut().enumerate() {
            *low = low.min(q[i]);
            *high = high.max(q[i]);
            *speed = speed.max(dq[i].abs());
            *acceleration = acceleration.max(ddq[i].abs());
        }
    }
    peaks
}
