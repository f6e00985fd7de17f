//! Two controllers of the desk arm on a simulated one: `cargo run -p control-loop`. No hardware was run with
//! them.

mod arm {
    #![allow(dead_code)]
    include!(concat!(env!("OUT_DIR"), "/arm.rs"));
}
mod simulated;

use powerball::controller::dynamics::{Functions, Reference, State};
use powerball::controller::friction::TanhFriction;
use powerball::controller::laws::{ComputedTorque, HandGuiding, Softening};
use simulated::{Arm, PERIOD};

type Joints = nalgebra::Vector3<f64>;

/// The generated model.
const MODEL: Functions<f64, 3> = Functions {
    mass_matrix: arm::mass_matrix,
    coriolis_times_velocity: arm::coriolis_times_velocity,
    coriolis_transpose_times_velocity: arm::coriolis_transpose_times_velocity,
    gravity: arm::gravity,
    forward_kinematics: arm::forward_kinematics,
    jacobian: arm::jacobian,
    jacobian_rate_times_velocity: arm::jacobian_rate_times_velocity,
};

/// Eq. 16 of each joint, as `powerball identify` finds it: N·m, s/rad, N·m·s/rad.
const FRICTION: TanhFriction<f64> =
    TanhFriction { gamma1: 0.5, gamma2: 50.0, gamma3: 0.1, gamma4: 5.0, gamma5: 0.4 };

/// Weight and friction are taken off whoever moves the arm by hand, who pulls at joint 2.
fn guide(arm: &mut Arm, hand: f64, seconds: f64) {
    let mut law = HandGuiding::new([FRICTION; 3], [Softening::of(&FRICTION); 3]);
    for _ in 0..(seconds / PERIOD) as usize {
        let torque = law.torque(&MODEL, &arm.state);
        arm.advance(torque + Joints::new(0.0, hand, 0.0));
    }
}

/// Along a path with small errors: the rigid arm and its feedback, and the friction of the motion that is
/// wanted.
fn follow(arm: &mut Arm, path: impl Fn(f64) -> Reference<f64, 3>, seconds: f64) -> f64 {
    let law = ComputedTorque::for_period(PERIOD);
    let mut worst = 0.0;
    for k in 0..(seconds / PERIOD) as usize {
        let goal = path(k as f64 * PERIOD);
        worst = (goal.q - arm.state.q).amax().max(worst);
        let torque = law.torque(&MODEL, &arm.state, &goal);
        arm.advance(torque + goal.dq.map(|dq| FRICTION.torque(dq)));
    }
    worst
}

fn main() {
    let rest = Joints::new(0.2, 0.5, -0.4);
    let mut arm = Arm { state: State { q: rest, dq: Joints::zeros() }, friction: FRICTION };
    // Hands off, with a weight that the model does not know.
    guide(&mut arm, 0.02, 10.0);
    let drift = (arm.state.q - rest).amax();
    guide(&mut arm, 0.3, 1.0);
    let moved = arm.state.q[1] - rest[1];
    println!(
        "hands off for 10 s: {:.4} mrad; pulled by half the friction for 1 s: {moved:.3} rad",
        1e3 * drift
    );
    assert!(drift < 1e-3 && moved > 0.05);

    let from = arm.state.q;
    arm.state.dq = Joints::zeros();
    // A cosine, 0.5 rad to and fro.
    let swing = |t: f64| {
        let (sin, cos) = (2.0 * t).sin_cos();
        let all = Joints::repeat;
        Reference { q: from.add_scalar(0.5 - 0.5 * cos), dq: all(sin), ddq: all(2.0 * cos) }
    };
    let worst = follow(&mut arm, swing, 6.0);
    println!("largest error along the path: {:.2} mrad", 1e3 * worst);
    assert!(worst < 1e-3);
}
