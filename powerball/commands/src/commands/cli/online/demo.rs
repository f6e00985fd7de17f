//! `powerball demo`: the whole loop on the virtual arm.

use super::Failure;
use super::output::{self, Progress};
use crate::commands::demo::{self, Demo, DemoError, SessionError};
use clap::Args;
use powerball_explanation::experiment::TRAJECTORY;
use powerball_logs as logs;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

/// What the names of the files begin with that the command writes.
const FILES: [&str; 11] = [
    "arm.toml",
    "virtual_arm.json",
    "base.json",
    "fit_",
    "held_out_",
    "experiment.csv",
    "path.csv",
    "model.json",
    "explained.json",
    "follow.json",
    TRAJECTORY,
];

/// Record a virtual arm with an effect that the model does not know about, identify, explain, and compare
/// with the truth.
///
/// Writes the logs, arm.toml, explained.json and report.html. Exits with 0 unless something broke: a wrong
/// name is a result.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball demo\n  powerball demo --seed 7 --out demo7\n  \
    powerball demo --effect hysteresis\n  powerball demo --effect asymmetry --seed 3 --experiment\n\nThe \
    logs can then be explained by hand:\n  \
    powerball explain --arm demo/arm.toml --log demo/fit_*.csv --validate demo/held_out_*.csv --out again")]
pub(crate) struct DemoCommand {
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Draws the effect, its size, the paths and the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The effect by name instead of one that the seed draws.
    #[arg(long, value_name = "NAME")]
    effect: Option<String>,
    /// If two names fit equally well, also record the experiment that distinguishes them, and let it decide.
    #[arg(long)]
    experiment: bool,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

impl DemoCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let words = "The demonstration was stopped, or is running: its report takes the place of this page.";
        output::make_own_folder(&self.out, &FILES, "Demonstration", words)?;
        let started = std::time::Instant::now();
        let demo = demo::run(
            &self.out,
            self.seed,
            self.effect.as_deref(),
            self.experiment,
            logs::Progress::to(&|what| progress.say(what)),
        )
        .map_err(|e| match e {
            DemoError::Session(SessionError::UnknownEffect(_) | SessionError::Write(..)) => {
                Failure::Unusable(e.to_string())
            }
            _ => Failure::Refused(e.to_string()),
        })?;
        let seconds = started.elapsed().as_secs_f64();
        output::write(&self.out, "explained.json", output::json(&demo.explained)?.as_bytes())?;
        if let Ok(driven) = &demo.driven {
            output::write(&self.out, "follow.json", output::json(&driven.followed)?.as_bytes())?;
        }
        output::write(&self.out, "report.html", demo::page(&demo).to_html().as_bytes())?;
        if self.json {
            let session = &demo.session;
            let result = json!({
                "seed": self.seed, "verdict": demo.verdict, "explained": demo.explained,
                "followed": demo.driven.as_ref().ok().map(|driven| &driven.followed),
                "fit_logs": session.fit, "held_out_logs": session.held_out, "arm": session.arm_file,
                "report": self.out.join("report.html"), "seconds": seconds,
            });
            output::data(&result.to_string());
        } else {
            output::print(&self.in_words(&demo, seconds));
        }
        Ok(())
    }

    fn in_words(&self, demo: &Demo, seconds: f64) -> String {
        let (session, explained, verdict) = (&demo.session, &demo.explained, &demo.verdict);
        let mut out = String::new();
        let _ = writeln!(
            out,
            "A virtual LWA 4P was recorded for {:.0} s along {} exciting paths: {} to fit, {} held out.\n\
             \nTorque error on the held-out paths, rms in N·m, {} to {} Hz\n\
             \njoint   base model   with what was named   change   noise floor",
            session.recorded,
            session.fit.len() + session.held_out.len(),
            session.fit.len(),
            session.held_out.len(),
            explained.band[0],
            explained.band[1],
        );
        let (before, after) = (&explained.before.validate.rms, &explained.after.validate.rms);
        for joint in 0..before.len() {
            let (b, a) = (before[joint], after[joint]);
            let _ = writeln!(
                out,
                "{:>5}   {b:>10.4}   {a:>19.4}   {:>+4.0} %   {:>11.4}",
                joint + 1,
                100.0 * (a / b - 1.0),
                explained.noise_floor[joint]
            );
        }
        out.push_str(&super::explain::open_in_words(explained));
        let _ = writeln!(
            out,
            "\nnamed:         {}\nin the plant:  {}\n\n{}\n\n{}\n{} and the logs next to it, {seconds:.1} s",
            verdict.named_in_words(),
            verdict.truth_in_words(),
            verdict.sentence(),
            tracking_in_words(demo),
            self.out.join("report.html").display(),
        );
        out.trim_end().to_string()
    }
}

/// How far the arm was off its path with either model.
fn tracking_in_words(demo: &Demo) -> String {
    let followed = match &demo.driven {
        Ok(driven) => &driven.followed,
        Err(why) => return format!("The arm was not moved with the models: {why}\n"),
    };
    let mut out = String::from(
        "Tracking error of the same arm along a new path, computed torque, rms in mrad\n\n\
         joint   base model   explained model   change\n",
    );
    let of = |name: &str| followed.tracking_error.get(name).map(Vec::as_slice).unwrap_or_default();
    for (joint, (base, explained)) in of("base").iter().zip(of("explained")).enumerate() {
        let change = 100.0 * (explained / base - 1.0);
        let _ = writeln!(
            out,
            "{:>5}   {:>10.3}   {:>15.3}   {change:>+4.0} %",
            joint + 1,
            1e3 * base,
            1e3 * explained
        );
    }
    if let Some(share) = followed.share_of_base() {
        let _ =
            writeln!(out, "\nAll joints together: {:.0} % of the error with the base model.", 100.0 * share);
    }
    out
}
