//! Torques over time, for people to look at.

use crate::logs::regression::Data;

/// Between two recordings on the axis of a figure, s.
const BETWEEN: f64 = 1.0;

/// What one joint's torque was and what was predicted, in the band, by row.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueCurve {
    /// Time along the logs, one after the other without their pauses, s.
    pub t: Vec<f64>,
    /// Measured torque, N·m.
    pub measured: Vec<f64>,
    /// Measured minus predicted by one model (the base model, where two are compared), N·m.
    pub before: Vec<f64>,
    /// Measured minus predicted by the other one (with all accepted effects), N·m.
    pub after: Vec<f64>,
    /// Places where rows are missing before a row: the end of a log, or a rest phase.
    pub breaks: Vec<usize>,
}

impl TorqueCurve {
    /// The points of one quantity, with a point that is not a number wherever rows are missing.
    #[must_use]
    pub fn points(&self, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(self.t.len() + self.breaks.len());
        let mut breaks = self.breaks.iter().peekable();
        for (row, t) in self.t.iter().enumerate() {
            if breaks.next_if(|at| **at == row).is_some() {
                points.push((*t, f64::NAN));
            }
            points.push((*t, value(row)));
        }
        points
    }
}

/// The curves of every joint from the residuals of both models.
#[must_use]
pub fn curves(data: &Data<'_>, before: &[Vec<f64>], after: &[Vec<f64>]) -> Vec<TorqueCurve> {
    (0..data.dof())
        .map(|j| {
            let rows = &data.joints[j];
            let (mut t, mut breaks) = (Vec::with_capacity(rows.len()), Vec::new());
            let mut start = 0.0;
            for (recording, kept) in data.recordings.iter().zip(&rows.kept) {
                let sample = rows.band.kept(recording.len());
                for (i, k) in kept.iter().enumerate() {
                    if i == 0 || kept[i - 1] + 1 != *k {
                        breaks.push(t.len());
                    }
                    t.push(start + sample[*k] as f64 / recording.rate);
                }
                start += recording.len() as f64 / recording.rate + BETWEEN;
            }
            let (before, after) = (before[j].clone(), after[j].clone());
            TorqueCurve { t, measured: rows.torque.clone(), before, after, breaks }
        })
        .collect()
}
