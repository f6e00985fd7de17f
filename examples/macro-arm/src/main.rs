//! A crane's load that is let go swings, and the trolley with it: `cargo run -p macro-arm`.

#[dyngen_macros::model(file = "crane.toml", functions = [forward_dynamics, kinetic_energy, potential_energy])]
#[allow(dead_code)]
mod crane {}

use nalgebra::{Vector2, Vector4};

type Pair = Vector2<f64>;

fn main() {
    // A trolley of 10 kg; 20 kg on a rope of 2 m: crane::PARAMETER_NAMES are m1 + m2, mx2, my2, Izz2.
    let parameters = Vector4::new(30.0, 20.0 * 2.0, 0.0, 20.0 * 4.0);
    let rate = |q: Pair, dq: Pair| (dq, crane::forward_dynamics(&q, &dq, &Pair::zeros(), &parameters));
    let (mut q, mut dq) = (Pair::new(0.0, 0.5), Pair::zeros());
    println!("  t [s]   trolley [m]   rope [rad]   energy [J]");
    for step in 0..=3000 {
        if step % 500 == 0 {
            let kinetic = crane::kinetic_energy(&q, &dq, &parameters);
            let energy = kinetic + crane::potential_energy(&q, &parameters);
            println!("{:7.1} {:13.4} {:12.4} {:12.6}", f64::from(step) * 1e-3, q[0], q[1], energy);
        }
        // Runge and Kutta's fourth order, steps of 1 ms.
        let h = 1e-3;
        let (a, b) = rate(q, dq);
        let (c, d) = rate(q + a * (h / 2.0), dq + b * (h / 2.0));
        let (e, f) = rate(q + c * (h / 2.0), dq + d * (h / 2.0));
        let (g, i) = rate(q + e * h, dq + f * h);
        q += (a + (c + e) * 2.0 + g) * (h / 6.0);
        dq += (b + (d + f) * 2.0 + i) * (h / 6.0);
    }
}
