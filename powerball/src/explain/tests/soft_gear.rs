//! A gear so soft that gravity on its link is another one: to first order it looks like a spring of another joint.

use crate::excite::{Fourier, Harmonics};
use crate::explain::explain;
use crate::log::common_clock;
use crate::regression::{DataOptions, RigidBody};
use crate::virtual_arm::{Effect, lwa4p};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

#[test]
fn a_soft_gear_is_named_with_its_stiffness() {
    const STIFFNESS: f64 = 170.0;
    let body = RigidBody::new(&lwa4p::arm().unwrap()).unwrap();
    let plant = lwa4p::plant().unwrap().with(Effect::JointElasticity { joint: 2, stiffness: STIFFNESS });
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut logs: Vec<_> = (0..7)
        .map(|k| {
            let mut draw = |scale: f64| (0..5).map(|_| scale * rng.random_range(-1.0..1.0)).collect();
            let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(0.25), b: draw(0.25) }).collect();
            let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints };
            plant.record(&path.sample(plant.sensors().rate), 0.0, k).log(format!("log {k}"))
        })
        .collect();
    common_clock(&mut logs);
    let (fit, validate) = logs.split_at(5);
    let explained = explain(&body, fit, validate, &DataOptions::default(), &|_| ()).unwrap();
    let first = &explained.effects[0];
    assert_eq!((first.effect.as_str(), first.joints.as_slice()), ("joint_elasticity", &[3][..]));
    let stiffness = first.parameters["stiffness"].as_f64().unwrap();
    approx::assert_relative_eq!(stiffness, STIFFNESS, max_relative = 0.1);
}
