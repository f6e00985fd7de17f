//! The colour of what a model leaves, and how much it errs: what a watch measures changes against.
//!
//! Rows are those of a band of [`BAND`]: wide enough that a change shows at once, and narrow enough that neighbouring
//! rows are nearly independent. A joint has no rows while it rests: friction is not determined there.

use super::TorqueModel;
use crate::controller::change::{self, JointTest, LATE, LEAST_MARGIN, ORDER, Shown};
use crate::controller::friction::TanhFriction;
use crate::identification::estimate::NormalEquations;
use crate::logs::log::{Log, logs_of_motors};
use crate::logs::regression::{DataOptions, Recording, RigidArm};
use crate::logs::signal::resample::median_step;
use crate::logs::signal::{Band, difference, motion};
use serde::{Deserialize, Serialize};

/// The band of the rows, Hz.
pub const BAND: f64 = 20.0;
/// A slower joint rests, rad/s or m/s: what is left there is how it sticks.
const REST: f64 = motion::REST_SPEED;
/// A joint with fewer rows says nothing of its colour.
const FEWEST: usize = 200;
/// The margin is such that no test on the logs it was learnt from comes nearer to an alarm than the level to the power
/// of this.
const CALM: f64 = 0.5;
/// A joint whose model errs by more standard deviations than this cannot be watched.
const MOST_MARGIN: f64 = 1.5;
/// Rows in which a colour's impulse response is over.
const IMPULSE: usize = 2000;
/// Steps of the search for the margin.
const STEPS: usize = 12;

/// What a model leaves on logs on which it holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Colour {
    /// Samples a second of the logs.
    pub rate: f64,
    /// By joint; none of a joint that was not seen to move, or whose model errs too much.
    pub joints: Vec<Option<JointColour>>,
}

/// The colour of one joint's rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointColour {
    /// a_1 … of r(t) = Σ a_k·r(t−k) + e(t).
    pub coefficients: [f64; ORDER],
    /// Standard deviation of e, N·m.
    pub deviation: f64,
    /// By how many of these the mean of e differs from zero without a change.
    pub margin: f64,
}

impl JointColour {
    /// Standard deviation of what the model leaves behind a low pass of `bandwidth` rad/s, and its mean at most, N·m; `rate` is
    /// that of the rows, 1/s. Sums of the impulse response of both filters.
    #[must_use]
    pub fn low_passed(&self, bandwidth: f64, rate: f64) -> [f64; 2] {
        let keep = (-bandwidth / rate).exp();
        let (mut past, mut low, mut squares, mut sum) = ([0.0; ORDER], 0.0, 0.0, 0.0);
        for k in 0..IMPULSE {
            let input = if k == 0 { 1.0 } else { 0.0 };
            let now = input + self.coefficients.iter().zip(&past).map(|(a, r)| a * r).sum::<f64>();
            past.copy_within(..ORDER - 1, 1);
            past[0] = now;
            low = keep * low + (1.0 - keep) * now;
            (squares, sum) = (squares + low * low, sum + low);
        }
        [self.deviation * f64::sqrt(squares), self.deviation * self.margin * f64::abs(sum)]
    }

    /// As the test of a controller takes it.
    #[must_use]
    pub fn for_test(&self) -> change::Colour<f64> {
        change::Colour { coefficients: self.coefficients, deviation: self.deviation, margin: self.margin }
    }
}

/// The rows of a stretch of time on an even grid.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Their times in the log's own t, s.
    pub t: Vec<f64>,
    /// By joint and row; none while the joint rests.
    pub joints: Vec<Vec<Option<Shown<f64>>>>,
}

impl Rows {
    /// Those of a recording for which a model predicts a torque, n a sample.
    #[must_use]
    pub fn new(model: &TorqueModel, recording: &Recording, predicted: &[f64]) -> Rows {
        let n = recording.dof;
        let band = Band::new(BAND, recording.rate);
        let kept = band.kept(recording.len());
        let laws: Vec<TanhFriction<f64>> = model.gammas().into_iter().map(TanhFriction::new).collect();
        let of_joint = |j: usize| {
            let torque: Vec<f64> = predicted.iter().skip(j).step_by(n).copied().collect();
            let measured = recording.smooth_torque(j);
            let left: Vec<f64> = measured.iter().zip(&torque).map(|(m, p)| m - p).collect();
            let friction: Vec<f64> = recording.velocity(j).map(|v| laws[j].torque(v)).collect();
            let rate = difference::derivative(&torque, 1.0 / recording.rate);
            let late: Vec<f64> = rate.iter().map(|rate| rate * LATE).collect();
            let [left, friction, torque, late] =
                [left, friction, torque, late].map(|signal| band.pass(&signal));
            let speed: Vec<f64> = recording.velocity(j).collect();
            let row = |(row, k): (usize, &usize)| {
                let shown = Shown { residual: left[row], columns: [friction[row], torque[row], late[row]] };
                (speed[*k].abs() > REST).then_some(shown)
            };
            kept.iter().enumerate().map(row).collect()
        };
        let t = kept.iter().map(|k| recording.start + *k as f64 / recording.rate).collect();
        Rows { t, joints: (0..n).map(of_joint).collect() }
    }
}

/// Rows a second of logs of so many samples a second.
#[must_use]
pub fn rows_a_second(rate: f64) -> f64 {
    rate / Band::new(BAND, rate).decimation as f64
}

impl Colour {
    /// What a model leaves on logs: `body` is the arm with the model's changes. The mean time to a false alarm is
    /// `level` rows, and friction may wander by ± `range` of itself. `None` where there is nothing to learn from.
    #[must_use]
    pub fn learn(
        model: &TorqueModel,
        body: &RigidArm,
        logs: &[Log],
        level: f64,
        range: f64,
    ) -> Option<Colour> {
        let logs = &*logs_of_motors(body.arm(), logs);
        let mut steps: Vec<f64> = logs.iter().filter_map(|log| median_step(&log.t)).collect();
        steps.sort_by(f64::total_cmp);
        let step = *steps.get(steps.len() / 2)?;
        let mut rows = Vec::new();
        for log in logs {
            for piece in log.pieces.clone() {
                let recording = Recording::new(log, 0, piece, step, DataOptions::default().smoothing);
                // Shorter than what the band's filter needs at its ends: no rows.
                for recording in recording.into_iter().filter(|r| r.len() as f64 > r.rate) {
                    let predicted = model.torque(body, &recording, &|_| false);
                    rows.push(Rows::new(model, &recording, &predicted));
                }
            }
        }
        Colour::of_rows(&rows, 1.0 / step, level, range)
    }

    /// The same of rows of logs with `rate` samples a second.
    #[must_use]
    pub fn of_rows(rows: &[Rows], rate: f64, level: f64, range: f64) -> Option<Colour> {
        let dof = rows.first()?.joints.len();
        let of_joint = |j: usize| {
            let joint: Vec<&[Option<Shown<f64>>]> = rows.iter().map(|r| r.joints[j].as_slice()).collect();
            joint_colour(&joint, level, range)
        };
        let joints: Vec<Option<JointColour>> = (0..dof).map(of_joint).collect();
        joints.iter().any(Option::is_some).then_some(Colour { rate, joints })
    }
}

fn joint_colour(rows: &[&[Option<Shown<f64>>]], level: f64, range: f64) -> Option<JointColour> {
    let (mut past, mut now) = (vec![Vec::new(); ORDER], Vec::new());
    for rows in rows {
        for window in rows.windows(ORDER + 1) {
            let Some(values) =
                window.iter().map(|r| Some(r.as_ref()?.residual)).collect::<Option<Vec<f64>>>()
            else {
                continue;
            };
            past.iter_mut().enumerate().for_each(|(k, past)| past.push(values[ORDER - 1 - k]));
            now.push(values[ORDER]);
        }
    }
    if now.len() < FEWEST {
        return None;
    }
    let equations = NormalEquations::of(&past, &now);
    let found = equations.solve();
    let deviation = (equations.left(&found) / (now.len() - ORDER) as f64).sqrt();
    let mut coefficients = [0.0; ORDER];
    coefficients.iter_mut().zip(found).for_each(|(to, from)| *to = from);
    let mut colour = JointColour { coefficients, deviation, margin: 0.0 };
    // The least margin with which the tests stay calm.
    let calm = level.powf(CALM);
    let (mut low, mut high) = (LEAST_MARGIN, MOST_MARGIN);
    for _ in 0..STEPS {
        colour.margin = 0.5 * (low + high);
        if most_capital(&colour, rows, range) < calm { high = colour.margin } else { low = colour.margin }
    }
    colour.margin = high;
    (deviation > 0.0 && high < MOST_MARGIN).then_some(colour)
}

/// The mean capital of the bets when it is largest.
fn most_capital(colour: &JointColour, rows: &[&[Option<Shown<f64>>]], range: f64) -> f64 {
    let mut test = JointTest::new(colour.for_test(), range);
    let mut most = 0.0f64;
    for rows in rows {
        test.interrupt();
        for (number, row) in rows.iter().enumerate() {
            match row {
                Some(shown) => test.update(*shown, number as u64),
                None => test.interrupt(),
            }
            most = most.max(test.capital() / change::BETS as f64);
        }
    }
    most
}
