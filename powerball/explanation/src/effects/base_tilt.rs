//! Gravity that does not point where the arm file says: the base is not level.

use super::words::{Words, number};
use super::{Axis, Candidate, Class, Context, Effect, Found, Part};
use dyngen::arm::ParameterKind;
use dyngen::exact::rational;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::Solver;
use powerball_logs::regression::{Column, PULLED, Signals};
use powerball_logs::vector::dot;
use serde::Serialize;
use std::sync::Arc;

/// Two columns: the change of gravity torque for a small turn of the base about its x and y axes.
///
/// A base turned by ω sees gravity turned by −ω: Δg = −ω × g. What the arm's own gravity never shows, such as
/// the way of a link's weight from an upright first axis, acts too once gravity is turned; it is unknown, so
/// that its products with the tilt are columns of their own ([`Settings::unshown`]).
pub(super) struct BaseTilt;

/// Settings of this effect: what is fitted in addition to the tilt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Whether the parameters that level gravity does not show are fitted too
    /// ([`RigidArm::gravity_unobservable`](powerball_logs::regression::RigidArm::gravity_unobservable)).
    pub unshown: bool,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The turn of the base about its x and y axes, rad.
    pub tilt: [f64; 2],
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, _: &Words<'_>) -> String {
        format!("{} rad about x, {} rad about y", number(self.tilt[0]), number(self.tilt[1]))
    }
}

impl Effect for BaseTilt {
    fn name(&self) -> &'static str {
        "base_tilt"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn of_the_body(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let joints: Vec<JointNumber> = context.moving_joints().collect();
        let weightless = context.data.body.arm().gravity.iter().all(|g| rational::to_f64(g) == 0.0);
        if joints.is_empty() || weightless {
            return Vec::new();
        }
        let kinds: &[bool] =
            if context.data.body.gravity_unobservable().is_empty() { &[false] } else { &[false, true] };
        let with = |unshown: &bool| Candidate::on_all(joints.clone(), Settings { unshown: *unshown }, 1);
        kinds.iter().map(with).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let body = context.data.body;
        let (turns, all) = (turns(context), body.carried(context.fit.inertial()));
        let unshown: &[Vec<f64>] = if with_unshown(candidate) { body.gravity_unobservable() } else { &[] };
        let known = turns.iter().map(|turn| pulled(context, turn, &all));
        // A turn about the other axis has the same columns, of other parameters.
        let unknown = unshown.iter().map(|direction| pulled(context, &turns[0], direction));
        known.chain(unknown).collect::<Option<Vec<_>>>().unwrap_or_default()
    }

    fn part(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Part {
        let turns = turns(context);
        let gravity = &context.data.body.arm().gravity;
        let (tilt, unshown) = c.split_at(2);
        let change = |k: usize| turns.iter().zip(tilt).map(|(turn, c)| c * turn[k]).sum::<f64>();
        let found = if with_unshown(candidate) { moments(context, tilt, unshown) } else { Vec::new() };
        Part::Gravity([0, 1, 2].map(|k| rational::to_f64(&gravity[k]) + change(k)), found)
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c.iter().take(2).all(|t| t.abs() < 0.5)
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let tilt = match found.first().map(|f| f.coefficients) {
            Some([x, y, ..]) => [*x, *y],
            _ => [0.0; 2],
        };
        Figures { tilt }.into()
    }
}

fn with_unshown(candidate: &Candidate) -> bool {
    Settings::of(candidate).is_some_and(|settings| settings.unshown)
}

/// The static torque of some parameters under some gravity.
fn pulled(context: &Context<'_>, gravity: &[f64; 3], all: &[f64]) -> Option<Column> {
    let data = context.data;
    let mut torque = Signals::zeros(data);
    for (axis, g) in gravity.iter().enumerate().filter(|(_, g)| **g != 0.0) {
        let columns = data.pull_columns(axis);
        let values = all.chunks_exact(ParameterKind::ALL.len()).flat_map(|link| &link[..PULLED]);
        if columns.is_empty() {
            return None;
        }
        columns
            .iter()
            .zip(values)
            .filter(|(_, v)| **v != 0.0)
            .for_each(|(c, v)| c.add_to(&mut torque, g * v));
    }
    Some(Column { parts: torque.0.into_iter().map(Arc::new).enumerate().collect() })
}

/// What all parameters gain where the unshown ones' torques are those found: under the whole tilt they are
/// the ones of a given amount of each direction.
fn moments(context: &Context<'_>, tilt: &[f64], found: &[f64]) -> Vec<f64> {
    let gravity_unobservable = context.data.body.gravity_unobservable();
    let turns = turns(context);
    let whole = [0, 1, 2].map(|k| turns.iter().zip(tilt).map(|(turn, t)| t * turn[k]).sum::<f64>());
    let under = |gravity: &[f64; 3]| -> Vec<Column> {
        gravity_unobservable.iter().filter_map(|direction| pulled(context, gravity, direction)).collect()
    };
    let (own, unit) = (under(&whole), under(&turns[0]));
    if own.len() < gravity_unobservable.len() || unit.len() < gravity_unobservable.len() {
        return Vec::new();
    }
    let product = |a: &Column, b: &Column| -> f64 {
        a.parts.iter().zip(&b.parts).map(|((_, a), (_, b))| dot(a, b)).sum()
    };
    let gram = Mat::from_fn(own.len(), own.len(), |a, b| product(&own[a], &own[b]));
    let right: Vec<f64> =
        own.iter().map(|column| unit.iter().zip(found).map(|(u, c)| c * product(column, u)).sum()).collect();
    let much = Solver::new(&gram, |_| true).solve(&right);
    let gain = |k: usize| gravity_unobservable.iter().zip(&much).map(|(direction, m)| m * direction[k]).sum();
    (0..context.data.body.arm().all_parameters().len()).map(gain).collect()
}

/// The change of gravity for a turn about x and about y: −(e_x × g) and −(e_y × g).
fn turns(context: &Context<'_>) -> [[f64; 3]; 2] {
    let [x, y, z] = [0, 1, 2].map(|k| rational::to_f64(&context.data.body.arm().gravity[k]));
    [[0.0, z, -y], [-z, 0.0, x]]
}
