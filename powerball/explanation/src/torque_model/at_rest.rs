//! The torque of an arm that stands, and contacts that show in it.
//!
//! No fit uses rows at rest: friction there has any value between its levels of both directions. But other
//! rests show how far the torque at rest may be from the model's. A torque beyond that, and beyond friction,
//! has an external cause, however long it lasts.

use crate::effects::contact_wrench::Point;
use dyngen::arm::ParameterKind;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::Solver;
use powerball_logs::regression::{Recording, RigidArm};
use powerball_logs::signal::{Band, motion};
use powerball_logs::vector::{NORMAL, median};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A push while no joint moved.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RestPush {
    /// The file of its log.
    pub(crate) log: String,
    /// When, in the log's own t, s.
    pub(crate) from: f64,
    pub(crate) to: f64,
    /// The largest force in the base frame, N …
    pub(crate) force: [f64; 3],
    /// … and the point on which it is taken to act.
    pub(crate) point: Point,
    /// The joints whose torque left by more than their limits.
    pub(crate) joints: Vec<JointNumber>,
    /// The joint that exceeds its limit most.
    pub(crate) most: JointNumber,
    /// The share of the squared residual that this force explains.
    pub(crate) share: f64,
    /// The largest residual over its limit, over joints.
    pub(crate) size: f64,
    /// The largest of what is beyond the limit, in standard deviations of the torque at rest.
    pub(crate) beyond: f64,
}

/// A rest begins so long after the arm has stopped, s: its controller comes to rest.
const GUARD: f64 = 0.25;
/// A push lasts at least so long, s; what is interrupted for less is one push.
const SHORTEST: f64 = 0.2;
/// The range of a residual at rest is taken from the rests of other logs if they last this long together, s …
const ENOUGH_REST: f64 = 5.0;
/// … as the value that this share of them does not exceed …
const USUAL: f64 = 0.995;
/// … and is otherwise this multiple of Coulomb friction, beyond which undisturbed joints stick in no measured
/// log.
const STICKS: f64 = 3.0;
/// Beyond that and the model's own error, in standard deviations of the torque at rest.
const DEVIATIONS: f64 = 6.0;
/// N·m: what divides by noise has some.
const LEAST_NOISE: f64 = 1e-9;
/// A push begins and ends where the residual is this share of its largest one.
const FOOT: f64 = 0.25;
/// Motors whose torques are all below this share of the limits hold no arm that has weight: its brakes do.
const BRAKED: f64 = 0.5;
/// A push acts on another link than the last one if that link's origin explains this share more than the
/// tool.
const OTHER_LINK: f64 = 0.2;

/// The usual error of a joint's torque without contact, N·m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Usual {
    /// Coulomb friction.
    pub(crate) friction: f64,
    /// The model's error in motion, rms: a pose may be new to it.
    pub(crate) error: f64,
}

/// How far the torque of each joint at rest may be from the model's, by joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RestLimits {
    /// The velocity below which the joint rests, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// The largest usual difference, N·m or N.
    pub limit: Vec<f64>,
    /// Standard deviation of the torque at rest, N·m or N.
    pub noise: Vec<f64>,
}

impl RestLimits {
    /// The limits that other rests show; `own` are those on which something may push.
    pub(crate) fn new(velocity: &[f64], joints: &[Usual], others: &[&Rest], own: &[Rest]) -> RestLimits {
        let seconds: f64 = others.iter().map(|rest| rest.calm_seconds()).sum();
        // A median over rests, most of which are without contact.
        let noise = |j: usize| {
            let mut all: Vec<f64> = others.iter().copied().chain(own).map(|rest| rest.noise(j)).collect();
            median(&mut all).max(LEAST_NOISE)
        };
        let noise: Vec<f64> = (0..joints.len()).map(noise).collect();
        let limit = |j: usize| {
            let Usual { friction, error } = joints[j];
            let usual = match seconds >= ENOUGH_REST {
                true => {
                    let mut sizes: Vec<f64> = others.iter().flat_map(|rest| rest.calm_sizes(j)).collect();
                    let k = ((sizes.len() - 1) as f64 * USUAL) as usize;
                    let (_, usual, _) = sizes.select_nth_unstable_by(k, f64::total_cmp);
                    usual.max(friction)
                }
                false => STICKS * friction,
            };
            usual + error + DEVIATIONS * noise[j]
        };
        RestLimits { limit: (0..joints.len()).map(limit).collect(), noise, velocity: velocity.to_vec() }
    }
}

/// A time in which no joint moves.
#[derive(Clone, Debug)]
pub(crate) struct Rest {
    /// The log that it is a part of.
    pub(crate) log: usize,
    /// Time of the first sample in the log's own t, s.
    start: f64,
    /// Samples a second.
    rate: f64,
    /// Positions, n a sample.
    q: Vec<f64>,
    /// Measured less predicted torque in the band by joint, N·m.
    left: Vec<Vec<f64>>,
    /// Measured torque in the band by joint, N·m.
    torque: Vec<Vec<f64>>,
    /// Rests without an external force, as far as is known.
    calm: Vec<bool>,
}

/// The rests of a recording, in order: all joints are slower than `velocity`. `predicted` is the model's
/// torque along a recording, n a sample.
pub(crate) fn rests(
    recording: &Recording,
    velocity: &[f64],
    band: &Band,
    predicted: impl FnOnce(&Recording) -> Vec<f64>,
) -> Vec<Rest> {
    let dof = recording.dof;
    let mut moves = vec![false; recording.len()];
    for (j, limit) in velocity.iter().enumerate() {
        let v: Vec<f64> = recording.velocity(j).collect();
        let moving = motion::moving(&v, recording.rate, *limit);
        moves.iter_mut().zip(moving).for_each(|(all, moving)| *all |= moving);
    }
    let (guard, shortest) = ((GUARD * recording.rate).ceil() as usize, SHORTEST * recording.rate);
    // Before an arm sets off it stands; after it has stopped it comes to rest.
    let settled = |run: Range<usize>| if run.start == 0 { run } else { run.start + guard..run.end };
    let long = runs(&moves, |moves| !moves).into_iter().map(settled);
    let long: Vec<Range<usize>> =
        long.filter(|run| run.start < run.end && run.len() as f64 >= shortest).collect();
    if long.is_empty() {
        return Vec::new();
    }
    // A joint that rests has no velocity, whatever its encoder's steps are.
    let mut still = recording.clone();
    for (v, moves) in still.v.chunks_exact_mut(dof).zip(&moves) {
        if !moves {
            v.fill(0.0);
        }
    }
    let predicted = predicted(&still);
    let torque: Vec<Vec<f64>> = (0..dof).map(|j| band.filtered(&recording.smooth_torque(j))).collect();
    let left = |j: usize| -> Vec<f64> {
        let own: Vec<f64> = predicted.iter().skip(j).step_by(dof).copied().collect();
        torque[j].iter().zip(band.filtered(&own)).map(|(measured, own)| measured - own).collect()
    };
    let left: Vec<Vec<f64>> = (0..dof).map(left).collect();
    let cut = |all: &[Vec<f64>], samples: &Range<usize>| {
        all.iter().map(|of| of[samples.clone()].to_vec()).collect::<Vec<_>>()
    };
    let rest = |samples: Range<usize>| Rest {
        log: recording.log,
        start: recording.start + samples.start as f64 / recording.rate,
        rate: recording.rate,
        q: recording.q[samples.start * dof..samples.end * dof].to_vec(),
        left: cut(&left, &samples),
        torque: cut(&torque, &samples),
        calm: vec![true; samples.len()],
    };
    long.into_iter().map(rest).collect()
}

impl Rest {
    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.calm.len()
    }

    /// Time of a sample in the log's own t, s.
    pub(crate) fn at(&self, k: usize) -> f64 {
        self.start + k as f64 / self.rate
    }

    /// Drops the last `samples`.
    pub(crate) fn shorten(&mut self, samples: usize) {
        let kept = self.len().saturating_sub(samples);
        self.left.iter_mut().chain(&mut self.torque).for_each(|of| of.truncate(kept));
        self.calm.truncate(kept);
    }

    /// Takes the rest as undisturbed except for these samples.
    pub(crate) fn disturbed_by(&mut self, runs: &[Range<usize>]) {
        self.calm = (0..self.len()).map(|k| !runs.iter().any(|run| run.contains(&k))).collect();
    }

    /// For how long nothing pushes, s.
    fn calm_seconds(&self) -> f64 {
        self.calm.iter().filter(|calm| **calm).count() as f64 / self.rate
    }

    /// The size of a joint's residual where nothing pushes, N·m.
    fn calm_sizes(&self, joint: usize) -> impl Iterator<Item = f64> + '_ {
        self.left[joint].iter().zip(&self.calm).filter(|(_, calm)| **calm).map(|(left, _)| left.abs())
    }

    /// The standard deviation of a joint's torque, by the median of its distance from its median; not 0,
    /// where a log holds a torque that never changes.
    fn noise(&self, joint: usize) -> f64 {
        let usual = median(&mut self.left[joint].clone());
        let mut sizes: Vec<f64> = self.left[joint].iter().map(|r| (r - usual).abs()).collect();
        f64::max(LEAST_NOISE, NORMAL * median(&mut sizes))
    }

    /// The largest residual over its limit at a sample, over joints.
    pub(crate) fn size(&self, limits: &RestLimits, k: usize) -> f64 {
        largest(&self.left, &limits.limit, k)
    }

    /// When something pushes: samples of the rest.
    pub(crate) fn pushed(&self, limits: &RestLimits) -> Vec<Range<usize>> {
        let n = self.len();
        // Brakes hold the arm, and motors do not.
        let braked = |k: usize| largest(&self.torque, &limits.limit, k) < BRAKED;
        let above: Vec<bool> = (0..n).map(|k| self.size(limits, k) > 1.0 && !braked(k)).collect();
        let shortest = SHORTEST * self.rate;
        let mut found: Vec<Range<usize>> = Vec::new();
        for peak in runs(&above, |above| above) {
            let highest = peak.clone().map(|k| self.size(limits, k)).fold(0.0, f64::max);
            let foot = |k: &usize| self.size(limits, *k) < FOOT * highest || braked(*k);
            let from = (0..peak.start).rev().find(foot).map_or(0, |k| k + 1);
            let to = (peak.end..n).find(foot).unwrap_or(n);
            match found.last_mut().filter(|last| (from as f64) < last.end as f64 + shortest) {
                Some(last) => last.end = last.end.max(to),
                None => found.push(from..to),
            }
        }
        found.into_iter().filter(|run| run.len() as f64 >= shortest).collect()
    }

    /// The force of a push; `log` is the name of the log.
    pub(crate) fn push(
        &self,
        body: &RigidArm,
        log: &str,
        limits: &RestLimits,
        run: &Range<usize>,
    ) -> Option<RestPush> {
        let dof = self.left.len();
        let top = run.clone().max_by(|a, b| self.size(limits, *a).total_cmp(&self.size(limits, *b)))?;
        let left: Vec<f64> = (0..dof).map(|j| self.left[j][top]).collect();
        let q = &self.q[top * dof..][..dof];
        let fit = |lever: [Vec<f64>; 3]| force(limits, &left, &lever);
        let (mut force, mut share) = fit(body.force_columns(q)?)?;
        let mut point = Point::tool(body);
        for link in (0..dof - 1).rev() {
            let Some(other) = at_link(body, link, q).and_then(fit) else { continue };
            if other.1 > share + OTHER_LINK {
                (force, share) = other;
                point = Point::origin(body, link);
            }
        }
        let joints = (0..dof)
            .filter(|j| run.clone().any(|k| self.left[*j][k].abs() > limits.limit[*j]))
            .map(JointNumber::from_index);
        let over = |j: &usize| left[*j].abs() / limits.limit[*j];
        let most = (0..dof).max_by(|a, b| over(a).total_cmp(&over(b)))?;
        let beyond = |j: usize| (left[j].abs() - limits.limit[j]) / limits.noise[j] + DEVIATIONS;
        Some(RestPush {
            size: self.size(limits, top),
            beyond: (0..dof).map(beyond).fold(0.0, f64::max),
            log: log.to_string(),
            from: self.at(run.start),
            to: self.at(run.end),
            force,
            point,
            joints: joints.collect(),
            most: JointNumber::from_index(most),
            share,
        })
    }
}

/// The force that explains most of the residual at one sample, N, and its share; each joint is weighted by
/// its limit.
fn force(limits: &RestLimits, left: &[f64], lever: &[Vec<f64>; 3]) -> Option<([f64; 3], f64)> {
    let weight = |j: usize| 1.0 / (limits.limit[j].powi(2) + limits.noise[j].powi(2));
    let sum = |x: &[f64], y: &[f64]| (0..left.len()).map(|j| weight(j) * x[j] * y[j]).sum::<f64>();
    let gram = Mat::from_fn(3, 3, |a, b| sum(&lever[a], &lever[b]));
    let right: Vec<f64> = lever.iter().map(|l| sum(l, left)).collect();
    let force = Solver::new(&gram, |_| true).solve(&right);
    let explained: f64 = force.iter().zip(&right).map(|(f, r)| f * r).sum();
    let share = explained / sum(left, left);
    share.is_finite().then(|| ([force[0], force[1], force[2]], share))
}

/// The torques of a unit force along each base axis at a link's origin.
fn at_link(body: &RigidArm, link: usize, q: &[f64]) -> Option<[Vec<f64>; 3]> {
    let mass = link * ParameterKind::ALL.len() + ParameterKind::M as usize;
    let along = |axis: usize| body.gravity_columns(axis, &[mass], q);
    Some([along(0)?, along(1)?, along(2)?])
}

/// The largest value over its limit at a sample, over joints.
fn largest(values: &[Vec<f64>], limits: &[f64], k: usize) -> f64 {
    values.iter().zip(limits).map(|(own, limit)| own[k].abs() / limit).fold(0.0, f64::max)
}

/// The runs of what is wanted.
fn runs(values: &[bool], wanted: impl Fn(bool) -> bool) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut first = None;
    for (k, value) in values.iter().copied().enumerate() {
        match (wanted(value), first) {
            (true, None) => first = Some(k),
            (false, Some(start)) => {
                runs.push(start..k);
                first = None;
            }
            _ => {}
        }
    }
    runs.extend(first.map(|start| start..values.len()));
    runs
}
