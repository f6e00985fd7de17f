//! From the accepted effects to the result.

use super::compose::Composed;
use super::curves::curves;
use super::forward::{ExplainError, Session, Step};
use super::leftover::{depends_on, effective_samples, leftover};
use super::result::{Errors, Explained, NamedEffect, Unattributed};
use crate::effects::{Context, Found};
use crate::estimate::{noise_floor, spread};
use crate::parallel;

/// Said where the logs to judge on are repeats.
const ONE_PATH: &str = "the logs of --validate run the same path as those of --log: what depends on positions (springs, zeros, \
                        gravity, broken symmetries, slow ripple) was not considered; record another path";

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

    pub(super) fn result(
        mut self,
        before: Errors,
        base_residual: &[Vec<f64>],
    ) -> Result<Explained, ExplainError> {
        let Composed { model, fitted, held_out: residual } = self.composed()?;
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
            let mut logs: Vec<String> =
                found.iter().flat_map(|f| f.candidate.windows.iter().map(|w| w.log.clone())).collect();
            logs.dedup();
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
                rivals: first.comparison.rivals.clone(),
                joints: joints.iter().map(|j| j + 1).collect(),
            });
        }
        let unattributed = self.unattributed(&context, &floor, &after);
        let next_experiment = self.steps.iter().find_map(|s| {
            let twin = s.comparison.twin.as_ref()?;
            let name = self.effects[s.effect].name();
            Some(serde_json::json!({
                "to_tell_apart": [name, twin],
                "advice": format!("record the joints concerned on a path with other positions, speeds and loads than these logs: {name} and {twin} explain them equally well"),
            }))
        });
        let effective_samples = effective_samples(&self.data, &self.fit.residual);
        self.false_positives.rate =
            self.false_positives.accepted as f64 / (self.false_positives.placebos.max(1)) as f64;
        Ok(Explained {
            arm: self.data.body.arm().name.clone(),
            before,
            after,
            noise_floor: floor,
            effects: named,
            band: [0.0, self.data.band.cutoff],
            effective_samples,
            unattributed,
            next_experiment,
            false_positives: self.false_positives.clone(),
            warnings: (self.data.notes.iter().chain(&self.other.notes).cloned())
                .chain(self.one_path.then(|| ONE_PATH.to_string()))
                .collect(),
            curves,
            model,
        })
    }

    /// The joints whose residual still depends on something.
    fn unattributed(&self, context: &Context<'_>, floor: &[f64], after: &Errors) -> Option<Unattributed> {
        let candidates: Vec<usize> = context
            .moving_joints()
            .filter(|j| after.fit.rms[*j] > 1.2 * floor[*j] && self.fit.inflation[*j] > 2.0)
            .collect();
        let found = parallel::map(&candidates, |j| depends_on(context, *j));
        let mut signals: Vec<(String, f64)> = Vec::new();
        let mut joints = Vec::new();
        for (j, list) in candidates.iter().zip(found) {
            if list.is_empty() {
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
        (!joints.is_empty()).then(|| Unattributed {
            rms: joints.iter().map(|j| after.fit.rms[*j]).collect(),
            joints: joints.iter().map(|j| j + 1).collect(),
            depends_on: signals.into_iter().map(|(name, _)| name).collect(),
            considered: self.refused.clone(),
        })
    }
}
