//! A body held by the last link, from the start of a log or from some time on.

use super::window_sums::{Sums, explained};
use super::{Axis, Candidate, Class, Context, Effect, Found, Part, Window};
use crate::controller::JointNumber;
use crate::identification::estimate::Solver;
use crate::logs::regression::{Block, Column, Data};
use dyngen::arm::ParameterKind;
use serde::Serialize;

/// Mass and first moment in the last frame as four columns; the inertia is that of a point mass at the centre
/// of mass last estimated, so a few rounds make it consistent.
pub(super) struct Payload;

/// What columns and windows depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The centre of mass that the inertia is taken about, m in the last frame; `None` while nothing is known
    /// of it.
    pub com: Option<[f64; 3]>,
    /// Whether it is in every log that was recorded after its start.
    pub stays: bool,
}

/// What it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Its centre in the last frame, m.
    pub com: [f64; 3],
    /// Its mass, kg.
    pub mass: f64,
    /// From when on, one for each log that has it, in the log's own t, s.
    pub start_time: Vec<f64>,
}

/// A centre of mass farther than this from the flange, m, is no payload.
const REACH: f64 = 1.0;
/// A rigid body's inertial parameters: all of a link's but its rotor's.
const OF_A_BODY: usize = ParameterKind::Im as usize;
/// … of which the mass and the first moments come before the inertias.
const INERTIAS: usize = ParameterKind::Ixx as usize;

impl Effect for Payload {
    fn name(&self) -> &'static str {
        "payload"
    }

    fn class(&self) -> Class {
        Class::Event
    }

    fn of_the_body(&self) -> bool {
        true
    }

    fn may_be_in_validation_only(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Time
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        search(context).into_iter().collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let Some(settings) = Settings::of(candidate) else { return Vec::new() };
        let columns = payload_columns(context, settings.com);
        let n = context.data.dof();
        let windows = self.windows(context, candidate);
        let masks: Vec<Vec<f64>> = (0..n).map(|j| mask(context, j, &windows)).collect();
        let cut = |column: &Column| Column {
            parts: column
                .parts
                .iter()
                .map(|(j, values)| (*j, values.iter().zip(&masks[*j]).map(|(v, m)| v * m).collect()))
                .collect(),
        };
        columns.iter().map(cut).collect()
    }

    /// A payload that stays is also in logs that were not fitted, where their `t` and that of the logs with
    /// the payload are one clock.
    fn windows(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Window> {
        let (data, windows) = (context.data, &candidate.windows);
        let here = windows.iter().any(|w| data.logs.contains(&w.log));
        let stays = Settings::of(candidate).is_some_and(|settings| settings.stays);
        let Some(first) = windows.iter().min_by(|a, b| (a.from + a.offset).total_cmp(&(b.from + b.offset)))
        else {
            return Vec::new();
        };
        if here || !stays {
            return windows.clone();
        }
        data.recordings
            .iter()
            .filter(|r| (r.clock - r.start - first.offset).abs() < 1e-6)
            .map(|r| Window::new(data, r.log, first.from, f64::INFINITY))
            .collect()
    }

    fn part(&self, _: &Context<'_>, _: &Candidate, c: &[f64]) -> Part {
        Part::Payload(c[0], centre(c))
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c[0] > 0.0 && c[1..].iter().all(|h| h.abs() < REACH * c[0])
    }

    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let settings = Settings::of(candidate)?;
        let com = || centre(c).map(|x| x.clamp(-REACH, REACH));
        (c[0] > 0.0).then(|| candidate.with(Settings { com: Some(com()), ..*settings }))
    }

    /// A payload may have been taken off before another log, or held again in it. What the clocks say is
    /// overruled by a log that clearly says otherwise, as a log among the fitted ones would.
    fn seen_in(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let (data, another_log) = (context.data, context.rule.another_log);
        let taken = self.windows(context, candidate);
        let (mut seen, settings) = (candidate.clone(), *Settings::of(candidate)?);
        seen.windows.retain(|w| !data.logs.contains(&w.log));
        for log in 0..data.logs.len() {
            let start = data.recordings.iter().find(|r| r.log == log).map_or(0.0, |r| r.start);
            let all = Window::new(data, log, start, f64::INFINITY);
            let was = taken.iter().any(|w| w.log == all.log);
            let columns = self.columns(context, &Candidate { windows: vec![all.clone()], ..seen.clone() });
            let explains: f64 =
                explained(context, &columns, c, &data.blocks).iter().map(|(less, _)| less).sum();
            let is = if was { explains > -another_log } else { explains > another_log };
            if is {
                seen.windows.push(all);
            } else if was {
                seen.settings = Settings { stays: false, ..settings }.into();
            }
        }
        Some(seen)
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let c = found[0].coefficients;
        let start_time = found[0].candidate.windows.iter().map(|w| w.from).collect();
        Figures { com: centre(c), mass: c[0], start_time }.into()
    }
}

/// The centre of mass.
fn centre(c: &[f64]) -> [f64; 3] {
    [1, 2, 3].map(|k| if c[0] != 0.0 { c[k] / c[0] } else { 0.0 })
}

/// Columns for mass and first moments with the inertia of a point mass at `com`.
fn payload_columns(context: &Context<'_>, com: Option<[f64; 3]>) -> Vec<Column> {
    let links = context.data.last_link_columns();
    if links.len() < OF_A_BODY {
        return Vec::new();
    }
    let [x, y, z] = com.unwrap_or_default();
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
            for (share, link) in shares.iter().zip(&links[INERTIAS..]).filter(|(s, _)| **s != 0.0) {
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

/// The start in each log that explains most, then the logs that share the payload.
fn search(context: &Context<'_>) -> Option<Candidate> {
    let (data, fit) = (context.data, context.fit);
    let columns = payload_columns(context, None);
    if columns.is_empty() {
        return None;
    }
    let (gram, _, _) = fit.gram.fitted(&fit.weights, |_| true);
    let solver = Solver::new(&gram, |c| fit.free[c]);
    let mut starts: Vec<(usize, f64, Sums)> = Vec::new();
    let empty = || Sums::zero(fit.design.size, 4);
    let mut tail = empty();
    for (b, block) in data.blocks.iter().enumerate().rev() {
        if data.blocks.get(b + 1).is_none_or(|next| next.log != block.log) {
            tail = empty();
        }
        tail.add(&Sums::of_block(context, &columns, block), 1.0);
        let recording = &data.recordings[block.recording];
        let time = block_start(context, block).unwrap_or(recording.start);
        let first_of_log = b == 0 || data.blocks[b - 1].log != block.log;
        let time = if first_of_log { recording.start } else { time };
        starts.push((block.log, time, tail.clone()));
    }
    let searched = starts.len() as f64;
    let gains: Vec<f64> = starts.iter().map(|(_, _, t)| gain(t, &solver)).collect();
    let best =
        (0..starts.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b])).filter(|b| gains[*b] > 0.0)?;
    let mut chosen = vec![best];
    let mut total = starts[best].2.clone();
    let mut explained = gains[best];
    loop {
        let with = |s: usize| {
            let mut sum = total.clone();
            sum.add(&starts[s].2, 1.0);
            sum
        };
        let others = (0..starts.len()).filter(|s| chosen.iter().all(|c| starts[*c].0 != starts[*s].0));
        let next = others.map(|s| (s, gain(&with(s), &solver))).max_by(|a, b| a.1.total_cmp(&b.1));
        match next {
            Some((s, gain)) if gain > explained + context.rule.another_log => {
                total = with(s);
                explained = gain;
                chosen.push(s);
            }
            _ => break,
        }
    }
    chosen.sort_by_key(|s| starts[*s].0);
    let windows: Vec<Window> =
        chosen.iter().map(|s| Window::new(data, starts[*s].0, starts[*s].1, f64::INFINITY)).collect();
    let first = windows.iter().map(|w| w.from + w.offset).fold(f64::INFINITY, f64::min);
    let has = |log: usize| windows.iter().any(|w| w.log == data.logs[log]);
    let stays = data.recordings.iter().filter(|r| r.clock >= first).all(|r| has(r.log));
    let settings = Settings { com: None, stays }.into();
    Some(Candidate { joints: all_joints(data), settings, windows, searched })
}

/// Every joint of the arm.
pub(super) fn all_joints(data: &Data<'_>) -> Vec<JointNumber> {
    (0..data.dof()).map(JointNumber::from_index).collect()
}

/// What a payload with positive mass explains over some rows.
fn gain(sums: &Sums, solver: &Solver) -> f64 {
    let (gain, x) = sums.gain(solver);
    if x[0] > 0.0 { gain } else { 0.0 }
}

/// The time of the first row of a block in its log's own t.
pub(super) fn block_start(context: &Context<'_>, block: &Block) -> Option<f64> {
    let data = context.data;
    let recording = &data.recordings[block.recording];
    (0..data.dof())
        .filter(|j| !block.rows[*j].is_empty())
        .map(|j| {
            let joint = &data.joints[j];
            let k = joint.kept[block.recording][block.rows[j].start - joint.rows[block.recording].start];
            recording.start + joint.band.kept(recording.len())[k] as f64 / recording.rate
        })
        .min_by(f64::total_cmp)
}
