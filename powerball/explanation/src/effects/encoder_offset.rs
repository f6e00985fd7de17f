//! A joint whose zero is wrong: the arm is not at the logged position.

use super::words::Words;
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found, Part};
use powerball_logs::regression::{Column, Recording};
use serde::Serialize;
use std::ops::Range;

/// τ = (τ_rigid(q − o) − τ_rigid(q))/o with coefficient o: logged position = true position + o.
pub(super) struct EncoderOffset;

/// Settings of this effect: the point at which the secant is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The offset that the column is taken about, rad.
    pub about: f64,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Logged less true position, rad.
    pub offset: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        format!("{} {}", words.sizes(&self.offset.0, 1.0), words.position())
    }
}

/// The offset at which the first secant is taken, rad.
const FIRST: f64 = 0.01;
/// Larger offsets are mounting errors that everybody sees.
const MOST: f64 = 0.5;

impl Effect for EncoderOffset {
    fn name(&self) -> &'static str {
        "encoder_offset"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn change_of_a_log(&self, _: &Candidate) -> Option<(f64, Range<f64>)> {
        Some((1.0, -MOST..MOST))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        context.moving_joints().map(|j| Candidate::on(j, Settings { about: FIRST }, 1)).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let Some(Settings { about: offset }) = Settings::of(candidate) else { return Vec::new() };
        let j = candidate.joints[0].index();
        let shifted = |r: &Recording| {
            let mut q = r.q.clone();
            q.iter_mut().skip(j).step_by(r.dof).for_each(|q| *q -= offset);
            context.fit.rigid_torque(context.data.body, &q, &r.v, &r.a)
        };
        let difference: Vec<Vec<f64>> = context
            .data
            .recordings
            .iter()
            .zip(context.rigid())
            .map(|(r, rigid)| shifted(r).iter().zip(rigid).map(|(a, b)| (a - b) / offset).collect())
            .collect();
        vec![context.data.column_over_all(&difference)]
    }

    fn part(&self, _: &Context<'_>, _: &Candidate, c: &[f64]) -> Part {
        Part::EncoderOffset(c[0])
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c[0].abs() < MOST
    }

    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let about = c[0].clamp(-MOST, MOST);
        (about.abs() > 1e-5).then(|| candidate.with(Settings { about }))
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures { offset: ByJoint::of(found, |f| f.coefficients[0]) }.into()
    }
}
