//! Frames of a CAN bus and the datagrams that carry them: what is read of one is written as it was read, and
//! a driver that hears them never panics.
#![no_main]

use libfuzzer_sys::fuzz_target;
use powerball::bus::canopen::emcy::Emcy;
use powerball::bus::canopen::sdo::{Request, Response};
use powerball::bus::canopen::{Frame, nmt};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{ControlMode, Driver, QueueFull, Transmit};
use powerball::bus::transport::msgpack;

struct Wire;

impl Transmit for Wire {
    fn send(&mut self, _: Frame) -> Result<(), QueueFull> {
        Ok(())
    }
    fn discard_queued(&mut self) {}
}

// Ten bytes a frame: identifier, data; the time goes on by a millisecond.
fuzz_target!(|data: &[u8]| {
    if let Some(frame) = msgpack::decode(data) {
        assert_eq!(msgpack::decode(&msgpack::encode(&frame, 0.0)), Some(frame));
    }
    let Ok(mut driver) = Driver::new(LWA4P) else { return };
    let _ = driver.start(ControlMode::InterpolatedPosition, false);
    for (k, part) in data.chunks(10).enumerate() {
        let Some((id, bytes)) = part.split_at_checked(2) else { continue };
        let Some(frame) = Frame::from_raw(u16::from_le_bytes([id[0], id[1]]) & 0x7FF, bytes) else {
            continue;
        };
        if let Ok(request) = Request::decode(bytes) {
            assert_eq!(Request::decode(&request.encode()).ok(), Some(request));
        }
        if let Ok(response) = Response::decode(bytes) {
            assert_eq!(Response::decode(&response.encode()).ok(), Some(response));
        }
        if let Some((node, emcy)) = Emcy::decode(&frame) {
            assert_eq!(Emcy::decode(&emcy.frame(node)), Some((node, emcy)));
        }
        let _ = nmt::State::decode(&frame);
        for mapping in LWA4P.tpdos.into_iter().filter(|mapping| !mapping.is_empty()) {
            let bits: usize = mapping.entries().iter().map(|entry| usize::from(entry.bits)).sum();
            assert_eq!(mapping.unpack(bytes).is_some(), bytes.len() == bits.div_ceil(8));
        }
        let now = 1000 * k as u64;
        driver.poll(now, &mut Wire);
        driver.receive(&frame, now, &mut Wire);
    }
});
