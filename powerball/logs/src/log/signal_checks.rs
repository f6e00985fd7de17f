//! What one log's signals say against themselves, before an arm is asked: logged velocities against
//! positions, levels, and the signs of torques. What an arm says against the columns is asked by
//! `identification::conventions`.

use super::map::velocity_units;
use super::read::Raw;
use super::{Doubt, Finding};

// Logged velocities against logged positions: units, signs, columns that were exchanged, and clocks that
// disagree.
//
// Velocities are computed from positions; logged ones are used for these checks alone. What a joint moves
// within half a second is held against the integral of its logged velocity: no derivative is taken, so
// encoder steps and noise hardly count. On sound logs of real arms the two agree within 0.1 % with a
// correlation of 1.0000.

/// Length of the stretches that are compared, s.
const STRETCH: f64 = 0.5;
/// A joint that moves less than this in every stretch says nothing, rad.
const STILL: f64 = 0.02;
/// Columns belong together from this correlation on, and not below the other.
const SAME: f64 = 0.995;
const OTHER: f64 = 0.9;
/// Clocks that differ by more than this share are named.
const CLOCKS: f64 = 5e-3;
/// With a time base that is off by more than this share no inertia and no friction is right.
const WRONG_TIME: f64 = 0.1;
/// A ratio is that of a unit where it differs from it by no more than this share.
const LIKE_UNIT: f64 = 0.03;

/// How far joint `j` moved in each stretch, and the integral of `dq`'s column `k`.
struct Stretches {
    moved: Vec<f64>,
    integral: Vec<Vec<f64>>,
}

/// Looks at the velocities of a log; gives what makes the log useless as it stands.
pub(super) fn velocities(raw: &Raw, step: f64, warnings: &mut Warnings<'_>) -> Vec<Doubt> {
    let n = raw.q.len();
    if raw.dq.iter().any(|dq| dq.len() != raw.t.len()) {
        return Vec::new();
    }
    let joints: Vec<Stretches> = (0..n).map(|j| stretches(raw, step, j)).collect();
    if let Some(doubt) = wrong_time(&joints) {
        return vec![doubt];
    }
    let mut ratios = Vec::new();
    for (j, joint) in joints.iter().enumerate() {
        let largest = joint.moved.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if largest < STILL {
            continue;
        }
        let name = format!("dq{}", j + 1);
        let (ratio, own) = slope(&joint.moved, &joint.integral[j]);
        let like = |k: &usize| slope(&joint.moved, &joint.integral[*k]).1;
        let other = (0..n).filter(|k| *k != j).max_by(|a, b| like(a).abs().total_cmp(&like(b).abs()));
        if let Some(other) = other.filter(|k| own.abs() < OTHER && like(k) > SAME) {
            let message = format!(
                "is not the slope of q{}, but dq{} is: columns of joints {} and {} were exchanged, in q or \
                    in dq. Compare with the drives before this log is used",
                j + 1,
                other + 1,
                j + 1,
                other + 1
            );
            warnings.add(None, name, message, Severity::Warning);
        } else if own.abs() < OTHER || ratio.abs() < 1e-9 {
            warnings.add(
                None,
                name,
                format!(
                    "does not follow q{}: check the order and the units of the \
                columns. Velocities are computed from q; dq is not used",
                    j + 1
                ),
                Severity::Warning,
            );
        } else if !(0.67..1.5).contains(&ratio) {
            // The ratio is q's slope over dq.
            let of_dq = velocity_units().find(|(_, unit)| (ratio / unit - 1.0).abs() < LIKE_UNIT);
            let unit = of_dq.map(|(unit, _)| format!("dq looks like {unit} (--map 'dq.unit = \"{unit}\"')"));
            let (hint, severity) = if let Some(hint) = &unit {
                (hint.as_str(), Severity::Warning)
            } else if (ratio / 57.2958 - 1.0).abs() < 0.25 {
                ("q looks like degrees (--map 'q.unit = \"deg\"')", Severity::Unusable)
            } else if ratio < 0.0 {
                ("their signs differ", Severity::Warning)
            } else {
                ("check units and order of columns", Severity::Warning)
            };
            let message = format!(
                "is {:.3} times the slope of q{}: {hint}. Velocities are computed from q; dq is not used",
                1.0 / ratio,
                j + 1
            );
            warnings.add(None, name, message, severity);
        } else if own > SAME {
            ratios.push((j, ratio));
        }
    }
    clocks(raw, &joints, &ratios, warnings);
    Vec::new()
}

/// Whether all joints' velocities differ from the slopes of their positions by one factor that is none of a
/// unit.
fn wrong_time(joints: &[Stretches]) -> Option<Doubt> {
    let moves = |joint: &Stretches| joint.moved.iter().any(|x| x.abs() >= STILL);
    let found = joints.iter().enumerate().filter(|(_, joint)| moves(joint));
    let mut ratios: Vec<f64> = found
        .map(|(j, joint)| slope(&joint.moved, &joint.integral[j]))
        .map(|(ratio, like)| if like > SAME { ratio } else { f64::NAN })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let (least, most) = (*ratios.first()?, *ratios.last()?);
    // One joint alone may have a unit of its own.
    let common = ratios[ratios.len() / 2];
    let alike = ratios.len() >= 2 && most - least < 0.02 * common;
    let of_unit = velocity_units()
        .any(|(_, unit)| [common / unit, common * unit].iter().any(|ratio| (ratio - 1.0).abs() < LIKE_UNIT));
    if !alike || of_unit || (common - 1.0).abs() < WRONG_TIME {
        return None;
    }
    // More digits are not known, and all logs are to say the same.
    let factor: f64 = format!("{common:.2e}").parse().unwrap_or(common);
    let pace = if common > 1.0 { factor } else { 1.0 / factor };
    let map = format!("t.scale = {factor}");
    let sentence = format!(
        "Time runs {pace:.2} times too {}: on all joints that move dq is {:.2} times the slope of q (--map \
         '{map}'; where t is right dq has another unit, and 'dq.scale = {factor}' says so).",
        if common > 1.0 { "fast" } else { "slowly" },
        1.0 / factor,
    );
    Some(Doubt { sentence, map: Some(map) })
}

/// Drives integrate their velocities on their own clocks: where all joints disagree with `t` alike, it is `t`
/// that is off.
fn clocks(raw: &Raw, joints: &[Stretches], ratios: &[(usize, f64)], warnings: &mut Warnings<'_>) {
    let mut all: Vec<f64> = ratios.iter().map(|(_, ratio)| *ratio).collect();
    all.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (all.first(), all.last()) else { return };
    let common = all[all.len() / 2];
    if all.len() >= 2 && (common - 1.0).abs() > CLOCKS && most - least < 0.5 * (common - 1.0).abs() {
        let message = format!(
            "passes {:.1} % too {} for the joints' velocities, on every joint alike: the time base is off \
                (are these the times of the samples, or a count times a nominal step?)",
            100.0 * (common - 1.0).abs(),
            if common > 1.0 { "slowly" } else { "fast" }
        );
        warnings.add(None, "t".into(), message, Severity::Warning);
    }
    // The same in the first and the last third.
    let third = |from: usize, to: usize| -> Vec<f64> {
        let part = |j: usize| {
            let joint = &joints[j];
            let count = joint.moved.len();
            let range = from * count / 3..to * count / 3;
            let moved = &joint.moved[range.clone()];
            let (ratio, like) = slope(moved, &joint.integral[j][range]);
            (moved.iter().any(|x| x.abs() > STILL) && like > SAME).then_some(ratio)
        };
        let mut found: Vec<f64> = ratios.iter().filter_map(|(j, _)| part(*j)).collect();
        found.sort_by(f64::total_cmp);
        found
    };
    let (first, last) = (third(0, 1), third(2, 3));
    if let (Some(a), Some(b)) = (first.get(first.len() / 2), last.get(last.len() / 2))
        && first.len() >= 2
        && last.len() >= 2
        && (b - a).abs() > 2.0 * CLOCKS
    {
        let begin = raw.t.len() * 2 / 3;
        let message = format!(
            "drifts against the joints' velocities: by {:.1} % from the first third of the log to the last",
            100.0 * (b - a)
        );
        warnings.add(Some(begin), "t".into(), message, Severity::Warning);
    }
}

fn stretches(raw: &Raw, step: f64, j: usize) -> Stretches {
    let length = ((STRETCH / step).round() as usize).max(2);
    let starts = || (0..raw.t.len().saturating_sub(length)).step_by((length / 4).max(1));
    // A gap is no stretch.
    let sound = |k: &usize| raw.t[k + length] - raw.t[*k] < 2.0 * STRETCH;
    let moved = starts().filter(sound).map(|k| raw.q[j][k + length] - raw.q[j][k]).collect();
    let integral = raw
        .dq
        .iter()
        .map(|dq| {
            let mut sum = vec![0.0; raw.t.len()];
            for k in 1..raw.t.len() {
                let area = 0.5 * (dq[k] + dq[k - 1]) * (raw.t[k] - raw.t[k - 1]);
                sum[k] = sum[k - 1] + if area.is_finite() { area } else { 0.0 };
            }
            starts().filter(sound).map(|k| sum[k + length] - sum[k]).collect()
        })
        .collect();
    Stretches { moved, integral }
}

/// y = slope·x by least squares through zero, and their correlation about zero.
fn slope(y: &[f64], x: &[f64]) -> (f64, f64) {
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (y, x) in y.iter().zip(x) {
        xy += x * y;
        xx += x * x;
        yy += y * y;
    }
    if xx <= 0.0 || yy <= 0.0 { (0.0, 0.0) } else { (xy / xx, xy / (xx * yy).sqrt()) }
}

// The levels of a signal: coarse steps, and tops that are flat because something saturates.

/// A saturated signal rests at its extreme for at least this many samples one after another.
const FLAT: usize = 4;
/// … and for this share of the log in all.
const FLAT_SHARE: f64 = 2e-3;
/// … and this many times more often than just below it: a signal that turns there is at most 2.4 times as
/// often in its last step as in the one before.
const PILED: f64 = 4.0;
/// Fewer steps than these across what a signal covers are worth telling.
const STEPS_POSITION: f64 = 500.0;
const STEPS_EFFORT: f64 = 40.0;

/// Whether a torque or current signal never changes, or is cut off at an extreme.
pub(super) fn effort(x: &[f64], name: &str, warnings: &mut Warnings<'_>) {
    let (low, high) = x.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    if high - low <= 1e-12 * high.abs().max(low.abs()) {
        let message = "never changes: the joint's sensor or drive is dead, or it was not recorded";
        warnings.add(None, name.into(), message.into(), Severity::Warning);
        return;
    }
    for (edge, sign) in [(low, -1.0), (high, 1.0)] {
        let runs = x.chunk_by(|a, b| a == b).scan(0, |at, run| {
            *at += run.len();
            Some((*at - run.len(), run))
        });
        let flat: Vec<(usize, usize)> = runs
            .filter(|(_, run)| run[0] == edge && run.len() >= FLAT)
            .map(|(at, run)| (at, run.len()))
            .collect();
        let resting: usize = flat.iter().map(|(_, length)| length).sum();
        // The band below the edge: as wide as 2 % of the range, or to the next level.
        let next = x.iter().filter(|v| **v != edge).map(|v| sign * (edge - v)).fold(f64::INFINITY, f64::min);
        let width = (0.02 * (high - low)).max(1.001 * next);
        let below = x.iter().filter(|v| **v != edge && sign * (edge - **v) <= width).count();
        let piled = resting as f64 > PILED * below.max(1) as f64;
        if let Some((first, _)) = flat.first().filter(|_| edge != 0.0 && piled)
            && resting as f64 > FLAT_SHARE * x.len() as f64
        {
            let message = format!(
                "stays at its extreme {edge} for {resting} samples (first here): it looks saturated, and the \
                    model cannot explain torque that was not delivered"
            );
            warnings.add(Some(*first), name.into(), message, Severity::Warning);
        }
    }
}

/// Whether a signal has few levels.
pub(super) fn steps(x: &[f64], name: &str, position: bool, warnings: &mut Warnings<'_>) {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let range = sorted[sorted.len() - 1] - sorted[0];
    let least = if position { 0.05 } else { 0.0 };
    if range <= least {
        return;
    }
    let gaps = || sorted.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > 1e-9 * range);
    let step = gaps().fold(f64::INFINITY, f64::min);
    let count = range / step;
    // Every difference of levels is a number of steps, or there are none.
    let off = gaps().filter(|gap| (gap / step - (gap / step).round()).abs() > 0.1).count();
    let most = if position { STEPS_POSITION } else { STEPS_EFFORT };
    if count < most && off == 0 {
        let consequence = match position {
            true => "accelerations computed from it are mostly noise: log the encoder's full resolution",
            false => "errors below that step mean nothing",
        };
        let message = format!("has {:.0} levels, {step:.3e} apart: {consequence}", count + 1.0);
        warnings.add(None, name.into(), message, Severity::Warning);
    }
}

// Whether torques have the signs of their joints: friction only ever takes.
//
// Between one reversal of a joint and the next its mean torque holds gravity, inertia and friction. Over
// many half swings the first two come out alike in both directions, friction does not: forward swings take
// more torque than backward ones. Where it is clearly the other way round, torque or position has the wrong
// sign. On sound logs of a UR10e the difference is 1 to 40 standard errors above zero.

/// Half swings in either direction, at least.
const SWINGS: usize = 4;
/// Standard errors below zero.
const CLEAR: f64 = 5.0;
/// Range of a joint that moves, rad.
const MOVES: f64 = 0.1;

/// Looks at each joint's torque or current.
pub(super) fn torque_signs(raw: &Raw, step: f64, name: &str, warnings: &mut Warnings<'_>) {
    for (j, (q, effort)) in raw.q.iter().zip(&raw.effort).enumerate() {
        let range = q.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        if range.1 - range.0 < MOVES {
            continue;
        }
        let stride = ((0.05 / step) as usize).max(1);
        let velocities: Vec<f64> = (stride..q.len().saturating_sub(stride))
            .map(|k| (q[k + stride] - q[k - stride]) / (raw.t[k + stride] - raw.t[k - stride]))
            .collect();
        let top = velocities.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        // Mean effort of every half swing; what is slow belongs to none.
        let direction = |v: f64| if v.abs() < 0.1 * top { 0.0 } else { v.signum() };
        let mut swings: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        let (mut sum, mut count, mut now) = (0.0, 0usize, 0.0);
        for (k, v) in velocities.iter().enumerate() {
            let next = direction(*v);
            if next != 0.0 && next != now {
                if count as f64 * step > 0.1 {
                    swings[usize::from(now > 0.0)].push(sum / count as f64);
                }
                (sum, count, now) = (0.0, 0, next);
            }
            if next != 0.0 {
                sum += effort[k + stride];
                count += 1;
            }
        }
        let [backward, forward] = swings.map(|means| mean(&means));
        let (Some((b, eb)), Some((f, ef))) = (backward, forward) else { continue };
        let error = (eb + ef).sqrt();
        if f - b < -CLEAR * error && error > 0.0 {
            let message = format!(
                "is {:.3} less on the way forward than on the way back, {:.0} standard errors: friction \
                    would have to drive the joint. Its sign, or that of q{}, is wrong",
                b - f,
                (b - f) / error,
                j + 1
            );
            warnings.add(None, format!("{name}{}", j + 1), message, Severity::Warning);
        }
    }
}

/// Mean and the square of its standard error; `None` with too few.
fn mean(x: &[f64]) -> Option<(f64, f64)> {
    if x.len() < SWINGS {
        return None;
    }
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    Some((mean, x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n))
}

// Where the checks put what they find.

/// What a finding means for the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Severity {
    /// The user should know.
    Warning,
    /// The signal cannot be used.
    Unusable,
}

/// Findings about one log, each with the line and the time of its sample.
pub(super) struct Warnings<'a> {
    pub file: &'a str,
    pub line: &'a [usize],
    pub t: &'a [f64],
    pub findings: &'a mut Vec<Finding>,
    pub errors: &'a mut Vec<Finding>,
}

impl Warnings<'_> {
    /// Adds a finding; `sample` is the one that it begins at, where it is not about the whole log.
    pub(super) fn add(
        &mut self,
        sample: Option<usize>,
        quantity: String,
        message: String,
        severity: Severity,
    ) {
        let when = sample.and_then(|k| self.t.get(k)).map_or(String::new(), |t| format!("at {t:.3} s: "));
        let finding = Finding {
            file: self.file.to_string(),
            line: sample.and_then(|k| self.line.get(k).copied()),
            quantity,
            message: format!("{when}{message}"),
        };
        match severity {
            Severity::Warning => self.findings.push(finding),
            Severity::Unusable => self.errors.push(finding),
        }
    }
}
