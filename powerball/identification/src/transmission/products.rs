//! The data about one joint's transmission: products of its columns, by block.
//!
//! The module also makes the signals that a motor's torque is compared with, and puts logs with both torques
//! on even grids, each in its part.

use crate::estimate::{NormalEquations, noise_in_band};
use dyngen::Arm;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_controller::correction::{Instant, Law, Memory};
use powerball_logs::log::Log;
use powerball_logs::regression::{Recording, top_velocity};
use powerball_logs::signal::resample::{linear, median_step};
use powerball_logs::signal::{Band, difference, motion};

/// Length of a block, s: one to three correlation times of the residual.
const BLOCK: f64 = 0.5;
/// Least number of blocks of motion for a result.
const FEWEST_BLOCKS: usize = 12;

/// Products of all columns over some rows.
#[derive(Clone, Debug)]
pub(super) struct Products {
    pub rows: f64,
    gram: Vec<f64>,
}

/// A stretch of rows that counts as independent of the others.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub part: usize,
    pub products: Products,
}

/// Everything that a joint's transmission is determined from.
#[derive(Debug)]
pub(super) struct Evidence {
    pub blocks: Vec<Block>,
    /// By part.
    pub parts: Vec<Products>,
    /// Whether the last part is of the logs to judge on.
    pub held_out: bool,
    /// Variance of the link torque's noise in the band.
    pub noise: f64,
}

impl Products {
    fn empty() -> Products {
        Products { rows: 0.0, gram: vec![0.0; Column::COUNT * Column::COUNT] }
    }

    /// Adds the row of all columns.
    fn push(&mut self, row: &[f64]) {
        self.rows += 1.0;
        for (products, x) in self.gram.chunks_exact_mut(Column::COUNT).zip(row) {
            products.iter_mut().zip(row).for_each(|(product, y)| *product += x * y);
        }
    }

    /// The sum of some.
    pub(super) fn sum<'p>(all: impl IntoIterator<Item = &'p Products>) -> Products {
        let mut sum = Products::empty();
        for one in all {
            sum.rows += one.rows;
            sum.gram.iter_mut().zip(&one.gram).for_each(|(a, b)| *a += b);
        }
        sum
    }

    /// The product of two columns.
    pub(super) fn of(&self, a: Column, b: Column) -> f64 {
        self.gram[a.index() * Column::COUNT + b.index()]
    }

    /// The normal equations of some columns and the motor's torque, times a sign.
    pub(super) fn normal(&self, columns: &[Column], sign: f64) -> NormalEquations {
        let size = columns.len();
        NormalEquations {
            gram: Mat::from_fn(size, size, |r, c| self.of(columns[r], columns[c])),
            right: columns.iter().map(|c| sign * self.of(*c, Column::Motor)).collect(),
            square: self.of(Column::Motor, Column::Motor),
        }
    }
}

impl Evidence {
    /// The parts for which something holds, together.
    pub(super) fn of(&self, wanted: impl Fn(usize) -> bool) -> Products {
        Products::sum(self.parts.iter().enumerate().filter(|(k, _)| wanted(*k)).map(|(_, part)| part))
    }

    /// The logs that are fitted.
    pub(super) fn fitted(&self) -> Products {
        self.of(|part| self.is_fitted(part))
    }

    /// Whether a part is not of the logs to judge on.
    pub(super) fn is_fitted(&self, part: usize) -> bool {
        !self.held_out || part + 1 != self.parts.len()
    }
}

/// The products of a joint's columns from the logs.
///
/// # Errors
/// The reason, if the logs hold no information about it.
pub(super) fn evidence(arm: &Arm, grid: &Grid, joint: JointNumber) -> Result<(Evidence, Scales), String> {
    let j = joint.index();
    let used = || grid.pieces.iter().filter(move |piece| !piece.motor(j).is_empty());
    let changes = |x: &[f64]| x.windows(2).any(|pair| pair[0] != pair[1]);
    if !used().any(|piece| changes(piece.motor(j))) {
        return Err(format!("motor{joint} never changes: it was not recorded, or its drive is dead"));
    }
    let recordings: Vec<&Recording> = used().map(|piece| &piece.recording).collect();
    let top = top_velocity(recordings.iter().copied(), j);
    let velocities = recordings.iter().flat_map(|r| r.velocity(j).map(f64::abs)).collect();
    let rest_velocity = motion::rest_velocity(velocities, arm.joints[j].velocity);
    let scales = Scales::new(top);
    let torques: Vec<&[f64]> = recordings.iter().map(|r| r.torque[j].as_slice()).collect();
    let noise = noise_in_band(&torques, &grid.band, grid.rate).powi(2);
    let per_block = ((BLOCK * grid.rate) as usize).max(1);
    let mut blocks: Vec<Block> = Vec::new();
    for piece in used() {
        let recording = &piece.recording;
        let moving =
            motion::moving(&recording.velocity(j).collect::<Vec<_>>(), recording.rate, rest_velocity);
        let kept = grid.band.kept(recording.len());
        let in_band = |column: Column| match column {
            Column::Motor => grid.band.pass(piece.motor(j)),
            other => grid.band.pass(&other.signal(&scales, recording, j)),
        };
        let columns: Vec<Vec<f64>> = Column::all().into_iter().map(in_band).collect();
        let mut last = None;
        for (k, sample) in kept.iter().enumerate().filter(|(_, s)| moving[**s] && piece.knows(j, **s)) {
            let half = usize::from(2 * sample >= recording.len());
            let (number, part) = (sample / per_block, piece.part.unwrap_or(half));
            if last != Some((number, part)) {
                last = Some((number, part));
                blocks.push(Block { part, products: Products::empty() });
            }
            let row: Vec<f64> = columns.iter().map(|column| column[k]).collect();
            if let Some(block) = blocks.last_mut() {
                block.products.push(&row);
            }
        }
    }
    let count = |part: usize| blocks.iter().filter(|block| block.part == part).count();
    if blocks.len() < FEWEST_BLOCKS || (0..grid.parts).any(|part| count(part) < FEWEST_BLOCKS / 3) {
        let seconds = BLOCK * blocks.len() as f64;
        return Err(format!(
            "its logs with both torques hold {seconds:.1} s of motion, or one of them hardly any: record \
             longer"
        ));
    }
    let parts = (0..grid.parts)
        .map(|part| Products::sum(blocks.iter().filter(|b| b.part == part).map(|b| &b.products)))
        .collect();
    Ok((Evidence { blocks, parts, held_out: grid.held_out, noise }, scales))
}

// The signals that a motor's torque is compared with.

/// One signal. What has a setting is there once for each that is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    /// The motor's torque.
    Motor,
    /// τ, the torque on the link's side.
    Link,
    /// q̈.
    Acceleration,
    /// q̇.
    Velocity,
    /// 1.
    Constant,
    /// τ̇.
    LinkRate,
    /// tanh(q̇/γ).
    Coulomb(usize),
    /// |τ|·tanh(q̇/γ).
    Load(usize),
    /// Dahl's state.
    Presliding(usize),
    /// tanh(γ·q̇)·exp(−(q̇/v)²).
    Bump(usize),
    /// tanh(γ·q̇)·|q̇|^p.
    Power(usize),
}

/// The settings that are tried on a joint.
#[derive(Clone, Debug)]
pub(super) struct Scales {
    /// γ, rad/s.
    pub widths: Vec<f64>,
    /// Distances of presliding, rad.
    pub distances: Vec<f64>,
    /// Velocities of a Stribeck bump, rad/s.
    pub bumps: Vec<f64>,
    /// Steepness of the change of a law's sign, s/rad.
    steepness: f64,
}

impl Scales {
    /// Powers of q̇.
    pub(super) const POWERS: [f64; Column::POWERS] = [0.5, 2.0, 3.0];

    /// For a joint whose fast velocity is `top`, rad/s.
    pub(super) fn new(top: f64) -> Scales {
        Scales {
            // From a step to a third of the velocities: friction that is sharper than what is tried would be
            // mistaken for presliding.
            widths: geometric(1e-3 * top, 0.3 * top, Column::WIDTHS),
            distances: geometric(1e-4, 0.02, Column::DISTANCES),
            bumps: geometric(0.02 * top, 0.3 * top, Column::BUMPS),
            steepness: 200.0 / top,
        }
    }
}

/// `count` numbers from `low` to `high` in equal ratios.
fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| low * (high / low).powf(k as f64 / (count - 1) as f64)).collect()
}

impl Column {
    pub(super) const WIDTHS: usize = 17;
    pub(super) const DISTANCES: usize = 8;
    pub(super) const BUMPS: usize = 5;
    pub(super) const POWERS: usize = 3;
    /// Columns in all.
    pub(super) const COUNT: usize = 6 + 2 * Self::WIDTHS + Self::DISTANCES + Self::BUMPS + Self::POWERS;

    /// All of them, each at its [`Column::index`].
    pub(super) fn all() -> Vec<Column> {
        let mut all = vec![
            Column::Motor,
            Column::Link,
            Column::Acceleration,
            Column::Velocity,
            Column::Constant,
            Column::LinkRate,
        ];
        all.extend((0..Self::WIDTHS).map(Column::Coulomb));
        all.extend((0..Self::WIDTHS).map(Column::Load));
        all.extend((0..Self::DISTANCES).map(Column::Presliding));
        all.extend((0..Self::BUMPS).map(Column::Bump));
        all.extend((0..Self::POWERS).map(Column::Power));
        all
    }

    /// The column's place among all.
    pub(super) fn index(self) -> usize {
        let loads = 6 + Self::WIDTHS;
        let presliding = loads + Self::WIDTHS;
        let bumps = presliding + Self::DISTANCES;
        match self {
            Column::Motor => 0,
            Column::Link => 1,
            Column::Acceleration => 2,
            Column::Velocity => 3,
            Column::Constant => 4,
            Column::LinkRate => 5,
            Column::Coulomb(k) => 6 + k,
            Column::Load(k) => loads + k,
            Column::Presliding(k) => presliding + k,
            Column::Bump(k) => bumps + k,
            Column::Power(k) => bumps + Self::BUMPS + k,
        }
    }

    /// Whether its coefficient cannot be negative: inertia, and what takes power. Friction may grow slower
    /// than in proportion to the velocity, and either torque may be the later one.
    pub(super) fn is_non_negative(self) -> bool {
        !matches!(self, Column::Motor | Column::Link | Column::Constant | Column::LinkRate | Column::Power(_))
    }

    /// The signal along a recording; nothing for the motor's, which no recording holds.
    pub(super) fn signal(self, scales: &Scales, recording: &Recording, joint: usize) -> Vec<f64> {
        let link = &recording.torque[joint];
        let along = |law: Law<f64>| -> Vec<f64> {
            let mut memory = Memory::default();
            let states = recording.position(joint).zip(recording.velocity(joint)).zip(link);
            states
                .map(|((q, dq), torque)| {
                    let now = Instant {
                        q: &[q],
                        dq: &[dq],
                        ddq: &[],
                        rigid: &[*torque],
                        friction: &[],
                        temperature: &[],
                        running: 0.0,
                    };
                    law.value(0, &now, &mut memory)
                })
                .collect()
        };
        let steepness = scales.steepness;
        match self {
            Column::Motor => Vec::new(),
            Column::Link => link.clone(),
            Column::Acceleration => recording.acceleration(joint).collect(),
            Column::Velocity => recording.velocity(joint).collect(),
            Column::Constant => along(Law::Constant),
            Column::LinkRate => difference::derivative(link, 1.0 / recording.rate),
            Column::Coulomb(k) => recording.velocity(joint).map(|v| (v / scales.widths[k]).tanh()).collect(),
            Column::Load(k) => along(Law::Load { steepness: 1.0 / scales.widths[k] }),
            Column::Presliding(k) => along(Law::Presliding { distance: scales.distances[k] }),
            Column::Bump(k) => along(Law::Stribeck { steepness, velocity: scales.bumps[k] }),
            Column::Power(k) => along(Law::Power { steepness, power: Scales::POWERS[k] }),
        }
    }
}

// Logs with both torques on even grids, and which part each belongs to.

/// Band of the comparison, Hz.
const BAND: f64 = 10.0;
/// Smoothing of positions, Hz. Reversals are sharp, and friction at them shows its law; noise of
/// accelerations above the band does not count.
const SMOOTHING: f64 = 25.0;
/// Shortest piece that is used, s.
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
    /// A joint's motor torque; empty if there is none.
    pub(super) fn motor(&self, joint: usize) -> &[f64] {
        self.motors.get(joint).map_or(&[], |motor| &motor.torque)
    }

    /// Whether the motor torque around a sample is known.
    pub(super) fn knows(&self, joint: usize, sample: usize) -> bool {
        self.motors.get(joint).is_some_and(|motor| motor.known.get(sample) == Some(&true))
    }
}

#[cfg(test)]
mod columns_tests {
    use super::*;

    #[test]
    fn every_column_is_at_its_index() {
        let all = Column::all();
        assert_eq!(all.len(), Column::COUNT);
        assert!(all.iter().enumerate().all(|(k, column)| column.index() == k));
    }
}
