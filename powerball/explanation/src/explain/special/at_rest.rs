//! Contact with an arm that stands still, or that the contact has stopped: each log is judged by the rests of
//! others.

use super::super::study::Study;
use crate::effects::Window;
use crate::rule::Rule;
use crate::torque_model::{Rest, RestLimits, RestPush, TorqueModel, Usual, rests};
use powerball_logs::parallel;
use powerball_logs::regression::{Data, Recording, RigidArm};
use std::ops::Range;

/// Rounds in which what pushes is taken out of what is usual.
const ROUNDS: usize = 2;

/// The limits of a log's rests, and by rest when something pushes: its samples.
type Pushed = (RestLimits, Vec<Vec<Range<usize>>>);

/// The pushes in all logs, those that were fitted first.
///
/// `arm` is the arm with the changes of `model`, and the last link holds the model's payload during the
/// windows `held` of the fitted logs and of the validation set. `errors` are the residuals of the model on
/// the latter, rms by joint.
pub(crate) fn pushes_at_rest(
    study: &Study<'_>,
    (model, arm): (&TorqueModel, &RigidArm),
    held: &[Vec<Window>; 2],
    errors: &[f64],
) -> Vec<RestPush> {
    let (sets, rule) = ([&study.data, &study.validation], study.rule());
    let joints = model.usual_at_rest(errors);
    let velocity = &study.data.rest_velocity;
    let [mut fitted, judged] = [0, 1].map(|k| all_rests(sets[k], (model, arm), &held[k]));
    // A push in one log hides those of others until it is known.
    for _ in 0..ROUNDS {
        let found = pushed(rule, &fitted, None, (velocity, &joints));
        let runs: Vec<Vec<Range<usize>>> = found.into_iter().flat_map(|(_, runs)| runs).collect();
        fitted.iter_mut().zip(runs).for_each(|(rest, runs)| rest.disturbed_by(&runs));
    }
    let pushes = |k: usize, own: &[Rest], found: Vec<Pushed>| {
        let each = found.iter().flat_map(|(limits, runs)| runs.iter().map(move |runs| (limits, runs)));
        let of = |(rest, (limits, runs)): (&Rest, (&RestLimits, &Vec<Range<usize>>))| {
            let log = &sets[k].logs[rest.log];
            let pushes = runs.iter().filter_map(|run| rest.push(sets[k].body, log, limits, run));
            // One force must explain most of it.
            pushes.filter(|push| push.share >= rule.most).collect::<Vec<_>>()
        };
        own.iter().zip(each).flat_map(of).collect::<Vec<_>>()
    };
    let in_fitted = pushes(0, &fitted, pushed(rule, &fitted, None, (velocity, &joints)));
    let in_judged = pushes(1, &judged, pushed(rule, &judged, Some(&fitted), (velocity, &joints)));
    in_fitted.into_iter().chain(in_judged).collect()
}

/// The times of pushes, by log and rest, with the usual residual there. The rests of `fitted` give the usual
/// residual of other logs; if there are none, the other logs of the rests themselves.
fn pushed(
    rule: &Rule,
    rests: &[Rest],
    fitted: Option<&[Rest]>,
    (velocity, joints): (&[f64], &[Usual]),
) -> Vec<Pushed> {
    let of = |own: &[Rest]| {
        let log = own[0].log;
        let others: Vec<&Rest> = match fitted {
            Some(fitted) => fitted.iter().collect(),
            None => rests.iter().filter(|rest| rest.log != log).collect(),
        };
        let limits = RestLimits::new(velocity, joints, &others, own);
        let mut runs: Vec<Vec<Range<usize>>> = own.iter().map(|rest| rest.pushed(&limits)).collect();
        let pushed: usize = runs.iter().flatten().map(Range::len).sum();
        let all: usize = own.iter().map(Rest::len).sum();
        // A force in all but little of several rests is that of a carried body, not a push.
        if own.len() > 1 && pushed as f64 >= (1.0 - rule.little) * all as f64 {
            runs.iter_mut().for_each(Vec::clear);
        }
        (limits, runs)
    };
    rests.chunk_by(|a, b| a.log == b.log).map(of).collect()
}

/// The rests of some logs, in order.
fn all_rests(data: &Data<'_>, (model, arm): (&TorqueModel, &RigidArm), held: &[Window]) -> Vec<Rest> {
    let of = |recording: &Recording| {
        let predicted = |still: &Recording| model.torque_in(arm, &data.logs[recording.log], still, held);
        rests(recording, &data.rest_velocity, &data.band, predicted)
    };
    let recordings: Vec<&Recording> = data.recordings.iter().collect();
    parallel::map(&recordings, |recording| of(recording)).into_iter().flatten().collect()
}
