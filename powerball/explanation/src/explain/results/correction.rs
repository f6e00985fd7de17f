//! An optional correction for what has no name: a bounded curve of one or two signals on a joint, kept only
//! where it lowers errors that it was not fitted to. It is a number for the controller and no finding:
//! nothing is named by it.
//!
//! Also here: the formulas of laws without a name.

use super::super::comparison::Step;
use super::super::model::{Accepted, Model};
use super::super::study::Study;
use super::unattributed::signals;
use crate::effects::{Context, Figures, Found};
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::{Folds, Solver, residual_stats};
use serde::Serialize;

/// The correction of one joint: the sum of its curves, held within ±`limit`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Correction {
    /// The joint.
    pub joint: JointNumber,
    /// One curve a signal.
    pub curves: Vec<Curve>,
    /// The correction's largest size, N·m.
    pub limit: f64,
    /// rms of the joint's error on the held-out logs without it, N·m.
    pub rms_before: f64,
    /// … and with it; never more.
    pub rms_after: f64,
    /// Share by which the squared error of each left-out fold of the fitted logs falls.
    pub fold_gains: Vec<f64>,
}

/// A torque over a signal: straight between knots, constant beyond the first and the last one, which the data
/// reach.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// The signal: q2, dq3, ddq1, or tau4 (the rigid arm's torque).
    pub signal: String,
    /// Its values, rising; rad, rad/s, rad/s² or N·m.
    pub knots: Vec<f64>,
    /// Torque to add to the model's, N·m.
    pub torque: Vec<f64>,
}

/// Signals of a joint at most.
const SIGNALS: usize = 2;
/// Knots of a curve.
const KNOTS: usize = 9;
/// The first and the last knot leave out this share of the samples: where hardly anything was seen nothing is
/// corrected.
const TAIL: f64 = 0.01;
/// Ridge: each knot's torque is drawn to zero as by so many samples without a residual.
const RIDGE: f64 = 20.0;

impl Curve {
    /// A curve's weights of its knots at a value: two of them at most.
    fn weights(knots: &[f64], value: f64) -> [(usize, f64); 2] {
        let last = knots.len() - 1;
        let value = value.clamp(knots[0], knots[last]);
        let high = knots.partition_point(|k| *k < value).clamp(1, last);
        let share = (value - knots[high - 1]) / (knots[high] - knots[high - 1]);
        [(high - 1, 1.0 - share), (high, share)]
    }

    /// The torque at a value of the signal, N·m.
    #[must_use]
    pub fn torque(&self, value: f64) -> f64 {
        Curve::weights(&self.knots, value).iter().map(|(k, w)| w * self.torque[*k]).sum()
    }
}

impl Correction {
    /// The correction at values of its curves' signals, N·m.
    #[must_use]
    pub fn torque(&self, values: impl Iterator<Item = f64>) -> f64 {
        let sum: f64 = self.curves.iter().zip(values).map(|(curve, value)| curve.torque(value)).sum();
        sum.clamp(-self.limit, self.limit)
    }
}

/// Corrects a joint by the signals that its residual depends on, the strongest first; `None` where that does
/// not lower the errors of left-out folds and of the validation set.
#[must_use]
pub(crate) fn correct(
    on_fitted: &Context<'_>,
    other: &Context<'_>,
    folds: &Folds,
    joint: usize,
    depends_on: &[(String, f64)],
) -> Option<Correction> {
    let lasting: Vec<&str> =
        depends_on.iter().map(|(name, _)| name.as_str()).filter(|n| *n != "t").take(SIGNALS).collect();
    let pick = |context: &Context<'_>| -> Vec<Vec<f64>> {
        let all = signals(context, joint);
        lasting.iter().filter_map(|n| Some(all.iter().find(|(name, _)| name == n)?.1.clone())).collect()
    };
    let (values, others) = (pick(on_fitted), pick(other));
    let residual = &on_fitted.residual[joint];
    let knots: Vec<Vec<f64>> = values.iter().map(|v| knots(v)).collect();
    if knots.is_empty() || knots.iter().any(|k| k.len() < 3) || residual.is_empty() {
        return None;
    }
    let rms = |r: &[f64]| (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt();
    let limit = on_fitted.rule.correction_bound * rms(residual);
    let fitted_without = |left_out: &dyn Fn(usize) -> bool| -> Correction {
        let torque = ridge(&knots, &values, residual, left_out);
        let curve = |(s, torque): (usize, Vec<f64>)| Curve {
            signal: lasting[s].to_string(),
            knots: knots[s].clone(),
            torque,
        };
        Correction {
            joint: JointNumber::from_index(joint),
            curves: torque.into_iter().enumerate().map(curve).collect(),
            limit,
            rms_before: 0.0,
            rms_after: 0.0,
            fold_gains: Vec::new(),
        }
    };
    let rest = |c: &Correction, residual: &[f64], values: &[Vec<f64>], row: usize| {
        residual[row] - c.torque(values.iter().map(|v| v[row]))
    };
    let mut cell_of_row = vec![0; residual.len()];
    for (block, cell) in on_fitted.data.blocks.iter().zip(&folds.cell_of_block) {
        cell_of_row[block.rows[joint].clone()].fill(*cell);
    }
    let (held, left_out) = folds.folds(false);
    let fold_gains: Vec<f64> = (held.iter().zip(left_out))
        .filter_map(|(held, left_out)| {
            let c = fitted_without(&|row| left_out.contains(&cell_of_row[row]));
            let rows: Vec<usize> = (0..residual.len()).filter(|r| held.contains(&cell_of_row[*r])).collect();
            let square = |of: &dyn Fn(usize) -> f64| rows.iter().map(|r| of(*r).powi(2)).sum::<f64>();
            let before = square(&|r| residual[r]);
            (before > 0.0).then(|| 1.0 - square(&|r| rest(&c, residual, &values, r)) / before)
        })
        .collect();
    let mean = fold_gains.iter().sum::<f64>() / fold_gains.len().max(1) as f64;
    let whole = fitted_without(&|_| false);
    let judged = &other.residual[joint];
    let after: Vec<f64> = (0..judged.len()).map(|row| rest(&whole, judged, &others, row)).collect();
    let (rms_before, rms_after) = (rms(judged), rms(&after));
    let helps =
        mean >= on_fitted.rule.least_gain && fold_gains.iter().all(|g| *g > 0.0) && rms_after < rms_before;
    helps.then_some(Correction { rms_before, rms_after, fold_gains, ..whole })
}

/// Quantiles of a signal, without repeats.
fn knots(signal: &[f64]) -> Vec<f64> {
    let mut sorted = signal.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |k: usize| {
        let share = TAIL + (1.0 - 2.0 * TAIL) * k as f64 / (KNOTS - 1) as f64;
        sorted[(share * (sorted.len() - 1) as f64) as usize]
    };
    let mut knots: Vec<f64> = if sorted.is_empty() { Vec::new() } else { (0..KNOTS).map(at).collect() };
    knots.dedup_by(|b, a| *b <= *a);
    knots
}

/// The knots' torques by least squares with a ridge, over the rows that are not left out, by signal.
fn ridge(
    knots: &[Vec<f64>],
    values: &[Vec<f64>],
    residual: &[f64],
    left_out: &dyn Fn(usize) -> bool,
) -> Vec<Vec<f64>> {
    let size = knots.iter().map(Vec::len).sum();
    let (mut gram, mut right) = (Mat::<f64>::zeros(size, size), vec![0.0; size]);
    for row in (0..residual.len()).filter(|row| !left_out(*row)) {
        let mut first = 0;
        let mut active: Vec<(usize, f64)> = Vec::with_capacity(2 * knots.len());
        for (knots, values) in knots.iter().zip(values) {
            active.extend(Curve::weights(knots, values[row]).map(|(k, w)| (first + k, w)));
            first += knots.len();
        }
        for (i, wi) in &active {
            active.iter().for_each(|(k, wk)| gram[(*i, *k)] += wi * wk);
            right[*i] += wi * residual[row];
        }
    }
    (0..size).for_each(|i| gram[(i, i)] += RIDGE);
    let x = Solver::new(&gram, |_| true).solve(&right);
    let mut rest = x.as_slice();
    let part = |k: &Vec<f64>| {
        let (own, others) = rest.split_at(k.len());
        rest = others;
        own.to_vec()
    };
    knots.iter().map(part).collect()
}

// What is there without a name, as a formula.

/// A torque without a name that joints feel, as a formula that holds on logs that were not fitted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnnamedLaw {
    /// As text: `tau2 = c1·q2·q3 + …`; tau in N·m, positions and velocities in rad and rad/s (m and m/s where
    /// a joint slides).
    pub formula: String,
    /// The same for LaTeX.
    pub latex: String,
    /// The joints that feel it.
    pub joints: Vec<JointNumber>,
    /// Its coefficients, in order.
    pub coefficients: Vec<LawCoefficient>,
    /// The change of the rms error on the validation set by it, by joint: with it over without it, less 1.
    pub held_out_change: Vec<f64>,
    /// 1 less the probability of as much by chance, over all that was tried: that something of these signals is
    /// there, not that no other formula fits as well.
    pub probability: f64,
    /// The named effect that came nearest.
    pub nearest: Option<String>,
}

impl UnnamedLaw {
    /// The formula with its numbers and what it does, as a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let number = |c: &LawCoefficient| format!("{} = {:.4} ± {:.1e} {}", c.name, c.value, c.std, c.unit);
        let numbers: Vec<String> = self.coefficients.iter().map(number).collect();
        let change = self.held_out_change.iter().map(|change| format!("{:+.0} %", 100.0 * change));
        let nearest = self.nearest.as_ref().map(|name| format!("; the nearest name is {name}"));
        format!(
            "{} with {}: the error on the other path changes by {}{}",
            self.formula,
            numbers.join(", "),
            change.collect::<Vec<_>>().join(", "),
            nearest.unwrap_or_default()
        )
    }
}

/// A coefficient of a law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawCoefficient {
    /// As in the formula.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard error.
    pub std: f64,
    /// Its unit.
    pub unit: &'static str,
}

/// The laws without a name, in the order in which they were found.
pub(crate) fn laws(study: &Study<'_>, model: &Model, steps: &[Step]) -> Vec<UnnamedLaw> {
    let context = model.context(study);
    let with = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let errors = model.errors();
    let of = |(k, (a, place)): (usize, (&Accepted, std::ops::Range<usize>))| {
        let coefficients = &model.fit.theta[place.clone()];
        let found = Found { candidate: &a.candidate, coefficients };
        let Figures::UnnamedLaw(figures) = a.effect().figures(&context, &[found]) else { return None };
        let formula = figures.formulas.into_iter().next()?;
        let without =
            residual_stats(&study.validation, &model.without(study, k).residual_on_validation(study)).rms;
        let step = steps.iter().find(|step| Some(step.number) == a.step());
        let coefficient = |(n, (value, unit)): (usize, (&f64, &'static str))| LawCoefficient {
            name: format!("c{}", n + 1),
            value: *value,
            std: errors(place.start + n).unwrap_or(0.0),
            unit,
        };
        Some(UnnamedLaw {
            formula: formula.formula,
            latex: formula.latex,
            joints: a.candidate.joints.clone(),
            coefficients: coefficients.iter().zip(formula.units).enumerate().map(coefficient).collect(),
            held_out_change: a
                .candidate
                .joints
                .iter()
                .map(|j| with[j.index()] / without[j.index()] - 1.0)
                .collect(),
            probability: 1.0 - a.p_value,
            nearest: step.and_then(|step| step.comparison.rivals.first()).map(|rival| rival.effect.clone()),
        })
    };
    let unnamed =
        model.accepted.iter().zip(model.places()).enumerate().filter(|(_, (a, _))| !a.effect().has_name());
    unnamed.filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_straight_between_knots_and_constant_beyond() {
        let curve = Curve { signal: "q1".into(), knots: vec![0.0, 1.0, 3.0], torque: vec![0.0, 2.0, -2.0] };
        for (at, torque) in
            [(-9.0, 0.0), (0.0, 0.0), (0.25, 0.5), (1.0, 2.0), (2.0, 0.0), (3.0, -2.0), (99.0, -2.0)]
        {
            approx::assert_relative_eq!(curve.torque(at), torque, epsilon = 1e-12);
        }
        let correction = Correction {
            joint: JointNumber::from_index(0),
            curves: vec![curve],
            limit: 1.5,
            rms_before: 1.0,
            rms_after: 0.9,
            fold_gains: vec![0.1],
        };
        assert_eq!(correction.torque([1.0].into_iter()), 1.5);
    }

    #[test]
    fn the_ridge_finds_a_bend_and_shrinks_what_has_no_data() {
        let signal: Vec<f64> = (0..2000).map(|k| f64::from(k) / 1000.0 - 1.0).collect();
        let residual: Vec<f64> = signal.iter().map(|x| x.abs() - 0.5).collect();
        let knots = knots(&signal);
        let all = ridge(std::slice::from_ref(&knots), std::slice::from_ref(&signal), &residual, &|_| false);
        let curve = Curve { signal: "q1".into(), knots: knots.clone(), torque: all[0].clone() };
        assert!((curve.torque(0.0) + 0.5).abs() < 0.1 && (curve.torque(0.9) - 0.4).abs() < 0.1, "{curve:?}");
        let none = ridge(&[knots], &[signal], &residual, &|_| true);
        assert!(none[0].iter().all(|t| *t == 0.0));
    }
}
