//! The negative control: an index that nobody can bound. It must not link.
#![no_std]
#![no_main]

#[path = "../proof.rs"]
mod proof;

use core::hint::black_box;
use cortex_m_rt::entry;
use powerball_firmware::f32::STATES;

#[entry]
fn main() -> ! {
    loop {
        black_box(STATES[black_box(7)]);
    }
}
