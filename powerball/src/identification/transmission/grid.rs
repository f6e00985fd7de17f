//! Logs with both torques on even grids, and which part each belongs to.

use crate::logs::log::Log;
use crate::logs::regression::Recording;
use crate::logs::signal::Band;
use crate::logs::signal::resample::{linear, median_step};

/// Band of the comparison, Hz.
const BAND: f64 = 10.0;
/// Smoothing of positions, Hz. Reversals are sharp, and what friction does at them tells its law; noise of
/// accelerations above the band does not count.
const SMOOTHING: f64 = 25.0;
/// Shorter pieces say nothing, s.
const SHORTEST: f64 = 1.0;
/// Parts of logs that are held out in turn.
const PARTS: usize = 3;

/// Recordings with the motors' torques.
#[derive(Debug)]
pub(super) struct Grid {
    pub pieces: Vec<Piece>,
    pub band: Band,
    pub rate: f64,
    /// How many parts there are.
    pub parts: usize,
    /// Whether the last part holds the logs to judge on.
    pub held_out: bool,
}

/// A piece of a log.
#[derive(Debug)]
pub(super) struct Piece {
    pub recording: Recording,
    /// The part of the whole log; none where its halves are parts.
    pub part: Option<usize>,
    motors: Vec<Motor>,
}

/// A motor's torque on the grid.
#[derive(Debug, Default)]
struct Motor {
    torque: Vec<f64>,
    known: Vec<bool>,
}

impl Grid {
    /// `logs` begin with `fitted` ones; the others are to judge on.
    ///
    /// # Errors
    /// In words, where nothing is long enough.
    pub(super) fn new(logs: &[Log], fitted: usize) -> Result<Grid, String> {
        let too_short =
            || "the logs hold no stretch of at least a second without gaps: record longer".to_string();
        let mut steps: Vec<f64> = logs.iter().filter_map(|log| median_step(&log.t)).collect();
        steps.sort_by(f64::total_cmp);
        let step = *steps.get(steps.len() / 2).ok_or_else(too_short)?;
        let rate = 1.0 / step;
        let band = Band::new(BAND, rate);
        let held_out = fitted < logs.len();
        let own = fitted.min(if held_out { PARTS - 1 } else { PARTS });
        let parts = own + usize::from(held_out);
        let part = |log: usize| if log < fitted { log * own / fitted } else { own };
        let mut pieces = Vec::new();
        for (index, log) in logs.iter().enumerate() {
            for piece in &log.pieces {
                let t = &log.t[piece.clone()];
                if t[t.len() - 1] - t[0] < SHORTEST {
                    continue;
                }
                let Some(recording) = Recording::new(log, index, piece.clone(), step, SMOOTHING) else {
                    continue;
                };
                let on_grid =
                    |torque: &Vec<f64>| Motor::new(t, &torque[piece.clone()], &recording, band.trim);
                let motors = log.motor.iter().flatten().map(on_grid).collect();
                pieces.push(Piece { recording, part: (parts > 1).then(|| part(index)), motors });
            }
        }
        match pieces.is_empty() {
            true => Err(too_short()),
            false => Ok(Grid { pieces, band, rate, parts: parts.max(2), held_out }),
        }
    }
}

impl Motor {
    /// Samples that hold no number are bridged by straight lines; what is nearer to one than the filter's
    /// reach is not known.
    fn new(t: &[f64], torque: &[f64], recording: &Recording, reach: usize) -> Motor {
        let (step, count) = (1.0 / recording.rate, recording.len());
        let numbers = || t.iter().zip(torque).filter(|(_, x)| x.is_finite());
        let times: Vec<f64> = numbers().map(|(t, _)| *t).collect();
        if times.len() < 2 {
            return Motor::default();
        }
        let values: Vec<f64> = numbers().map(|(_, x)| *x).collect();
        let mut known = vec![true; count];
        for (t, _) in t.iter().zip(torque).filter(|(_, x)| !x.is_finite()) {
            let at = ((t - recording.start) / step).round().max(0.0) as usize;
            known[at.saturating_sub(reach).min(count)..(at + reach + 1).min(count)].fill(false);
        }
        Motor { torque: linear(&times, &values, recording.start, step, count), known }
    }
}

impl Piece {
    /// A joint's motor torque; nothing where there is none.
    pub(super) fn motor(&self, joint: usize) -> &[f64] {
        self.motors.get(joint).map_or(&[], |motor| &motor.torque)
    }

    /// Whether the motor torque around a sample is known.
    pub(super) fn knows(&self, joint: usize, sample: usize) -> bool {
        self.motors.get(joint).is_some_and(|motor| motor.known.get(sample) == Some(&true))
    }
}
