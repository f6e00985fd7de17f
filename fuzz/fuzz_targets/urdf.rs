//! Any text as a URDF: an arm or reasons.
#![no_main]

use dyngen::import::{Options, urdf};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(imported) = urdf(text, "fuzz.urdf", &Options::default()) {
        let _ = imported.values_json();
    }
});
