//! Fits of an arm with a closed loop.

use super::{compared, fitted_to};
use crate::comparison::{Cause, Side};
use crate::excite::{Fourier, Harmonics};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use palletiser::{ARM, LOAD, ROD, record};
use powerball_logs::regression::RigidArm;
use rand::SeedableRng;

#[path = "../../../../../tests/support/palletiser.rs"]
mod palletiser;

/// A fit of three logs of the arm with a load on a body, if any.
fn fitted(body: &RigidArm, load: Option<(usize, (f64, [f64; 3]))>, seed: u64) -> Side {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    fitted_to(body, (0..3).map(|_| record(body.arm(), load, &mut rng)), seed)
}

/// 1.5 kg on the rod are of the rod, by its name or by its number, and on the forearm of the forearm: a bar
/// that explains a difference no better than a link takes it from none.
#[test]
fn a_body_on_a_bar_is_one_of_the_bar() {
    let body = RigidArm::new(&Arm::parse(ARM, "arm.toml").unwrap()).unwrap();
    let usual = fitted(&body, None, 1);
    let on_rod = fitted(&body, Some((ROD, LOAD)), 2);
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
    let on_forearm = compared(&usual, &fitted(&body, Some((2, (1.5, [0.3, 0.1, 0.05]))), 3));
    let Some(Cause::Payload { link: 3, bar: None, .. }) = on_forearm.causes.first() else {
        panic!("{} {:?}", on_forearm.sentence, on_forearm.causes)
    };
}
