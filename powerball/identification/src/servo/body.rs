//! What one joint has to move along a log: τ = inertia·q̈ + rest(q) in the joint's own angle, next to the
//! measured motion of all others.
//!
//! The joint's own inertia does not depend on its own angle, and the rest (gravity, and what the others'
//! motion does to it) is a trigonometric polynomial of degree two in it: every entry of an inertia tensor
//! that is turned by q is. Five angles therefore determine it exactly, whatever the arm. The joint's own
//! speed enters the rest as measured: for an arm of one joint it does not enter at all.

use powerball_logs::log::ServoLog;
use powerball_logs::regression::RigidArm;
use powerball_logs::signal::Butterworth;
use powerball_logs::signal::difference::{derivative, second_derivative};
use powerball_logs::signal::resample::{cubic, even_grid};
use std::f64::consts::TAU;
use std::ops::Range;

/// Coefficients of 1, cos q, sin q, cos 2q, sin 2q.
pub(super) const HARMONICS: usize = 5;
/// The end of the band of the others' motion, Hz: arms with such drives do not move faster.
const BAND: f64 = 5.0;
/// … but no more than this share of the rate of samples.
const OF_RATE: f64 = 0.2;

/// What a joint has to move, N·m·s²/rad and N·m (or shares of the torque at full duty).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// Against its acceleration.
    pub inertia: f64,
    /// Coefficients of the torque at rest and beyond.
    pub harmonics: [f64; 5],
}

impl Moved {
    /// The torque that holds it at an angle, while the others move as they do.
    #[must_use]
    pub fn rest(&self, q: f64) -> f64 {
        let (s, c) = q.sin_cos();
        let [constant, c1, s1, c2, s2] = self.harmonics;
        constant + c * (c1 + 2.0 * c2 * c) - c2 + s * (s1 + 2.0 * s2 * c)
    }

    fn add(&mut self, other: &Moved, factor: f64) {
        self.inertia += factor * other.inertia;
        self.harmonics.iter_mut().zip(other.harmonics).for_each(|(own, x)| *own += factor * x);
    }
}

/// What a joint has to move along one piece of a log, for a value of 1 of each inertial parameter: one entry
/// a parameter where nothing changes with time (an arm of one joint), else one for each sample and parameter.
#[derive(Clone, Debug)]
pub(super) struct Body {
    terms: Vec<Moved>,
    parameters: usize,
}

impl Body {
    /// With values of the parameters: one entry, or one a sample.
    #[must_use]
    pub(super) fn with(&self, values: &[f64]) -> Vec<Moved> {
        let sum = |terms: &[Moved]| {
            let mut sum = Moved::default();
            terms.iter().zip(values).for_each(|(term, value)| sum.add(term, *value));
            sum
        };
        if self.parameters == 0 {
            return vec![Moved::default()];
        }
        self.terms.chunks(self.parameters).map(sum).collect()
    }

    /// The mean square that each parameter at 1 adds to the joint's torque along measured motion.
    #[must_use]
    pub(super) fn powers(&self, q: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.parameters];
        for (k, q) in q.iter().enumerate() {
            let at = if self.terms.len() == self.parameters { 0 } else { k * self.parameters };
            for (sum, term) in sums.iter_mut().zip(&self.terms[at..]) {
                *sum += term.rest(*q).powi(2) + term.inertia.powi(2);
            }
        }
        sums.iter().map(|sum| sum / q.len().max(1) as f64).collect()
    }
}

/// The bodies of a joint along the pieces of a log.
#[must_use]
pub(super) fn bodies(arm: &RigidArm, log: &ServoLog, joint: usize, pieces: &[Range<usize>]) -> Vec<Body> {
    if arm.dof() == 1 {
        let one = body(arm, joint, &[vec![0.0]], &[vec![0.0]], &[vec![0.0]]);
        return pieces.iter().map(|_| one.clone()).collect();
    }
    let of_piece = |piece: &Range<usize>| {
        let [q, v, a] = motion(log, piece);
        body(arm, joint, &q, &v, &a)
    };
    pieces.iter().map(of_piece).collect()
}

/// Positions, smooth velocities and accelerations of all joints at the samples of a piece, by joint.
fn motion(log: &ServoLog, piece: &Range<usize>) -> [Vec<Vec<f64>>; 3] {
    let t = &log.t[piece.clone()];
    let of_joint = |q: &Vec<f64>| -> [Vec<f64>; 3] {
        let q = &q[piece.clone()];
        let Some((start, step, count)) = even_grid(t) else {
            return [q.to_vec(), vec![0.0; t.len()], vec![0.0; t.len()]];
        };
        let even = cubic(t, q, start, step, count);
        let smooth = match Butterworth::low_pass(4, BAND.min(OF_RATE / step), 1.0 / step) {
            Some(filter) => filter.zero_phase(&even),
            None => even,
        };
        let at_samples =
            |x: &[f64]| t.iter().map(|t| x[(((t - start) / step).round() as usize).min(count - 1)]).collect();
        [q.to_vec(), at_samples(&derivative(&smooth, step)), at_samples(&second_derivative(&smooth, step))]
    };
    let by_joint: Vec<[Vec<f64>; 3]> = log.q.iter().map(of_joint).collect();
    [0, 1, 2].map(|k| by_joint.iter().map(|own| own[k].clone()).collect())
}

fn body(arm: &RigidArm, joint: usize, q: &[Vec<f64>], v: &[Vec<f64>], a: &[Vec<f64>]) -> Body {
    let (n, p, samples) = (arm.dof(), arm.names().len(), q[0].len());
    let states =
        |x: &[Vec<f64>]| -> Vec<f64> { (0..samples).flat_map(|k| x.iter().map(move |x| x[k])).collect() };
    let (mut q, v, mut a) = (states(q), states(v), states(a));
    let set = |x: &mut Vec<f64>, value: f64| x.chunks_mut(n).for_each(|state| state[joint] = value);
    let row = |rows: &[f64], k: usize, c: usize| rows[(k * n + joint) * p + c];
    set(&mut a, 0.0);
    let mut terms = vec![Moved::default(); samples * p];
    for m in 0..HARMONICS {
        let angle = TAU * m as f64 / HARMONICS as f64;
        set(&mut q, angle);
        let rows = arm.regressor(&q, &v, &a);
        let weights = [0.5, angle.cos(), angle.sin(), (2.0 * angle).cos(), (2.0 * angle).sin()];
        for (at, term) in terms.iter_mut().enumerate() {
            let value = row(&rows, at / p, at % p);
            for (own, weight) in term.harmonics.iter_mut().zip(weights) {
                *own += 2.0 / HARMONICS as f64 * weight * value;
            }
        }
        if m == 0 {
            set(&mut a, 1.0);
            let pushed = arm.regressor(&q, &v, &a);
            set(&mut a, 0.0);
            let push = |at: usize| row(&pushed, at / p, at % p) - row(&rows, at / p, at % p);
            terms.iter_mut().enumerate().for_each(|(at, term)| term.inertia = push(at));
        }
    }
    Body { terms, parameters: p }
}
