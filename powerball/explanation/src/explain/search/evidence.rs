//! The evidence for a candidate: blocks that agree, folds that gain, a validation set that gains.
//!
//! The module also decides whether the evidence for a candidate is sufficient.

use super::screen::Screen;
use crate::effects::Candidate;
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_identification::estimate::distribution::f_tail;
use powerball_identification::estimate::{Folds, MEAN_OVER, NormalEquations, variance_inflation};
use powerball_identification::evidence::{Rows, Trial, gain_on};
use powerball_logs::regression::Column;
use powerball_logs::vector::{dot, median};

/// The evidence for one candidate.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    /// Penalised gain.
    pub(crate) score: f64,
    /// Cluster-robust Wald test over blocks, base refitted: the probability of such coefficients by chance.
    pub(crate) p_value: f64,
    /// Share by which the held-out squared error of the candidate's joints falls, by fold.
    pub(crate) fold_gains: Vec<f64>,
    /// That share on the validation set: the median over its logs.
    pub(crate) validation_gain: f64,
    /// For an event: the remaining share of the additional squared error of its time over other times; 1 or
    /// more if that time has no larger error than others.
    pub(crate) event_left: Option<f64>,
}

impl Evidence {
    /// The median of the held-out gains over folds.
    pub(crate) fn median_gain(&self) -> f64 {
        median(&mut self.fold_gains.clone())
    }
}

/// The extent in which a candidate acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Extent {
    /// The candidate acts in all logs.
    Everywhere,
    /// The candidate acts in some logs, for most of their time.
    SomeLogs,
    /// For this long, s: too short for blocks and folds.
    Short(f64),
}

impl Extent {
    /// The extent of a candidate.
    pub(crate) fn of(candidate: &Candidate) -> Extent {
        match candidate.windows.iter().map(|w| w.to - w.from).reduce(f64::max) {
            None => Extent::Everywhere,
            Some(seconds) if seconds.is_finite() => Extent::Short(seconds),
            Some(_) => Extent::SomeLogs,
        }
    }
}

/// Gathers the evidence for a trial. `validation` holds the validation set and the candidate's columns there.
#[must_use]
pub(crate) fn evidence(
    screen: &Screen<'_>,
    trial: &Trial,
    joints: &[JointNumber],
    folds: &Folds,
    extent: Extent,
    validation: Option<(&Rows<'_>, &[Column])>,
) -> Evidence {
    let base = &screen.base;
    let (p_value, fold_gains, event_left) = match extent {
        Extent::Short(seconds) => {
            let after = base.left(trial);
            let by_chance = by_chance(screen, trial, &after, seconds);
            let gains = event_gains(screen, trial, &base.freed(trial));
            (by_chance, gains, Some(event_left(screen, trial, &after)))
        }
        _ => {
            let local = extent != Extent::Everywhere;
            let p_value = base.p_value(trial, &base.rows.data.blocks);
            (p_value, screen.folds.gains(base, trial, joints, folds, local), None)
        }
    };
    let on_validation =
        |(set, columns): (&Rows<'_>, &[Column])| gain_on(set, (trial, columns), base.weights, joints);
    Evidence {
        event_left,
        score: trial.score,
        p_value,
        fold_gains,
        validation_gain: validation.map_or(0.0, on_validation),
    }
}

/// The probability of the gain by chance, for an event of some seconds, too short for blocks. Gains are over
/// the variance inflation of means over 1 s; slow noise looks like an event that lasts as long as it stays,
/// so it is that of means over the event's own duration that counts.
fn by_chance(screen: &Screen<'_>, trial: &Trial, after: &[Vec<f64>], seconds: f64) -> f64 {
    let data = screen.context.data;
    let slower: Vec<f64> = (after.iter().enumerate())
        .filter(|(j, e)| !e.is_empty() && trial.columns.iter().any(|c| c.at(*j).is_some()))
        .map(|(j, e)| {
            let inflation = |over: f64| variance_inflation(data, j, e, over);
            (inflation(seconds.max(MEAN_OVER)) / inflation(MEAN_OVER)).max(1.0)
        })
        .collect();
    let slower = slower.iter().sum::<f64>() / slower.len().max(1) as f64;
    let used = trial.theta.iter().filter(|t| **t != 0.0).count() as f64;
    // The inflation itself is known from about a hundred means.
    f_tail(trial.gain / slower.max(1.0) / used.max(1.0), used, 100.0)
}

/// Parts into which an event's own rows are dealt.
const EVENT_PARTS: usize = 5;

/// Held-out gains of a short event: it happens once, so that each part of its rows is predicted from the
/// others. Rows are dealt to the parts in turn: a part in one piece would test whether the noise of a fifth
/// of the event is smaller than the event, while an event is distinguished from slow noise by what its log
/// holds elsewhere ([`by_chance`]).
fn event_gains(screen: &Screen<'_>, trial: &Trial, columns: &[Vec<Vec<f64>>]) -> Vec<f64> {
    let fit = screen.context.fit;
    let k = trial.columns.len();
    let places: Vec<usize> = (0..k).collect();
    let mut parts = vec![NormalEquations::zero(k); EVENT_PARTS];
    for j in 0..fit.design.dof() {
        let residual = &screen.context.residual[j];
        let rows: Vec<usize> = (0..residual.len())
            .filter(|i| trial.columns.iter().any(|c| c.at(j).is_some_and(|v| v[*i] != 0.0)))
            .collect();
        for (n, part) in parts.iter_mut().enumerate() {
            let own = |x: &Vec<f64>| -> Vec<f64> {
                rows.iter().skip(n).step_by(EVENT_PARTS).map(|row| x[*row]).collect()
            };
            let columns: Vec<Vec<f64>> = columns[j].iter().map(own).collect();
            part.add_columns(&places, &columns, &own(residual), fit.weights[j]);
        }
    }
    let gain = |held: usize| {
        let mut others = NormalEquations::zero(k);
        parts.iter().enumerate().filter(|(n, _)| *n != held).for_each(|(_, p)| others.add(&places, p, 1.0));
        let part = &parts[held];
        (part.square > 0.0).then(|| 1.0 - part.left(&others.solve()) / part.square)
    };
    (0..EVENT_PARTS).filter_map(gain).collect()
}

/// See [`Evidence::event_left`]. Other times are represented by the median over blocks, so that other events
/// do not count.
fn event_left(screen: &Screen<'_>, trial: &Trial, after: &[Vec<f64>]) -> f64 {
    let (data, fit) = (screen.context.data, screen.context.fit);
    let (mut excess, mut stays) = (0.0, 0.0);
    for (j, residual) in screen.context.residual.iter().enumerate() {
        let inside = |i: &usize| trial.columns.iter().any(|c| c.at(j).is_some_and(|v| v[*i] != 0.0));
        let rows: Vec<usize> = (0..residual.len()).filter(inside).collect();
        let blocks = data.blocks.iter().map(|block| &residual[block.rows[j].clone()]);
        let elsewhere = blocks.filter(|own| !own.is_empty()).map(|own| dot(own, own) / own.len() as f64);
        let usual = median(&mut elsewhere.collect::<Vec<f64>>());
        for i in rows {
            excess += fit.weights[j] * (residual[i] * residual[i] - usual);
            stays += fit.weights[j] * (after[j][i] * after[j][i] - usual);
        }
    }
    if excess > 0.0 { stays.max(0.0) / excess } else { f64::INFINITY }
}

// Whether the evidence for a candidate is enough: the rule that accepts or refuses.

/// Why a candidate is refused, `None` where it passes. `tests` counts what was tried over joints and
/// candidates.
pub(crate) fn refusal(rule: &Rule, evidence: &Evidence, tests: f64, local: bool) -> Option<String> {
    if evidence.score < rule.least_score {
        return Some(format!("explains too little (score {:.1} of {})", evidence.score, rule.least_score));
    }
    let p = (evidence.p_value * tests).min(1.0);
    if p > rule.family_wise {
        return Some(format!(
            "not significant between independent blocks (p = {p:.2} over all that was tried)"
        ));
    }
    let folds = &evidence.fold_gains;
    let good = folds.iter().filter(|g| **g > 0.0).count();
    let mean = folds.iter().sum::<f64>() / folds.len().max(1) as f64;
    if (good as f64) < rule.nearly_all * folds.len() as f64 {
        return Some(format!("the held-out error falls in {good} of {} folds only", folds.len()));
    }
    if mean < rule.least_gain {
        return Some(format!("the held-out squared error falls by {:.1} % only", 100.0 * mean));
    }
    if let Some(worst) = folds.iter().copied().reduce(f64::min).filter(|w| *w < -rule.negligible) {
        return Some(format!("one held-out fold is {:.0} % worse", -100.0 * worst));
    }
    // A push is where errors are larger than elsewhere, and explains that.
    if let Some(left) = evidence.event_left.filter(|left| *left > 1.0 - rule.most) {
        return Some(match left.is_finite() {
            true => {
                format!("leaves {:.0} % of the additional squared error of its time", 100.0 * left)
            }
            false => "its time has no larger error than others".to_string(),
        });
    }
    // An effect in some logs only need not be in the validation set.
    if evidence.validation_gain <= 0.0 && !local {
        return Some(format!(
            "does not lower the error on the other path ({:+.1} %)",
            -100.0 * evidence.validation_gain
        ));
    }
    None
}
