//! An arm of its own: numeric Newton–Euler, Table 2 friction, and laws that are not the candidates' formulas.

use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::arm::ParameterKind;
use dyngen::exact::rational::to_f64;
use powerball_logs::log::Log;
use powerball_logs::regression::newton_euler::regressor;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;

pub(super) const RATE: f64 = 100.0;

/// What is added to the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Truth {
    Clean,
    LoadFriction,
    Stribeck,
    VelocityNonlinearity,
    Asymmetry,
    Hysteresis,
    FrictionByPosition,
    Payload,
    PayloadLater,
    Spring,
    Ripple,
    MotorRipple,
    Temperature,
    TimeDelay,
    TorqueConstant,
    EncoderOffset,
    BaseTilt,
    BrokenSymmetry,
    Contact,
    Coupling,
    Backlash,
    Elasticity,
    /// A tool that swings: no effect of the library.
    Swing,
}

impl Truth {
    pub(super) const ALL: [Truth; 21] = {
        use Truth::*;
        [
            LoadFriction,
            Stribeck,
            VelocityNonlinearity,
            Asymmetry,
            Hysteresis,
            FrictionByPosition,
            Payload,
            PayloadLater,
            Spring,
            Ripple,
            MotorRipple,
            Temperature,
            TimeDelay,
            TorqueConstant,
            EncoderOffset,
            BaseTilt,
            BrokenSymmetry,
            Contact,
            Coupling,
            Backlash,
            Elasticity,
        ]
    };

    pub(super) fn name(self) -> &'static str {
        match self {
            Truth::Clean => "clean",
            Truth::LoadFriction => "load_friction",
            Truth::Stribeck => "stribeck",
            Truth::VelocityNonlinearity => "velocity_nonlinearity",
            Truth::Asymmetry => "asymmetry",
            Truth::Hysteresis => "hysteresis",
            Truth::FrictionByPosition => "friction_by_position",
            Truth::Payload | Truth::PayloadLater => "payload",
            Truth::Spring => "spring",
            Truth::Ripple | Truth::MotorRipple => "position_ripple",
            Truth::Temperature => "temperature",
            Truth::TimeDelay => "time_delay",
            Truth::TorqueConstant => "torque_constant",
            Truth::EncoderOffset => "encoder_offset",
            Truth::BaseTilt => "base_tilt",
            Truth::BrokenSymmetry => "broken_symmetry",
            Truth::Contact => "contact_wrench",
            Truth::Coupling => "joint_coupling",
            Truth::Backlash => "backlash",
            Truth::Elasticity => "joint_elasticity",
            Truth::Swing => "a tool that swings",
        }
    }
}

/// Measurement noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Noise {
    White,
    /// First-order, with this time constant in s.
    Coloured(f64),
}

/// The arm of the tests: the LWA 4P with its gears.
pub(super) fn arm() -> Arm {
    let text =
        include_str!("../../../../controller/arm.toml").replace("rotor_ratio = 1\n", "rotor_ratio = 100\n");
    let mut arm = Arm::parse(&text, "arm.toml").unwrap();
    arm.groupings.clear();
    arm
}

/// Plausible parameters: cylinders of a few kilograms with the declared symmetries.
fn parameters(arm: &Arm, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut all = Vec::new();
    for (i, joint) in arm.joints.iter().enumerate() {
        let mass = rng.random_range(2.0..4.0) * 0.8f64.powi(i as i32);
        let mut c: [f64; 3] = std::array::from_fn(|_| rng.random_range(-0.08..0.08));
        if i == 1 {
            c[0] = -0.17;
        }
        for (k, kind) in [ParameterKind::Mx, ParameterKind::My, ParameterKind::Mz].into_iter().enumerate() {
            if joint.zero.contains(&kind) {
                c[k] = 0.0;
            }
        }
        let own: [f64; 3] = std::array::from_fn(|_| mass * rng.random_range(0.003..0.008));
        let [x, y, z] = c;
        let rotor = if joint.rotor_ratio.is_some() { rng.random_range(0.5..1.5) * 1e-5 } else { 0.0 };
        let mut of = vec![
            mass,
            mass * x,
            mass * y,
            mass * z,
            own[0] + mass * (y * y + z * z),
            mass * x * y,
            mass * x * z,
            own[1] + mass * (x * x + z * z),
            mass * y * z,
            own[2] + mass * (x * x + y * y),
            rotor,
        ];
        for kind in &joint.zero {
            of[*kind as usize] = 0.0;
        }
        all.extend(of);
    }
    all
}

/// Fourier paths: position, velocity, acceleration.
struct Motion {
    terms: Vec<Vec<(f64, f64, f64)>>,
    centre: Vec<f64>,
}

impl Motion {
    fn draw(n: usize, rng: &mut ChaCha8Rng) -> Motion {
        let joint = |rng: &mut ChaCha8Rng| -> Vec<(f64, f64, f64)> {
            (1..=5)
                .map(|l| {
                    let w = 2.0 * PI / 11.0 * f64::from(l);
                    (w, rng.random_range(-0.45..0.45) / w, rng.random_range(-0.45..0.45) / w)
                })
                .collect()
        };
        Motion {
            terms: (0..n).map(|_| joint(rng)).collect(),
            centre: (0..n).map(|_| rng.random_range(-0.4..0.4)).collect(),
        }
    }

    fn at(&self, t: f64) -> [Vec<f64>; 3] {
        let sum = |j: usize, d: u32| -> f64 {
            self.terms[j]
                .iter()
                .map(|(w, a, b)| {
                    let (s, c) = (w * t).sin_cos();
                    match d {
                        0 => a * s + b * c,
                        1 => w * (a * c - b * s),
                        _ => -w * w * (a * s + b * c),
                    }
                })
                .sum()
        };
        let n = self.terms.len();
        [
            (0..n).map(|j| sum(j, 0) + self.centre[j]).collect(),
            (0..n).map(|j| sum(j, 1)).collect(),
            (0..n).map(|j| sum(j, 2)).collect(),
        ]
    }
}

/// Logs of the plant with a truth of relative size `size` (1 is easily visible); the first `fit` are to be
/// fitted.
pub(super) fn record(
    arm: &Arm,
    truth: Truth,
    size: f64,
    noise: Noise,
    logs: usize,
    seconds: f64,
    seed: u64,
) -> Vec<Log> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = arm.dof();
    let all = parameters(arm, &mut rng);
    let mut out = Vec::new();
    let mut running = 0.0;
    // The joint that the effect is on; not the first, whose load is small, nor the last.
    let at = rng.random_range(1..n - 1);
    let other = (at + 1 + rng.random_range(0..n - 1)) % n;
    let other = if other == at { 0 } else { other };
    let friction = powerball_controller::friction::TABLE_2;
    let gravity: [f64; 3] = std::array::from_fn(|k| to_f64(&arm.gravity[k]));
    let torque_of = |q: &[f64], v: &[f64], a: &[f64], all: &[f64], g: [f64; 3]| -> Vec<f64> {
        let y = regressor(arm, q, v, a, g);
        (0..n).map(|j| (0..11 * n).map(|k| y[j * 11 * n + k] * all[k]).sum()).collect()
    };
    for log in 0..logs {
        let motion = Motion::draw(n, &mut rng);
        let count = (seconds * RATE) as usize;
        let (mut t, mut q_log) = (Vec::new(), vec![Vec::new(); n]);
        let mut tau_log = vec![Vec::new(); n];
        let mut z = 0.0;
        let mut swing = [0.0f64; 2];
        let mut colour = vec![0.0; n];
        let mut previous = motion.at(0.0)[0][at];
        let mut play = 0.0f64;
        for k in 0..count {
            let now = k as f64 / RATE;
            let time = if truth == Truth::TimeDelay { now - 0.006 * size } else { now };
            let [q, v, a] = motion.at(time);
            let (mut q_true, mut v_true, mut a_true) = (q.clone(), v.clone(), a.clone());
            let mut values = all.clone();
            let mut g = gravity;
            match truth {
                Truth::EncoderOffset => q_true[at] -= 0.03 * size,
                Truth::BaseTilt => {
                    let tilt = 0.02 * size;
                    g = [gravity[0], tilt * gravity[2].abs(), gravity[2]];
                }
                Truth::BrokenSymmetry => {
                    let zero = [
                        (2, ParameterKind::Mx),
                        (3, ParameterKind::Mx),
                        (4, ParameterKind::Mx),
                        (1, ParameterKind::My),
                    ];
                    let (link, kind) = zero[at % 4];
                    values[11 * link + kind as usize] += 0.06 * size;
                }
                Truth::Payload | Truth::PayloadLater
                    if (log == 1 || log == 3) && (truth == Truth::Payload || now > 0.4 * seconds) =>
                {
                    let (m, [x, y, z]) = (0.5 * size, [0.03, -0.02, 0.08]);
                    let add = [
                        m,
                        m * x,
                        m * y,
                        m * z,
                        m * (y * y + z * z + 0.001),
                        m * x * y,
                        m * x * z,
                        m * (x * x + z * z + 0.001),
                        m * y * z,
                        m * (x * x + y * y + 0.001),
                    ];
                    for (k, value) in add.into_iter().enumerate() {
                        values[11 * (n - 1) + k] += value;
                    }
                }
                Truth::Elasticity => {
                    // One fixed-point step of q_link = q − τ/K, differentiated along the path.
                    let stiffness = 1500.0 / size;
                    let h = 1e-3;
                    let d = |t: f64| {
                        let [q, v, a] = motion.at(t);
                        -torque_of(&q, &v, &a, &all, gravity)[at] / stiffness
                    };
                    let (m, c, p) = (d(time - h), d(time), d(time + h));
                    q_true[at] += c;
                    v_true[at] += (p - m) / (2.0 * h);
                    a_true[at] += (p - 2.0 * c + m) / (h * h);
                }
                _ => {}
            }
            let rigid = torque_of(&q_true, &v_true, &a_true, &values, g);
            let mut tau: Vec<f64> = (0..n)
                .map(|j| {
                    let [g1, g2, g3, g4, g5] = friction[j];
                    let f = g1 * (g2 * v[j]).tanh() + g3 * (g4 * v[j]).tanh() + g5 * v[j];
                    let warm = 1.0 - 0.15 * size * (1.0 - (-(running + now) / 60.0).exp());
                    rigid[j] + if truth == Truth::Temperature && j == at { f * warm } else { f }
                })
                .collect();
            let scale = [1.0, 1.2, 1.0, 0.6, 0.12, 0.1][at.min(5)] * size;
            let (x, velocity) = (q[at], v[at]);
            let sign = velocity.signum();
            tau[at] += match truth {
                Truth::LoadFriction => {
                    0.08 * size * (rigid[at].powi(2) + 0.01).sqrt() * (300.0 * velocity).tanh()
                }
                Truth::Stribeck => scale * sign / (1.0 + (velocity / 0.06).powi(2)),
                Truth::VelocityNonlinearity => 3.0 * scale * sign * velocity.abs().powf(1.8),
                Truth::Asymmetry => {
                    if velocity > 0.0 {
                        0.6 * scale
                    } else {
                        -0.1 * scale
                    }
                }
                Truth::Hysteresis => {
                    z = f64::clamp(z + (x - previous) / 0.004, -1.0, 1.0);
                    previous = x;
                    2.5 * scale * (z - (200.0 * velocity).tanh())
                }
                // A stretch where the seal is pressed on.
                Truth::FrictionByPosition => {
                    scale * (200.0 * velocity).tanh() * (1.0 + (1.3 * (x - 0.4).sin()).tanh())
                }
                Truth::Spring => scale * ((x - 0.2) + 0.2 * (x - 0.2).powi(3)),
                Truth::Ripple => 0.4 * scale * ((7.0 * x + 0.5).cos() + 0.2 * (14.0 * x).cos()),
                Truth::MotorRipple => 0.4 * scale * (200.0 * x + 0.5).cos(),
                Truth::Coupling => 0.8 * scale * (v[other] + 0.1 * (20.0 * v[other]).tanh()),
                Truth::TorqueConstant => -0.06 * size * tau[at],
                Truth::Swing => {
                    let w = 2.0 * PI * 5.0;
                    swing[1] -= (w * w * swing[0] + 0.06 * w * swing[1] + a[at]) / RATE;
                    swing[0] += swing[1] / RATE;
                    15.0 * scale * w * w * swing[0]
                }
                Truth::Backlash => {
                    // Lost motion: the load is not carried while the play is crossed.
                    play = f64::clamp(play + (x - previous), -0.01, 0.01);
                    previous = x;
                    if play.abs() < 0.0099 { -0.6 * size * rigid[at] } else { 0.0 }
                }
                _ => 0.0,
            };
            if truth == Truth::Contact && log == 2 && (8.0..11.0).contains(&now) {
                let force = [8.0 * size, -5.0 * size, 3.0 * size];
                for (axis, f) in force.iter().enumerate() {
                    let mut unit = [0.0; 3];
                    unit[axis] = 1.0;
                    let still = vec![0.0; n];
                    let y = regressor(arm, &q, &still, &still, unit);
                    for j in 0..n {
                        tau[j] += f * y[j * 11 * n + 11 * (n - 1)];
                    }
                }
            }
            let at_now = motion.at(now)[0].clone();
            t.push(now);
            for j in 0..n {
                let sigma = [0.4, 0.4, 0.3, 0.2, 0.05, 0.05][j.min(5)];
                let white: f64 = StandardNormal.sample(&mut rng);
                let e = match noise {
                    Noise::White => white,
                    Noise::Coloured(time) => {
                        let keep = (-1.0 / (time * RATE)).exp();
                        colour[j] = keep * colour[j] + (1.0 - keep * keep).sqrt() * white;
                        0.5 * colour[j]
                    }
                };
                tau_log[j].push(tau[j] + sigma * e);
                let step = 0.001 * PI / 180.0;
                q_log[j].push((at_now[j] / step).round() * step);
            }
        }
        running += seconds;
        out.push(Log {
            file: format!("log{log}.csv"),
            pieces: std::iter::once(0..t.len()).collect(),
            doubts: Vec::new(),
            t,
            q: q_log,
            torque: tau_log,
            temperature: None,
            motor: None,
            clock: 0.0,
        });
    }
    powerball_logs::log::common_clock(&mut out);
    out
}
