//! Two logs of one path: friction compared stroke by stroke, without a model.
//!
//! Where two logs run one path, weight and inertia are the same in both, so that the torque against the
//! motion differs by friction alone. A stroke is a joint's way from one reversal to the next. Its median
//! torque against the motion, less that of the same stroke of the other log, is one draw of the difference;
//! the mean over strokes forwards and that over strokes backwards count alike, so that a body or a zero of
//! the torques, whose part turns its sign with the direction, drops out.

use crate::estimate::distribution::{f_tail, t_critical};
use powerball_logs::log::Log;
use powerball_logs::regression::{DataOptions, Recording};
use powerball_logs::signal::motion::REST_SPEED;
use powerball_logs::signal::resample::median_step;
use powerball_logs::vector::median;

/// A joint's way from one reversal to the next.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    /// The part of the stroke at its usual velocity, from and to, rad or m.
    pub ends: [f64; 2],
    /// Median velocity, rad/s or m/s.
    pub velocity: f64,
    /// Median torque against the motion, N·m or N.
    pub against: f64,
}

/// How much friction of a joint differs between two logs of one path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// Mean friction in the one, N·m or N.
    friction: f64,
    /// How much more it is in the other.
    difference: f64,
    /// The standard error of the difference.
    std: f64,
    freedom: f64,
}

/// Slower parts of a stroke than this share of its largest velocity are left out: friction changes with the
/// velocity there.
const FAST: f64 = 0.5;
/// A stroke of fewer samples has no median to speak of.
const FEWEST_SAMPLES: usize = 8;
/// Two logs run one path where all but this share of the strokes are alike …
const OTHERS: f64 = 0.2;
/// … that is, their ends differ by at most this share of the joint's travel, and their velocities by this
/// share.
const ALIKE: f64 = 0.05;
/// Strokes of one log that may have none in the other, in a row.
const SKIPPED: usize = 4;
/// Strokes in either direction that a comparison needs.
const FEWEST: usize = 2;
/// Friction of an arm at work wanders by as much with its warmth: what differs by less is not a difference.
const WANDERS: f64 = 0.05;

/// The strokes of each joint along a log, in their order.
pub(super) fn strokes(log: &Log) -> Vec<Vec<Stroke>> {
    let smoothing = DataOptions::default().smoothing;
    let mut all = vec![Vec::new(); log.q.len()];
    for piece in &log.pieces {
        let t = &log.t[piece.clone()];
        let Some(step) = median_step(t) else { continue };
        let Some(recording) = Recording::new(log, 0, piece.clone(), step, smoothing) else { continue };
        for (j, strokes) in all.iter_mut().enumerate() {
            let q: Vec<f64> = recording.position(j).collect();
            let v: Vec<f64> = recording.velocity(j).collect();
            let side = |v: f64| if v.abs() > REST_SPEED { v.signum() } else { 0.0 };
            let mut from = 0;
            while from < v.len() {
                let to = (from..v.len()).find(|k| side(v[*k]) != side(v[from])).unwrap_or(v.len());
                strokes.extend(stroke(
                    &q[from..to],
                    &v[from..to],
                    &recording.torque[j][from..to],
                    side(v[from]),
                ));
                from = to;
            }
        }
    }
    all
}

/// The part of a way in one direction in which it is fast.
fn stroke(q: &[f64], v: &[f64], torque: &[f64], side: f64) -> Option<Stroke> {
    let top = v.iter().fold(0.0, |top: f64, v| top.max(v.abs()));
    let fast: Vec<usize> = (0..v.len()).filter(|k| v[*k].abs() > FAST * top).collect();
    if side == 0.0 || fast.len() < FEWEST_SAMPLES {
        return None;
    }
    let of = |what: &dyn Fn(usize) -> f64| median(&mut fast.iter().map(|k| what(*k)).collect::<Vec<f64>>());
    Some(Stroke {
        ends: [q[*fast.first()?], q[*fast.last()?]],
        velocity: of(&|k| v[k]),
        against: of(&|k| side * torque[k]),
    })
}

/// The difference of friction by joint, `b` minus `a`; `None` where the logs do not run one path, or the
/// joint does not go both ways often enough.
pub(super) fn changes(a: &[Vec<Stroke>], b: &[Vec<Stroke>]) -> Vec<Option<Change>> {
    let pairs: Vec<Option<Vec<(Stroke, Stroke)>>> = a.iter().zip(b).map(|(a, b)| matched(a, b)).collect();
    // A joint that rests in both carries no information; one on another path shows that the torques of the
    // others differ.
    match pairs.iter().all(Option::is_some) {
        true => pairs.iter().map(|pairs| Change::of(pairs.as_deref()?)).collect(),
        false => vec![None; a.len()],
    }
}

/// The strokes of one joint in pairs; `None` where it is on another path.
fn matched(a: &[Stroke], b: &[Stroke]) -> Option<Vec<(Stroke, Stroke)>> {
    let all = || a.iter().chain(b).flat_map(|stroke| stroke.ends);
    let travel = all().fold(f64::MIN, f64::max) - all().fold(f64::MAX, f64::min);
    let alike = |a: &Stroke, b: &Stroke| {
        let near = |k: usize| (a.ends[k] - b.ends[k]).abs() <= ALIKE * travel;
        near(0) && near(1) && (a.velocity - b.velocity).abs() <= ALIKE * a.velocity.abs()
    };
    let shortest = a.len().min(b.len());
    if shortest == 0 {
        return (a.len().max(b.len()) == 0).then(Vec::new);
    }
    let mut pairs: Vec<(Stroke, Stroke)> = Vec::new();
    let mut next = 0;
    for stroke in a {
        // One of them may start later, and noise cuts a slow stroke in two.
        let reach = if pairs.is_empty() { b.len() } else { (next + SKIPPED).min(b.len()) };
        if let Some(k) = (next..reach).find(|k| alike(stroke, &b[*k])) {
            pairs.push((*stroke, b[k]));
            next = k + 1;
        }
    }
    (pairs.len() as f64 >= (1.0 - OTHERS) * shortest as f64).then_some(pairs)
}

/// Whether an interval of a change, as a share of friction, has sizes in it by which friction wanders alone.
pub(super) fn wanders([low, high]: [f64; 2]) -> bool {
    low <= WANDERS && high >= -WANDERS
}

impl Change {
    fn of(pairs: &[(Stroke, Stroke)]) -> Option<Change> {
        let one_way = |side: f64| -> Option<[f64; 3]> {
            let own = || pairs.iter().filter(|(a, _)| a.velocity.signum() == side);
            let count = own().count();
            if count < FEWEST {
                return None;
            }
            let mean = |of: &dyn Fn(&(Stroke, Stroke)) -> f64| own().map(of).sum::<f64>() / count as f64;
            let difference = mean(&|(a, b)| b.against - a.against);
            let square = mean(&|(a, b)| (b.against - a.against - difference).powi(2));
            Some([mean(&|(a, _)| a.against), difference, square / (count - 1) as f64])
        };
        let (forwards, backwards) = (one_way(1.0)?, one_way(-1.0)?);
        let [friction, difference] = [0, 1].map(|k| 0.5 * (forwards[k] + backwards[k]));
        let std = 0.5 * (forwards[2] + backwards[2]).sqrt();
        (friction > 0.0).then(|| Change { friction, difference, std, freedom: (pairs.len() - 2) as f64 })
    }

    /// How often friction that wanders by [`WANDERS`] alone would differ so.
    pub(super) fn p_value(&self) -> f64 {
        let beyond = self.difference.abs() - WANDERS * self.friction;
        if beyond <= 0.0 {
            return 1.0;
        }
        let t = beyond / self.std.max(f64::MIN_POSITIVE);
        f_tail(t * t, 1.0, self.freedom)
    }

    /// Interval of the difference as a share of friction, which misses with probability `p`.
    pub(super) fn interval(&self, p: f64) -> [f64; 2] {
        let half = t_critical(p, self.freedom) * self.std;
        [self.difference - half, self.difference + half].map(|end| end / self.friction)
    }
}
