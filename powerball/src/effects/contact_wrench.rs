//! An outside force on the last link during some time: a touch, a push, a thing leaned on.

use super::candidate::Window;
use super::payload::{block_start, mask};
use super::window_sums::Sums;
use super::{Axis, Candidate, Class, Context, Effect, Found, Part};
use crate::estimate::Solver;
use crate::regression::Column;
use serde_json::{Value, json};

/// A constant force in the base frame at the last frame's origin, during a window of one log.
pub(super) struct ContactWrench;

/// Windows begin and end on a grid of this, s.
const GRID: f64 = 0.5;
/// Longest window in grid steps: what lasts longer is a payload or no event.
const LONGEST: usize = 16;
/// Larger forces are a rank-poor fit, N.
const MOST: f64 = 2000.0;

impl Effect for ContactWrench {
    fn name(&self) -> &'static str {
        "contact_wrench"
    }

    fn class(&self) -> Class {
        Class::Event
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Time
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        search(context).into_iter().collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let masks: Vec<Vec<f64>> =
            (0..context.data.dof()).map(|j| mask(context, j, &candidate.windows)).collect();
        let cut = |column: &Column| Column {
            parts: column
                .parts
                .iter()
                .map(|(j, values)| (*j, values.iter().zip(&masks[*j]).map(|(v, m)| v * m).collect()))
                .collect(),
        };
        context.data.force_columns().iter().map(cut).collect()
    }

    fn part(&self, _: &Context<'_>, _: &Candidate, _: &[f64]) -> Part {
        Part::Event
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c.iter().all(|f| f.abs() < MOST)
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let windows = || found.iter().flat_map(|f| &f.candidate.windows);
        json!({
            "force": found.iter().map(|f| f.coefficients.to_vec()).collect::<Vec<_>>(),
            "start_time": windows().map(|w| w.from).collect::<Vec<_>>(),
            "end_time": windows().map(|w| w.to).collect::<Vec<_>>(),
        })
    }
}

/// The window that explains most.
fn search(context: &Context<'_>) -> Option<Candidate> {
    let (data, fit) = (context.data, context.fit);
    let columns = data.force_columns();
    if columns.len() < 3 {
        return None;
    }
    let (gram, _, _) = fit.gram.sum(&fit.weights, |_| true);
    let solver = Solver::new(&gram, |c| fit.free[c]);
    let steps = data.blocks_of(GRID);
    let sums: Vec<Sums> = steps.iter().map(|b| Sums::of_block(context, columns, b)).collect();
    let (mut best, mut found) = (0.0, None);
    let mut searched = 0.0;
    for first in 0..steps.len() {
        let mut window = Sums::zero(fit.design.size, 3);
        for last in first..(first + LONGEST).min(steps.len()) {
            if steps[last].log != steps[first].log {
                break;
            }
            window.add(&sums[last], 1.0);
            searched += 1.0;
            let (gain, force) = window.gain(&solver);
            if gain > best && force.iter().all(|f| f.abs() < MOST) {
                (best, found) = (gain, Some((first, last)));
            }
        }
    }
    let (first, last) = found?;
    let from = block_start(context, &steps[first])?;
    let step = 1.0 / data.rate();
    // To the last row before the next step begins.
    let next = steps.get(last + 1).filter(|s| s.log == steps[last].log);
    let to = next.and_then(|s| block_start(context, s)).map_or(f64::MAX, |t| t - 0.5 * step);
    let window = Window::new(
        data,
        steps[first].log,
        from,
        if to == f64::MAX { end_of_log(context, steps[last].log) } else { to },
    );
    let joints = (0..data.dof()).collect();
    Some(Candidate { joints, form: 0, values: Vec::new(), windows: vec![window], searched })
}

fn end_of_log(context: &Context<'_>, log: usize) -> f64 {
    let end = |r: &crate::regression::Recording| r.start + r.len() as f64 / r.rate;
    context.data.recordings.iter().filter(|r| r.log == log).map(end).fold(0.0, f64::max)
}
