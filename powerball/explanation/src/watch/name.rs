//! The cause of a change: the columns of each possible effect, fitted to the rows since the change.
//!
//! Rows and columns pass the colour of each joint's residual first, so that squares are χ². A name's score is
//! the part that it explains, less penalties for its coefficients and for how many alternatives were tried,
//! as in the rule.

use super::changes::Change;
use crate::effects::{
    Candidate, Context, Window, contact_wrench, encoder_offset, payload, temperature, time_delay,
};
use crate::rule::Rule;
use crate::torque_model::{Colour, TorqueModel};
use powerball_controller::JointNumber;
use powerball_controller::change::ORDER;
use powerball_identification::estimate::{Fit, NormalEquations, known};
use powerball_logs::regression::{Column, Data, PULLED, Signals};

/// Ends of a push are looked for on a grid of this, s.
pub(super) const GRID: f64 = 0.1;
/// Beginnings on a finer one, s: one row more or less matters for a sudden change.
const FINE: f64 = 0.02;
/// A push lasts at least this long, s.
const SHORTEST: f64 = 0.3;
/// How far before the first guess a change may begin, s.
const AROUND: f64 = 0.6;
/// Number of times that an inertia or a secant is computed again from the last estimate.
const ROUNDS: usize = 4;
/// The start of a change is known only roughly: rows within this time before and after it are not used for
/// its size, s.
const BLURRED: [f64; 2] = [0.15, 0.3];
/// χ² of such a row, which noise does not reach.
const ANYTHING: f64 = 16.0;
/// These rows count at most this many times as much as the others: a step through the colour is largest
/// there.
const EDGES: f64 = 4.0;
/// A force elsewhere than on the tool counts as this many alternatives for each link.
const ELSEWHERE: f64 = 20.0;
/// Innovations of a block.
const BLOCK: usize = 12;
/// A heavier body pulls more than any push that could be mistaken for one, kg.
const HEAVIEST: f64 = 200.0;
/// A joint shows a change, or has changed friction as well, where that explains this much of its χ².
const SHOWS: f64 = 15.0;

/// The rows of a stretch of a log, and their residual.
pub(super) struct Stretch<'a> {
    pub(super) data: &'a Data<'a>,
    pub(super) residual: Signals,
    pub(super) colour: &'a Colour,
    pub(super) rule: &'a Rule,
    fit: Fit,
    /// Innovations by joint and row; none where too few rows came before.
    white: Signals,
    /// Times by joint and row, s.
    times: Vec<Vec<f64>>,
}

/// A force that is tried.
#[derive(Clone, Copy, Debug)]
struct Push {
    link: usize,
    from: f64,
    end: Option<f64>,
    /// Whether it rises and falls as that of a hand does.
    rises: bool,
}

/// Whether a row is too near an edge to say anything.
fn is_near(edge: f64, t: f64) -> bool {
    (edge - BLURRED[0]..edge + BLURRED[1]).contains(&t)
}

/// When a change began, roughly: the alarm's guess, and when it rose, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    pub(super) since: f64,
    pub(super) alarm: f64,
}

/// The time near a guess for which most is explained: on a coarse grid, then on a fine one.
fn best_time(guess: Guess, explains: impl Fn(f64) -> f64) -> f64 {
    let best = |from: f64, to: f64, step: f64| {
        let times = (0..=((to - from) / step).round() as usize).map(|k| from + k as f64 * step);
        let asked = times.map(|time| (time, explains(time)));
        asked.fold((guess.since, f64::NEG_INFINITY), |a, b| if b.1 > a.1 { b } else { a }).0
    };
    let coarse = best(guess.since - AROUND, guess.alarm.max(guess.since), GRID);
    best(coarse - GRID, coarse + GRID, FINE)
}

/// A name with its size.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub(super) changes: Vec<Change>,
    pub(super) joints: Vec<JointNumber>,
    pub(super) since: f64,
    /// The end of the change, if it is over already.
    pub(super) until: Option<f64>,
    /// χ² that it explains.
    pub(super) explains: f64,
    /// χ² that it explains, less penalties.
    pub(super) score: f64,
    columns: Vec<Column>,
    coefficients: Vec<f64>,
}

impl Named {
    /// When it begins and ends.
    pub(super) fn edges(&self) -> Vec<f64> {
        std::iter::once(self.since).chain(self.until).collect()
    }

    pub(super) fn name(&self) -> &'static str {
        self.changes.first().map_or("unknown", Change::name)
    }
}

impl<'a> Stretch<'a> {
    pub(super) fn new(
        data: &'a Data<'a>,
        model: &TorqueModel,
        residual: Signals,
        colour: &'a Colour,
        rule: &'a Rule,
    ) -> Stretch<'a> {
        let fit = known(data, &model.inertial(), &model.gammas());
        let context = Context::for_columns(data, &fit, rule);
        let times =
            (0..data.dof()).map(|j| context.row_times(j).into_iter().map(|(_, t)| t).collect()).collect();
        let mut own = Stretch { data, white: Signals::default(), residual, colour, rule, fit, times };
        own.white = own.residual.iter().enumerate().map(|(j, r)| own.whitened(j, r)).collect();
        own
    }

    /// A signal on a joint's rows through the colour of its residual; 0 where too few rows came before.
    fn whitened(&self, j: usize, values: &[f64]) -> Vec<f64> {
        let mut white = vec![0.0; values.len()];
        let Some(colour) = self.colour.joints.get(j).and_then(Option::as_ref) else { return white };
        for run in self.data.joints[j].runs() {
            for k in run.start + ORDER..run.end {
                let past = colour.coefficients.iter().enumerate();
                let predicted: f64 = past.map(|(lag, a)| a * values[k - 1 - lag]).sum();
                white[k] = (values[k] - predicted) / colour.deviation;
            }
        }
        white
    }

    /// The error of a residual on the stretch's rows beyond the usual from a time on, and its χ² there. A
    /// block of [`BLOCK`] innovations counts by its sum: changes are slow, and the margin defines the usual
    /// error. Rows near `edges` do not count.
    pub(super) fn excess(&self, residual: &Signals, since: f64, edges: &[f64]) -> (f64, f64) {
        let (mut excess, mut square) = (0.0, 0.0);
        for (j, residual) in residual.iter().enumerate() {
            let Some(colour) = self.colour.joints.get(j).and_then(Option::as_ref) else { continue };
            let usual = 1.0 + BLOCK as f64 * colour.margin.powi(2);
            let white = self.sharp(j, self.whitened(j, residual), edges);
            for run in self.data.joints[j].runs() {
                let first = run.start + self.times[j][run.clone()].partition_point(|t| *t < since);
                for block in white[first.max(run.start + ORDER).min(run.end)..run.end].chunks(BLOCK) {
                    let sum: f64 = block.iter().sum();
                    excess += sum * sum / block.len() as f64 - usual;
                    square += block.iter().map(|z| z * z).sum::<f64>();
                }
            }
        }
        (excess.max(0.0), square)
    }

    /// The residual without the torque of a name.
    pub(super) fn without(&self, named: &Named) -> Signals {
        let mut left = self.residual.clone();
        left.subtract(&named.columns, &named.coefficients);
        left
    }

    /// χ² by joint that columns explain with these coefficients.
    fn by_joint(&self, columns: &[Column], c: &[f64], edges: &[f64]) -> Vec<f64> {
        let of = |j: usize| {
            let mut torque = vec![0.0; self.white[j].len()];
            for (column, c) in columns.iter().zip(c) {
                let values = column.at(j).unwrap_or_default();
                torque.iter_mut().zip(values).for_each(|(torque, v)| *torque += c * v);
            }
            let torque = self.sharp(j, self.whitened(j, &torque), edges);
            torque.iter().zip(&self.white[j]).map(|(t, z)| t * (2.0 * z - t)).sum()
        };
        (0..self.data.dof()).map(of).collect()
    }

    /// A whitened signal on a joint's rows without those near some times.
    fn sharp(&self, j: usize, mut white: Vec<f64>, edges: &[f64]) -> Vec<f64> {
        for (z, t) in white.iter_mut().zip(&self.times[j]) {
            if edges.iter().any(|edge| is_near(*edge, *t)) {
                *z = 0.0;
            }
        }
        white
    }

    /// Least squares over the rows that are not near `edges`: coefficients, and what they explain.
    fn fitted(&self, columns: &[Column], edges: &[f64]) -> (Vec<f64>, f64) {
        let places: Vec<usize> = (0..columns.len()).collect();
        let mut equations = NormalEquations::zero(columns.len());
        for (j, white) in self.white.iter().enumerate() {
            let here: Vec<usize> = places.iter().copied().filter(|c| columns[*c].at(j).is_some()).collect();
            let of =
                |c: &usize| self.sharp(j, self.whitened(j, columns[*c].at(j).unwrap_or_default()), edges);
            equations.add_columns(&here, &here.iter().map(of).collect::<Vec<_>>(), white, 1.0);
        }
        let c = equations.solve();
        let explains: f64 = c.iter().zip(&equations.right).map(|(c, r)| c * r).sum();
        (c, explains)
    }

    /// χ² that rows near `edges` have beyond [`ANYTHING`] each: the start of a change is known only roughly,
    /// so any of these rows may have any value. Without this an edge next to the true one, which leaves the
    /// true one's rows to be explained, would seem to explain more.
    fn blurred(&self, edges: &[f64]) -> f64 {
        let near = |t: &f64| edges.iter().any(|edge| is_near(*edge, *t));
        let of = |(white, times): (&Vec<f64>, &Vec<f64>)| -> f64 {
            let rows = white.iter().zip(times).filter(|(_, t)| near(t));
            rows.map(|(z, _)| (z * z - ANYTHING).max(0.0)).sum()
        };
        self.white.iter().zip(&self.times).map(of).sum()
    }

    /// Columns that are there during some time only.
    fn cut(&self, columns: &[Column], from: f64, to: f64) -> Vec<Column> {
        let part = |(j, values): &(usize, std::sync::Arc<Vec<f64>>)| {
            let inside = |t: &f64| (from..to).contains(t);
            let cut = values.iter().zip(&self.times[*j]).map(|(v, t)| if inside(t) { *v } else { 0.0 });
            (*j, cut.collect::<Vec<f64>>().into())
        };
        columns.iter().map(|column| Column { parts: column.parts.iter().map(part).collect() }).collect()
    }

    fn named(
        &self,
        changes: impl FnOnce(&[f64]) -> Vec<Change>,
        columns: Vec<Column>,
        searched: f64,
        (since, until): (f64, Option<f64>),
    ) -> Named {
        let edges: Vec<f64> = std::iter::once(since).chain(until).collect();
        let (coefficients, explains) = self.fitted(&columns, &edges);
        let penalty = self.rule.penalty(columns.len(), searched);
        Named {
            changes: changes(&coefficients),
            joints: Vec::new(),
            since,
            until,
            explains,
            score: explains - penalty,
            columns,
            coefficients,
        }
    }

    /// The names that could be, best first; at most one an effect. `now` is the last time of the stretch.
    /// `held` is the mass that the last link holds and that may be taken off, kg.
    pub(super) fn names(&self, guess: Guess, now: f64, held: f64) -> Vec<Named> {
        let context = Context::for_columns(self.data, &self.fit, self.rule);
        let mut names: Vec<Named> = Vec::new();
        names.extend(self.forces(&context, guess, now));
        names.extend(self.payload(&context, guess, held));
        names.extend(self.friction(&context, guess));
        names.extend(self.offset(&context, guess));
        names.extend(self.delay(&context, guess));
        names.retain(|named| named.score >= self.rule.least_score);
        names.sort_by(|a, b| b.score.total_cmp(&a.score));
        for named in &mut names {
            named.joints = named.changes.iter().flat_map(Change::joints).copied().collect();
            if !named.joints.is_empty() {
                continue;
            }
            let by_joint = self.by_joint(&named.columns, &named.coefficients, &named.edges());
            let shows = |j: &usize| by_joint[*j] > SHOWS;
            named.joints = (0..self.data.dof()).filter(shows).map(JointNumber::from_index).collect();
        }
        names
    }

    /// The start of a change of such columns: that which explains most near the first guess.
    fn beginning(&self, columns: &[Column], guess: Guess) -> f64 {
        best_time(guess, |from| self.fitted(&self.cut(columns, from, f64::INFINITY), &[]).1)
    }

    /// A force on the tool or on a link, which continues or is over.
    fn forces(&self, context: &Context<'_>, guess: Guess, now: f64) -> Option<Named> {
        let n = self.data.dof();
        let mut best: Option<(Push, Named)> = None;
        for link in (0..n).rev() {
            let Some(columns) = self.force_columns(context, link) else { continue };
            let from = self.beginning(&columns, guess);
            let mut tried = vec![Push { link, from, end: None, rises: false }];
            let ends = (SHORTEST / GRID) as usize..((now - from) / GRID).max(0.0) as usize;
            for end in ends.map(|k| Some(from + k as f64 * GRID)) {
                tried.push(Push { link, from, end, rises: false });
                // Elsewhere than on the tool a force is recognised by its columns alone.
                tried.extend((link + 1 == n).then_some(Push { link, from, end, rises: true }));
            }
            self.best_force(context, &columns, tried, &mut best);
        }
        // Of a push that is over the beginning is looked for again, its end being known.
        if let Some(push) = best.as_ref().map(|(push, _)| *push).filter(|push| push.end.is_some()) {
            let columns = self.force_columns(context, push.link)?;
            let end = push.end.unwrap_or(f64::INFINITY);
            let latest = Guess { alarm: guess.alarm.min(end - SHORTEST), ..guess };
            let from = best_time(latest, |from| self.fitted(&self.cut(&columns, from, end), &[]).1);
            best = None;
            self.best_force(context, &columns, vec![Push { from, ..push }], &mut best);
        }
        best.map(|(_, named)| named)
    }

    /// Columns of a constant force on a link.
    fn force_columns(&self, context: &Context<'_>, link: usize) -> Option<Vec<Column>> {
        let columns: Vec<Column> = match link + 1 == self.data.dof() {
            true => context.columns(&self.wrench(contact_wrench::Settings::Constant, self.everywhere())),
            false => {
                (0..3).filter_map(|axis| self.data.pull_columns(axis).get(link * PULLED).cloned()).collect()
            }
        };
        (columns.len() == 3).then_some(columns)
    }

    fn wrench(&self, settings: contact_wrench::Settings, window: Window) -> Candidate {
        let joints = (0..self.data.dof()).map(JointNumber::from_index).collect();
        Candidate { windows: vec![window], ..Candidate::on_all(joints, settings, 1) }
    }

    /// All the time of the stretch.
    fn everywhere(&self) -> Window {
        let log = self.data.logs.first().cloned().unwrap_or_default();
        Window { log, from: f64::NEG_INFINITY, to: f64::INFINITY, offset: 0.0 }
    }

    /// Takes the best of some pushes where it is better than the best so far.
    fn best_force(
        &self,
        context: &Context<'_>,
        columns: &[Column],
        tried: Vec<Push>,
        best: &mut Option<(Push, Named)>,
    ) {
        let constant = self.wrench(contact_wrench::Settings::Constant, self.everywhere());
        let count = tried.len() as f64;
        // Windows that leave out different rows are compared with what these could be.
        let whole = |named: &Named| named.score + self.blurred(&named.edges()).min(EDGES * named.explains);
        for push in tried {
            let Push { link, from, end, rises } = push;
            let torques = match end.filter(|_| rises) {
                None => self.cut(columns, from, end.unwrap_or(f64::INFINITY)),
                Some(end) => {
                    let window = Window { from: from - GRID, to: end + GRID, ..self.everywhere() };
                    context.columns(&self.wrench(contact_wrench::Settings::Push, window))
                }
            };
            let elsewhere =
                if link + 1 == self.data.dof() { 1.0 } else { ELSEWHERE * self.data.dof() as f64 };
            let searched = elsewhere * if end.is_some() { count } else { 1.0 };
            let change = |c: &[f64]| {
                let force = [0, 1, 2].map(|k| c.get(k).copied().unwrap_or(0.0));
                vec![Change::Force { force, link: JointNumber::from_index(link) }]
            };
            let named = self.named(change, torques, searched, (from, end));
            let better = best.as_ref().is_none_or(|(_, best)| whole(&named) > whole(best));
            if better && constant.effect().admissible(&constant, &named.coefficients) {
                *best = Some((push, named));
            }
        }
    }

    /// A body that the last link holds.
    fn payload(&self, context: &Context<'_>, guess: Guess, held: f64) -> Option<Named> {
        let joints = (0..self.data.dof()).map(JointNumber::from_index).collect();
        let settings = payload::Settings::default();
        let mut candidate =
            Candidate { windows: vec![self.everywhere()], ..Candidate::on_all(joints, settings, 1) };
        let since = self.beginning(&context.columns(&candidate), guess);
        let mut found = None;
        for _ in 0..ROUNDS {
            let columns = self.cut(&context.columns(&candidate), since, f64::INFINITY);
            let change = |c: &[f64]| {
                let com = [1, 2, 3].map(|k| c.get(k).copied().unwrap_or(0.0) / c[0]);
                vec![Change::Payload { mass: c[0], com }]
            };
            if columns.is_empty() {
                return None;
            }
            let named = self.named(change, columns, 1.0, (since, None));
            let c = &named.coefficients;
            // A body that was taken off is the lack of one.
            let sign = if c[0] < 0.0 { -1.0 } else { 1.0 };
            if !(-1.2 * held..HEAVIEST).contains(&c[0]) {
                return None;
            }
            let possible: Vec<f64> = c.iter().map(|c| sign * c).collect();
            if !candidate.effect().admissible(&candidate, &possible) {
                return None;
            }
            let next = candidate.effect().refined(&candidate, &possible);
            found = Some(named);
            match next {
                Some(next) => candidate = next,
                None => break,
            }
        }
        found
    }

    /// Friction that is another one, on one joint or several.
    fn friction(&self, context: &Context<'_>, guess: Guess) -> Option<Named> {
        let first = best_of(&self.frictions(context, guess.since), &|_| true)?;
        let since = self.beginning(&self.uncut(&first, context), guess);
        let asked = self.frictions(context, since);
        let mut all = best_of(&asked, &|_| true)?;
        // Joints are independent: what others explain adds up.
        for joint in context.moving_joints() {
            let own = |change: &Change| matches!(change, Change::Friction { joint: j, .. } if *j == joint);
            let Some(more) = best_of(&asked, &|c| c.joints[0] == joint) else { continue };
            if !all.changes.iter().any(own) && more.explains > SHOWS {
                all.changes.extend(more.changes);
                all.columns.extend(more.columns);
                all.coefficients.extend(more.coefficients);
                all.explains += more.explains;
                all.score += more.score;
            }
        }
        Some(all)
    }

    /// Friction of each joint that could be another one since a time, the whole of it or its viscous part.
    fn frictions(&self, context: &Context<'_>, since: f64) -> Vec<(Candidate, Named)> {
        let with = temperature::Warmth::RunningTime { time_constant: f64::INFINITY };
        let candidates = context.moving_joints().flat_map(|j| {
            let of = [temperature::Friction::Whole, temperature::Friction::Viscous];
            of.map(|of| Candidate::on(j, temperature::Settings { of, with }, 1))
        });
        let ask = |candidate: Candidate| {
            let columns = self.cut(&context.columns(&candidate), since, f64::INFINITY);
            let joint = candidate.joints[0];
            let viscous = temperature::Settings::of(&candidate)?.of == temperature::Friction::Viscous;
            let gamma = self.fit.friction(joint.index())[4];
            let change = |c: &[f64]| {
                // The viscous column is the velocity.
                let by = if viscous { c[0] / gamma } else { c[0] };
                vec![Change::Friction { joint, viscous, by }]
            };
            let named = self.named(change, columns, 2.0, (since, None));
            let possible = candidate.effect().possible(context, &candidate, &named.coefficients)
                && (!viscous || gamma > 0.0);
            possible.then_some((candidate, named))
        };
        candidates.filter_map(ask).collect()
    }

    /// The whole columns of a change of friction.
    fn uncut(&self, named: &Named, context: &Context<'_>) -> Vec<Column> {
        let of = |change: &Change| match change {
            Change::Friction { joint, viscous, .. } => {
                let with = temperature::Warmth::RunningTime { time_constant: f64::INFINITY };
                let of = if *viscous { temperature::Friction::Viscous } else { temperature::Friction::Whole };
                context.columns(&Candidate::on(*joint, temperature::Settings { of, with }, 1))
            }
            _ => Vec::new(),
        };
        named.changes.iter().flat_map(of).collect()
    }

    /// A joint whose zero has moved.
    fn offset(&self, context: &Context<'_>, guess: Guess) -> Option<Named> {
        let first = Candidate::on(JointNumber::from_index(0), encoder_offset::Settings { about: 0.01 }, 1);
        self.one_of(context, &first.effect().candidates(context), guess, |candidate, c| {
            vec![Change::Offset { joint: candidate.joints[0], by: c[0] }]
        })
    }

    /// Torques that come later than they did.
    fn delay(&self, context: &Context<'_>, guess: Guess) -> Option<Named> {
        let first = Candidate::on(JointNumber::from_index(0), time_delay::Settings { delay: 0.01 }, 1);
        self.one_of(context, &first.effect().candidates(context), guess, |candidate, c| {
            let delay = time_delay::Settings::of(candidate).map_or(0.0, |settings| settings.delay);
            vec![Change::Delay { joints: candidate.joints.clone(), by: delay * c[0] }]
        })
    }

    /// The best of an effect's candidates, computed again from its own estimate.
    fn one_of(
        &self,
        context: &Context<'_>,
        candidates: &[Candidate],
        guess: Guess,
        change: impl Fn(&Candidate, &[f64]) -> Vec<Change>,
    ) -> Option<Named> {
        let searched = candidates.len().max(1) as f64;
        let ask = |candidate: &Candidate, since: f64| {
            let columns = self.cut(&context.columns(candidate), since, f64::INFINITY);
            let named = self.named(|c| change(candidate, c), columns, searched, (since, None));
            candidate.effect().admissible(candidate, &named.coefficients).then(|| (candidate.clone(), named))
        };
        let best = |since: f64| {
            let asked: Vec<_> = candidates.iter().filter_map(|candidate| ask(candidate, since)).collect();
            asked.into_iter().max_by(|a, b| a.1.score.total_cmp(&b.1.score))
        };
        let (first, _) = best(guess.since)?;
        let since = self.beginning(&context.columns(&first), guess);
        let (mut candidate, mut named) = best(since)?;
        for _ in 0..ROUNDS {
            let Some(next) = candidate.effect().refined(&candidate, &named.coefficients) else { break };
            let Some(better) = ask(&next, since) else { break };
            (candidate, named) = better;
        }
        Some(named)
    }
}

/// The name that explains most.
fn best_of(asked: &[(Candidate, Named)], among: &dyn Fn(&Candidate) -> bool) -> Option<Named> {
    let those = asked.iter().filter(|(candidate, _)| among(candidate)).map(|(_, named)| named);
    those.max_by(|a, b| a.score.total_cmp(&b.score)).cloned()
}
