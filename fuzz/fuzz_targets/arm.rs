//! Any text as an arm file: an arm or errors, never a panic; small arms are derived and one function is
//! proven.
#![no_main]

use dyngen::{Arm, Function, Model, SetKind};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(arm) = Arm::parse(text, "fuzz.toml") else { return };
    // Many general angles are slow, not wrong.
    if arm.dof() <= 3
        && let Ok(model) = Model::derive(arm)
    {
        let _ = model.function(Function::Gravity, SetKind::Minimal);
    }
});
