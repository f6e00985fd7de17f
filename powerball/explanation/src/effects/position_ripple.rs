//! Torque that is periodic in a joint's or its motor's position: gear teeth, wave generators, cogging.

use super::words::{Words, number};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::rule::Rule;
use dyngen::exact::rational;
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use powerball_logs::regression::Data;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// τ = a·cos(k·q) + b·sin(k·q), k ≥ 2 cycles a joint turn.
///
/// k = 1 is left out: an arm's own weight turns that way.
pub(crate) struct PositionRipple;

/// Settings of this effect, which the search varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// k, cycles a joint turn.
    pub order: f64,
}

/// Figures of this effect in a result, one entry per ripple.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// N·m.
    pub amplitudes: Vec<f64>,
    /// The joints.
    pub joints: Vec<JointNumber>,
    /// Cycles a joint turn.
    pub orders: Vec<f64>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        // Of a joint that slides the order counts on 2π m.
        let (way, orders) = if words.slides { ("m", 1.0 / std::f64::consts::TAU) } else { ("turn", 1.0) };
        let several = self.joints.iter().any(|joint| *joint != self.joints[0]);
        let one = |(k, ((amplitude, joint), order)): (usize, ((&f64, &JointNumber), &f64))| {
            let of = if several { format!(" (joint {joint})") } else { String::new() };
            let size = words.size(k, *amplitude);
            format!("{size} {}, {} cycles a {way}{of}", words.torque(), number(orders * order))
        };
        let all = self.amplitudes.iter().zip(&self.joints).zip(&self.orders).enumerate().map(one);
        all.collect::<Vec<_>>().join("; ")
    }
}

/// Whole orders up to here are tried one by one, higher ones are found by a scan.
const SMALL_ORDERS: usize = 20;
/// Bins of a turn in the scan: orders up to half of it.
pub(crate) const BINS: usize = 2048;
/// Two ripples of a joint whose orders differ by less than this are one.
const SAME_ORDER: f64 = 0.5;
/// Peaks of the scan that are examined closely.
const PEAKS: usize = 4;

impl Effect for PositionRipple {
    fn name(&self) -> &'static str {
        "position_ripple"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Cycle(order(candidate))
    }

    /// A ripple of many cycles along the path resembles nothing else.
    fn is_function_of_path(&self, candidate: &Candidate, data: &Data<'_>, rule: &Rule) -> bool {
        cycles(data, candidate.joints[0], order(candidate)) < rule.few_cycles
    }

    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.joints == b.joints && (order(a) - order(b)).abs() < SAME_ORDER
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let mut candidates = Vec::new();
        for j in context.moving_joints() {
            for k in (2..=SMALL_ORDERS).filter(|k| cycles(context.data, j, *k as f64) >= 1.0) {
                candidates.push(Candidate::on(j, Settings { order: k as f64 }, SMALL_ORDERS));
            }
            // Orders of the motor and of twice the motor (a wave generator has two lobes).
            if let Some(ratio) = &context.data.body.arm().joints[j.index()].rotor_ratio {
                let ratio = rational::to_f64(ratio).abs();
                for k in [ratio, 2.0 * ratio].into_iter().filter(|k| *k > SMALL_ORDERS as f64) {
                    candidates.push(Candidate::on(j, Settings { order: k }, SMALL_ORDERS));
                }
            }
            for order in scan(context, j.index()) {
                candidates.push(Candidate::on(j, Settings { order }, BINS / 2));
            }
        }
        candidates
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let order = order(candidate);
        vec![Law::Cosine { order }, Law::Sine { order }]
    }

    fn neighbours(&self, candidate: &Candidate, share: f64) -> Vec<Candidate> {
        let order = order(candidate);
        let near = |d: f64| candidate.with(Settings { order: order + share * d });
        if order < SMALL_ORDERS as f64 {
            return Vec::new();
        }
        [-0.3, -0.1, -0.03, 0.03, 0.1, 0.3].map(near).to_vec()
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures {
            amplitudes: found.iter().map(|f| f.coefficients[0].hypot(f.coefficients[1])).collect(),
            joints: found.iter().map(|f| f.candidate.joints[0]).collect(),
            orders: found.iter().map(|f| order(f.candidate)).collect(),
        }
        .into()
    }
}

/// The order of a candidate of this effect.
fn order(candidate: &Candidate) -> f64 {
    Settings::of(candidate).map_or(f64::NAN, |settings| settings.order)
}

/// Cycles of an order along a joint's travel: less than one cycle cannot show that it repeats.
fn cycles(data: &Data<'_>, joint: JointNumber, order: f64) -> f64 {
    let positions = data.recordings.iter().flat_map(|r| r.position(joint.index()));
    let (low, high) = positions.fold((f64::MAX, f64::MIN), |(l, h): (f64, f64), q| (l.min(q), h.max(q)));
    order * (high - low) / TAU
}

/// The orders above [`SMALL_ORDERS`] at which the residual, sorted by position, oscillates most.
fn scan(context: &Context<'_>, joint: usize) -> Vec<f64> {
    let data = context.data;
    let rows = &data.joints[joint];
    let mut positions = Vec::with_capacity(rows.len());
    for (r, recording) in data.recordings.iter().enumerate() {
        let q: Vec<f64> = recording.position(joint).collect();
        let kept = rows.band.kept(recording.len());
        positions.extend(rows.kept[r].iter().map(|k| q[kept[*k]]));
    }
    let samples = || positions.iter().copied().zip(context.residual[joint].iter().copied());
    let Some(spectrum) = Spectrum::new(samples) else { return Vec::new() };
    let power: Vec<f64> = spectrum.values.iter().map(Complex::norm_sqr).collect();
    let mut peaks: Vec<usize> = (1..power.len() - 1)
        .filter(|k| spectrum.order(*k) > SMALL_ORDERS as f64)
        .filter(|k| power[*k] > power[k - 1] && power[*k] >= power[k + 1])
        .collect();
    peaks.sort_by(|a, b| power[*b].total_cmp(&power[*a]));
    peaks
        .into_iter()
        .take(PEAKS)
        .map(|k| {
            // The top of the parabola through the peak and its neighbours.
            let (a, b, c) = (power[k - 1], power[k], power[k + 1]);
            let shift = if a - 2.0 * b + c == 0.0 { 0.0 } else { 0.5 * (a - c) / (a - 2.0 * b + c) };
            spectrum.order(k) + shift * spectrum.order(1)
        })
        .collect()
}

/// A joint's torque by order: Σ τ·e^(−i·k·q) over samples.
pub(crate) struct Spectrum {
    /// The spectrum's values, up to the order of half a cycle a bin of position.
    pub(crate) values: Vec<Complex<f64>>,
    step: f64,
}

impl Spectrum {
    /// Made from positions and torques, which are read twice; `None` if the positions hardly differ, or by
    /// many turns.
    pub(crate) fn new<I: Iterator<Item = (f64, f64)>>(samples: impl Fn() -> I) -> Option<Spectrum> {
        let (low, high) = samples().fold((f64::MAX, f64::MIN), |(l, h), (q, _)| (l.min(q), h.max(q)));
        let width = TAU / BINS as f64;
        if high - low <= 20.0 * width || high - low > 100.0 {
            return None;
        }
        let bins = ((high - low) / width) as usize + 1;
        let length = (4 * bins).next_power_of_two().max(4 * BINS);
        let mut signal = vec![Complex::new(0.0, 0.0); length];
        for (q, torque) in samples() {
            signal[((q - low) / width) as usize] += Complex::new(torque, 0.0);
        }
        FftPlanner::new().plan_fft_forward(length).process(&mut signal);
        signal.truncate(length / 2);
        Some(Spectrum { values: signal, step: BINS as f64 / length as f64 })
    }

    /// The order of a value, cycles a joint turn.
    pub(crate) fn order(&self, k: usize) -> f64 {
        k as f64 * self.step
    }
}
