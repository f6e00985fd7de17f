//! What stays without a name.

use super::super::comparison::History;
use super::super::model::Model;
use super::super::named::{FitErrors, NamedEffect, Rival};
use super::super::study::Study;
use super::correction::{Correction, correct};
use super::dependencies::{Dependencies, depends_on};
use super::verdict::explained;
use crate::controller::JointNumber;
use crate::logs::parallel;
use serde::Serialize;

/// What stays without a name.
#[derive(Clone, Debug, Serialize)]
pub struct Unattributed {
    /// Joints.
    pub joints: Vec<JointNumber>,
    /// Signals that the residual depends on, the strongest first.
    pub depends_on: Vec<String>,
    /// rms of the residual of those joints on the fitted logs, N·m.
    pub rms: Vec<f64>,
    /// Effects that fit a part of it, but not well enough to be named there.
    pub considered: Vec<Rival>,
    /// Curves that take a part of it off, where they were asked for: those of the joints whose held-out
    /// errors fall by them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction: Option<Vec<Correction>>,
}

/// The joints that are not explained and whose residual depends on something, and what is to be said of the others on
/// which more than noise is left.
pub(crate) fn unattributed(
    study: &Study<'_>,
    model: &Model,
    history: &History,
    held_out: &[Vec<f64>],
    floor: &[f64],
    after: &FitErrors,
    named: &[NamedEffect],
) -> (Option<Unattributed>, Vec<String>, Dependencies) {
    let (rule, context) = (study.rule(), model.context(study));
    let rms = &after.fit.rms;
    let is_left =
        |j: &usize| rms[*j] > rule.above_floor * floor[*j] && model.fit.inflation[*j] > rule.coloured;
    let candidates: Vec<usize> = context.moving_joints().map(JointNumber::index).filter(is_left).collect();
    let found = parallel::map(&candidates, |j| depends_on(&context, *j));
    let on_validation = study.on_validation(&model.fit, held_out);
    let correction = study.options.correct_unattributed.then(|| {
        let of = |(j, list): (&usize, &Vec<(String, f64)>)| {
            correct(&context, &on_validation, &study.folds, *j, list)
        };
        candidates.iter().zip(&found).filter_map(of).collect()
    });
    let dependencies = Dependencies::new(candidates.iter().copied().zip(found.iter().cloned()));
    let mut signals: Vec<(String, f64)> = Vec::new();
    let explained = explained(study, &after.validate, floor, &dependencies);
    let (mut joints, mut nothing, mut little) = (Vec::<JointNumber>::new(), Vec::new(), Vec::new());
    for (j, list) in candidates.iter().zip(found) {
        let Some((strongest, _)) = list.first() else {
            nothing.push(format!("{} ({:.1} times the noise floor)", j + 1, rms[*j] / floor[*j]));
            continue;
        };
        if explained[*j] {
            let left = 100.0 * after.validate.relative[*j];
            little.push(format!("{strongest} on joint {} ({left:.1} % of its torque)", j + 1));
            continue;
        }
        joints.push(JointNumber::from_index(*j));
        for (name, share) in list {
            match signals.iter_mut().find(|(n, _)| *n == name) {
                Some((_, s)) => *s = s.max(share),
                None => signals.push((name, share)),
            }
        }
    }
    signals.sort_by(|a, b| b.1.total_cmp(&a.1));
    let unattributed = (!joints.is_empty()).then(|| Unattributed {
        rms: joints.iter().map(|j| rms[j.index()]).collect(),
        depends_on: signals.into_iter().map(|(name, _)| name).collect(),
        considered: considered(history, &joints, named),
        correction,
        joints,
    });
    let mut unexplained = Vec::new();
    if !little.is_empty() {
        unexplained.push(format!("what little is left depends on {}", little.join(", ")));
    }
    if !nothing.is_empty() {
        unexplained.push(format!(
            "what stays on joint {} is slower than white noise and depends on no position, velocity, \
             acceleration, load or time: slow noise of the sensor, or something that comes and goes",
            nothing.join(", ")
        ));
    }
    (unattributed, unexplained, dependencies)
}

/// The effects that were refused on joints without being named on one of them.
fn considered(history: &History, joints: &[JointNumber], named: &[NamedEffect]) -> Vec<Rival> {
    let on_these = |rival: &&Rival| {
        rival.joints.iter().any(|joint| joints.contains(joint))
            && !named.iter().any(|effect| effect.is(&rival.effect, &rival.joints))
    };
    history.refused.iter().filter(on_these).cloned().collect()
}
