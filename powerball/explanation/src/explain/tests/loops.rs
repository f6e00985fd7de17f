//! A body on a bar of a closed loop.

use super::figures;
use crate::ExplainOptions;
use crate::explain::explain_body;
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use palletiser::{ARM, LOAD, ROD, record};
use powerball_identification::excite::{Fourier, Harmonics};
use powerball_logs::log::{Log, common_clock};
use powerball_logs::regression::RigidArm;
use rand::SeedableRng;

#[path = "../../../../../tests/support/palletiser.rs"]
mod palletiser;

const LOADED: [usize; 2] = [1, 4];
const LOGS: usize = 6;
const FITTED: usize = 4;

/// 1.5 kg on the rod are found there, and neither on the link that it turns with nor on the one that carries
/// its pin, which explain nearly as much as long as weights are those of logs without the body.
#[test]
fn a_body_on_a_bar_is_found_on_the_bar() {
    let arm = Arm::parse(ARM, "arm.toml").unwrap();
    let body = RigidArm::new(&arm).unwrap();
    for seed in [3, 7, 11] {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let load = |log: usize| LOADED.contains(&log).then_some((ROD, LOAD));
        let mut logs: Vec<Log> = (0..LOGS)
            .map(|log| Log { file: format!("log{log}.csv"), ..record(&arm, load(log), &mut rng) })
            .collect();
        common_clock(&mut logs);
        let (fit, validate) = logs.split_at(FITTED);
        let explained = explain_body(&body, fit, validate, &ExplainOptions::default()).unwrap();
        let names: Vec<&str> = explained.effects.iter().map(|e| e.effect.as_str()).collect();
        assert_eq!(names, ["payload"], "seed {seed}");
        let found = figures(&explained.effects[0]);
        let place = (found["bar"].as_str(), found["link"].as_u64());
        assert_eq!(place, (Some("rod"), Some(ROD as u64 + 1)), "seed {seed}: {found}");
        approx::assert_relative_eq!(found["mass"].as_f64().unwrap(), LOAD.0, max_relative = 0.05);
        approx::assert_relative_eq!(found["com"][0].as_f64().unwrap(), LOAD.1[0], max_relative = 0.05);
        // The fourth joint turns behind the bar, and feels nothing of it.
        let joints: Vec<usize> = explained.effects[0].joints.iter().map(|joint| joint.index()).collect();
        assert_eq!(joints, [0, 1, 2], "seed {seed}");
    }
}
