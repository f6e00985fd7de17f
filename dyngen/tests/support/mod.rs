//! What tests of an arm's functions share: models of a text, states drawn by lot.

// Each test uses a part of it.
#![allow(dead_code)]

pub(crate) mod valued;

use chacha20::ChaCha8Rng;
use dyngen::{Arm, Evaluator, Model, Samples, SetKind};
use rand::RngExt;

pub(crate) fn model(text: &str) -> Model {
    Model::derive(Arm::parse(text, "arm.toml").unwrap_or_else(|e| panic!("{e}"))).unwrap()
}

/// Every function that the arm has for a set, in the order of [`Function::ALL`]: it is proven, or this
/// panics.
pub(crate) fn proven(model: &Model, kind: SetKind) -> Vec<Evaluator> {
    let evaluator = |f| Evaluator::new(model, f, kind).unwrap_or_else(|e| panic!("{f} {kind}: {e}"));
    model.functions(kind).map(evaluator).collect()
}

/// The rank of columns, the longest taken first (Gram and Schmidt, twice).
pub(crate) fn rank(mut columns: Vec<Vec<f64>>) -> usize {
    let dot = |u: &[f64], v: &[f64]| u.iter().zip(v).map(|(x, y)| x * y).sum::<f64>();
    for column in &mut columns {
        let length = dot(column, column).sqrt();
        // Rotors' columns are longer than others by their ratio's square; what is rounding is no column.
        let scale = if length > 1e-9 { 1.0 / length } else { 0.0 };
        column.iter_mut().for_each(|x| *x *= scale);
    }
    for rank in 0..columns.len() {
        let rest = rank..columns.len();
        let longest =
            rest.max_by(|i, j| dot(&columns[*i], &columns[*i]).total_cmp(&dot(&columns[*j], &columns[*j])));
        columns.swap(rank, longest.unwrap());
        let length = dot(&columns[rank], &columns[rank]).sqrt();
        if length < 1e-9 {
            return rank;
        }
        columns[rank].iter_mut().for_each(|x| *x /= length);
        let unit = columns[rank].clone();
        for other in &mut columns[rank + 1..] {
            for _ in 0..2 {
                let part = dot(other, &unit);
                other.iter_mut().zip(&unit).for_each(|(x, y)| *x -= part * y);
            }
        }
    }
    columns.len()
}

/// One sample of everything that functions take but parameters.
#[derive(Clone)]
pub(crate) struct State {
    pub(crate) q: Vec<f64>,
    pub(crate) dq: Vec<f64>,
    pub(crate) ddq: Vec<f64>,
    pub(crate) dqr: Vec<f64>,
    pub(crate) ddqr: Vec<f64>,
    pub(crate) e: Vec<f64>,
    pub(crate) f: Vec<f64>,
    pub(crate) tau: Vec<f64>,
    pub(crate) payload: Vec<f64>,
    pub(crate) vq: Vec<f64>,
    pub(crate) vdq: Vec<f64>,
}

impl State {
    /// Every number between -size and size.
    pub(crate) fn draw(random: &mut ChaCha8Rng, joints: usize, size: f64) -> State {
        let mut of = |length| (0..length).map(|_| random.random_range(-size..size)).collect();
        let mut v = || of(joints);
        let [q, dq, ddq, dqr, ddqr, e, tau, vq, vdq] = std::array::from_fn(|_| v());
        State { q, dq, ddq, dqr, ddqr, e, tau, vq, vdq, f: of(6), payload: of(10) }
    }

    pub(crate) fn samples<'a>(&'a self, parameters: &'a [f64]) -> Samples<'a> {
        let State { q, dq, ddq, dqr, ddqr, e, f, tau, payload, vq, vdq } = self;
        Samples { q, dq, ddq, dqr, ddqr, tau, e, f, payload, vq, vdq, parameters }
    }
}

/// A function's result at one sample, row by row.
pub(crate) fn evaluate(evaluator: &Evaluator, samples: &Samples<'_>) -> Vec<f64> {
    let mut out = vec![0.0; evaluator.outputs()];
    evaluator.run(samples, &mut out);
    out
}
