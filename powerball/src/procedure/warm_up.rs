//! Warming an arm up (§II.C): every joint swings until the torque that friction takes no longer changes.

use super::settling::{Cycle, Exponential, Trend, cycles, exponential, trend};
use super::{RecordError, Recorder};
use crate::bus::Bus;
use crate::driver::Profile;
use crate::motion::Motion;
use serde_json::{Value, json};
use std::io::Write;

/// How to swing, and when to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Length of a cycle, s.
    pub period: f64,
    /// Share of each joint's range, speed and acceleration that is used.
    pub share: f64,
    /// Greatest change of a joint's cycle-mean torque that may still be to come, as a share of it.
    pub tolerance: f64,
    /// An arm that is not warm by then is given up, s.
    pub most: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { period: 5.0, share: 0.6, tolerance: 0.01, most: 3600.0 }
    }
}

/// What was seen of a joint.
#[derive(Clone, Debug)]
pub struct JointWarmth {
    /// Its cycles.
    pub cycles: Vec<Cycle>,
    /// The exponential of Fig. 3, where there are cycles enough.
    pub curve: Option<Exponential>,
    /// The trend at the end.
    pub trend: Option<Trend>,
}

/// What came of a warm-up.
#[derive(Clone, Debug)]
pub struct Warmth {
    /// By joint.
    pub joints: Vec<JointWarmth>,
    /// Whether every joint is within the tolerance.
    pub warm: bool,
    /// How long it took, s.
    pub seconds: f64,
}

/// One cycle of all joints, from rest to rest at one end of their swings: q = middle − A·cos ωt, so that cycles follow each other
/// without a stop. Amplitudes keep the share of range, speed and acceleration.
#[must_use]
pub fn swing<const N: usize>(profile: &Profile<N>, settings: &Settings) -> Motion {
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

/// Swings until every joint is warm, or the time is over. The log gets every cycle, t running on; `progress` is told the time and
/// the greatest change that may still be to come.
///
/// # Errors
/// Where the arm stops, or the log cannot be written.
pub fn warm_up<B: Bus, const N: usize>(
    recorder: &mut Recorder<B, N>,
    settings: &Settings,
    log: &mut impl Write,
    mut progress: impl FnMut(f64, Option<f64>),
) -> Result<Warmth, RecordError> {
    let motion = swing(recorder.master().driver().profile(), settings);
    let start = motion.samples().next().and_then(|[q, ..]| <[f64; N]>::try_from(q).ok());
    if let Some(start) = start {
        recorder.go(&start, 0.25, 1.0)?;
    }
    let speeds: Vec<Vec<f64>> = (0..N).map(|j| motion.samples().map(|[_, dq, _]| dq[j]).collect()).collect();
    let mut seen: Vec<Vec<Cycle>> = vec![Vec::new(); N];
    let mut seconds = 0.0;
    loop {
        let mut text = Vec::new();
        recorder.record(&motion, seconds, false, &mut text)?;
        let text = String::from_utf8_lossy(&text);
        // The header is written once.
        let mut lines = text.split_inclusive('\n').skip(usize::from(seconds > 0.0));
        lines.try_for_each(|line| log.write_all(line.as_bytes())).map_err(RecordError::Write)?;
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').filter_map(|x| x.parse().ok()).collect())
            .filter(|row: &Vec<f64>| row.len() == 1 + 2 * N)
            .collect();
        // Lines may be missing; each knows by its time which sample it is.
        let sample = |row: &Vec<f64>| ((row[0] - seconds) / motion.period).round() as usize;
        let known: Vec<(usize, &Vec<f64>)> =
            rows.iter().map(|row| (sample(row), row)).filter(|(k, _)| *k < motion.len()).collect();
        let times: Vec<f64> = known.iter().map(|(k, _)| *k as f64 * motion.period).collect();
        let whole = times.first() == Some(&0.0) && times.last().is_some_and(|t| *t >= motion.duration());
        for (j, cycle) in seen.iter_mut().enumerate().filter(|_| whole) {
            let speed: Vec<f64> = known.iter().map(|(k, _)| speeds[j][*k]).collect();
            let torque: Vec<f64> = known.iter().map(|(_, row)| row[1 + N + j]).collect();
            let found = cycles(&times, &speed, &torque, motion.duration());
            cycle.extend(found.iter().map(|c| Cycle { time: c.time + seconds, ..*c }));
        }
        seconds += motion.len() as f64 * motion.period;
        let trends: Vec<Option<Trend>> = seen.iter().map(|c| trend(c)).collect();
        let change = trends.iter().map(|t| t.map(|t| t.change)).collect::<Option<Vec<f64>>>();
        let change = change.map(|all| all.into_iter().fold(0.0, f64::max));
        progress(seconds, change);
        let warm = change.is_some_and(|c| c < settings.tolerance);
        if warm || seconds >= settings.most {
            let joints = seen
                .into_iter()
                .zip(trends)
                .map(|(cycles, trend)| JointWarmth { curve: exponential(&cycles), cycles, trend })
                .collect();
            return Ok(Warmth { joints, warm, seconds });
        }
    }
}

impl Warmth {
    /// As a JSON object.
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
mod tests {
    use super::*;
    use crate::bus::{Master, Memory};
    use crate::driver::Driver;
    use crate::driver::lwa4p::LWA4P;
    use crate::virtual_arm::{Effect, VirtualArm, lwa4p};

    /// An arm whose viscous friction falls by a fifth with 60 s: it is called warm when little of that is left, and the curve
    /// has that time constant.
    #[test]
    fn a_warming_arm_is_followed_until_it_is_warm() {
        let mut setup = lwa4p::setup([0.0; 6], 5).unwrap();
        setup.plant = setup.plant.with(Effect::Temperature { change: -0.2, time_constant: 60.0 });
        let bus = Memory::new(VirtualArm::new(setup).unwrap(), LWA4P.bitrate);
        let mut recorder = Recorder::enable(Master::new(Driver::new(LWA4P).unwrap(), bus)).unwrap();
        let mut log = Vec::new();
        let settings = Settings { most: 600.0, ..Settings::default() };
        let warmth = warm_up(&mut recorder, &settings, &mut log, |_, _| ()).unwrap();
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
        let settings = Settings { most: 20.0, ..settings };
        assert!(!warm_up(&mut recorder, &settings, &mut Vec::new(), |_, _| ()).unwrap().warm);
    }
}
