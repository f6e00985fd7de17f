//! `powerball log --to mcap --model`: a log next to what a model predicts.

use super::log::joint_names;
use super::{Failure, output};
use dyngen::Arm;
use powerball_explanation::torque_model::ModelFile;
use powerball_identification::{Source, VerifyOptions, verify};
use powerball_logs::log::Log;
use powerball_logs::tables::{JointState, McapWriter, layouts};
use std::path::Path;

/// Writes a log as MCAP that has measured, predicted and residual torque next to each other.
pub(super) fn write(log: &Log, arm: &Arm, model: &Path, out: &Path) -> Result<(), Failure> {
    let failed = |e: std::io::Error| Failure::Unusable(format!("{}: cannot be written: {e}", out.display()));
    let model = ModelFile::read(model).map_err(|e| Failure::Unusable(e.to_string()))?;
    // Times along the log, and measured, predicted and residual torque there, by joint.
    let mut torque: Vec<Vec<[f64; 4]>> = vec![Vec::new(); arm.dof()];
    for piece in log.whole_pieces() {
        let start = piece.t.first().copied().unwrap_or(0.0);
        let verified = verify(arm, &model, [Source::from(piece)], &VerifyOptions::default())?;
        for (rows, curve) in torque.iter_mut().zip(&verified.curves) {
            let at = curve.t.iter().zip(&curve.measured).zip(&curve.before);
            rows.extend(at.map(|((t, measured), left)| [start + t, *measured, measured - left, *left]));
        }
    }
    let mut bytes = Vec::new();
    mcap(log, &joint_names(arm), &torque, &mut bytes).map_err(failed)?;
    output::write_file(out, &bytes)?;
    let held = layouts::Held { joints: &joint_names(arm), velocities: false, torques: true };
    layouts::write(out, held).map_err(failed)
}

fn mcap(log: &Log, joints: &[String], torque: &[Vec<[f64; 4]>], out: &mut Vec<u8>) -> std::io::Result<()> {
    let members = ["measured", "predicted", "residual"];
    let mut writer = McapWriter::new(out)?;
    let states = writer.joint_states("/joint_states")?;
    let channels: Vec<_> = joints
        .iter()
        .map(|joint| writer.numbers(&format!("/torque/{joint}"), "Torque", &members))
        .collect::<Result<_, _>>()?;
    for (k, t) in log.t.iter().enumerate() {
        let of = |signals: &[Vec<f64>]| signals.iter().map(|x| x[k]).collect::<Vec<f64>>();
        let (position, effort) = (of(&log.q), of(&log.torque));
        writer.state(
            states,
            *t,
            joints,
            &JointState { position: &position, velocity: &[], effort: &effort },
        )?;
    }
    for (channel, rows) in channels.into_iter().zip(torque) {
        for [t, measured, predicted, residual] in rows {
            let values = members.into_iter().zip([*measured, *predicted, *residual]);
            writer.object(channel, *t, values)?;
        }
    }
    writer.finish().map(|_| ())
}
