//! `powerball record`: a trajectory in interpolated position mode, and its log.

use super::bus::{Consent, Where, master};
use super::envelope::Surroundings;
use super::log::joint_names;
use super::{Failure, motion, output, replace};
use crate::procedure::{Behind, RecordError, record};
use clap::Args;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_identification::mounting::Mounting;
use powerball_logs::log::LogFile;
use powerball_logs::motion::Motion;
use serde_json::json;
use std::path::PathBuf;

/// Bring the arm up, go to where a trajectory begins, follow it at 200 Hz, and log it.
///
/// The log has t (s, the measured time of each SYNC), q1…q6 (rad), tau1…tau6 (N·m, as good as the profile's
/// calibration), ref1…ref6 (rad, the set-points), dq1…dq6 (rad/s, the drives' own), status1…status6
/// (statuswords), answer1…answer6 (s from SYNC to the joint's data), and late, skipped, dropped (counts since
/// it began).
///
/// Each line is written whole: whatever happens, the log can be read up to there. A log whose name ends in
/// .parquet or .mcap is written as lines next to it, NAME.parquet.csv, and becomes that when it ends; lines
/// that an interrupted program left are moved to NAME.interrupted-1.parquet by the next recording of that
/// name.
///
/// Before the arm moves the whole trajectory and the straight way to its beginning are checked: limits of
/// position, velocity, acceleration and torque, the floor, and the arm's links as capsules in the way of
/// `powerball excite`. THE ARM MOVES.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  powerball excite --arm powerball/lwa4p.toml --out path.csv\n  \
    powerball record --trajectory path.csv --out log.csv --arm powerball/lwa4p.toml --floor -0.2 --bus \
    socketcan:can0")]
pub(crate) struct RecordCommand {
    /// The trajectory: CSV with t, q1…q6 (rad), as `powerball excite` writes it at the arm's rate.
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// File for the log: Parquet or MCAP if the name ends in .parquet or .mcap, else CSV.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How the base stands: filed, ROLL,PITCH in degrees, or gravity in the base frame as X,Y,Z in m/s².
    #[arg(long, default_value = "filed", allow_hyphen_values = true)]
    mounting: Mounting,
    #[command(flatten)]
    surroundings: Surroundings,
    #[command(flatten)]
    place: Where,
    #[command(flatten)]
    consent: Consent,
}

impl RecordCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let name = self.trajectory.display();
        let text = dyngen::file::text(&self.trajectory)
            .map_err(|e| Failure::Unusable(format!("{name}: cannot be read: {e}")))?;
        let motion = Motion::from_csv(&text, LWA4P.joints.len())
            .map_err(|why| Failure::Unusable(format!("{name}: {why}")))?;
        replace::check_log(&self.out, &[&self.trajectory])?;
        let arm = self.surroundings.arm()?;
        let envelope = self.surroundings.envelope(&arm, &self.mounting)?;
        let master = master(&self.place, self.consent)?;
        let unwritable =
            |e: std::io::Error| Failure::Unusable(format!("{}: cannot be written: {e}", self.out.display()));
        let (log, recovered) = LogFile::create_for(&self.out, &joint_names(&arm)).map_err(unwritable)?;
        if let Some(file) = &recovered {
            let file = file.display();
            tracing::warn!("an earlier recording was interrupted: its lines are now in {file}");
        }
        let mut log = Behind::new(log);
        let done = record(master, &motion, envelope, motion::live(), &mut log);
        // A recording that failed is closed too: what was recorded counts. The reported error is why it
        // failed.
        let (log, written) = log.close();
        let closed = written.and_then(|()| log.map_or(Ok(()), LogFile::close));
        let done = done.map_err(|e| match e {
            RecordError::Motion(what) => Failure::Unusable(format!("{name}: {what}")),
            other => Failure::Refused(other.to_string()),
        })?;
        closed.map_err(unwritable)?;
        if self.place.json {
            output::data(&json!({ "out": self.out, "record": done }).to_string());
        } else {
            let far = done.following_max.iter().fold(0.0f64, |far, e| far.max(*e));
            output::print(&format!(
                "{}: {} samples, {} missing; {} cycles late, {} left out, {} set-points held; at most {:.1} \
                    mrad from the set-point",
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
