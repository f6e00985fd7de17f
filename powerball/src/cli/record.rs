//! `powerball record`: a trajectory in interpolated position mode, and its log.

use super::Failure;
use super::bus::{Where, master};
use super::output;
use crate::driver::lwa4p::LWA4P;
use crate::motion::Motion;
use crate::procedure::{RecordError, record};
use clap::Args;
use serde_json::json;
use std::fs::File;
use std::path::PathBuf;

/// Bring the arm up, go to where a trajectory begins, follow it at 200 Hz, and log it.
///
/// The log has t, q1…q6 (rad), tau1…tau6 (N·m, as good as the profile's calibration) and ref1…ref6 (rad, the set-points).
/// Each line is written whole: whatever happens, the log can be read up to there. THE ARM MOVES.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  powerball excite --arm powerball/lwa4p.toml --out path.csv\n  \
    powerball record --trajectory path.csv --out log.csv --bus socketcan:can0")]
pub(crate) struct RecordCommand {
    /// The trajectory: CSV with t, q1…q6 (rad), as `powerball excite` writes it at the arm's rate.
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// Where the log is written, CSV.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    place: Where,
}

impl RecordCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let name = self.trajectory.display();
        let text = std::fs::read_to_string(&self.trajectory)
            .map_err(|e| Failure::Unusable(format!("{name}: cannot be read: {e}")))?;
        let motion = Motion::from_csv(&text, LWA4P.joints.len())
            .map_err(|why| Failure::Unusable(format!("{name}: {why}")))?;
        let master = master(&self.place)?;
        let mut log = File::create(&self.out)
            .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", self.out.display())))?;
        let done = record(master, &motion, &mut log).map_err(|e| match e {
            RecordError::Motion(what) => Failure::Unusable(format!("{name}: {what}")),
            other => Failure::Refused(other.to_string()),
        })?;
        if self.place.json {
            output::print(&json!({ "out": self.out, "record": done }).to_string());
        } else {
            let far = done.following_max.iter().fold(0.0f64, |far, e| far.max(*e));
            output::print(&format!(
                "{}: {} samples, {} missing; {} cycles late, {} left out, {} set-points held; at most {:.1} mrad from the set-point",
                self.out.display(),
                done.samples,
                done.missing,
                done.late,
                done.skipped,
                done.dropped,
                1e3 * far
            ));
        }
        Ok(())
    }
}
