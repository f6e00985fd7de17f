//! Random and mutated bytes into everything that reads a bus or a drive's file, a fixed number of times with
//! a fixed seed: nothing panics, and accepted bytes are read with the right meaning. `fuzz/` holds the same
//! readers for as long as one likes.

use super::canopen::emcy::Emcy;
use super::canopen::pdo::Mapping;
use super::canopen::sdo::{Request, Response};
use super::canopen::{Frame, Micros, NodeId, nmt};
use super::driver::import::rust_source;
use super::driver::lwa4p::LWA4P;
use super::driver::{BusEvent, ControlMode, Driver, Phase, QueueFull, Transmit};
use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

const TIMES: usize = 100_000;

fn bytes(rng: &mut ChaCha8Rng, most: usize) -> Vec<u8> {
    (0..rng.random_range(0..=most)).map(|_| rng.random()).collect()
}

#[test]
fn sdo_messages_say_what_they_are_taken_for() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut requests, mut responses) = (0, 0);
    for _ in 0..TIMES {
        let data = bytes(&mut rng, 9);
        if let Ok(request) = Request::decode(&data) {
            requests += 1;
            assert_eq!(Request::decode(&request.encode()).ok(), Some(request), "{data:02X?}");
        }
        if let Ok(response) = Response::decode(&data) {
            responses += 1;
            assert_eq!(Response::decode(&response.encode()).ok(), Some(response), "{data:02X?}");
        }
    }
    assert!(requests > 1000 && responses > 1000, "{requests} {responses}");
}

#[test]
fn emergencies_and_heartbeats_say_what_they_are_taken_for() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..TIMES {
        let data = bytes(&mut rng, 8);
        let Some(frame) = Frame::from_raw(rng.random_range(0..0x800), &data) else { continue };
        if let Some((node, emcy)) = Emcy::decode(&frame) {
            assert_eq!(Emcy::decode(&emcy.frame(node)), Some((node, emcy)), "{frame:?}");
        }
        if let Some((node, state)) = nmt::State::decode(&frame) {
            assert_eq!(nmt::State::decode(&state.frame(node)), Some((node, state)), "{frame:?}");
        }
        let _ = nmt::Command::decode(&frame, NodeId::clamped(5));
    }
}

#[test]
fn process_data_is_taken_in_its_own_length_only() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mappings: Vec<Mapping> = LWA4P.tpdos.into_iter().filter(|mapping| !mapping.is_empty()).collect();
    for _ in 0..TIMES {
        let data = bytes(&mut rng, 8);
        for mapping in &mappings {
            let bits: usize = mapping.entries().iter().map(|entry| usize::from(entry.bits)).sum();
            let taken =
                mapping.unpack(&data).map(|values| values.map(|(_, raw)| u64::from(raw)).sum::<u64>());
            assert_eq!(taken.is_some(), data.len() == bits.div_ceil(8), "{data:02X?}");
        }
    }
}

/// Takes everything, or now and then nothing.
struct Wire(u32);

impl Transmit for Wire {
    fn send(&mut self, _: Frame) -> Result<(), QueueFull> {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        if self.0 >> 24 == 0 { Err(QueueFull) } else { Ok(()) }
    }
    fn discard_queued(&mut self) {}
}

/// A driver that hears nonsense at any time never panics, and runs no arm on it.
#[test]
fn a_driver_that_hears_nonsense_moves_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for mode in ControlMode::ALL {
        let (mut driver, mut wire, mut now) = (Driver::new(LWA4P).unwrap(), Wire(1), 0 as Micros);
        for _ in 0..TIMES / 4 {
            now += rng.random_range(0..3000);
            match rng.random_range(0..40u32) {
                0 => drop(driver.start(mode, true).is_ok()),
                1 => drop(driver.enable().is_ok()),
                2 => drop(driver.acknowledge().is_ok()),
                3 => driver.event(BusEvent::ErrorPassive, now, &mut wire),
                4 => driver.event(BusEvent::Overrun, now, &mut wire),
                5..=20 => driver.poll(now, &mut wire),
                _ => {
                    // Identifiers of the arm's nodes more often than others.
                    let node = rng.random_range(3..9u16);
                    let kind = [0x080, 0x180, 0x280, 0x580, 0x700, 0x000][rng.random_range(0..6usize)];
                    let id = if kind == 0 { rng.random_range(0..0x800) } else { kind + node };
                    let data = bytes(&mut rng, 8);
                    driver.receive(&Frame::from_raw(id, &data).unwrap(), now, &mut wire);
                }
            }
            assert_ne!(driver.phase(), Phase::Running);
        }
    }
}

/// A small DCF with its bytes changed, lost and doubled: a profile or a reason.
#[test]
fn mutated_files_of_drives_are_read_or_refused() {
    const DCF: &str = "[DeviceInfo]\nBaudRate_500=1\n[1016sub1]\nDataType=7\nAccessType=rw\n[6040]\n\
        DataType=6\nAccessType=rww\nPDOMapping=1\n[1400sub1]\nDataType=7\nAccessType=rw\n\
        DefaultValue=$NODEID+0x200\n[1003]\nObjectType=8\nDataType=0x1B\nCompactSubObj=3\n[1003Name]\n\
        NrOfEntries=1\n1=Newest ; of all\n[1003Value]\n2=0x8130\n[A0sub1]\nDataType=5\nDefaultValue=0x10\n\
        [2000]\nDataType=0xA0\nDefaultValue=0xFFFFFF\n[DeviceComissioning]\nNodeID=5\nBaudrate=500\n";
    const ARM: &str = include_str!("../../lwa4p_bus.toml");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..2_000 {
        let mut dcf = DCF.as_bytes().to_vec();
        for _ in 0..rng.random_range(1..6) {
            let at = rng.random_range(0..dcf.len());
            match rng.random_range(0..3) {
                0 => dcf[at] = rng.random(),
                1 => drop(dcf.remove(at)),
                _ => dcf.insert(at, DCF.as_bytes()[rng.random_range(0..DCF.len())]),
            }
        }
        if let Err(why) = rust_source(&dcf, &[], ARM, "ARM", "a test") {
            assert!(!why.to_string().is_empty());
        }
    }
}
