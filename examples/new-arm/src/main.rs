//! What the desk arm weighs at a pose: `cargo run -p new-arm`.

mod arm {
    #![allow(dead_code)]
    include!(concat!(env!("OUT_DIR"), "/arm.rs"));
}

fn main() {
    // Upper arm 30° up, forearm level; rad.
    let q = nalgebra::Vector3::<f64>::from([0.0, 30.0, -30.0]).map(f64::to_radians);
    let hand = arm::forward_kinematics(&q).fixed_view::<3, 1>(0, 3).into_owned();
    println!("hand at [m]{hand:8.3}");
    println!("torques that hold it there [N·m]{:8.3}", arm::gravity(&q));
    println!("mass matrix [kg·m²]{:8.4}", arm::mass_matrix(&q));
}
