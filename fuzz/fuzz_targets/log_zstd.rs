//! Any bytes as a recording that Zstandard compressed: tables or a reason, never a panic.
#![no_main]

mod log;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| log::read(b"\x28\xb5\x2f\xfd", data));
