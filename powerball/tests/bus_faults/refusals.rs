//! What the driver refuses before a drive is enabled, one rule a test.

use super::rules::{refused, started};
use super::world::{VICTIM, Wire, World};
use powerball::bus::canopen::Object;
use powerball::bus::canopen::pdo::{Entry, Mapping};
use powerball::bus::cia402::{Mode, schunk};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{Cause, ControlMode, Driver, Phase, Profile, Refusal, Verdict};

#[test]
fn a_drive_that_does_not_watch_the_master_is_not_enabled() {
    for object in [Object::new(0x1016, 1), schunk::SYNC_TIMEOUT_FACTOR] {
        let cause = refused(started(ControlMode::Velocity, LWA4P, true, Wire::Refuse(object)));
        assert!(matches!(cause, Cause::NoWatch(VICTIM, o, _) if o == object), "{cause}");
        let cause = refused(started(ControlMode::Velocity, LWA4P, true, Wire::Misread(object, 0)));
        assert!(matches!(cause, Cause::NotTaken(VICTIM, o, _, 0) if o == object), "{cause}");
    }
}

/// A profile without `sync_timeout_factor` asks for no object of SCHUNK's, and still has the drives watch the
/// master.
#[test]
fn drives_of_another_maker_run_without_schunks_objects() {
    let profile = Profile { sync_timeout_factor: None, ..LWA4P };
    for object in [schunk::SYNC_TIMEOUT_FACTOR, schunk::EXTENDED_STATUS] {
        let mut world = started(ControlMode::Velocity, profile, true, Wire::Refuse(object));
        let runs = world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running);
        assert!(runs, "{object}: {:?}", world.driver.cause());
        let mut world = started(ControlMode::Velocity, LWA4P, true, Wire::Refuse(object));
        assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Faulted), "{object}");
        assert!(matches!(world.driver.cause(), Some(Cause::NoWatch(..) | Cause::Sdo(..))));
    }
    let heartbeat = Object::new(0x1016, 1);
    let cause = refused(started(ControlMode::Velocity, profile, true, Wire::Refuse(heartbeat)));
    assert!(matches!(cause, Cause::NoWatch(VICTIM, o, _) if o == heartbeat), "{cause}");
}

#[test]
fn a_mapping_that_reads_back_otherwise_is_refused() {
    let entry = Object::new(0x1A00, 2);
    let cause =
        refused(started(ControlMode::InterpolatedPosition, LWA4P, true, Wire::Misread(entry, 0x6064_0020)));
    assert_eq!(cause, Cause::NotTaken(VICTIM, entry, 0x6077_0010, 0x6064_0020));
}

#[test]
fn current_mode_is_refused_where_it_is_not_verified_or_not_offered() {
    let mut world = World::with(true, LWA4P, false);
    world.run(100_000);
    let unverified = world.driver.start(ControlMode::Current, false);
    assert_eq!(unverified, Err(Refusal::NotVerified(ControlMode::Current)));
    assert_eq!(world.driver.phase(), Phase::Idle);
    // Accepted, the drive is asked: the modes of its DCF do not contain it.
    world.driver.start(ControlMode::Current, true).unwrap();
    let cause = refused(world);
    assert!(matches!(cause, Cause::ModeNotOffered(_, Mode::ProfileTorque, 0x43)), "{cause}");

    // A drive that claims the mode without its target, and a profile that knows of none.
    let target = LWA4P.current.unwrap().setpoint;
    let cause = refused(started(ControlMode::Current, LWA4P, true, Wire::Refuse(target)));
    assert!(matches!(cause, Cause::Sdo(VICTIM, object, _) if object == target), "{cause}");
    let mut driver = Driver::new(Profile { current: None, ..LWA4P }).unwrap();
    assert_eq!(driver.start(ControlMode::Current, true), Err(Refusal::NoMode(ControlMode::Current)));
}

#[test]
fn another_node_than_expected_is_refused() {
    let mut profile = LWA4P;
    profile.joints[2].identity.vendor = Some(0xBAD);
    let cause = refused(started(ControlMode::Velocity, profile, true, Wire::Good));
    assert_eq!(cause, Cause::WrongIdentity(VICTIM, Object::new(0x1018, 1), 0xBAD, 0x15E));

    // A device of another maker, one that is no drive, and one that does not say what it is.
    let (vendor, device_type) = (Object::new(0x1018, 1), Object::new(0x1000, 0));
    let refusal = |wire| refused(started(ControlMode::InterpolatedPosition, LWA4P, true, wire)).to_string();
    let expected = "node 5: vendor 0xDEADBEEF (0x1018:1) where 0x0000015E is expected";
    assert_eq!(refusal(Wire::Misread(vendor, 0xDEAD_BEEF)), expected);
    let expected = "node 5: device type 0x00030191 (0x1000:0), which is CiA 401 where CiA 402 is expected";
    assert_eq!(refusal(Wire::Misread(device_type, 0x0003_0191)), expected);
    assert!(refusal(Wire::Refuse(device_type)).contains("0x1000:0"));
}

/// What the caller accepts is noted by name, and the arm runs.
#[test]
fn another_node_than_expected_runs_where_it_is_accepted() {
    let (vendor, device_type) = (Object::new(0x1018, 1), Object::new(0x1000, 0));
    for wire in
        [Wire::Misread(vendor, 0xDEAD_BEEF), Wire::Misread(device_type, 0x191), Wire::Refuse(device_type)]
    {
        let mut world = World::new(true, LWA4P);
        world.run(100_000);
        world.bus.peer_mut().wire = wire;
        world.driver.accept_other_nodes();
        world.driver.start(ControlMode::InterpolatedPosition, false).unwrap();
        assert!(world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running), "{wire:?}");
        let notes: Vec<Cause> = world.driver.notes().map(|note| note.cause).collect();
        assert!(
            matches!(notes[..], [Cause::WrongIdentity(VICTIM, ..) | Cause::Sdo(VICTIM, ..)]),
            "{notes:?}"
        );
    }
}

#[test]
fn a_bus_that_cannot_carry_it_is_refused_and_a_tight_one_reported() {
    let entry = |index, bits| Entry::new(Object::new(index, 0), bits);
    // What a public DCF maps: at 200 Hz and 500 kbit/s impossible.
    let mut profile = LWA4P;
    profile.tpdos = [
        Mapping::new(&[entry(0x6041, 16), entry(0x6061, 8)]).unwrap(),
        Mapping::EMPTY,
        Mapping::new(&[entry(0x6064, 32), entry(0x606C, 32)]).unwrap(),
        Mapping::EMPTY,
    ];
    profile.interpolated_position.as_mut().unwrap().rpdo =
        Mapping::new(&[entry(0x6040, 16), entry(0x6042, 16), Entry::new(Object::new(0x60C1, 1), 32)])
            .unwrap();
    profile.tpdos[3] = Mapping::new(&[entry(0x607A, 32), entry(0x6081, 32)]).unwrap();
    let refused = Driver::new(profile).unwrap().start(ControlMode::InterpolatedPosition, false);
    assert!(matches!(refused, Err(Refusal::BusLoad(load)) if load > 1.19), "{refused:?}");
    assert!(
        Driver::new(Profile { sync_period: 10_000, ..profile })
            .unwrap()
            .start(ControlMode::InterpolatedPosition, false)
            .is_ok()
    );

    let mut profile = LWA4P;
    let lean = Driver::new(profile).unwrap().start(ControlMode::InterpolatedPosition, false);
    assert_eq!(lean, Ok(Verdict::Fits));
    profile.interpolated_position.as_mut().unwrap().rpdo =
        Mapping::new(&[entry(0x6040, 16), Entry::new(Object::new(0x60C1, 1), 32), entry(0x60B2, 16)])
            .unwrap();
    let tight = Driver::new(profile).unwrap().start(ControlMode::InterpolatedPosition, false);
    assert_eq!(tight, Ok(Verdict::Tight));
}
