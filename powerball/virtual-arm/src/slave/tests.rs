//! The slaves as a master sees them, over a bus in memory.

use super::{CurrentMode, Fault, VirtualArm};
use crate::{Simulation, lwa4p};
use powerball_bus::canopen::client::{SdoError, Value};
use powerball_bus::canopen::emcy::Emcy;
use powerball_bus::canopen::sdo::AbortCode;
use powerball_bus::canopen::{Cob, Frame, Micros, NodeId, Object, cob, nmt, objects};
use powerball_bus::cia402::{State, Statusword, objects as drive, schunk};
use powerball_bus::driver::lwa4p::DICTIONARY;
use powerball_bus::transport::blocking::{self, TransferError};
use powerball_bus::transport::{Bus, Event, Memory};

const START: [f64; 6] = [0.2, 0.4, -0.6, 0.3, 0.5, -0.2];
const CYCLE: Micros = 5_000;

/// A master made of a bus and a hand.
struct Bench {
    bus: Memory<VirtualArm>,
    emergencies: Vec<(u8, u16)>,
    heard: Vec<Frame>,
}

impl Bench {
    fn new() -> Bench {
        let mut setup = lwa4p::setup(START, 1).unwrap();
        setup.modules.iter_mut().for_each(|m| m.commutated = true);
        Bench::of(VirtualArm::new(setup).unwrap())
    }

    fn of(arm: VirtualArm) -> Bench {
        let mut bench = Bench { bus: Memory::new(arm, 500_000), emergencies: Vec::new(), heard: Vec::new() };
        bench.pass(100_000);
        bench
    }

    fn arm(&self) -> &VirtualArm {
        self.bus.peer()
    }

    fn simulation(&self) -> &Simulation {
        self.arm().simulation()
    }

    /// Lets time pass and keeps what is heard.
    fn pass(&mut self, time: Micros) {
        let until = self.bus.now() + time;
        while let Some((_, event)) = self.bus.receive(until).unwrap() {
            let Event::Frame(frame) = event else { continue };
            self.emergencies.extend(Emcy::decode(&frame).map(|(node, e)| (node.raw(), e.code)));
            self.heard.push(frame);
        }
    }

    fn send(&mut self, frame: Frame) {
        self.bus.send(&frame).unwrap();
    }

    fn read(&mut self, node: u8, object: Object) -> Result<Value, AbortCode> {
        code(blocking::read(&mut self.bus, NodeId::clamped(node), object))
    }

    fn number(&mut self, node: u8, object: Object) -> i32 {
        self.read(node, object).unwrap().signed().unwrap()
    }

    fn write(&mut self, node: u8, object: Object, value: i64) -> Result<(), AbortCode> {
        let size = self.arm().nodes()[usize::from(node) - 3].dictionary().entry(object)?.kind.size().unwrap();
        code(blocking::write(&mut self.bus, NodeId::clamped(node), object, Value::number(value, size)))
    }

    fn state(&self, node: u8) -> State {
        self.arm().nodes()[usize::from(node) - 3].state()
    }

    /// To operation enabled in a mode, by SDO alone, with the RPDOs' objects left alone.
    fn enable(&mut self, node: u8, mode: i8) {
        self.write(node, drive::MODE, i64::from(mode)).unwrap();
        for word in [0x06, 0x07, 0x0F] {
            self.write(node, drive::CONTROLWORD, word).unwrap();
        }
        assert_eq!(self.state(node), State::OperationEnabled);
        self.pass(60_000);
    }

    fn start(&mut self) {
        self.send(nmt::Command::Start.frame(None));
        self.pass(2_000);
    }

    /// Interpolated position at 200 Hz: a SYNC, then a set-point (rad) for joint 1 as default RPDO 1 has it.
    fn cycle(&mut self, word: u16, point: Option<f64>) {
        self.send(cob::SYNC);
        self.pass(2_000);
        if let Some(point) = point {
            let counts = (point.to_degrees() * 1000.0).round() as i32;
            let mut bytes = word.to_le_bytes().to_vec();
            bytes.extend(counts.to_le_bytes());
            self.send(Frame::from_raw(Cob::Rpdo(1, NodeId::clamped(3)).id(), &bytes).unwrap());
        }
        self.pass(CYCLE - 2_000);
    }
}

fn code<T>(result: Result<T, TransferError>) -> Result<T, AbortCode> {
    result.map_err(|e| match e {
        TransferError::Node { error: SdoError::Aborted(code), .. } => code,
        other => panic!("{other}"),
    })
}

#[test]
fn six_nodes_boot_once_and_say_who_they_are() {
    let mut bench = Bench::new();
    let booted: Vec<u16> = bench.heard.iter().filter(|f| f.bytes() == [0]).map(Frame::raw_id).collect();
    assert_eq!(booted, [0x703, 0x704, 0x705, 0x706, 0x707, 0x708]);
    for node in 3..=8 {
        assert_eq!(bench.number(node, objects::DEVICE_TYPE), 0x0002_0192);
        assert_eq!(bench.number(node, objects::SERIAL_NUMBER), 1000 + i32::from(node));
        assert_eq!(bench.number(node, drive::SUPPORTED_MODES), 0x43);
        let name = bench.read(node, objects::DEVICE_NAME).unwrap();
        assert_eq!(name.as_slice(), b"PRL+ virtual");
        let position = f64::from(bench.number(node, drive::POSITION));
        assert!((position - START[usize::from(node) - 3].to_degrees() * 1000.0).abs() < 1.0);
    }
}

#[test]
fn exactly_the_objects_of_the_dcf_exist_with_their_rights() {
    let mut bench = Bench::new();
    for entry in DICTIONARY {
        let read = bench.read(5, entry.object);
        assert_eq!(read.is_ok(), entry.readable, "{}: {read:?}", entry.object);
        if let (Ok(value), Some(size)) = (read, entry.data_type.size()) {
            assert_eq!(value.as_slice().len(), size, "{}", entry.object);
        }
        if !entry.writable {
            let size = entry.data_type.size().unwrap_or(4);
            let value = Value::number(0, size);
            let written = code(blocking::write(&mut bench.bus, NodeId::clamped(5), entry.object, value));
            assert_eq!(written, Err(AbortCode::READ_ONLY), "{}", entry.object);
        }
    }
    let known = |index: u16| DICTIONARY.iter().any(|e| e.object.index == index);
    for index in (0x1000..0x1030).chain(0x6000..0x6110).filter(|i| !known(*i)) {
        assert_eq!(bench.read(5, Object::new(index, 0)), Err(AbortCode::NO_OBJECT), "{index:04X}");
    }
    assert_eq!(bench.read(5, Object::new(0x607D, 3)), Err(AbortCode::NO_SUB_INDEX));
}

#[test]
fn wrong_values_are_refused_with_their_reason() {
    let mut bench = Bench::new();
    let node = NodeId::clamped(3);
    let mut raw = |object, bytes: &[u8]| {
        code(blocking::write(&mut bench.bus, node, object, Value::new(bytes).unwrap()))
    };
    assert_eq!(raw(drive::CONTROLWORD, &[6, 0, 0]), Err(AbortCode::TOO_LONG));
    assert_eq!(raw(drive::CONTROLWORD, &[6]), Err(AbortCode::TOO_SHORT));
    assert_eq!(raw(drive::MODE, &[4]), Err(AbortCode::VALUE));
    assert_eq!(raw(drive::MODE, &[8]), Err(AbortCode::VALUE));
    assert_eq!(raw(objects::PRODUCER_HEARTBEAT, &[0, 0x80]), Err(AbortCode::VALUE));
    assert_eq!(raw(objects::ERROR_HISTORY, &[1]), Err(AbortCode::VALUE));
    // A password is a string and may be longer than a frame; nobody reads it back.
    assert_eq!(raw(Object::new(0x2008, 0), b"a long password"), Ok(()));
    assert_eq!(bench.read(3, Object::new(0x2008, 0)), Err(AbortCode::WRITE_ONLY));
}

#[test]
fn a_pdo_is_changed_the_way_the_device_wants_it_and_no_other() {
    let mut bench = Bench::new();
    let (count, entry) = (objects::tpdo_mapping(2, 0), objects::tpdo_mapping(2, 1));
    let cob_id = objects::tpdo_parameter(2, 1);
    assert_eq!(bench.write(3, count, 0), Err(AbortCode::DEVICE_STATE), "it is valid still");
    assert_eq!(bench.write(3, cob_id, 0x285), Err(AbortCode::VALUE), "so is its identifier");
    bench.write(3, cob_id, 0x8000_0283).unwrap();
    assert_eq!(bench.write(3, entry, 0x606C_0020), Err(AbortCode::DEVICE_STATE), "it maps something");
    bench.write(3, count, 0).unwrap();
    assert_eq!(bench.write(3, entry, 0x6071_0010), Err(AbortCode::NO_OBJECT));
    assert_eq!(bench.write(3, entry, 0x606C_0010), Err(AbortCode::NOT_MAPPABLE), "wrong size");
    assert_eq!(bench.write(3, entry, 0x6065_0020), Err(AbortCode::NOT_MAPPABLE));
    for (sub, mapped) in [(1, 0x606C_0020), (2, 0x6061_0008), (3, 0x6064_0020)] {
        bench.write(3, objects::tpdo_mapping(2, sub), mapped).unwrap();
    }
    assert_eq!(bench.write(3, count, 3), Err(AbortCode::PDO_LENGTH));
    bench.write(3, count, 2).unwrap();
    bench.write(3, cob_id, 0x0000_0283).unwrap();
    bench.start();
    assert_eq!(bench.write(3, cob_id, 0x8000_0283), Err(AbortCode::DEVICE_STATE), "operational");
    bench.heard.clear();
    bench.send(cob::SYNC);
    bench.pass(CYCLE);
    let tpdo = bench.heard.iter().find(|f| f.raw_id() == 0x283).unwrap();
    assert_eq!(tpdo.bytes().len(), 5);
    assert!(bench.heard.iter().filter(|f| f.raw_id() == 0x183).count() == 1);
    // TPDO 4 is asynchronous, TPDO 3 maps nothing: neither is sent.
    assert!(bench.heard.iter().all(|f| !matches!(f.raw_id() & !0x7F, 0x380 | 0x480)));
}

#[test]
fn the_receive_pdo_cannot_carry_what_is_read_only() {
    let mut bench = Bench::new();
    bench.write(3, objects::rpdo_parameter(2, 1), 0x8000_0303).unwrap();
    assert_eq!(bench.write(3, objects::rpdo_mapping(2, 1), 0x6064_0020), Err(AbortCode::NOT_MAPPABLE));
    assert_eq!(bench.write(3, objects::rpdo_mapping(2, 1), 0x6040_0010), Ok(()));
}

#[test]
fn interpolated_position_follows_and_brakes_hold_before_and_after() {
    let mut bench = Bench::new();
    bench.write(3, drive::INTERPOLATION_PERIOD, 5).unwrap();
    bench.write(3, objects::rpdo_parameter(1, 2), 1).unwrap();
    bench.enable(3, 7);
    bench.start();
    let path = |k: usize| START[0] + 0.1 * (1.0 - (0.01 * k as f64).cos());
    let mut worst = 0.0f64;
    for k in 0..1000 {
        bench.cycle(0x1F, Some(path(k)));
        if k > 20 {
            // One and a half periods late by interpolation, one more until the SYNC.
            worst = worst.max((bench.simulation().links()[0] - path(k - 3)).abs());
        }
    }
    assert!(worst < 3e-3, "{worst} rad");
    let word = Statusword(bench.number(3, drive::STATUSWORD) as u16);
    assert!(word.has(Statusword::MODE_12) && word.state() == State::OperationEnabled, "{word:?}");
    let others: f64 = (1..6).map(|i| (bench.simulation().links()[i] - START[i]).abs()).sum();
    assert!(others < 1e-4, "the brakes of the other joints let go: {others}");
    assert!(bench.emergencies.is_empty());
    // Halt stops and closes the brake.
    for k in 0..100 {
        bench.cycle(0x11F, Some(path(1000 + k)));
    }
    assert!(bench.arm().nodes()[0].brake_closed() && bench.simulation().link_velocities()[0].abs() < 1e-4);
}

#[test]
fn without_fresh_set_points_the_drive_stops_quickly_by_itself() {
    for lose_sync in [false, true] {
        let mut bench = Bench::new();
        bench.write(3, drive::INTERPOLATION_PERIOD, 5).unwrap();
        bench.write(3, objects::rpdo_parameter(1, 2), 1).unwrap();
        bench.enable(3, 7);
        bench.start();
        let path = |k: usize| START[0] + 0.4 * (0.005 * k as f64);
        (0..100).for_each(|k| bench.cycle(0x1F, Some(path(k))));
        assert!(bench.simulation().link_velocities()[0] > 0.3);
        let mut cycles = 0;
        while bench.state(3) == State::OperationEnabled {
            if lose_sync {
                bench.pass(CYCLE)
            } else {
                bench.cycle(0x1F, None)
            }
            cycles += 1;
            assert!(cycles < 20);
        }
        // 0x200E is 6.
        assert!((6..=8).contains(&cycles), "{cycles}");
        bench.pass(300_000);
        assert_eq!(bench.state(3), State::SwitchOnDisabled);
        assert!(bench.arm().nodes()[0].brake_closed());
        assert_eq!(bench.emergencies, [(3, 0x8250)]);
    }
}

#[test]
fn the_drive_watches_its_master() {
    let mut bench = Bench::new();
    bench.write(4, objects::CONSUMER_HEARTBEAT, 0x0001_0064).unwrap();
    bench.enable(4, 1);
    bench.start();
    let beat = nmt::State::Operational.frame(NodeId::clamped(1));
    for _ in 0..20 {
        bench.send(beat);
        bench.pass(50_000);
    }
    assert_eq!(bench.state(4), State::OperationEnabled);
    bench.pass(400_000);
    assert_eq!(bench.state(4), State::SwitchOnDisabled);
    assert_eq!(bench.emergencies, [(4, 0x8130)]);
    assert_eq!(bench.arm().nodes()[1].nmt_state(), nmt::State::PreOperational);
}

#[test]
fn velocity_mode_scales_ramps_and_stops_at_the_limit() {
    let mut bench = Bench::new();
    bench.enable(3, 2);
    bench.write(3, drive::VL_TARGET_VELOCITY, 20_000).unwrap();
    bench.pass(200_000);
    assert!(bench.simulation().link_velocities()[0].abs() < 1e-3, "the ramp is held without bits 4 to 6");
    bench.write(3, drive::CONTROLWORD, 0x7F).unwrap();
    bench.pass(500_000);
    approx::assert_relative_eq!(
        bench.simulation().link_velocities()[0],
        20f64.to_radians(),
        max_relative = 0.01
    );
    // Four times as fast for the same count.
    bench.write(3, drive::VL_FACTOR_DENOMINATOR, 24_000).unwrap();
    bench.write(3, drive::VL_TARGET_VELOCITY, 7_500).unwrap();
    bench.pass(500_000);
    approx::assert_relative_eq!(
        bench.simulation().link_velocities()[0],
        30f64.to_radians(),
        max_relative = 0.01
    );
    bench.pass(8_000_000);
    let at = bench.simulation().links()[0];
    assert!((2.9..2.968).contains(&at) && bench.simulation().link_velocities()[0].abs() < 1e-3, "{at}");
    let word = Statusword(bench.number(3, drive::STATUSWORD) as u16);
    assert!(word.has(Statusword::INTERNAL_LIMIT), "{word:?}");
}

#[test]
fn profile_position_shakes_hands_and_arrives() {
    let mut bench = Bench::new();
    bench.enable(6, 1);
    bench.write(6, drive::TARGET_POSITION, 40_000).unwrap();
    bench.write(6, drive::PROFILE_VELOCITY, 30_000).unwrap();
    bench.write(6, drive::CONTROLWORD, 0x1F).unwrap();
    bench.pass(10_000);
    let word = |bench: &mut Bench| Statusword(bench.number(6, drive::STATUSWORD) as u16);
    assert!(word(&mut bench).has(Statusword::MODE_12) && !word(&mut bench).has(Statusword::TARGET_REACHED));
    bench.write(6, drive::CONTROLWORD, 0x0F).unwrap();
    bench.pass(10_000);
    assert!(!word(&mut bench).has(Statusword::MODE_12));
    bench.pass(2_000_000);
    assert!(word(&mut bench).has(Statusword::TARGET_REACHED), "{:?}", word(&mut bench));
    assert!((bench.number(6, drive::POSITION) - 40_000).abs() <= 12);
}

#[test]
fn a_sagging_supply_faults_and_the_drive_searches_its_commutation_again() {
    let mut bench = Bench::new();
    bench.start();
    bench.enable(4, 1);
    assert_eq!(bench.number(4, schunk::EXTENDED_STATUS), 3);
    bench.bus.peer_mut().fault(NodeId::clamped(4), Fault::Supply(false));
    bench.pass(100_000);
    assert_eq!((bench.state(4), bench.emergencies.clone()), (State::Fault, vec![(4, 0x3222)]));
    assert!(bench.arm().nodes()[1].brake_closed());
    let reset = |bench: &mut Bench| {
        bench.write(4, drive::CONTROLWORD, 0x00).unwrap();
        bench.write(4, drive::CONTROLWORD, 0x80).unwrap();
    };
    reset(&mut bench);
    assert_eq!(bench.state(4), State::Fault, "the cause is still there");
    bench.bus.peer_mut().fault(NodeId::clamped(4), Fault::Supply(true));
    reset(&mut bench);
    assert_eq!(bench.state(4), State::SwitchOnDisabled);
    assert_eq!(bench.number(4, schunk::EXTENDED_STATUS), 0);
    bench.enable(4, 7);
    bench.pass(600_000);
    assert_eq!(bench.number(4, schunk::EXTENDED_STATUS), 3);
    assert_eq!(bench.number(4, objects::ERROR_HISTORY), 1);
    assert_eq!(bench.number(4, Object::new(0x1003, 1)), 0x3222);
}

#[test]
fn faults_on_demand_do_what_they_say() {
    let mut bench = Bench::new();
    let node = NodeId::clamped(5);
    bench.write(5, objects::PRODUCER_HEARTBEAT, 100).unwrap();
    bench.start();
    let beats = |bench: &mut Bench| {
        bench.heard.clear();
        bench.pass(1_000_000);
        bench.heard.iter().filter(|f| f.raw_id() == 0x705).map(|f| f.bytes()[0]).collect::<Vec<_>>()
    };
    assert_eq!(beats(&mut bench), [5; 10]);
    bench.bus.peer_mut().fault(node, Fault::Silent(true));
    assert!(beats(&mut bench).is_empty());
    bench.bus.peer_mut().fault(node, Fault::Silent(false));
    bench.bus.peer_mut().fault(node, Fault::Reboot);
    assert_eq!(beats(&mut bench), [0], "boot-up, and no heartbeat until it is set again");
    bench.bus.peer_mut().fault(node, Fault::Statusword(Some(0xFFFF)));
    assert_eq!(bench.number(5, drive::STATUSWORD) as u16, 0xFFFF);
    bench
        .bus
        .peer_mut()
        .fault(node, Fault::RefuseMode(Some(powerball_bus::cia402::Mode::InterpolatedPosition)));
    bench.write(5, drive::MODE, 7).unwrap();
    assert_eq!(bench.number(5, drive::MODE_DISPLAY), 0);
    bench.bus.peer_mut().fault(node, Fault::Emergency { code: 0x4310, register: 8 });
    bench.pass(10_000);
    assert_eq!(bench.emergencies, [(5, 0x4310)]);
}

#[test]
fn a_current_mode_is_there_only_where_it_is_declared() {
    let mut setup = lwa4p::setup(START, 1).unwrap();
    let target = Object::new(0x6071, 0);
    setup.modules[0].commutated = true;
    setup.modules[0].current_mode = Some(CurrentMode { mode: 4, target });
    let mut bench = Bench::of(VirtualArm::new(setup).unwrap());
    assert_eq!(bench.number(3, drive::SUPPORTED_MODES), 0x4B);
    assert_eq!(bench.read(4, target), Err(AbortCode::NO_OBJECT));
    bench.enable(3, 4);
    // 14 N·m are 2000 ‰: the joint velocities up until friction takes them.
    bench.write(3, target, 2000).unwrap();
    bench.pass(1_000_000);
    assert!(bench.simulation().link_velocities()[0] > 0.2);
    approx::assert_relative_eq!(bench.arm().torques()[0], 14.0, max_relative = 1e-9);
}

#[test]
#[ignore = "a measurement; run in release with --ignored --nocapture"]
fn how_fast_with_six_drives_at_200_hz() {
    let mut bench = Bench::new();
    for node in 3..=8 {
        bench.write(node, drive::INTERPOLATION_PERIOD, 5).unwrap();
        bench.write(node, objects::rpdo_parameter(1, 2), 1).unwrap();
        bench.enable(node, 7);
    }
    bench.start();
    let start = std::time::Instant::now();
    let cycles = 10_000;
    for k in 0..cycles {
        bench.send(cob::SYNC);
        for (joint, node) in (3..=8).enumerate() {
            let point = START[joint] + 0.1 * (1.0 - (0.01 * f64::from(k)).cos());
            let mut bytes = vec![0x1F, 0];
            bytes.extend(((point.to_degrees() * 1000.0) as i32).to_le_bytes());
            bench.send(Frame::from_raw(0x200 + node, &bytes).unwrap());
        }
        bench.pass(CYCLE);
    }
    println!("{:.0} times real time", f64::from(cycles) * 0.005 / start.elapsed().as_secs_f64());
    assert!(bench.emergencies.is_empty(), "{:?}", bench.emergencies);
}
