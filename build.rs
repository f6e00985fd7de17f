//! Generates the code that the tests compile: the arms of `tests/arms` and the paper's arm, for each
//! parameter set.

use dyngen::{Config, Function, SetKind};

fn main() {
    println!("cargo::rerun-if-changed=tests/arms");
    for name in ["puma560", "ur5e", "panda", "stanford"] {
        for set in [SetKind::Full, SetKind::Minimal, SetKind::Symbolic] {
            let config =
                Config::new(format!("tests/arms/{name}.toml")).parameters(set).batch(name == "stanford");
            config.build(&format!("{name}_{set}.rs")).unwrap_or_else(|e| e.exit());
        }
    }
    let rotorless = Config::new("tests/arms/lwa4p_rotorless.toml");
    rotorless.batch(true).build("lwa4p_rotorless_minimal.rs").unwrap_or_else(|e| e.exit());
    let others: Vec<Function> =
        Function::ALL.into_iter().filter(|f| Function::common().all(|common| common != *f)).collect();
    let control = Config::new("tests/arms/lwa4p_rotorless.toml").functions(others).batch(true);
    // Some of them are the full set's alone.
    let control = control.parameters(SetKind::Full);
    control.build("lwa4p_rotorless_control.rs").unwrap_or_else(|e| e.exit());
    let of_steps = [
        Function::ForwardDynamics,
        Function::MassMatrixInverse,
        Function::AccelerationByPosition,
        Function::AccelerationByVelocity,
    ];
    let discrete = Config::new("tests/arms/lwa4p_rotorless.toml").functions(of_steps);
    discrete.build("lwa4p_rotorless_discrete.rs").unwrap_or_else(|e| e.exit());
    for set in [SetKind::Full, SetKind::Minimal, SetKind::Symbolic, SetKind::Published] {
        let config = Config::new("powerball/arm.toml").parameters(set).batch(set == SetKind::Minimal);
        config.build(&format!("lwa4p_{set}.rs")).unwrap_or_else(|e| e.exit());
    }
}
