//! Stretches in which a joint's torque stays at its limit: what the drive could not give, or the sensor not
//! show, says nothing of the arm.

use crate::logs::log::Log;

/// A torque that stays at the largest or the least value of all logs for so long was cut there, s: measured
/// torque that moves by its noise and its resolution does not stay.
const LEAST: f64 = 0.2;
/// … in so many samples in a row.
const SAMPLES: usize = 10;

/// When a joint's torque is at its limit, by log: spans of the log's own t, s.
pub(super) fn saturated(logs: &[Log], joint: usize) -> Vec<Vec<[f64; 2]>> {
    let values = || logs.iter().flat_map(|log| log.torque[joint].iter().copied()).filter(|v| v.is_finite());
    let (top, bottom) = (values().fold(f64::NEG_INFINITY, f64::max), values().fold(f64::INFINITY, f64::min));
    // A joint whose torque never changes is another matter.
    if top <= bottom {
        return vec![Vec::new(); logs.len()];
    }
    let of = |log: &Log| {
        let torque = &log.torque[joint];
        let mut spans = Vec::new();
        for piece in &log.pieces {
            let runs = torque[piece.clone()].chunk_by(|a, b| a == b);
            let mut start = piece.start;
            for run in runs {
                let end = start + run.len();
                let at_limit = run[0] == top || run[0] == bottom;
                if at_limit && run.len() >= SAMPLES && log.t[end - 1] - log.t[start] >= LEAST {
                    spans.push([log.t[start], log.t[end - 1]]);
                }
                start = end;
            }
        }
        spans
    };
    logs.iter().map(of).collect()
}

/// What is said of a joint's spans, a sentence a log.
pub(super) fn saturation_notes(logs: &[Log], joint: usize, spans: &[Vec<[f64; 2]>]) -> Vec<String> {
    let note = |(log, spans): (&Log, &Vec<[f64; 2]>)| {
        let seconds: f64 = spans.iter().map(|[from, to]| to - from).sum();
        format!(
            "{}: the torque of joint {} stays at the largest or least value of all logs for {seconds:.1} s in \
             all: it was at its limit; these samples of the joint were left out",
            log.file,
            joint + 1
        )
    };
    logs.iter().zip(spans).filter(|(_, spans)| !spans.is_empty()).map(note).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::log::Arrays;
    use crate::logs::regression::{Data, DataOptions, RigidArm};
    use std::f64::consts::TAU;

    /// 20 s of one joint at 100 Hz: a torque of 10 N·m at most, cut at `limit`.
    fn log(limit: f64) -> Log {
        let t: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let wave = |size: f64| -> Vec<f64> { t.iter().map(|t| size * (TAU * 0.2 * t).sin()).collect() };
        let torque = wave(10.0).into_iter().map(|v| v.clamp(-limit, limit)).collect();
        let dof = Arrays { t: &t, q: &[wave(0.5)], torque: &[torque], ..Arrays::default() };
        Log::from_arrays("log", &arm(), &dof).unwrap().0
    }

    fn arm() -> dyngen::Arm {
        let text = "name = \"one\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\nkind = \
                    \"revolute\"\na = 0.5\nalpha = 0.0\nd = 0.0\ntheta = 0.0\n";
        dyngen::Arm::parse(text, "one.toml").unwrap()
    }

    #[test]
    fn a_torque_at_its_limit_is_left_out_and_said() {
        let (arm, whole, cut) = (arm(), log(11.0), log(8.0));
        let body = RigidArm::new(&arm).unwrap();
        // 0.2 Hz: above 0.8 of its peak for (π − 2 asin 0.8)/τ of each half turn, 1.02 s, eight times.
        let spans = saturated(std::slice::from_ref(&cut), 0);
        assert_eq!(spans[0].len(), 8);
        for [from, to] in &spans[0] {
            approx::assert_relative_eq!(to - from, 1.02, epsilon = 0.03);
        }
        assert!(saturated(std::slice::from_ref(&whole), 0)[0].is_empty());
        let data = |log: &Log| Data::new(&body, std::slice::from_ref(log), &DataOptions::default()).unwrap();
        let (whole, cut) = (data(&whole), data(&cut));
        assert!(cut.joints[0].len() < whole.joints[0].len() * 2 / 3);
        assert!(cut.joints[0].torque.iter().all(|t| t.abs() < 8.0));
        assert!(cut.notes.iter().any(|n| n.contains("joint 1") && n.contains("8.2 s")), "{:?}", cut.notes);
        assert!(whole.notes.iter().all(|n| !n.contains("limit")));
    }
}
