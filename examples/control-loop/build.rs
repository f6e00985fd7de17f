use dyngen::{Config, Function::*};

fn main() {
    let rigid = [MassMatrix, CoriolisTimesVelocity, CoriolisTransposeTimesVelocity, Gravity, ForwardDynamics];
    let tool = [ForwardKinematics, Jacobian, JacobianRateTimesVelocity];
    let config = Config::new("../new-arm/arm.toml").values("../new-arm/values.json");
    config.functions([&rigid[..], &tool].concat()).build("arm.rs").unwrap_or_else(|e| e.exit());
}
