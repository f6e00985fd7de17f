//! Whether a model still holds: samples in, events out, as a stream.
//!
//! The test is [`powerball_controller::change`], whose false alarms have a stated rate; `stream` feeds it
//! with the rows of a stream, `meaning` finds the cause of an alarm, with a name (`name`). After an event the
//! model has the change, so that one change is one event. An arm that stands is compared with other rests
//! (`standing`).

mod buffer;
mod changes;
mod event;
mod meaning;
mod name;
mod standing;
mod stream;

use crate::rule::Rule;
use crate::torque_model::{TorqueModel, rows_a_second};
use dyngen::Arm;
pub use event::{Event, Evidence};
use powerball_controller::JointNumber;
use powerball_logs::log::LiveSample;
use powerball_logs::regression::RigidArm;
use powerball_logs::signal::resample::median_step;
use stream::Stream;

/// Number of samples from which the sample rate is determined. A file is watched like a stream: the same rows
/// give the same events.
pub const FIRST: usize = 40;

/// How a model is watched.
#[derive(Clone, Debug)]
pub struct WatchOptions {
    /// The mean time to a false alarm, h of motion.
    pub hours: f64,
    /// Share of itself by which each joint's friction may wander.
    pub friction_range: f64,
    /// Time whose motion is taken as good if the model file has no colour, s.
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
    /// The level of the alarm for rows of logs with `rate` samples a second.
    #[must_use]
    pub fn level(&self, rate: f64) -> f64 {
        self.hours * 3600.0 * rows_a_second(rate)
    }
}

/// The model and the options of a watch.
#[derive(Clone, Copy, Debug)]
struct Setting<'a> {
    body: &'a RigidArm,
    model: &'a TorqueModel,
    options: &'a WatchOptions,
    /// The name of the stream.
    file: &'a str,
}

/// One stream that is watched.
#[derive(Debug)]
pub struct Watch<'a> {
    setting: Setting<'a>,
    /// Before the rate is known.
    first: Vec<LiveSample>,
    stream: Option<Stream<'a>>,
}

impl<'a> Watch<'a> {
    /// A stream of samples called `file`. `model` is one of the arm `body`, checked.
    #[must_use]
    pub fn new(
        body: &'a RigidArm,
        model: &'a TorqueModel,
        options: &'a WatchOptions,
        file: &'a str,
    ) -> Watch<'a> {
        Watch { setting: Setting { body, model, options, file }, first: Vec::new(), stream: None }
    }

    /// The arm that is watched.
    #[must_use]
    pub fn arm(&self) -> &Arm {
        self.setting.body.arm()
    }

    /// Notes about the stream in addition to events; each once.
    pub fn notes(&mut self) -> Vec<String> {
        self.stream.as_mut().map(Stream::notes).unwrap_or_default()
    }

    /// Takes a sample; times rise.
    pub fn push(&mut self, sample: &LiveSample) -> Vec<Event> {
        if let Some(stream) = &mut self.stream {
            return stream.push(sample);
        }
        self.first.push(sample.clone());
        let t: Vec<f64> = self.first.iter().map(|s| s.t).collect();
        let Some(step) = median_step(&t).filter(|_| t.len() >= FIRST) else { return Vec::new() };
        let stream = self.stream.insert(Stream::new(self.setting, 1.0 / step));
        self.first.drain(..).flat_map(|sample| stream.push(&sample)).collect()
    }

    /// The stream ends.
    pub fn finish(&mut self) -> Vec<Event> {
        self.stream.as_mut().map(Stream::finish).unwrap_or_default()
    }

    /// The joints with a known residual of the unchanged model: the others are not watched.
    #[must_use]
    pub fn watched(&self) -> Vec<JointNumber> {
        let colours = self.stream.iter().flat_map(|stream| stream.colours.iter().enumerate());
        colours.filter(|(_, colour)| colour.is_some()).map(|(j, _)| JointNumber::from_index(j)).collect()
    }

    /// Why the stream so far is no evidence that the model holds: how much motion it has, and how much is
    /// needed. `None` where it is enough.
    #[must_use]
    pub fn unjudged(&self) -> Option<String> {
        match &self.stream {
            Some(stream) => stream.unjudged(),
            None => Some(format!("{} samples are too few: at least {FIRST} are needed", self.first.len())),
        }
    }

    /// Whether there were enough samples to start.
    #[must_use]
    pub fn has_started(&self) -> bool {
        self.stream.is_some()
    }
}
