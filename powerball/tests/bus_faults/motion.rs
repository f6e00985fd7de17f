//! A joint that does not do what it is commanded: each way stops the arm, is reported, and stays stopped.

use super::rules::{running, started};
use super::world::{CYCLE, VICTIM, Wire, World};
use powerball::bus::canopen::{Cob, Frame, cob, nmt};
use powerball::bus::cia402::Statusword;
use powerball::bus::driver::cause::Hindrance;
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{Cause, ControlMode, Phase, Refusal};
use powerball::virtual_arm::slave::Fault;

/// Runs until the arm is stopped by a cause that `expected` accepts, at most `cycles` from now; then nothing
/// moves.
fn stopped(mut world: World, cycles: u64, expected: impl Fn(&Cause) -> bool) {
    let begin = world.now();
    assert!(world.run_until(cycles * CYCLE, |w| w.driver.cause().is_some()), "not seen in {cycles} cycles");
    let cause = *world.driver.cause().unwrap();
    println!("{} cycles: {cause}", (world.now() - begin) / CYCLE);
    assert!(expected(&cause) && cause.node() == Some(VICTIM), "{cause}");
    assert!(world.run_until(4_000_000, |w| w.driver.phase() == Phase::Faulted));
    let at = world.now();
    world.run(500_000);
    assert_eq!(world.motion_after(at), None);
    assert!(matches!(world.driver.enable(), Err(Refusal::Latched(_))));
}

fn with_fault(control: ControlMode, fault: Fault) -> World {
    let mut world = running(control);
    world.bus.peer_mut().arm.fault(VICTIM, fault);
    world
}

fn with_wire(control: ControlMode, wire: Wire) -> World {
    let mut world = running(control);
    world.bus.peer_mut().wire = wire;
    world
}

/// The set-points swing by 0.1 rad from end to end, with a period of 3.1 s: the time is that in which they
/// have gone farther than the following error that may be.
#[test]
fn a_brake_that_closes_on_a_moving_joint_stops_the_arm() {
    for control in [ControlMode::InterpolatedPosition, ControlMode::ProfilePosition, ControlMode::Velocity] {
        stopped(with_fault(control, Fault::BrakeStuck(true)), 1200, |cause| {
            matches!(
                cause,
                Cause::FollowingError(..)
                    | Cause::Stuck(..)
                    | Cause::WrongVelocityScale(..)
                    | Cause::VelocityError(..)
                    | Cause::TorqueLimit(..)
                    | Cause::Emergency(..)
                    | Cause::DriveFault(..)
            )
        });
    }
}

/// The encoder stays where it is while everything else goes on: only the master can see it.
#[test]
fn an_encoder_that_stands_still_stops_the_arm() {
    stopped(with_wire(ControlMode::InterpolatedPosition, Wire::Freeze(None)), 1200, |cause| {
        matches!(cause, Cause::FollowingError(..))
    });
    // In profile position the targets change every 0.2 s.
    let mut profile = LWA4P;
    profile.reactions.still_time = 100_000;
    profile.joints.iter_mut().for_each(|joint| joint.following_error = 0.01);
    let mut world = started(ControlMode::ProfilePosition, profile, true, Wire::Good);
    assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running));
    world.bus.peer_mut().wire = Wire::Freeze(None);
    stopped(world, 1200, |cause| matches!(cause, Cause::Stuck(..)));
}

#[test]
fn bits_of_the_statusword_stop_the_arm() {
    let interpolated = ControlMode::InterpolatedPosition;
    let set = |bits| Wire::Status { set: bits, clear: 0 };
    let hindered =
        |why| move |cause: &Cause| matches!(cause, Cause::Hindered(_, reported, _) if *reported == why);
    stopped(with_wire(interpolated, set(Statusword::MODE_13)), 3, hindered(Hindrance::FollowingError));
    stopped(
        with_wire(interpolated, Wire::Status { set: 0, clear: Statusword::MODE_12 }),
        5,
        hindered(Hindrance::NotInterpolating),
    );
    // A warning is reported, once, and stops nothing.
    let mut world = with_wire(interpolated, set(Statusword::WARNING));
    world.run(50 * CYCLE);
    assert_eq!(world.driver.phase(), Phase::Running);
    let warnings: Vec<_> = world
        .driver
        .notes()
        .filter(|note| matches!(note.cause, Cause::Hindered(VICTIM, Hindrance::Warning, _)))
        .collect();
    assert_eq!(warnings.len(), 1);
    assert_eq!(warnings[0].times, 1);
}

/// A position that creeps beyond its limits is no jump.
#[test]
fn a_position_beyond_its_limits_stops_the_arm() {
    let mut world = running(ControlMode::ProfilePosition);
    let mut by = 0;
    while world.driver.cause().is_none() && by < 200_000 {
        by += 200;
        world.bus.peer_mut().wire = Wire::Shift { by, frames: u32::MAX };
        world.run(CYCLE);
    }
    let cause = *world.driver.cause().unwrap();
    assert!(matches!(cause, Cause::PositionLimit(VICTIM, ..)), "{cause}");
}

/// Nothing at all is sent where another master is heard before the start: neither a reset nor a heartbeat.
#[test]
fn another_master_is_heard_before_anything_is_sent() {
    let frames = [
        cob::SYNC,
        nmt::Command::Start.frame(None),
        nmt::State::Operational.frame(LWA4P.master),
        Frame::from_raw(Cob::Rpdo(2, VICTIM).id(), &[0; 8]).unwrap(),
    ];
    for frame in frames {
        let mut world = World::new(true, LWA4P);
        world.bus.peer_mut().foreign = Some(frame);
        world.driver.start(ControlMode::InterpolatedPosition, false).unwrap();
        assert!(world.run_until(1_000_000, |w| w.driver.phase() == Phase::Faulted));
        assert!(matches!(world.driver.cause(), Some(Cause::OtherMaster(_))));
        world.run(500_000);
        assert!(world.bus.peer().heard.is_empty(), "{:?}", world.bus.peer().heard.first());
    }
}

/// Only the arm's own nodes are reset and started: other devices on the bus are none of its business.
#[test]
fn no_other_device_is_managed() {
    let mut world = running(ControlMode::InterpolatedPosition);
    world.stop();
    world.run(500_000);
    let heard = &world.bus.peer().heard;
    let mut commands = heard.iter().filter(|(_, frame)| frame.raw_id() == 0).peekable();
    assert!(commands.peek().is_some());
    for (_, frame) in commands {
        let node = frame.bytes()[1];
        assert!(LWA4P.joints.iter().any(|joint| joint.node.raw() == node), "node {node} (0 is all of them)");
    }
}
