//! The meaning of an alarm: a name if one is clear, and the model with the change.

use super::changes::{self, Change};
use super::event::{Event, Evidence};
use super::name::{Guess, Named, Stretch};
use super::stream::{Pending, Stream};
use crate::torque_model::{BAND, Colour};
use powerball_controller::JointNumber;
use powerball_logs::regression::{Data, DataOptions, Signals};
use serde_json::{Map, Value, json};

/// Period at which the meaning of an alarm is determined, s.
const ASK: f64 = 0.4;
/// A stretch for naming begins this long before the change, s.
const LEAD: f64 = 1.5;
/// The longest stretch back to a change, s.
const LONGEST: f64 = 30.0;
/// A push that ended this long ago is over, s.
pub(super) const OVER: f64 = 0.4;
/// A name is given after this time where it is clear, s …
const CLEAR: f64 = 2.0;
/// … and after this time in any case, s.
pub(super) const LATEST: f64 = 5.0;
/// A change of another size by less than this share of it is the same one, better known.
const SAME: f64 = 0.35;

/// The findings from the rows since an alarm.
#[derive(Debug, Default)]
struct Found {
    named: Option<Named>,
    /// The earlier change that is over.
    over: Option<Change>,
    explains: f64,
    left: f64,
    rivals: Vec<String>,
}

impl Stream<'_> {
    /// Names what raised an alarm, once that is clear.
    pub(super) fn decide(&mut self, ends: bool) -> Vec<Event> {
        let Some(pending) = self.pending else { return Vec::new() };
        let seconds = self.last - pending.time;
        if !ends && self.last < self.ask {
            return Vec::new();
        }
        self.ask = self.last + ASK;
        let Some(found) = self.name(&pending, seconds, ends) else { return Vec::new() };
        self.pending = None;
        let event = self.take(found, &pending);
        self.restart();
        event.into_iter().collect()
    }

    /// The name, where it is clear already or the time is up.
    fn name(&self, pending: &Pending, seconds: f64, ends: bool) -> Option<Found> {
        let up = ends || seconds >= LATEST;
        let nothing = || up.then(Found::default);
        let from = pending.since.max(self.last - LONGEST);
        let Some(log) = self.buffer.log(from - LEAD, self.setting.file) else { return nothing() };
        let options = DataOptions { cutoff: BAND, ..DataOptions::default() };
        let logs = [log];
        let Ok(data) = Data::new(self.setting.body, &logs, &options) else { return nothing() };
        let colour = Colour { rate: self.rate, joints: self.colours.clone(), rest: None };
        let model = changes::with(self.setting.model, &self.changes);
        let rule = &self.setting.options.rule;
        let stretch = Stretch::new(&data, &model, self.residual(&data, &self.changes), &colour, rule);
        let over = self.over(&data, &stretch, from);
        let held = |change: &Change| if let Change::Payload { mass, .. } = change { *mass } else { 0.0 };
        let names = stretch.names(
            Guess { since: from, alarm: pending.time },
            self.last,
            self.changes.iter().map(held).sum(),
        );
        let best = names.first();
        if let Some(over) = over {
            let better = best.is_none_or(|best| over.explains > 0.9 * best.explains);
            if better && over.left <= rule.max_unexplained && (up || seconds >= CLEAR) {
                return Some(over);
            }
        }
        let Some(best) = best else { return nothing() };
        let rivals = self.rivals(&names);
        let left = left(&stretch, &stretch.without(best), from, &best.edges());
        let known = left <= rule.max_unexplained;
        let is_over = best.until.is_some_and(|until| until < self.last - OVER);
        let is_clear = known && rivals.is_empty() && (is_over || (best.until.is_none() && seconds >= CLEAR));
        if !(is_clear || up) {
            return None;
        }
        Some(Found { named: known.then(|| best.clone()), over: None, explains: best.explains, left, rivals })
    }

    /// The residual of the model with some changes.
    fn residual(&self, data: &Data<'_>, changes: &[Change]) -> Signals {
        let torque = |recording| changes::torque(self.setting.body, self.setting.model, changes, recording);
        data.residual(&data.recordings.iter().map(torque).collect::<Vec<_>>())
    }

    /// The earlier change whose end explains most: the model returns to its earlier state.
    fn over(&self, data: &Data<'_>, stretch: &Stretch<'_>, from: f64) -> Option<Found> {
        let square = |residual: &Signals| stretch.excess(residual, from, &[from]).1;
        let without = |k: usize| {
            let mut without = self.changes.clone();
            let change = without.remove(k);
            let residual = self.residual(data, &without);
            let explains = square(&stretch.residual) - square(&residual);
            let left = left(stretch, &residual, from, &[from]);
            Found { over: Some(change), explains, left, ..Found::default() }
        };
        (0..self.changes.len()).map(without).max_by(|a, b| a.explains.total_cmp(&b.explains))
    }

    /// Names that explain as much as the first or nearly so.
    fn rivals(&self, names: &[Named]) -> Vec<String> {
        let Some((best, others)) = names.split_first() else { return Vec::new() };
        let rule = &self.setting.options.rule;
        let near = |other: &&Named| {
            best.explains < rule.least_margin * other.explains || best.score - other.score < rule.least_score
        };
        others.iter().filter(near).map(|other| other.name().to_string()).collect()
    }

    /// Takes what was found into the model; the event, where it is a new one.
    fn take(&mut self, found: Found, pending: &Pending) -> Option<Event> {
        let evidence = Evidence {
            log: self.setting.file.to_string(),
            ends: found.over.is_some(),
            alarm_joint: JointNumber::from_index(pending.joint),
            capital: pending.capital,
            explains: found.explains,
            left: found.left,
            rivals: found.rivals,
        };
        let event = |what: &str, joints: Vec<JointNumber>, value: Map<String, Value>, since: f64| Event {
            time: pending.time,
            what: what.to_string(),
            joints: if joints.is_empty() { vec![evidence.alarm_joint] } else { joints },
            value,
            since,
            evidence: evidence.clone(),
        };
        if let Some(change) = found.over {
            self.changes.retain(|own| *own != change);
            return Some(event(change.name(), change.joints().to_vec(), Map::new(), pending.since));
        }
        let Some(named) = found.named else {
            // A change without a name is taken as good from now on.
            self.learn_again([pending.joint]);
            return Some(event("unknown", Vec::new(), Map::new(), pending.since));
        };
        let value = value(&named);
        let new = event(named.name(), named.joints.clone(), value, named.since);
        if named.until.is_some() {
            return Some(new);
        }
        let refined = named.changes.iter().all(|change| self.refines(change));
        // How large the model's error is with a change whose size is known roughly must be seen first.
        if !matches!(named.changes[..], [Change::Force { .. }]) {
            self.learn_again(0..self.colours.len());
        }
        for change in named.changes {
            self.changes.push(change);
        }
        (!refined).then_some(new)
    }

    /// Whether a change only corrects the size of one that was reported already.
    fn refines(&self, change: &Change) -> bool {
        let size = |change: &Change| match change {
            Change::Friction { by, .. } | Change::Offset { by, .. } | Change::Delay { by, .. } => by.abs(),
            Change::Payload { mass, .. } => mass.abs(),
            Change::Force { force, .. } => force.iter().map(|f| f * f).sum::<f64>().sqrt(),
        };
        let like = self.changes.iter().filter(|own| own.is_like(change)).map(size).sum::<f64>();
        size(change) < SAME * like
    }
}

/// The share of the error beyond the usual that stays with another residual; all of it where the error is a
/// usual one: then there is nothing that a name could explain.
fn left(stretch: &Stretch<'_>, residual: &Signals, from: f64, edges: &[f64]) -> f64 {
    let before = stretch.excess(&stretch.residual, from, edges).0;
    if before > 0.0 { stretch.excess(residual, from, edges).0 / before } else { 1.0 }
}

/// The size of a change, as in explained.json.
fn value(named: &Named) -> Map<String, Value> {
    let mut value = Map::new();
    let mut put = |key: &str, x: Value| drop(value.insert(key.to_string(), x));
    let by = |x: &[f64]| if let [one] = x { json!(one) } else { json!(x) };
    match &named.changes[..] {
        [Change::Payload { mass, com }] => {
            put("mass", json!(mass));
            put("com", json!(com));
        }
        [Change::Force { force, link }] => {
            put("force", json!(force));
            put("link", json!(link));
        }
        [Change::Delay { by, .. }] => put("delay", json!(by)),
        [Change::Offset { by, .. }] => put("offset", json!(by)),
        several => {
            let shares: Vec<f64> = several
                .iter()
                .filter_map(|change| if let Change::Friction { by, .. } = change { Some(*by) } else { None })
                .collect();
            let all = |sign: f64| shares.iter().all(|by| by * sign > 0.0);
            put("change", by(&shares));
            let reading = if all(-1.0) {
                "warmer"
            } else if all(1.0) {
                "colder or worn"
            } else {
                "mixed"
            };
            put("friction", json!(reading));
        }
    }
    if let Some(until) = named.until {
        put("end_time", json!(until));
    }
    value
}
