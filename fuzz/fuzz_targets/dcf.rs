//! A drive's DCF: a profile or a reason.
#![no_main]

use libfuzzer_sys::fuzz_target;
use powerball::bus::driver::import::rust_source;

const ARM: &str = include_str!("../../powerball/lwa4p_bus.toml");

fuzz_target!(|data: &[u8]| {
    if let Err(why) = rust_source(data, &[], ARM, "ARM", "a fuzzer") {
        assert!(!why.to_string().is_empty());
    }
});
