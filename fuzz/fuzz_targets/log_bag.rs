//! Any bytes as bags of ROS 1: tables or a reason, never a panic.
#![no_main]

mod log;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| log::read(b"#ROSBAG V2.0\n", data));
