//! What a call costs on the emulated core: instructions and stack.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// Instructions in a tick of the board's 25 MHz timer: QEMU is set so that one takes 1 ns.
const INSTRUCTIONS_PER_TICK: u32 = 40;
const CALLS: u32 = 400;

/// Counts instructions by the system's timer.
pub struct Counter {
    timer: SYST,
}

impl Counter {
    /// Starts the timer.
    pub fn new(mut timer: SYST) -> Counter {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(0x00ff_ffff);
        timer.clear_current();
        timer.enable_counter();
        Counter { timer }
    }

    fn of_many(&mut self, call: &mut dyn FnMut()) -> u32 {
        let mut ticks = 0;
        for _ in 0..CALLS {
            let start = SYST::get_current();
            call();
            ticks += start.wrapping_sub(SYST::get_current()) & 0x00ff_ffff;
        }
        let _ = &self.timer;
        ticks
    }

    /// Instructions of a call, to about one; what the counting itself takes is taken off.
    pub fn instructions(&mut self, call: &mut dyn FnMut()) -> u32 {
        let empty = self.of_many(&mut || {});
        self.of_many(call).saturating_sub(empty) * INSTRUCTIONS_PER_TICK / CALLS
    }
}

const PAINT: u32 = 0x5AFE_57AC;
/// Bytes below the stack pointer that are painted.
const DEPTH: usize = 64 * 1024;

/// Bytes of stack that a call uses, what it calls included.
#[inline(never)]
pub fn stack(call: &mut dyn FnMut()) -> usize {
    deepest(call) - deepest(&mut || {})
}

#[inline(never)]
fn deepest(call: &mut dyn FnMut()) -> usize {
    let top = (cortex_m::register::msp::read() as usize) & !3;
    let bottom = top - DEPTH;
    for address in (bottom..top).step_by(4) {
        // SAFETY: RAM of the stack that nothing uses yet: 4 MB, with interrupts off.
        unsafe { core::ptr::write_volatile(address as *mut u32, PAINT) };
    }
    call();
    let clean = (bottom..top).step_by(4).take_while(|address| {
        // SAFETY: as above.
        unsafe { core::ptr::read_volatile(*address as *const u32) == PAINT }
    });
    DEPTH - 4 * clean.count()
}
