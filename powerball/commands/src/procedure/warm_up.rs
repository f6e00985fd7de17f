//! Warming an arm up (§II.C): every joint swings until the torque that friction takes no longer changes.

use super::settling::{Cycle, Exponential, Trend, cycles, exponential, trend};
use super::{Columns, LogTime, RecordError, Recorder, resume};
use powerball_bus::driver::Profile;
use powerball_bus::transport::Bus;
use powerball_logs::motion::Motion;
use serde_json::{Value, json};
use std::io::{self, Write};

/// How to swing, and when to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarmUpSettings {
    /// Length of a cycle, s.
    pub period: f64,
    /// Share of each joint's range, velocity and acceleration that is used.
    pub share: f64,
    /// Greatest change of a joint's cycle-mean torque that may still be to come, as a share of it.
    pub tolerance: f64,
    /// An arm that is not warm by then is given up, s.
    pub most: f64,
}

impl Default for WarmUpSettings {
    fn default() -> Self {
        WarmUpSettings { period: 5.0, share: 0.6, tolerance: 0.01, most: 3600.0 }
    }
}

/// The result for one joint.
#[derive(Clone, Debug)]
pub struct JointWarmth {
    /// The joint's cycles.
    pub cycles: Vec<Cycle>,
    /// The exponential of Fig. 3, where there are cycles enough.
    pub curve: Option<Exponential>,
    /// The trend at the end.
    pub trend: Option<Trend>,
}

/// The result of a warm-up.
#[derive(Clone, Debug)]
pub struct Warmth {
    /// By joint.
    pub joints: Vec<JointWarmth>,
    /// Whether every joint is within the tolerance.
    pub warm: bool,
    /// How long it took, s.
    pub seconds: f64,
}

/// One cycle of all joints, from rest to rest at one end of their swings: q = middle − A·cos ωt, so that
/// cycles follow each other without a stop. Amplitudes keep the share of range, velocity and acceleration.
#[must_use]
pub fn swing<const N: usize>(profile: &Profile<N>, settings: &WarmUpSettings) -> Motion {
    let period = profile.period_seconds();
    let steps = (settings.period / period).round().max(1.0);
    let w = std::f64::consts::TAU / (steps * period);
    let shapes: Vec<(f64, f64)> = profile
        .joints
        .iter()
        .map(|joint| {
            let [low, high] = joint.position;
            let room = 0.5 * (high - low);
            let most = room.min(joint.velocity / w).min(joint.acceleration / (w * w));
            (0.5 * (low + high), settings.share * most)
        })
        .collect();
    let mut motion = Motion::new(N, period);
    for k in 0..=steps as usize {
        let (s, c) = (w * k as f64 * period).sin_cos();
        motion.push(shapes.iter().map(|(middle, a)| [middle - a * c, a * w * s, a * w * w * c]));
    }
    motion
}

/// Cycle means of a swing, as its log gives them.
#[derive(Clone, Debug)]
pub struct Seen {
    motion: Motion,
    cycles: Vec<Vec<Cycle>>,
}

/// A logged position further than this from where the swing should be is another swing's, rad.
const ANOTHER: f64 = 0.3;
/// Between two rows of one cycle less time than this passes, s.
const BROKEN_OFF: f64 = 0.5;

impl Seen {
    /// Nothing seen yet of a swing.
    #[must_use]
    pub fn new(motion: Motion) -> Seen {
        Seen { cycles: vec![Vec::new(); motion.dof()], motion }
    }

    /// Takes the rows (`t`, `q1…qn`, `tau1…taun`, `ref1…refn`, and more) of an earlier log of the same swing.
    /// `None` where they are of another one.
    #[must_use]
    pub fn earlier(mut self, rows: &[Vec<f64>]) -> Option<Seen> {
        let n = self.motion.dof();
        if rows.iter().any(|row| row.len() < 1 + 3 * n) {
            return None;
        }
        // A cycle ends and the next one begins with the set-point of the swing's end; where a program died,
        // time has passed.
        let reference = 1 + 2 * n;
        let end = self.motion.q.first().copied()?;
        let rests = |row: &[f64]| (row[reference] - end).abs() < 1e-7;
        let parts = rows.chunk_by(|a, b| !(rests(a) && rests(b)) && b[0] - a[0] < BROKEN_OFF);
        for part in parts.clone() {
            let sample = |row: &Vec<f64>| ((row[0] - part[0][0]) / self.motion.period).round() as usize;
            let same = |row: &Vec<f64>| {
                // What comes late comes after the last sample.
                let q = self.motion.q.get(sample(row) * n..(sample(row) + 1) * n).unwrap_or(&[]);
                q.iter().zip(&row[1..]).all(|(a, b)| (a - b).abs() < ANOTHER)
            };
            if !part.iter().all(same) {
                return None;
            }
        }
        parts.for_each(|part| self.take(part));
        Some(self)
    }

    /// Takes the rows of a cycle; one that is not whole is left out.
    fn take(&mut self, rows: &[Vec<f64>]) {
        let Some(start) = rows.first().map(|row| row[0]) else { return };
        let (n, motion) = (self.motion.dof(), &self.motion);
        // Lines may be missing; each knows by its time which sample it is.
        let sample = |row: &Vec<f64>| ((row[0] - start) / motion.period).round() as usize;
        let known: Vec<(usize, &Vec<f64>)> =
            rows.iter().map(|row| (sample(row), row)).filter(|(k, _)| *k < motion.len()).collect();
        let times: Vec<f64> = known.iter().map(|(k, _)| *k as f64 * motion.period).collect();
        if times.last().is_none_or(|t| *t < motion.duration()) {
            return;
        }
        for (j, seen) in self.cycles.iter_mut().enumerate() {
            let velocity: Vec<f64> = known.iter().map(|(k, _)| motion.dq[k * n + j]).collect();
            let torque: Vec<f64> = known.iter().map(|(_, row)| row[1 + n + j]).collect();
            let found = cycles(&times, &velocity, &torque, motion.duration());
            seen.extend(found.iter().map(|c| Cycle { time: c.time + start, ..*c }));
        }
    }

    /// Greatest change that may still be to come on a joint, and the trends; `None` while it is too early to
    /// say.
    fn change(&self) -> Option<f64> {
        let all: Option<Vec<f64>> = self.cycles.iter().map(|c| trend(c).map(|t| t.change)).collect();
        all.map(|all| all.into_iter().fold(0.0, f64::max))
    }
}

/// Passes the lines of a log on, the header where the log begins alone, and keeps their numbers.
struct Lines<'a, W> {
    log: &'a mut W,
    started: bool,
    rows: Vec<Vec<f64>>,
}

impl<W: Write> Write for Lines<'_, W> {
    /// Takes a line, which is written by one call.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        match std::str::from_utf8(line).ok().and_then(resume::row) {
            Some(row) => self.rows.push(row),
            None if self.started => return Ok(line.len()),
            None => self.started = true,
        }
        self.log.write_all(line)?;
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.log.flush()
    }
}

/// Swings until every joint is warm, or the time is over. The log gets every cycle, t running on from
/// `start`, which is 0 where a log begins; `seen` is what an earlier part of it showed. `progress` is given
/// the time and the greatest change that may still be to come. The log is written in the cycle: hand over a
/// [`Behind`](super::Behind) where it is a file.
///
/// # Errors
/// Where the arm stops, or the log cannot be written.
pub fn warm_up<B: Bus, const N: usize>(
    recorder: &mut Recorder<B, N>,
    settings: &WarmUpSettings,
    mut seen: Seen,
    start: f64,
    log: &mut impl Write,
    mut progress: impl FnMut(f64, Option<f64>),
) -> Result<Warmth, RecordError> {
    let motion = recorder.clear(seen.motion.clone())?;
    let begin = motion.motion().samples().next().and_then(|[q, ..]| <[f64; N]>::try_from(q).ok());
    if let Some(begin) = begin {
        recorder.go(&begin, 0.25, 1.0)?;
    }
    let mut time = LogTime::from(start);
    let mut lines = Lines { log, started: start > 0.0, rows: Vec::new() };
    loop {
        recorder.record(&motion, &mut time, Columns::Everything, &mut lines)?;
        seen.take(&std::mem::take(&mut lines.rows));
        let seconds = time.at(recorder.master().driver().synced_at());
        let change = seen.change();
        progress(seconds, change);
        let warm = change.is_some_and(|c| c < settings.tolerance);
        if warm || seconds >= settings.most {
            let joint = |cycles: Vec<Cycle>| JointWarmth {
                curve: exponential(&cycles),
                trend: trend(&cycles),
                cycles,
            };
            return Ok(Warmth { joints: seen.cycles.into_iter().map(joint).collect(), warm, seconds });
        }
    }
}

impl Warmth {
    /// The result as a JSON object.
    #[must_use]
    pub fn json(&self) -> Value {
        let joint = |(j, joint): (usize, &JointWarmth)| {
            let cycles: Vec<[f64; 2]> = joint.cycles.iter().map(|c| [c.time, c.torque]).collect();
            let curve = joint.curve.map(|c| {
                json!({"settled": c.settled, "excess": c.excess, "time_constant": c.time_constant, "rms": c.rms})
            });
            json!({"joint": j + 1, "cycles": cycles, "exponential": curve,
                "change_to_come": joint.trend.map(|t| t.change)})
        };
        json!({"warm": self.warm, "seconds": self.seconds,
            "joints": self.joints.iter().enumerate().map(joint).collect::<Vec<_>>()})
    }
}

#[cfg(test)]
#[cfg(feature = "demo")]
mod tests {
    use super::*;
    use crate::procedure::Envelope;
    use powerball_bus::driver::Driver;
    use powerball_bus::driver::lwa4p::LWA4P;
    use powerball_bus::transport::{Master, Memory};
    use powerball_virtual_arm::{PlantEffect, VirtualArm, lwa4p};

    /// An arm whose viscous friction falls by a fifth with 60 s: it is called warm when little of that is
    /// left, and the curve has that time constant.
    #[test]
    fn a_warming_arm_is_followed_until_it_is_warm() {
        let mut setup = lwa4p::setup([0.0; 6], 5).unwrap();
        setup.plant = setup.plant.with(PlantEffect::Temperature { change: -0.2, time_constant: 60.0 });
        let bus = Memory::new(VirtualArm::new(setup).unwrap(), LWA4P.bitrate);
        let mut recorder =
            Recorder::enable(Master::new(Driver::new(LWA4P).unwrap(), bus), Envelope::new(|_| None)).unwrap();
        let mut log = Vec::new();
        let settings = WarmUpSettings { most: 600.0, ..WarmUpSettings::default() };
        let seen = || Seen::new(swing(&LWA4P, &settings));
        let warmth = warm_up(&mut recorder, &settings, seen(), 0.0, &mut log, |_, _| ()).unwrap();
        assert!(warmth.warm && (120.0..500.0).contains(&warmth.seconds), "{}", warmth.seconds);
        let curve = warmth.joints[3].curve.unwrap();
        approx::assert_relative_eq!(curve.time_constant, 60.0, max_relative = 0.2);
        assert!(curve.excess > 0.0);
        // The log is one table with a time that rises throughout.
        let text = String::from_utf8(log).unwrap();
        let times: Vec<f64> =
            text.lines().skip(1).map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
        assert!(times.windows(2).all(|w| w[1] > w[0]) && text.matches("tau1").count() == 1);
        // One that is given no time is not called warm.
        let short = WarmUpSettings { most: 20.0, ..settings };
        assert!(!warm_up(&mut recorder, &short, seen(), 0.0, &mut Vec::new(), |_, _| ()).unwrap().warm);
        // The log holds all earlier results, except for a partial cycle; the log of another swing is not
        // used.
        let rows: Vec<Vec<f64>> =
            text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        let whole = seen().earlier(&rows[..rows.len() - 300]).unwrap();
        for (joint, seen) in warmth.joints.iter().zip(&whole.cycles) {
            assert_eq!(joint.cycles.len() - 1, seen.len());
            for (a, b) in joint.cycles.iter().zip(seen) {
                assert!((a.time - b.time).abs() < 1e-6 && a.torque == b.torque, "{a:?} {b:?}");
            }
        }
        let wider = WarmUpSettings { share: 0.9, ..settings };
        assert!(Seen::new(swing(&LWA4P, &wider)).earlier(&rows).is_none());
    }
}
