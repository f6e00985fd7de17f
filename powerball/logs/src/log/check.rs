//! What can be wrong with numbers that are there: time, wraps, units, dead and saturated signals.

use super::map::{SLOWEST, time_unit};
use super::read::{Effort, GOAL, Raw};
use super::{Doubt, Finding, Log, LogError, Motors, Severity, Warnings, outliers, signal_checks};
use crate::signal::resample::median_step;
use dyngen::Arm;
use dyngen::arm::{Joint, JointKind};
use std::f64::consts::PI;
use std::mem::take;
use std::ops::Range;

/// A step between samples longer than this, s, or than [`GAP_STEPS`] median steps, is a gap.
const GAP: f64 = 0.1;
const GAP_STEPS: f64 = 5.0;
/// At most this many of a log's gaps and jumps are named one by one.
const SPLITS_SHOWN: usize = 5;
/// Time stamps that do not rise: up to this share are left out, more make the log unusable.
const MOST_STALE: f64 = 0.05;
/// The fewest samples with which anything can be done.
const FEWEST: usize = 20;
/// Beyond this many times a limit of the arm a position is in another unit, not a bold motion.
const ABSURD: f64 = 3.0;
/// Beyond this many times its limit a joint's typical torque is in another unit: mN·m and mA are a thousand
/// times as large. Limits of URDFs are often placeholders, and several times too small.
const OTHER_UNIT: f64 = 20.0;

/// The log of samples that were read; what is odd about them is added to `findings`.
pub(super) fn into_log(
    raw: &mut Raw,
    effort: &Effort,
    file: &str,
    arm: &Arm,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    let restarts = join_restarts(raw, file, findings);
    drop_stale(raw, file, findings)?;
    let step = sound_step(raw, file, findings)?;
    outliers::leave_out(raw, effort, (arm, file), findings);
    let doubts = check_signals(raw, effort, step, file, arm, findings)?;
    let pieces = pieces(raw, step, &restarts, (arm, file), findings);
    let torque = match effort {
        Effort::Torque | Effort::Goal => take(&mut raw.effort),
        Effort::Current(constants) => {
            let scaled = |(x, c): (Vec<f64>, &f64)| x.into_iter().map(|i| i * c).collect();
            of_motors(arm, take(&mut raw.effort).into_iter().zip(constants).map(scaled).collect())
        }
    };
    let temperature = raw.temperature.take().filter(|of| are_whole(of, file, findings));
    Ok(Log {
        file: file.to_string(),
        t: take(&mut raw.t),
        q: take(&mut raw.q),
        torque,
        temperature,
        motor: raw.motor.take(),
        pieces,
        doubts,
        clock: 0.0,
    })
}

/// Whether temperatures are there in every sample; each joint that lacks some is reported.
fn are_whole(temperature: &[Vec<f64>], file: &str, findings: &mut Vec<Finding>) -> bool {
    let before = findings.len();
    for (j, signal) in temperature.iter().enumerate() {
        let missing = signal.iter().filter(|v| !v.is_finite()).count();
        if missing > 0 {
            let message = format!(
                "{missing} of {} samples are no number: the log's temperatures are not used; fill these samples",
                signal.len()
            );
            findings.push(finding(file, None, format!("temp{}", j + 1), message));
        }
    }
    findings.len() == before
}

fn finding(file: &str, line: Option<usize>, quantity: impl Into<String>, message: String) -> Finding {
    Finding { file: file.to_string(), line, quantity: quantity.into(), message }
}

/// Samples after a clock's restart that rise and lie before it.
const AFTER_RESTART: usize = 5;
/// The gap between the parts of a log whose clock restarts, s.
pub(super) const RESTART: f64 = 1.0;

/// Lets time run on where a clock restarts: what follows is a piece of its own, as after a gap. Gives the
/// times of these pieces' first samples.
fn join_restarts(raw: &mut Raw, file: &str, findings: &mut Vec<Finding>) -> Vec<f64> {
    let (mut restarts, mut first, mut added) = (Vec::new(), None, 0.0);
    let mut before = f64::NEG_INFINITY;
    for k in 0..raw.t.len() {
        let after = &raw.t[k..(k + AFTER_RESTART).min(raw.t.len())];
        let rises = after.len() == AFTER_RESTART && after.windows(2).all(|w| w[0] < w[1]);
        if rises && after.iter().all(|t| t + added < before - GAP) {
            first.get_or_insert((raw.line[k], before, raw.t[k]));
            restarts.push(before + RESTART);
            added = before + RESTART - raw.t[k];
        }
        raw.t[k] += added;
        before = before.max(raw.t[k]);
    }
    let Some((line, before, t)) = first else { return restarts };
    let times = if restarts.len() == 1 { "once".to_string() } else { format!("{} times", restarts.len()) };
    let message = format!(
        "the clock restarts {times} (first here: {t} s after {before} s): the log is used as {} pieces, and \
         the times of each go on after those of the one before",
        restarts.len() + 1
    );
    findings.push(finding(file, Some(line), "t", message));
    restarts
}

/// Leaves out samples whose time stands still or runs back.
fn drop_stale(raw: &mut Raw, file: &str, findings: &mut Vec<Finding>) -> Result<(), LogError> {
    let mut keep = vec![true; raw.t.len()];
    let (mut latest, mut stale, mut first_stale) = (f64::NEG_INFINITY, 0usize, None);
    for (k, &t) in raw.t.iter().enumerate() {
        if t > latest {
            latest = t;
        } else {
            keep[k] = false;
            stale += 1;
            first_stale.get_or_insert((raw.line[k], t, latest));
        }
    }
    let Some((line, t, latest)) = first_stale else { return Ok(()) };
    let found = format!("{stale} of {} time stamps do not rise (first: {t} after {latest})", raw.t.len());
    if stale as f64 > MOST_STALE * raw.t.len() as f64 {
        let message = format!("{found}: give the times at which samples were taken");
        return Err(LogError(vec![finding(file, Some(line), "t", message)]));
    }
    findings.push(finding(file, Some(line), "t", format!("{found}; those samples were left out")));
    raw.retain(&keep);
    Ok(())
}

/// The median step between samples, s, where there are enough of them and their time can be in seconds.
fn sound_step(raw: &Raw, file: &str, findings: &mut Vec<Finding>) -> Result<f64, LogError> {
    if raw.t.len() < FEWEST {
        let message = format!("{} usable samples are too few: at least {FEWEST} are needed", raw.t.len());
        return Err(LogError(vec![finding(file, None, "samples", message)]));
    }
    let step = median_step(&raw.t).unwrap_or(1.0);
    if step >= SLOWEST {
        let unit = time_unit(step);
        let message = format!(
            "the median step is {step} s: t must be in seconds (this looks like {unit}: --map 't.unit = \
            \"{unit}\"')"
        );
        return Err(LogError(vec![finding(file, Some(raw.line[1]), "t", message)]));
    }
    let uneven = raw.t.windows(2).filter(|w| (w[1] - w[0] - step).abs() > 0.05 * step).count();
    if uneven as f64 > 0.01 * raw.t.len() as f64 {
        let share = 100.0 * uneven as f64 / raw.t.len() as f64;
        let message = format!(
            "{share:.0} % of the steps differ from the median \
             {step:.4} s; samples are interpolated onto an even grid of that step"
        );
        findings.push(finding(file, None, "t", message));
    }
    Ok(step)
}

/// Unwraps angles, and asks each signal for what only another unit, sign or sensor explains.
fn check_signals(
    raw: &mut Raw,
    effort: &Effort,
    step: f64,
    file: &str,
    arm: &Arm,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Doubt>, LogError> {
    let mut errors = Vec::new();
    for j in 0..arm.dof() {
        unwrap(&mut raw.q[j], &raw.line, &raw.t, j, arm, file, findings);
        units(raw, j, effort, arm, file, findings, &mut errors);
        errors.extend(open_loop(raw, j, arm, file));
    }
    let mut errors = one_a_quantity(errors);
    let name = effort.name();
    let mut warnings = Warnings { file, line: &raw.line, t: &raw.t, findings, errors: &mut errors };
    for (j, (q, effort)) in raw.q.iter().zip(&raw.effort).enumerate() {
        if name != GOAL {
            signal_checks::effort(effort, &format!("{name}{}", j + 1), &mut warnings);
            signal_checks::steps(effort, &format!("{name}{}", j + 1), false, &mut warnings);
        }
        signal_checks::steps(q, &format!("q{}", j + 1), true, &mut warnings);
    }
    let doubts = signal_checks::velocities(raw, step, &mut warnings);
    if name != GOAL {
        signal_checks::torque_signs(raw, step, name, &mut warnings);
    }
    rate(&raw.t, &mut warnings);
    if errors.is_empty() { Ok(doubts) } else { Err(LogError(errors)) }
}

/// The pieces of a log between gaps of time and jumps of position. Of many splits the first ones are shown.
fn pieces(
    raw: &Raw,
    step: f64,
    restarts: &[f64],
    (arm, file): (&Arm, &str),
    findings: &mut Vec<Finding>,
) -> Vec<Range<usize>> {
    let (mut pieces, mut start) = (Vec::new(), 0);
    let mut splits = Vec::new();
    for k in 1..raw.t.len() {
        let gap = raw.t[k] - raw.t[k - 1];
        let jump = (0..arm.dof()).find(|&j| (raw.q[j][k] - raw.q[j][k - 1]).abs() > farthest(arm, j, gap));
        if restarts.iter().any(|t| raw.t[k - 1] < *t && *t <= raw.t[k]) {
            // That was reported.
        } else if gap > GAP.max(GAP_STEPS * step) {
            let message =
                format!("at {:.3} s: a gap of {gap:.3} s: the log is used as two pieces", raw.t[k - 1]);
            splits.push(finding(file, Some(raw.line[k]), "t", message));
        } else if let Some(j) = jump {
            let by = raw.q[j][k] - raw.q[j][k - 1];
            let message = format!(
                "at {:.3} s: jumps by {by:.4} in {gap:.4} s, faster than the joint can move: the log is \
                 split there",
                raw.t[k]
            );
            splits.push(finding(file, Some(raw.line[k]), format!("q{}", j + 1), message));
        } else {
            continue;
        }
        pieces.push(start..k);
        start = k;
    }
    pieces.push(start..raw.t.len());
    let more = splits.len().saturating_sub(SPLITS_SHOWN);
    splits.truncate(SPLITS_SHOWN);
    if more > 0 {
        let message = format!("{more} more gaps or jumps: the log is used as {} pieces", pieces.len());
        splits.push(finding(file, None, "t", message));
    }
    findings.extend(splits);
    pieces
}

/// The joint of a column: those that follow others have none.
pub(super) fn of_column(arm: &Arm, j: usize) -> &Joint {
    arm.moving_joints().nth(j).unwrap_or(&arm.joints[j])
}

/// How far a joint can move in some time, rad or m: five times its speed limit, and always a few steps of an
/// encoder.
pub(super) fn farthest(arm: &Arm, j: usize, seconds: f64) -> f64 {
    (5.0 * of_column(arm, j).velocity.unwrap_or(10.0) * seconds).max(0.02)
}

/// The joints' torques of those that the motors' currents make: where a transmission couples joints a motor's
/// torque is on all joints that turn it.
fn of_motors(arm: &Arm, motors: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    match Motors::of(arm) {
        None => motors,
        Some(turned) => turned.joint_torque_signals(&motors),
    }
}

/// A clock that changes its pace: the mean step of the last third of the samples against the first.
fn rate(t: &[f64], warnings: &mut Warnings<'_>) {
    let third = t.len() / 3;
    let (first, last) = (t[third] - t[0], t[t.len() - 1] - t[t.len() - 1 - third]);
    // A gap is no drift.
    let whole = |w: &[f64]| w.windows(2).all(|w| w[1] - w[0] <= GAP);
    let change = last / first - 1.0;
    if change.abs() > 0.01 && whole(&t[..=third]) && whole(&t[t.len() - 1 - third..]) {
        let message = format!(
            "the mean step changes by {:.1} % from the first third of the samples to the last: the clock \
                drifts, or samples were lost evenly",
            100.0 * change
        );
        warnings.add(Some(t.len() - 1 - third), "t".into(), message, Severity::Warning);
    }
}

fn unwrap(
    q: &mut [f64],
    line: &[usize],
    t: &[f64],
    j: usize,
    arm: &Arm,
    file: &str,
    findings: &mut Vec<Finding>,
) {
    if of_column(arm, j).kind != JointKind::Revolute {
        return;
    }
    let (mut turns, mut wraps, mut first) = (0.0, 0usize, None);
    let mut previous = q[0];
    for (k, value) in q.iter_mut().enumerate().skip(1) {
        let jump = *value - previous;
        previous = *value;
        if jump.abs() > PI && (jump.abs() - 2.0 * PI).abs() < 0.5 {
            turns -= 2.0 * PI * jump.signum();
            wraps += 1;
            first.get_or_insert((line[k], t[k]));
        }
        *value += turns;
    }
    if let Some((line, t)) = first {
        findings.push(Finding {
            file: file.to_string(),
            line: Some(line),
            quantity: format!("q{}", j + 1),
            message: format!(
                "at {t:.3} s: the angle wraps by a full turn {wraps} times (first here); it was unwrapped"
            ),
        });
    }
}

/// Joints with the same mistake as one error: all their columns, and the first one's figures.
fn one_a_quantity(errors: Vec<Finding>) -> Vec<Finding> {
    let quantity = |name: &str| name.trim_end_matches(|c: char| c.is_ascii_digit()).to_string();
    let mut merged: Vec<Finding> = Vec::new();
    for error in errors {
        let like = |other: &&mut Finding| {
            let first = other.quantity.split(", ").next().unwrap_or_default();
            quantity(first) == quantity(&error.quantity)
        };
        match merged.iter_mut().find(like) {
            Some(first) => {
                if !first.quantity.contains(", ") {
                    first.message = format!("{} {}", first.quantity, first.message);
                }
                first.quantity = format!("{}, {}", first.quantity, error.quantity);
            }
            None => merged.push(error),
        }
    }
    merged
}

/// The first sample at which a joint's loop of four bars does not close: no torque model has a value there.
fn open_loop(raw: &Raw, j: usize, arm: &Arm, file: &str) -> Option<Finding> {
    let joint = of_column(arm, j);
    let linkage = arm.linkages().find(|linkage| std::ptr::eq(&arm.joints[linkage.joint], joint))?;
    let closes = |q: f64| linkage.open_within(Some([q, q]), joint.theta.radians());
    let (k, range) = raw.q[j].iter().enumerate().find_map(|(k, q)| Some((k, closes(*q)?)))?;
    let message = format!(
        "is {:.4} rad at {:.3} s, where the joint's [[loop]] does not close (it closes {range}): check the \
         joint's zero, sign and unit, and the lengths of the loop",
        raw.q[j][k], raw.t[k]
    );
    Some(finding(file, Some(raw.line[k]), format!("q{}", j + 1), message))
}

/// Numbers that only another unit explains.
fn units(
    raw: &Raw,
    j: usize,
    effort: &Effort,
    arm: &Arm,
    file: &str,
    findings: &mut Vec<Finding>,
    errors: &mut Vec<Finding>,
) {
    let joint = of_column(arm, j);
    let mut error = |quantity: String, message: String| {
        errors.push(Finding { file: file.to_string(), line: None, quantity, message });
    };
    let largest = |x: &[f64]| x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let q = &raw.q[j];
    let reach = joint.position.map_or(2.0 * PI, |[low, high]| low.abs().max(high.abs()));
    let span = largest(q);
    let (low, high) = q.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    if joint.kind == JointKind::Revolute && span > ABSURD * reach.max(PI) && high - low > 2.0 * PI {
        let message = format!(
            "reaches {span:.1}, the joint {reach:.2} rad: angles must be in radians (degrees look like \
                this: --map 'q.unit = \"deg\"')"
        );
        error(format!("q{}", j + 1), message);
    } else if joint.kind == JointKind::Prismatic
        && joint.position.is_some()
        && span > ABSURD * reach
        && high - low > reach
    {
        let message = format!(
            "reaches {span:.1}, the joint {reach:.3} m: positions of joints that slide must be in metres \
                (millimetres look like this: --map 'q.unit = \"mm\"')"
        );
        error(format!("q{}", j + 1), message);
    } else if joint
        .position
        .is_some_and(|[low, high]| raw.q[j].iter().any(|v| *v < low - 0.1 || *v > high + 0.1))
    {
        findings.push(Finding {
            file: file.to_string(),
            line: None,
            quantity: format!("q{}", j + 1),
            message: "goes beyond the arm file's position limits: check the joint's zero, sign and unit"
                .into(),
        });
    }
    let mut magnitudes: Vec<f64> = raw.effort[j].iter().map(|v| v.abs()).collect();
    magnitudes.sort_by(f64::total_cmp);
    let typical = magnitudes[magnitudes.len() / 2];
    let Some(limit) = joint.torque else { return };
    let (column, torque, unit) = match effort {
        Effort::Torque => {
            ("tau", typical, "torques must be in N·m (mN·m look like this: --map 'tau.unit = \"mN·m\"')")
        }
        Effort::Current(constants) => (
            "i",
            typical * constants[j].abs(),
            "currents must be in A (mA look like this: --map 'i.unit = \"mA\"')",
        ),
        Effort::Goal => return,
    };
    let quantity = format!("{column}{}", j + 1);
    let own = if joint.kind == JointKind::Prismatic { "N" } else { "N·m" };
    let torque_is =
        format!("is typically {torque:.0} {own}, the joint's torque limit in the arm file is {limit} {own}");
    if torque > OTHER_UNIT * limit {
        error(quantity, format!("{torque_is}: {unit}; or the limit is a placeholder: correct it"));
    } else if torque > limit {
        findings.push(Finding {
            file: file.to_string(),
            line: None,
            quantity,
            message: format!("{torque_is}: the limit is a placeholder, or the torque has another unit"),
        });
    }
}
