//! Any text as a MuJoCo model: an arm or reasons.
#![no_main]

use dyngen::import::{Options, mjcf};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(imported) = mjcf(text, "fuzz.xml", &Options::default()) {
        let _ = imported.values_json();
    }
});
