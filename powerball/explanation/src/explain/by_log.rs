//! Differences of one log from the others: friction, a zero, a gain, a delay.
//!
//! All logs, fitted or for validation, are taken under one model. Errors that all logs share cancel: a model
//! that is equally wrong in all of them makes none of them different.

use super::model::Model;
use super::study::Study;
use crate::effects::{self, Context, Settings, temperature};
use powerball_controller::JointNumber;
use powerball_identification::estimate::{Design, Folds, Gram, Solver, friction_columns};
use powerball_identification::evidence::{Base, Clusters, Rows, Trial};
use powerball_logs::parallel;
use powerball_logs::regression::{Column, Data, Signals};
use powerball_logs::vector::dot;
use std::ops::Range;
use std::sync::Arc;

/// A change in one log.
#[derive(Clone, Debug)]
pub(crate) struct Changed {
    /// The file of the log.
    pub(crate) log: String,
    /// The name of the effect that it would be if it were in all logs.
    pub(crate) effect: &'static str,
    pub(crate) joints: Vec<JointNumber>,
    /// Size of the difference: of friction and of a gain relative, of a zero in N·m (N) or rad (m), of a
    /// delay in s.
    pub(crate) value: f64,
    /// The share of the additional squared error of its joints in this log that this change explains.
    pub(crate) share: f64,
}

/// A change that is tried, with its columns on the fitted logs and on the validation set.
struct Tried {
    effect: &'static str,
    joints: Vec<JointNumber>,
    /// Factor from its coefficient to a figure.
    unit: f64,
    /// Coefficients that are possible.
    possible: Range<f64>,
    columns: [Column; SIDES],
}

/// Largest number of differences that are searched in a log, all logs together.
const MOST_A_LOG: usize = 3;
/// With this many other logs, a coefficient must be this many times as far from theirs as they are spread.
const OTHERS: usize = 3;
const FAR: f64 = 3.0;

/// The changes, the most certain first, and the residual with them, by side, joint and row.
pub(crate) fn changes(
    study: &Study<'_>,
    model: &Model,
    mut together: Together<'_>,
) -> (Vec<Changed>, [Signals; SIDES]) {
    let tried = tried(study, model);
    let logs: Vec<(usize, usize)> = (together.data.iter().enumerate())
        .flat_map(|(side, data)| (0..data.logs.len()).map(move |log| (side, log)))
        .collect();
    let (rule, mut found) = (study.rule(), Vec::new());
    let places: Vec<(usize, usize)> =
        (0..tried.len()).flat_map(|t| (0..logs.len()).map(move |l| (t, l))).collect();
    while logs.len() > 1 && found.len() < MOST_A_LOG * logs.len() {
        let bases = [0, 1].map(|side| together.base(side));
        let asked: Vec<Option<(f64, f64)>> = parallel::map(&places, |(t, l)| {
            let (side, log) = logs[*l];
            let column = tried[*t].columns[side].clone();
            let trial = bases[side].ask_within(vec![column], 1.0, |j| together.rows(side, log, j))?;
            Some((trial.theta[0], trial.gain))
        });
        let of = |t: usize, l: usize| asked[t * logs.len() + l];
        // From the largest on, until one is sure.
        let mut order: Vec<(usize, usize)> = places.clone();
        let gain = |(t, l): &(usize, usize)| of(*t, *l).map_or(0.0, |(_, gain)| gain);
        order.retain(|place| {
            gain(place) >= rule.least_score && !found.iter().any(|(known, _)| known == place)
        });
        order.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        let sure = |&(t, l): &(usize, usize)| -> Option<(Asked, f64)> {
            let asked = together.ask(logs[l], &tried[t].columns[logs[l].0])?;
            let theta = asked.trial.theta[0];
            if !tried[t].possible.contains(&theta) {
                return None;
            }
            let others: Vec<f64> =
                (0..logs.len()).filter(|k| *k != l).filter_map(|k| Some(of(t, k)?.0)).collect();
            let share = share(&together, logs[l], &logs, &tried[t].joints, &asked, rule.unlike)?;
            let enough = share >= 1.0 - rule.max_unexplained
                && together.by_chance(&asked) * places.len() as f64 <= rule.family_wise
                && stands_out(theta, &others);
            enough.then_some((asked, share))
        };
        let Some((place, (asked, share))) = order.iter().find_map(|place| Some((*place, sure(place)?)))
        else {
            break;
        };
        together.take(&asked);
        let (side, log) = logs[place.1];
        let Tried { effect, joints, unit, .. } = &tried[place.0];
        let log = together.data[side].logs[log].clone();
        let value = unit * asked.trial.theta[0];
        found.push((place, Changed { log, effect, joints: joints.clone(), value, share }));
    }
    (found.into_iter().map(|(_, changed)| changed).collect(), together.residual)
}

/// The differences that are tried for every log.
fn tried(study: &Study<'_>, model: &Model) -> Vec<Tried> {
    let (on_fitted, on_validation) = (model.context(study), study.on_validation(&model.fit, &[]));
    let mut tried = Vec::new();
    for effect in effects::all() {
        for candidate in effect.candidates(&on_fitted) {
            let Some((unit, possible)) = effect.change_of_a_log(&candidate) else { continue };
            let columns = [&on_fitted, &on_validation]
                .map(|context| context.columns(&candidate).pop().unwrap_or_default());
            tried.push(Tried { effect: effect.name(), joints: candidate.joints, unit, possible, columns });
        }
    }
    // What warms: friction that is another one in this log.
    let with = temperature::Warmth::RunningTime { time_constant: f64::INFINITY };
    let warmth = Settings::from(temperature::Settings { of: temperature::Friction::Whole, with });
    let warmth = warmth.effect().name();
    for j in on_fitted.moving_joints() {
        let columns = [&on_fitted, &on_validation].map(|context| friction(context, model, j));
        tried.push(Tried { effect: warmth, joints: vec![j], unit: 1.0, possible: -1.0..10.0, columns });
    }
    tried.retain(|t| t.columns.iter().all(|c| !c.parts.is_empty() && c.is_finite()));
    tried
}

/// The friction torque of a joint as the model has it: Eq. 16 and what was found of friction beyond that.
fn friction(context: &Context<'_>, model: &Model, joint: JointNumber) -> Column {
    let (n, j) = (context.data.dof(), joint.index());
    let base = context.friction();
    let own = context.data.column_on(j, |r, _| base[r].iter().skip(j).step_by(n).copied().collect());
    let mut friction = Signals::zeros(context.data);
    own.add_to(&mut friction, 1.0);
    for (a, coefficients) in model.accepted.iter().zip(model.coefficients()) {
        if a.effect().is_friction() && a.candidate.joints == [joint] {
            friction.add(&context.columns(&a.candidate), &coefficients);
        }
    }
    Column::on(j, std::mem::take(&mut friction[j]))
}

/// The share of what the squared error of some joints is larger in a log than in any other one that goes with
/// a column; `None` where it is not `odd` times as large. Logs of other paths are predicted more or less
/// well, and the best fit in one of them only resembles that.
fn share(
    together: &Together<'_>,
    own: (usize, usize),
    logs: &[(usize, usize)],
    joints: &[JointNumber],
    asked: &Asked,
    odd: f64,
) -> Option<f64> {
    let error = |&(side, log): &(usize, usize), with: bool| -> Option<f64> {
        let (mut square, mut count) = (0.0, 0);
        for j in joints.iter().map(|j| j.index()) {
            let rows = together.rows(side, log, j);
            let residual = &together.residual[side][j][rows.clone()];
            let fall = if with { together.side(side).fall(&asked.added[side], j, rows) } else { 0.0 };
            square += together.weights[j] * (dot(residual, residual) - fall);
            count += residual.len();
        }
        (count > 0).then(|| square / count as f64)
    };
    let usual = logs.iter().filter(|log| **log != own).filter_map(|log| error(log, true)).reduce(f64::max)?;
    let (before, after) = (error(&own, false)?, error(&own, true)?);
    (before > odd * usual).then(|| (before - after) / (before - usual))
}

/// Whether a coefficient is unlike those of other logs.
fn stands_out(theta: f64, others: &[f64]) -> bool {
    let count = others.len() as f64;
    let mean = others.iter().sum::<f64>() / count.max(1.0);
    let std = (others.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)).sqrt();
    others.len() < OTHERS || (theta - mean).abs() > FAR * std
}

// The accepted model fitted to all logs together.

/// The fitted logs, then the validation set.
pub(crate) const SIDES: usize = 2;

/// The model of all logs.
pub(crate) struct Together<'s> {
    pub(crate) data: [&'s Data<'s>; SIDES],
    /// Residual of the model, by side, joint and row, N·m.
    pub(crate) residual: [Signals; SIDES],
    designs: [Design; SIDES],
    solver: Solver,
    weights: Vec<f64>,
}

/// The answer for a column of one log.
struct Asked {
    /// Its coefficient and what it explains.
    trial: Trial,
    /// The column less what the model imitates of it, by side, joint and column.
    freed: [Vec<Vec<Vec<f64>>>; SIDES],
    /// What it adds to the prediction, by side, joint and row, N·m.
    added: [Signals; SIDES],
}

impl<'s> Together<'s> {
    pub(crate) fn new(study: &'s Study<'_>, model: &Model) -> Together<'s> {
        let (fit, validation) = (&model.fit, &study.validation);
        let columns = model.columns_on_validation(study);
        let on_validation = Design::new(validation, &friction_columns(validation, &fit.shapes), &columns);
        let mut normal = fit.normal_equations();
        let folds = Folds::new(validation);
        let more = Gram::new(validation, &on_validation, &folds).all(&fit.weights);
        normal.add(&(0..fit.design.size).collect::<Vec<_>>(), &more, 1.0);
        let solver = normal.solver(|c| fit.free[c]);
        let solved = solver.solve(&normal.right);
        let moved: Vec<f64> =
            (0..solved.len()).map(|c| if fit.free[c] { solved[c] - fit.theta[c] } else { 0.0 }).collect();
        let designs = [fit.design.clone(), on_validation];
        let mut residual = [fit.residual.clone(), model.residual_on_validation(study)];
        for (residual, design) in residual.iter_mut().zip(&designs) {
            for (j, residual) in residual.iter_mut().enumerate() {
                residual.iter_mut().zip(design.predict(j, &moved)).for_each(|(r, more)| *r -= more);
            }
        }
        let data = [&study.data, validation];
        Together { data, residual, designs, solver, weights: fit.weights.clone() }
    }

    /// The rows of a log on a joint.
    fn rows(&self, side: usize, log: usize, joint: usize) -> Range<usize> {
        let data = self.data[side];
        let own = data.recordings.iter().zip(&data.joints[joint].rows).filter(|(r, _)| r.log == log);
        let (first, last) =
            own.fold((usize::MAX, 0), |(a, b), (_, rows)| (a.min(rows.start), b.max(rows.end)));
        if first < last { first..last } else { 0..0 }
    }

    /// The model on the rows of a side.
    fn base(&self, side: usize) -> Base<'_> {
        Base::of_more(self.side(side), &self.weights, self.solver.clone(), 0.0)
    }

    fn side(&self, side: usize) -> Rows<'_> {
        Rows { data: self.data[side], design: &self.designs[side], residual: &self.residual[side] }
    }

    /// Everything about a column in one log alone; `None` where the model imitates it wholly.
    fn ask(&self, (side, log): (usize, usize), column: &Column) -> Option<Asked> {
        let own = self.within((side, log), column);
        let trial = self.base(side).ask(vec![own], 1.0)?;
        let nothing = [Column::default()];
        let columns = |s: usize| if s == side { trial.columns.as_slice() } else { nothing.as_slice() };
        let freed = [0, 1].map(|s| self.side(s).freed(columns(s), &trial.shares));
        let added = [0, 1].map(|s| self.side(s).added(columns(s), &trial));
        Some(Asked { freed, added, trial })
    }

    /// A column that is zero but in one log.
    fn within(&self, (side, log): (usize, usize), column: &Column) -> Column {
        let of = |(j, values): &(usize, Arc<Vec<f64>>)| {
            let rows = self.rows(side, log, *j);
            let mut own = vec![0.0; values.len()];
            own[rows.clone()].copy_from_slice(&values[rows]);
            (*j, own.into())
        };
        Column { parts: column.parts.iter().map(of).collect() }
    }

    /// The probability of a coefficient by chance: blocks of all logs as clusters.
    fn by_chance(&self, asked: &Asked) -> f64 {
        let mut clusters = Clusters::new(1);
        for side in 0..SIDES {
            let left = self.residual[side].without(&asked.added[side]);
            clusters.add(&self.data[side].blocks, &self.weights, &asked.freed[side], &left);
        }
        clusters.p_value(&asked.trial.theta)
    }

    /// Takes a column in.
    fn take(&mut self, asked: &Asked) {
        for (residual, added) in self.residual.iter_mut().zip(&asked.added) {
            residual.add_signal(added, -1.0);
        }
    }
}
