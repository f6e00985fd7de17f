//! Any text as a file of parameter values.
#![no_main]

use dyngen::Values;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = Values::parse(text, "fuzz.json");
});
