//! A body held by the last link, from the start of a log or from some time on.

use super::candidate::{Candidate, Found, Window};
use super::{Class, Context, Effect};
use crate::estimate::Solver;
use crate::regression::Column;
use serde_json::{Value, json};

/// Mass and first moment in the last frame as four columns; the inertia is that of a point mass at the centre of mass
/// last estimated (`values`), so a few rounds make it consistent.
pub(super) struct Payload;

/// A centre of mass farther than this from the flange, m, is no payload.
const REACH: f64 = 1.0;
/// Another log has the same payload if that explains this much more (in units of χ²).
const ANOTHER_LOG: f64 = 10.0;

impl Effect for Payload {
    fn name(&self) -> &'static str {
        "payload"
    }

    fn class(&self) -> Class {
        Class::Event
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        search(context).into_iter().collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let columns = payload_columns(context, &candidate.values);
        let n = context.data.dof();
        let masks: Vec<Vec<f64>> = (0..n).map(|j| mask(context, j, &candidate.windows)).collect();
        let cut = |column: &Column| Column {
            parts: column
                .parts
                .iter()
                .map(|(j, values)| (*j, values.iter().zip(&masks[*j]).map(|(v, m)| v * m).collect()))
                .collect(),
        };
        columns.iter().map(cut).collect()
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c[0] > 0.0 && c[1..].iter().all(|h| h.abs() < REACH * c[0])
    }

    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        (c[0] > 0.0).then(|| Candidate {
            values: c[1..].iter().map(|h| (h / c[0]).clamp(-REACH, REACH)).collect(),
            ..candidate.clone()
        })
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let Some(first) = found.first() else { return Value::Null };
        let c = first.coefficients;
        let com: Vec<f64> = c[1..].iter().map(|h| if c[0] != 0.0 { h / c[0] } else { 0.0 }).collect();
        let starts: Vec<f64> = first.candidate.windows.iter().map(|w| w.from).collect();
        json!({ "mass": c[0], "com": com, "start_time": starts })
    }
}

/// Columns for mass and first moments with the inertia of a point mass at `com`.
fn payload_columns(context: &Context<'_>, com: &[f64]) -> Vec<Column> {
    let links = context.last_link();
    if links.len() < 10 {
        return Vec::new();
    }
    let [x, y, z] = [0, 1, 2].map(|k| com.get(k).copied().unwrap_or(0.0));
    // By first moment: what Ixx Ixy Ixz Iyy Iyz Izz it carries; the mass carries none of its own.
    let inertia = [
        [0.0; 6],
        [0.0, 0.5 * y, 0.5 * z, x, 0.0, x],
        [y, 0.5 * x, 0.0, 0.0, 0.5 * z, y],
        [z, 0.0, 0.5 * x, z, 0.5 * y, 0.0],
    ];
    inertia
        .iter()
        .enumerate()
        .map(|(c, shares)| {
            let mut column = links[c].clone();
            for (share, link) in shares.iter().zip(&links[4..]).filter(|(s, _)| **s != 0.0) {
                for ((_, values), (_, more)) in column.parts.iter_mut().zip(&link.parts) {
                    values.iter_mut().zip(more).for_each(|(v, m)| *v += share * m);
                }
            }
            column
        })
        .collect()
}

/// 1 in the windows, 0 elsewhere, by row; without windows 1 everywhere.
pub(super) fn mask(context: &Context<'_>, joint: usize, windows: &[Window]) -> Vec<f64> {
    let inside = |(log, t): &(usize, f64)| {
        windows.iter().any(|w| w.log == context.data.logs[*log] && *t >= w.from && *t <= w.to)
    };
    context.row_times(joint).iter().map(|at| if inside(at) { 1.0 } else { 0.0 }).collect()
}

/// Sums over the blocks from some block to the end of its log.
struct Tail {
    /// A'P: the columns of the base by 4.
    cross: Vec<[f64; 4]>,
    square: [[f64; 4]; 4],
    score: [f64; 4],
}

impl Tail {
    fn empty(size: usize) -> Tail {
        Tail { cross: vec![[0.0; 4]; size], square: [[0.0; 4]; 4], score: [0.0; 4] }
    }

    fn plus(&self, other: &Tail) -> Tail {
        let mut sum = Tail::empty(self.cross.len());
        for (to, (a, b)) in sum.cross.iter_mut().zip(self.cross.iter().zip(&other.cross)) {
            *to = std::array::from_fn(|k| a[k] + b[k]);
        }
        sum.square = std::array::from_fn(|i| std::array::from_fn(|k| self.square[i][k] + other.square[i][k]));
        sum.score = std::array::from_fn(|k| self.score[k] + other.score[k]);
        sum
    }

    /// χ² that the payload explains with the base refitted, where its mass is positive.
    fn gain(&self, solver: &Solver) -> f64 {
        let column = |k: usize| self.cross.iter().map(|c| c[k]).collect::<Vec<f64>>();
        let cross: [Vec<f64>; 4] = std::array::from_fn(column);
        let base: [Vec<f64>; 4] = std::array::from_fn(|k| solver.solve(&cross[k]));
        let mut gram = faer::Mat::zeros(4, 4);
        for i in 0..4 {
            for k in 0..4 {
                let shared: f64 = cross[i].iter().zip(&base[k]).map(|(a, b)| a * b).sum();
                gram[(i, k)] = self.square[i][k] - shared;
            }
            // What the base takes over almost wholly says nothing.
            if gram[(i, i)] < 1e-6 * self.square[i][i] {
                gram[(i, i)] = 0.0;
            }
        }
        let x = Solver::new(&gram, |_| true).solve(&self.score);
        let gain = x.iter().zip(&self.score).map(|(a, b)| a * b).sum();
        if x[0] > 0.0 { gain } else { 0.0 }
    }
}

/// The start in each log that explains most, then the logs that share the payload.
fn search(context: &Context<'_>) -> Option<Candidate> {
    let (data, fit) = (context.data, context.fit);
    let columns = payload_columns(context, &[]);
    if columns.is_empty() {
        return None;
    }
    let (gram, _, _) = fit.gram.sum(&fit.weights, |_| true);
    let solver = Solver::new(&gram, |c| fit.free[c]);
    let mut starts: Vec<(usize, f64, Tail)> = Vec::new();
    let mut tail = Tail::empty(fit.design.size);
    for (b, block) in data.blocks.iter().enumerate().rev() {
        if data.blocks.get(b + 1).is_none_or(|next| next.log != block.log) {
            tail = Tail::empty(fit.design.size);
        }
        tail = tail.plus(&block_sums(context, &columns, b));
        let recording = &data.recordings[block.recording];
        let time = block_start(context, b).unwrap_or(recording.start);
        let first_of_log = b == 0 || data.blocks[b - 1].log != block.log;
        let time = if first_of_log { recording.start } else { time };
        starts.push((block.log, time, tail.plus(&Tail::empty(fit.design.size))));
    }
    let searched = starts.len() as f64;
    let gains: Vec<f64> = starts.iter().map(|(_, _, t)| t.gain(&solver)).collect();
    let best = (0..starts.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b])).filter(|b| gains[*b] > 0.0)?;
    let mut chosen = vec![best];
    let mut total = starts[best].2.plus(&Tail::empty(fit.design.size));
    let mut explained = gains[best];
    loop {
        let others = (0..starts.len()).filter(|s| chosen.iter().all(|c| starts[*c].0 != starts[*s].0));
        let next = others.map(|s| (s, total.plus(&starts[s].2).gain(&solver))).max_by(|a, b| a.1.total_cmp(&b.1));
        match next {
            Some((s, gain)) if gain > explained + ANOTHER_LOG => {
                total = total.plus(&starts[s].2);
                explained = gain;
                chosen.push(s);
            }
            _ => break,
        }
    }
    chosen.sort_by_key(|s| starts[*s].0);
    let windows = chosen
        .iter()
        .map(|s| Window { log: data.logs[starts[*s].0].clone(), from: starts[*s].1, to: f64::INFINITY })
        .collect();
    Some(Candidate { joints: (0..data.dof()).collect(), form: 0, values: Vec::new(), windows, searched })
}

/// The time of the first row of a block in its log's own t.
fn block_start(context: &Context<'_>, block: usize) -> Option<f64> {
    let data = context.data;
    let block = &data.blocks[block];
    let recording = &data.recordings[block.recording];
    let kept = data.band.kept(recording.len());
    (0..data.dof())
        .filter(|j| !block.rows[*j].is_empty())
        .map(|j| {
            let joint = &data.joints[j];
            let k = joint.kept[block.recording][block.rows[j].start - joint.rows[block.recording].start];
            recording.start + kept[k] as f64 / recording.rate
        })
        .min_by(f64::total_cmp)
}

fn block_sums(context: &Context<'_>, columns: &[Column], block: usize) -> Tail {
    let (data, fit) = (context.data, context.fit);
    let mut tail = Tail::empty(fit.design.size);
    for (j, rows) in data.blocks[block].rows.iter().enumerate() {
        let w = fit.weights[j];
        if rows.is_empty() || w == 0.0 {
            continue;
        }
        let parts: Vec<&[f64]> = columns.iter().filter_map(|c| c.at(j)).collect();
        if parts.len() < 4 {
            continue;
        }
        for (g, values) in fit.design.cross(j, rows, &parts) {
            for k in 0..4 {
                tail.cross[g][k] += w * values[k];
            }
        }
        let dot = |a: &[f64], b: &[f64]| -> f64 {
            a[rows.clone()].iter().zip(&b[rows.clone()]).map(|(x, y)| x * y).sum()
        };
        for i in 0..4 {
            for k in 0..4 {
                tail.square[i][k] += w * dot(parts[i], parts[k]);
            }
            tail.score[i] += w * dot(parts[i], &context.residual[j]);
        }
    }
    tail
}
