#!/usr/bin/env python3
"""Single precision of a calibrated arm's generated code, next to that of the same arm with right angles.

    cargo build --release -p dyngen
    python3 benches/single.py --dyngen target/release/dyngen --urdf calib_15200003067234149431.urdf --tip tool0

The URDF is imported as it is, and with axes within 0.01 rad of a right angle taken for that. Both are compiled; at 2000 random
states, positions within ±π, velocities within ±2, accelerations within ±5, the generated code runs in f32 and in f64 of the same
numbers. Printed are the largest difference and the largest value of torque (N·m), mass matrix (kg·m²) and pose (m).
"""

import argparse
import pathlib
import subprocess
import tempfile

MANIFEST = """[package]
name = "single"
version = "0.0.0"
edition = "2024"
[dependencies]
nalgebra = { version = "0.35", default-features = false, features = ["libm"] }
[workspace]
"""
PROGRAM = """#![allow(dead_code)]
mod calibrated;
mod right;
use nalgebra::SVector;

macro_rules! compared {
    ($arm:ident) => {{
        use $arm::*;
        let mut seed = 1u64;
        let mut random = |size: f64| {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            // The same state for both: what f32 rounds of it is not the code's.
            f64::from((size * ((seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0)) as f32)
        };
        let (mut error, mut largest) = ([0f64; 3], [0f64; 3]);
        for _ in 0..2000 {
            let mut draw = |size: f64| SVector::<f64, JOINTS>::from_fn(|_, _| random(size));
            let (q, v, a) = (draw(std::f64::consts::PI), draw(2.0), draw(5.0));
            let [p, w, b] = [q, v, a].map(|x| x.map(|x| x as f32));
            let (tau, mass, pose) = (inverse_dynamics(&q, &v, &a), mass_matrix(&q), forward_kinematics(&q));
            let (t, m, k) = (inverse_dynamics(&p, &w, &b), mass_matrix(&p), forward_kinematics(&p));
            let off = [
                (tau - t.map(f64::from)).amax(),
                (mass - m.map(f64::from)).amax(),
                (pose - k.map(f64::from)).amax(),
            ];
            let sizes = [tau.amax(), mass.amax(), pose.amax()];
            for i in 0..3 {
                (error[i], largest[i]) = (error[i].max(off[i]), largest[i].max(sizes[i]));
            }
        }
        let text = |i: usize| format!("{:.1e} of {:.2}", error[i], largest[i]);
        println!("{}: torque {}, mass matrix {}, pose {}", stringify!($arm), text(0), text(1), text(2));
    }};
}

fn main() {
    compared!(calibrated);
    compared!(right);
}
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dyngen", required=True, type=pathlib.Path, help="the program")
    parser.add_argument("--urdf", required=True, type=pathlib.Path, help="a calibrated arm")
    parser.add_argument("--tip", required=True, help="its last link")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        source = folder / "src"
        source.mkdir()
        (folder / "Cargo.toml").write_text(MANIFEST)
        (source / "main.rs").write_text(PROGRAM)
        dyngen = lambda *command: subprocess.run([options.dyngen.resolve(), *command], check=True, capture_output=True)
        for name, more in [("calibrated", []), ("right", ["--angle-tolerance", "0.01"])]:
            arm = folder / f"{name}.toml"
            dyngen("import", options.urdf, "--tip", options.tip, *more, "-o", arm)
            dyngen("generate", arm, "--values", arm.with_suffix(".values.json"), "-o", source / f"{name}.rs")
        subprocess.run(["cargo", "run", "--release", "--quiet"], check=True, cwd=folder)


if __name__ == "__main__":
    main()
