//! Generates the dynamics of the LWA 4P as the identification paper models it, for three parameter sets.

use dyngen::{Config, SetKind};

fn main() {
    for set in [SetKind::Minimal, SetKind::Symbolic, SetKind::Published] {
        let built = Config::new("arm.toml")
            .parameters(set)
            .batch(set == SetKind::Minimal)
            .build(&format!("{set}.rs"));
        built.unwrap_or_else(|e| e.exit());
    }
}
