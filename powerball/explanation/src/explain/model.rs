//! The base model with the accepted effects, which every step changes.

use super::study::Study;
use crate::effects::{self, Candidate, Context, Effect, Made};
use crate::rule::Rule;
use powerball_identification::estimate::{Fit, Folds, NormalEquations, Solver, Term, fit};
use powerball_logs::regression::{Column, Data, Signals};
use powerball_logs::vector::dot;
use std::ops::Range;
use std::sync::OnceLock;

/// An accepted effect on its joints.
#[derive(Clone, Debug)]
pub(super) struct Accepted {
    /// The effect with its settings.
    pub(super) candidate: Candidate,
    pub(super) origin: Origin,
    pub(super) p_value: f64,
    pub(super) fold_gain: f64,
    /// Squared error that fell when it was accepted, by joint, (N·m)² summed over rows.
    pub(super) explained: Vec<f64>,
}

/// How an effect came into the model, and with how many columns of the fit.
#[derive(Clone, Debug)]
pub(super) enum Origin {
    /// The effect is in the model from the start (see [`Effect::baseline`]).
    Baseline { columns: usize },
    /// A step accepted it.
    Step { number: usize, columns: usize },
    /// A step accepted it above the band of the fit: its coefficients were measured there, and it has no
    /// columns.
    AboveBand { number: usize, coefficients: Vec<f64> },
}

/// The model in the making.
#[derive(Debug)]
pub(super) struct Model {
    /// The accepted effects, in the order of their columns.
    pub(super) accepted: Vec<Accepted>,
    /// Accepted once and taken out again, or no better than chance: not tried again.
    pub(super) given_up: Vec<Candidate>,
    /// The base model with all of it, fitted.
    pub(super) fit: Fit,
    /// Which accepted effect raises the error on the validation logs, once that is evaluated on this fit.
    pub(super) harmful: OnceLock<Option<usize>>,
}

impl Accepted {
    /// The effect.
    pub(super) fn effect(&self) -> &'static dyn Effect {
        self.candidate.effect()
    }

    /// The step that accepted it; `None` where it is in the model from the start.
    pub(super) fn step(&self) -> Option<usize> {
        match self.origin {
            Origin::Baseline { .. } => None,
            Origin::Step { number, .. } | Origin::AboveBand { number, .. } => Some(number),
        }
    }

    /// Whether it is in the model from the start.
    pub(super) fn is_baseline(&self) -> bool {
        self.step().is_none()
    }

    /// How many columns of the fit it has.
    pub(super) fn columns(&self) -> usize {
        match self.origin {
            Origin::Baseline { columns } | Origin::Step { columns, .. } => columns,
            Origin::AboveBand { .. } => 0,
        }
    }

    /// The coefficients, where they were measured above the band of the fit.
    pub(super) fn above_band(&self) -> Option<&[f64]> {
        match &self.origin {
            Origin::AboveBand { coefficients, .. } => Some(coefficients),
            Origin::Baseline { .. } | Origin::Step { .. } => None,
        }
    }

    /// Puts another candidate of the same origin in its place, which has `count` columns of the fit.
    pub(super) fn replace(&mut self, candidate: Candidate, count: usize) {
        self.candidate = candidate;
        match &mut self.origin {
            Origin::Baseline { columns } | Origin::Step { columns, .. } => *columns = count,
            Origin::AboveBand { .. } => {}
        }
    }
}

/// How much of an accepted effect is its own.
pub(super) struct Own {
    /// The share of its squared torque that no other column can take over: 1 less R² of its torque over all
    /// other columns, weighted as in the fit.
    pub(super) share: f64,
    /// The standard error of its size, a share of it; `None` where it was measured otherwise.
    pub(super) relative_std: Option<f64>,
}

impl Model {
    /// The base model alone.
    pub(super) fn new(base: Fit) -> Model {
        Model { accepted: Vec::new(), given_up: Vec::new(), fit: base, harmful: OnceLock::new() }
    }

    /// The base model with what every arm may have (see [`Effect::baseline`]). Its friction is fitted again.
    pub(super) fn baseline(&self, study: &Study<'_>) -> Model {
        let context = self.context(study);
        let mut terms: Vec<Term> = Vec::new();
        let accepted = |candidate: Candidate| {
            let effect = candidate.effect();
            let (columns, non_negative) = (context.columns(&candidate), effect.non_negative());
            let count = columns.len();
            terms.extend(columns.into_iter().map(|column| Term { column, non_negative }));
            Accepted {
                candidate,
                origin: Origin::Baseline { columns: count },
                p_value: 1.0,
                fold_gain: 0.0,
                explained: Vec::new(),
            }
        };
        let candidates = effects::all().iter().flat_map(|effect| effect.baseline(&context));
        let accepted: Vec<Accepted> = candidates.map(accepted).collect();
        let fit = fit(&study.data, &study.folds, &terms, None);
        Model { accepted, ..Model::new(fit) }
    }

    /// The model without one of what was accepted, fitted.
    pub(super) fn without(&self, study: &Study<'_>, k: usize) -> Model {
        let mut accepted = self.accepted.clone();
        accepted.remove(k);
        let fit = fitted_again(study, &mut accepted, &self.fit);
        Model { accepted, ..Model::new(fit) }
    }

    /// Takes in what was measured above the band of the fit.
    pub(super) fn add_above_band(&mut self, study: &Study<'_>, accepted: Accepted) {
        let columns = study.on_fitted(&self.fit, &[]).columns(&accepted.candidate);
        take_above_band_out(&accepted, &columns, &mut self.fit.residual);
        self.accepted.push(accepted);
        self.harmful = OnceLock::new();
    }

    /// The terms of what was accepted on some data, of all or of all but one.
    pub(super) fn terms(&self, context: &Context<'_>, without: Option<usize>) -> Vec<Term> {
        let term = |(_, a): (usize, &Accepted)| {
            let non_negative = a.effect().non_negative();
            let columns = context.columns(&a.candidate).into_iter();
            columns.map(move |column| Term { column, non_negative }).collect::<Vec<_>>()
        };
        let fitted = |(k, a): &(usize, &Accepted)| Some(*k) != without && a.above_band().is_none();
        self.accepted.iter().enumerate().filter(fitted).flat_map(term).collect()
    }

    /// The model seen on the logs that it was fitted to.
    pub(super) fn context<'c>(&'c self, study: &'c Study<'_>) -> Context<'c> {
        study.on_fitted(&self.fit, &self.fit.residual)
    }

    /// Whether a candidate or one that excludes it was accepted.
    pub(super) fn has(&self, candidate: &Candidate) -> bool {
        self.accepted.iter().any(|a| a.candidate.excludes(candidate))
    }

    /// Whether a candidate was given up.
    pub(super) fn gave_up(&self, candidate: &Candidate) -> bool {
        self.given_up.iter().any(|c| c.joints == candidate.joints && c.excludes(candidate))
    }

    /// The places of each accepted effect's columns among all of the fit.
    pub(super) fn places(&self) -> Vec<Range<usize>> {
        let mut first = 0;
        let place = |a: &Accepted| {
            first += a.columns();
            self.fit.design.extra(first - a.columns())..self.fit.design.extra(first)
        };
        self.accepted.iter().map(place).collect()
    }

    /// The coefficients of each accepted effect.
    pub(super) fn coefficients(&self) -> Vec<Vec<f64>> {
        let of =
            |(a, place): (&Accepted, Range<usize>)| a.above_band().unwrap_or(&self.fit.theta[place]).to_vec();
        self.accepted.iter().zip(self.places()).map(of).collect()
    }

    /// Standard errors of the fit's columns by their place; `None` for a column that is not free.
    pub(super) fn errors(&self) -> impl Fn(usize) -> Option<f64> {
        let variances = self.fit.solver().inverse_diagonal();
        move |column| variances.get(column).filter(|v| v.is_finite()).map(|v| v.max(0.0).sqrt())
    }

    /// The model with another candidate in the place of an accepted one, fitted.
    fn with(&self, study: &Study<'_>, k: usize, candidate: Candidate) -> Model {
        let mut accepted = self.accepted.clone();
        let columns = self.context(study).columns(&candidate).len();
        accepted[k].replace(candidate, columns);
        let fit = fitted_again(study, &mut accepted, &self.fit);
        Model { accepted, ..Model::new(fit) }
    }

    /// The size of an accepted effect that has one of its own, and the standard error that noise gives it.
    fn size(&self, k: usize) -> Option<(f64, f64)> {
        let (a, c) = (&self.accepted[k], &self.coefficients()[k]);
        let gradient = a.effect().size(&a.candidate, c)?;
        let mut along = vec![0.0; self.fit.design.size];
        along[self.places()[k].clone()].copy_from_slice(&gradient);
        let variance = dot(&along, &self.fit.solver().solve(&along));
        Some((dot(&gradient, c), variance.max(0.0).sqrt()))
    }

    /// The standard error of an accepted effect's size, a share of it; `of_factor` is that of the factor of
    /// its torque. Where its law assumes something, the truth is anywhere between this and what logs say
    /// without the assumption: with equal chances the mean square of its distance is a third of the square of
    /// theirs.
    pub(super) fn size_error(&self, study: &Study<'_>, k: usize, of_factor: Option<f64>) -> Option<f64> {
        let Some((size, std)) = self.size(k) else { return of_factor };
        let a = &self.accepted[k];
        let other = a.effect().otherwise(&a.candidate).and_then(|other| self.with(study, k, other).size(k));
        let apart = other.map_or(0.0, |(other, _)| other - size);
        Some((std.powi(2) + apart.powi(2) / 3.0).sqrt() / size.abs())
    }

    /// How much of each accepted effect is its own.
    pub(super) fn own(&self) -> Vec<Own> {
        let NormalEquations { gram, .. } = self.fit.normal_equations();
        let share = |((a, place), coefficients): ((&Accepted, Range<usize>), Vec<f64>)| {
            if a.above_band().is_some() {
                return Own { share: 1.0, relative_std: None };
            }
            let torque = |c: usize| place.clone().zip(&coefficients).map(|(e, own)| gram[(c, e)] * own).sum();
            let products: Vec<f64> = (0..gram.ncols()).map(torque).collect();
            let square: f64 = place.clone().zip(&coefficients).map(|(e, own)| products[e] * own).sum();
            let others = Solver::new(&gram, |c| self.fit.free[c] && !place.contains(&c));
            let taken: f64 = others.whitened(&products).iter().map(|v| v * v).sum();
            let own = (square - taken).max(0.0);
            Own {
                share: if square > 0.0 { own / square } else { 0.0 },
                relative_std: (own > 0.0).then(|| 1.0 / own.sqrt()),
            }
        };
        self.accepted.iter().zip(self.places()).zip(self.coefficients()).map(share).collect()
    }

    /// Measured less predicted torque of the validation set, by joint and row, N·m.
    pub(super) fn residual_on_validation(&self, study: &Study<'_>) -> Signals {
        let mut residual = self.fit.residual_on(&study.validation, &self.columns_on_validation(study));
        let context = study.on_validation(&self.fit, &[]);
        for a in self.accepted.iter().filter(|a| a.above_band().is_some()) {
            take_above_band_out(a, &context.columns(&a.candidate), &mut residual);
        }
        residual
    }

    /// The columns of what was accepted, as the fit has them, on the validation set.
    pub(super) fn columns_on_validation(&self, study: &Study<'_>) -> Vec<Column> {
        let context = study.on_validation(&self.fit, &[]);
        let columns = |a: &Accepted| context.columns(&a.candidate);
        self.accepted.iter().filter(|a| a.above_band().is_none()).flat_map(columns).collect()
    }

    /// Fits everything again, and tests whether the validation logs have the effects that are in some logs
    /// only.
    pub(super) fn refit(&mut self, study: &Study<'_>) {
        self.fit = fitted_again(study, &mut self.accepted, &self.fit);
        self.harmful = OnceLock::new();
        for k in 0..self.accepted.len() {
            if let Some(seen) = self.seen_in_validation(study, k) {
                self.accepted[k].candidate = seen;
            }
        }
    }

    /// The evidence of the validation logs for an effect that is in some logs and not in others.
    fn seen_in_validation(&self, study: &Study<'_>, k: usize) -> Option<Candidate> {
        let a = &self.accepted[k];
        if a.candidate.windows.is_empty() {
            return None;
        }
        let coefficients = &self.coefficients()[k];
        let mut without = self.residual_on_validation(study);
        let context = study.on_validation(&self.fit, &[]);
        let own = context.columns(&a.candidate);
        without.add(&own, coefficients);
        let context = study.on_validation(&self.fit, &without);
        a.effect().seen_in(&context, &a.candidate, coefficients)
    }
}

/// The fit with what was accepted; candidates move to where it fits best.
fn fitted_again(study: &Study<'_>, accepted: &mut [Accepted], start: &Fit) -> Fit {
    let mut own: Vec<&mut Accepted> = accepted.iter_mut().filter(|a| a.above_band().is_none()).collect();
    let mut candidates: Vec<Candidate> = own.iter().map(|a| a.candidate.clone()).collect();
    let mut fit =
        refitted(&study.data, &study.folds, &mut candidates, start, study.rule(), Some(&study.made));
    for (a, candidate) in own.iter_mut().zip(candidates) {
        a.candidate = candidate;
    }
    let context = study.on_fitted(start, &[]);
    for a in accepted.iter().filter(|a| a.above_band().is_some()) {
        take_above_band_out(a, &context.columns(&a.candidate), &mut fit.residual);
    }
    fit
}

/// Takes the torque of what was measured above the band out of a residual.
fn take_above_band_out(a: &Accepted, columns: &[Column], residual: &mut Signals) {
    residual.subtract(columns, a.above_band().unwrap_or_default());
}

/// Fits the base model with some candidates; columns that depend on estimates are computed again, twice.
/// `made` has columns of the data that were made already.
pub(super) fn refitted(
    data: &Data<'_>,
    folds: &Folds,
    candidates: &mut [Candidate],
    start: &Fit,
    rule: &Rule,
    made: Option<&Made>,
) -> Fit {
    let once = |candidates: &mut [Candidate], start: &Fit| {
        let context = Context::new(data, start, &start.residual, rule);
        let context = if let Some(made) = made { context.with(made) } else { context };
        let mut terms: Vec<Term> = Vec::new();
        let mut counts = Vec::new();
        for candidate in candidates.iter() {
            let effect = candidate.effect();
            let (before, non_negative) = (terms.len(), effect.non_negative());
            let columns = context.columns(candidate).into_iter();
            terms.extend(columns.map(|column| Term { column, non_negative }));
            counts.push(terms.len() - before);
        }
        let fitted = fit(data, folds, &terms, Some(start));
        let mut first = 0;
        for (candidate, count) in candidates.iter_mut().zip(counts) {
            let coefficients: Vec<f64> = (first..first + count).map(|c| fitted.coefficient(c)).collect();
            first += count;
            if let Some(refined) = candidate.effect().refined(candidate, &coefficients) {
                *candidate = refined;
            }
        }
        fitted
    };
    let first = once(candidates, start);
    once(candidates, &first)
}
