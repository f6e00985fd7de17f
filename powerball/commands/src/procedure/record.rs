//! A motion in interpolated position mode, and the log of it.
//!
//! Every line of a log is written whole, by one call, when its cycle is over: if the program dies at any
//! moment, the file can be read up to there.
//!
//! [`RecordError`] says why an arm is not recorded.

use super::{Cleared, Columns, Envelope, LogTime, RecordProgress, approach};
use powerball_bus::driver::{ControlMode, Phase, Profile, Rejection};
use powerball_bus::transport::{ArmError, Bus, Master, Moment};
use powerball_logs::motion::Motion;
use serde::Serialize;
use std::io::Write;
use std::{fmt, io};

/// Share of the joints' velocities and accelerations on the way to where a motion begins.
const APPROACH: f64 = 0.25;

/// Time that bringing up and enabling may take, µs: joints commutate one after the other.
const PATIENCE: u64 = 60_000_000;

/// The result of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Record {
    /// Lines of the log.
    pub samples: usize,
    /// Cycles of the motion without a line: process data was missing.
    pub missing: usize,
    /// SYNCs that were late, and those that were left out.
    pub late: u64,
    /// SYNCs that were left out because their time had passed.
    pub skipped: u64,
    /// Cycles in which the drives held their last set-points because new ones came too late.
    pub dropped: u64,
    /// Greatest distance of each joint from the set-point of the cycle, rad; with the drives' interpolation
    /// delay in it.
    pub following_max: Vec<f64>,
    /// Root mean square of the same, rad.
    pub following_rms: Vec<f64>,
}

/// An arm that is enabled in interpolated position mode and holds its position between motions.
pub struct Recorder<B: Bus, const N: usize> {
    master: Master<B, N>,
    /// The limits of every motion.
    envelope: Envelope<N>,
    /// The set-point that is held.
    target: [f64; N],
    progress: Box<dyn FnMut(&RecordProgress)>,
}

/// Cycles between two words on how far a motion has come: half a second.
const TELL: usize = 100;

impl<B: Bus, const N: usize> fmt::Debug for Recorder<B, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recorder")
            .field("master", &self.master)
            .field("target", &self.target)
            .finish_non_exhaustive()
    }
}

impl<B: Bus, const N: usize> Recorder<B, N> {
    /// Tells `progress` twice a second how far a motion has come.
    #[must_use]
    pub fn with_progress(mut self, progress: impl FnMut(&RecordProgress) + 'static) -> Self {
        self.progress = Box::new(progress);
        self
    }

    /// Brings an arm up: its position is then known, and its brakes are closed. No motion leaves `envelope`.
    ///
    /// # Errors
    /// Where driver, arm or bus refuse.
    pub fn bring_up(mut master: Master<B, N>, envelope: Envelope<N>) -> Result<Self, RecordError> {
        if let Some(guard) = envelope.torque_guard() {
            master.driver_mut().guard_torque(guard);
        }
        master.driver_mut().start(ControlMode::InterpolatedPosition, false).map_err(ArmError::from)?;
        master.wait_for(Phase::Ready, PATIENCE)?;
        let target = master.driver().positions();
        Ok(Recorder { master, envelope, target, progress: Box::new(|_| ()) })
    }

    /// Enables the arm and holds it where it is.
    ///
    /// # Errors
    /// Where driver, arm or bus refuse.
    pub fn release(&mut self) -> Result<(), RecordError> {
        self.master.driver_mut().enable().map_err(ArmError::from)?;
        self.master.wait_for(Phase::Running, PATIENCE)?;
        self.target = self.master.driver().setpoints();
        Ok(())
    }

    /// Both: brings an arm up, enables it, and holds it where it is.
    ///
    /// # Errors
    /// Where driver, arm or bus refuse.
    pub fn enable(master: Master<B, N>, envelope: Envelope<N>) -> Result<Self, RecordError> {
        let mut recorder = Recorder::bring_up(master, envelope)?;
        recorder.release()?;
        Ok(recorder)
    }

    /// The arm.
    pub fn master(&self) -> &Master<B, N> {
        &self.master
    }

    /// The arm, to do something to its bus.
    pub fn master_mut(&mut self) -> &mut Master<B, N> {
        &mut self.master
    }

    /// Follows a motion, with `each` called for every cycle: the number of the sample that was given in it,
    /// and the master, `None` where process data is missing.
    ///
    /// Where set-points came too late for their slot, the sample is given again and the motion is a cycle
    /// longer: a joint never has to catch up. `forward`: the torque that each drive is given with a sample,
    /// N·m, where there is one.
    pub(super) fn follow(
        &mut self,
        motion: &Motion,
        forward: &[[f64; N]],
        mut each: impl FnMut(usize, Option<&Master<B, N>>) -> Result<(), RecordError>,
    ) -> Result<(), RecordError> {
        let mut next = 0usize;
        let mut waiting: Option<usize> = None;
        let mut dropped = self.master.driver().counters().dropped;
        loop {
            let until = self.master.bus().now() + 100_000;
            let moment = self.master.step(until)?;
            if self.master.driver().phase() != Phase::Running {
                self.master.wait_for(Phase::Faulted, 10_000_000)?;
                self.master.check()?;
            }
            match moment {
                Moment::Cycle => {
                    // The cycle before is over; data that did not arrive in it is missing.
                    if let Some(missed) = waiting.take() {
                        each(missed, None)?;
                    }
                    let again =
                        std::mem::replace(&mut dropped, self.master.driver().counters().dropped) != dropped;
                    let sample = if again && next > 0 { next - 1 } else { next };
                    let q = motion.q.get(sample * N..(sample + 1) * N);
                    if let Some(q) = q {
                        self.target.copy_from_slice(q);
                        waiting = Some(sample);
                    }
                    let (target, driver) = (self.target, self.master.driver_mut());
                    let set = match forward.get(sample) {
                        Some(torque) => driver.set_with_torque(&target, torque),
                        None => driver.set(&target),
                    };
                    set.map_err(RecordError::Rejected)?;
                    if q.is_none() {
                        return Ok(());
                    }
                    next = sample + 1;
                }
                Moment::Data => {
                    if let Some(sample) = waiting.take() {
                        each(sample, Some(&self.master))?;
                        if sample % TELL == 0 {
                            let progress = self.how_far(sample, motion.len());
                            (self.progress)(&progress);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    fn how_far(&self, sample: usize, all: usize) -> RecordProgress {
        let driver = self.master.driver();
        let position = driver.positions();
        let errors = position.iter().zip(driver.setpoints()).map(|(q, reference)| (q - reference).abs());
        RecordProgress {
            samples: [sample, all],
            error: errors.fold(0.0, f64::max),
            position: position.to_vec(),
            late: driver.counters().late,
            missing: driver.joints().iter().map(|joint| joint.counters.missing).sum(),
        }
    }

    /// The path to a position, each joint straight there: at a share of its velocity and acceleration, in at
    /// least `least` s. It was checked as a whole.
    ///
    /// # Errors
    /// [`RecordError::Barred`] if the arm must not take it.
    pub fn way_to(&self, to: &[f64; N], share: f64, least: f64) -> Result<Cleared, RecordError> {
        let profile = self.master.driver().profile();
        let motion = way(profile, &self.target, to, share, least);
        self.envelope.clear(profile, motion).map_err(|e| match e {
            RecordError::Motion(why) | RecordError::Barred(why) => {
                let to: Vec<String> = to.iter().map(|q| format!("{q:.3}")).collect();
                let to = to.join(", ");
                RecordError::Barred(format!(
                    "on the straight path to ({to}) rad {why}: move the arm nearer to that pose first"
                ))
            }
            other => other,
        })
    }

    /// Looks at a motion as a whole, for [`record`](Self::record): before the arm is
    /// [released](Self::release), as a long one takes longer than a cycle.
    ///
    /// # Errors
    /// Where the arm must not go along it.
    pub fn clear(&self, motion: Motion) -> Result<Cleared, RecordError> {
        self.envelope.clear(self.master.driver().profile(), motion)
    }

    /// Goes that way and holds the position.
    ///
    /// # Errors
    /// Those of [`way_to`](Self::way_to) and [`record`](Self::record).
    pub fn go(&mut self, to: &[f64; N], share: f64, least: f64) -> Result<(), RecordError> {
        let way = self.way_to(to, share, least)?;
        self.follow(way.motion(), &[], |_, _| Ok(()))
    }

    /// Follows a motion that begins where the arm is, and writes the log with these columns, `t` by `time`.
    /// The log is written in the cycle, a line by a call: hand over a [`Behind`](super::Behind) where it is a
    /// file.
    ///
    /// # Errors
    /// Where the motion begins elsewhere, the arm is stopped, or the log cannot be written. The log ends
    /// there.
    pub fn record(
        &mut self,
        motion: &Cleared,
        time: &mut LogTime,
        columns: Columns,
        log: &mut impl Write,
    ) -> Result<Record, RecordError> {
        let motion = motion.motion();
        let far = motion.q.iter().zip(&self.target).fold(0.0f64, |far, (a, b)| far.max((a - b).abs()));
        if far > 1e-3 {
            let why = format!("the motion begins {far:.4} rad from where the arm is; go there first");
            return Err(RecordError::Motion(why));
        }
        let counters = *self.master.driver().counters();
        let mut record =
            Record { following_max: vec![0.0; N], following_rms: vec![0.0; N], ..Record::default() };
        log.write_all(columns.header(N).as_bytes()).map_err(RecordError::Write)?;
        let rows: Vec<&[f64]> = motion.samples().map(|[q, ..]| q).collect();
        let mut line = String::new();
        self.follow(motion, &[], |k, master| {
            let Some(master) = master else {
                record.missing += 1;
                return Ok(());
            };
            let driver = master.driver();
            let joints = driver.joints();
            columns.line(&mut line, time.at(driver.synced_at()), driver, rows[k], &counters);
            log.write_all(line.as_bytes()).map_err(RecordError::Write)?;
            record.samples += 1;
            for (i, joint) in joints.iter().enumerate() {
                let error = rows[k][i] - joint.position;
                record.following_max[i] = record.following_max[i].max(error.abs());
                record.following_rms[i] += error * error;
            }
            Ok(())
        })?;
        log.flush().map_err(RecordError::Write)?;
        let count = record.samples.max(1) as f64;
        record.following_rms.iter_mut().for_each(|sum| *sum = (*sum / count).sqrt());
        let now = self.master.driver().counters();
        record.late = now.late - counters.late;
        record.skipped = now.skipped - counters.skipped;
        record.dropped = now.dropped - counters.dropped;
        Ok(record)
    }

    fn approach_and_record(&mut self, motion: &Cleared, log: &mut impl Write) -> Result<Record, RecordError> {
        if let Some(begin) = beginning(motion.motion()) {
            self.go(&begin, APPROACH, 1.0)?;
        }
        self.record(motion, &mut LogTime::default(), Columns::Everything, log)
    }

    /// Stops the arm: brakes closed, torque off.
    ///
    /// # Errors
    /// Where the arm or the bus fails.
    pub fn finish(self) -> Result<Master<B, N>, RecordError> {
        self.finish_with_envelope().map(|(master, _)| master)
    }

    /// Like [`Self::finish`]; also returns the limits of the motions.
    pub(super) fn finish_with_envelope(mut self) -> Result<(Master<B, N>, Envelope<N>), RecordError> {
        self.master.stop()?;
        Ok((self.master, self.envelope))
    }
}

/// The motion that [`Recorder::go`] makes from `from` to `to`.
pub fn way<const N: usize>(
    profile: &Profile<N>,
    from: &[f64; N],
    to: &[f64; N],
    share: f64,
    least: f64,
) -> Motion {
    let velocity = profile.joints.map(|joint| share * joint.velocity);
    let acceleration = profile.joints.map(|joint| share * joint.acceleration);
    approach(from, to, &velocity, &acceleration, profile.period_seconds(), least)
}

/// The first position of a motion, if it is one of `N` joints.
fn beginning<const N: usize>(motion: &Motion) -> Option<[f64; N]> {
    motion.samples().next().and_then(|[q, ..]| q.try_into().ok())
}

/// The whole of it: brings the arm up, goes to where the motion begins at a quarter of its velocity, follows
/// the motion, writes the log, and stops; `progress` hears how far it has come. The motion is checked before
/// anything is sent, the way to where it begins before the arm is enabled.
///
/// # Errors
/// Those of [`Recorder::enable`] and [`Recorder::record`], and [`RecordError::Barred`]; the arm has not moved
/// then.
pub fn record<B: Bus, const N: usize>(
    master: Master<B, N>,
    motion: &Motion,
    envelope: Envelope<N>,
    progress: impl FnMut(&RecordProgress) + 'static,
    log: &mut impl Write,
) -> Result<Record, RecordError> {
    let cleared = envelope.clear(master.driver().profile(), motion.clone()).map_err(|e| match e {
        RecordError::Barred(why) => RecordError::Barred(format!("on the trajectory {why}")),
        other => other,
    })?;
    let mut recorder = Recorder::bring_up(master, envelope)?.with_progress(progress);
    if let Some(begin) = beginning(motion) {
        recorder.way_to(&begin, APPROACH, 1.0)?;
    }
    recorder.release()?;
    let done = recorder.approach_and_record(&cleared, log);
    // Also where the recording failed, the arm is stopped; the reported error is why it failed.
    let stopped = recorder.finish();
    let done = done?;
    stopped?;
    Ok(done)
}

// Why an arm is not recorded.

/// Why a recording ended early, or did not begin.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The arm.
    #[error("{0}")]
    Arm(ArmError),
    /// A set-point was rejected.
    #[error("the motion cannot be followed: {0}")]
    Rejected(Rejection),
    /// The motion does not fit the arm or its rate.
    #[error("{0}")]
    Motion(String),
    /// The arm must not go where it would have to: why.
    #[error("{0}")]
    Barred(String),
    /// The log could not be written.
    #[error("the log cannot be written: {0}")]
    Write(io::Error),
}

impl<E: Into<ArmError>> From<E> for RecordError {
    fn from(e: E) -> Self {
        RecordError::Arm(e.into())
    }
}

#[cfg(test)]
#[cfg(feature = "demo")]
mod tests {
    use super::*;
    use powerball_bus::canopen::NodeId;
    use powerball_bus::driver::lwa4p::LWA4P;
    use powerball_bus::driver::{Cause, Driver};
    use powerball_bus::transport::Memory;
    use powerball_virtual_arm::slave::Fault;
    use powerball_virtual_arm::{VirtualArm, lwa4p};

    const START: [f64; 6] = [0.1, 0.2, -0.3, 0.2, 0.4, 0.0];

    fn arm() -> Master<Memory<VirtualArm>, 6> {
        let arm = VirtualArm::new(lwa4p::setup(START, 1).unwrap()).unwrap();
        Master::new(Driver::new(LWA4P).unwrap(), Memory::new(arm, LWA4P.bitrate))
    }

    /// No surroundings: the joints' limits alone.
    fn open() -> Envelope<6> {
        Envelope::new(|_| None)
    }

    /// Every joint swings, from rest to rest.
    fn swing(seconds: f64) -> Motion {
        let mut motion = Motion::new(6, 0.005);
        for k in 0..=(seconds / 0.005) as usize {
            let t = k as f64 * 0.005;
            motion.push((0..6).map(|i| {
                let w = std::f64::consts::TAU * (1 + i % 3) as f64 / seconds;
                let (s, c) = (w * t).sin_cos();
                [START[i] + 0.3 * (1.0 - c), 0.3 * w * s, 0.3 * w * w * c]
            }));
        }
        motion
    }

    #[test]
    fn a_motion_is_followed_and_logged_without_a_gap() {
        let (motion, mut log) = (swing(6.0), Vec::new());
        let mut recorder = Recorder::enable(arm(), open()).unwrap();
        recorder.go(&START, 0.25, 1.0).unwrap();
        let cleared = recorder.clear(motion.clone()).unwrap();
        let mut time = LogTime::from(10.0);
        let record = recorder.record(&cleared, &mut time, Columns::Everything, &mut log).unwrap();
        assert_eq!((record.samples, record.missing, record.late, record.dropped), (motion.len(), 0, 0, 0));
        // Two and a half cycles of delay at 1 rad/s, and the servo.
        assert!(record.following_max.iter().all(|e| *e < 0.03), "{record:?}");
        let text = String::from_utf8(log).unwrap();
        let rows: Vec<Vec<f64>> =
            text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        assert_eq!(rows.len(), motion.len());
        assert!(
            rows.iter()
                .enumerate()
                .all(|(k, row)| { row.len() == 40 && (row[0] - 10.0 - 0.005 * k as f64).abs() < 1e-9 })
        );
        // The drives' reports: their own velocities, "operation enabled", within the cycle.
        for (pair, sample) in rows.windows(3).zip(&motion.q.chunks(6).collect::<Vec<_>>()[1..]) {
            let row = &pair[1];
            assert!((0..6).all(|j| (row[13 + j] - sample[j]).abs() < 1e-6));
            let differences = (0..6).map(|j| (pair[2][1 + j] - pair[0][1 + j]) / 0.01);
            assert!(differences.zip(&row[19..25]).all(|(v, dq)| (v - dq).abs() < 0.05), "{row:?}");
            assert!(row[25..31].iter().all(|status| *status as u16 & 0x6F == 0x27));
            assert!(row[31..37].iter().all(|answer| (1e-4..5e-3).contains(answer)), "{row:?}");
            assert_eq!(row[37..], [0.0; 3]);
        }
        let master = recorder.finish().unwrap();
        let arm = master.bus().peer();
        assert!(arm.nodes().iter().all(|node| node.brake_closed()));
        assert_eq!(master.driver().phase(), Phase::Ready);
    }

    #[test]
    fn a_log_ends_with_a_whole_line_where_the_arm_is_stopped() {
        let (motion, mut log) = (swing(6.0), Vec::new());
        let mut recorder = Recorder::enable(arm(), open()).unwrap();
        recorder.go(&START, 0.25, 1.0).unwrap();
        let mut lines = 0;
        let failed = recorder.follow(&motion, &[], |_, master| {
            lines += usize::from(master.is_some());
            Ok(())
        });
        assert!(failed.is_ok() && lines == motion.len());
        recorder.go(&START, 0.25, 1.0).unwrap();
        recorder.master_mut().bus_mut().peer_mut().fault(NodeId::clamped(5), Fault::Silent(true));
        let cleared = recorder.clear(motion).unwrap();
        let mut time = LogTime::default();
        let failed = recorder.record(&cleared, &mut time, Columns::Torques, &mut log).unwrap_err();
        let RecordError::Arm(ArmError::Stopped(cause, _)) = &failed else { panic!("{failed}") };
        // The first cause, or the graver one that follows from the same silence.
        assert!(matches!(cause, Cause::DataMissing(_) | Cause::HeartbeatLost(_)), "{cause:?}");
        assert_eq!(cause.node(), NodeId::new(5));
        assert!(log.ends_with(b"\n"));
    }

    /// Where the way to the beginning is barred nothing moves, and the arm is stopped.
    #[test]
    fn a_barred_way_is_not_gone() {
        let mut motion = swing(6.0);
        motion.q.iter_mut().skip(1).step_by(6).for_each(|q| *q += 0.2);
        let highest = |m: &Motion| m.q.iter().skip(1).step_by(6).fold(f64::MIN, |a, b| a.max(*b));
        let mut log = Vec::new();
        // The way alone ends at joint 2 being lower than the trajectory gets.
        let begin = motion.q[1];
        let barred = move |m: &Motion| (highest(m) <= begin + 1e-6).then(|| "it is barred".to_string());
        let refused =
            record(arm(), &motion, Envelope::new(barred), |_| (), &mut log).unwrap_err().to_string();
        assert!(refused.contains("on the straight path to (0.100, 0.400, "), "{refused}");
        assert!(refused.contains("rad it is barred: move the arm nearer"), "{refused}");
        let everything = Envelope::new(|_: &Motion| Some("it is barred".into()));
        let refused = record(arm(), &motion, everything, |_| (), &mut log).unwrap_err();
        assert!(refused.to_string().starts_with("on the trajectory"), "{refused}");
        assert!(log.is_empty());
        let (tell, heard) = std::sync::mpsc::channel();
        let progress = move |progress: &RecordProgress| tell.send(progress.to_string()).unwrap();
        assert_eq!(record(arm(), &motion, open(), progress, &mut log).unwrap().samples, motion.len());
        let heard: Vec<String> = heard.iter().collect();
        assert!(heard.iter().any(|line| line.starts_with(" 49 % of 1201 samples, at (0.")), "{heard:?}");
    }

    #[test]
    fn what_does_not_fit_is_refused_before_anything_moves() {
        let mut recorder = Recorder::enable(arm(), open()).unwrap();
        let mut refused = |motion: Motion| {
            let done = recorder.clear(motion).and_then(|motion| {
                let (mut time, mut log) = (LogTime::default(), Vec::new());
                recorder.record(&motion, &mut time, Columns::Torques, &mut log)
            });
            match done {
                Err(RecordError::Motion(what)) => what,
                other => panic!("{other:?}"),
            }
        };
        let mut slow = swing(1.0);
        slow.period = 0.01;
        assert!(refused(slow).contains("sample it at 200 Hz"));
        let mut far = swing(6.0);
        far.q.iter_mut().for_each(|q| *q += 0.1);
        assert!(refused(far).contains("go there first"));
        assert!(refused(Motion::new(6, 0.005)).contains("0 samples"));
    }
}
