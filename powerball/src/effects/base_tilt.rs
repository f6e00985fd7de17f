//! Gravity that does not point where the arm file says: the base is not level.

use super::{Axis, Candidate, Class, Context, Effect, Found, Part};
use crate::regression::Column;
use dyngen::exact::rational;
use serde_json::{Value, json};

/// Two columns: the change of gravity torque for a small turn of the base about its x and y axes.
///
/// A base turned by ω sees gravity turned by −ω: Δg = −ω × g.
pub(super) struct BaseTilt;

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
        let joints: Vec<usize> = context.moving_joints().collect();
        let weightless = context.data.body.arm().gravity.iter().all(|g| rational::to_f64(g) == 0.0);
        if joints.is_empty() || weightless {
            return Vec::new();
        }
        vec![Candidate { joints, ..Candidate::on(0, 0, Vec::new(), 1) }]
    }

    fn columns(&self, context: &Context<'_>, _: &Candidate) -> Vec<Column> {
        let data = context.data;
        let turns = turns(context);
        let all = data.body.carried(context.fit.inertial());
        let carriers: Vec<usize> = (0..all.len()).filter(|k| all[*k] != 0.0 && k % 11 < 4).collect();
        let unit = |axis: usize| -> Option<Vec<Vec<f64>>> {
            data.recordings
                .iter()
                .map(|r| {
                    let columns = data.body.gravity_columns(axis, &carriers, &r.q)?;
                    let sum = |row: &[f64]| row.iter().zip(&carriers).map(|(c, k)| c * all[*k]).sum();
                    Some(columns.chunks_exact(carriers.len().max(1)).map(sum).collect())
                })
                .collect()
        };
        let Some(units) = (0..3).map(unit).collect::<Option<Vec<_>>>() else { return Vec::new() };
        turns
            .iter()
            .map(|turn| {
                let mixed: Vec<Vec<f64>> = (0..data.recordings.len())
                    .map(|r| {
                        let sum = |k: usize| (0..3).map(|axis| turn[axis] * units[axis][r][k]).sum();
                        (0..units[0][r].len()).map(sum).collect()
                    })
                    .collect();
                data.column_over_all(&mixed)
            })
            .collect()
    }

    fn part(&self, context: &Context<'_>, _: &Candidate, c: &[f64]) -> Part {
        let turns = turns(context);
        let gravity = &context.data.body.arm().gravity;
        Part::Gravity([0, 1, 2].map(|k| {
            rational::to_f64(&gravity[k]) + turns.iter().zip(c).map(|(turn, c)| c * turn[k]).sum::<f64>()
        }))
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c.iter().all(|t| t.abs() < 0.5)
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({ "tilt": found.first().map(|f| f.coefficients.to_vec()).unwrap_or_default() })
    }
}

/// The change of gravity for a turn about x and about y: −(e_x × g) and −(e_y × g).
fn turns(context: &Context<'_>) -> [[f64; 3]; 2] {
    let [x, y, z] = [0, 1, 2].map(|k| rational::to_f64(&context.data.body.arm().gravity[k]));
    [[0.0, z, -y], [-z, 0.0, x]]
}
