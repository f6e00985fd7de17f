//! Experiments on the virtual arm: its own numeric dynamics, Table 2's friction, sensors of choice.

use crate::excite::{Fourier, Harmonics};
use crate::mounting::Mounting;
use chacha20::ChaCha8Rng;
use dyngen::SetKind;
use powerball_controller::friction::TanhFriction;
use powerball_logs::chain::Chain;
use powerball_logs::log::Log;
use powerball_logs::regression::RigidArm;
use powerball_virtual_arm::{Body, Dynamics, Plant, Sensors, lwa4p};
use rand::{RngExt, SeedableRng};

/// The arm's functions, and the true values of its minimal set.
pub(crate) fn truth() -> (RigidArm, Vec<f64>) {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let all: Vec<f64> = lwa4p::links().iter().flat_map(Body::parameters).collect();
    let values = body.model().set_values(body.model().set(SetKind::Minimal).unwrap(), &all);
    (body, values)
}

/// The virtual arm's own sensors.
pub(crate) fn sensors() -> Sensors {
    lwa4p::plant().unwrap().sensors().clone()
}

/// Logs of random paths, each of `periods` times 10 s.
pub(crate) fn record(sensors: &Sensors, logs: usize, periods: usize, seed: u64) -> Vec<Log> {
    let filed = Mounting::Filed.gravity(&lwa4p::arm().unwrap());
    record_mounted(filed, lwa4p::links(), sensors, logs, periods, seed, &[])
}

/// Like [`record`], at a share of the velocity, with other friction.
pub(crate) fn record_slow(
    share: f64,
    friction: Vec<TanhFriction<f64>>,
    sensors: &Sensors,
    logs: usize,
    seed: u64,
) -> Vec<Log> {
    let chain = Chain::new(&lwa4p::arm().unwrap());
    let plant = Plant::new(Dynamics::new(chain, lwa4p::links()).unwrap(), friction, sensors.clone());
    record_on(&plant, logs, 2, seed, |_| 0.25 * share)
}

/// Like [`record_slow`], with other links under any gravity in the base frame, and some joints held still.
pub(crate) fn record_mounted(
    gravity: [f64; 3],
    links: Vec<Body>,
    sensors: &Sensors,
    logs: usize,
    periods: usize,
    seed: u64,
    still: &[usize],
) -> Vec<Log> {
    let mut chain = Chain::new(&lwa4p::arm().unwrap());
    chain.gravity = gravity.into();
    let friction = lwa4p::plant().unwrap().friction().to_vec();
    let plant = Plant::new(Dynamics::new(chain, links).unwrap(), friction, sensors.clone());
    record_on(&plant, logs, periods, seed, |joint| if still.contains(&joint) { 0.0 } else { 0.25 })
}

/// Logs of random paths whose harmonics are of a joint's `size` at most, rad.
fn record_on(plant: &Plant, logs: usize, periods: usize, seed: u64, size: impl Fn(usize) -> f64) -> Vec<Log> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..logs)
        .map(|log| {
            let mut draw = |scale: f64| (0..5).map(|_| scale * rng.random_range(-1.0..1.0)).collect();
            let joint = |j: usize| Harmonics { middle: 0.0, a: draw(size(j)), b: draw(size(j)) };
            let joints = (0..6).map(joint).collect();
            let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods, ramp: 1.0, joints };
            let recording = plant.record(&path.sample(plant.sensors().rate), 0.0, 1000 * seed + log as u64);
            recording.log(format!("virtual {seed}.{log}"))
        })
        .collect()
}
