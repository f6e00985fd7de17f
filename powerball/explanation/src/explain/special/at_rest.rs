//! A hand that pushes an arm which stands still.
//!
//! Rows at rest take no part in any fit: friction there is anything between its levels of either direction. But what
//! holds an arm in its place holds it against a push too, and a torque that leaves by more than friction can hide, and
//! comes back while no joint has moved, is that of something outside.

use super::super::model::Model;
use super::super::study::Study;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::Solver;
use powerball_logs::regression::{Data, Recording};
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
    /// The largest force on the tool in the base frame, N.
    pub(crate) force: [f64; 3],
    /// The joints of which torque left by more than friction hides.
    pub(crate) joints: Vec<JointNumber>,
    /// The share of the squared deviation that this force explains.
    pub(crate) share: f64,
    /// The largest deviation over what friction and noise hide, over joints.
    pub(crate) size: f64,
    /// The largest of what friction cannot hide, in standard deviations of the torque at rest.
    pub(crate) beyond: f64,
}

/// A stretch of rest is asked where it lasts so long, s: what is usual in it is its median …
const SHORTEST_REST: f64 = 2.0;
/// … and what is so near to a motion is left out, s: it stops, and its controller comes to rest.
const GUARD: f64 = 1.0;
/// A push lasts at least so long, s …
const SHORTEST: f64 = 0.2;
/// … and less than this share of the stretch, of which the rest tells what is usual.
const LONGEST: f64 = 0.4;
/// A push begins and ends where a joint's torque is this share of its largest deviation.
const FOOT: f64 = 0.25;
/// Deviations beyond what friction hides, in standard deviations of the torque at rest.
const DEVIATIONS: f64 = 6.0;
/// N·m: what divides by noise has some.
const LEAST_NOISE: f64 = 1e-9;
/// One force on the last frame explains at least so much of a push.
const EXPLAINED: f64 = 0.5;

/// The pushes in all logs, those that were fitted first.
pub(crate) fn pushes_at_rest(study: &Study<'_>, model: &Model) -> Vec<RestPush> {
    let friction: Vec<f64> = (0..study.data.dof())
        .map(|j| {
            let gamma = model.fit.friction(j);
            gamma[0].abs() + gamma[2].abs()
        })
        .collect();
    [&study.data, &study.validation].into_iter().flat_map(|data| in_data(data, &friction)).collect()
}

fn in_data(data: &Data<'_>, friction: &[f64]) -> Vec<RestPush> {
    let stretches: Vec<Stretch<'_>> =
        data.recordings.iter().flat_map(|recording| Stretch::all(data, recording)).collect();
    // Noise of the torque at rest by joint: a median over stretches, most of which nobody touches.
    let noise: Vec<f64> = (0..data.dof())
        .map(|j| median(&mut stretches.iter().map(|s| s.noise(j)).collect::<Vec<_>>()))
        .collect();
    let limit: Vec<f64> = friction.iter().zip(&noise).map(|(f, n)| 2.0 * f + DEVIATIONS * n).collect();
    stretches.iter().flat_map(|stretch| stretch.pushes(data, &limit, &noise)).collect()
}

/// A time in which no joint moves.
struct Stretch<'r> {
    recording: &'r Recording,
    samples: Range<usize>,
    /// Torque less its median, in the band, by joint, N·m.
    torque: Vec<Vec<f64>>,
}

impl<'r> Stretch<'r> {
    fn all(data: &Data<'_>, recording: &'r Recording) -> Vec<Stretch<'r>> {
        let mut moves = vec![false; recording.len()];
        for j in 0..data.dof() {
            let v: Vec<f64> = recording.velocity(j).collect();
            let moving = motion::moving(&v, recording.rate, data.rest_velocity[j]);
            moves.iter_mut().zip(moving).for_each(|(all, moving)| *all |= moving);
        }
        let runs = runs(&moves, |moves| !moves);
        let shortest = (SHORTEST_REST * recording.rate).ceil() as usize;
        let guard = (GUARD * recording.rate).ceil() as usize;
        let inside = |run: Range<usize>| run.start + guard..run.end.saturating_sub(guard);
        let long: Vec<Range<usize>> =
            runs.into_iter().map(inside).filter(|run| run.start < run.end && run.len() >= shortest).collect();
        if long.is_empty() {
            return Vec::new();
        }
        let torque: Vec<Vec<f64>> =
            (0..data.dof()).map(|j| data.band.filtered(&recording.smooth_torque(j))).collect();
        let of = |samples: Range<usize>| {
            let less_median = |torque: &Vec<f64>| {
                let own = &torque[samples.clone()];
                let usual = median(&mut own.to_vec());
                own.iter().map(|t| t - usual).collect()
            };
            Stretch { recording, torque: torque.iter().map(less_median).collect(), samples }
        };
        long.into_iter().map(of).collect()
    }

    /// The standard deviation of a joint's torque, by the median of its size; not 0, where a log holds a torque that
    /// never changes.
    fn noise(&self, joint: usize) -> f64 {
        f64::max(
            LEAST_NOISE,
            NORMAL * median(&mut self.torque[joint].iter().map(|t| t.abs()).collect::<Vec<_>>()),
        )
    }

    fn pushes(&self, data: &Data<'_>, limit: &[f64], noise: &[f64]) -> Vec<RestPush> {
        let n = self.samples.len();
        let over =
            |k: usize, share: f64| (0..limit.len()).any(|j| self.torque[j][k].abs() > share * limit[j]);
        let above: Vec<bool> = (0..n).map(|k| over(k, 1.0)).collect();
        let mut found: Vec<Range<usize>> = Vec::new();
        for peak in runs(&above, |above| above) {
            // From where the joint that stands out leaves what is usual to where it is back.
            let size =
                |k: usize| (0..limit.len()).map(|j| self.torque[j][k].abs() / limit[j]).fold(0.0, f64::max);
            let highest = peak.clone().map(size).fold(0.0, f64::max);
            let foot = |k: &usize| size(*k) < FOOT * highest;
            let from = (0..peak.start).rev().find(foot);
            let to = (peak.end..n).find(foot);
            // What does not come back is no push: a brake that falls in, a load that is put down.
            let (Some(from), Some(to)) = (from, to) else { continue };
            if found.last().is_none_or(|last| last.end <= from) {
                found.push(from..to);
            }
        }
        let long = |run: &Range<usize>| {
            let seconds = run.len() as f64 / self.recording.rate;
            seconds >= SHORTEST && (run.len() as f64) < LONGEST * n as f64
        };
        found.into_iter().filter(long).filter_map(|run| self.push(data, limit, noise, run)).collect()
    }

    fn push(&self, data: &Data<'_>, limit: &[f64], noise: &[f64], run: Range<usize>) -> Option<RestPush> {
        let dof = self.torque.len();
        let size = |k: usize| (0..dof).map(|j| (self.torque[j][k] / limit[j]).powi(2)).sum::<f64>();
        let top = run.clone().max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
        let deviation: Vec<f64> = (0..dof).map(|j| self.torque[j][top]).collect();
        let q = &self.recording.q[(self.samples.start + top) * dof..][..dof];
        let lever = data.body.force_columns(q)?;
        // Each joint counts as surely as its friction lets it.
        let weight: Vec<f64> = limit.iter().zip(noise).map(|(l, n)| 1.0 / (l * l + n * n)).collect();
        let sum = |x: &[f64], y: &[f64]| (0..dof).map(|j| weight[j] * x[j] * y[j]).sum::<f64>();
        let gram = Mat::from_fn(3, 3, |a, b| sum(&lever[a], &lever[b]));
        let right: Vec<f64> = lever.iter().map(|l| sum(l, &deviation)).collect();
        let force = Solver::new(&gram, |_| true).solve(&right);
        let explained: f64 = force.iter().zip(&right).map(|(f, r)| f * r).sum();
        let share = explained / sum(&deviation, &deviation);
        let at = |k: usize| self.recording.start + (self.samples.start + k) as f64 / self.recording.rate;
        let joints = (0..dof)
            .filter(|j| run.clone().any(|k| self.torque[*j][k].abs() > limit[*j]))
            .map(JointNumber::from_index);
        let largest = |of: &dyn Fn(usize) -> f64| (0..dof).map(of).fold(0.0, f64::max);
        (share >= EXPLAINED).then(|| RestPush {
            size: largest(&|j| deviation[j].abs() / limit[j]),
            beyond: largest(&|j| (deviation[j].abs() - limit[j]) / noise[j] + DEVIATIONS),
            log: data.logs[self.recording.log].clone(),
            from: at(run.start),
            to: at(run.end),
            force: [force[0], force[1], force[2]],
            joints: joints.collect(),
            share,
        })
    }
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
