//! τ of the UR5e and the Panda by files with and without `--contract`, single calls and blocks of eight, in
//! both precisions, compiled for AVX2 and for AVX-512, in one run.
//!
//! `cargo bench -p powerball-benches --bench contract -- --write docs/dyngen.md` writes its table into the
//! page.

#![allow(clippy::unwrap_used, missing_docs, unreachable_pub)]

mod support;

use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use std::fmt::Write;
use std::hint::black_box;

macro_rules! arm {
    ($name:ident) => {
        mod $name {
            include!(concat!(env!("OUT_DIR"), "/", stringify!($name), ".rs"));
        }
    };
}
arm!(ur5e_plain);
arm!(ur5e_contracted);
arm!(panda_plain);
arm!(panda_contracted);

const STATES: usize = 1024;
const ROUNDS: usize = 2000;

/// Where a line of the cache begins, as the module `batch` asks for.
#[repr(align(64))]
struct Aligned<T>(T);

/// A row of one arm, scalar and kind of vectors; `$vectors` runs a closure compiled for them.
macro_rules! row {
    ($table:ident, $name:literal, $plain:ident, $contracted:ident, $scalar:ty, $joints:literal, $of:literal, $vectors:ident) => {{
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(5);
        let mut draw = || SVector::<$scalar, $joints>::from_fn(|_, _| rng.random_range(-3.0..3.0));
        let motion: Vec<[_; 3]> = (0..STATES).map(|_| std::array::from_fn(|_| draw())).collect();
        let blocks: Vec<Aligned<[[[$scalar; 8]; $joints]; 3]>> = (motion.as_chunks::<8>().0.iter())
            .map(|b| {
                Aligned(std::array::from_fn(|k| std::array::from_fn(|i| std::array::from_fn(|l| b[l][k][i]))))
            })
            .collect();
        let parameters = SVector::<$scalar, { $plain::PARAMETERS }>::repeat(0.5);
        macro_rules! single {
            ($arm:ident) => {{
                let prepared = $arm::prepare(&parameters);
                let (motion, vectors) = (&motion, $vectors);
                move || {
                    vectors.vectorize(
                        #[inline(always)]
                        || {
                            for [q, dq, ddq] in motion {
                                let trig = $arm::Trig::new(q);
                                black_box($arm::inverse_dynamics_with(&trig, dq, ddq, &prepared));
                            }
                        },
                    )
                }
            }};
        }
        macro_rules! block {
            ($arm:ident) => {{
                let prepared = $arm::prepare(&parameters);
                let (blocks, vectors) = (&blocks, $vectors);
                move || {
                    vectors.vectorize(
                        #[inline(always)]
                        || {
                            let mut torque = Aligned([[0.0; 8]; $joints]);
                            for Aligned([q, dq, ddq]) in blocks {
                                $arm::batch::inverse_dynamics(q, dq, ddq, &prepared, &mut torque.0);
                                black_box(&mut torque.0);
                            }
                        },
                    )
                }
            }};
        }
        let best = support::paired(
            ROUNDS,
            [&mut single!($plain), &mut single!($contracted), &mut block!($plain), &mut block!($contracted)],
        );
        let [one, fused, all, all_fused] = best.map(|time| time.as_secs_f64() * 1e9 / STATES as f64);
        let _ = writeln!(
            $table,
            "| {} | {} | {} | {one:.1} | {fused:.1} | {:.2} × | {all:.2} | {all_fused:.2} | {:.2} × |",
            $name,
            stringify!($scalar),
            $of,
            one / fused,
            all / all_fused
        );
    }};
}

fn main() {
    let mut table = "| τ | scalar | vectors | single, ns | contracted, ns | gain | in blocks of 8, ns | \
                     contracted, ns | gain |\n|---|---|---|---|---|---|---|---|---|\n"
        .to_string();
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(v3) = pulp::x86::V3::try_new() {
            row!(table, "UR5e", ur5e_plain, ur5e_contracted, f64, 6, "AVX2", v3);
            row!(table, "UR5e", ur5e_plain, ur5e_contracted, f32, 6, "AVX2", v3);
            row!(table, "Panda", panda_plain, panda_contracted, f64, 7, "AVX2", v3);
            row!(table, "Panda", panda_plain, panda_contracted, f32, 7, "AVX2", v3);
        }
        if let Some(v4) = pulp::x86::V4::try_new() {
            row!(table, "UR5e", ur5e_plain, ur5e_contracted, f64, 6, "AVX-512", v4);
            row!(table, "UR5e", ur5e_plain, ur5e_contracted, f32, 6, "AVX-512", v4);
            row!(table, "Panda", panda_plain, panda_contracted, f64, 7, "AVX-512", v4);
            row!(table, "Panda", panda_plain, panda_contracted, f32, 7, "AVX-512", v4);
        }
    }
    support::publish("contraction", &table);
}
