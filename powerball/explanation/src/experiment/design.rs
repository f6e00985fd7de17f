//! The path along which open names predict torques that differ most: a design that discriminates between
//! models (T-optimality: Atkinson and Fedorov, The design of experiments for discriminating between two rival
//! models, Biometrika 1975).
//!
//! Each open name has a model, fitted to the old logs. Were one of them true, the other one, fitted again to
//! old and new logs together, would absorb a part of the difference: inertia, friction and its own
//! coefficients move. The part that it cannot absorb, relative to the noise, is the signal of an experiment
//! along the path.

use crate::explain::{Hypothesis, Open};
use faer::Mat;
use powerball_identification::estimate::{Design, Folds, Gram, Solver};
use powerball_identification::excite::{Error, ExcitationSettings, Fourier, Limits, search};
use powerball_logs::log::Log;
use powerball_logs::motion::Motion;
use powerball_logs::regression::{Column, Data, DataOptions, RigidArm, Signals};
use powerball_logs::vector::dot;

/// A designed experiment.
#[derive(Clone, Debug)]
pub struct DesignedExperiment {
    /// The path that the arm is to follow, from rest to rest.
    pub motion: Motion,
    /// rms of the difference that would stay, over the residual's own rms, by joint.
    pub expected: Vec<f64>,
    /// Evidence over the whole path, all joints together: χ² by which the wrong name would fall behind.
    pub evidence: f64,
    /// How much better than the old logs the path determines the quantities that only one of the names has.
    pub narrows: f64,
    /// `evidence` of the middle one of random paths.
    pub usual: f64,
}

/// Samples a second of the trajectory, as the arm's bus wants them.
const RATE: f64 = 200.0;
/// … and while paths are compared: the band of the analysis needs no more.
const COARSE: f64 = 50.0;

/// One period without a repeat, so that its end is another path than its beginning; harmonics up to 0.5 Hz.
fn settings() -> ExcitationSettings {
    ExcitationSettings {
        harmonics: 10,
        fundamental: std::f64::consts::TAU / 20.0,
        periods: 1,
        evaluations: 160,
        ..ExcitationSettings::default()
    }
}

/// Designs an experiment within the limits of the arm file.
///
/// # Errors
/// Limits that the arm file misses.
pub fn design(body: &RigidArm, open: &Open, options: &DataOptions) -> Result<DesignedExperiment, Error> {
    let settings = settings();
    let limits = Limits::of(body.arm(), settings.margin)?;
    let duels = duels(open);
    let (path, _, usual) = search(&settings, &limits, |path| {
        let shows = judge(body, open, &duels, path, COARSE, options);
        shows.map_or((0.0, 0.0), |s| (-s.evidence - s.narrows, s.evidence))
    })?;
    let shows = judge(body, open, &duels, &path, RATE, options);
    let shows =
        shows.unwrap_or_else(|| Shows { evidence: 0.0, narrows: 0.0, by_joint: vec![0.0; body.dof()] });
    Ok(DesignedExperiment {
        motion: path.sample(RATE),
        expected: shows.by_joint,
        evidence: shows.evidence,
        narrows: shows.narrows,
        usual,
    })
}

/// One name true, the other one fitted: what the old logs show about it.
struct Duel<'o> {
    truth: usize,
    rival: usize,
    model: &'o Hypothesis,
    /// The rival's normal equations on the old logs.
    gram: Mat<f64>,
    /// Signals of the true model that the rival may not absorb: the difference of both models, then each of
    /// the true model's own columns.
    signals: Vec<Signal>,
}

/// A signal on the old logs.
struct Signal {
    /// A's with the rival's columns A.
    right: Vec<f64>,
    /// s's.
    square: f64,
    /// The part of it that the rival cannot absorb.
    stays: f64,
}

/// The old logs leave a coefficient open by this many standard deviations.
const OPEN: f64 = 2.0;
/// A coefficient that is already known this much better no longer counts.
const ENOUGH: f64 = 20.0;

fn duels(open: &Open) -> Vec<Duel<'_>> {
    let all = &open.hypotheses;
    let pairs = (0..all.len()).flat_map(|t| (0..all.len()).filter(move |r| *r != t).map(move |r| (t, r)));
    pairs
        .map(|(truth, rival)| {
            let (other, fit) = (&all[truth].fit, &all[rival].fit);
            let gram = fit.gram.all(&fit.weights).gram;
            let difference = fit.residual.without(&other.residual);
            let mut signals: Vec<Signals> = vec![difference];
            let rows: Vec<usize> = fit.residual.iter().map(Vec::len).collect();
            signals.extend(all[truth].fitted_columns.iter().map(|c| by_joint(c, &rows)));
            let signals = (signals.iter())
                .map(|values| {
                    let (right, square) = products(&fit.design, &fit.weights, values);
                    let stays = left(&gram, &right, square, &fit.free).0;
                    Signal { right, square, stays }
                })
                .collect();
            Duel { truth, rival, model: &all[rival], gram, signals }
        })
        .collect()
}

/// A column's values on every joint.
fn by_joint(column: &Column, rows: &[usize]) -> Signals {
    let on = |(j, rows): (usize, &usize)| column.at(j).map_or_else(|| vec![0.0; *rows], <[f64]>::to_vec);
    rows.iter().enumerate().map(on).collect()
}

/// A's and s's of a signal, weighted.
fn products(design: &Design, weights: &[f64], signal: &[Vec<f64>]) -> (Vec<f64>, f64) {
    let (mut right, mut square) = (vec![0.0; design.size], 0.0);
    for (j, values) in signal.iter().enumerate() {
        for (g, value) in design.cross(j, &(0..values.len()), &[values]) {
            right[g] += weights[j] * value[0];
        }
        square += weights[j] * values.iter().map(|v| v * v).sum::<f64>();
    }
    (right, square)
}

/// The least χ² over the free coefficients, and those.
fn left(gram: &Mat<f64>, right: &[f64], square: f64, free: &[bool]) -> (f64, Vec<f64>) {
    let x = Solver::new(gram, |c| free[c]).solve(right);
    (square - dot(&x, right), x)
}

/// The evidence that a path would give.
#[derive(Clone, Debug)]
struct Shows {
    /// χ² that the new log would add.
    evidence: f64,
    /// How much better it would determine the terms that only one of the names has, if the old logs leave
    /// them open: the variances of its coefficients over those after the new log, less one. It decides where
    /// names predict the same as fitted (a spring that does not grow is a constant torque).
    narrows: f64,
    /// The difference that stays over the noise, by joint.
    by_joint: Vec<f64>,
}

/// The evidence of a path for the pair of names that is hardest to distinguish; `None` if the path moves
/// nothing.
fn judge(
    body: &RigidArm,
    open: &Open,
    duels: &[Duel<'_>],
    path: &Fourier,
    rate: f64,
    options: &DataOptions,
) -> Option<Shows> {
    let log = log_of(&path.sample(rate));
    let data = Data::new(body, std::slice::from_ref(&log), options).ok()?;
    let folds = Folds::new(&data);
    let n = data.dof();
    let rows: Vec<usize> = data.joints.iter().map(|j| j.len()).collect();
    let designs: Vec<Design> = open.hypotheses.iter().map(|h| h.design(&data)).collect();
    let own: Vec<Vec<Column>> = open.hypotheses.iter().map(|h| h.own_columns(&data)).collect();
    let predict = |h: usize, j: usize| designs[h].predict(j, &open.hypotheses[h].fit.theta);
    let shows = |duel: &Duel<'_>| {
        let (fit, design) = (&duel.model.fit, &designs[duel.rival]);
        let difference: Signals = (0..n)
            .map(|j| {
                let (truth, rival) = (predict(duel.truth, j), predict(duel.rival, j));
                truth.iter().zip(rival).map(|(t, r)| t - r).collect()
            })
            .collect();
        let gram = &duel.gram + &Gram::new(&data, design, &folds).all(&fit.weights).gram;
        let stays = |signal: &[Vec<f64>], old: &Signal| {
            let (right, square) = products(design, &fit.weights, signal);
            let right: Vec<f64> = right.iter().zip(&old.right).map(|(a, b)| a + b).collect();
            left(&gram, &right, square + old.square, &fit.free)
        };
        let (all, x) = stays(&difference, &duel.signals[0]);
        let narrows = (own[duel.truth].iter().zip(&duel.signals[1..]))
            .filter(|(_, old)| old.stays > 1e-6 * old.square)
            .map(|(column, old)| {
                let (after, _) = stays(&by_joint(column, &rows), old);
                OPEN * OPEN * ((after - old.stays) / old.stays).clamp(0.0, ENOUGH)
            })
            .sum();
        let by_joint = (0..n)
            .map(|j| {
                let absorbed = design.predict(j, &x);
                let rest = difference[j].iter().zip(&absorbed).map(|(d, a)| (d - a) * (d - a));
                let rms = (rest.sum::<f64>() / absorbed.len().max(1) as f64).sqrt();
                if fit.sigma[j] > 0.0 { rms / fit.sigma[j] } else { 0.0 }
            })
            .collect();
        Shows { evidence: (all - duel.signals[0].stays).max(0.0), narrows, by_joint }
    };
    let shown: Vec<Shows> = duels.iter().map(shows).collect();
    // A name whose model holds the other one's as a special case absorbs all of it: only the way back can
    // show a difference, so both ways count together.
    let both_ways = |there: usize| -> Option<Shows> {
        let duel = &duels[there];
        let back = duels.iter().position(|d| d.truth == duel.rival && d.rival == duel.truth)?;
        let (there, back) = (&shown[there], &shown[back]);
        Some(Shows {
            evidence: 0.5 * (there.evidence + back.evidence),
            narrows: there.narrows + back.narrows,
            by_joint: there.by_joint.iter().zip(&back.by_joint).map(|(a, b)| a.max(*b)).collect(),
        })
    };
    (0..duels.len())
        .filter(|d| duels[*d].truth < duels[*d].rival)
        .filter_map(both_ways)
        .min_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

/// A motion as a log. Its torques are never used, but one that never changes would count as dead:
/// positions stand in.
fn log_of(motion: &Motion) -> Log {
    let n = motion.dof();
    let of = |j: usize| motion.q.iter().skip(j).step_by(n).copied().collect();
    let q: Vec<Vec<f64>> = (0..n).map(of).collect();
    Log {
        file: "planned".into(),
        t: (0..motion.len()).map(|k| k as f64 * motion.period).collect(),
        torque: q.clone(),
        q,
        temperature: None,
        motor: None,
        pieces: std::iter::once(0..motion.len()).collect(),
        doubts: Vec::new(),
        clock: 0.0,
    }
}
