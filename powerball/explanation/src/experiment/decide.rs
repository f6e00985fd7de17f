//! The decision between two models by old and new logs.
//!
//! Both are fitted to all logs that may be fitted. Block by block the χ² of the one is taken from that of the
//! other; blocks count as independent, so the error of their sum is valid for any colour of the residual
//! (Vuong, Likelihood ratio tests for model selection and non-nested hypotheses, Econometrica 1989, with
//! blocks in the place of samples).
//!
//! The module also joins the log of an experiment with the earlier ones.

use crate::explain::{Hypothesis, Open};
use crate::options::{ExplainError, ExplainOptions};
use powerball_identification::estimate::Folds;
use powerball_identification::evidence::p_of_sum;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, RigidArm, Signals};
use powerball_logs::vector::dot;

/// The decision.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The name that is right; `None` where these logs cannot say.
    pub winner: Option<&'static str>,
    /// Why, in words.
    pub why: String,
    /// χ² by which the better one leads on the fitted logs, after a penalty for coefficients.
    pub evidence: f64,
    /// Probability of so large a lead by chance.
    pub p_value: f64,
    /// χ² by which it leads on the held-out logs.
    pub held_out: f64,
}

/// Decides between the first two open names.
///
/// # Errors
/// Logs that hold too little.
pub fn decide(
    body: &RigidArm,
    open: &Open,
    fit: &[Log],
    held_out: &[Log],
    options: &ExplainOptions<'_>,
) -> Result<Decision, ExplainError> {
    let rule = &options.rule;
    let data = Data::new(body, fit, &options.data).map_err(ExplainError::Fit)?;
    let other = Data::new(body, held_out, &options.data).map_err(ExplainError::Validate)?;
    let folds = Folds::new(&data);
    let fitted: Vec<Hypothesis> = open.hypotheses.iter().map(|h| h.fitted_to(&data, &folds)).collect();
    let [a, b, ..] = fitted.as_slice() else {
        let why = "one name only".to_string();
        return Ok(Decision { winner: None, why, evidence: 0.0, p_value: 1.0, held_out: 0.0 });
    };
    let (own_a, own_b) = (a.fitted_columns.len(), b.fitted_columns.len());
    let penalty = rule.per_coefficient * (own_b as f64 - own_a as f64);
    let blocks = leads(&data, a, b);
    let lead = blocks.iter().sum::<f64>() + penalty;
    let held = leads(&other, a, b).iter().sum::<f64>();
    let p_value = p_of_sum(&blocks, penalty);
    // From here on `first` is the one that leads.
    let (first, second, sign) = if lead >= 0.0 { (a, b, 1.0) } else { (b, a, -1.0) };
    let (evidence, held_out) = (sign * lead, sign * held);
    let share = difference(&data, a, b);
    let (winner, why) = if p_value < rule.family_wise && held_out > 0.0 {
        (
            Some(first.name),
            format!(
                "{} fits all logs better by χ² {evidence:.0} (p = {p_value:.1e} between blocks), and by \
                    {held_out:.0} on logs that were not fitted",
                first.name
            ),
        )
    } else if share < rule.little && own_a != own_b {
        let simpler = if own_a < own_b { a } else { b };
        let more = if own_a < own_b { b } else { a };
        (
            Some(simpler.name),
            format!(
                "{} fits equally well within {:.0} % and needs {} more: the answer is {}",
                more.name,
                (100.0 * share).ceil(),
                own_a.abs_diff(own_b),
                simpler.name
            ),
        )
    } else {
        (
            None,
            format!(
                "{} is ahead of {} by χ² {evidence:.1} on the fitted and {held_out:.1} on the held-out logs \
                    (p = {p_value:.2}): not enough",
                first.name, second.name
            ),
        )
    };
    Ok(Decision { winner, why, evidence, p_value, held_out })
}

/// χ² of `b` less that of `a`, by block.
fn leads(data: &Data<'_>, a: &Hypothesis, b: &Hypothesis) -> Vec<f64> {
    let (of_a, of_b) = (a.residual_on(data), b.residual_on(data));
    let joint = |j: usize, rows: &std::ops::Range<usize>| {
        let weight = 0.5 * (a.fit.weights[j] + b.fit.weights[j]);
        let square = |of: &Signals| dot(&of[j][rows.clone()], &of[j][rows.clone()]);
        weight * (square(&of_b) - square(&of_a))
    };
    (data.blocks.iter())
        .map(|block| block.rows.iter().enumerate().map(|(j, rows)| joint(j, rows)).sum())
        .collect()
}

/// How much two models differ over what their own names explain, rms over rms, weighted by joint.
fn difference(data: &Data<'_>, a: &Hypothesis, b: &Hypothesis) -> f64 {
    let square = |of: Signals| of.weighted_square(&a.fit.weights);
    let apart = square(a.residual_on(data).without(&b.residual_on(data)));
    let least = square(a.own_torque(data)).min(square(b.own_torque(data)));
    if least > 0.0 { (apart / least).sqrt() } else { f64::INFINITY }
}

// The log of an experiment together with the earlier ones.

/// The share of a new log, its end, that is held out.
pub const HELD_OUT: f64 = 0.35;
/// Between what is fitted and what is held out, s.
const GAP: f64 = 0.5;
/// Assumed pause between the end of the last log and the new one, s.
const PAUSE: f64 = 5.0;

/// Splits a new log into a part to fit and a held-out part, and places it after all others: on their common
/// clock if they have one, else with a separate clock.
#[must_use]
pub fn split_off(mut new: Log, others: &[&Log]) -> (Log, Log) {
    let end = others.iter().filter_map(|log| log.t.last().map(|t| t + log.clock)).fold(0.0, f64::max);
    let behind = end + PAUSE - new.t.first().copied().unwrap_or(0.0);
    match others {
        [first, rest @ ..] if rest.iter().all(|log| log.clock == first.clock) => {
            new.clock = first.clock;
            new.t.iter_mut().for_each(|t| *t += behind - first.clock);
        }
        _ => new.clock = behind,
    }
    let (first, last) = (new.t.first().copied().unwrap_or(0.0), new.t.last().copied().unwrap_or(0.0));
    let at = last - HELD_OUT * (last - first);
    let mut held = new.clone();
    held.file = format!("{} (its end)", new.file);
    let (before, after) =
        (new.t.partition_point(|t| *t < at - 0.5 * GAP), new.t.partition_point(|t| *t < at + 0.5 * GAP));
    new.pieces = clipped(&new.pieces, 0, before);
    held.pieces = clipped(&held.pieces, after, held.t.len());
    (new, held)
}

fn clipped(pieces: &[std::ops::Range<usize>], from: usize, to: usize) -> Vec<std::ops::Range<usize>> {
    pieces.iter().map(|p| p.start.max(from)..p.end.min(to)).filter(|p| p.len() >= 2).collect()
}

#[cfg(test)]
mod new_log_tests {
    use super::*;

    #[test]
    fn nothing_is_fitted_and_held_out_and_the_clock_runs_on() {
        let log = |file: &str, clock: f64| Log {
            file: file.into(),
            t: (0..1000).map(|k| 3.0 + 0.01 * f64::from(k)).collect(),
            q: vec![vec![0.0; 1000]],
            torque: vec![vec![0.0; 1000]],
            temperature: None,
            motor: None,
            pieces: vec![0..400, 420..1000],
            doubts: Vec::new(),
            clock,
        };
        let old = [log("a", 0.0), log("b", 20.0)];
        let (fit, held) = split_off(log("new", 0.0), &[&old[0], &old[1]]);
        assert!(fit.pieces.last().unwrap().end < held.pieces[0].start, "{:?} {:?}", fit.pieces, held.pieces);
        let seconds = |pieces: &[std::ops::Range<usize>]| pieces.iter().map(|p| p.len()).sum::<usize>();
        assert!((300..=350).contains(&seconds(&held.pieces)) && seconds(&fit.pieces) > 550);
        assert_ne!(fit.file, held.file);
        assert!(fit.t[0] + fit.clock > 20.0 + 12.99 && fit.clock == held.clock);
        // Where the others have a common clock, the new log has it too.
        let (fit, held) = split_off(log("new", 0.0), &[&old[1], &old[1]]);
        assert!(fit.clock == 20.0 && held.clock == 20.0 && fit.t[0] + fit.clock > 20.0 + 12.99);
    }
}
