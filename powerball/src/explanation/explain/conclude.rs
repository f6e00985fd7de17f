//! From the accepted effects to the result.

use super::compose::Composed;
use super::correction::correct;
use super::curves::curves;
use super::forward::{ExplainError, RuledOut, Session, Step};
use super::leftover::{depends_on, effective_samples, leftover};
use super::naming::Comparison;
use super::result::{Change, Errors, Explained, NamedEffect, Rival, Unattributed};
use crate::explanation::effects::{Context, Found};
use crate::identification::estimate::{noise_floor, over_blocks, spread};
use crate::logs::parallel;
use crate::logs::regression::Data;
use std::ops::Range;
use std::sync::Arc;

impl Session<'_> {
    pub(super) fn coefficients(&self) -> Vec<Vec<f64>> {
        let mut first = 0;
        self.accepted
            .iter()
            .map(|a| {
                let c = (first..first + a.columns).map(|c| self.fit.coefficient(c)).collect();
                first += a.columns;
                c
            })
            .collect()
    }

    pub(super) fn result(mut self) -> Result<Explained, ExplainError> {
        let (before, base_residual) = (self.before.clone(), std::mem::take(&mut self.base_residual));
        let base_residual = base_residual.as_slice();
        let Composed { model, fitted, held_out: residual } =
            if self.data.joints_apart { self.composed_apart()? } else { self.composed()? };
        let after = Errors { fit: spread(&self.data, &fitted), validate: spread(&self.other, &residual) };
        let curves = curves(&self.other, base_residual, &residual);
        let floor = noise_floor(&self.data);
        let context = Context::new(&self.data, &self.fit, &self.fit.residual);
        let coefficients = self.coefficients();
        let mut named: Vec<NamedEffect> = self.held.take().into_iter().collect();
        let mut order: Vec<usize> = Vec::new();
        for a in &self.accepted {
            if !order.contains(&a.effect) {
                order.push(a.effect);
            }
        }
        for e in order {
            let mine: Vec<usize> =
                (0..self.accepted.len()).filter(|k| self.accepted[*k].effect == e).collect();
            let found: Vec<Found<'_>> = mine
                .iter()
                .map(|k| Found { candidate: &self.accepted[*k].candidate, coefficients: &coefficients[*k] })
                .collect();
            let mut joints: Vec<usize> = found.iter().flat_map(|f| f.candidate.joints.clone()).collect();
            joints.sort_unstable();
            joints.dedup();
            let steps: Vec<&Step> = self.steps.iter().filter(|s| s.effect == e).collect();
            let (Some(first), Some(last)) = (steps.first(), steps.last()) else { continue };
            let mut logs: Vec<String> = Vec::new();
            for window in found.iter().flat_map(|f| &f.candidate.windows) {
                if !logs.contains(&window.log) {
                    logs.push(window.log.clone());
                }
            }
            let effect = self.effects[e].as_ref();
            named.push(NamedEffect {
                effect: effect.name().to_string(),
                parameters: effect.parameters(&context, &found),
                rms_before: joints.iter().map(|j| first.before[*j]).collect(),
                rms_after: joints.iter().map(|j| last.after[*j]).collect(),
                p_value: mine.iter().map(|k| self.accepted[*k].p_value).fold(0.0, f64::max),
                held_out_gain: mine.iter().map(|k| self.accepted[*k].fold_gain).collect(),
                logs,
                margin: first.comparison.margin,
                leftover: leftover(&before.fit.rms, &after.fit.rms, &floor, &joints),
                class: effect.class().name().to_string(),
                rivals: self.rivals(&first.comparison, effect.name()),
                joints: joints.iter().map(|j| j + 1).collect(),
            });
        }
        let shown = self.shown(&context);
        let (unattributed, unexplained) = self.unattributed(&context, &residual, &floor, &after);
        let open = self.open(unattributed.is_some());
        let next_experiment = open.as_ref().map(|open| {
            let names = open.names();
            serde_json::json!({
                "to_tell_apart": names,
                "advice": format!(
                    "record the joints concerned on a path with other positions, speeds and loads than these \
                        logs, \
                     where {} predict different torques", names.join(" and ")
                ),
            })
        });
        let effective_samples = effective_samples(&self.data, &self.fit.residual);
        self.false_positives.rate = self.false_positives.share();
        Ok(Explained {
            arm: self.data.body.arm().name.clone(),
            held_out_change: changes(&self.other, base_residual, &residual),
            before,
            after,
            noise_floor: floor,
            effects: named,
            band: [0.0, self.data.band.cutoff],
            effective_samples,
            unattributed,
            next_experiment,
            experiment: None,
            // An experiment moves a body.
            open: open.filter(|_| !self.data.joints_apart).map(Arc::new),
            false_positives: self.false_positives.clone(),
            warnings: self.doubts().into_iter().chain(unexplained).collect(),
            curves,
            shown,
            model,
        })
    }

    /// The next best names, and what an experiment has ruled out on the same joints.
    fn rivals(&self, comparison: &Comparison, name: &str) -> Vec<Rival> {
        let here = |r: &&RuledOut| r.effect != name && r.joints.iter().any(|j| comparison.joints.contains(j));
        let out = |r: &RuledOut| Rival { effect: r.effect.clone(), why_not: r.why_not.clone() };
        comparison.rivals.iter().cloned().chain(self.told.ruled_out.iter().filter(here).map(out)).collect()
    }

    /// The joints whose residual still depends on something, and what is to be said of those where more than
    /// noise is left that depends on nothing.
    fn unattributed(
        &self,
        context: &Context<'_>,
        other_residual: &[Vec<f64>],
        floor: &[f64],
        after: &Errors,
    ) -> (Option<Unattributed>, Option<String>) {
        let candidates: Vec<usize> = context
            .moving_joints()
            .filter(|j| after.fit.rms[*j] > 1.2 * floor[*j] && self.fit.inflation[*j] > 2.0)
            .collect();
        let found = parallel::map(&candidates, |j| depends_on(context, *j));
        let other = Context::new(&self.other, &self.fit, other_residual);
        let correction = self.told.correct_unattributed.then(|| {
            (candidates.iter().zip(&found))
                .filter_map(|(j, list)| correct(context, &other, &self.folds, *j, list))
                .collect()
        });
        let mut signals: Vec<(String, f64)> = Vec::new();
        let (mut joints, mut nothing) = (Vec::new(), Vec::new());
        for (j, list) in candidates.iter().zip(found) {
            if list.is_empty() {
                nothing.push(format!(
                    "{} ({:.1} times the noise floor)",
                    j + 1,
                    after.fit.rms[*j] / floor[*j]
                ));
                continue;
            }
            joints.push(*j);
            for (name, share) in list {
                match signals.iter_mut().find(|(n, _)| *n == name) {
                    Some((_, s)) => *s = s.max(share),
                    None => signals.push((name, share)),
                }
            }
        }
        signals.sort_by(|a, b| b.1.total_cmp(&a.1));
        let unattributed = (!joints.is_empty()).then(|| Unattributed {
            rms: joints.iter().map(|j| after.fit.rms[*j]).collect(),
            joints: joints.iter().map(|j| j + 1).collect(),
            depends_on: signals.into_iter().map(|(name, _)| name).collect(),
            considered: self.refused.clone(),
            correction,
        });
        let unexplained = (!nothing.is_empty()).then(|| {
            format!(
                "what stays on joint {} is slower than white noise and depends on no position, speed, \
                    acceleration, load or time: slow noise \
                 of the sensor, or something that comes and goes",
                nothing.join(", ")
            )
        });
        (unattributed, unexplained)
    }
}

/// How the errors change, by joint that moves.
fn changes(data: &Data<'_>, before: &[Vec<f64>], after: &[Vec<f64>]) -> Vec<Change> {
    let of = |j: usize| {
        let square = |residual: &[f64]| residual.iter().map(|r| r * r).sum::<f64>();
        let block = |rows: &Range<usize>| (square(&after[j][rows.clone()]), square(&before[j][rows.clone()]));
        let (ratio, half) = over_blocks(&data.blocks.iter().map(|b| block(&b.rows[j])).collect::<Vec<_>>());
        let change = |square: f64| square.max(0.0).sqrt() - 1.0;
        Change { joint: j + 1, rms: change(ratio), interval: [change(ratio - half), change(ratio + half)] }
    };
    (0..data.dof()).filter(|j| !data.joints[*j].is_empty()).map(of).collect()
}
