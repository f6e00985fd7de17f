//! The path along which open names predict torques that differ most: a design that discriminates between models
//! (T-optimality: Atkinson and Fedorov, The design of experiments for discriminating between two rival models, Biometrika 1975).
//!
//! Each open name has a model, fitted to the old logs. Were one of them true, the other one, fitted again to old and new logs
//! together, would absorb a part of the difference: inertia, friction and its own coefficients move. What it cannot absorb, over the
//! noise, is what an experiment along the path would show.

use crate::estimate::{Folds, Gram, Solver};
use crate::excite::{Error, Fourier, Limits, Settings, search};
use crate::explain::{Hypothesis, Open};
use crate::log::Log;
use crate::motion::Motion;
use crate::regression::{Data, DataOptions, RigidBody};
use faer::Mat;

/// A designed experiment.
#[derive(Clone, Debug)]
pub struct Design {
    /// What the arm is to follow, from rest to rest.
    pub motion: Motion,
    /// rms of the difference that would stay, over the residual's own rms, by joint.
    pub expected: Vec<f64>,
    /// The same over the whole path, all joints together: χ² by which the wrong name would fall behind.
    pub evidence: f64,
    /// `evidence` of the middle one of random paths.
    pub usual: f64,
}

/// Samples a second of the trajectory, as the arm's bus wants them.
const RATE: f64 = 200.0;
/// … and while paths are compared: the band of the analysis needs no more.
const COARSE: f64 = 50.0;

/// One period without a repeat, so that its end is another path than its beginning; harmonics up to 0.5 Hz.
fn settings() -> Settings {
    Settings {
        harmonics: 10,
        fundamental: std::f64::consts::TAU / 20.0,
        periods: 1,
        evaluations: 160,
        ..Settings::default()
    }
}

/// Designs an experiment within the limits of the arm file.
///
/// # Errors
/// Limits that the arm file misses.
pub fn design(body: &RigidBody, open: &Open, options: &DataOptions) -> Result<Design, Error> {
    let settings = settings();
    let limits = Limits::of(body.arm(), settings.margin)?;
    let duels = duels(open);
    let (path, _, usual) = search(body.dof(), &settings, &limits, |path| {
        let evidence = judge(body, open, &duels, path, COARSE, options).map_or(0.0, |j| j.0);
        (-evidence, evidence)
    })?;
    let (evidence, expected) =
        judge(body, open, &duels, &path, RATE, options).unwrap_or_else(|| (0.0, vec![0.0; body.dof()]));
    Ok(Design { motion: path.sample(RATE), expected, evidence, usual })
}

/// One name true, the other one fitted: what the old logs say of it.
struct Duel<'o> {
    truth: usize,
    rival: usize,
    model: &'o Hypothesis,
    /// The rival's normal equations on the old logs, with the difference in the place of torques.
    gram: Mat<f64>,
    right: Vec<f64>,
    /// The part of the difference that stays on the old logs.
    stays: f64,
}

fn duels(open: &Open) -> Vec<Duel<'_>> {
    let all = &open.hypotheses;
    let pairs = (0..all.len()).flat_map(|t| (0..all.len()).filter(move |r| *r != t).map(move |r| (t, r)));
    pairs
        .map(|(truth, rival)| {
            let (other, fit) = (&all[truth].fit, &all[rival].fit);
            let gram = fit.gram.sum(&fit.weights, |_| true).0;
            let (mut right, mut square) = (vec![0.0; fit.design.size], 0.0);
            for j in 0..fit.design.dof() {
                let w = fit.weights[j];
                let difference: Vec<f64> =
                    fit.residual[j].iter().zip(&other.residual[j]).map(|(r, t)| r - t).collect();
                for (g, value) in fit.design.cross(j, &(0..difference.len()), &[&difference]) {
                    right[g] += w * value[0];
                }
                square += w * difference.iter().map(|d| d * d).sum::<f64>();
            }
            let stays = left(&gram, &right, square, &fit.free).0;
            Duel { truth, rival, model: &all[rival], gram, right, stays }
        })
        .collect()
}

/// The least χ² over the free coefficients, and those.
fn left(gram: &Mat<f64>, right: &[f64], square: f64, free: &[bool]) -> (f64, Vec<f64>) {
    let x = Solver::new(gram, |c| free[c]).solve(right);
    (square - x.iter().zip(right).map(|(a, b)| a * b).sum::<f64>(), x)
}

/// χ² that the new path would add for the pair of names that is hardest to tell apart, and by joint the difference over
/// the noise; `None` where the path moves nothing.
fn judge(
    body: &RigidBody,
    open: &Open,
    duels: &[Duel<'_>],
    path: &Fourier,
    rate: f64,
    options: &DataOptions,
) -> Option<(f64, Vec<f64>)> {
    let log = log_of(&path.sample(rate));
    let mut data = Data::new(body, std::slice::from_ref(&log), options).ok()?;
    let folds = Folds::new(&data);
    let n = data.dof();
    let designs: Vec<_> = open.hypotheses.iter().map(|h| h.design(&data)).collect();
    let predictions: Vec<Vec<Vec<f64>>> = (designs.iter().zip(&open.hypotheses))
        .map(|(design, h)| (0..n).map(|j| design.predict(j, &h.fit.theta)).collect())
        .collect();
    let mut verdicts: Vec<(usize, usize, f64, Vec<f64>)> = Vec::new();
    for duel in duels {
        let (fit, design) = (&duel.model.fit, &designs[duel.rival]);
        for j in 0..n {
            let (truth, rival) = (&predictions[duel.truth][j], &predictions[duel.rival][j]);
            data.joints[j].torque = truth.iter().zip(rival).map(|(t, r)| t - r).collect();
        }
        let (gram, right, square) = Gram::new(&data, design, &folds).sum(&fit.weights, |_| true);
        let both: Vec<f64> = right.iter().zip(&duel.right).map(|(a, b)| a + b).collect();
        let old_square = duel.stays
            + Solver::new(&duel.gram, |c| fit.free[c])
                .solve(&duel.right)
                .iter()
                .zip(&duel.right)
                .map(|(a, b)| a * b)
                .sum::<f64>();
        let (stays, x) = left(&(&gram + &duel.gram), &both, square + old_square, &fit.free);
        let by_joint = (0..n)
            .map(|j| {
                let absorbed = design.predict(j, &x);
                let rest = data.joints[j].torque.iter().zip(&absorbed).map(|(d, a)| (d - a) * (d - a));
                let rms = (rest.sum::<f64>() / absorbed.len().max(1) as f64).sqrt();
                if fit.sigma[j] > 0.0 { rms / fit.sigma[j] } else { 0.0 }
            })
            .collect();
        verdicts.push((duel.truth, duel.rival, stays - duel.stays, by_joint));
    }
    // A name whose model holds the other one's as a special case absorbs all of it: only the way back can show a
    // difference, so both ways count together.
    let mut worst: Option<(f64, Vec<f64>)> = None;
    for (truth, rival, evidence, by_joint) in verdicts.iter().filter(|v| v.0 < v.1) {
        let Some(back) = verdicts.iter().find(|v| v.0 == *rival && v.1 == *truth) else { continue };
        let evidence = 0.5 * (evidence + back.2);
        if worst.as_ref().is_none_or(|(w, _)| evidence < *w) {
            let by_joint = by_joint.iter().zip(&back.3).map(|(a, b)| a.max(*b)).collect();
            worst = Some((evidence, by_joint));
        }
    }
    worst
}

/// A motion as a log without torques.
fn log_of(motion: &Motion) -> Log {
    let n = motion.dof();
    let of = |j: usize| motion.q.iter().skip(j).step_by(n).copied().collect();
    Log {
        file: "planned".into(),
        t: (0..motion.len()).map(|k| k as f64 * motion.period).collect(),
        q: (0..n).map(of).collect(),
        torque: vec![vec![0.0; motion.len()]; n],
        temperature: None,
        pieces: std::iter::once(0..motion.len()).collect(),
        clock: 0.0,
    }
}
