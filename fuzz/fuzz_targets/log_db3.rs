//! Any bytes as rosbag2's SQLite: tables or a reason, never a panic.
#![no_main]

mod log;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| log::read(b"SQLite format 3\0", data));
