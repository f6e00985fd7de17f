//! `powerball verify`: an identified model on another trajectory.

use super::inputs::Inputs;
use super::{Failure, output};
use crate::report;
use clap::Args;
use dyngen::Arm;
use powerball_explanation::torque_model::ModelFile;
use powerball_identification::mounting::Mounting;
use powerball_identification::{Source, VerifyOptions, verify};
use powerball_logs::Progress;
use std::path::PathBuf;
use std::sync::Arc;

/// Judge an identified model on logs that it has not seen (Fig. 8): errors with intervals, against the noise
/// floor.
///
/// Writes verified.json and report.html. Exit code 1 where a joint's error is beyond the tolerance, 3 where
/// the logs should not be used.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball verify --arm arm.toml --model result/identified.json --log other.csv \
        --out verified"
)]
pub(crate) struct Verify {
    #[command(flatten)]
    inputs: Inputs,
    /// The model: identified.json of `powerball identify` or model.json of `powerball explain`, for the same
    /// arm file.
    #[arg(long, value_name = "FILE.json")]
    model: PathBuf,
    /// How the base stood for these logs: `filed`, ROLL,PITCH in degrees from there, or gravity in its frame
    /// as X,Y,Z in m/s².
    #[arg(long, value_name = "MOUNTING", allow_hyphen_values = true, default_value = "filed")]
    mounting: Mounting,
    /// Largest error of a joint, as a share of the rms of its torque.
    #[arg(long, default_value_t = 0.1)]
    tolerance: f64,
    #[command(flatten)]
    accept: output::Accept,
}

impl Verify {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm = Arm::read(&self.inputs.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let model = ModelFile::read(&self.model).map_err(|e| Failure::Unusable(e.to_string()))?;
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let options = VerifyOptions {
            tolerance: self.tolerance,
            joint_bands: model.model.joint_bands.clone(),
            progress: Progress::to(&say),
            ..VerifyOptions::default()
        };
        let map = Arc::new(self.inputs.map.read()?);
        let source = |file| Source::file(file).mounted(self.mounting).mapped(Arc::clone(&map));
        let logs = self.inputs.log.iter().map(source);
        let verified = verify(&arm, &model, logs, &options)?;
        let files = report::verified::files(&verified).map_err(Failure::Refused)?;
        output::write_all(&files, &self.inputs.out)?;
        if self.inputs.json {
            output::data(&files.first());
        } else {
            output::first_lines(&verified.unusable, None, false).iter().for_each(|line| output::print(line));
            for (j, band) in verified.joints.iter().zip(&verified.joint_bands) {
                output::print(&format!(
                    "joint {}: {:.4} N·m ({:.4} to {:.4}), {:.1} % of the torque, noise alone {:.4} N·m, \
                    {band} Hz",
                    j.joint,
                    j.rms,
                    j.interval[0],
                    j.interval[1],
                    100.0 * j.relative,
                    j.noise_floor,
                    band = report::band_of(*band)
                ));
            }
        }
        self.accept.judge(&verified.unusable)?;
        let beyond: Vec<String> =
            verified.joints.iter().filter(|j| j.within == Some(false)).map(|j| j.joint.to_string()).collect();
        if beyond.is_empty() {
            return Ok(());
        }
        Err(Failure::Refused(format!(
            "the error of joint {} may exceed {} % of its torque: see {}",
            beyond.join(", "),
            100.0 * self.tolerance,
            self.inputs.out.join("report.html").display()
        )))
    }
}
