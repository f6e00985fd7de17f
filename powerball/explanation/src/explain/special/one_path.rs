//! Whether the validation logs run the same path as the fitted ones: then functions of the path cannot be
//! judged.
//!
//! The module also chooses between one fit for all joints and one fit per joint on a repeated path, and finds
//! when logs were recorded if their times do not show it.

use super::super::model::Model;
use super::super::search::Screen;
use super::super::study::Study;
use crate::effects::{self, Candidate, Context, Effect};
use crate::rule::Rule;
use powerball_identification::estimate::{Design, Fit, friction_columns};
use powerball_identification::evidence::{Rows, Trial, gain_on};
use powerball_logs::log::Log;
use powerball_logs::parallel;
use powerball_logs::regression::{Data, Recording};

/// Whether every recording of `other` repeats one of `data`.
#[must_use]
pub(crate) fn repeats(rule: &Rule, data: &Data<'_>, other: &Data<'_>) -> bool {
    let again = |o: &Recording| data.recordings.iter().any(|r| same_path(rule, r, o));
    other.recordings.iter().all(again)
}

fn same_path(rule: &Rule, a: &Recording, b: &Recording) -> bool {
    let n = a.dof;
    let samples = a.len().min(b.len());
    // A short stretch that agrees is not a path.
    if samples * 2 < a.len().max(b.len()) || (a.rate - b.rate).abs() > 0.05 * a.rate {
        return false;
    }
    let (mut common, mut own) = (0.0, [0.0; 2]);
    for j in 0..n {
        let mean = |r: &Recording| (0..samples).map(|k| r.q[k * n + j]).sum::<f64>() / samples.max(1) as f64;
        let (mean_a, mean_b) = (mean(a), mean(b));
        for k in 0..samples {
            let (x, y) = (a.q[k * n + j] - mean_a, b.q[k * n + j] - mean_b);
            common += x * y;
            own[0] += x * x;
            own[1] += y * y;
        }
    }
    common > (1.0 - rule.little) * (own[0] * own[1]).sqrt()
}

// On a repeated path: one multibody model for all joints (the joint fit), or inertial parameters for each
// joint by itself (the per-joint fit, see [`Data::per_joint_fit`]).

/// Whether the first model's squared errors on the validation set are clearly below the second's: the
/// geometric mean over all rows, which no joint's unit rules.
pub(crate) fn predicts_better(model: (&Study<'_>, &Model), rival: (&Study<'_>, &Model)) -> bool {
    let square = |(study, model): (&Study<'_>, &Model)| -> Vec<(f64, f64)> {
        let left = model.residual_on_validation(study);
        left.iter().zip(left.squares()).map(|(r, square)| (r.len() as f64, square)).collect()
    };
    let (mut log_ratio, mut rows) = (0.0, 0.0);
    for ((n, own), (_, theirs)) in square(model).into_iter().zip(square(rival)) {
        if own > 0.0 && theirs > 0.0 {
            log_ratio += n * (own / theirs).ln();
            rows += n;
        }
    }
    log_ratio < rows * (1.0 - model.0.rule().little).ln()
}

// When logs were recorded, if their times do not show it.
//
// Times that restart in each file do not show when a file was recorded; the order of the files is used
// instead, and the logs of `--validate` then come after those of `--log`. But they may as well have been
// recorded in between (every other repeat is held out, say), and a series of repeats that starts from another
// place may have started with a cold arm. Warming distinguishes these cases: the one that it fits best is
// taken.

/// When logs were recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clock {
    /// The order that their times or the files give.
    AsGiven,
    /// The logs to judge on lie in between the fitted ones.
    InBetween,
    /// Every series of repeats from the same place began with a cold arm, and those to judge on were recorded
    /// in between.
    ColdSeries,
}

impl Clock {
    /// A note for the reader of the result.
    pub(crate) fn note(self) -> Option<&'static str> {
        match self {
            Clock::AsGiven => None,
            Clock::InBetween => Some(
                "the times restart in each file: the logs of --validate are taken to have been recorded in \
                    between those of --log, because warming fits that order better than the order given",
            ),
            Clock::ColdSeries => Some(
                "the times restart in each file: every series of runs from the same start is taken to have \
                    started with a cold arm, because warming fits that better than one running time through \
                    all files",
            ),
        }
    }
}

/// Chooses when recordings were made, if only the order of the files is known: the choice, and both sets with
/// it, if it differs from the given order.
pub(crate) fn choose_clock<'a>(
    rule: &Rule,
    logs: &[Log],
    validate: &[Log],
    fit: &Fit,
    (data, other): (&Data<'a>, &Data<'a>),
) -> (Clock, Option<[Data<'a>; 2]>) {
    let known = |clock: f64| logs.iter().chain(validate).all(|log| (log.clock - clock).abs() < 1e-9);
    if logs.first().is_none_or(|first| known(first.clock)) {
        return (Clock::AsGiven, None);
    }
    let Some(effect) = effects::all().iter().find(|e| e.needs_running_time()) else {
        return (Clock::AsGiven, None);
    };
    let baseline = [in_series(data, other, |_, _| true), in_series(other, data, |_, _| true)];
    let same = same_start(rule, data, other);
    let cold = [in_series(data, other, &same), in_series(other, data, &same)];
    let mut best = (Clock::AsGiven, None);
    let mut most = gain(rule, *effect, data, fit, other).max(0.0);
    for (clock, [own, others]) in [(Clock::InBetween, &baseline), (Clock::ColdSeries, &cold)] {
        let sets = [data.with_clocks(own), other.with_clocks(others)];
        let gain = gain(rule, *effect, &sets[0], fit, &sets[1]);
        // Equal clocks are equally good; the first is the simplest.
        if gain > most * (1.0 + 1e-9) {
            (best, most) = ((clock, Some(sets)), gain);
        }
    }
    best
}

/// The gain of warming on both sets of logs.
fn gain(rule: &Rule, effect: &dyn Effect, data: &Data<'_>, fit: &Fit, other: &Data<'_>) -> f64 {
    let context = Context::new(data, fit, &fit.residual, rule);
    let screen = Screen::new(&context);
    let candidates = effect.candidates(&context);
    let trials = parallel::map(&candidates, |c| screen.try_candidate(c));
    // The best one of each joint.
    let mut best: Vec<(&Candidate, Trial)> = Vec::new();
    for (candidate, trial) in candidates.iter().zip(trials) {
        let Some(trial) = trial.filter(|t| t.score >= rule.least_score) else { continue };
        match best.iter_mut().find(|(c, _)| c.joints == candidate.joints) {
            Some((_, t)) if t.score >= trial.score => {}
            Some(known) => *known = (candidate, trial),
            None => best.push((candidate, trial)),
        }
    }
    let residual = fit.residual_on(other, &[]);
    let design = Design::new(other, &friction_columns(other, &fit.shapes), &[]);
    let validation = Rows { data: other, design: &design, residual: &residual };
    let context = Context::new(other, fit, &residual, rule);
    let of = |(candidate, trial): &(&Candidate, Trial)| {
        let columns = effect.columns(&context, candidate);
        let gain = gain_on(&validation, (trial, &columns), screen.base.weights, &candidate.joints);
        trial.score * gain.clamp(-1.0, 1.0)
    };
    best.iter().map(of).sum()
}

/// Whether two runs start at the same place.
fn same_start(
    rule: &Rule,
    data: &Data<'_>,
    other: &Data<'_>,
) -> impl Fn(&Recording, &Recording) -> bool + use<> {
    let reach = |j: usize| {
        let positions = data.recordings.iter().chain(other.recordings.iter()).flat_map(|r| r.position(j));
        let (low, high) = positions.fold((f64::MAX, f64::MIN), |(l, h): (f64, f64), q| (l.min(q), h.max(q)));
        rule.negligible * (high - low).max(1e-9)
    };
    let reach: Vec<f64> = (0..data.dof()).map(reach).collect();
    move |a, b| reach.iter().enumerate().all(|(j, reach)| (a.q[j] - b.q[j]).abs() <= *reach)
}

/// Clocks that restart with every series of runs that are `same`; runs of one set are taken to alternate
/// with those of the other.
fn in_series(data: &Data<'_>, other: &Data<'_>, same: impl Fn(&Recording, &Recording) -> bool) -> Vec<f64> {
    let lasting = |r: &Recording| r.len() as f64 / r.rate;
    let mut clocks = Vec::with_capacity(data.recordings.len());
    for (at, r) in data.recordings.iter().enumerate() {
        // The first recording of a log represents its run.
        let run = data.recordings[..at].iter().find(|first| first.log == r.log).unwrap_or(r);
        let of_series = |d: &Data<'_>, until: usize| -> f64 {
            let runs = d.recordings.iter().filter(|x| x.log < until);
            runs.filter(|x| d.recordings.iter().find(|f| f.log == x.log).is_some_and(|f| same(f, run)))
                .map(lasting)
                .sum()
        };
        let (own, theirs) = (of_series(data, usize::MAX), of_series(other, usize::MAX));
        let before = of_series(data, run.log) * (own + theirs) / own;
        clocks.push(before + r.clock - run.clock);
    }
    clocks
}
