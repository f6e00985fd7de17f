//! What the search for steepnesses finds.

use super::plant::{record_slow, sensors, truth};
use crate::estimate::{Folds, fit};
use chacha20::ChaCha8Rng;
use powerball_controller::friction::TanhFriction;
use powerball_logs::regression::{Data, DataOptions};
use powerball_virtual_arm::{Sensors, lwa4p};
use rand::{RngExt, SeedableRng};

/// In slow motion the bend of Eq. 16 is all but straight, and a second step looks as good from afar: without
/// noise one in four joints then kept half a percent of its friction.
#[test]
fn the_bend_is_found_in_slow_motion() {
    let (body, _) = truth();
    let quiet = Sensors { encoder_step: 0.0, white: vec![0.0; 6], coloured: vec![0.0; 6], ..sensors() };
    let mut worst = 0.0f64;
    for seed in 0..8 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut share = || rng.random_range(0.6..1.5);
        let friction: Vec<TanhFriction<f64>> = (lwa4p::plant().unwrap().friction().iter())
            .map(|f| {
                let gamma = [f.gamma1, f.gamma2, f.gamma3, f.gamma4, f.gamma5];
                TanhFriction::new(gamma.map(|g| g * share()))
            })
            .collect();
        let logs = record_slow(0.3, friction.clone(), &quiet, 3, seed);
        let data = Data::new(&body, &logs, &DataOptions::default()).unwrap();
        let fitted = fit(&data, &Folds::new(&data), &[], None);
        for (j, law) in friction.iter().enumerate() {
            let left = fitted.sigma[j] / (law.gamma1 + law.gamma3);
            worst = worst.max(left);
            assert!(
                left < 0.0015,
                "seed {seed}, joint {}: {left:.4}, {:?} of {law:?}",
                j + 1,
                fitted.friction(j)
            );
        }
    }
    println!("at most {:.2} % of the friction is left", 100.0 * worst);
}
