//! Experiments on the virtual arm: its own numeric dynamics, Table 2's friction, sensors of choice.

use crate::excite::{Fourier, Harmonics};
use crate::log::Log;
use crate::mounting::Mounting;
use crate::regression::RigidBody;
use crate::virtual_arm::{Body, Chain, Dynamics, Plant, Sensors, lwa4p};
use dyngen::SetKind;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The arm's functions, and the true values of its minimal set.
pub(super) fn truth() -> (RigidBody, Vec<f64>) {
    let body = RigidBody::new(&lwa4p::arm().unwrap()).unwrap();
    let all: Vec<f64> = lwa4p::links().iter().flat_map(Body::parameters).collect();
    let values = body.model().set_values(body.model().set(SetKind::Minimal).unwrap(), &all);
    (body, values)
}

/// The virtual arm's own sensors.
pub(super) fn sensors() -> Sensors {
    lwa4p::plant().unwrap().sensors().clone()
}

/// Logs of random paths, each of `periods` times 10 s.
pub(super) fn record(sensors: &Sensors, logs: usize, periods: usize, seed: u64) -> Vec<Log> {
    let filed = Mounting::Filed.gravity(&lwa4p::arm().unwrap());
    record_mounted(filed, lwa4p::links(), sensors, logs, periods, seed, &[])
}

/// The same with other links under any gravity in the base frame, and some joints held still.
pub(super) fn record_mounted(
    gravity: [f64; 3],
    links: Vec<Body>,
    sensors: &Sensors,
    logs: usize,
    periods: usize,
    seed: u64,
    still: &[usize],
) -> Vec<Log> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut chain = Chain::new(&lwa4p::arm().unwrap());
    chain.gravity = gravity.into();
    let friction = lwa4p::plant().unwrap().friction().to_vec();
    let plant = Plant::new(Dynamics::new(chain, links).unwrap(), friction, sensors.clone());
    (0..logs)
        .map(|log| {
            let mut draw = |scale: f64| (0..5).map(|_| scale * rng.random_range(-1.0..1.0)).collect();
            let joint = |j: usize| {
                let size = if still.contains(&j) { 0.0 } else { 0.25 };
                Harmonics { middle: 0.0, a: draw(size), b: draw(size) }
            };
            let joints = (0..6).map(joint).collect();
            let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods, ramp: 1.0, joints };
            let recording = plant.record(&path.sample(sensors.rate), 0.0, 1000 * seed + log as u64);
            let by_joint = |x: &[f64]| -> Vec<Vec<f64>> {
                (0..6).map(|j| x.iter().skip(j).step_by(6).copied().collect()).collect()
            };
            Log {
                file: format!("virtual {seed}.{log}"),
                q: by_joint(&recording.q),
                torque: by_joint(&recording.tau),
                temperature: None,
                pieces: std::iter::once(0..recording.t.len()).collect(),
                clock: 0.0,
                t: recording.t,
            }
        })
        .collect()
}
