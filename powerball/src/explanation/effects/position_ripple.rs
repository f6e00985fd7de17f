//! Torque that is periodic in a joint's or its motor's position: gear teeth, wave generators, cogging.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use dyngen::exact::rational;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use serde_json::{Value, json};
use std::f64::consts::PI;

/// τ = a·cos(k·q) + b·sin(k·q), k ≥ 2 cycles a joint turn.
///
/// k = 1 is left out: an arm's own weight turns that way.
pub(super) struct PositionRipple;

/// Whole orders up to here are tried one by one, higher ones are found by a scan.
const SMALL_ORDERS: usize = 20;
/// Bins of a turn in the scan: orders up to half of it.
const BINS: usize = 2048;
/// Peaks of the scan that are looked at closely.
const PEAKS: usize = 4;

impl Effect for PositionRipple {
    fn name(&self) -> &'static str {
        "position_ripple"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Cycle(candidate.values[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let mut candidates = Vec::new();
        for j in context.moving_joints() {
            for k in 2..=SMALL_ORDERS {
                candidates.push(Candidate::on(j, 0, vec![k as f64], SMALL_ORDERS));
            }
            // Orders of the motor and of twice the motor (a wave generator has two lobes).
            if let Some(ratio) = &context.data.body.arm().joints[j].rotor_ratio {
                let ratio = rational::to_f64(ratio).abs();
                for k in [ratio, 2.0 * ratio].into_iter().filter(|k| *k > SMALL_ORDERS as f64) {
                    candidates.push(Candidate::on(j, 0, vec![k], SMALL_ORDERS));
                }
            }
            for order in scan(context, j) {
                candidates.push(Candidate::on(j, 0, vec![order], BINS / 2));
            }
        }
        candidates
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let order = candidate.values[0];
        vec![Law::Cosine { order }, Law::Sine { order }]
    }

    fn neighbours(&self, candidate: &Candidate) -> Vec<Candidate> {
        let k = candidate.values[0];
        let near = |d: f64| Candidate { values: vec![k + d], ..candidate.clone() };
        if k < SMALL_ORDERS as f64 {
            return Vec::new();
        }
        [-0.3, -0.1, -0.03, 0.03, 0.1, 0.3].map(near).to_vec()
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({
            "orders": found.iter().map(|f| f.candidate.values[0]).collect::<Vec<_>>(),
            "amplitudes": found.iter().map(|f| f.coefficients[0].hypot(f.coefficients[1])).collect::<Vec<_>>(),
            "joints": found.iter().map(|f| f.candidate.joints[0] + 1).collect::<Vec<_>>(),
        })
    }
}

/// The orders above [`SMALL_ORDERS`] at which the residual, sorted by position, oscillates most.
fn scan(context: &Context<'_>, joint: usize) -> Vec<f64> {
    let data = context.data;
    let rows = &data.joints[joint];
    let residual = &context.residual[joint];
    let mut positions = Vec::with_capacity(rows.len());
    for (r, recording) in data.recordings.iter().enumerate() {
        let q: Vec<f64> = recording.position(joint).collect();
        let kept = data.band.kept(recording.len());
        positions.extend(rows.kept[r].iter().map(|k| q[kept[*k]]));
    }
    let (low, high) = positions.iter().fold((f64::MAX, f64::MIN), |(l, h), q| (l.min(*q), h.max(*q)));
    let width = 2.0 * PI / BINS as f64;
    if high - low <= 20.0 * width || high - low > 100.0 {
        return Vec::new();
    }
    let bins = ((high - low) / width) as usize + 1;
    let length = (4 * bins).next_power_of_two().max(4 * BINS);
    let mut signal = vec![Complex::new(0.0, 0.0); length];
    for (q, r) in positions.iter().zip(residual) {
        signal[((q - low) / width) as usize] += Complex::new(*r, 0.0);
    }
    FftPlanner::new().plan_fft_forward(length).process(&mut signal);
    let order = |k: usize| k as f64 * BINS as f64 / length as f64;
    let power: Vec<f64> = signal[..length / 2].iter().map(Complex::norm_sqr).collect();
    let mut peaks: Vec<usize> = (1..power.len() - 1)
        .filter(|k| order(*k) > SMALL_ORDERS as f64 && power[*k] > power[k - 1] && power[*k] >= power[k + 1])
        .collect();
    peaks.sort_by(|a, b| power[*b].total_cmp(&power[*a]));
    peaks
        .into_iter()
        .take(PEAKS)
        .map(|k| {
            // The top of the parabola through the peak and its neighbours.
            let (a, b, c) = (power[k - 1], power[k], power[k + 1]);
            let shift = if a - 2.0 * b + c == 0.0 { 0.0 } else { 0.5 * (a - c) / (a - 2.0 * b + c) };
            order(k) + shift * order(1)
        })
        .collect()
}
