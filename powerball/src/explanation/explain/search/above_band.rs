//! Ripple that is too fast for the band of the regression.
//!
//! Teeth that pass at 30 Hz leave nothing in a band of 10 Hz, in which inertia is identified: above it
//! accelerations are noise. A ripple needs none. What the model leaves above the band is summed by order, and
//! the highest peak of all joints is held against those of time-shift surrogates, in which the same torque is
//! seen at other positions: the single-step test of Westfall and Young (1993) at one level for all joints and
//! orders. It must then lower the error above the band on the validation set, with the same phase.

use super::super::comparison::{Comparison, Step, relative_score};
use super::super::model::{Accepted, Model};
use super::super::study::Study;
use super::screen::penalty;
use super::traces::{APART, Trace, Wave, heights_by_chance, highest, refined, traces};
use crate::controller::JointNumber;
use crate::explanation::effects::position_ripple::{BINS, PositionRipple, Settings};
use crate::explanation::effects::{Candidate, Context, Effect};
use crate::identification::estimate::residual_stats;
use crate::logs::parallel;
use crate::logs::regression::Data;

/// Ripples of a joint, at most.
const MOST: usize = 4;
/// Below this height no surrogate is asked: chance reaches it among so many orders.
const LOWEST: f64 = 8.0;

/// Finds the ripples and takes them into the model. Returns the step that names them, if any.
pub(crate) fn ripple_above_band(study: &Study<'_>, model: &mut Model, number: usize) -> Option<Step> {
    let before = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let square_before = model.fit.residual.iter().map(|r| r.iter().map(|v| v * v).sum()).collect();
    let found = search(study, model);
    let score = found.iter().map(|f| f.score).fold(0.0, f64::max);
    let mut joints: Vec<JointNumber> = found.iter().map(|f| f.accepted.candidate.joints[0]).collect();
    joints.dedup();
    for ripple in found {
        model.add_measured(study, Accepted { step: Some(number), ..ripple.accepted });
    }
    let after = residual_stats(&study.validation, &model.residual_on_validation(study)).rms;
    let margin = relative_score(study.rule(), score);
    let comparison = Comparison {
        margin,
        rivals: Vec::new(),
        twin: None,
        distinct_margin: margin,
        joints: joints.clone(),
    };
    let effect: &'static dyn Effect = &PositionRipple;
    let step = Step { number, effect, square_before, comparison, question: None, before, after };
    (!joints.is_empty()).then_some(step)
}

/// A ripple that passed.
struct Ripple {
    accepted: Accepted,
    score: f64,
}

fn search(study: &Study<'_>, model: &Model) -> Vec<Ripple> {
    let rule = study.rule();
    let of = |data: &Data<'_>| -> Vec<Vec<Trace>> {
        let context = Context::for_columns(data, &model.fit, rule);
        // Made once, before joints ask for them from several threads.
        context.rigid();
        context.friction();
        let joints: Vec<usize> = (0..data.dof()).collect();
        parallel::map(&joints, |j| traces(&context, model, *j))
    };
    let (mut fitted, validation) = (of(&study.data), of(&study.validation));
    let mut found: Vec<Ripple> = Vec::new();
    let mut chance: Option<Vec<f64>> = None;
    for j in 0..fitted.len() {
        for _ in 0..MOST {
            let left: Vec<&[f64]> = fitted[j].iter().map(|trace| trace.twice.as_slice()).collect();
            let Some(peak) = highest(&fitted[j], &left).filter(|peak| peak.height > LOWEST) else { break };
            let order = refined(&fitted[j], peak.order);
            let joint = JointNumber::from_index(j);
            let candidate = Candidate::on(joint, Settings { order }, BINS / 2);
            let wave = Wave::of(&fitted[j], order);
            let mut named = model.accepted.iter().chain(found.iter().map(|f| &f.accepted));
            if named.any(|a| is_the_same(&a.candidate, &candidate)) {
                fitted[j].iter_mut().for_each(|trace| trace.take_out(order, wave.coefficients));
                continue;
            }
            let Some(gain) = wave.gain_on(&validation[j], rule.family_wise) else { break };
            if gain.min(wave.gain(&fitted[j])) < rule.least_gain {
                break;
            }
            let chance = chance.get_or_insert_with(|| heights_by_chance(&fitted, rule.peak_surrogates));
            let above = chance.iter().filter(|height| **height >= peak.height).count();
            let p_value = (1 + above) as f64 / (1 + chance.len()) as f64;
            if p_value > rule.family_wise {
                break;
            }
            let coefficients = wave.coefficients;
            fitted[j].iter_mut().for_each(|trace| trace.take_out(order, coefficients));
            let accepted = Accepted {
                candidate,
                columns: 0,
                p_value,
                fold_gain: gain,
                explained: vec![0.0; study.data.dof()],
                step: None,
                measured: Some(coefficients.to_vec()),
            };
            let score = 2.0 * peak.height - penalty(rule, 2, BINS as f64 / 2.0);
            if raises_error(study, model, &accepted) {
                break;
            }
            found.push(Ripple { accepted, score });
        }
    }
    found
}

/// Whether two ripples of a joint are one: their orders differ by less than a path can tell.
fn is_the_same(a: &Candidate, b: &Candidate) -> bool {
    let order = |c: &Candidate| Settings::of(c).map(|settings| settings.order);
    let (Some(x), Some(y)) = (order(a), order(b)) else { return false };
    a.joints == b.joints && (x - y).abs() < APART
}

/// Whether the error on the validation set rises in the band so much that a name is taken back for it: a ripple that is
/// there changes little.
fn raises_error(study: &Study<'_>, model: &Model, ripple: &Accepted) -> bool {
    let joint = ripple.candidate.joints[0].index();
    let columns = study.on_validation(&model.fit, &[]).columns(&ripple.candidate);
    let square = |residual: &[Vec<f64>]| residual[joint].iter().map(|e| e * e).sum::<f64>();
    let mut residual = model.residual_on_validation(study);
    let before = square(&residual);
    let with = columns.iter().zip(ripple.measured.iter().flatten());
    with.for_each(|(column, c)| column.add_to(&mut residual, -c));
    square(&residual) > study.rule().max_validation_loss.exp() * before
}
