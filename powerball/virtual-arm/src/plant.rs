//! The plant: an arm that follows a motion, and the log that its drives would give.
//!
//! The module also has the file of a virtual arm, with the effect that no model knows.

use super::dynamics::Dynamics;
use super::effect::{Instant, PlantEffect, State};
use super::slave::Setup;
use super::{VirtualArm, lwa4p};
use chacha20::ChaCha8Rng;
use dyngen::Diagnostics;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::Log;
use powerball_logs::motion::Motion;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The sensors of the drives, and their noise.
#[derive(Clone, Debug)]
pub struct Sensors {
    /// Samples a second.
    pub rate: f64,
    /// Step of the encoders, rad.
    pub encoder_step: f64,
    /// White torque noise of each joint, N·m standard deviation of a sample.
    pub white: Vec<f64>,
    /// Slow torque noise of each joint, N·m standard deviation.
    pub coloured: Vec<f64>,
    /// Correlation time of the slow noise, s.
    pub colour_time: f64,
}

/// An arm with friction, sensors and possibly effects that no model knows about.
#[derive(Clone, Debug)]
pub struct Plant {
    dynamics: Dynamics,
    friction: Vec<TanhFriction<f64>>,
    sensors: Sensors,
    effects: Vec<PlantEffect>,
}

/// A log as the drives give it.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedLog {
    dof: usize,
    /// Times, s.
    pub t: Vec<f64>,
    /// Measured joint positions, n values a sample, rad.
    pub q: Vec<f64>,
    /// Measured joint torques, n values a sample, N·m.
    pub tau: Vec<f64>,
}

impl Plant {
    /// A plant; every joint needs its friction and its noise.
    pub fn new(dynamics: Dynamics, friction: Vec<TanhFriction<f64>>, sensors: Sensors) -> Self {
        Plant { dynamics, friction, sensors, effects: Vec::new() }
    }

    /// The plant with one more effect.
    #[must_use]
    pub fn with(mut self, effect: PlantEffect) -> Self {
        self.effects.push(effect);
        self
    }

    /// The rigid-body dynamics without effects.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// The friction of each joint without effects: of its motor, where a transmission couples joints.
    pub fn friction(&self) -> &[TanhFriction<f64>] {
        &self.friction
    }

    /// The sensors.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Follows a motion exactly, as a stiff position servo does, and records it from time `start` (s) on.
    ///
    /// Equal plant, motion, start and seed give the same log, to the bit.
    pub fn record(&self, motion: &Motion, start: f64, seed: u64) -> SimulatedLog {
        let n = motion.dof();
        let mut torques = Vec::with_capacity(motion.q.len());
        let mut windups = vec![0.0; motion.q.len()];
        let mut states = vec![State::default(); self.effects.len()];
        for (k, [q, dq, ddq]) in motion.samples().enumerate() {
            let t = start + k as f64 * motion.period;
            let rigid = self.rigid_torques(t, q, dq, ddq);
            let instant =
                Instant { t, q, dq, rigid: &rigid, friction: &self.friction, dynamics: &self.dynamics };
            let mut tau = rigid.clone();
            for (effect, state) in self.effects.iter().zip(&mut states) {
                effect.add_torque(&instant, state, &mut tau);
                effect.add_windup(&instant, &mut windups[k * n..(k + 1) * n]);
            }
            torques.extend(tau);
        }
        // Eq. 16 is of the motor's side of the gear, where the encoder sits as well.
        for (k, [_, dq, _]) in motion.samples().enumerate() {
            let (last, next) = (k.saturating_sub(1), (k + 1).min(motion.len() - 1));
            let time = (next - last).max(1) as f64 * motion.period;
            let winding = |i: usize| (windups[next * n + i] - windups[last * n + i]) / time;
            let rates: Vec<f64> = dq.iter().enumerate().map(|(i, dq)| dq + winding(i)).collect();
            let chain = self.dynamics.chain();
            for (i, law) in self.friction.iter().enumerate() {
                let spent = law.torque(chain.motor_rate(i, &rates));
                chain.add_motor_torque(i, spent, &mut torques[k * n..(k + 1) * n]);
            }
        }
        let positions: Vec<f64> = motion.q.iter().zip(&windups).map(|(q, w)| q + w).collect();
        let mut recording = SimulatedLog {
            dof: n,
            t: (0..motion.len()).map(|k| start + k as f64 * motion.period).collect(),
            q: positions,
            tau: torques,
        };
        for effect in &self.effects {
            effect.distort(&mut recording.q, &mut recording.tau, n, motion.period);
        }
        self.measure(&mut recording, motion.period, seed);
        recording
    }

    /// The torques of the bodies alone, as the effects make them at that time.
    fn rigid_torques(&self, t: f64, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        self.changed_dynamics(t).as_ref().unwrap_or(&self.dynamics).inverse(q, dq, ddq)
    }

    /// The rigid bodies at time `t` with all effects that change them; `None` where none does.
    pub(super) fn changed_dynamics(&self, t: f64) -> Option<Dynamics> {
        self.effects.iter().fold(None, |changed: Option<Dynamics>, effect| {
            effect.changed_dynamics(changed.as_ref().unwrap_or(&self.dynamics), t).or(changed)
        })
    }

    /// The effects, in the order in which they were added.
    pub fn effects(&self) -> &[PlantEffect] {
        &self.effects
    }

    /// Encoder steps and torque noise.
    fn measure(&self, recording: &mut SimulatedLog, period: f64, seed: u64) {
        let step = self.sensors.encoder_step;
        if step > 0.0 {
            recording.q.iter_mut().for_each(|q| *q = (*q / step).round() * step);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let keep = (-period / self.sensors.colour_time).exp();
        let mut slow: Vec<f64> = self.sensors.coloured.iter().map(|s| s * normal()).collect();
        for tau in recording.tau.chunks_exact_mut(recording.dof) {
            for i in 0..tau.len() {
                slow[i] = keep * slow[i] + (1.0 - keep * keep).sqrt() * self.sensors.coloured[i] * normal();
                tau[i] += slow[i] + self.sensors.white[i] * normal();
            }
        }
    }
}

impl SimulatedLog {
    /// The number of joints n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The recording as a log.
    pub fn log(&self, file: impl Into<String>) -> Log {
        let n = self.dof;
        let by_joint = |values: &[f64]| -> Vec<Vec<f64>> {
            (0..n).map(|j| values.iter().skip(j).step_by(n).copied().collect()).collect()
        };
        Log {
            file: file.into(),
            q: by_joint(&self.q),
            torque: by_joint(&self.tau),
            temperature: None,
            motor: None,
            pieces: std::iter::once(0..self.t.len()).collect(),
            doubts: Vec::new(),
            clock: 0.0,
            t: self.t.clone(),
        }
    }

    /// The recording as CSV with a header line: `t`, `q1…qn`, `tau1…taun`.
    pub fn to_csv(&self) -> String {
        let mut out = String::from("t");
        for name in ["q", "tau"] {
            for joint in 1..=self.dof {
                let _ = write!(out, ",{name}{joint}");
            }
        }
        out.push('\n');
        for (k, t) in self.t.iter().enumerate() {
            let row = k * self.dof..(k + 1) * self.dof;
            let _ = write!(out, "{t:.4}");
            for q in &self.q[row.clone()] {
                // A digit finer than the encoders' step.
                let _ = write!(out, ",{q:.7}");
            }
            for tau in &self.tau[row] {
                let _ = write!(out, ",{tau:.4}");
            }
            out.push('\n');
        }
        out
    }

    /// Writes the log to a file.
    ///
    /// # Errors
    /// What the file system says.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        std::fs::write(path, self.to_csv())
    }
}

// The virtual arm with what no model knows about it, as a file: so that the arm of a session can be met
// again.

/// A virtual LWA 4P by its undeclared effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Undeclared {
    /// The effect that is in the plant and in no model.
    pub effect: PlantEffect,
    /// Age of the plant, s: what warms has been warming for this time.
    pub age: f64,
}

impl Undeclared {
    /// The file's name in the folder of a session.
    pub const FILE: &'static str = "virtual_arm.json";

    /// The file of the session that an arm file is of, where there is one: in the same folder.
    pub fn next_to(arm: &Path) -> Option<PathBuf> {
        Some(arm.with_file_name(Self::FILE)).filter(|file| file.is_file())
    }

    /// Reads it.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn read(path: &Path) -> Result<Undeclared, String> {
        let text =
            dyngen::file::text(path).map_err(|e| format!("{}: cannot be read: {e}", path.display()))?;
        serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// The arm with closed brakes at `start`, rad; `seed` draws the sensors' noise, and where `commutated`
    /// the motors know their commutation already.
    ///
    /// # Errors
    /// None for the arm file that is built in.
    pub fn arm(&self, start: [f64; 6], seed: u64, commutated: bool) -> Result<VirtualArm, Diagnostics> {
        let mut setup = self.setup(start, seed)?;
        setup.modules.iter_mut().for_each(|module| module.commutated = commutated);
        VirtualArm::new(setup).ok_or_else(|| Diagnostics::whole_file("lwa4p.toml", "six joints are needed"))
    }

    /// The plant and its drives.
    ///
    /// # Errors
    /// None for the arm file that is built in.
    pub fn setup(&self, start: [f64; 6], seed: u64) -> Result<Setup, Diagnostics> {
        let setup = lwa4p::setup(start, seed)?;
        let plant = setup.plant.clone().with(self.effect.clone());
        Ok(Setup { plant, age: self.age, ..setup })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lwa4p;

    /// Every joint swings at its own pace, 20 s.
    fn swing() -> Motion {
        let mut motion = Motion::new(6, 0.005);
        for k in 0..4000 {
            let t = k as f64 * 0.005;
            motion.push((0..6).map(|i| {
                let w = 0.7 + 0.2 * i as f64;
                let (s, c) = (w * t).sin_cos();
                [0.6 * s, 0.6 * w * c, -0.6 * w * w * s]
            }));
        }
        motion
    }

    fn quiet() -> Plant {
        let mut plant = lwa4p::plant().unwrap();
        plant.sensors.encoder_step = 0.0;
        plant.sensors.white.fill(0.0);
        plant.sensors.coloured.fill(0.0);
        plant
    }

    #[test]
    fn the_virtual_arm_is_possible_and_keeps_its_declared_symmetries() {
        let (arm, plant) = (lwa4p::arm().unwrap(), lwa4p::plant().unwrap());
        let parameters: Vec<f64> = lwa4p::links().iter().flat_map(super::super::Body::parameters).collect();
        for parameter in arm.all_parameters().into_iter().filter(|p| !arm.keeps(*p)) {
            assert_eq!(parameters[parameter.index()], 0.0, "{parameter}");
        }
        for [q, ..] in swing().samples().step_by(97) {
            assert!(plant.dynamics().forward(q, &[0.0; 6], &[0.0; 6]).is_some());
        }
        let mass: f64 = plant.dynamics().bodies().iter().map(|b| b.mass).sum();
        assert!((12.0..15.0).contains(&mass), "{mass} kg; the maker says 12 to 15");
    }

    #[test]
    fn a_log_is_the_same_for_the_same_seed_and_carries_the_noise_it_should() {
        let (plant, motion) = (lwa4p::plant().unwrap(), swing());
        let log = plant.record(&motion, 0.0, 7);
        assert_eq!(log, plant.record(&motion, 0.0, 7));
        let other = plant.record(&motion, 0.0, 8);
        let truth = quiet().record(&motion, 0.0, 0);
        for i in 0..6 {
            let rms = |a: &SimulatedLog, b: &SimulatedLog| {
                let sum: f64 =
                    a.tau.iter().zip(&b.tau).skip(i).step_by(6).map(|(a, b)| (a - b).powi(2)).sum();
                (sum / motion.len() as f64).sqrt()
            };
            let want = plant.sensors.white[i].hypot(plant.sensors.coloured[i]);
            approx::assert_relative_eq!(rms(&log, &truth), want, max_relative = 0.1);
            approx::assert_relative_eq!(rms(&log, &other), want * 2f64.sqrt(), max_relative = 0.1);
        }
        let half_step = 0.5 * plant.sensors.encoder_step;
        assert!(log.q.iter().zip(&truth.q).all(|(a, b)| (a - b).abs() <= half_step * 1.0001));
        assert!(log.to_csv().starts_with("t,q1,q2,q3,q4,q5,q6,tau1,tau2,tau3,tau4,tau5,tau6\n0.0000,"));
    }

    #[test]
    fn effects_act_where_they_sit_and_those_that_are_friction_dissipate() {
        let motion = swing();
        let plain = quiet().record(&motion, 0.0, 0);
        for name in PlantEffect::NAMES {
            for seed in 0..5 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let effect =
                    lwa4p::draw_effect(name, &lwa4p::plant().unwrap(), 20.0, 5.0..15.0, &mut rng).unwrap();
                let with = quiet().with(effect.clone()).record(&motion, 0.0, 0);
                let change: Vec<f64> = with.tau.iter().zip(&plain.tau).map(|(a, b)| a - b).collect();
                let largest =
                    change.iter().zip(&with.q).zip(&plain.q).map(|((t, a), b)| t.abs() + (a - b).abs());
                assert!(largest.fold(0.0, f64::max) > 1e-3, "{effect:?} changes nothing");
                let touched: Vec<usize> = (0..6)
                    .filter(|i| change.iter().skip(*i).step_by(6).any(|t| *t != 0.0))
                    .map(|i| i + 1)
                    .collect();
                if !effect.joints().is_empty() && !touched.is_empty() {
                    assert_eq!(touched, effect.joints(), "{effect:?}");
                }
                if ["load_friction", "stribeck", "velocity_nonlinearity", "hysteresis"].contains(&name) {
                    let work: f64 = change.iter().zip(&motion.dq).map(|(t, v)| t * v).sum();
                    assert!(work > 0.0, "{effect:?}");
                }
            }
        }
    }
}

#[cfg(test)]
mod undeclared_tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::SeedableRng;

    #[test]
    fn every_effect_survives_its_file() {
        let plant = lwa4p::plant().unwrap();
        for (seed, name) in PlantEffect::NAMES.into_iter().enumerate() {
            let mut rng = ChaCha8Rng::seed_from_u64(seed as u64);
            let effect = lwa4p::draw_effect(name, &plant, 100.0, 1.0..2.0, &mut rng).unwrap();
            let undeclared = Undeclared { effect, age: 100.0 };
            let text = serde_json::to_string(&undeclared).unwrap();
            assert!(text.contains(name), "{text}");
            // Numbers are read to the last digit but one.
            let read: Undeclared = serde_json::from_str(&text).unwrap();
            assert_eq!(read.effect.describe(), undeclared.effect.describe());
            assert_eq!((read.effect.joints(), read.age), (undeclared.effect.joints(), undeclared.age));
        }
        let wrong = serde_json::from_str::<Undeclared>("{\"effect\": {\"magic\": {}}, \"age\": 0}");
        assert!(wrong.unwrap_err().to_string().contains("magic"));
    }
}
