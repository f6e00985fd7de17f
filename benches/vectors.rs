//! Single calls and blocks of samples of the emitted functions of the LWA 4P without rotors, in both
//! precisions, compiled for the vectors of several kinds of processor, in one run.
//!
//! `cargo bench -p powerball-benches --bench vectors -- --write docs/results/performance.md` writes its table
//! into the page.

#![allow(clippy::unwrap_used, missing_docs)]

mod support;

use chacha20::ChaCha8Rng;
use nalgebra::SVector;
use powerball_workspace::generated::lwa4p_rotorless_minimal as arm;
use rand::{RngExt, SeedableRng};
use std::fmt::Write;
use std::hint::black_box;

const STATES: usize = 1024;
const ROUNDS: usize = 300;

/// Where a line of the cache begins, as the module `batch` asks for.
#[repr(align(64))]
struct Aligned<T>(T);

/// What is computed of a motion.
#[derive(Clone, Copy, PartialEq)]
enum What {
    Torque,
    Regressor,
}

/// Single calls and blocks of eight for a scalar; the blocks' results stay in the cache, as for one who sums
/// them up.
macro_rules! kernels {
    ($single:ident, $blocks:ident, $scalar:ty) => {
        struct $single<'a> {
            what: What,
            motion: &'a [[SVector<$scalar, 6>; 3]],
            parameters: &'a arm::Prepared<$scalar>,
        }

        impl $single<'_> {
            #[inline(always)]
            fn run(self) {
                for [q, dq, ddq] in self.motion {
                    if self.what == What::Torque {
                        let trig = arm::Trig::new(q);
                        black_box(arm::inverse_dynamics_with(&trig, dq, ddq, self.parameters));
                    } else {
                        black_box(arm::regressor(q, dq, ddq));
                    }
                }
            }
        }

        struct $blocks<'a> {
            what: What,
            motion: &'a [[[[$scalar; 8]; 6]; 3]],
            parameters: &'a arm::Prepared<$scalar>,
        }

        impl $blocks<'_> {
            #[inline(always)]
            fn run(self) {
                let mut torque = Aligned([[0.0; 8]; 6]);
                let mut regressor = Aligned([[[0.0; 8]; 6]; arm::PARAMETERS]);
                for [q, dq, ddq] in self.motion {
                    if self.what == What::Torque {
                        arm::batch::inverse_dynamics(q, dq, ddq, self.parameters, &mut torque.0);
                        black_box(&mut torque.0);
                    } else {
                        arm::batch::regressor(q, dq, ddq, &mut regressor.0);
                        black_box(&mut regressor.0);
                    }
                }
            }
        }
    };
}

kernels!(SingleF64, BlocksF64, f64);
kernels!(SingleF32, BlocksF32, f32);

/// Rows of one precision: for each width single calls and blocks.
macro_rules! rows {
    ($table:ident, $single:ident, $blocks:ident, $scalar:ty) => {{
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut draw = || SVector::<$scalar, 6>::from_fn(|_, _| rng.random_range(-3.0..3.0));
        let motion: Vec<[SVector<$scalar, 6>; 3]> =
            (0..STATES).map(|_| std::array::from_fn(|_| draw())).collect();
        let blocks: Vec<[[[$scalar; 8]; 6]; 3]> = (motion.as_chunks::<8>().0.iter())
            .map(|b| std::array::from_fn(|k| std::array::from_fn(|i| std::array::from_fn(|l| b[l][k][i]))))
            .collect();
        let parameters = &arm::prepare(&SVector::<$scalar, { arm::PARAMETERS }>::repeat(0.5));
        let (motion, blocks) = (&motion[..], &blocks[..]);
        for (what, name) in [(What::Torque, "**τ**"), (What::Regressor, "**Y**, 6 × 19")] {
            let mut row =
                |width: &str, run: &mut dyn FnMut($single<'_>), all: &mut dyn FnMut($blocks<'_>)| {
                    let best = support::paired(
                        ROUNDS,
                        [&mut || run($single { what, motion, parameters }), &mut || {
                            all($blocks { what, motion: blocks, parameters })
                        }],
                    );
                    let [one, block] = best.map(|time| time.as_secs_f64() * 1e9 / STATES as f64);
                    let _ = writeln!(
                        $table,
                        "| {name} | {} | {width} | {one:.1} | {block:.1} | {:.1} × | {:.0} |",
                        stringify!($scalar),
                        one / block,
                        1e3 / block
                    );
                };
            row("any", &mut |k| k.run(), &mut |k| k.run());
            #[cfg(target_arch = "x86_64")]
            {
                if let Some(v3) = pulp::x86::V3::try_new() {
                    row(
                        "AVX2",
                        &mut |k| {
                            v3.vectorize(
                                #[inline(always)]
                                || k.run(),
                            )
                        },
                        &mut |k| {
                            v3.vectorize(
                                #[inline(always)]
                                || k.run(),
                            )
                        },
                    );
                }
                if let Some(v4) = pulp::x86::V4::try_new() {
                    row(
                        "AVX-512",
                        &mut |k| {
                            v4.vectorize(
                                #[inline(always)]
                                || k.run(),
                            )
                        },
                        &mut |k| {
                            v4.vectorize(
                                #[inline(always)]
                                || k.run(),
                            )
                        },
                    );
                }
            }
        }
    }};
}

fn main() {
    let mut table = "| a sample | scalar | vectors | one at a time, ns | blocks of 8, ns | throughput | \
        millions a second |\n\
                     |---|---|---|---|---|---|---|\n"
        .to_string();
    rows!(table, SingleF64, BlocksF64, f64);
    rows!(table, SingleF32, BlocksF32, f32);
    support::publish("batches", &table);
}
