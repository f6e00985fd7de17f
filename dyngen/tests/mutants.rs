//! Files of every language with one thing changed: each change is found, or shown to change no value.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)]

#[path = "support/mutation.rs"]
mod mutation;

use chacha20::ChaCha8Rng;
use dyngen::verify::Verifier;
use dyngen::{Arm, Config, Function, Language};
use rand::SeedableRng;
use std::path::Path;

/// Potential energies are the same with another constant; the rest of the file is the same for all functions.
const FUNCTIONS: [Function; 10] = {
    use Function::*;
    [
        InverseDynamics,
        Regressor,
        MassMatrix,
        CoriolisMatrix,
        Gravity,
        ForwardDynamics,
        KineticEnergy,
        ForwardKinematics,
        Jacobian,
        TorqueByPosition,
    ]
};

/// How many changes there were, and what became of them.
#[derive(Debug, Default)]
struct Counts {
    /// Another value, an angle that is none of the arm's, a name without a value.
    found: usize,
    /// Nothing that dyngen writes.
    unread: usize,
    /// The order of terms, factors or lines.
    order: usize,
    /// Passed, and the code around it has the same values in floating point.
    same: usize,
}

fn counts(arm: &str, language: Language, wished: usize, seed: u64, passed: &mut Vec<String>) -> Counts {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(arm);
    let mut config = Config::new(&path).language(language).functions(FUNCTIONS);
    if language != Language::Wgsl {
        config = config.friction(["viscous", "coulomb", "tanh:20"].map(|term| term.parse().unwrap()));
    }
    let text = config.batch(language == Language::Rust).source().unwrap();
    let verifier = Verifier::new(Arm::read(&path).unwrap(), language, &text).unwrap();
    assert_eq!(verifier.verify(&text, None).unwrap().difference, None, "{arm} {language}");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let lines = mutation::code_lines(&text);
    let mut counts = Counts::default();
    while counts.found + counts.unread + counts.order + counts.same < wished {
        let Some(mutant) = mutation::mutant(&lines, &text, &mut rng) else { continue };
        let only = Function::parse(&mutant.function).map(|function| vec![function]);
        match verifier.verify(&mutant.text, only.as_deref()) {
            Err(_) => counts.unread += 1,
            Ok(report) if report.difference.is_some() => counts.found += 1,
            Ok(_) if mutant.is_order => counts.order += 1,
            Ok(_) if mutant.is_same => counts.same += 1,
            Ok(_) => {
                passed.push(format!("{arm}, {language}, line {}: {}", mutant.line, mutant.what));
                counts.same += 1;
            }
        }
    }
    counts
}

fn every_mutant_is_found(each: usize, seed: u64) {
    let mut passed = Vec::new();
    for arm in ["tests/arms/scara.toml", "tests/arms/twist.toml", "dyngen/tests/loops/rocker.toml"] {
        for language in [Language::Rust, Language::C, Language::Cuda, Language::Wgsl] {
            let counts = counts(arm, language, each, seed, &mut passed);
            println!("{arm}, {language}: {counts:?}");
            assert!(counts.found * 2 > each, "{arm}, {language}: {counts:?}");
        }
    }
    assert!(passed.is_empty(), "not found:\n{}", passed.join("\n"));
}

#[test]
fn of_two_hundred_mutants_every_one_that_changes_a_value_is_found() {
    every_mutant_is_found(25, 1);
}

/// `cargo test --release -p dyngen --test mutants -- --ignored --nocapture`
#[test]
#[ignore = "minutes"]
fn of_two_thousand_mutants_every_one_that_changes_a_value_is_found() {
    every_mutant_is_found(250, 2026);
}
