//! Torques that are no effect of the library, and other laws of friction: functions of the true motion.

use chacha20::ChaCha8Rng;
use powerball::identification::motion::Motion;
use powerball::virtual_arm::Plant;
use rand::RngExt;
use std::f64::consts::{PI, TAU};

/// What a joint feels along a motion, N·m for each sample and joint.
pub(super) trait ExtraTorque {
    /// The torques along `motion`, which begins at `start` s, `n` values a sample.
    fn torques(&self, motion: &Motion, start: f64) -> Vec<f64>;
}

/// Kinds of torque outside the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outside {
    /// A hose over two joints: torque with the product of two positions.
    CrossSpring,
    /// A tool that swings at its own frequency, driven by the joint's acceleration.
    Resonance,
    /// Friction that differs along the joint's range: a bearing pinched on one side.
    PinchedBearing,
    /// A torque sensor's zero that wanders.
    Wander,
    /// Losses with the product of two joints' velocities.
    Windage,
}

impl Outside {
    pub(super) const ALL: [Outside; 5] = [
        Outside::CrossSpring,
        Outside::Resonance,
        Outside::PinchedBearing,
        Outside::Wander,
        Outside::Windage,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Outside::CrossSpring => "cross_spring",
            Outside::Resonance => "resonance",
            Outside::PinchedBearing => "pinched_bearing",
            Outside::Wander => "wander",
            Outside::Windage => "windage",
        }
    }
}

/// One of them on a joint.
#[derive(Clone, Debug)]
pub(super) struct OutsideLaw {
    pub(super) kind: Outside,
    pub(super) joint: usize,
    other: usize,
    /// N·m.
    pub(super) amplitude: f64,
    /// Of the phases, frequencies and times that the kind has.
    numbers: [f64; 8],
}

impl OutsideLaw {
    pub(super) fn draw(kind: Outside, plant: &Plant, rng: &mut ChaCha8Rng) -> OutsideLaw {
        let n = plant.friction().len();
        let joint = rng.random_range(0..n);
        let other = (joint + rng.random_range(1..n)) % n;
        OutsideLaw {
            kind,
            joint,
            other,
            amplitude: 1.0,
            numbers: std::array::from_fn(|_| rng.random_range(0.0..1.0)),
        }
    }

    pub(super) fn scaled(&self, factor: f64) -> OutsideLaw {
        OutsideLaw { amplitude: self.amplitude * factor, ..self.clone() }
    }
}

impl ExtraTorque for OutsideLaw {
    fn torques(&self, motion: &Motion, start: f64) -> Vec<f64> {
        let n = motion.dof();
        let mut out = vec![0.0; motion.q.len()];
        let (mut x, mut v) = (0.0, 0.0);
        for (k, [q, dq, ddq]) in motion.samples().enumerate() {
            let t = start + k as f64 * motion.period;
            let (i, j) = (self.joint, self.other);
            let torque = match self.kind {
                Outside::CrossSpring => (q[i] - self.numbers[0]) * (q[j] - self.numbers[1]),
                Outside::Resonance => {
                    let w = TAU * (4.0 + 4.0 * self.numbers[0]);
                    let h = motion.period;
                    v += h * (-w * w * x - 2.0 * 0.03 * w * v - ddq[i]);
                    x += h * v;
                    w * w * x
                }
                Outside::PinchedBearing => {
                    let place = 1.0 / (1.0 + ((q[i] - self.numbers[0] + 0.5) / 0.3).powi(2));
                    place * dq[i] / dq[i].hypot(0.01)
                }
                Outside::Wander => (0..8)
                    .map(|m| {
                        let m = f64::from(m);
                        let w = TAU / (7.0 + 11.0 * m);
                        (w * t + TAU * self.numbers[m as usize]).sin() * (1.0 + m).sqrt() / 4.0
                    })
                    .sum(),
                Outside::Windage => dq[i] * dq[j].abs() + 0.5 * dq[i] * dq[j],
            };
            out[k * n + i] = self.amplitude * torque;
        }
        out
    }
}

/// A misfit of every joint that is a smooth function of all positions and velocities.
#[derive(Clone, Debug)]
pub(super) struct Misfit {
    /// N·m by joint.
    pub(super) amplitude: Vec<f64>,
    /// For each joint: waves of direction in (q, dq) and phase.
    waves: Vec<Vec<(Vec<f64>, f64)>>,
}

impl Misfit {
    pub(super) fn draw(n: usize, rng: &mut ChaCha8Rng) -> Misfit {
        let mut wave = || {
            let direction = (0..2 * n).map(|_| rng.random_range(-1.2..1.2)).collect();
            (direction, rng.random_range(-PI..PI))
        };
        Misfit { amplitude: vec![1.0; n], waves: (0..n).map(|_| (0..6).map(|_| wave()).collect()).collect() }
    }
}

impl ExtraTorque for Misfit {
    fn torques(&self, motion: &Motion, _start: f64) -> Vec<f64> {
        let mut out = Vec::with_capacity(motion.q.len());
        for [q, dq, _] in motion.samples() {
            for (amplitude, waves) in self.amplitude.iter().zip(&self.waves) {
                let sum: f64 = (waves.iter())
                    .map(|(direction, phase)| {
                        let (along_q, along_dq) = direction.split_at(q.len());
                        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                        (dot(along_q, q) + dot(along_dq, dq) + phase).sin()
                    })
                    .sum();
                out.push(amplitude * sum);
            }
        }
        out
    }
}

/// Friction of another law in the place of Eq. 16.
#[derive(Clone, Copy, Debug)]
pub(super) enum OtherLaw {
    /// Coulomb friction that sets in like an algebraic curve, and viscous friction.
    Algebraic,
    /// Coulomb friction that sets in like an arc tangent, and viscous friction.
    ArcTangent,
    /// An error function in the place of each tanh: close to Eq. 16 but no sum of them.
    Gudermann,
}

impl OtherLaw {
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> OtherLaw {
        [OtherLaw::Algebraic, OtherLaw::ArcTangent, OtherLaw::Gudermann][rng.random_range(0..3)]
    }
}

/// The law, and the friction that it takes the place of.
pub(super) struct OtherFriction<'a> {
    pub(super) law: OtherLaw,
    pub(super) plant: &'a Plant,
}

impl ExtraTorque for OtherFriction<'_> {
    fn torques(&self, motion: &Motion, _start: f64) -> Vec<f64> {
        let mut out = Vec::with_capacity(motion.q.len());
        for [_, dq, _] in motion.samples() {
            for (v, g) in dq.iter().zip(self.plant.friction()) {
                let coulomb = g.gamma1 + g.gamma3;
                let other = match self.law {
                    OtherLaw::Algebraic => coulomb * v / v.hypot(0.01) + g.gamma5 * v,
                    OtherLaw::ArcTangent => coulomb * (v / 0.004).atan() * 2.0 / PI + g.gamma5 * v,
                    OtherLaw::Gudermann => {
                        let curve = |x: f64| 2.0 / PI * (0.5 * PI * x).sinh().atan();
                        g.gamma1 * curve(g.gamma2 * v) + g.gamma3 * curve(g.gamma4 * v) + g.gamma5 * v
                    }
                };
                out.push(other - g.torque(*v));
            }
        }
        out
    }
}
