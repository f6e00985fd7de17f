//! Fits of an arm with a closed loop.

use super::{compared, fitted_to};
use crate::comparison::{Cause, Side};
use crate::excite::{Fourier, Harmonics};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::exact::rational::to_f64;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::Log;
use powerball_logs::regression::RigidArm;
use powerball_logs::regression::newton_euler::regressor;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// A palletiser with a wrist, whose forearm is moved by a crank through a rod.
const ARM: &str = r#"
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
/// Bodies as balls: mass, kg, and centre, m; their radius of gyration, m.
const BODIES: [(f64, [f64; 3]); 6] = [
    (30.0, [0.1, 0.02, 0.1]),
    (12.0, [0.5, 0.02, 0.03]),
    (9.0, [0.4, 0.05, 0.02]),
    (2.0, [0.01, 0.02, 0.05]),
    (2.5, [0.5, 0.01, 0.02]),
    (3.0, [0.1, 0.01, 0.02]),
];
const GYRATION: f64 = 0.1;
const RATE: f64 = 100.0;

fn add(parameters: &mut [f64], mass: f64, [x, y, z]: [f64; 3], gyration: f64) {
    let own = gyration * gyration;
    let unit =
        [1.0, x, y, z, y * y + z * z + own, x * y, x * z, x * x + z * z + own, y * z, x * x + y * y + own];
    parameters.iter_mut().zip(unit).for_each(|(p, u)| *p += mass * u);
}

/// A fit of three logs of the arm with 1.5 kg on a body.
fn fitted(body: &RigidArm, load: Option<(usize, [f64; 3])>, seed: u64) -> Side {
    let arm = body.arm();
    let mut all = vec![0.0; arm.all_parameters().len()];
    for (link, (mass, centre)) in BODIES.into_iter().enumerate() {
        add(&mut all[11 * link..], mass, centre, GYRATION);
    }
    (0..3).for_each(|joint| all[11 * joint + 10] = 2e-4);
    if let Some((carrier, at)) = load {
        add(&mut all[11 * carrier..], 1.5, at, 0.0);
    }
    let gravity = arm.gravity.each_ref().map(to_f64);
    let friction = [3.0, 5.0, 4.0, 1.0].map(|f| TanhFriction::new([0.7 * f, 60.0, 0.3 * f, 4.0, f]));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let logs = (0..3).map(|log| {
        let mut draw = || (0..5).map(|k| 0.4 * rng.random_range(-1.0..1.0) / f64::from(k + 1)).collect();
        let joints = (0..4).map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).collect();
        let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints }.sample(RATE);
        let (mut q_log, mut torque) = (vec![Vec::new(); 4], vec![Vec::new(); 4]);
        for [q, dq, ddq] in path.samples() {
            let y = regressor(arm, q, dq, ddq, gravity);
            for (j, row) in y.chunks_exact(all.len()).enumerate() {
                let noise: f64 = StandardNormal.sample(&mut rng);
                let rigid: f64 = row.iter().zip(&all).map(|(y, p)| y * p).sum();
                q_log[j].push(q[j]);
                torque[j].push(rigid + friction[j].torque(dq[j]) + 0.1 * noise);
            }
        }
        let count = q_log[0].len();
        Log {
            file: format!("log{log}.csv"),
            pieces: std::iter::once(0..count).collect(),
            doubts: Vec::new(),
            t: (0..count).map(|k| k as f64 / RATE).collect(),
            q: q_log,
            torque,
            temperature: None,
            motor: None,
            clock: 0.0,
        }
    });
    fitted_to(body, logs, seed)
}

/// 1.5 kg on the rod are of the rod, by its name or by its number, and on the forearm of the forearm: a bar
/// that explains a difference no better than a link takes it from none.
#[test]
fn a_body_on_a_bar_is_one_of_the_bar() {
    let body = RigidArm::new(&Arm::parse(ARM, "arm.toml").unwrap()).unwrap();
    let usual = fitted(&body, None, 1);
    let on_rod = fitted(&body, Some((4, [0.6, 0.15, 0.0])), 2);
    for (bars, name) in [(usual.bars.clone(), "rod"), (Vec::new(), "5")] {
        let found = compared(&Side { bars, ..usual.clone() }, &on_rod);
        let Some(Cause::Payload { link: 5, bar: Some(bar), mass: Some([mass, std]), .. }) =
            found.causes.first()
        else {
            panic!("{} {:?}", found.sentence, found.causes)
        };
        assert_eq!(bar, name);
        assert!((mass - 1.5).abs() < 4.0 * std && *std < 0.3, "{mass} ± {std}");
        assert!(
            found.sentence.starts_with(&format!("Another payload: bar {name} is ")),
            "{}",
            found.sentence
        );
    }
    let on_forearm = compared(&usual, &fitted(&body, Some((2, [0.3, 0.1, 0.05])), 3));
    let Some(Cause::Payload { link: 3, bar: None, .. }) = on_forearm.causes.first() else {
        panic!("{} {:?}", on_forearm.sentence, on_forearm.causes)
    };
}
