//! An arm with a closed loop, and logs of it. Each crate whose tests need one has this file as a module; the
//! module around it has `Fourier` and `Harmonics`.

use super::{Fourier, Harmonics};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::exact::rational::to_f64;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::Log;
use powerball_logs::regression::newton_euler::regressor;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// A palletiser with a wrist, whose forearm is moved by a crank through a rod.
pub(crate) const ARM: &str = r#"
name = "palletiser"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = 0, d = 0.5, theta = 0, rotor_ratio = 100 },
    { kind = "revolute", a = 0.3, alpha = "-pi/2", d = 0, theta = "-pi/2", rotor_ratio = 100 },
    { kind = "revolute", a = 1.1, alpha = 0, d = 0.05, theta = 0, rotor_ratio = 100 },
    { kind = "revolute", a = 0.2, alpha = "pi/2", d = 0.1, theta = 0 },
]
[[loop]]
joints = [3, "tail", "rod end", "crank"]
lengths = [0.25, 1.1, 0.25, 1.1]
inner = "pi"
outer = "pi"
bar = [{ name = "rod" }, { name = "crank" }]
"#;
/// Bodies as balls: mass, kg, centre, m, and radius of gyration, m.
const BODIES: [(f64, [f64; 3], f64); 6] = [
    (30.0, [0.1, 0.02, 0.1], 0.25),
    (12.0, [0.5, 0.02, 0.03], 0.3),
    (9.0, [0.4, 0.05, 0.02], 0.3),
    (2.0, [0.01, 0.02, 0.05], 0.1),
    (2.5, [0.5, 0.01, 0.02], 0.3),
    (3.0, [0.1, 0.01, 0.02], 0.08),
];
/// By joint: friction, N·m, and noise, N·m.
const JOINTS: [[f64; 2]; 4] = [[3.0, 0.3], [5.0, 0.3], [4.0, 0.3], [1.0, 0.05]];
/// The number of the rod among the bodies, which follow the links.
pub(crate) const ROD: usize = JOINTS.len();
/// A point on the rod, off the line between the pins: no body on a single link has the same weight. Its mass,
/// kg, and place, m.
pub(crate) const LOAD: (f64, [f64; 3]) = (1.5, [0.6, 0.15, 0.0]);
/// Samples a second.
const RATE: f64 = 100.0;

fn add(parameters: &mut [f64], mass: f64, [x, y, z]: [f64; 3], gyration: f64) {
    let own = gyration * gyration;
    let unit =
        [1.0, x, y, z, y * y + z * z + own, x * y, x * z, x * x + z * z + own, y * z, x * x + y * y + own];
    parameters.iter_mut().zip(unit).for_each(|(p, u)| *p += mass * u);
}

/// A log of the arm on a drawn path, with a point of a mass at a place of a body, if any.
pub(crate) fn record(arm: &Arm, load: Option<(usize, (f64, [f64; 3]))>, rng: &mut ChaCha8Rng) -> Log {
    let mut all = vec![0.0; arm.all_parameters().len()];
    for (link, (mass, centre, gyration)) in BODIES.into_iter().enumerate() {
        add(&mut all[11 * link..], mass, centre, gyration);
    }
    (0..3).for_each(|joint| all[11 * joint + 10] = 2e-4);
    if let Some((body, (mass, place))) = load {
        add(&mut all[11 * body..], mass, place, 0.0);
    }
    let mut draw = || (0..5).map(|k| 0.4 * rng.random_range(-1.0..1.0) / f64::from(k + 1)).collect();
    let joints = JOINTS.map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).to_vec();
    let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints }.sample(RATE);
    let friction = JOINTS.map(|[f, _]| TanhFriction::new([0.7 * f, 60.0, 0.3 * f, 4.0, f]));
    let gravity = arm.gravity.each_ref().map(to_f64);
    let (mut q_log, mut torque) = (vec![Vec::new(); JOINTS.len()], vec![Vec::new(); JOINTS.len()]);
    for [q, dq, ddq] in path.samples() {
        let y = regressor(arm, q, dq, ddq, gravity);
        for (j, row) in y.chunks_exact(all.len()).enumerate() {
            let noise: f64 = StandardNormal.sample(rng);
            let rigid: f64 = row.iter().zip(&all).map(|(y, p)| y * p).sum();
            q_log[j].push(q[j]);
            torque[j].push(rigid + friction[j].torque(dq[j]) + JOINTS[j][1] * noise);
        }
    }
    let count = q_log[0].len();
    Log {
        file: "log.csv".into(),
        pieces: std::iter::once(0..count).collect(),
        doubts: Vec::new(),
        t: (0..count).map(|k| k as f64 / RATE).collect(),
        q: q_log,
        torque,
        temperature: None,
        motor: None,
        clock: 0.0,
    }
}
