//! `powerball verify`: an identified model on another trajectory.

use super::Failure;
use super::identify::by_band;
use super::identify_page::torque_figure;
use super::inputs::{Inputs, load};
use super::output::{self, Progress};
use crate::explanation::explain::{TorqueCurve, curves};
use crate::identification::estimate::{JointVerdict, verify};
use crate::identification::mounting::Mounting;
use crate::logs::regression::{Data, DataOptions};
use crate::logs::summary::BANDS;
use crate::report::{Page, Table, Tone, number};
use clap::Args;
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

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

/// verified.json.
#[derive(Serialize)]
struct Verified {
    arm: String,
    joints: Vec<JointVerdict>,
    tolerance: f64,
    within_tolerance: bool,
    band: [f64; 2],
    /// The end of each joint's band, Hz, in which its error is taken: the one in which it was identified.
    joint_bands: Vec<f64>,
    warnings: Vec<String>,
}

impl Verify {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if !(self.tolerance.is_finite() && self.tolerance > 0.0) {
            return Err(Failure::Unusable("--tolerance must be above 0".into()));
        }
        let progress = Progress::new();
        let loaded = load(&self.inputs, &[], Some(&self.model), self.mounting, &progress)?;
        progress.say("preparing signals");
        let data = Data::new(&loaded.body, &loaded.fit, &DataOptions::default())
            .map_err(|e| Failure::Refused(e.to_string()))?;
        let residual_of = |data: &Data<'_>| {
            loaded.known.as_ref().map(|m| m.residual(&loaded.body, data, &[])).unwrap_or_default()
        };
        let residual = residual_of(&data);
        let mut joints = verify(&data, &residual, self.tolerance);
        let joint_bands = joint_bands(&self.model, joints.len());
        for (members, data) in by_band(&loaded.body, &loaded.fit, &joint_bands)? {
            let own = verify(&data, &residual_of(&data), self.tolerance);
            members.into_iter().for_each(|j| joints[j] = own[j].clone());
        }
        let verified = Verified {
            arm: loaded.body.arm().name.clone(),
            within_tolerance: joints.iter().all(|j| j.within != Some(false)),
            joints,
            tolerance: self.tolerance,
            band: [0.0, data.band.cutoff],
            joint_bands,
            warnings: loaded.warnings.into_iter().chain(data.notes.iter().cloned()).collect(),
        };
        let text = output::json(&verified)?;
        output::write(&self.inputs.out, "verified.json", text.as_bytes())?;
        let shown = page(&verified, &curves(&data, &residual, &residual));
        output::write(&self.inputs.out, "report.html", shown.to_html().as_bytes())?;
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

/// The joints' bands of an identified.json; the widest where the file says nothing of them.
fn joint_bands(model: &Path, dof: usize) -> Vec<f64> {
    let said: Option<Value> = std::fs::read_to_string(model).ok().and_then(|t| serde_json::from_str(&t).ok());
    let of =
        |j: usize| said.as_ref()?.get("joint_bands")?.get(j)?.as_f64().filter(|band| BANDS.contains(band));
    (0..dof).map(|j| of(j).unwrap_or(BANDS[0])).collect()
}

fn page(verified: &Verified, curves: &[TorqueCurve]) -> Page {
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
    for (joint, curve) in curves.iter().enumerate().filter(|(_, c)| !c.t.is_empty()) {
        page.figure(&torque_figure(joint, curve), "");
    }
    page
}
