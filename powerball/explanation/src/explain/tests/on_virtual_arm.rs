//! How large an effect of the virtual arm is found to be, and what stays of it on another path.

use super::{figures, numbered};
use crate::ExplainOptions;
use crate::explain::{Explained, explain_body};
use chacha20::ChaCha8Rng;
use powerball_identification::excite::{Fourier, Harmonics};
use powerball_logs::log::common_clock;
use powerball_logs::regression::RigidArm;
use powerball_virtual_arm::{PlantEffect as Effect, lwa4p};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;

fn explained(effect: Option<Effect>) -> Explained {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let mut plant = lwa4p::plant().unwrap();
    if let Some(effect) = effect {
        plant = plant.with(effect);
    }
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
    explain_body(&body, fit, validate, &ExplainOptions::default()).unwrap()
}

/// A gear so soft that gravity on its link is another one: to first order it looks like a spring of another
/// joint.
#[test]
fn a_soft_gear_is_named_with_its_stiffness() {
    const STIFFNESS: f64 = 170.0;
    let explained = explained(Some(Effect::JointElasticity { joint: 2, stiffness: STIFFNESS }));
    let first = &explained.effects[0];
    assert_eq!((first.effect.as_str(), first.joints.clone()), ("joint_elasticity", numbered(&[3])));
    let stiffness = figures(first)["stiffness"].as_f64().unwrap();
    // A gear that rings within the band is a little stiffer than it looks.
    approx::assert_relative_eq!(stiffness, STIFFNESS, max_relative = 0.13);
}

/// Another joint's friction has two levels and a viscous part; one of them alone does not fit.
#[test]
fn the_friction_of_another_joint_is_felt_with_all_its_parts() {
    const SHARE: f64 = 0.12;
    let clean = explained(None);
    let coupled = explained(Some(Effect::JointCoupling { from: 3, onto: 2, share: SHARE }));
    let [found] = coupled.effects.as_slice() else { panic!("{:?}", coupled.effects) };
    assert_eq!((found.effect.as_str(), found.joints.clone()), ("joint_coupling", numbered(&[3])));
    assert_eq!(figures(found)["from_joint"][0], 4);
    assert_eq!(figures(found)["law"][0], "friction");
    let share = figures(found)["coefficient"][0].as_f64().unwrap();
    approx::assert_relative_eq!(share, SHARE, max_relative = 0.05);
    let (before, after) = (&coupled.before.validate.rms, &coupled.after.validate.rms);
    assert!(before[2] > 1.3 * after[2], "{before:?} {after:?}");
    approx::assert_relative_eq!(after[2], clean.after.validate.rms[2], max_relative = 0.02);
}
