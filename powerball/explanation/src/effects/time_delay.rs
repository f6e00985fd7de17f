//! Torque and position that were not sampled at the same time.

use super::words::Words;
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found, Part};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_logs::regression::{Column, Data};
use powerball_logs::signal::resample::later;
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
