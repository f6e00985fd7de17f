//! `powerball excite`.

use super::{Failure, Set};
use powerball::excite::{Error, Excitation, Limits, Settings, optimise};
use powerball::motion::Motion;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `powerball excite`.
#[derive(clap::Args)]
#[command(
    after_help = "Example: powerball excite --arm arm.toml --out path.csv --period 10 --harmonics 4\n\n\
    The file has the columns t, q1…qn, dq1…dqn, ddq1…ddqn in rad and s, from rest to rest."
)]
pub(super) struct Args {
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

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    if !(args.rate.is_finite() && args.rate > 0.0) {
        return Err(Failure::input("--rate must be above 0"));
    }
    let model = super::model(&args.arm)?;
    let settings = Settings {
        harmonics: args.harmonics,
        fundamental: std::f64::consts::TAU / args.period,
        periods: args.periods,
        margin: args.margin,
        lambda2: args.weight,
        evaluations: args.evaluations,
        seed: args.seed,
        ..Settings::default()
    };
    let found = optimise(&model, args.parameters.into(), &settings).map_err(|e| match e {
        Error::Setting(_) => Failure::input(e),
        _ => Failure::refused(e),
    })?;
    let motion = found.path.sample(args.rate);
    super::write(&args.out, &motion.to_csv())?;
    let limits = Limits::of(model.arm(), 0.0).map_err(Failure::refused)?;
    let peaks = peaks(&motion);
    super::print(&if args.json {
        in_json(args, &found, &motion, &peaks)
    } else {
        in_words(args, &found, &motion, &peaks, &limits)
    })?;
    Ok(ExitCode::SUCCESS)
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

fn in_json(args: &Args, found: &Excitation, motion: &Motion, peaks: &[[f64; 4]]) -> String {
    let joints: Vec<_> = peaks
        .iter()
        .zip(&found.path.joints)
        .map(|([low, high, speed, acceleration], series)| {
            json!({"position": [low, high], "velocity": speed, "acceleration": acceleration,
                   "middle": series.middle, "a": series.a, "b": series.b})
        })
        .collect();
    let figures =
        |f: &powerball::excite::Figures| json!({"condition": f.condition, "least_singular_value": f.least});
    let object = json!({
        "out": args.out, "samples": motion.len(), "duration": motion.duration(),
        "fundamental": found.path.fundamental, "figures": figures(&found.figures),
        "random_start": figures(&found.usual), "joints": joints,
    });
    format!("{object}\n")
}

fn in_words(args: &Args, found: &Excitation, motion: &Motion, peaks: &[[f64; 4]], limits: &Limits) -> String {
    let mut out = String::new();
    let (good, usual) = (&found.figures, &found.usual);
    let _ = writeln!(
        out,
        "{}: {} samples, {:.2} s from rest to rest\n\
         condition number of the regressor {:.2} (a random path: {:.1}), smallest singular value {:.3} ({:.3})\n",
        args.out.display(),
        motion.len(),
        motion.duration(),
        good.condition,
        usual.condition,
        good.least,
        usual.least
    );
    let _ =
        writeln!(out, "joint   position [rad]     of limit        speed  of limit   acceleration  of limit");
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
