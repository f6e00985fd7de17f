//! Torque and position that were not sampled at the same time.

use super::words::Words;
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found, Part};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_logs::regression::{Column, Data};
use serde::Serialize;
use std::ops::Range;

/// τ = τ_model(t − d) − τ_model(t), its coefficient near 1: all joints alike or one joint.
///
/// A positive delay means that the logged torque is late.
pub(super) struct TimeDelay;

/// Settings of this effect: the point at which the shifted torque is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// d, s.
    pub delay: f64,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Delay of the logged torque, s.
    pub delay: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        format!("{} ms", words.sizes(&self.delay.0, 1e3))
    }
}

/// Starting values, s; the coefficient makes each a third to three times as long. Filters and gateways make
/// torque late by a tenth of a second and more.
const DELAYS: [f64; 9] = [0.000_8, 0.003, 0.008, 0.02, 0.06, 0.12, -0.000_8, -0.003, -0.01];

impl Effect for TimeDelay {
    fn name(&self) -> &'static str {
        "time_delay"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::TorqueRate
    }

    /// `false`: one path may be run early or late.
    fn is_function_of_path(&self, _: &Candidate, _: &Data<'_>, _: &Rule) -> bool {
        false
    }

    fn change_of_a_log(&self, candidate: &Candidate) -> Option<(f64, Range<f64>)> {
        Some((delay(candidate), 0.3..3.0))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let all: Vec<JointNumber> = context.moving_joints().collect();
        let mut candidates = Vec::new();
        for delay in DELAYS {
            candidates.push(Candidate::on_all(all.clone(), Settings { delay }, DELAYS.len()));
            candidates.extend(all.iter().map(|j| Candidate::on(*j, Settings { delay }, DELAYS.len())));
        }
        candidates
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let n = context.data.dof();
        let shift = delay(candidate) * context.data.rate();
        let prediction = context.prediction();
        let parts = candidate.joints.iter().map(|j| {
            let j = j.index();
            let column = context.data.column_on(j, |r, _| {
                let torque: Vec<f64> = prediction[r].iter().skip(j).step_by(n).copied().collect();
                later(&torque, shift).iter().zip(&torque).map(|(late, now)| late - now).collect()
            });
            column.parts.into_iter().next().unwrap_or_default()
        });
        vec![Column { parts: parts.collect() }]
    }

    fn part(&self, _: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Part {
        Part::Delay(delay(candidate) * c[0])
    }

    fn admissible(&self, candidate: &Candidate, c: &[f64]) -> bool {
        // The shifted torque must be seen whole, or the shift is another; below 10 µs nothing is late.
        (0.3..3.0).contains(&c[0]) && (c[0] * delay(candidate)).abs() > 1e-5
    }

    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let delay = delay(candidate) * c[0].clamp(0.3, 3.0);
        Some(candidate.with(Settings { delay }))
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures { delay: ByJoint::of(found, |f| delay(f.candidate) * f.coefficients[0]) }.into()
    }
}

fn delay(candidate: &Candidate) -> f64 {
    Settings::of(candidate).map_or(f64::NAN, |settings| settings.delay)
}

/// Samples that a value between samples is computed from.
const AROUND: isize = 8;

/// A signal that is late by a number of samples; the first or last value beyond its ends.
///
/// By the polynomial through the [`AROUND`] nearest samples: a straight line between two of them makes a
/// signal also weaker where it is fast, by 19 % at half a sample and a fifth of the sample rate, and a log
/// whose torque is weaker there would seem to be late.
pub(crate) fn later(x: &[f64], by: f64) -> Vec<f64> {
    let Some(last) = x.len().checked_sub(1) else { return Vec::new() };
    let (whole, part) = (by.ceil() as isize, by.ceil() - by);
    let near = || 1 - AROUND / 2..=AROUND / 2;
    let weight = |m: isize| -> f64 {
        near().filter(|other| *other != m).map(|other| (part - other as f64) / (m - other) as f64).product()
    };
    let weights: Vec<(isize, f64)> = near().map(|m| (m.saturating_sub(whole), weight(m))).collect();
    let at = |k: usize| {
        let sample = |(m, w): &(isize, f64)| w * x[k.saturating_add_signed(*m).min(last)];
        weights.iter().map(sample).sum()
    };
    (0..x.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::later;
    use std::f64::consts::TAU;

    /// A wave that is late by a part of a sample is as strong as before, up to the band of the rows.
    #[test]
    fn what_is_late_is_as_strong_as_before() {
        for (cycles, most) in [(0.02, 1e-8), (0.1, 2e-4), (0.2, 6e-3)] {
            let wave = |by: f64| -> Vec<f64> {
                (0..500).map(|k| (TAU * cycles * (f64::from(k) - by)).sin()).collect()
            };
            for by in [0.5, 3.3, -0.4, -7.0] {
                let (late, truth) = (later(&wave(0.0), by), wave(by));
                let error = (10..490).map(|k| (late[k] - truth[k]).abs()).fold(0.0, f64::max);
                assert!(error < most, "{cycles} cycles a sample, {by} samples: {error}");
            }
        }
    }

    #[test]
    fn a_signal_goes_on_beyond_its_ends() {
        assert_eq!(later(&[1.0, 2.0, 4.0], 5.0), [1.0; 3]);
        assert_eq!(later(&[1.0, 2.0, 4.0], -5.0), [4.0; 3]);
        assert_eq!(later(&[1.0, 2.0, 4.0], 1.0), [1.0, 1.0, 2.0]);
        approx::assert_relative_eq!(later(&[3.0], 0.5)[0], 3.0, max_relative = 1e-12);
        assert!(later(&[], 0.5).is_empty());
    }
}
