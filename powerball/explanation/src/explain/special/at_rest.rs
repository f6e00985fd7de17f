//! Contact with an arm that stands still, or that the contact has stopped.
//!
//! No fit uses rows at rest: friction there has any value between its levels of both directions. But the
//! rests of other logs show how far the torque at rest may be from the model's. A torque beyond that, and
//! beyond friction, has an external cause, however long it lasts.

use super::super::study::Study;
use crate::effects::Window;
use crate::effects::contact_wrench::Point;
use crate::rule::Rule;
use crate::torque_model::TorqueModel;
use dyngen::arm::ParameterKind;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::Solver;
use powerball_logs::parallel;
use powerball_logs::regression::{Data, Recording, RigidArm};
use powerball_logs::signal::motion;
use powerball_logs::vector::{NORMAL, median};
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
/// Rounds in which what pushes is taken out of what is usual.
const ROUNDS: usize = 2;

/// The pushes in all logs, those that were fitted first.
///
/// `arm` is the arm with the changes of `model`, and the last link holds the model's payload during the
/// windows `held` of the fitted logs and of the validation set. `errors` are the residuals of the model on
/// the latter, rms by joint.
pub(crate) fn pushes_at_rest(
    study: &Study<'_>,
    (model, arm): (&TorqueModel, &RigidArm),
    held: &[Vec<Window>; 2],
    errors: &[f64],
) -> Vec<RestPush> {
    let (sets, rule) = ([&study.data, &study.validation], study.rule());
    let friction = model.gammas().into_iter().map(|g| g[0].abs() + g[2].abs());
    let joints: Vec<Usual> =
        friction.zip(errors).map(|(friction, error)| Usual { friction, error: *error }).collect();
    let [mut fitted, judged] = [0, 1].map(|k| rests(sets[k], (model, arm), &held[k]));
    // A push in one log hides those of others until it is known.
    for _ in 0..ROUNDS {
        let found = pushed(rule, &fitted, None, &joints);
        let runs: Vec<Vec<Range<usize>>> = found.into_iter().flat_map(|(_, runs)| runs).collect();
        for (rest, runs) in fitted.iter_mut().zip(runs) {
            rest.calm = (0..rest.samples.len()).map(|k| !runs.iter().any(|run| run.contains(&k))).collect();
        }
    }
    let pushes = |k: usize, own: &[Rest<'_>], found: Vec<(Limits, Vec<Vec<Range<usize>>>)>| {
        let each = found.iter().flat_map(|(limits, runs)| runs.iter().map(move |runs| (limits, runs)));
        let of = |(rest, (limits, runs)): (&Rest<'_>, (&Limits, &Vec<Range<usize>>))| {
            let pushes = runs.iter().filter_map(|run| rest.push(sets[k], limits, run));
            // One force must explain most of it.
            pushes.filter(|push| push.share >= rule.most).collect::<Vec<_>>()
        };
        own.iter().zip(each).flat_map(of).collect::<Vec<_>>()
    };
    let in_fitted = pushes(0, &fitted, pushed(rule, &fitted, None, &joints));
    let in_judged = pushes(1, &judged, pushed(rule, &judged, Some(&fitted), &joints));
    in_fitted.into_iter().chain(in_judged).collect()
}

/// The times of pushes, by log and rest, with the usual residual there. The rests of `fitted` give the usual
/// residual of other logs; if there are none, the other logs of the rests themselves.
fn pushed(
    rule: &Rule,
    rests: &[Rest<'_>],
    fitted: Option<&[Rest<'_>]>,
    joints: &[Usual],
) -> Vec<(Limits, Vec<Vec<Range<usize>>>)> {
    let of = |own: &[Rest<'_>]| {
        let log = own[0].recording.log;
        let others: Vec<&Rest<'_>> = match fitted {
            Some(fitted) => fitted.iter().collect(),
            None => rests.iter().filter(|rest| rest.recording.log != log).collect(),
        };
        let limits = Limits::new(joints, &others, own);
        let mut runs: Vec<Vec<Range<usize>>> = own.iter().map(|rest| rest.pushed(&limits)).collect();
        let pushed: usize = runs.iter().flatten().map(Range::len).sum();
        let all: usize = own.iter().map(|rest| rest.samples.len()).sum();
        // A force in all but little of several rests is that of a carried body, not a push.
        if own.len() > 1 && pushed as f64 >= (1.0 - rule.little) * all as f64 {
            runs.iter_mut().for_each(Vec::clear);
        }
        (limits, runs)
    };
    rests.chunk_by(|a, b| a.recording.log == b.recording.log).map(of).collect()
}

/// The usual error of a joint's torque without contact, N·m.
struct Usual {
    /// Coulomb friction.
    friction: f64,
    /// The model's error in motion on logs that were not fitted, rms: a pose may be new to it.
    error: f64,
}

/// How far the torque of each joint at rest may be from the model's, N·m.
struct Limits {
    limit: Vec<f64>,
    /// Standard deviation of the torque at rest.
    noise: Vec<f64>,
}

impl Limits {
    fn new(joints: &[Usual], others: &[&Rest<'_>], own: &[Rest<'_>]) -> Limits {
        let seconds: f64 = others.iter().map(|rest| rest.calm_seconds()).sum();
        // A median over rests, most of which are without contact.
        let noise = |j: usize| {
            let mut all: Vec<f64> = others.iter().copied().chain(own).map(|rest| rest.noise(j)).collect();
            median(&mut all)
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
        Limits { limit: (0..joints.len()).map(limit).collect(), noise }
    }
}

/// A time in which no joint moves.
struct Rest<'r> {
    recording: &'r Recording,
    samples: Range<usize>,
    /// Measured less predicted torque in the band by joint, N·m.
    left: Vec<Vec<f64>>,
    /// Measured torque in the band by joint, N·m.
    torque: Vec<Vec<f64>>,
    /// Rests without an external force, as far as is known.
    calm: Vec<bool>,
}

/// The rests of some logs, in order.
fn rests<'r>(data: &'r Data<'_>, (model, arm): (&TorqueModel, &RigidArm), held: &[Window]) -> Vec<Rest<'r>> {
    let of = |recording: &'r Recording| {
        let mut moves = vec![false; recording.len()];
        for j in 0..data.dof() {
            let v: Vec<f64> = recording.velocity(j).collect();
            let moving = motion::moving(&v, recording.rate, data.rest_velocity[j]);
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
        for (v, moves) in still.v.chunks_exact_mut(data.dof()).zip(&moves) {
            if !moves {
                v.fill(0.0);
            }
        }
        let predicted = model.torque_in(arm, &data.logs[recording.log], &still, held);
        let torque: Vec<Vec<f64>> =
            (0..data.dof()).map(|j| data.band.filtered(&recording.smooth_torque(j))).collect();
        let left = |j: usize| -> Vec<f64> {
            let own: Vec<f64> = predicted.iter().skip(j).step_by(data.dof()).copied().collect();
            torque[j].iter().zip(data.band.filtered(&own)).map(|(measured, own)| measured - own).collect()
        };
        let left: Vec<Vec<f64>> = (0..data.dof()).map(left).collect();
        let cut = |all: &[Vec<f64>], samples: &Range<usize>| {
            all.iter().map(|of| of[samples.clone()].to_vec()).collect::<Vec<_>>()
        };
        let rest = |samples: Range<usize>| Rest {
            recording,
            left: cut(&left, &samples),
            torque: cut(&torque, &samples),
            calm: vec![true; samples.len()],
            samples,
        };
        long.into_iter().map(rest).collect()
    };
    let recordings: Vec<&Recording> = data.recordings.iter().collect();
    parallel::map(&recordings, |recording| of(recording)).into_iter().flatten().collect()
}

impl Rest<'_> {
    /// For how long nothing pushes, s.
    fn calm_seconds(&self) -> f64 {
        self.calm.iter().filter(|calm| **calm).count() as f64 / self.recording.rate
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
    fn size(&self, limits: &Limits, k: usize) -> f64 {
        largest(&self.left, &limits.limit, k)
    }

    /// When something pushes: samples of the rest.
    fn pushed(&self, limits: &Limits) -> Vec<Range<usize>> {
        let n = self.samples.len();
        // Brakes hold the arm, and motors do not.
        let braked = |k: usize| largest(&self.torque, &limits.limit, k) < BRAKED;
        let above: Vec<bool> = (0..n).map(|k| self.size(limits, k) > 1.0 && !braked(k)).collect();
        let shortest = SHORTEST * self.recording.rate;
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

    /// The force of a push.
    fn push(&self, data: &Data<'_>, limits: &Limits, run: &Range<usize>) -> Option<RestPush> {
        let dof = self.left.len();
        let top = run.clone().max_by(|a, b| self.size(limits, *a).total_cmp(&self.size(limits, *b)))?;
        let left: Vec<f64> = (0..dof).map(|j| self.left[j][top]).collect();
        let q = &self.recording.q[(self.samples.start + top) * dof..][..dof];
        let fit = |lever: [Vec<f64>; 3]| force(limits, &left, &lever);
        let (mut force, mut share) = fit(data.body.force_columns(q)?)?;
        let mut point = Point::tool(data.body);
        for link in (0..dof - 1).rev() {
            let Some(other) = at_link(data.body, link, q).and_then(fit) else { continue };
            if other.1 > share + OTHER_LINK {
                (force, share) = other;
                point = Point::origin(data.body, link);
            }
        }
        let at = |k: usize| self.recording.start + (self.samples.start + k) as f64 / self.recording.rate;
        let joints = (0..dof)
            .filter(|j| run.clone().any(|k| self.left[*j][k].abs() > limits.limit[*j]))
            .map(JointNumber::from_index);
        let beyond = |j: usize| (left[j].abs() - limits.limit[j]) / limits.noise[j] + DEVIATIONS;
        Some(RestPush {
            size: self.size(limits, top),
            beyond: (0..dof).map(beyond).fold(0.0, f64::max),
            log: data.logs[self.recording.log].clone(),
            from: at(run.start),
            to: at(run.end),
            force,
            point,
            joints: joints.collect(),
            share,
        })
    }
}

/// The force that explains most of the residual at one sample, N, and its share; each joint is weighted by
/// its limit.
fn force(limits: &Limits, left: &[f64], lever: &[Vec<f64>; 3]) -> Option<([f64; 3], f64)> {
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
