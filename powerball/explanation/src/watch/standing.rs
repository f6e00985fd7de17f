//! Touches of an arm that stands, which the test in motion does not see: friction is not determined there.
//!
//! The torque at rest is compared with limits that rests without contact showed. What was there already when
//! the arm came to rest, or when the stream began, is no touch: it may be a body in the hand, and the test in
//! motion judges it.

use super::changes::{self, Change};
use super::event::{Event, Evidence};
use super::meaning::{LATEST, OVER};
use super::stream::Stream;
use crate::torque_model::{Rest, RestLimits, RestPush, rests};
use powerball_logs::log::logs_of_motors;
use powerball_logs::regression::{DataOptions, Recording};
use powerball_logs::signal::Band;
use powerball_logs::signal::motion::LONGEST_REVERSAL;
use serde_json::{Map, json};
use std::ops::Range;

/// Period at which the torque at rest is tested, s.
const ASK: f64 = 0.2;
/// Time back to the beginning of a touch, s: longer than it takes to report it, with what its filters need.
const BACK: f64 = 10.0;
/// Filters of the newest samples lack what comes next, s.
const NEWEST: f64 = 0.3;

/// The name of a touch …
const FORCE: &str = "contact_wrench";
/// … and of one that goes on: it may be a body in the hand.
const UNKNOWN: &str = "unknown";

/// How far a touch is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It goes on.
    Lasts,
    /// It is over, and this was not reported before.
    Over,
    /// What was reported ends.
    Ends,
}

/// What is known of touches at rest.
#[derive(Debug)]
pub(super) struct Standing {
    limits: RestLimits,
    /// When the torque is tested again, s.
    ask: f64,
    /// When a touch that is not reported yet was seen first, s.
    seen: Option<f64>,
    /// Until when touches are reported, s.
    reported: f64,
    /// A touch that was reported and is not over.
    lasting: Option<RestPush>,
}

impl Standing {
    /// `None` where these are not the limits of an arm of `n` joints.
    pub(super) fn new(limits: RestLimits, n: usize) -> Option<Standing> {
        let fits = [&limits.velocity, &limits.limit, &limits.noise].iter().all(|of| of.len() == n);
        fits.then_some(Standing {
            limits,
            ask: f64::NEG_INFINITY,
            seen: None,
            reported: f64::NEG_INFINITY,
            lasting: None,
        })
    }
}

impl Stream<'_> {
    /// The touches that are clear now.
    pub(super) fn stand(&mut self, ends: bool) -> Vec<Event> {
        let now = self.buffer.latest();
        let Some(mut standing) = self.standing.take_if(|standing| ends || now >= standing.ask) else {
            return Vec::new();
        };
        standing.ask = now + ASK;
        // What changed in motion must be known first.
        let rest = if self.pending.is_none() { self.rest(&standing.limits, &self.changes) } else { None };
        let events = match rest {
            Some(rest) => self.touches(&mut standing, &rest, ends),
            None => {
                (standing.seen, standing.lasting) = (None, None);
                Vec::new()
            }
        };
        self.standing = Some(standing);
        events
    }

    /// The rest of the last samples, where all joints stand long enough to be no reversal.
    fn rest(&self, limits: &RestLimits, changes: &[Change]) -> Option<Rest> {
        let (body, model) = (self.setting.body, self.setting.model);
        let log = [self.buffer.log(self.buffer.latest() - BACK, self.setting.file)?];
        let motors = logs_of_motors(body.arm(), &log);
        let log = motors.first()?;
        let all = log.pieces.first()?.clone();
        let recording = Recording::new(log, 0, all, 1.0 / self.rate, DataOptions::default().smoothing)?;
        let band = Band::new(DataOptions::default().cutoff, self.rate);
        let predicted = |still: &Recording| changes::torque(body, model, changes, still);
        let mut rest = rests(&recording, &limits.velocity, &band, predicted).pop()?;
        let (first, last) = (rest.at(0), rest.at(rest.len()));
        let stands = last > self.buffer.latest() - 0.5 * NEWEST && last - first >= LONGEST_REVERSAL;
        rest.shorten((NEWEST * self.rate).ceil() as usize);
        (stands && rest.len() > 0).then_some(rest)
    }

    fn touches(&mut self, standing: &mut Standing, rest: &Rest, ends: bool) -> Vec<Event> {
        let mut events = Vec::new();
        let last = rest.at(rest.len());
        let (mut waits, mut lasts) = (false, false);
        for run in rest.pushed(&standing.limits) {
            let [from, to] = [run.start, run.end].map(|k| rest.at(k));
            let over = to + OVER < last;
            if from <= standing.reported {
                // A part of what is reported.
                standing.reported = standing.reported.max(to);
                lasts |= !over;
            } else if run.start > 0 {
                let seen = *standing.seen.get_or_insert(self.buffer.latest());
                if !(over || ends || last - from >= LATEST) {
                    waits = true;
                    continue;
                }
                (standing.reported, standing.seen) = (to, None);
                let push = rest.push(self.setting.body, self.setting.file, &standing.limits, &run);
                let Some(push) = push else { continue };
                if let Some(name) = self.release(&standing.limits, &run) {
                    events.push(self.event(&push, name, seen, Phase::Ends));
                } else if push.share >= self.setting.options.rule.most {
                    let (name, phase) = if over { (FORCE, Phase::Over) } else { (UNKNOWN, Phase::Lasts) };
                    events.push(self.event(&push, name, seen, phase));
                    standing.lasting = Some(push).filter(|_| !over);
                    lasts |= !over;
                }
            }
        }
        standing.seen = standing.seen.filter(|_| waits);
        if let Some(mut push) = standing.lasting.take_if(|_| !lasts) {
            push.from = standing.reported;
            events.push(self.event(&push, FORCE, self.buffer.latest(), Phase::Ends));
        }
        events
    }

    /// The name of a known force or body whose end a torque is; it is forgotten then. The foot of the torque
    /// belongs to both, so the middle half of the time decides.
    fn release(&mut self, limits: &RestLimits, run: &Range<usize>) -> Option<&'static str> {
        let middle = run.start + run.len() / 4..run.end - run.len() / 4;
        let ended = (0..self.changes.len()).find(|k| {
            let mut without = self.changes.clone();
            let gone = without.remove(*k);
            let rest = matches!(gone, Change::Force { .. } | Change::Payload { .. })
                .then(|| self.rest(limits, &without))
                .flatten();
            rest.is_some_and(|rest| middle.clone().all(|k| rest.size(limits, k) <= 1.0))
        })?;
        Some(self.changes.remove(ended).name())
    }

    /// An event at rest.
    fn event(&self, push: &RestPush, name: &str, time: f64, phase: Phase) -> Event {
        let mut value = Map::new();
        if phase != Phase::Ends {
            value.insert("force".into(), json!(push.force));
            value.insert("link".into(), json!(push.point.link));
        }
        if phase == Phase::Over {
            value.insert("end_time".into(), json!(push.to));
        }
        // What is put into the hand of an arm that stands pulls at it as a force does.
        let rivals = if phase == Phase::Lasts { vec![FORCE, "payload"] } else { Vec::new() };
        Event {
            time,
            what: name.to_string(),
            joints: push.joints.clone(),
            value,
            since: push.from,
            evidence: Evidence {
                log: self.setting.file.to_string(),
                ends: phase == Phase::Ends,
                alarm_joint: push.most,
                capital: push.size,
                explains: push.share * push.beyond.powi(2),
                left: 1.0 - push.share,
                rivals: rivals.into_iter().map(str::to_string).collect(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torque_model::tests::{body, model, recording};
    use crate::torque_model::{Colour, TorqueModel};
    use crate::watch::{Watch, WatchOptions};
    use powerball_logs::log::LiveSample;
    use powerball_logs::regression::RigidArm;

    use super::FORCE as FORCE_NAME;
    use powerball_controller::JointNumber;

    const FORCE: [f64; 3] = [10.0, -20.0, 30.0];

    /// The events of 12 s at rest with [`FORCE`] times `size` of the time, where a force is known; no joint
    /// is watched in motion.
    fn events(known: Option<[f64; 3]>, size: impl Fn(f64) -> f64) -> Vec<Event> {
        let body: RigidArm = body();
        let n = body.dof();
        let rest = RestLimits { velocity: vec![0.03; n], limit: vec![3.0; n], noise: vec![0.1; n] };
        let colour = Colour { rate: 100.0, joints: vec![None; n], rest: Some(rest) };
        let model = TorqueModel { colour: Some(colour), ..model(&body, &[]) };
        let mut still = recording(n, 0.0);
        let q: Vec<f64> = (0..n).map(|j| 0.4 + 0.2 * j as f64).collect();
        for (k, q_of) in still.q.iter_mut().enumerate() {
            *q_of = q[k % n];
        }
        still.v.fill(0.0);
        still.a.fill(0.0);
        let usual = model.torque(&body, &still, &|_| false);
        let lever = body.force_columns(&q).unwrap();
        let options = WatchOptions::default();
        let mut watch = Watch::new(&body, &model, &options, "log.csv");
        let mut found: Vec<Event> = Vec::new();
        for k in 0..1200 {
            let t = 0.01 * f64::from(k);
            // What friction holds, noise, and the push.
            let torque = (0..n).map(|j| {
                let force: f64 = (0..3).map(|axis| lever[axis][j] * FORCE[axis]).sum();
                usual[j] + 0.1 + 0.1 * f64::from(k * (7 + j as i32)).sin() + size(t) * force
            });
            found.extend(watch.push(&LiveSample { t, q: q.clone(), torque: torque.collect() }));
            if let (Some(force), Some(stream), 100) = (known, &mut watch.stream, k) {
                let link = JointNumber::from_index(n - 1);
                stream.changes.push(Change::Force { force, link });
            }
        }
        found.extend(watch.finish());
        found
    }

    /// A push that is over is one event; one that goes on is reported as what it may be, and its end is
    /// another event. A force that was there from the first sample on is none.
    #[test]
    fn pushes_on_an_arm_that_stands_are_events_with_their_times() {
        assert!(events(None, |_| 0.0).is_empty());
        assert!(events(None, |_| 1.0).is_empty());
        let pushed = |t: f64| (1.0..2.0).contains(&t) || (3.5..10.0).contains(&t);
        let found = events(None, |t| f64::from(pushed(t)));
        let [short, long, over] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!([short, long, over].map(|event| event.what.as_str()), [FORCE_NAME, UNKNOWN, FORCE_NAME]);
        approx::assert_abs_diff_eq!(short.since, 1.0, epsilon = 0.1);
        approx::assert_abs_diff_eq!(short.value["end_time"].as_f64().unwrap(), 2.0, epsilon = 0.1);
        assert!(short.evidence.rivals.is_empty() && short.time < 2.0);
        for (axis, force) in FORCE.iter().enumerate() {
            approx::assert_abs_diff_eq!(short.value["force"][axis].as_f64().unwrap(), force, epsilon = 6.0);
        }
        approx::assert_abs_diff_eq!(long.since, 3.5, epsilon = 0.1);
        assert!(!long.value.contains_key("end_time") && !long.evidence.ends);
        assert_eq!(long.evidence.rivals, [FORCE_NAME, "payload"]);
        assert!(over.evidence.ends);
        approx::assert_abs_diff_eq!(over.since, 10.0, epsilon = 0.1);
    }

    /// A force that is known and ends at rest is one event, its end, and no force the other way round.
    #[test]
    fn a_known_force_that_ends_at_rest_is_its_end() {
        let found = events(Some(FORCE), |t| f64::from(t < 5.0));
        let [ended] = found.as_slice() else { panic!("{found:?}") };
        assert!(ended.what == FORCE_NAME && ended.evidence.ends && ended.value.is_empty());
        approx::assert_abs_diff_eq!(ended.since, 5.0, epsilon = 0.2);
    }
}
