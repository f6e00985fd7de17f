//! Touches of an arm that stands, which the test in motion does not see: friction is not determined there.
//!
//! The torque at rest is compared with limits that rests without contact showed. What was there already when
//! the arm came to rest, or when the stream began, is no touch: it may be a body in the hand, and the test in
//! motion judges it.

use super::changes::{self, Change};
use super::event::{Event, Evidence};
use super::meaning::{CLEAR, OVER};
use super::stream::Stream;
use crate::torque_model::{Rest, RestLimits, RestPush, rests};
use powerball_logs::log::logs_of_motors;
use powerball_logs::regression::{DataOptions, Recording};
use powerball_logs::signal::Band;
use powerball_logs::signal::motion::LONGEST_REVERSAL;
use serde_json::{Map, json};
use std::ops::Range;

/// Period at which the torque at rest is asked, s.
const ASK: f64 = 0.2;
/// Time back to the beginning of a touch, s: longer than it takes to report it, with what its filters need.
const BACK: f64 = 10.0;
/// Filters of the newest samples lack what comes next, s.
const NEWEST: f64 = 0.3;

/// What is known of touches at rest.
#[derive(Debug)]
pub(super) struct Standing {
    limits: RestLimits,
    /// When the torque is asked again, s.
    ask: f64,
    /// When a touch that is not reported yet was seen first, s.
    seen: Option<f64>,
    /// Until when touches are reported, s.
    reported: f64,
    /// A touch that was reported and is not over.
    lasting: Option<RestPush>,
}

impl Standing {
    pub(super) fn new(limits: RestLimits) -> Standing {
        Standing { limits, ask: f64::NEG_INFINITY, seen: None, reported: f64::NEG_INFINITY, lasting: None }
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
                if !(over || ends || last - from >= CLEAR) {
                    waits = true;
                    continue;
                }
                (standing.reported, standing.seen) = (to, None);
                let push = rest.push(self.setting.body, self.setting.file, &standing.limits, &run);
                let Some(push) = push else { continue };
                if self.release(&standing.limits, &run) {
                    events.push(self.event(&push, seen, true, over));
                } else if push.share >= self.setting.options.rule.most {
                    events.push(self.event(&push, seen, false, over));
                    standing.lasting = Some(push).filter(|_| !over);
                    lasts |= !over;
                }
            }
        }
        standing.seen = standing.seen.filter(|_| waits);
        if let Some(mut push) = standing.lasting.take_if(|_| !lasts) {
            push.from = standing.reported;
            events.push(self.event(&push, self.buffer.latest(), true, true));
        }
        events
    }

    /// Whether a torque is that of a force which was known and has ended; it is forgotten then.
    fn release(&mut self, limits: &RestLimits, run: &Range<usize>) -> bool {
        let stays = |change: &Change| !matches!(change, Change::Force { .. });
        let without: Vec<Change> = self.changes.iter().filter(|change| stays(change)).cloned().collect();
        let rest = (without.len() < self.changes.len()).then(|| self.rest(limits, &without)).flatten();
        let ended = rest.is_some_and(|rest| run.clone().all(|k| rest.size(limits, k) <= 1.0));
        if ended {
            self.changes = without;
        }
        ended
    }

    /// A touch, or the end of one; `over` says whether its end is known.
    fn event(&self, push: &RestPush, time: f64, ends: bool, over: bool) -> Event {
        let mut value = Map::new();
        if !ends {
            value.insert("force".into(), json!(push.force));
            value.insert("link".into(), json!(push.point.link));
            if over {
                value.insert("end_time".into(), json!(push.to));
            }
        }
        // What is put into the hand of an arm that stands pulls at it as a force does.
        let rivals = if over { Vec::new() } else { vec!["payload".to_string()] };
        Event {
            time,
            what: Change::Force { force: push.force, link: push.point.link }.name().to_string(),
            joints: push.joints.clone(),
            value,
            since: push.from,
            evidence: Evidence {
                log: self.setting.file.to_string(),
                ends,
                alarm_joint: push.most,
                capital: push.size,
                explains: push.share * push.beyond.powi(2),
                left: 1.0 - push.share,
                rivals,
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

    const FORCE: [f64; 3] = [10.0, -20.0, 30.0];

    /// The events of 12 s at rest with [`FORCE`] times `size` of the time; no joint is watched in motion.
    fn events(size: impl Fn(f64) -> f64) -> Vec<Event> {
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
        }
        found.extend(watch.finish());
        found
    }

    /// A push that is over is one event; one that goes on is reported after 2 s, with the body that it may
    /// be, and its end is another event. A force that was there from the first sample on is none.
    #[test]
    fn pushes_on_an_arm_that_stands_are_events_with_their_times() {
        assert!(events(|_| 0.0).is_empty());
        assert!(events(|_| 1.0).is_empty());
        let found = events(|t| if (2.0..3.0).contains(&t) || (5.0..9.0).contains(&t) { 1.0 } else { 0.0 });
        let [short, long, over] = found.as_slice() else { panic!("{found:?}") };
        assert!(found.iter().all(|event| event.what == "contact_wrench"));
        approx::assert_abs_diff_eq!(short.since, 2.0, epsilon = 0.1);
        approx::assert_abs_diff_eq!(short.value["end_time"].as_f64().unwrap(), 3.0, epsilon = 0.1);
        assert!(short.evidence.rivals.is_empty() && short.time < 3.0);
        for (axis, force) in FORCE.iter().enumerate() {
            approx::assert_abs_diff_eq!(short.value["force"][axis].as_f64().unwrap(), force, epsilon = 6.0);
        }
        approx::assert_abs_diff_eq!(long.since, 5.0, epsilon = 0.1);
        assert!(long.time < 6.0 && !long.value.contains_key("end_time") && !long.evidence.ends);
        assert_eq!(long.evidence.rivals, ["payload"]);
        assert!(over.evidence.ends);
        approx::assert_abs_diff_eq!(over.since, 9.0, epsilon = 0.1);
    }
}
