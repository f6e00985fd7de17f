//! From samples to alarms.

use super::Setting;
use super::buffer::Buffer;
use super::changes::{self, Change};
use super::event::Event;
use super::standing::Standing;
use crate::torque_model::{Colour, Detector, JointColour, Rows, rows_a_second};
use powerball_controller::change::WINDOW;
use powerball_logs::log::{LiveSample, logs_of_motors};
use powerball_logs::regression::{DataOptions, Recording};

/// Period at which rows are made, s.
const HOP: f64 = 0.05;
/// Time before new rows that is needed, s: filters and presliding have memories.
const BEFORE: f64 = 2.5;
/// Factor of the margin after learning again, for a model with a change whose size is known only roughly.
const AGAIN: f64 = 1.5;

/// An alarm that has no name yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pending {
    /// The joint on which it shows most.
    pub(super) joint: usize,
    /// When the change began, and the last sample when the alarm rose, s.
    pub(super) since: f64,
    pub(super) time: f64,
    pub(super) capital: f64,
}

/// A stream whose rate is known.
#[derive(Debug)]
pub(super) struct Stream<'a> {
    pub(super) setting: Setting<'a>,
    /// Samples a second.
    pub(super) rate: f64,
    pub(super) buffer: Buffer,
    start: Option<f64>,
    /// The time of the last row, s.
    pub(super) last: f64,
    next: f64,
    pub(super) colours: Vec<Option<JointColour>>,
    detector: Detector,
    /// Rows of joints whose colour is learnt, one entry for each stretch.
    learning: Vec<Rows>,
    learns: Vec<bool>,
    /// Rows in motion that the bets were given.
    judged: usize,
    pub(super) changes: Vec<Change>,
    pub(super) pending: Option<Pending>,
    /// Time at which the cause of an alarm is searched again, s.
    pub(super) ask: f64,
    /// Touches at rest; none where no limits are known.
    pub(super) standing: Option<Standing>,
    notes: Vec<String>,
}

impl<'a> Stream<'a> {
    /// A stream of `rate` samples a second.
    pub(super) fn new(setting: Setting<'a>, rate: f64) -> Stream<'a> {
        let n = setting.body.dof();
        let fits = |colour: &&Colour| (colour.rate / rate - 1.0).abs() < 0.1 && colour.joints.len() == n;
        let known = setting.model.colour.as_ref().filter(fits);
        let colours = known.map_or_else(|| vec![None; n], |colour| colour.joints.clone());
        let notes = beginning(setting, known, rate);
        let rate = known.map_or(rate, |colour| colour.rate);
        let decimation = (rate / rows_a_second(rate)).round() as usize;
        Stream {
            setting,
            rate,
            buffer: Buffer::new(n, 1.0 / rate, decimation),
            start: None,
            last: f64::NEG_INFINITY,
            next: f64::NEG_INFINITY,
            detector: Detector::new(&colours, setting.options.friction_range),
            colours,
            learning: Vec::new(),
            learns: vec![known.is_none(); n],
            judged: 0,
            changes: Vec::new(),
            pending: None,
            ask: f64::NEG_INFINITY,
            standing: known.and_then(|colour| Standing::new(colour.rest.clone()?, n)),
            notes,
        }
    }

    pub(super) fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Takes a sample.
    pub(super) fn push(&mut self, sample: &LiveSample) -> Vec<Event> {
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
    pub(super) fn finish(&mut self) -> Vec<Event> {
        self.hop(true)
    }

    /// Why the stream is no evidence that the model holds: a bet knows the size of a change only after
    /// [`WINDOW`] rows in motion.
    pub(super) fn unjudged(&self) -> Option<String> {
        let (judged, step) = (self.judged as f64, self.row_step());
        (judged < WINDOW).then(|| {
            format!(
                "{:.2} s of motion could be judged; at least {:.2} s are needed",
                judged * step,
                WINDOW * step
            )
        })
    }

    /// Restarts all bets.
    pub(super) fn restart(&mut self) {
        let watched = self.colours.iter().zip(&self.learns);
        let colours: Vec<_> = watched.map(|(colour, learns)| colour.clone().filter(|_| !learns)).collect();
        self.detector = Detector::new(&colours, self.setting.options.friction_range);
    }

    /// Takes what joints show from now on as good.
    pub(super) fn learn_again(&mut self, joints: impl IntoIterator<Item = usize>) {
        joints.into_iter().for_each(|j| self.learns[j] = true);
        self.learning.clear();
    }

    fn interrupt(&mut self) {
        self.detector.interrupt();
        self.learning.push(Rows::default());
    }

    fn row_step(&self) -> f64 {
        1.0 / rows_a_second(self.rate)
    }

    /// The rows since the last time.
    fn rows(&self) -> Option<Rows> {
        let Setting { body, model, file, .. } = self.setting;
        let log = [self.buffer.log(self.last - BEFORE, file)?];
        let motors = logs_of_motors(body.arm(), &log);
        let log = motors.first()?;
        let all = log.pieces.first()?.clone();
        let recording = Recording::new(log, 0, all, 1.0 / self.rate, DataOptions::default().smoothing)?;
        let predicted = changes::torque(body, model, &self.changes, &recording);
        let rows = Rows::new(model, body, &recording, &predicted);
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
        let mut events = self.decide(ends);
        events.extend(self.stand(ends));
        events
    }

    /// Gives the bets one row.
    fn test(&mut self, rows: &Rows, k: usize) {
        let start = self.start.unwrap_or(0.0);
        let number = ((rows.t[k] - start) / self.row_step()).round() as u64;
        let moves = self.detector.update(rows.row(k), number);
        self.judged += usize::from(moves);
        if !moves || self.pending.is_some() {
            return;
        }
        if let Some(found) = self.detector.alarm(self.setting.options.level(self.rate)) {
            self.pending = Some(Pending {
                joint: self.detector.joint(),
                since: start + found.since as f64 * self.row_step(),
                time: self.buffer.latest(),
                capital: found.capital,
            });
        }
    }

    /// Takes rows as good, and learns the colour of joints of which there are enough.
    fn learn(&mut self, rows: &Rows) {
        self.keep(rows);
        let n = self.learns.len();
        let moved = |j: usize| self.learning.iter().flat_map(|r| &r.joints[j]).flatten().count() as f64;
        let enough = self.setting.options.learn / self.row_step();
        let ready: Vec<usize> = (0..n).filter(|j| self.learns[*j] && moved(*j) >= enough).collect();
        if ready.is_empty() {
            return;
        }
        let (level, range) = (self.setting.options.level(self.rate), self.setting.options.friction_range);
        let found = Colour::of_rows(&self.learning, self.rate, level, range);
        for j in ready {
            self.learns[j] = false;
            let mut colour = found.as_ref().and_then(|colour| colour.joints[j].clone());
            if let (Some(colour), Some(before)) = (&mut colour, &self.colours[j]) {
                colour.margin = AGAIN * colour.margin.max(before.margin);
            }
            self.colours[j] = colour;
            if self.colours[j].is_none() {
                self.notes.push(format!(
                    "joint {} is not watched: its residual drifts as slowly as the changes to detect",
                    j + 1
                ));
            }
        }
        self.restart();
    }

    /// Adds rows to those that are learnt from.
    fn keep(&mut self, rows: &Rows) {
        let n = self.learns.len();
        if self.learning.is_empty() {
            self.learning.push(Rows::default());
        }
        if let Some(last) = self.learning.last_mut() {
            last.joints.resize(n, Vec::new());
            last.t.extend(&rows.t);
            last.joints.iter_mut().zip(&rows.joints).for_each(|(to, from)| to.extend_from_slice(from));
        }
        self.learning.iter_mut().for_each(|rows| rows.joints.resize(n, Vec::new()));
    }
}

/// Notes before the first sample.
fn beginning(setting: Setting<'_>, known: Option<&Colour>, rate: f64) -> Vec<String> {
    let (file, learn) = (setting.file, setting.options.learn);
    match (known, &setting.model.colour) {
        (Some(colour), _) => {
            let blind = colour.joints.iter().enumerate().filter(|(_, joint)| joint.is_none());
            let blind: Vec<String> = blind.map(|(j, _)| (j + 1).to_string()).collect();
            let note = format!(
                "joint {} is not watched: it moved too little in the logs of the model, or its residual \
                    drifts as slowly as the changes to detect (its verdict gives only the size of the \
                    residual)",
                blind.join(", ")
            );
            (!blind.is_empty()).then_some(note).into_iter().collect()
        }
        (None, Some(colour)) => vec![format!(
            "{file} has {rate:.0} samples a second, the spectrum of the model's residual was learnt at \
                {:.0}: the first {learn:.0} s of motion are taken as good",
            colour.rate
        )],
        (None, None) => vec![format!(
            "{file}: the model file has no spectrum of its residual (`powerball explain` writes it): the \
                first {learn:.0} s of motion are taken as good"
        )],
    }
}
