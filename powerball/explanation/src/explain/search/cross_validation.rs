//! The evidence for a candidate that removes a large part of the error, on short logs.
//!
//! A small effect needs many blocks and folds to be distinguished from chance; one that lowers an error by a
//! tenth and more needs only a few seconds. It is judged both ways round: fitted to the logs and judged on
//! the validation set, fitted to the validation set and judged on the logs; each time the squared error must
//! fall by a share that chance does not give, and both must agree. Significance is that of blocks as
//! long as the residual's own memory.

use super::super::model::Model;
use super::super::study::Study;
use super::screen::Screen;
use crate::effects::Candidate;
use powerball_identification::estimate::{Design, Fit, Folds, fit, friction_columns};
use powerball_identification::evidence::{Rows, Trial, correlation, gain_on, log_change};
use powerball_logs::regression::{Data, Signals};
use powerball_logs::vector::dot;

/// The model fitted to the validation set.
#[derive(Debug)]
pub(crate) struct CrossValidation {
    fit: Fit,
    /// The model's columns on the logs that the model was fitted to.
    design: Design,
    /// Residual of the model there.
    residual: Signals,
}

/// The results of both ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossValidated {
    /// The share by which the squared error of the candidate's joints falls on the logs that took no part in
    /// the fit, the lesser of both ways.
    pub(crate) gain: f64,
    /// The probability of such coefficients by chance, both ways together.
    pub(crate) p_value: f64,
    /// The correlation of what either way adds.
    pub(crate) correlation: f64,
    /// Change of the logarithm of the squared error on the logs, mean over joints.
    pub(crate) log_change: f64,
}

impl CrossValidation {
    /// Fits the model to the validation set, all of it or without one accepted effect.
    pub(crate) fn new(study: &Study<'_>, model: &Model, without: Option<usize>) -> CrossValidation {
        let on_validation = study.on_validation(&model.fit, &[]);
        let terms = model.terms(&on_validation, without);
        let fit = fit(&study.validation, &Folds::new(&study.validation), &terms, Some(&model.fit));
        let on_fitted: Vec<_> =
            model.terms(&model.context(study), without).into_iter().map(|t| t.column).collect();
        let residual = fit.residual_on(&study.data, &on_fitted);
        let design = Design::new(&study.data, &friction_columns(&study.data, &fit.shapes), &on_fitted);
        CrossValidation { fit, design, residual }
    }

    /// Residual on the logs that the model was fitted to, by joint and row, N·m.
    pub(crate) fn residual(&self) -> &Signals {
        &self.residual
    }

    /// Asks about a candidate that was tried on the logs; `forward` is what the validation set gained by it.
    pub(crate) fn ask(
        &self,
        study: &Study<'_>,
        screen: &Screen<'_>,
        (candidate, trial, forward): (&Candidate, &Trial, f64),
    ) -> Option<CrossValidated> {
        let on_validation = study.on_validation(&self.fit, &self.fit.residual);
        let back = Screen::new(&on_validation);
        let other = back.base.ask(on_validation.columns(candidate), candidate.searched)?;
        let columns = screen.context.columns(candidate);
        let judged = Rows { data: &study.data, design: &self.design, residual: &self.residual };
        let gain = gain_on(&judged, (&other, &columns), back.base.weights, &candidate.joints);
        // What either way adds to the prediction of the logs.
        let theirs = Trial { theta: other.theta.clone(), ..trial.clone() };
        let added = [trial, &theirs].map(|trial| screen.base.added(trial));
        let [p, q] =
            [(screen, trial), (&back, &other)].map(|(screen, trial)| by_blocks(screen, trial, candidate));
        let product = (p * q).max(f64::MIN_POSITIVE);
        Some(CrossValidated {
            gain: forward.min(gain),
            // Fisher: −2 ln(p·q) is χ² with four degrees of freedom.
            p_value: (product * (1.0 - product.ln())).min(1.0),
            correlation: correlation(screen.base.weights, &added[0], &added[1]),
            log_change: log_change(&judged, (&other, &columns)),
        })
    }
}

/// The Wald test over blocks as long as the memory of the trial's residual.
fn by_blocks(screen: &Screen<'_>, trial: &Trial, candidate: &Candidate) -> f64 {
    let data = screen.context.data;
    let rule = screen.context.rule;
    let residual = screen.base.left(trial);
    let memory = candidate.joints.iter().map(|j| memory(data, j.index(), &residual[j.index()]));
    let length = (rule.block_memories * memory.fold(0.0, f64::max)).max(rule.shortest_block);
    let length = length.min(rule.longest_block);
    screen.base.p_value(trial, &data.blocks_of(length))
}

/// The autocorrelation time of a joint's residual, s: twice the sum of its autocorrelation up to where that
/// first vanishes.
fn memory(data: &Data<'_>, joint: usize, residual: &[f64]) -> f64 {
    let per_second = data.rate() / data.joints[joint].band.decimation as f64;
    let at = |lag: usize| -> f64 {
        let of = |rows: &std::ops::Range<usize>| {
            let r = &residual[rows.clone()];
            dot(&r[..r.len().saturating_sub(lag)], &r[lag.min(r.len())..])
        };
        data.joints[joint].rows.iter().map(of).sum()
    };
    let power = at(0);
    if power <= 0.0 {
        return 0.0;
    }
    let later = (1..residual.len().min((4.0 * per_second) as usize)).map(at);
    (1.0 + 2.0 * later.take_while(|c| *c > 0.0).sum::<f64>() / power) / per_second
}

impl CrossValidated {
    /// Whether it is enough; `tests` counts what was tried.
    pub(crate) fn is_enough(&self, rule: &crate::rule::Rule, tests: f64) -> bool {
        self.gain >= rule.large_gain()
            && self.p_value * tests <= rule.family_wise
            && self.correlation >= rule.most
    }
}
