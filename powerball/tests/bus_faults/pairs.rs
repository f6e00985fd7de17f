//! Every two things, one after the other, that can happen to an arm that runs, is ready or is faulted, in every mode:
//! faults, and acts of the caller. What walks find by chance in long histories is here looked at in all short ones, for
//! the same three things: nothing that moves after a latched cause, a stop of every drive soon after every cause, no
//! set-point beyond a joint's limits. In the end the caller tries to enable without acknowledging.

use crate::faults::Fault;
use crate::walks::Walk;
use crate::world::CYCLE;
use powerball::bus::driver::{ControlMode, Phase};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Between two things that happen: less than a stop takes.
const BETWEEN: u64 = 3 * CYCLE;

#[derive(Clone, Copy, Debug)]
enum Act {
    Happens(Fault),
    Enable,
    Acknowledge,
    Stop,
}

impl Act {
    fn all() -> impl Iterator<Item = Act> + Clone {
        let acts = [Act::Enable, Act::Acknowledge, Act::Stop];
        Fault::ALL.into_iter().map(|(fault, _)| Act::Happens(fault)).chain(acts)
    }

    fn done(self, walk: &mut Walk) {
        let now = walk.world.now();
        walk.done.push(format!("{now}: {self:?}"));
        match self {
            Act::Happens(fault) => fault.inject(&mut walk.world),
            Act::Enable => {
                let allowed = walk.world.driver.phase() == Phase::Ready;
                if walk.world.driver.enable().is_ok() {
                    assert!(allowed, "enabled where it must not be: {}", walk.done.join("\n"));
                    walk.enabled.push(now);
                }
            }
            Act::Acknowledge => drop(walk.world.driver.acknowledge().is_ok()),
            Act::Stop => walk.world.stop(),
        }
    }
}

/// The arm in a phase, with the histories that lead there.
fn arm(control: ControlMode, phase: Phase) -> Walk {
    let mut walk = Walk::of(control, true, ChaCha8Rng::seed_from_u64(0));
    let until = |walk: &mut Walk, phase: Phase| {
        for _ in 0..4_000 {
            if walk.world.driver.phase() == phase {
                return;
            }
            walk.pass(CYCLE);
        }
        panic!("{phase:?} is not reached: {}", walk.done.join("\n"));
    };
    walk.pass(100_000);
    walk.world.driver.start(control, true).unwrap();
    until(&mut walk, Phase::Ready);
    if phase != Phase::Ready {
        Act::Enable.done(&mut walk);
        until(&mut walk, Phase::Running);
        walk.pass(20 * CYCLE);
    }
    if phase == Phase::Faulted {
        Act::Happens(Fault::WrongMode).done(&mut walk);
        until(&mut walk, Phase::Faulted);
        Fault::WrongMode.repair(&mut walk.world);
    }
    walk
}

/// All pairs from one phase in one mode; how many of them latched a cause.
fn pairs(control: ControlMode, phase: Phase) -> usize {
    let begin = arm(control, phase);
    let mut latched = 0;
    for first in Act::all() {
        let mut after = begin.clone();
        first.done(&mut after);
        after.pass(BETWEEN);
        for second in Act::all() {
            let mut walk = after.clone();
            second.done(&mut walk);
            walk.pass(BETWEEN);
            Act::Enable.done(&mut walk);
            walk.pass(2 * BETWEEN);
            latched += usize::from(walk.causes.len() > begin.causes.len());
            if let Err(wrong) = walk.judge() {
                panic!("{control:?}, {phase:?}: {wrong}; what was done:\n{}", walk.done.join("\n"));
            }
        }
    }
    latched
}

#[test]
fn every_two_things_in_every_mode() {
    let all = Act::all().count().pow(2);
    std::thread::scope(|scope| {
        for control in ControlMode::ALL {
            scope.spawn(move || {
                let latched =
                    [Phase::Running, Phase::Ready, Phase::Faulted].map(|phase| pairs(control, phase));
                println!("{control:?}: {all} pairs a phase, causes latched in {latched:?} of them");
                assert!(
                    latched[0] > all / 2 && latched[1] > all / 4,
                    "the pairs see too little: {latched:?}"
                );
            });
        }
    });
}
