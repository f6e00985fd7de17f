//! One cycle of the driver: set-points in, frames out.

use powerball::bus::canopen::Frame;
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{Driver, QueueFull, Refusal, Rejection, Transmit};

/// A transport that holds what one cycle sends.
#[derive(Default)]
pub struct Mailbox {
    frames: [Option<Frame>; 32],
    filled: usize,
}

impl Mailbox {
    /// What was sent, in order.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.frames.iter().flatten()
    }
}

impl Transmit for Mailbox {
    fn send(&mut self, frame: Frame) -> Result<(), QueueFull> {
        *self.frames.get_mut(self.filled).ok_or(QueueFull)? = Some(frame);
        self.filled += 1;
        Ok(())
    }

    fn discard_queued(&mut self) {
        *self = Mailbox::default();
    }
}

/// A driver of the LWA 4P.
///
/// # Errors
/// As [`Driver::new`].
pub fn driver() -> Result<Driver<6>, Refusal> {
    Driver::new(LWA4P)
}

/// One step: what came is taken, set-points are given, what is due leaves.
#[inline(never)]
pub fn step(
    driver: &mut Driver<6>,
    now: u64,
    came: &[Frame],
    positions: &[f64; 6],
) -> (Mailbox, Result<(), Rejection>) {
    let mut out = Mailbox::default();
    for frame in came {
        driver.receive(frame, now, &mut out);
    }
    let taken = driver.set(positions);
    driver.poll(now, &mut out);
    (out, taken)
}
