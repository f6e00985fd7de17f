//! Any bytes as MCAP: tables or a reason, never a panic.
#![no_main]

mod log;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| log::read(b"\x89MCAP0\r\n", data));
