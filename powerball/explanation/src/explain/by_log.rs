//! Differences of one log from the others: friction, a zero, a gain, a delay.
//!
//! All logs, fitted or for validation, are taken under one model. Errors that all logs share cancel: a model
//! that is equally wrong in all of them makes none of them different.

use super::model::Model;
use super::study::Study;
use crate::effects::{self, Context, Settings, temperature};
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::evidence::p_of_coefficients;
use powerball_identification::estimate::{Design, Folds, Gram, Solver, friction_columns};
use powerball_logs::parallel;
use powerball_logs::regression::{Column, Data, Signals};
use powerball_logs::vector::dot;
use std::ops::Range;

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
        let asked: Vec<Option<(f64, f64)>> = parallel::map(&places, |(t, l)| {
            let (side, log) = logs[*l];
            together.screen(side, log, &tried[*t].columns[side])
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
            let (side, log) = logs[l];
            let asked = together.ask(side, log, &tried[t].columns[side])?;
            if !tried[t].possible.contains(&asked.theta) {
                return None;
            }
            let others: Vec<f64> =
                (0..logs.len()).filter(|k| *k != l).filter_map(|k| Some(of(t, k)?.0)).collect();
            let share = share(&together, (side, log), &logs, &tried[t].joints, &asked, rule.unlike)?;
            let enough = share >= 1.0 - rule.max_unexplained
                && by_chance(&together, &asked) * places.len() as f64 <= rule.family_wise
                && stands_out(asked.theta, &others);
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
        let value = unit * asked.theta;
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
            let theta = if with { asked.theta } else { 0.0 };
            let left =
                together.residual[side][j][rows.clone()].iter().zip(&asked.column[side][j][rows.clone()]);
            square += together.weight(j) * left.map(|(r, c)| (r - theta * c).powi(2)).sum::<f64>();
            count += rows.len();
        }
        (count > 0).then(|| square / count as f64)
    };
    let usual = logs.iter().filter(|log| **log != own).filter_map(|log| error(log, true)).reduce(f64::max)?;
    let (before, after) = (error(&own, false)?, error(&own, true)?);
    (before > odd * usual).then(|| (before - after) / (before - usual))
}

/// The probability of such a coefficient by chance: blocks of all logs as clusters.
fn by_chance(together: &Together<'_>, asked: &Asked) -> f64 {
    let square = Mat::from_fn(1, 1, |_, _| asked.gain / asked.theta.powi(2));
    p_of_coefficients(&[asked.theta], &square, &together.by_block(asked))
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
    /// The model's coefficients.
    pub(crate) theta: Vec<f64>,
    designs: [Design; SIDES],
    solver: Solver,
    weights: Vec<f64>,
}

/// The part of a log's residual that a column of this log explains in addition to the model.
pub(crate) struct Asked {
    /// The column's coefficient.
    pub(crate) theta: f64,
    /// χ² explained.
    pub(crate) gain: f64,
    /// The column less what the model imitates of it, by side, joint and row.
    pub(crate) column: [Signals; SIDES],
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
        let theta: Vec<f64> =
            (0..solved.len()).map(|c| if fit.free[c] { solved[c] } else { fit.theta[c] }).collect();
        let moved: Vec<f64> = theta.iter().zip(&fit.theta).map(|(new, old)| new - old).collect();
        let designs = [fit.design.clone(), on_validation];
        let mut residual = [fit.residual.clone(), model.residual_on_validation(study)];
        for (residual, design) in residual.iter_mut().zip(&designs) {
            for (j, residual) in residual.iter_mut().enumerate() {
                residual.iter_mut().zip(design.predict(j, &moved)).for_each(|(r, more)| *r -= more);
            }
        }
        let data = [&study.data, validation];
        Together { data, residual, theta, designs, solver, weights: fit.weights.clone() }
    }

    /// The rows of a log on a joint.
    pub(crate) fn rows(&self, side: usize, log: usize, joint: usize) -> Range<usize> {
        let data = self.data[side];
        let own = data.recordings.iter().zip(&data.joints[joint].rows).filter(|(r, _)| r.log == log);
        let (first, last) =
            own.fold((usize::MAX, 0), |(a, b), (_, rows)| (a.min(rows.start), b.max(rows.end)));
        if first < last { first..last } else { 0..0 }
    }

    /// A joint's weight: 1 over the variance of the model's residual.
    pub(crate) fn weight(&self, joint: usize) -> f64 {
        self.weights[joint]
    }

    /// The coefficient of a column in one log alone and what it explains, χ²; `None` where the model imitates
    /// it wholly.
    pub(crate) fn screen(&self, side: usize, log: usize, column: &Column) -> Option<(f64, f64)> {
        self.solve(side, log, column).map(|(theta, gain, _)| (theta, gain))
    }

    /// Like [`Self::screen`], with the column itself.
    pub(crate) fn ask(&self, side: usize, log: usize, column: &Column) -> Option<Asked> {
        let (theta, gain, base) = self.solve(side, log, column)?;
        let mut freed: [Signals; SIDES] = [0, 1].map(|s: usize| {
            let negative = |j| self.designs[s].predict(j, &base).iter().map(|v| -v).collect();
            (0..self.data[s].dof()).map(negative).collect()
        });
        for (j, values) in &column.parts {
            let rows = self.rows(side, log, *j);
            freed[side][*j][rows.clone()].iter_mut().zip(&values[rows]).for_each(|(f, v)| *f += v);
        }
        Some(Asked { theta, gain, column: freed })
    }

    /// The coefficient, the gain and the model's shares in the column.
    fn solve(&self, side: usize, log: usize, column: &Column) -> Option<(f64, f64, Vec<f64>)> {
        let mut cross = vec![0.0; self.theta.len()];
        let (mut raw, mut score) = (0.0, 0.0);
        for (j, values) in &column.parts {
            let (rows, w) = (self.rows(side, log, *j), self.weights[*j]);
            for (g, value) in self.designs[side].cross(*j, &rows, &[values.as_slice()]) {
                cross[g] += w * value[0];
            }
            let own = &values[rows.clone()];
            raw += w * dot(own, own);
            score += w * dot(own, &self.residual[side][*j][rows]);
        }
        let base = self.solver.solve(&cross);
        let square = raw - dot(&cross, &base);
        let theta = score / square;
        (square > 1e-6 * raw && score.is_finite()).then_some((theta, theta * score, base))
    }

    /// The sums over blocks of all logs of a column times the residual with it: their variation shows
    /// how surely its coefficient is known.
    pub(crate) fn by_block(&self, asked: &Asked) -> Vec<Vec<f64>> {
        let mut sums = Vec::new();
        for (side, data) in self.data.iter().enumerate() {
            for block in &data.blocks {
                let of = |(j, rows): (usize, &Range<usize>)| {
                    let (r, c) =
                        (&self.residual[side][j][rows.clone()], &asked.column[side][j][rows.clone()]);
                    self.weights[j] * (dot(c, r) - asked.theta * dot(c, c))
                };
                sums.push(vec![block.rows.iter().enumerate().map(of).sum()]);
            }
        }
        sums
    }

    /// Takes a column in.
    pub(crate) fn take(&mut self, asked: &Asked) {
        for (residual, column) in self.residual.iter_mut().zip(&asked.column) {
            residual.add_signal(column, -asked.theta);
        }
    }
}
