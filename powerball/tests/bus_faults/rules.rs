//! What the driver does and does not do on the bus, one rule a test; many are mistakes of other drivers.

use super::world::{CYCLE, VICTIM, Wire, World};
use powerball::bus::canopen::emcy::Emcy;
use powerball::bus::canopen::pdo::Mapping;
use powerball::bus::canopen::{Cob, Micros, cob};
use powerball::bus::cia402::{Controlword, State, objects, schunk};
use powerball::bus::driver::cause::Hindrance;
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{
    Budget, BusEvent, Cause, ControlMode, Driver, Phase, Profile, Refusal, Rejection, Verdict,
};
use powerball::controller::JointNumber;
use powerball::virtual_arm::slave::Fault;

const JOINT_1: JointNumber = JointNumber::from_index(0);

pub(super) fn started(control: ControlMode, profile: Profile<6>, commutated: bool, wire: Wire) -> World {
    let mut world = World::new(commutated, profile);
    world.run(100_000);
    world.bus.peer_mut().wire = wire;
    world.driver.start(control, true).unwrap();
    world
}

pub(super) fn running(control: ControlMode) -> World {
    let mut world = started(control, LWA4P, true, Wire::Good);
    assert!(
        world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running),
        "{:?}",
        world.driver.cause()
    );
    world.run(20 * CYCLE);
    world
}

/// Runs into a fault before anything was enabled, and gives its cause.
pub(super) fn refused(mut world: World) -> Cause {
    assert!(
        world.run_until(20_000_000, |w| w.driver.phase() == Phase::Faulted),
        "{:?}",
        world.driver.phase()
    );
    assert_eq!(world.motion_after(0), None);
    assert!(matches!(world.driver.enable(), Err(Refusal::Latched(_))));
    *world.driver.cause().unwrap()
}

/// Set-points of node `VICTIM` that reached it with their controlwords, 32 bits.
fn points(world: &World) -> Vec<(Micros, u16, i32)> {
    let rpdo = Cob::Rpdo(1, VICTIM).id();
    let frames = world.bus.peer().heard.iter().filter(|(_, frame)| frame.raw_id() == rpdo);
    frames
        .map(|(at, frame)| {
            let b = frame.bytes();
            let point = if b.len() == 6 { i32::from_le_bytes([b[2], b[3], b[4], b[5]]) } else { 0 };
            (*at, u16::from_le_bytes([b[0], b[1]]), point)
        })
        .collect()
}

/// Others had arms that ran to an old target, or to zero, when they were enabled.
#[test]
fn until_it_runs_every_target_is_where_the_joint_is() {
    for control in [ControlMode::InterpolatedPosition, ControlMode::ProfilePosition] {
        let mut world = started(control, LWA4P, false, Wire::Good);
        assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running));
        let stand = LWA4P.joints[2].units.counts(super::world::START[2]).value;
        let points = points(&world);
        assert!(points.len() > 100);
        // The commutation search jerks the joint by 0.002 rad.
        for (at, word, point) in points {
            assert!((point - stand).abs() < 200, "{point} instead of {stand} with word {word:04X} at {at}");
        }
    }
}

#[test]
fn two_set_points_never_meet_in_one_sync() {
    let world = running(ControlMode::InterpolatedPosition);
    let mut since_sync = 0;
    for (_, frame) in &world.bus.peer().heard {
        if *frame == cob::SYNC {
            since_sync = 0;
        } else if frame.raw_id() == Cob::Rpdo(1, VICTIM).id() {
            since_sync += 1;
            assert_eq!(since_sync, 1);
        }
    }
}

/// Two steps in one cycle would be twice the greatest velocity.
#[test]
fn steps_are_measured_from_what_has_left() {
    let mut world = running(ControlMode::InterpolatedPosition);
    let step = LWA4P.joints[0].velocity * 0.005;
    let here = world.driver.setpoints();
    world.run_until(CYCLE, |w| w.driver.cycle_complete());
    // Taken, and not left yet: the next one is measured from what has left all the same.
    assert_eq!(world.driver.set(&here.map(|q| q + 0.0001)), Ok(()));
    assert_eq!(world.driver.set(&here.map(|q| q + 0.0001)), Ok(()));
    let much = world.driver.set(&here.map(|q| q + 1.2 * step));
    assert!(matches!(much, Err(Rejection::Jump(JOINT_1, ..))), "{much:?}");
}

/// The torque offset goes to the drives with its points, is guarded as they are, and is gone after a stop.
#[test]
fn torque_offsets_are_guarded_and_end_with_the_motion() {
    let profile = LWA4P.with_torque_offset();
    let mut world = started(ControlMode::InterpolatedPosition, profile, true, Wire::Good);
    assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running));
    world.pilot.enable = false;
    world.run(100_000);
    let here = world.driver.setpoints();
    world.run_until(CYCLE, |w| w.driver.cycle_complete());
    let mut give = |torques: [f64; 6]| world.driver.set_with_torque(&here, &torques);
    // The victim's joint.
    let (third, of) = (JointNumber::from_index(2), |torque: f64| [0.0, 0.0, torque, 0.0, 0.0, 0.0]);
    assert_eq!(give(of(f64::NAN)), Err(Rejection::NotFinite(third)));
    assert!(matches!(give(of(65.0)), Err(Rejection::Torque(j, ..)) if j == third));
    // A quarter of 64 N·m in a cycle.
    assert!(matches!(give(of(16.1)), Err(Rejection::Jump(j, ..)) if j == third));
    assert_eq!(give(of(14.0)), Ok(()));
    // 14 N·m are 2000 ‰ of what 7 N·m are at the rated current.
    let offset = |w: &World| {
        let heard = w.bus.peer().heard.iter().rev();
        let mut ours = heard.filter(|(_, f)| f.raw_id() == Cob::Rpdo(1, VICTIM).id());
        ours.next().map(|(_, f)| i16::from_le_bytes([f.bytes()[2], f.bytes()[3]]))
    };
    world.hold_pilot(CYCLE);
    assert_eq!(offset(&world), Some(2000));
    world.stop();
    world.run(1_000_000);
    assert_eq!((world.driver.phase(), offset(&world)), (Phase::Ready, Some(0)));
}

/// Where the receive PDO holds no offset, it would be lost on the way.
#[test]
fn torque_offsets_need_their_place_in_the_pdo() {
    let mut world = running(ControlMode::InterpolatedPosition);
    let here = world.driver.setpoints();
    assert_eq!(world.driver.set_with_torque(&here, &[0.0; 6]), Err(Rejection::NoTorqueOffset));
    let profile = LWA4P.with_torque_offset();
    let budget = Budget::of(&profile, &profile.interpolated_position.unwrap());
    assert!((budget.worst_load() - 0.935).abs() < 5e-3, "{budget}");
    assert_eq!(budget.verdict(), Verdict::Tight);
}

#[test]
fn a_stop_is_quick_stop_then_halt_then_no_torque() {
    let mut world = running(ControlMode::Velocity);
    world.pilot.enable = false;
    let at = world.now();
    world.stop();
    world.run(1_000_000);
    assert_eq!(world.driver.phase(), Phase::Ready);
    let mut words: Vec<u16> =
        world.words(at).filter(|(_, node, _)| *node == VICTIM).map(|(_, _, word)| word.0).collect();
    words.dedup();
    assert_eq!(words, [0x0002, 0x0102, 0x0000]);
    assert_eq!(world.driver.set(&[0.0; 6]), Err(Rejection::NotRunning));
}

/// Frames that waited for a bus that was disturbed flew out when others released their emergency stop.
#[test]
fn a_set_point_that_waits_in_the_queue_does_not_leave_after_a_stop() {
    let mut world = running(ControlMode::InterpolatedPosition);
    // The slot has just opened: six set-points wait, at most one is on the wire.
    let slot = world.driver.budget().setpoint_slot();
    let cycles = world.driver.counters().cycles;
    world.run_until(2 * CYCLE, |w| w.driver.counters().cycles > cycles);
    world.run(slot + 10);
    let at = world.now();
    world.pilot.enable = false;
    world.stop();
    world.run(50_000);
    let on_the_wire = at + 300;
    assert_eq!(world.motion_after(on_the_wire), None);
    assert!(world.quick_stops(at).iter().all(|stop| stop.is_some_and(|s| s < at + CYCLE)));
}

#[test]
fn a_fault_is_reset_once_for_each_acknowledgement_with_an_edge() {
    let mut world = running(ControlMode::Velocity);
    world.pilot.enable = false;
    // Without motor supply the drive does not leave its fault.
    world.bus.peer_mut().arm.fault(VICTIM, Fault::Supply(false));
    assert!(world.run_until(4_000_000, |w| w.driver.phase() == Phase::Faulted));
    world.run(500_000);
    assert!(matches!(world.driver.cause(), Some(Cause::Emergency(VICTIM, Emcy { code: 0x3222, .. }))));
    let details = world.driver.details();
    assert_eq!(details.register.map(|r| r & 0x04), Some(0x04));
    assert!(details.vendor_code.is_some() && details.line.is_some(), "{details:?}");
    let edges = |world: &World, from| {
        let mut last = Controlword::default();
        let words = world.words(from).filter(|(_, node, _)| *node == VICTIM);
        words.filter(|(_, _, word)| !std::mem::replace(&mut last, *word).has(0x80) && word.has(0x80)).count()
    };
    let at = world.now();
    assert_eq!(edges(&world, 0), 0);
    world.driver.acknowledge().unwrap();
    world.run(3_000_000);
    assert_eq!(edges(&world, at), 1);
    assert_eq!(world.driver.phase(), Phase::Faulted);
    assert!(matches!(world.driver.cause(), Some(Cause::DriveFault(VICTIM, _))), "{:?}", world.driver.cause());
    // Supply again: one more acknowledgement does it, and nothing moves before it is enabled.
    world.bus.peer_mut().arm.fault(VICTIM, Fault::Supply(true));
    world.driver.acknowledge().unwrap();
    assert!(world.run_until(2_000_000, |w| w.driver.phase() == Phase::Ready), "{:?}", world.driver.cause());
    assert_eq!((edges(&world, at), world.motion_after(at)), (2, None));
    world.pilot.enable = true;
    assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running));
}

/// "Could not enable motor", without a reason, is what users of others find.
#[test]
fn a_transition_that_does_not_happen_has_its_reason() {
    let rows = [
        (0x0221, Hindrance::NoVoltage),
        (0x0031, Hindrance::NotRemote),
        (0x0A31, Hindrance::InternalLimit),
        (0x02B1, Hindrance::Warning),
        (0x0231, Hindrance::Untold),
    ];
    for (word, reason) in rows {
        let mut world = started(ControlMode::Velocity, LWA4P, true, Wire::Good);
        world.pilot.enable = false;
        assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Ready));
        world.bus.peer_mut().arm.fault(VICTIM, Fault::Statusword(Some(word)));
        world.pilot.enable = true;
        assert!(world.run_until(6_000_000, |w| w.driver.phase() == Phase::Faulted));
        let expected = Cause::Transition(VICTIM, State::ReadyToSwitchOn, State::SwitchedOn, reason);
        assert_eq!(world.driver.cause(), Some(&expected));
    }
}

/// One peer tried for ever, and took any bit of the extended status for the one that counts.
#[test]
fn a_commutation_that_never_ends_ends() {
    let mut profile = LWA4P;
    profile.reactions.commutation_tries = 4;
    for status in [0, u32::from(schunk::POSITION_VERIFIED)] {
        let wire = Wire::Misread(schunk::EXTENDED_STATUS, status);
        let mut world = started(ControlMode::InterpolatedPosition, profile, true, wire);
        assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Faulted));
        assert_eq!(world.driver.cause(), Some(&Cause::NoCommutation(VICTIM)));
    }
}

/// Supplies come late: a node that did not boot is reset once more, and then refused.
#[test]
fn a_node_that_boots_late_is_waited_for() {
    for comes in [true, false] {
        let mut world = started(ControlMode::Velocity, LWA4P, true, Wire::Good);
        world.bus.peer_mut().arm.fault(VICTIM, Fault::Silent(true));
        world.run(4_000_000);
        assert_eq!(world.driver.phase(), Phase::Boot);
        world.bus.peer_mut().arm.fault(VICTIM, Fault::Silent(!comes));
        let done = |w: &World| w.driver.phase() == Phase::Running || w.driver.cause().is_some();
        assert!(world.run_until(20_000_000, done));
        assert_eq!(world.driver.cause(), if comes { None } else { Some(&Cause::NoBoot(VICTIM)) });
    }
}

/// With others an emergency stop that is pressed at boot kills the start-up.
#[test]
fn a_motor_supply_that_is_off_at_boot_costs_no_restart() {
    let mut world = World::new(true, LWA4P);
    world.bus.peer_mut().arm.fault(VICTIM, Fault::Supply(false));
    world.run(100_000);
    world.driver.start(ControlMode::Velocity, false).unwrap();
    assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Faulted));
    let cause = *world.driver.cause().unwrap();
    let named =
        matches!(cause, Cause::Transition(VICTIM, _, _, Hindrance::NoVoltage) | Cause::DriveFault(VICTIM, _));
    assert!(named, "{cause}");
    world.bus.peer_mut().arm.fault(VICTIM, Fault::Supply(true));
    world.driver.acknowledge().unwrap();
    assert!(
        world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running),
        "{:?}",
        world.driver.cause()
    );
}

#[test]
fn joints_are_commutated_one_after_the_other() {
    let mut world = started(ControlMode::InterpolatedPosition, LWA4P, false, Wire::Good);
    world.run_until(20_000_000, |w| w.driver.phase() == Phase::Enabling);
    while world.driver.phase() == Phase::Enabling {
        let open = world.bus.peer().arm.nodes().iter().filter(|node| !node.brake_closed()).count();
        assert!(open <= 2, "{open} brakes open while commutating; one closes while the next opens");
        world.turn();
    }
    assert_eq!(world.driver.phase(), Phase::Running);
}

/// New targets are announced by a rising edge, and only when the drive has let go of the last one.
#[test]
fn profile_position_shakes_hands() {
    let mut world = running(ControlMode::ProfilePosition);
    world.run(3_000_000);
    let points = points(&world);
    let mut edges = 0;
    for pair in points.windows(2) {
        let [(_, before, old), (at, word, new)] = [pair[0], pair[1]];
        let rising = word & 0x10 != 0 && before & 0x10 == 0;
        edges += usize::from(rising && word & 0x0F == 0x0F);
        assert!(
            old == new || rising || word & 0x0F != 0x0F || before & 0x0F != 0x0F,
            "target changes without an edge at {at}"
        );
    }
    assert!(edges > 5, "{edges}");
    let targets = world.accepted.last().unwrap().1;
    world.run(1_000_000);
    assert!((world.driver.positions()[2] - targets[2]).abs() < 0.06);
}

/// With 0x604C at its default the i16 target ends at 32.767°/s, less than the joint's greatest velocity.
#[test]
fn velocities_that_the_wire_cannot_hold_are_rejected_not_cut() {
    let mut world = running(ControlMode::Velocity);
    let step = LWA4P.joints[0].acceleration * 0.005;
    let mut velocities = world.accepted.last().unwrap().1;
    world.hold_pilot(CYCLE);
    let mut rejected = None;
    for _ in 0..60 {
        world.run_until(CYCLE, |w| w.driver.cycle_complete());
        velocities[0] += step;
        if let Err(rejection) = world.driver.set(&velocities) {
            rejected = Some(rejection);
            break;
        }
        world.hold_pilot(CYCLE);
    }
    let degrees = velocities[0].to_degrees();
    assert_eq!(rejected, Some(Rejection::Saturated(JOINT_1)), "at {degrees}°/s");
    assert!((degrees - 32.767).abs() < step.to_degrees(), "{degrees}°/s");
}

/// All three ramp bits: without them drives hold the ramp.
#[test]
fn velocity_mode_runs_with_0x7f_and_interpolation_with_0x1f() {
    for (control, running_word) in [
        (ControlMode::Velocity, 0x7F),
        (ControlMode::InterpolatedPosition, 0x1F),
        (ControlMode::Current, 0x0F),
    ] {
        let world = running(control);
        let last = world.words(0).last().unwrap();
        assert_eq!(last.2.0, running_word, "{control}");
        assert!(world.driver.joints().iter().all(|j| j.state() == Some(State::OperationEnabled)));
    }
}

#[test]
fn a_heartbeat_alone_that_stops_is_noticed() {
    let mut world = running(ControlMode::Velocity);
    let at = world.now();
    world.bus.peer_mut().arm.fault(VICTIM, Fault::NoHeartbeat(true));
    assert!(world.run_until(1_000_000, |w| w.driver.cause().is_some()));
    assert_eq!(world.driver.cause(), Some(&Cause::HeartbeatLost(VICTIM)));
    assert!(world.now() - at <= 301_000);
}

#[test]
fn a_caller_that_stops_giving_set_points_stops_the_arm() {
    let mut world = running(ControlMode::Velocity);
    let at = world.now();
    world.hold_pilot(50_000);
    assert_eq!(world.driver.cause(), Some(&Cause::Starved));
    assert!(world.quick_stops(at).iter().all(|stop| stop.is_some_and(|s| s - at < 5 * CYCLE)));
    // In profile position the drive has its target: silence is no fault.
    let mut world = running(ControlMode::ProfilePosition);
    world.hold_pilot(50_000);
    assert_eq!((world.driver.phase(), world.driver.cause()), (Phase::Running, None));
}

#[test]
fn storms_are_counted_and_reported_once() {
    let mut world = running(ControlMode::Velocity);
    world.bus.peer_mut().storm = 40;
    world.run(300_000);
    assert_eq!(world.driver.joints()[2].counters.emergencies, 40);
    let noted = world.driver.notes().filter(|note| matches!(note.cause, Cause::Emergency(VICTIM, _))).count();
    assert!((1..=2).contains(&noted), "{noted}");
}

#[test]
fn off_the_bus_the_master_is_silent_until_acknowledged() {
    let mut world = running(ControlMode::Velocity);
    world.event(BusEvent::BusOff);
    let at = world.now() + 300;
    world.run(500_000);
    assert!(world.bus.peer().heard.iter().all(|(when, _)| *when <= at));
    assert!(world.bus.peer().arm.nodes().iter().all(|node| node.brake_closed()));
    world.driver.acknowledge().unwrap();
    assert_eq!(world.driver.phase(), Phase::Idle);
}

#[test]
fn error_passive_is_a_warning() {
    let mut world = running(ControlMode::Velocity);
    world.event(BusEvent::ErrorPassive);
    world.run(100_000);
    assert_eq!((world.driver.phase(), world.driver.counters().error_passive), (Phase::Running, 1));
}

#[test]
fn the_mode_is_changed_when_ready_and_asking_again_is_no_fault() {
    let mut world = running(ControlMode::Velocity);
    world.pilot.enable = false;
    assert!(matches!(world.driver.start(ControlMode::Velocity, false), Err(Refusal::Phase(_))));
    world.stop();
    world.run(1_000_000);
    for control in [ControlMode::Velocity, ControlMode::InterpolatedPosition] {
        world.driver.start(control, false).unwrap();
        assert!(
            world.run_until(5_000_000, |w| w.driver.phase() == Phase::Ready),
            "{:?}",
            world.driver.cause()
        );
        assert_eq!(world.driver.joints()[0].mode, Some(LWA4P.mode(control).unwrap().mode));
    }
    world.pilot.enable = true;
    assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running));
}

#[test]
fn measurements_are_in_si() {
    let world = running(ControlMode::InterpolatedPosition);
    let simulation = world.bus.peer().arm.simulation();
    for (j, joint) in world.driver.joints().iter().enumerate() {
        // Not older than a cycle.
        let velocity = simulation.velocity(j).abs().max(0.1);
        assert!(
            (joint.position - simulation.position(j)).abs() < 2.0 * velocity * 0.005 + 2e-5,
            "joint {}",
            j + 1
        );
        assert!((joint.velocity - simulation.velocity(j)).abs() < 0.05, "joint {}", j + 1);
        let rated = joint.units.rated_current;
        assert!(
            (joint.torque / joint.units.rated_torque
                - joint.current / rated.copysign(joint.units.rated_torque))
            .abs()
                < 1e-9
        );
    }
}

#[test]
fn profiles_that_contradict_themselves_are_refused() {
    let refused = |change: fn(&mut Profile<6>)| {
        let mut profile = LWA4P;
        change(&mut profile);
        matches!(Driver::new(profile), Err(Refusal::Profile(_)))
    };
    assert!(refused(|p| p.joints[1].node = p.joints[0].node));
    assert!(refused(|p| p.master = p.joints[0].node));
    assert!(refused(|p| p.sync_timeout_factor = Some(0)));
    assert!(refused(|p| p.master_watch_ms = 0));
    assert!(refused(|p| p.master_heartbeat = 80_000));
    assert!(refused(|p| p.sync_period = 3333));
    assert!(refused(|p| p.joints[0].position = [1.0, -1.0]));
    assert!(refused(|p| p.joints[0].velocity = f64::NAN));
    assert!(refused(|p| p.tpdos[1] = Mapping::EMPTY));
    assert!(refused(|p| p.velocity.as_mut().unwrap().setpoint = objects::TARGET_POSITION));
    assert!(!refused(|_| {}));
}

/// The dimension factor 0x604C can be read in two ways that are inverse to each other. A tenth of a radian
/// tells.
#[test]
fn a_wrong_velocity_scale_stops_the_first_move() {
    let mut profile = LWA4P;
    profile.velocity_scale.millidegrees = 4.0;
    let mut world = started(ControlMode::Velocity, profile, true, Wire::Good);
    assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running));
    assert!(world.run_until(5_000_000, |w| w.driver.cause().is_some()));
    let cause = *world.driver.cause().unwrap();
    assert!(matches!(cause, Cause::WrongVelocityScale(_, part) if (part - 0.25).abs() < 0.1), "{cause}");
    // The right one runs on, to and fro.
    let mut world = running(ControlMode::Velocity);
    world.run(5_000_000);
    assert_eq!(world.driver.cause(), None);
}
