use dyngen::{Config, Function::*};

fn main() {
    let functions = [MassMatrix, Gravity, ForwardKinematics];
    let config = Config::new("arm.toml").values("values.json").functions(functions);
    config.build("arm.rs").unwrap_or_else(|e| e.exit());
}
