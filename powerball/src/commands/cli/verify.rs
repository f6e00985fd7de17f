//! `powerball verify`: an identified model on another trajectory.

use super::identify_page::torque_figure;
use super::inputs::Inputs;
use super::{Failure, output};
use crate::explanation::torque_model::ModelFile;
use crate::identification::mounting::Mounting;
use crate::identification::{Source, Verified, VerifyOptions, verify};
use crate::logs::Progress;
use crate::report::{Page, Table, Tone, number};
use clap::Args;
use dyngen::Arm;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Judge an identified model on logs that it has not seen (Fig. 8): errors with intervals, against the noise
/// floor.
///
/// Writes verified.json and report.html. Exit code 1 where a joint's error is beyond the tolerance.
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
}

impl Verify {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm = Arm::read(&self.inputs.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let model = ModelFile::read(&self.model).map_err(|e| Failure::Unusable(e.to_string()))?;
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let options = VerifyOptions {
            tolerance: self.tolerance,
            joint_bands: joint_bands(&self.model),
            progress: Progress::to(&say),
            ..VerifyOptions::default()
        };
        let map = Arc::new(self.inputs.map.read()?);
        let source = |file| Source::file(file).mounted(self.mounting).mapped(Arc::clone(&map));
        let logs = self.inputs.log.iter().map(source);
        let verified = verify(&arm, &model, logs, &options)?;
        output::make_folder(&self.inputs.out)?;
        let text = output::json(&verified)?;
        output::write(&self.inputs.out, "verified.json", text.as_bytes())?;
        output::write(&self.inputs.out, "report.html", page(&verified).to_html().as_bytes())?;
        if self.inputs.json {
            output::print(&text);
        } else {
            for j in &verified.joints {
                output::print(&format!(
                    "joint {}: {:.4} N·m ({:.4} to {:.4}), {:.1} % of the torque, noise alone {:.4} N·m",
                    j.joint,
                    j.rms,
                    j.interval[0],
                    j.interval[1],
                    100.0 * j.relative,
                    j.noise_floor
                ));
            }
        }
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

/// The joints' bands of an identified.json; none where the file says nothing of them.
fn joint_bands(model: &Path) -> Vec<f64> {
    let said: Option<Value> = std::fs::read_to_string(model).ok().and_then(|t| serde_json::from_str(&t).ok());
    let bands = said.as_ref().and_then(|json| json.get("joint_bands")?.as_array());
    bands.map_or(Vec::new(), |bands| bands.iter().map(|band| band.as_f64().unwrap_or(0.0)).collect())
}

fn page(verified: &Verified) -> Page {
    let mut page = Page::new(format!("Torque model of {}, verified", verified.arm));
    page.lead(
        "A model on logs that it has not seen: measured against predicted torque, 95 % intervals of \
        the error from blocks that count as independent.",
    );
    let percent = 100.0 * verified.tolerance;
    match verified.within_tolerance {
        true => {
            page.note(Tone::Good, &format!("Every joint that moves is within {percent} % of its torque."))
        }
        false => page.note(Tone::Bad, &format!("Not every joint is within {percent} % of its torque.")),
    };
    let mut table =
        Table::new(["joint", "error [N·m]", "interval [N·m]", "of the torque", "noise alone [N·m]"]);
    for j in &verified.joints {
        table.push([
            j.joint.to_string(),
            number(j.rms),
            format!("{} to {}", number(j.interval[0]), number(j.interval[1])),
            format!("{:.1} %", 100.0 * j.relative),
            number(j.noise_floor),
        ]);
    }
    page.table(&table);
    for (joint, curve) in verified.curves.iter().enumerate().filter(|(_, c)| !c.t.is_empty()) {
        page.figure(&torque_figure(joint, curve), "");
    }
    page
}
