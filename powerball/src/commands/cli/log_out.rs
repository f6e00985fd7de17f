//! `powerball log --to`: a log as another file, with what a model predicts beside it.

use super::Failure;
use crate::explanation::torque_model::ModelFile;
use crate::identification::{Source, VerifyOptions, verify};
use crate::logs::log::Log;
use crate::logs::tables::{JointState, McapWriter};
use dyngen::Arm;
use std::path::Path;

/// Writes a log; with a model as MCAP that has measured, predicted and residual torque beside each other.
pub(super) fn write(log: &Log, arm: &Arm, model: Option<&Path>, out: &Path) -> Result<(), Failure> {
    let failed = |e: std::io::Error| Failure::Unusable(format!("{}: cannot be written: {e}", out.display()));
    let Some(model) = model else { return log.write(out).map_err(failed) };
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
    mcap(log, &torque, &mut bytes).map_err(failed)?;
    super::output::write_file(out, &bytes)
}

fn mcap(log: &Log, torque: &[Vec<[f64; 4]>], out: &mut Vec<u8>) -> std::io::Result<()> {
    let joints: Vec<String> = (1..=log.q.len()).map(|j| format!("joint{j}")).collect();
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
            &joints,
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
