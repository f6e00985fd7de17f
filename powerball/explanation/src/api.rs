//! The API: from an arm and logs to an explanation.

use super::experiment::propose;
use super::explain::{Explained, LogResult, explain_body};
use super::options::{ExplainError, ExplainOptions};
use super::rule::Rule;
use super::torque_model::{Colour, TorqueModel};
use super::watch::WatchOptions;
use dyngen::Arm;
use powerball_identification::conventions::{Conventions, conventions};
use powerball_identification::transmission::{JointTransmission, transmission};
use powerball_logs::log::{Log, common_clock};
use powerball_logs::motion::Motion;
use powerball_logs::regression::RigidArm;
use powerball_logs::signal::resample::median_step;
use std::ops::Range;
use std::path::Path;

/// Explains what the base model of an arm lacks on `logs`; every addition is judged on `validate`, the logs
/// of another path.
///
/// The clocks of all logs are joined, in the order `logs`, then `validate`; the arm's dynamics are derived
/// and proven; and what is known already is taken out of the logs and comes back into the model. Serialized,
/// the result is explained.json, and its model is model.json.
///
/// # Errors
/// [`ExplainError`] where logs hold too little, where the arm's dynamics cannot be derived, and where the
/// known model is another arm's.
pub fn explain(
    arm: &Arm,
    logs: &[Log],
    validate: &[Log],
    options: &ExplainOptions<'_>,
) -> Result<Explained, ExplainError> {
    let prepared = Prepared::new(arm, logs, validate, options)?;
    let explained = explain_body(&prepared.body, &prepared.logs, &prepared.validate, options)?;
    Ok(prepared.with_known(explained))
}

/// An arm that is derived, and logs from which what is known is taken out: for those who also propose
/// experiments.
#[derive(Debug)]
pub struct Prepared {
    /// The arm as it is known to be.
    pub body: RigidArm,
    /// Logs to fit, on the common clock.
    pub logs: Vec<Log>,
    /// The validation set, on the common clock.
    pub validate: Vec<Log>,
    /// What the columns of all of them are.
    pub conventions: Conventions,
    /// What is between the motors' torques and the links', by joint, where logs hold both.
    pub transmission: Option<Vec<JointTransmission>>,
    known: Option<TorqueModel>,
}

impl Prepared {
    /// Joins the clocks, derives the dynamics and takes out what is known.
    ///
    /// # Errors
    /// [`ExplainError`] as [`explain`].
    pub fn new(
        arm: &Arm,
        logs: &[Log],
        validate: &[Log],
        options: &ExplainOptions<'_>,
    ) -> Result<Prepared, ExplainError> {
        let mut all: Vec<Log> = logs.iter().chain(validate).cloned().collect();
        common_clock(&mut all);
        options.progress.say("deriving and proving the arm's dynamics");
        let changed = options.known.as_ref().map(|known| known.additions.arm_changes.of(arm)).transpose();
        let body = RigidArm::new(changed.map_err(ExplainError::Changes)?.as_ref().unwrap_or(arm))
            .map_err(ExplainError::Arm)?;
        let checked = |known: TorqueModel| {
            known.in_set_of(&body).checked(body.names(), body.dof(), Path::new("the known model"))
        };
        let known = options.known.clone().map(checked).transpose().map_err(ExplainError::Known)?;
        let validate = all.split_off(logs.len());
        options.progress.say("asking what the columns are");
        let conventions = conventions(&body, &all, &validate);
        let transmission = transmission(body.arm(), &all, &validate);
        let (logs, held_out) = (Vec::new(), Vec::new());
        let mut prepared = Prepared { body, logs, validate: held_out, conventions, transmission, known };
        (prepared.logs, prepared.validate) = (prepared.without_known(all), prepared.without_known(validate));
        Ok(prepared)
    }

    /// The explanation of the logs, and the trajectory that tells apart what they leave open, where there is
    /// one.
    ///
    /// # Errors
    /// [`ExplainError`] as [`explain`].
    pub fn explained(
        &self,
        options: &ExplainOptions<'_>,
    ) -> Result<(Explained, Option<Motion>), ExplainError> {
        let mut explained = explain_body(&self.body, &self.logs, &self.validate, options)?;
        let motion = propose(&self.body, &mut explained, options);
        Ok((explained, motion))
    }

    /// Other logs of the same arm, without what is known.
    #[must_use]
    pub fn without_known(&self, mut logs: Vec<Log>) -> Vec<Log> {
        if let Some(known) = &self.known {
            known.take_out(&self.body, &mut logs);
        }
        logs
    }

    /// What the explained model leaves on logs where nothing else was found; `None` where that cannot be
    /// learnt.
    fn colour(&self, explained: &Explained) -> Option<Colour> {
        let model = &explained.model;
        let changes = &model.additions.arm_changes;
        let changed = (!changes.is_empty()).then(|| RigidArm::new(&changes.of(self.body.arm()).ok()?).ok());
        let changed = changed.map_or(Some(None), |body| body.map(Some))?;
        let body = changed.as_ref().unwrap_or(&self.body);
        let options = WatchOptions::default();
        let logs = self.logs.iter().chain(&self.validate);
        let usual = |log: &Log| match explained.logs.iter().find(|result| result.log == log.file) {
            Some(result) => usual_part(log, result, &options.rule),
            None => Some(log.clone()),
        };
        let usual: Vec<Log> = logs.filter_map(usual).collect();
        let rate = 1.0 / median_step(&usual.first()?.t)?;
        Colour::learn(model, body, &usual, options.level(rate), options.friction_range)
    }

    /// An explanation with what the columns and the transmissions are, whose model holds what was known too.
    #[must_use]
    pub fn with_known(&self, explained: Explained) -> Explained {
        let mut explained = explained.with_columns(self.conventions.clone());
        explained.transmission.clone_from(&self.transmission);
        explained.model.colour = self.colour(&explained);
        if let Some(known) = &self.known {
            explained.model.additions = known.additions.and(&explained.model.additions);
        }
        explained
    }
}

/// A log without the times of what differs there from the other logs, and the longest block before and after:
/// these times are known roughly. `None` where its error is larger than that of the others with these
/// differences in the model, or nothing stays.
fn usual_part(log: &Log, result: &LogResult, rule: &Rule) -> Option<Log> {
    if result.error_ratio.is_some_and(|ratio| ratio > rule.unlike) {
        return None;
    }
    let apart = rule.longest_block;
    let differs =
        |t: f64| result.differs.iter().any(|d| (d.start_time - apart..=d.end_time + apart).contains(&t));
    let parts = |piece: &Range<usize>| -> Vec<Range<usize>> {
        let kept: Vec<usize> = piece.clone().filter(|k| !differs(log.t[*k])).collect();
        kept.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[0] + run.len()).collect()
    };
    let mut log = log.clone();
    log.pieces = log.pieces.iter().flat_map(parts).filter(|piece| piece.len() >= 2).collect();
    (!log.pieces.is_empty()).then_some(log)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::Difference;

    #[test]
    fn the_usual_part_of_a_log_is_without_what_was_found_there() {
        let t: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let log = Log {
            file: "log.csv".into(),
            q: vec![t.clone()],
            torque: vec![t.clone()],
            temperature: None,
            motor: None,
            pieces: vec![0..400, 400..1000],
            doubts: Vec::new(),
            clock: 0.0,
            t,
        };
        let push = |start_time, end_time| Difference {
            effect: "contact_wrench".into(),
            joints: Vec::new(),
            start_time,
            end_time,
            share: 1.0,
            value: None,
        };
        let rule = Rule { longest_block: 0.5, unlike: 2.0, ..Rule::default() };
        let pieces = |ratio, differs| {
            let error_ratio = Some(ratio);
            let result = LogResult { log: "log.csv".into(), like_the_others: false, error_ratio, differs };
            usual_part(&log, &result, &rule).map(|log| log.pieces)
        };
        assert_eq!(pieces(1.0, vec![]), Some(vec![0..400, 400..1000]));
        let pushes = vec![push(3.004, 4.0), push(6.0, 6.196)];
        assert_eq!(pieces(1.0, pushes.clone()), Some(vec![0..251, 451..550, 670..1000]));
        assert_eq!(pieces(1.0, vec![push(0.0, 9.99)]), None);
        assert_eq!([pieces(3.0, vec![]), pieces(3.0, pushes)], [None, None]);
    }
}
