//! The residual without a name.
//!
//! The module also finds the dependencies of a residual.

use super::super::comparison::History;
use super::super::model::Model;
use super::super::named::{FitErrors, NamedEffect, Rival, TAKEN_BACK};
use super::super::study::Study;
use super::verdict::needs_no_name;
use crate::effects::{Candidate, Context};
use powerball_controller::JointNumber;
use powerball_logs::parallel;
use powerball_logs::regression::Data;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

/// The residual without a name.
#[derive(Clone, Debug, Serialize)]
pub struct Unattributed {
    /// Joints.
    pub joints: Vec<JointNumber>,
    /// Signals that the residual depends on, the strongest first.
    pub depends_on: Vec<String>,
    /// rms of the residual of those joints on the fitted logs, N·m.
    pub rms: Vec<f64>,
    /// Effects that fit a part of it, but not well enough to be named there.
    pub considered: Vec<Rival>,
}

/// The joints with more than a small remaining error that depends on a signal, and the notes about
/// the others on which more than noise is left.
pub(crate) fn unattributed(
    study: &Study<'_>,
    model: &Model,
    history: &History,
    floor: &[f64],
    after: &FitErrors,
    named: &[NamedEffect],
) -> (Option<Unattributed>, Vec<String>, Dependencies) {
    let (rule, context) = (study.rule(), model.context(study));
    let rms = &after.fit.rms;
    let is_left = |j: &usize| rms[*j] > rule.above_floor * floor[*j] && model.fit.inflation[*j] > rule.unlike;
    let candidates: Vec<usize> = context.moving_joints().map(JointNumber::index).filter(is_left).collect();
    let found = parallel::map(&candidates, |j| depends_on(&context, *j));
    let dependencies = Dependencies::new(candidates.iter().copied().zip(found.iter().cloned()));
    let mut signals: Vec<(String, f64)> = Vec::new();
    let (mut joints, mut nothing, mut little) = (Vec::<JointNumber>::new(), Vec::new(), Vec::new());
    for (j, list) in candidates.iter().zip(found) {
        let Some((strongest, _)) = list.first() else {
            nothing.push(format!("{} ({:.1} times the noise floor)", j + 1, rms[*j] / floor[*j]));
            continue;
        };
        if needs_no_name(study, &after.validate, floor, *j) {
            let left = 100.0 * after.validate.relative[*j];
            little.push(format!("{strongest} on joint {} ({left:.1} % of its torque)", j + 1));
            continue;
        }
        joints.push(JointNumber::from_index(*j));
        for (name, share) in list {
            match signals.iter_mut().find(|(n, _)| *n == name) {
                Some((_, s)) => *s = s.max(share),
                None => signals.push((name, share)),
            }
        }
    }
    signals.sort_by(|a, b| b.1.total_cmp(&a.1));
    let unattributed = (!joints.is_empty()).then(|| Unattributed {
        rms: joints.iter().map(|j| rms[j.index()]).collect(),
        depends_on: signals.into_iter().map(|(name, _)| name).collect(),
        considered: considered(history, &joints, named),
        joints,
    });
    let mut unexplained = Vec::new();
    if !little.is_empty() {
        unexplained.push(format!("the small remaining error depends on {}", little.join(", ")));
    }
    if !nothing.is_empty() {
        unexplained.push(format!(
            "the remaining error of joint {} is slower than white noise and depends on no position, \
                velocity, acceleration, load or time: slow noise of the sensor, or a cause that comes and \
                goes",
            nothing.join(", ")
        ));
    }
    (unattributed, unexplained, dependencies)
}

/// The effects that were refused on joints without being named on one of them, by the last step or before.
fn considered(history: &History, joints: &[JointNumber], named: &[NamedEffect]) -> Vec<Rival> {
    let on_these = |rival: &Rival| {
        rival.joints.iter().any(|joint| joints.contains(joint))
            && !named.iter().any(|effect| effect.is(&rival.effect, &rival.joints))
    };
    let taken_back = |proposal: &Vec<Candidate>| {
        let mut joints: Vec<JointNumber> = proposal.iter().flat_map(|c| c.joints.clone()).collect();
        joints.sort_unstable();
        joints.dedup();
        let effect = proposal.first()?.effect().name().to_string();
        Some(Rival { effect, joints, alike: false, why_not: TAKEN_BACK.to_string() })
    };
    let earlier = history.questions.iter().flat_map(|q| &q.proposals).filter_map(taken_back);
    let mut all: Vec<Rival> = Vec::new();
    for rival in history.refused.iter().cloned().chain(earlier).filter(on_these) {
        if !all.iter().any(|known| known.effect == rival.effect && known.joints == rival.joints) {
            all.push(rival);
        }
    }
    all
}

// Dependencies of a residual: the samples that it is worth, and the signals it depends on.

/// The signals that each joint's residual depends on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dependencies(Vec<(usize, Vec<(String, f64)>)>);

impl Dependencies {
    pub(super) fn new(by_joint: impl Iterator<Item = (usize, Vec<(String, f64)>)>) -> Dependencies {
        Dependencies(by_joint.collect())
    }

    /// The dependencies of a joint, the strongest first, with the share of its variance.
    pub(crate) fn of(&self, joint: usize) -> &[(String, f64)] {
        self.0.iter().find(|(j, _)| *j == joint).map_or(&[], |(_, list)| list.as_slice())
    }
}

/// The number of independent samples with the same information: Σ over joints of N over its autocorrelation
/// time.
#[must_use]
pub(crate) fn effective_samples(data: &Data<'_>, residual: &[Vec<f64>]) -> usize {
    let mut total = 0.0;
    for (joint, r) in data.joints.iter().zip(residual) {
        let variance: f64 = r.iter().map(|v| v * v).sum();
        if variance == 0.0 {
            continue;
        }
        let mut time = 1.0;
        for lag in 1..200 {
            let covariance: f64 = joint
                .rows
                .iter()
                .map(|rows| {
                    let r = &r[rows.clone()];
                    r.iter().zip(r.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>()
                })
                .sum();
            // Beyond the first non-positive value the sum is noise.
            if covariance <= 0.0 {
                break;
            }
            time += 2.0 * covariance / variance;
        }
        total += r.len() as f64 / time;
    }
    total as usize
}

/// Quantile bins in which a residual's mean is taken.
const BINS: usize = 12;
/// Time shifts of a signal that show what chance gives.
const SHIFTS: usize = 19;

/// The signals on which a joint's residual may depend, by its rows: positions, velocities and accelerations
/// of all joints, the rigid arm's torque on this one, and time.
#[must_use]
pub(crate) fn signals(context: &Context<'_>, joint: usize) -> Vec<(String, Vec<f64>)> {
    let data = context.data;
    let rows = &data.joints[joint];
    let mut signals: Vec<(String, Vec<f64>)> = Vec::new();
    let pick = |values: &dyn Fn(usize) -> Vec<f64>| {
        let mut out = Vec::with_capacity(rows.len());
        for (r, recording) in data.recordings.iter().enumerate() {
            let values = values(r);
            let kept = rows.band.kept(recording.len());
            out.extend(rows.kept[r].iter().map(|k| values[kept[*k]]));
        }
        out
    };
    let n = data.dof();
    for i in 0..n {
        let name = |what: &str| format!("{what}{}", i + 1);
        signals.push((name("q"), pick(&|r| data.recordings[r].position(i).collect())));
        signals.push((name("dq"), pick(&|r| data.recordings[r].velocity(i).collect())));
        signals.push((name("ddq"), pick(&|r| data.recordings[r].acceleration(i).collect())));
        if i == joint {
            let rigid = context.rigid();
            signals.push((name("tau"), pick(&|r| rigid[r].iter().skip(i).step_by(n).copied().collect())));
        }
    }
    signals.push((
        "t".into(),
        pick(&|r| {
            (0..data.recordings[r].len()).map(|k| data.recordings[r].clock + k as f64 / data.rate()).collect()
        }),
    ));
    signals
}

/// The signals that a joint's residual depends on, with the share of its variance: those that beat every
/// time-shifted copy of themselves, the strongest first.
#[must_use]
pub(crate) fn depends_on(context: &Context<'_>, joint: usize) -> Vec<(String, f64)> {
    let rows = &context.data.joints[joint];
    let residual = &context.residual[joint];
    let mut rng = chacha20::ChaCha8Rng::seed_from_u64(joint as u64);
    let mut found = Vec::new();
    for (name, signal) in signals(context, joint) {
        let bins = quantile_bins(&signal, BINS);
        let share = explained_share(&bins, residual);
        if share < context.rule.least_gain {
            continue;
        }
        let chance = (0..SHIFTS)
            .map(|_| {
                let mut shifted = bins.clone();
                for rows in &rows.rows {
                    let by = (rng.random_range(0.15..0.85) * rows.len() as f64) as usize;
                    shifted[rows.clone()].rotate_left(by);
                }
                explained_share(&shifted, residual)
            })
            .fold(0.0, f64::max);
        if share > chance {
            found.push((name, share));
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found
}

/// The quantile bin of each value, as one of `count` bins.
#[must_use]
pub(crate) fn quantile_bins(signal: &[f64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..signal.len()).collect();
    order.sort_by(|a, b| signal[*a].total_cmp(&signal[*b]));
    let mut bins = vec![0; signal.len()];
    for (rank, k) in order.iter().enumerate() {
        bins[*k] = rank * count / signal.len();
    }
    bins
}

fn explained_share(bins: &[usize], residual: &[f64]) -> f64 {
    let (mut sums, mut counts, mut square) = ([0.0; BINS], [0.0; BINS], 0.0);
    for (b, r) in bins.iter().zip(residual) {
        sums[*b] += r;
        counts[*b] += 1.0;
        square += r * r;
    }
    if square == 0.0 {
        return 0.0;
    }
    sums.iter().zip(counts).filter(|(_, c)| *c > 0.0).map(|(s, c)| s * s / c).sum::<f64>() / square
}
