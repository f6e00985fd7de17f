//! An outside force on the last link during some time: a touch, a push, a thing leaned on.

use super::payload::all_joints;
use super::windows::{Sums, best_run, by_log, cut, explained, rests, step_start, window};
use super::words::{Words, list, number};
use super::{Axis, Candidate, Class, Context, Effect, Found, Part, Window};
use powerball_controller::JointNumber;
use powerball_logs::regression::{Block, Column, RigidArm};
use serde::Serialize;
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// A force in the base frame at the tool, during a window of one log: constant, rising and falling as that of
/// a hand does, or of any shape and direction over time.
pub(super) struct ContactWrench;

/// The course of its force within its windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Settings {
    /// The force is constant from the window's beginning to its end.
    Constant,
    /// Half a wave: largest in the middle of the window.
    Push,
    /// A force of any shape: linear between five instants, the first and the last of which are the window's
    /// ends.
    Knots,
}

/// Figures of this effect in a result, one entry per window.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// When it ended, in the log's own t, s.
    pub end_time: Vec<f64>,
    /// The force in the base frame, N; the largest value of a changing force.
    pub force: Vec<Vec<f64>>,
    /// The assumed point of action, on the tool. At another point of the link the force has another size.
    pub point: Vec<Point>,
    /// When it began, in the log's own t, s.
    pub start_time: Vec<f64>,
}

/// A point of a link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// The link.
    pub link: JointNumber,
    /// The point in the link's own frame, m: that of its robot description where the arm file has it, else
    /// that of the table.
    pub xyz: [f64; 3],
}

impl Point {
    /// The tool of the arm file; where it has none the origin of the last frame.
    pub(crate) fn tool(body: &RigidArm) -> Point {
        let last = body.dof() - 1;
        Point { link: JointNumber::from_index(last), xyz: body.in_link_frame(last, body.force_point()) }
    }

    /// The origin of a link's frame in the table.
    pub(crate) fn origin(body: &RigidArm, link: usize) -> Point {
        Point { link: JointNumber::from_index(link), xyz: body.in_link_frame(link, [0.0; 3]) }
    }
}

/// Up to this many pushes, each is shown; of more the range.
const EACH: usize = 3;

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, _: &Words<'_>) -> String {
        let size = |force: &Vec<f64>| force.iter().map(|x| x * x).sum::<f64>().sqrt();
        let sizes: Vec<f64> = self.force.iter().map(size).collect();
        let times = self.start_time.iter().zip(&self.end_time);
        if sizes.len() <= EACH {
            let one = |(size, (from, to)): (&f64, (&f64, &f64))| {
                format!("{} N from {from:.1} to {to:.1} s", number(*size))
            };
            return list(sizes.iter().zip(times).map(one));
        }
        let [least, most] =
            [f64::min, f64::max].map(|of| sizes.iter().copied().reduce(of).unwrap_or(f64::NAN));
        let seconds: f64 = times.map(|(from, to)| to - from).sum();
        format!("{} pushes of {} to {} N, {seconds:.1} s together", sizes.len(), number(least), number(most))
    }
}

/// Windows begin and end on a grid of this, s.
const GRID: f64 = 0.5;
/// Longest window in grid steps that is tried from every step on, and anywhere.
const SHORT: usize = 16;
/// Ends of longer windows are looked for this many grid steps apart first.
const COARSE: usize = 4;
/// Longer windows keep away from their log's ends by a share of 1 / `CLEAR` of it where the arm feels a
/// weight: what is there until the end is then a payload.
const CLEAR: usize = 10;
/// Share of a window's gain that one half of its time must explain to be a push by itself: a force that is
/// constant explains half of it in half of its time.
const ALONE: f64 = 0.65;
/// Larger forces are a rank-poor fit, N.
const MOST: f64 = 2000.0;
/// How many times as long as the constant force that fits best a push is taken to be …
const LONGER: [f64; 4] = [1.0, 1.4, 2.0, 2.8];
/// … and by which share of that its middle is later.
const LATE: [f64; 3] = [-0.25, 0.0, 0.25];
/// Instants between which a force of any shape is linear.
const KNOTS: usize = 5;
/// A longer force leans on the arm and does not push it, s.
pub(crate) const LONGEST_PUSH: f64 = 4.0;
/// Grid of the same push in other logs, s: its force is known there, so that a row more or less makes a
/// difference.
const FINE: f64 = 0.1;

impl Effect for ContactWrench {
    fn name(&self) -> &'static str {
        "contact_wrench"
    }

    fn class(&self) -> Class {
        Class::Event
    }

    fn may_be_in_validation_only(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Time
    }

    /// One force at a time.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.windows.iter().any(|w| b.windows.iter().any(|other| w.overlaps(other)))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        search(context).unwrap_or_default()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let constant = cut(context, context.data.force_columns(), &candidate.windows);
        let shaped = |shape: &dyn Fn(f64) -> f64| shaped(context, &constant, &candidate.windows, shape);
        match Settings::of(candidate) {
            Some(Settings::Push) => shaped(&|x| (PI * x).sin()),
            Some(Settings::Knots) => (0..KNOTS).flat_map(|k| shaped(&|x| near_knot(k, x))).collect(),
            _ => constant,
        }
    }

    fn part(&self, _: &Context<'_>, _: &Candidate, _: &[f64]) -> Part {
        Part::Event
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c.iter().all(|f| f.abs() < MOST)
    }

    /// The times at which other logs have the same force: only its times are fitted to them. It must
    /// explain more than the best of all windows of a log explains by chance.
    fn seen_in(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let (data, rule) = (context.data, context.rule);
        let mut seen = candidate.clone();
        seen.windows.retain(|w| !data.logs.contains(&w.log));
        let lasted = seen.windows.iter().map(|w| w.to - w.from).fold(f64::INFINITY, f64::min);
        let steps = data.blocks_of(FINE);
        // The mean over its time explains there what its own shape would.
        let force = mean(candidate, c);
        let explains = explained(context, data.force_columns(), &force, &steps);
        for log in by_log(&steps) {
            let chance = 4.0 * (log.len().max(1) as f64).ln();
            let mut open = vec![log.clone()];
            while let Some(stretch) = open.pop() {
                let found = best_run(&explains[stretch.clone()]);
                let found = stretch.start + found.start..stretch.start + found.end;
                let (less, own) =
                    explains[found.clone()].iter().fold((0.0, 0.0), |sum, e| (sum.0 + e.0, sum.1 + e.1));
                let as_long = found.len() as f64 * FINE > rule.most * lasted;
                if less > rule.least_score + chance && less > rule.nearly_all * own && as_long {
                    seen.windows.push(window(context, &steps, &log, &found)?);
                    open.extend([stretch.start..found.start, found.end..stretch.end]);
                }
            }
        }
        Some(seen)
    }

    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let windows = || found.iter().flat_map(|f| &f.candidate.windows);
        let force = |f: &Found<'_>| vec![largest(f.coefficients); f.candidate.windows.len()];
        Figures {
            end_time: windows().map(|w| w.to).collect(),
            force: found.iter().flat_map(force).collect(),
            point: windows().map(|_| Point::tool(context.data.body)).collect(),
            start_time: windows().map(|w| w.from).collect(),
        }
        .into()
    }
}

/// A constant force in the window that explains most, and pushes about its middle. Short windows are all
/// tried, longer ones on a coarse grid, whose ends are then moved. No window begins where the arm starts from
/// rest, where an error comes from the start itself: a push that lasts longer is found from then on. A whole
/// log is tried where the arm feels no weight.
fn search(context: &Context<'_>) -> Option<Vec<Candidate>> {
    let data = context.data;
    if data.force_columns().len() < 3 {
        return None;
    }
    let steps = data.blocks_of(GRID);
    let rests = rests(context, &steps, GRID);
    let logs = by_log(&steps);
    let mut windows = Windows::new(context, &steps, &rests);
    let heavy = windows.heavy;
    for log in &logs {
        windows.try_all(log, SHORT);
        if !heavy {
            windows.consider(log.clone());
        }
        let inner = inner(log, heavy);
        for first in inner.clone().step_by(COARSE) {
            for end in (first + SHORT + 1..=inner.end).step_by(COARSE) {
                windows.consider(first..end);
            }
        }
    }
    let (_, coarse) = windows.best.clone()?;
    let log = logs.iter().find(|log| log.contains(&coarse.start))?;
    if coarse.len() > SHORT {
        let inner = inner(log, heavy);
        let near =
            |at: usize| at.saturating_sub(COARSE - 1).max(inner.start)..(at + COARSE).min(inner.end + 1);
        for first in near(coarse.start) {
            for end in near(coarse.end) {
                windows.consider(first..end);
            }
        }
    }
    let found = windows.alone()?;
    let searched = windows.searched;
    let windows = vec![window(context, &steps, log, &found)?];
    let constant =
        Candidate { joints: all_joints(data), settings: Settings::Constant.into(), windows, searched };
    let pushes = pushes(context, &constant, &rests);
    let searched = searched + pushes.len() as f64;
    Some(std::iter::once(constant).chain(pushes).map(|c| Candidate { searched, ..c }).collect())
}

/// The windows of a search, in steps, and the best of those that were tried.
struct Windows {
    /// Sums up to each step.
    before: Vec<Sums>,
    /// Whether the arm rests or sets off in each step.
    sets_off: Vec<bool>,
    /// The steps of each log.
    logs: Vec<Range<usize>>,
    /// Whether the arm feels weight.
    heavy: bool,
    searched: f64,
    /// The largest gain and its window.
    best: Option<(f64, Range<usize>)>,
}

impl Windows {
    fn new(context: &Context<'_>, steps: &[Block], rests: &[Window]) -> Windows {
        let (data, solver) = (context.data, context.fit.solver());
        let columns = data.force_columns();
        let sets_off = (steps.iter())
            .map(|step| {
                step_start(context, step).is_none_or(|start| sets_off(rests, &data.logs[step.log], start))
            })
            .collect();
        let mut before = vec![Sums::zero(&solver, 3)];
        for step in steps {
            let mut sum = before[before.len() - 1].clone();
            sum.add(&Sums::of_block(context, &solver, columns, step));
            before.push(sum);
        }
        let heavy = feels_weight(context);
        Windows { before, sets_off, logs: by_log(steps), heavy, searched: 0.0, best: None }
    }

    /// The gain of a constant force in a window; `None` where none may be, or where it is too large.
    fn gain(&mut self, window: &Range<usize>) -> Option<f64> {
        if self.sets_off[window.start] && (self.heavy || !self.logs.contains(window)) {
            return None;
        }
        let mut sums = self.before[window.end].clone();
        sums.subtract(&self.before[window.start]);
        self.searched += 1.0;
        let (gain, force) = sums.gain();
        force.iter().all(|f| f.abs() < MOST).then_some(gain)
    }

    /// Takes a window if it is the best so far.
    fn consider(&mut self, window: Range<usize>) {
        let best = self.best.as_ref().map_or(0.0, |(gain, _)| *gain);
        if let Some(gain) = self.gain(&window).filter(|gain| *gain > best) {
            self.best = Some((gain, window));
        }
    }

    /// Tries all windows in a range of steps that have at most `longest` of them.
    fn try_all(&mut self, range: &Range<usize>, longest: usize) {
        for first in range.clone() {
            for end in first + 1..=(first + longest).min(range.end) {
                self.consider(first..end);
            }
        }
    }

    /// The best window. Two pushes with a pause are two: one that explains most of a window in half of its
    /// time is taken by itself, and the other one is found after it.
    fn alone(&mut self) -> Option<Range<usize>> {
        let (mut gain, mut found) = self.best.take()?;
        while found.len() > 1 {
            self.try_all(&found, found.len().div_ceil(2));
            match self.best.take().filter(|(own, _)| *own > ALONE * gain) {
                Some((own, window)) => (gain, found) = (own, window),
                None => break,
            }
        }
        Some(found)
    }
}

/// Whether an arm rests or sets off at a time of a log.
fn sets_off(rests: &[Window], log: &str, time: f64) -> bool {
    rests.iter().any(|rest| rest.log == log && (rest.from..rest.to + GRID).contains(&time))
}

/// Pushes about the middle of a constant force, which covers but the height of one.
fn pushes(context: &Context<'_>, constant: &Candidate, rests: &[Window]) -> Vec<Candidate> {
    let Some(window) = constant.windows.first() else { return Vec::new() };
    let (middle, length) = (0.5 * (window.from + window.to), window.to - window.from);
    let recordings = || context.data.recordings.iter().filter(|r| context.data.logs[r.log] == window.log);
    let starts = recordings().map(|r| r.start).fold(f64::INFINITY, f64::min);
    let ends = recordings().map(|r| r.start + r.len() as f64 / r.rate).fold(f64::NEG_INFINITY, f64::max);
    let push = |longer: f64, late: f64, settings: Settings| {
        let (middle, half) = (middle + late * length, 0.5 * longer * length);
        let window = Window { from: middle - half, to: middle + half, ..window.clone() };
        let inside = window.from > starts && window.to < ends && half < 0.5 * LONGEST_PUSH;
        (inside && !sets_off(rests, &window.log, window.from)).then(|| Candidate {
            windows: vec![window],
            settings: settings.into(),
            ..constant.clone()
        })
    };
    let of = |longer: f64| {
        // One of any shape has its middle where that is.
        let waves = LATE.map(|late| push(longer, late, Settings::Push));
        waves.into_iter().chain([push(longer, 0.0, Settings::Knots)])
    };
    LONGER.into_iter().flat_map(of).flatten().collect()
}

/// Columns of a force of another size over its windows; `shape` says of 0 … 1, from a window's beginning to
/// its end, how large it is.
fn shaped(
    context: &Context<'_>,
    constant: &[Column],
    windows: &[Window],
    shape: &dyn Fn(f64) -> f64,
) -> Vec<Column> {
    let height = |(log, t): &(usize, f64)| {
        let own = windows.iter().find(|w| w.log == context.data.logs[*log] && *t >= w.from && *t <= w.to);
        own.map_or(0.0, |w| shape((t - w.from) / (w.to - w.from)))
    };
    let heights: Vec<Vec<f64>> =
        (0..context.data.dof()).map(|j| context.row_times(j).iter().map(height).collect()).collect();
    let part = |(j, values): &(usize, Arc<Vec<f64>>)| {
        (*j, values.iter().zip(&heights[*j]).map(|(v, h)| v * h).collect::<Vec<f64>>().into())
    };
    constant.iter().map(|column| Column { parts: column.parts.iter().map(part).collect() }).collect()
}

/// 1 at a knot, 0 from its neighbours on, linear between them.
fn near_knot(knot: usize, x: f64) -> f64 {
    (1.0 - (x * (KNOTS - 1) as f64 - knot as f64).abs()).max(0.0)
}

/// The largest of a force's knots.
fn largest(c: &[f64]) -> Vec<f64> {
    let square = |force: &[f64]| force.iter().map(|f| f * f).sum::<f64>();
    let largest = c.chunks(3).max_by(|a, b| square(a).total_cmp(&square(b)));
    largest.unwrap_or_default().to_vec()
}

/// The mean of a force over its time.
fn mean(candidate: &Candidate, c: &[f64]) -> Vec<f64> {
    let knots = c.len() / 3;
    // Trapezia; of half a wave 2/π of its height.
    let share = |k: usize| match Settings::of(candidate) {
        Some(Settings::Push) => 2.0 / PI,
        Some(Settings::Knots) => (if k == 0 || k + 1 == knots { 0.5 } else { 1.0 }) / (knots - 1) as f64,
        _ => 1.0,
    };
    (0..3).map(|axis| (0..knots).map(|k| share(k) * c[3 * k + axis]).sum()).collect()
}

/// Whether the arm feels a weight at its tool.
fn feels_weight(context: &Context<'_>) -> bool {
    let (columns, gravity) = (context.data.force_columns(), context.data.body.gravity());
    let largest = |column: &Column| {
        let values = column.parts.iter().flat_map(|(_, values)| values.iter());
        values.fold(0.0, |largest: f64, v| largest.max(v.abs()))
    };
    let all: Vec<f64> = columns.iter().map(largest).collect();
    let most = all.iter().copied().fold(0.0, f64::max);
    // What is less is rounding.
    all.iter().zip(gravity).any(|(own, g)| g != 0.0 && *own > 1e-9 * most)
}

/// The range of a log's longer windows.
fn inner(log: &Range<usize>, heavy: bool) -> Range<usize> {
    if !heavy {
        return log.clone();
    }
    let clear = log.len().div_ceil(CLEAR);
    log.start + clear..log.end.saturating_sub(clear).max(log.start + clear)
}
