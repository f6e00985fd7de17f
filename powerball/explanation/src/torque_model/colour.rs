//! The colour of a model's residual, and the size of its error: a watch compares changes with both.

use super::at_rest::{RestLimits, rests};
use super::rows::{Rows, Shown};
use super::{Detector, TorqueModel};
use powerball_controller::change::{self, LEAST_MARGIN, ORDER};
use powerball_identification::estimate::NormalEquations;
use powerball_logs::log::{Log, logs_of_motors};
use powerball_logs::regression::{DataOptions, Recording, RigidArm};
use powerball_logs::signal::resample::median_step;
use powerball_logs::signal::{Band, motion};
use serde::{Deserialize, Serialize};

/// Least number of rows from which a joint's colour is learnt.
const FEWEST: usize = 200;
/// The margin is such that no test on the logs it was learnt from comes nearer to an alarm than the level to
/// the power of this.
const CALM: f64 = 0.5;
/// A joint whose model is wrong by more standard deviations than this cannot be watched.
const MOST_MARGIN: f64 = 1.5;
/// Rows in which a colour's impulse response is over.
const IMPULSE: usize = 2000;
/// Steps of the search for a margin.
const STEPS: usize = 8;
/// Joints together may need margins up to this many times as large as each by itself.
const TOGETHER: f64 = 4.0;

/// The residual of a model on logs on which it holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Colour {
    /// Samples a second of the logs.
    pub rate: f64,
    /// By joint; none for a joint that was not seen to move, or whose model's error is too large.
    pub joints: Vec<Option<JointColour>>,
    /// How far torques at rest may be from the model's; none where no log shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<RestLimits>,
}

/// The colour of one joint's rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointColour {
    /// a_1 … of r(t) = Σ a_k·r(t−k) + e(t).
    pub coefficients: [f64; ORDER],
    /// Standard deviation of e, N·m.
    pub deviation: f64,
    /// Number of these by which the mean of e differs from zero without a change.
    pub margin: f64,
}

impl JointColour {
    /// Standard deviation of the model's residual after a low pass of `bandwidth` rad/s, and its mean at
    /// most, N·m; `rate` is that of the rows, 1/s. Sums of the impulse response of both filters.
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

    /// This colour with another margin.
    fn with(&self, margin: f64) -> JointColour {
        let mut own = self.clone();
        own.margin = margin;
        own
    }

    /// The colour in the form of the controller's test.
    #[must_use]
    pub fn for_test(&self) -> change::Colour<f64> {
        change::Colour { coefficients: self.coefficients, deviation: self.deviation, margin: self.margin }
    }
}

impl Colour {
    /// Learns the residual of a model from logs: `body` is the arm with the model's changes. The mean time to
    /// a false alarm is `level` rows, and friction may wander by ± `range` of itself. `None` where there is
    /// nothing to learn from.
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
        let mut recordings: Vec<Recording> = Vec::new();
        for log in logs {
            let smoothing = DataOptions::default().smoothing;
            let of = |piece| Recording::new(log, 0, piece, step, smoothing);
            // Shorter than what the band's filter needs at its ends: no rows.
            recordings
                .extend(log.pieces.clone().into_iter().filter_map(of).filter(|r| r.len() as f64 > r.rate));
        }
        let of = |recording: &Recording| {
            let predicted = model.torque(body, recording, &|_| false);
            Rows::new(model, body, recording, &predicted)
        };
        let rows: Vec<Rows> = recordings.iter().map(of).collect();
        let mut colour = Colour::of_rows(&rows, 1.0 / step, level, range)?;
        colour.rest = rest_limits(model, body, &recordings, &rows);
        Some(colour)
    }

    /// Like [`Colour::learn`], from rows of logs with `rate` samples a second.
    #[must_use]
    pub fn of_rows(rows: &[Rows], rate: f64, level: f64, range: f64) -> Option<Colour> {
        let dof = rows.first()?.joints.len();
        let mut joints: Vec<Option<JointColour>> = (0..dof).map(|j| joint_colour(rows, j)).collect();
        let calm = level.powf(CALM);
        let is_calm = |joints: &[Option<JointColour>]| most_capital(joints, rows, range) < calm;
        for j in 0..dof {
            let Some(own) = joints[j].clone() else { continue };
            let alone = |margin: f64| {
                let mut colours = vec![None; dof];
                colours[j] = Some(own.with(margin));
                is_calm(&colours)
            };
            let margin = least(LEAST_MARGIN, MOST_MARGIN, alone);
            joints[j] = margin.map(|margin| own.with(margin));
        }
        let scaled = |by: f64| -> Vec<Option<JointColour>> {
            let scale = |own: &JointColour| own.with(own.margin * by);
            joints.iter().map(|own| own.as_ref().map(scale)).collect()
        };
        // For joints that are calm alone but not together; if no such margin helps, each keeps its own.
        let by = least(1.0, TOGETHER, |by| is_calm(&scaled(by))).unwrap_or(1.0);
        let joints = scaled(by);
        joints.iter().any(Option::is_some).then_some(Colour { rate, joints, rest: None })
    }
}

/// How far torques at rest may be from a model's where it holds; none where no log rests.
fn rest_limits(
    model: &TorqueModel,
    body: &RigidArm,
    recordings: &[Recording],
    rows: &[Rows],
) -> Option<RestLimits> {
    let joints = 0..body.dof();
    let velocity = |j: usize| {
        let speeds = recordings.iter().flat_map(|r| r.velocity(j).map(f64::abs)).collect();
        motion::rest_velocity(speeds, body.velocity_limit(j))
    };
    let velocity: Vec<f64> = joints.clone().map(velocity).collect();
    let error = |j: usize| {
        let (mut square, mut count) = (0.0, 0.0);
        for shown in rows.iter().flat_map(|rows| &rows.joints[j]).flatten() {
            (square, count) = (square + shown.residual.powi(2), count + 1.0);
        }
        f64::sqrt(square / f64::max(count, 1.0))
    };
    let errors: Vec<f64> = joints.map(error).collect();
    let of = |recording: &Recording| {
        let band = Band::new(DataOptions::default().cutoff, recording.rate);
        rests(recording, &velocity, &band, |still| model.torque(body, still, &|_| false))
    };
    let rests: Vec<_> = recordings.iter().flat_map(of).collect();
    let others: Vec<_> = rests.iter().collect();
    (!others.is_empty()).then(|| RestLimits::new(&velocity, &model.usual_at_rest(&errors), &others, &[]))
}

/// The least number in a range for which a condition holds that also holds for all larger ones; `None` if
/// there is none.
fn least(low: f64, high: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    if holds(low) {
        return Some(low);
    }
    let (mut low, mut high) = (low, Some(high).filter(|high| holds(*high))?);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

/// A joint's colour with no margin; none where too few rows show it.
fn joint_colour(rows: &[Rows], j: usize) -> Option<JointColour> {
    let (mut past, mut now) = (vec![Vec::new(); ORDER], Vec::new());
    for rows in rows {
        for window in rows.joints[j].windows(ORDER + 1) {
            let residual = |row: &Option<Shown>| Some(row.as_ref()?.residual);
            let Some(values) = window.iter().map(residual).collect::<Option<Vec<f64>>>() else { continue };
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
    (deviation > 0.0).then_some(JointColour { coefficients, deviation, margin: 0.0 })
}

/// The average capital of the bets when it is largest.
fn most_capital(colours: &[Option<JointColour>], rows: &[Rows], range: f64) -> f64 {
    let mut test = Detector::new(colours, range);
    let mut most = 0.0f64;
    for rows in rows {
        test.interrupt();
        for number in 0..rows.t.len() {
            test.update(rows.row(number), number as u64);
            most = most.max(test.capital());
        }
    }
    most
}
