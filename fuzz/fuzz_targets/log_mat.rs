//! Any bytes as MATLAB's files: tables or a reason, never a panic.
#![no_main]

mod log;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| log::read(b"MATLAB 5.0 MAT-file", data));
