//! Whether an effect is there at every pace. A name that is not the truth is fitted where most of the truth
//! is, in slow motion say; in faster motion what the same law says is then not there. (Tests of constant
//! parameters, after Chow 1960; here over octaves of time in the place of periods.)

use super::super::model::Model;
use super::super::study::Study;
use crate::identification::estimate::Solver;
use crate::logs::summary::{OCTAVES, halved};
use crate::logs::vector::dot;
use faer::Mat;
use std::ops::Range;

/// By octave, fast to slow: how much larger or smaller the effect is there than over all, as a share, and the
/// standard error of that.
type ByOctave = [(f64, f64); OCTAVES];

/// What a signal holds by octave. An odd end is left out: by itself it tells fast from slow no more.
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

/// The last accepted effect of which surely most is missing in some octave. Everything that fits must be
/// in the model: what else is missing is seen as a change of size too. (A change by more than the effect
/// itself is not its own.)
pub(crate) fn inconstant(study: &Study<'_>, model: &Model) -> Option<usize> {
    let rule = study.rule();
    let (gram, _, _) = model.fit.gram.fitted(&model.fit.weights, |_| true);
    let sizes: Vec<ByOctave> =
        model.places().into_iter().map(|own| by_octave(study, model, &gram, own)).collect();
    let missing = |(change, error): &(f64, f64)| {
        let least = rule.least_missing.max(rule.missing_errors * error);
        (least..2.0 - rule.least_missing).contains(&-change)
    };
    let judged = |a: &usize| model.accepted[*a].step.is_some() && !model.accepted[*a].effect().abrupt();
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
mod tests {
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
