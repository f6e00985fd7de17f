//! Names that are taken back because they cannot be distinguished from others, or because their effect is not
//! there.
//!
//! The module also tests whether an effect is there at every speed of motion.

use super::super::model::{Accepted, Model};
use super::super::study::Study;
use super::open::{History, Question, Step};
use crate::effects::Effect;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::distribution::{MANY, t_critical};
use powerball_identification::estimate::{NormalEquations, Solver, noise_floor, residual_stats};
use powerball_logs::regression::Signals;
use powerball_logs::summary::{OCTAVES, halved};
use powerball_logs::vector::dot;
use std::ops::Range;

/// The candidates that were taken back, and the reason.
pub(crate) struct Withheld {
    pub(crate) effect: &'static dyn Effect,
    pub(crate) why: &'static str,
}

/// Takes back a wrong name, once everything that fits is in the model: an effect that is missing at some
/// speed of motion; or one that cannot be distinguished from its rivals and leaves a large residual, so that
/// another effect is there. It stays as a rival of later candidates.
pub(crate) fn withhold(study: &Study<'_>, model: &mut Model, history: &mut History) -> Option<Withheld> {
    let (taken, why) = if let Some(a) = impossible(study, model) {
        (vec![model.accepted.remove(a)], IMPOSSIBLE)
    } else if let Some(a) = inconstant(study, model) {
        (vec![model.accepted.remove(a)], "it is not there at every speed of motion")
    } else if let Some(a) = harmful(study, model) {
        (vec![model.accepted.remove(a)], HARMS)
    } else {
        let step = history.steps.iter().rev().find(|s| is_weak(study, model, s))?.number;
        let taken = model.accepted.extract_if(.., |a| a.step() == Some(step)).collect();
        (taken, "other effects fit as well, and much of the error is left")
    };
    take_back(study, model, history, taken, why)
}

/// Takes back only effects with impossible values and effects that raise the error on the validation logs.
pub(crate) fn withhold_harmful(
    study: &Study<'_>,
    model: &mut Model,
    history: &mut History,
) -> Option<Withheld> {
    let (taken, why) = match impossible(study, model) {
        Some(a) => (a, IMPOSSIBLE),
        None => (harmful(study, model)?, HARMS),
    };
    let taken = vec![model.accepted.remove(taken)];
    take_back(study, model, history, taken, why)
}

/// Reason for an effect with impossible values.
const IMPOSSIBLE: &str = "its values are impossible";
/// Reason for an effect that raises the error on the validation logs.
const HARMS: &str = "with it the error on the validation logs is larger";

fn take_back(
    study: &Study<'_>,
    model: &mut Model,
    history: &mut History,
    taken: Vec<Accepted>,
    why: &'static str,
) -> Option<Withheld> {
    let step = taken.first()?.step();
    let effect = taken.first()?.effect();
    // Effects that were found after it on the same joints may be there because of it, and are tried again.
    let joints: Vec<JointNumber> = taken.iter().flat_map(|a| a.candidate.joints.clone()).collect();
    model.accepted.retain(|a| a.step() <= step || !a.candidate.is_on(&joints));
    model.given_up.extend(taken.into_iter().map(|a| a.candidate));
    let stands = |s: &Step| model.accepted.iter().any(|a| a.step() == Some(s.number));
    let gone = history.steps.extract_if(.., |s| !stands(s));
    history.questions.extend(gone.filter_map(|s| s.question).map(Question::withheld));
    model.refit(study);
    Some(Withheld { effect, why })
}

/// The accepted effect that cannot be there with the coefficients that it came to have.
fn impossible(study: &Study<'_>, model: &Model) -> Option<usize> {
    let context = model.context(study);
    let mut found = model.accepted.iter().zip(model.coefficients());
    found.position(|(a, coefficients)| {
        let (effect, candidate) = (a.effect(), &a.candidate);
        !(effect.admissible(candidate, &coefficients) && effect.possible(&context, candidate, &coefficients))
    })
}

/// The accepted effect without which the logs to judge on are predicted better on its joints, or clearly
/// better on all: what one joint gains others may lose, since they share their parameters.
fn harmful(study: &Study<'_>, model: &Model) -> Option<usize> {
    *model.harmful.get_or_init(|| find_harmful(study, model))
}

fn find_harmful(study: &Study<'_>, model: &Model) -> Option<usize> {
    let error = |left: &Signals, joints: &[JointNumber]| -> f64 {
        let squares = left.squares();
        joints.iter().map(|j| squares[j.index()]).filter(|s| *s > 0.0).map(f64::ln).sum::<f64>()
            / joints.len() as f64
    };
    let all: Vec<JointNumber> = (0..study.data.dof()).map(JointNumber::from_index).collect();
    let with = model.residual_on_validation(study);
    let found = (0..model.accepted.len()).rev().filter(|k| !model.accepted[*k].is_baseline());
    found.into_iter().find(|k| {
        let joints = &model.accepted[*k].candidate.joints;
        let without = model.without(study, *k).residual_on_validation(study);
        [(joints, 0.0), (&all, study.rule().little)]
            .iter()
            .any(|(on, loss)| error(&without, on) < error(&with, on) - loss)
    })
}

/// Whether a step's name is not distinguished from others and a large residual remains.
fn is_weak(study: &Study<'_>, model: &Model, step: &Step) -> bool {
    step.comparison.distinct_margin < study.rule().least_margin
        && model.accepted.iter().any(|a| a.step() == Some(step.number))
        && share_left(study, model, step) > study.rule().max_unexplained
}

/// The share of the excess over the noise floor that stayed on a step's joints, each counting alike: a name
/// must explain every joint that it is given on.
fn share_left(study: &Study<'_>, model: &Model, step: &Step) -> f64 {
    let rms = |j: usize, square: f64| (square / study.data.joints[j].len().max(1) as f64).sqrt();
    let before: Vec<f64> = step.square_before.iter().enumerate().map(|(j, s)| rms(j, *s)).collect();
    let after = residual_stats(&study.data, &model.fit.residual).rms;
    let floor = noise_floor(&study.data);
    let joints = &step.comparison.joints;
    let shares: f64 = joints.iter().map(|j| leftover(&before, &after, &floor, &[*j])).sum();
    shares / joints.len().max(1) as f64
}

/// Share of the excess over the floor that stays: (after² − floor²)/(before² − floor²) over some joints
/// together, each in units of its floor.
#[must_use]
pub(crate) fn leftover(before: &[f64], after: &[f64], floor: &[f64], joints: &[JointNumber]) -> f64 {
    let excess = |rms: &[f64]| -> f64 {
        let of = |j: &JointNumber| ((rms[j.index()] / floor[j.index()]).powi(2) - 1.0).max(0.0);
        joints.iter().filter(|j| floor[j.index()] > 0.0).map(of).sum()
    };
    let old = excess(before);
    if old > 0.0 { (excess(after) / old).min(1.0) } else { 0.0 }
}

// Whether an effect is there at every speed of motion. A wrong name is fitted where most of the true effect
// is, in slow motion say; in faster motion the torque of its law is then not there. (Tests of constant
// parameters, after Chow 1960; here over octaves of time in the place of periods.)

/// By octave, fast to slow: how much larger or smaller the effect is there than over all, as a share, and the
/// standard error of that.
type ByOctave = [(f64, f64); OCTAVES];

/// The parts of a signal by octave. An odd end is left out: alone it does not distinguish fast from slow.
fn octaves(signal: &[f64]) -> [Vec<f64>; OCTAVES] {
    let mut slower = signal.to_vec();
    std::array::from_fn(|octave| {
        if octave + 1 == OCTAVES {
            return std::mem::take(&mut slower);
        }
        let (differences, sums) = halved(&slower);
        slower = sums;
        differences
    })
}

/// The last accepted effect of which most is certainly missing in some octave. Everything that fits must be
/// in the model before, because other missing effects also look like a change of size. (A change by more than
/// the effect itself has another cause.)
pub(crate) fn inconstant(study: &Study<'_>, model: &Model) -> Option<usize> {
    let rule = study.rule();
    let errors = t_critical(rule.family_wise / OCTAVES as f64, MANY);
    let NormalEquations { gram, .. } = model.fit.normal_equations();
    let sizes: Vec<ByOctave> =
        model.places().into_iter().map(|own| by_octave(study, model, &gram, own)).collect();
    let missing = |(change, error): &(f64, f64)| {
        let least = rule.most.max(errors * error);
        (least..2.0 - rule.most).contains(&-change)
    };
    let judged = |a: &usize| !model.accepted[*a].is_baseline() && !model.accepted[*a].effect().abrupt();
    (0..sizes.len()).rev().filter(judged).find(|a| sizes[*a].iter().any(missing))
}

/// An effect's size by octave, everything else refitted. `own` are the places of its columns.
fn by_octave(study: &Study<'_>, model: &Model, gram: &Mat<f64>, own: Range<usize>) -> ByOctave {
    let fit = &model.fit;
    let others = Solver::new(gram, |c| fit.free[c] && !own.contains(&c));
    let mut alone = vec![0.0; fit.design.size];
    for c in own {
        alone[c] += fit.theta[c];
        for (a, share) in alone.iter_mut().zip(others.solve(gram.col_as_slice(c))) {
            *a -= fit.theta[c] * share;
        }
    }
    let (mut along, mut square) = ([0.0; OCTAVES], [0.0; OCTAVES]);
    for j in 0..fit.design.dof() {
        let explained = fit.design.predict(j, &alone);
        for rows in &study.data.joints[j].rows {
            let (x, e) = (octaves(&explained[rows.clone()]), octaves(&fit.residual[j][rows.clone()]));
            for o in 0..OCTAVES {
                along[o] += fit.weights[j] * dot(&x[o], &e[o]);
                square[o] += fit.weights[j] * dot(&x[o], &x[o]);
            }
        }
    }
    std::array::from_fn(|o| {
        if square[o] > 0.0 { (along[o] / square[o], 1.0 / square[o].sqrt()) } else { (0.0, f64::INFINITY) }
    })
}

#[cfg(test)]
mod constancy_tests {
    use super::octaves;

    #[test]
    fn octaves_keep_the_power_and_tell_fast_from_slow() {
        let n = 1024;
        let wave = |period: f64| -> Vec<f64> {
            (0..n).map(|k| (std::f64::consts::TAU * k as f64 / period).sin()).collect()
        };
        for (period, from, to) in [(2.5, 0, 1), (12.0, 2, 4), (400.0, 6, 8)] {
            let signal = wave(period);
            let power = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
            let parts: Vec<f64> = octaves(&signal).iter().map(|o| power(o)).collect();
            approx::assert_relative_eq!(parts.iter().sum::<f64>(), power(&signal), max_relative = 1e-12);
            assert!(parts[from..to].iter().sum::<f64>() > 0.6 * power(&signal), "{period}: {parts:?}");
        }
    }
}
