//! A body held by the last link or carried by another one, or by a bar of a closed loop, from the start of a
//! log or from some time on, to its end or to some time.

use super::link_body::{self, Body};
use super::windows::{Sums, best_run, by_log, cut, deviance, explained, lasting_window};
use super::words::{Words, list, number};
use super::{Axis, Candidate, Class, Context, Effect, Found, Part, Window};
use dyngen::arm::ParameterKind;
use powerball_controller::JointNumber;
use powerball_identification::estimate::Solver;
use powerball_logs::regression::{Block, Column, Data};
use serde::Serialize;
use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

/// On the last link: mass and first moment in the last frame as four columns; the inertia is that of a point
/// mass at the centre of mass last estimated, so a few rounds make it consistent. On any other link
/// ([`link_body`]): first moment about its joint, mass and inertia, since often the first moment is all that
/// shows.
pub(super) struct Payload;

/// Settings of this effect, on which its columns and windows depend.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// The centre of mass that the inertia is taken about, m in the last frame; `None` while nothing is known
    /// of it.
    pub com: Option<[f64; 3]>,
    /// Whether it is in every log that was recorded after its start.
    pub stays: bool,
    /// The link that carries it; `None` for the last one's hand. Of another link `com` is the direction of
    /// the first moment.
    pub link: Option<usize>,
    /// What is taken of its inertia.
    pub inertia: Inertia,
}

/// What is taken of the inertia of a body in the hand; on another link it is what the logs show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inertia {
    /// That of a point at the centre of mass.
    #[default]
    OfPoint,
    /// More than that, about all axes alike, as the logs show.
    Free,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Centre of the body in the frame of its link, m; nothing where only its first moment shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com: Option<[f64; 3]>,
    /// Centre of the body in the link's own frame, m: that of its robot description where the arm file has
    /// it, else that of the table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_in_link: Option<[f64; 3]>,
    /// Until when, one for each log that has it, in the log's own t, s: null where it stays to the end;
    /// nothing where it does in all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub end_time: Vec<Option<f64>>,
    /// First moment of the body about the joint of its link, in the link's frame, kg·m; nothing on the last
    /// link.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_moment: Option<[f64; 3]>,
    /// The name of the bar that carries the body, where that is no link of the chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bar: Option<String>,
    /// The link, or the bar by its number after them, that carries the body, if it is not the last one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<JointNumber>,
    /// Mass of the body, kg; nothing where only its first moment shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Start times, one for each log that has the body, in the log's own t, s.
    pub start_time: Vec<f64>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let vector = |x: &[f64; 3]| format!("({})", x.map(number).join(", "));
        // On another link the standard error is that of the first moment.
        let mass = |mass: f64| if self.link.is_some() { number(mass) } else { words.size(0, mass) };
        let what = match (self.mass, &self.com, &self.first_moment) {
            (Some(own), Some(com), _) => format!("{} kg at {} m", mass(own), vector(com)),
            (Some(own), None, _) => format!("{} kg", mass(own)),
            (None, _, Some(moment)) => {
                let length = moment.iter().map(|x| x * x).sum::<f64>().sqrt();
                format!("first moment {} kg·m, {}", words.size(0, length), vector(moment))
            }
            (None, ..) => "a body".to_string(),
        };
        let link = match (&self.bar, self.link) {
            (Some(bar), _) => format!("bar {bar}"),
            (None, Some(link)) => format!("link {link}"),
            (None, None) => "the last link".to_string(),
        };
        let times = self.start_time.iter().enumerate().map(|(k, from)| {
            match self.end_time.get(k).copied().flatten() {
                Some(to) => format!("{} to {} s", number(*from), number(to)),
                None => format!("from {} s on", number(*from)),
            }
        });
        let times = list(times);
        let when = if times.is_empty() { String::new() } else { format!(", {times}") };
        format!("{what} of {link}{when}")
    }
}

/// A body is held for steps of this, s …
const GRID: f64 = 0.5;
/// … whose ends are then looked for on a grid of this, s …
const FINE: f64 = 0.1;
/// … at least this many of them where it is taken up and put down again, 8 s: what is there for less is a
/// push …
const SHORTEST: usize = 16;
/// … this many where the log ends with it, and twice as many where the log begins with it and does not.
const LEAST: usize = 4;
/// Parts of a log at which it is picked up and put down are looked for first.
const COARSE: usize = 24;
/// Least gain of an end within a log over the same run to the log's end, in units of χ².
const END: f64 = 10.0;
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
        let arm = context.data.body.arm();
        let (dof, bodies) = (context.data.dof(), arm.bodies());
        let links = std::iter::once(None).chain((0..dof.saturating_sub(1)).map(Some));
        let mut found: Vec<Candidate> = links.filter_map(|link| search(context, link)).collect();
        // A bar of a loop moves much like the link that it turns with: only what no link explains is on it.
        // Weights are those of a residual with the body in it, in which what is left of the body is small:
        // what is left is compared with what is left, at each joint.
        let bars: Vec<Candidate> = (dof..bodies).filter_map(|bar| search(context, Some(bar))).collect();
        if !bars.is_empty() {
            let base = context.fit.solver();
            let left = |candidate: &Candidate| deviance(context, &base, &self.columns(context, candidate));
            let least = found.iter().map(left).fold(deviance(context, &base, &[]), f64::min);
            found.extend(bars.into_iter().filter(|bar| left(bar) + context.rule.least_score < least));
        }
        found
    }

    /// One body at a time.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.windows.iter().any(|w| b.windows.iter().any(|other| w.overlaps(other)))
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let Some(settings) = Settings::of(candidate) else { return Vec::new() };
        let columns = columns_of(context, settings);
        cut(context, &columns, &self.windows(context, candidate))
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

    fn part(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Part {
        let Some(link) = Settings::of(candidate).and_then(|settings| settings.link) else {
            return Part::Payload(c[0], centre(c), None);
        };
        let body = Body::new(context, link, c);
        Part::Payload(body.mass, body.centre.into(), Some(JointNumber::from_index(link)))
    }

    fn admissible(&self, candidate: &Candidate, c: &[f64]) -> bool {
        match Settings::of(candidate).and_then(|settings| settings.link) {
            None => c[0] > 0.0 && c[1..].iter().all(|h| h.abs() < REACH * c[0]),
            Some(_) => link_body::is_possible(c, REACH),
        }
    }

    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let settings = Settings::of(candidate)?;
        if settings.link.is_some() {
            let along = link_body::direction(c)?;
            return Some(candidate.with(Settings { com: Some(along), ..*settings }));
        }
        let com = || centre(c).map(|x| x.clamp(-REACH, REACH));
        (c[0] > 0.0).then(|| candidate.with(Settings { com: Some(com()), ..*settings }))
    }

    /// A body's mass in the hand, the length of its first moment on another link.
    fn size(&self, candidate: &Candidate, c: &[f64]) -> Option<Vec<f64>> {
        let mut gradient = vec![0.0; c.len()];
        match Settings::of(candidate)?.link {
            None => gradient[0] = 1.0,
            Some(_) => gradient[..3].copy_from_slice(&link_body::direction(c)?),
        }
        Some(gradient)
    }

    fn otherwise(&self, candidate: &Candidate) -> Option<Candidate> {
        let settings = *Settings::of(candidate)?;
        settings.link.is_none().then(|| candidate.with(Settings { inertia: Inertia::Free, ..settings }))
    }

    /// A payload may have been taken off before another log, or taken up and put down in it. Each log is
    /// tested by itself; the clocks are overruled if the log clearly contradicts them, as for the fitted
    /// logs.
    fn seen_in(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        let (data, least) = (context.data, context.rule.least_score);
        let taken = self.windows(context, candidate);
        let (mut seen, settings) = (candidate.clone(), *Settings::of(candidate)?);
        seen.windows.retain(|w| !data.logs.contains(&w.log));
        let steps = data.blocks_of(FINE);
        let explains = explained(context, &columns_of(context, &settings), c, &steps);
        for log in by_log(&steps) {
            let run = best_run(&explains[log.clone()]);
            let run = log.start + run.start..log.start + run.end;
            let sum =
                |steps: &Range<usize>| explains[steps.clone()].iter().map(|(less, _)| less).sum::<f64>();
            let was = taken.iter().any(|w| w.log == data.logs[steps[log.start].log]);
            let all = sum(&log) + if was { least } else { -least };
            // A beginning and an end are searched for: they must explain more than the best of all runs by
            // chance.
            let part = sum(&run) - least - 4.0 * (log.len() as f64).ln();
            let held = if long_enough(&run, &log, FINE) && part > all.max(0.0) { run } else { log.clone() };
            if held != log || all > 0.0 {
                seen.windows.push(lasting_window(context, &steps, &log, &held)?);
            }
            if was && (held != log || all <= 0.0) {
                seen.settings = Settings { stays: false, ..settings }.into();
            }
        }
        Some(seen)
    }

    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let (c, windows) = (found[0].coefficients, &found[0].candidate.windows);
        let link = Settings::of(found[0].candidate).and_then(|settings| settings.link);
        let body = link.map(|link| Body::new(context, link, c));
        let point = match body {
            None => Some((c[0], centre(c))),
            Some(body) => body.shows_mass.then(|| (body.mass, body.centre.into())),
        };
        let arm = context.data.body;
        let on = link.unwrap_or(arm.dof() - 1);
        Figures {
            com: point.map(|(_, com)| com),
            com_in_link: point.map(|(_, com)| arm.in_link_frame(on, com)),
            first_moment: body.map(|body| body.moment.into()),
            bar: link.and_then(|link| arm.arm().bar(link)).map(|bar| bar.name.clone()),
            link: link.map(JointNumber::from_index),
            end_time: Window::ends(windows),
            mass: point.map(|(mass, _)| mass),
            start_time: windows.iter().map(|w| w.from).collect(),
        }
        .into()
    }
}

/// The centre of mass.
fn centre(c: &[f64]) -> [f64; 3] {
    [1, 2, 3].map(|k| if c[0] != 0.0 { c[k] / c[0] } else { 0.0 })
}

/// The columns of a body where its settings say that it is.
fn columns_of(context: &Context<'_>, settings: &Settings) -> Vec<Column> {
    let Some(link) = settings.link else {
        let mut columns = payload_columns(context, settings.com);
        if settings.inertia == Inertia::Free {
            columns.extend(own_inertia(context));
        }
        return columns;
    };
    link_body::columns(context, link, settings.com)
}

/// Columns for mass and first moments with the inertia of a point mass at `com`.
fn payload_columns(context: &Context<'_>, com: Option<[f64; 3]>) -> Vec<Column> {
    let links = context.data.link_columns(context.data.dof() - 1);
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
                    Arc::make_mut(values).iter_mut().zip(more.iter()).for_each(|(v, m)| *v += share * m);
                }
            }
            column
        })
        .collect()
}

/// The column of an inertia about the centre of mass of a body in the hand, the same about all axes.
fn own_inertia(context: &Context<'_>) -> Option<Column> {
    let links = context.data.link_columns(context.data.dof() - 1);
    let of = |kind: ParameterKind| links.get(kind as usize);
    let mut column = of(ParameterKind::Ixx)?.clone();
    for other in [of(ParameterKind::Iyy)?, of(ParameterKind::Izz)?] {
        for ((_, values), (_, more)) in column.parts.iter_mut().zip(&other.parts) {
            Arc::make_mut(values).iter_mut().zip(more.iter()).for_each(|(v, m)| *v += m);
        }
    }
    Some(column)
}

/// When each log has it, as explains most, and which logs share it.
fn search(context: &Context<'_>, link: Option<usize>) -> Option<Candidate> {
    let (data, fit) = (context.data, context.fit);
    let settings = Settings { com: None, stays: false, link, inertia: Inertia::OfPoint };
    let columns = columns_of(context, &settings);
    if columns.is_empty() {
        return None;
    }
    let steps = data.blocks_of(GRID);
    // A first moment has no sign: what a log lacks would be as good a body as what another one has.
    let positive = if link.is_some() { link_body::INERTIA } else { 0 };
    let mut held = Search::new(context, &columns, &steps, &fit.solver(), positive);
    let mut open = by_log(&steps);
    let mut chosen: Vec<(Range<usize>, Range<usize>)> = Vec::new();
    // The log that shows it best, then every other one that explains more with it.
    while let Some((place, (gain, run))) = (open.iter().enumerate())
        .map(|(place, log)| (place, held.best(log)))
        .max_by(|(_, a), (_, b)| a.0.total_cmp(&b.0))
    {
        let least = if chosen.is_empty() { 0.0 } else { held.explained + context.rule.least_score };
        if gain <= least {
            break;
        }
        held.take(gain, &run);
        chosen.push((open.swap_remove(place), run));
    }
    chosen.sort_by_key(|(log, _)| log.start);
    let windows = held.windows(context, &columns, &chosen)?;
    let first = windows.iter().map(|w| w.from + w.offset).min_by(f64::total_cmp)?;
    let keeps = |log: usize| windows.iter().any(|w| w.log == data.logs[log] && w.to.is_infinite());
    let ends = windows.iter().any(|w| w.to.is_finite());
    let stays = !ends && data.recordings.iter().filter(|r| r.clock >= first).all(|r| keeps(r.log));
    let settings = Settings { stays, ..settings }.into();
    let joints = match link {
        None => all_joints(data),
        Some(link) => joints_before(data.body.arm().last_joint(link).map_or(0, |last| last + 1)),
    };
    Some(Candidate { joints, settings, windows, searched: held.searched })
}

/// Whether a run of steps of `step` seconds can be a body that is held.
fn long_enough(run: &Range<usize>, log: &Range<usize>, step: f64) -> bool {
    let least = match [run.start == log.start, run.end == log.end] {
        [_, true] => LEAST,
        [true, false] => 2 * LEAST,
        [false, false] => SHORTEST,
    };
    run.len() as f64 * step >= least as f64 * GRID || run == log
}

/// The search for when logs hold a body.
struct Search {
    /// Sums of all steps before each.
    before: Vec<Sums>,
    /// The sums of the candidate found, its coefficients, and the part that it explains.
    found: Sums,
    coefficients: Vec<f64>,
    explained: f64,
    searched: f64,
    /// Which coefficient no body has negative.
    positive: usize,
}

impl Search {
    fn new(
        context: &Context<'_>,
        columns: &[Column],
        steps: &[Block],
        base: &Solver,
        positive: usize,
    ) -> Search {
        let empty = Sums::zero(base, columns.len());
        let mut before = vec![empty.clone()];
        for step in steps {
            let mut sum = before[before.len() - 1].clone();
            sum.add(&Sums::of_block(context, base, columns, step));
            before.push(sum);
        }
        Search { before, found: empty, coefficients: Vec::new(), explained: 0.0, searched: 0.0, positive }
    }

    /// The sums of the candidate found and of a run of steps.
    fn with(&self, run: &Range<usize>) -> Sums {
        let mut sum = self.found.clone();
        sum.add(&self.before[run.end]);
        sum.subtract(&self.before[run.start]);
        sum
    }

    /// The gain of that, if it can be a body.
    fn gain(&mut self, run: &Range<usize>) -> f64 {
        self.searched += 1.0;
        let (gain, x) = self.with(run).gain();
        if x[self.positive] > 0.0 { gain } else { 0.0 }
    }

    fn take(&mut self, gain: f64, run: &Range<usize>) {
        (self.found, self.explained) = (self.with(run), gain);
        self.coefficients = self.found.gain().1;
    }

    /// The run of a log that explains most in addition to what was found: on a coarse grid first, then its
    /// ends are moved. A body is held to the end of a log rather than put down shortly before.
    fn best(&mut self, log: &Range<usize>) -> (f64, Range<usize>) {
        let coarse = log.len().div_ceil(COARSE).max(1);
        let mut best = (0.0, log.clone());
        let consider = |own: &mut Search, run: Range<usize>, best: &mut (f64, Range<usize>)| {
            if !long_enough(&run, log, GRID) {
                return;
            }
            let gain = own.gain(&run);
            // An end is one more thing that was searched for.
            let to_the_end = |run: &Range<usize>| if run.end == log.end { END } else { 0.0 };
            if gain + to_the_end(&run) > best.0 + to_the_end(&best.1) {
                *best = (gain, run);
            }
        };
        for start in log.clone().step_by(coarse) {
            for end in (start + 2 * LEAST..log.end).step_by(coarse).chain([log.end]) {
                consider(self, start..end, &mut best);
            }
        }
        let near = |at: usize| (at + 1).saturating_sub(coarse).max(log.start)..(at + coarse).min(log.end + 1);
        for _ in 0..2 {
            for start in near(best.1.start) {
                consider(self, start..best.1.end, &mut best);
            }
            for end in near(best.1.end) {
                consider(self, best.1.start..end, &mut best);
            }
        }
        best
    }

    /// The windows of runs of steps, with their ends moved by at most a step each: the body is known now, so
    /// that a row more or less makes a difference.
    fn windows(
        &self,
        context: &Context<'_>,
        columns: &[Column],
        chosen: &[(Range<usize>, Range<usize>)],
    ) -> Option<Vec<Window>> {
        let fine = context.data.blocks_of(FINE);
        let less = explained(context, columns, &self.coefficients, &fine);
        let logs = by_log(&fine);
        let steps = context.data.blocks_of(GRID);
        let all = by_log(&steps);
        let reach = (GRID / FINE).ceil() as usize;
        let window = |(log, run): &(Range<usize>, Range<usize>)| {
            let fine_log = &logs[all.iter().position(|l| l == log)?];
            // Steps without rows are none, so that steps are not in proportion: rows are.
            let before = |fine: &Block, step: &Block| {
                fine.rows.iter().zip(&step.rows).any(|(fine, step)| fine.start < step.start)
            };
            let at = |step: usize| match step == log.end {
                true => fine_log.end,
                false => fine_log.start + fine[fine_log.clone()].partition_point(|f| before(f, &steps[step])),
            };
            let near =
                |at: usize| at.saturating_sub(reach).max(fine_log.start)..=(at + reach).min(fine_log.end);
            let [start, end] = [at(run.start), at(run.end)];
            let middle = start.midpoint(end);
            let sum = |steps: Range<usize>| less[steps].iter().map(|(less, _)| less).sum::<f64>();
            let best = |among: RangeInclusive<usize>, sum: &dyn Fn(usize) -> f64| {
                among.max_by(|a, b| sum(*a).total_cmp(&sum(*b)))
            };
            let start = match run.start == log.start {
                true => fine_log.start,
                false => best(near(start), &|s| sum(s.min(middle)..middle))?,
            };
            let end = match run.end == log.end {
                true => fine_log.end,
                false => best(near(end), &|e| sum(middle..e.max(middle)))?.max(fine_log.start + 1),
            };
            lasting_window(context, &fine, fine_log, &(start.min(end - 1)..end))
        };
        chosen.iter().map(window).collect()
    }
}

/// Every joint of the arm.
pub(super) fn all_joints(data: &Data<'_>) -> Vec<JointNumber> {
    joints_before(data.dof())
}

/// The first joints.
fn joints_before(end: usize) -> Vec<JointNumber> {
    (0..end).map(JointNumber::from_index).collect()
}
