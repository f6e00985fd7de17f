//! The comparison of each log with the others, and its differences.
//!
//! All logs are fitted together here, so that they are judged alike: otherwise a log with a path of its own
//! would differ only because the model does not know that path.

use super::super::by_log::{Changed, Together, changes};
use super::super::findings::Findings;
use super::super::model::{Accepted, Model};
use super::super::study::Study;
use crate::effects::{Settings, Window, contact_wrench};
use crate::rule::Rule;
use crate::torque_model::RestPush;
use powerball_controller::JointNumber;
use powerball_identification::evidence::error_in_log;
use powerball_logs::regression::{Data, Signals};
use serde::Serialize;

/// The report on one log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogResult {
    /// The log's file.
    pub log: String,
    /// Whether it has no difference from the other logs, and the model predicts it as well as them.
    pub like_the_others: bool,
    /// Squared error of a model of all logs on this log, mean over joints, divided by the largest one on
    /// another log; the differences are in the model.
    pub error_ratio: Option<f64>,
    /// The differences of this log from the others.
    pub differs: Vec<Difference>,
}

/// Something that is in a log and not in all others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The effect's name.
    pub effect: String,
    /// The joints that it acts on.
    pub joints: Vec<JointNumber>,
    /// Start time, in the log's own t, s.
    pub start_time: f64,
    /// Until when, s.
    pub end_time: f64,
    /// The share of the log's squared error, beyond that of the other logs, that it explains; for a push on
    /// an arm that stands still, whose rows are in no error, the share of its torques that one force
    /// explains.
    pub share: f64,
    /// Size of the difference from the other logs: friction (`temperature`) and gains (`torque_constant`)
    /// relative, a zero of torques (`asymmetry`) in N·m or N, one of positions (`encoder_offset`) in rad or
    /// m, a delay in s. `None` for a body or a push, whose figures are in the effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
}

/// An effect that is in some logs only: where, and with which torque on the fitted logs and on the validation
/// set.
struct Local {
    effect: String,
    joints: Vec<JointNumber>,
    windows: Vec<Window>,
    torque: [Signals; 2],
}

/// The judgement by a log's rows: mean over joints of squared errors over the joint's variance.
struct Judged<'a> {
    data: &'a Data<'a>,
    side: usize,
    log: usize,
    /// Residual of the model, by joint and row.
    residual: &'a Signals,
}

/// One entry a log, those that were fitted first.
pub(super) fn logs(findings: &Findings<'_>, at_rest: &[RestPush]) -> Vec<LogResult> {
    let (study, model) = (&findings.study, &findings.model);
    let mut local: Vec<Local> =
        model.accepted.iter().enumerate().filter_map(|(k, a)| of_accepted(study, model, k, a)).collect();
    for effect in &findings.initial_fit.validation_only {
        local.extend(effect.parts.iter().map(|part| Local {
            effect: effect.named.effect.clone(),
            joints: effect.named.joints.clone(),
            windows: part.windows.clone(),
            torque: part.torque.clone(),
        }));
    }
    let together = Together::new(study, model);
    let (changes, residual) = changes(study, model, together);
    let sides = [&study.data, &study.validation].into_iter().enumerate();
    let judged: Vec<Judged<'_>> = sides
        .flat_map(|(side, data)| (0..data.logs.len()).map(move |log| (side, data, log)))
        .map(|(side, data, log)| Judged { data, side, log, residual: &residual[side] })
        .collect();
    let errors: Vec<Option<f64>> =
        judged.iter().map(|judged| judged.error(&model.fit.sigma, judged.residual)).collect();
    let of = |(place, judged): (usize, &Judged<'_>)| {
        let others = errors.iter().enumerate().filter(|(k, _)| *k != place).filter_map(|(_, error)| *error);
        judged.result(&model.fit.sigma, &local, others.reduce(f64::max), study.rule())
    };
    let mut results: Vec<LogResult> = judged.iter().enumerate().map(of).collect();
    for Changed { log, effect, joints, value, share } in changes {
        let Some(place) = results.iter().position(|result| result.log == log) else { continue };
        results[place].like_the_others = false;
        let [start_time, end_time] = judged[place].span();
        results[place].differs.push(Difference {
            effect: effect.to_string(),
            joints,
            start_time,
            end_time,
            share: share.clamp(0.0, 1.0),
            value: Some(value),
        });
    }
    for push in at_rest {
        for result in results.iter_mut().filter(|result| result.log == push.log) {
            result.like_the_others = false;
            result.differs.push(Difference {
                effect: Settings::from(contact_wrench::Settings::Constant).effect().name().to_string(),
                joints: push.joints.clone(),
                start_time: push.from,
                end_time: push.to,
                share: push.share,
                value: None,
            });
            result.differs.sort_by(|a, b| a.start_time.total_cmp(&b.start_time));
        }
    }
    results
}

/// An accepted effect, where it is in some logs only.
fn of_accepted(study: &Study<'_>, model: &Model, place: usize, accepted: &Accepted) -> Option<Local> {
    let candidate = &accepted.candidate;
    if candidate.windows.is_empty() {
        return None;
    }
    let coefficients = model.coefficients().swap_remove(place);
    let (on_fitted, on_validation) = (model.context(study), study.on_validation(&model.fit, &[]));
    let torque = [(&study.data, &on_fitted), (&study.validation, &on_validation)].map(|(data, context)| {
        let mut torque = Signals::zeros(data);
        let columns = context.columns(candidate);
        torque.add(&columns, &coefficients);
        torque
    });
    let mut windows = accepted.effect().windows(&on_fitted, candidate);
    for window in accepted.effect().windows(&on_validation, candidate) {
        if !windows.contains(&window) {
            windows.push(window);
        }
    }
    let (effect, joints) = (accepted.effect().name().to_string(), candidate.joints.clone());
    Some(Local { effect, joints, windows, torque })
}

impl Judged<'_> {
    /// The error of some residuals on this log.
    fn error(&self, sigma: &[f64], residual: &Signals) -> Option<f64> {
        error_in_log(self.data, residual, sigma, (self.log, 1))
    }

    /// When the log begins and ends, in its own t, s.
    fn span(&self) -> [f64; 2] {
        let own = || self.data.recordings.iter().filter(|r| r.log == self.log);
        let end = own().map(|r| r.start + r.len() as f64 / r.rate).fold(f64::NEG_INFINITY, f64::max);
        [own().map(|r| r.start).fold(f64::INFINITY, f64::min), end]
    }

    fn result(&self, sigma: &[f64], local: &[Local], usual: Option<f64>, rule: &Rule) -> LogResult {
        let log = self.data.logs[self.log].clone();
        let locals: Vec<&Local> =
            local.iter().filter(|local| local.windows.iter().any(|w| w.log == log)).collect();
        let with = |which: &[&Local]| {
            let mut residual = self.residual.clone();
            which.iter().for_each(|local| residual.add_signal(&local.torque[self.side], 1.0));
            self.error(sigma, &residual).unwrap_or(0.0)
        };
        let (after, before) = (with(&[]), with(&locals));
        let excess = (before - usual.unwrap_or(0.0)).max(before - after);
        let [_, end] = self.span();
        let mut differs = Vec::new();
        for local in locals {
            let share = if excess > 0.0 { (with(&[local]) - after) / excess } else { 0.0 };
            differs.extend(local.windows.iter().filter(|w| w.log == log).map(|w| Difference {
                effect: local.effect.clone(),
                joints: local.joints.clone(),
                start_time: w.from,
                end_time: w.to.min(end),
                share: share.clamp(0.0, 1.0),
                value: None,
            }));
        }
        differs.sort_by(|a, b| a.start_time.total_cmp(&b.start_time));
        let error_ratio = usual.filter(|usual| *usual > 0.0).map(|usual| after / usual);
        let like_the_others = differs.is_empty() && error_ratio.is_none_or(|ratio| ratio <= rule.unlike);
        LogResult { log, like_the_others, error_ratio, differs }
    }
}

impl LogResult {
    /// One sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let ratio = |text: &str| match self.error_ratio {
            Some(ratio) => format!("{text} {ratio:.1} times the squared error of any other log"),
            None => String::new(),
        };
        if self.like_the_others {
            return format!("{}: like the others", self.log);
        }
        if self.differs.is_empty() {
            return format!("{}: differs, and no cause that was tested explains it:{}", self.log, ratio(""));
        }
        let of = |d: &Difference| {
            let joints: Vec<String> = d.joints.iter().map(ToString::to_string).collect();
            let value = d.value.map_or_else(String::new, |value| format!(" of {value:+.4}"));
            let share = 100.0 * d.share;
            format!(
                "{}{value} on joint {} from {:.1} to {:.1} s ({share:.0} % of its additional error)",
                d.effect,
                joints.join(", "),
                d.start_time,
                d.end_time
            )
        };
        let list: Vec<String> = self.differs.iter().map(of).collect();
        format!("{}: differs: {}", self.log, list.join(", "))
    }
}
