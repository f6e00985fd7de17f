//! Whether a model still holds: samples in, events out, as a stream.
//!
//! The test is [`crate::controller::change`], whose false alarms have a stated rate; here it is fed with the rows of a
//! stream, and what it finds is named (`name`). After an event the model has the change, so that one change is
//! one event.

mod buffer;
mod changes;
mod event;
mod name;

use crate::controller::JointNumber;
use crate::controller::change::{JointTest, alarm};
use crate::explanation::rule::Rule;
use crate::explanation::torque_model::{BAND, Colour, JointColour, Rows, TorqueModel, rows_a_second};
use crate::logs::log::{LiveSample, logs_of_motors};
use crate::logs::regression::{Data, DataOptions, Recording, RigidArm, Signals};
use buffer::Buffer;
use changes::Change;
pub use event::{Event, Evidence};
use name::{Named, Stretch};
use serde_json::{Map, Value, json};

/// Rows are made so often, s.
const HOP: f64 = 0.1;
/// It is asked so often what an alarm means, s.
const ASK: f64 = 0.4;
/// So many seconds before new rows are needed: filters and presliding have memories.
const BEFORE: f64 = 2.5;
/// A stretch for naming begins so many seconds before the change.
const LEAD: f64 = 1.5;
/// The longest stretch back to a change, s.
const LONGEST: f64 = 30.0;
/// A push that ended so long ago is over, s.
const OVER: f64 = 0.4;
/// A name is given after so many seconds where it is clear …
const CLEAR: f64 = 2.0;
/// … and after so many in any case.
const LATEST: f64 = 5.0;
/// A change of another size by less than this share of it is the same one, better known.
const SAME: f64 = 0.35;

/// What is learnt again, of a model with a change whose size is known roughly, has so many times the margin.
const AGAIN: f64 = 1.5;

/// How a model is watched.
#[derive(Clone, Debug)]
pub struct WatchOptions {
    /// The mean time to a false alarm, h of motion.
    pub hours: f64,
    /// By how much of itself each joint's friction may wander.
    pub friction_range: f64,
    /// Where the model does not say its colour: so many seconds of motion are taken as good.
    pub learn: f64,
    /// The thresholds for names.
    pub rule: Rule,
}

impl Default for WatchOptions {
    fn default() -> Self {
        WatchOptions { hours: 24.0, friction_range: 0.02, learn: 20.0, rule: Rule::default() }
    }
}

impl WatchOptions {
    /// The level of the alarm for rows of logs with so many samples a second.
    #[must_use]
    pub fn level(&self, rate: f64) -> f64 {
        self.hours * 3600.0 * rows_a_second(rate)
    }
}

/// An alarm that has no name yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    joint: usize,
    since: f64,
    time: f64,
    capital: f64,
}

/// One stream that is watched.
#[derive(Debug)]
pub struct Watch<'a> {
    body: &'a RigidArm,
    model: &'a TorqueModel,
    options: &'a WatchOptions,
    /// What the stream is called.
    file: String,
    /// Samples a second.
    rate: f64,
    buffer: Buffer,
    start: Option<f64>,
    /// The time of the last row, s.
    last: f64,
    next: f64,
    colours: Vec<Option<JointColour>>,
    tests: Vec<Option<JointTest<f64>>>,
    /// Rows of joints whose colour is learnt, one entry for each stretch.
    learning: Vec<Rows>,
    learns: Vec<bool>,
    changes: Vec<Change>,
    pending: Option<Pending>,
    /// When it is asked again what an alarm means, s.
    ask: f64,
    notes: Vec<String>,
}

impl<'a> Watch<'a> {
    /// A stream of `rate` samples a second. `model` is one of the arm `body`, checked.
    #[must_use]
    pub fn new(
        body: &'a RigidArm,
        model: &'a TorqueModel,
        options: &'a WatchOptions,
        file: &str,
        rate: f64,
    ) -> Watch<'a> {
        let n = body.dof();
        let (mut notes, mut colours) = (Vec::new(), vec![None; n]);
        let fits = |colour: &&Colour| (colour.rate / rate - 1.0).abs() < 0.1 && colour.joints.len() == n;
        let known = model.colour.as_ref().filter(fits);
        match (known, &model.colour) {
            (Some(colour), _) => {
                colours.clone_from(&colour.joints);
                let blind = |j: &usize| colour.joints[*j].is_none();
                let blind: Vec<String> = (0..n).filter(blind).map(|j| (j + 1).to_string()).collect();
                if !blind.is_empty() {
                    notes.push(format!(
                        "joint {} is not watched: the logs of the model did not show how much it errs there, or it errs \
                         too much",
                        blind.join(", ")
                    ));
                }
            }
            (None, Some(colour)) => notes.push(format!(
                "{file} has {rate:.0} samples a second, the model's colour was learnt at {:.0}: the first {:.0} s of \
                 motion are taken as good",
                colour.rate, options.learn
            )),
            (None, None) => notes.push(format!(
                "{file}: the model does not say what it leaves where it holds (`powerball explain` writes it): the first \
                 {:.0} s of motion are taken as good",
                options.learn
            )),
        }
        let learns = vec![known.is_none(); n];
        let rate = known.map_or(rate, |colour| colour.rate);
        let decimation = (rate / rows_a_second(rate)).round() as usize;
        let mut watch = Watch {
            body,
            model,
            options,
            file: file.to_string(),
            rate,
            buffer: Buffer::new(n, 1.0 / rate, decimation),
            start: None,
            last: f64::NEG_INFINITY,
            next: f64::NEG_INFINITY,
            colours,
            tests: Vec::new(),
            learning: Vec::new(),
            learns,
            changes: Vec::new(),
            pending: None,
            ask: f64::NEG_INFINITY,
            notes,
        };
        watch.restart();
        watch
    }

    /// What is to be said of the stream beside events; each once.
    pub fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Takes a sample.
    pub fn push(&mut self, sample: &LiveSample) -> Vec<Event> {
        let mut events = Vec::new();
        if self.buffer.would_break(sample.t) {
            events.extend(self.hop(true));
            self.interrupt();
        }
        self.buffer.push(sample);
        self.start.get_or_insert(sample.t);
        if sample.t >= self.next {
            self.next = sample.t + HOP;
            events.extend(self.hop(false));
            self.buffer.trim();
        }
        events
    }

    /// The stream ends.
    pub fn finish(&mut self) -> Vec<Event> {
        self.hop(true)
    }

    /// All tests begin anew.
    fn restart(&mut self) {
        let test = |(colour, learns): (&Option<JointColour>, &bool)| {
            let colour = colour.as_ref().filter(|_| !learns)?;
            Some(JointTest::new(colour.for_test(), self.options.friction_range))
        };
        self.tests = self.colours.iter().zip(&self.learns).map(test).collect();
    }

    fn interrupt(&mut self) {
        self.tests.iter_mut().flatten().for_each(JointTest::interrupt);
        self.learning.push(Rows::default());
    }

    fn row_step(&self) -> f64 {
        1.0 / rows_a_second(self.rate)
    }

    /// The rows since the last time.
    fn rows(&self) -> Option<Rows> {
        let log = [self.buffer.log(self.last - BEFORE, &self.file)?];
        let motors = logs_of_motors(self.body.arm(), &log);
        let log = motors.first()?;
        let all = log.pieces.first()?.clone();
        let recording = Recording::new(log, 0, all, 1.0 / self.rate, DataOptions::default().smoothing)?;
        let predicted = changes::torque(self.body, self.model, &self.changes, &recording);
        let rows = Rows::new(self.model, &recording, &predicted);
        let new = rows.t.partition_point(|t| *t < self.last + 0.5 * self.row_step());
        Some(Rows {
            t: rows.t[new..].to_vec(),
            joints: rows.joints.into_iter().map(|joint| joint[new..].to_vec()).collect(),
        })
    }

    fn hop(&mut self, ends: bool) -> Vec<Event> {
        let rows = self.rows().unwrap_or_default();
        for k in 0..rows.t.len() {
            self.last = rows.t[k];
            self.test(&rows, k);
        }
        if self.learns.contains(&true) && !rows.t.is_empty() {
            self.learn(&rows);
        }
        self.decide(ends)
    }

    /// Gives the tests one row.
    fn test(&mut self, rows: &Rows, k: usize) {
        let start = self.start.unwrap_or(0.0);
        let number = ((rows.t[k] - start) / self.row_step()).round() as u64;
        let mut moves = false;
        for (test, joint) in self.tests.iter_mut().zip(&rows.joints) {
            match (test, joint.get(k).copied().flatten()) {
                (Some(test), Some(shown)) => {
                    test.update(shown, number);
                    moves = true;
                }
                (Some(test), None) => test.interrupt(),
                (None, _) => {}
            }
        }
        if !moves || self.pending.is_some() {
            return;
        }
        let tests = self.tests.iter().enumerate().filter_map(|(j, test)| Some((j, test.as_ref()?)));
        if let Some(found) = alarm(tests, self.options.level(self.rate)) {
            self.pending = Some(Pending {
                joint: found.joint,
                since: start + found.since as f64 * self.row_step(),
                time: self.buffer.latest(),
                capital: found.capital,
            });
        }
    }

    /// Takes rows as good, and learns the colour of joints of which there are enough.
    fn learn(&mut self, rows: &Rows) {
        let n = self.learns.len();
        if self.learning.is_empty() {
            self.learning.push(Rows::default());
        }
        if let Some(last) = self.learning.last_mut() {
            last.joints.resize(n, Vec::new());
            last.t.extend(&rows.t);
            last.joints.iter_mut().zip(&rows.joints).for_each(|(to, from)| to.extend(from));
        }
        self.learning.iter_mut().for_each(|rows| rows.joints.resize(n, Vec::new()));
        let moved = |j: usize| self.learning.iter().flat_map(|r| &r.joints[j]).flatten().count() as f64;
        let enough = self.options.learn / self.row_step();
        let ready: Vec<usize> = (0..n).filter(|j| self.learns[*j] && moved(*j) >= enough).collect();
        if ready.is_empty() {
            return;
        }
        let (level, range) = (self.options.level(self.rate), self.options.friction_range);
        let found = Colour::of_rows(&self.learning, self.rate, level, range);
        for j in ready {
            self.learns[j] = false;
            let mut colour = found.as_ref().and_then(|colour| colour.joints[j].clone());
            if let (Some(colour), Some(before)) = (&mut colour, &self.colours[j]) {
                colour.margin = AGAIN * colour.margin.max(before.margin);
            }
            self.tests[j] = colour.as_ref().map(|colour| JointTest::new(colour.for_test(), range));
            self.colours[j] = colour;
            if self.colours[j].is_none() {
                self.notes.push(format!("joint {} is not watched: the model errs too much there", j + 1));
            }
        }
    }

    /// Names what raised an alarm, once that is clear.
    fn decide(&mut self, ends: bool) -> Vec<Event> {
        let Some(pending) = self.pending else { return Vec::new() };
        let seconds = self.last - pending.time;
        if !ends && self.last < self.ask {
            return Vec::new();
        }
        self.ask = self.last + ASK;
        let found = self.name(&pending, seconds, ends);
        let Some(found) = found else { return Vec::new() };
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
        let Some(log) = self.buffer.log(from - LEAD, &self.file) else { return nothing() };
        let options = DataOptions { cutoff: BAND, ..DataOptions::default() };
        let logs = [log];
        let Ok(data) = Data::new(self.body, &logs, &options) else { return nothing() };
        let predicted = |changes: &[Change]| {
            let torque = |recording| changes::torque(self.body, self.model, changes, recording);
            data.residual(&data.recordings.iter().map(torque).collect::<Vec<_>>())
        };
        let colour = Colour { rate: self.rate, joints: self.colours.clone() };
        let model = changes::with(self.model, &self.changes);
        let stretch = Stretch::new(&data, &model, predicted(&self.changes), &colour, &self.options.rule);
        let left = |residual: &Signals, edges: &[f64]| {
            let before = stretch.excess(&stretch.residual, from, edges).0;
            stretch.excess(residual, from, edges).0 / before.max(1.0)
        };
        let square = |residual: &Signals| stretch.excess(residual, from, &[from]).1;
        // An earlier change that is over leaves the model as it was.
        let over = (0..self.changes.len()).map(|k| {
            let mut without = self.changes.clone();
            let change = without.remove(k);
            let residual = predicted(&without);
            (change, square(&stretch.residual) - square(&residual), left(&residual, &[from]))
        });
        let over = over.max_by(|a, b| a.1.total_cmp(&b.1));
        let held = |change: &Change| if let Change::Payload { mass, .. } = change { *mass } else { 0.0 };
        let names = stretch.names(from, self.last, self.changes.iter().map(held).sum());
        let best = names.first();
        if let Some((change, explains, left)) = over {
            let better = best.is_none_or(|best| explains > 0.9 * best.explains);
            if better && left <= self.options.rule.max_unexplained && (up || seconds >= CLEAR) {
                return Some(Found { over: Some(change), explains, left, ..Found::default() });
            }
        }
        let Some(best) = best else { return nothing() };
        let rule = &self.options.rule;
        let rivals: Vec<String> = names[1..]
            .iter()
            .filter(|other| {
                best.explains < rule.least_margin * other.explains
                    || best.score - other.score < rule.least_score
            })
            .map(|other| other.name().to_string())
            .collect();
        let left = left(&stretch.without(best), &best.edges());
        let known = left <= rule.max_unexplained;
        let is_over = best.until.is_some_and(|until| until < self.last - OVER);
        let is_clear = known && rivals.is_empty() && (is_over || (best.until.is_none() && seconds >= CLEAR));
        if !(is_clear || up) {
            return None;
        }
        Some(Found { named: known.then(|| best.clone()), over: None, explains: best.explains, left, rivals })
    }

    /// Takes what was found into the model; the event, where it is a new one.
    fn take(&mut self, found: Found, pending: &Pending) -> Option<Event> {
        let evidence = Evidence {
            log: self.file.clone(),
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
            return Some(event(change.name(), Vec::new(), Map::new(), pending.since));
        }
        let Some(named) = found.named else {
            // What has no name is taken as good from now on.
            self.learns[pending.joint] = true;
            self.learning.clear();
            return Some(event("unknown", Vec::new(), Map::new(), pending.since));
        };
        let value = value(&named);
        let new = event(named.name(), named.joints.clone(), value, named.since);
        if named.until.is_some() {
            return Some(new);
        }
        let refined = named.changes.iter().all(|change| self.refines(change));
        // How much the model errs with a change whose size is known roughly must be seen first.
        if !matches!(named.changes[..], [Change::Force { .. }]) {
            self.learns.fill(true);
            self.learning.clear();
        }
        for change in named.changes {
            self.changes.push(change);
        }
        (!refined).then_some(new)
    }

    /// Whether a change only corrects the size of one that was said already.
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

/// What the rows since an alarm say.
#[derive(Debug, Default)]
struct Found {
    named: Option<Named>,
    /// The earlier change that is over.
    over: Option<Change>,
    explains: f64,
    left: f64,
    rivals: Vec<String>,
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
