//! One emission for every scalar: f32, several samples at once. `benches/tests/` has dual numbers.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use nalgebra::{SMatrix, SVector, SimdValue};
use powerball::logs::batch::{self, Work};
use powerball_workspace::generated::{panda_minimal, stanford_minimal};
use rand::{RngExt, SeedableRng};
use simba::simd::AutoF64x4;

fn random<const N: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, N> {
    SVector::from_fn(|_, _| rng.random_range(-1.5..1.5))
}

/// Four samples at once are four samples, to the bit: the lanes run the same operations.
#[test]
fn lanes_are_the_samples() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let samples: [[SVector<f64, 7>; 3]; 4] =
        std::array::from_fn(|_| std::array::from_fn(|_| random(&mut rng)));
    let parameters: SVector<f64, { panda_minimal::PARAMETERS }> = random(&mut rng);
    let lanes = |k: usize| SVector::<AutoF64x4, 7>::from_fn(|i, _| AutoF64x4::from(samples.map(|s| s[k][i])));
    let (q, dq, ddq) = (lanes(0), lanes(1), lanes(2));
    let torques = panda_minimal::inverse_dynamics(&q, &dq, &ddq, &parameters.map(AutoF64x4::splat));
    let regressor = panda_minimal::regressor(&q, &dq, &ddq);
    for (lane, [q, dq, ddq]) in samples.iter().enumerate() {
        assert_eq!(
            torques.map(|x| x.extract(lane)),
            panda_minimal::inverse_dynamics(q, dq, ddq, &parameters)
        );
        assert_eq!(regressor.map(|x| x.extract(lane)), panda_minimal::regressor(q, dq, ddq));
    }
}

/// A block of samples is its samples, to the bit, whatever vectors the processor has: an arm with a prismatic
/// joint, with an angle beyond what is reduced without a branch in one lane, a vector, a matrix and a number
/// as results.
#[test]
fn blocks_are_the_samples() {
    const LANES: usize = 8;
    type Block = [[f64; LANES]; 6];
    struct Everything<'a> {
        motion: &'a [Block; 3],
        parameters: &'a SVector<f64, { stanford_minimal::PARAMETERS }>,
    }
    impl Work for Everything<'_> {
        type Output = (Block, [Block; stanford_minimal::PARAMETERS], [f64; LANES]);
        #[inline(always)]
        fn run(self) -> Self::Output {
            let [q, dq, ddq] = self.motion;
            let (mut torque, mut regressor, mut energy) =
                ([[0.0; LANES]; 6], [[[0.0; LANES]; 6]; stanford_minimal::PARAMETERS], [0.0; LANES]);
            stanford_minimal::batch::inverse_dynamics(q, dq, ddq, self.parameters, &mut torque);
            stanford_minimal::batch::regressor(q, dq, ddq, &mut regressor);
            stanford_minimal::batch::kinetic_energy(q, dq, self.parameters, &mut energy);
            (torque, regressor, energy)
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let parameters: SVector<f64, { stanford_minimal::PARAMETERS }> = random(&mut rng);
    for far in [0.0, 1e4, 1e7] {
        let mut samples: [[SVector<f64, 6>; 3]; LANES] =
            std::array::from_fn(|_| std::array::from_fn(|_| random(&mut rng)));
        samples[3][0][4] += far;
        let block = |k: usize| -> Block { std::array::from_fn(|i| samples.map(|sample| sample[k][i])) };
        let motion = [block(0), block(1), block(2)];
        let work = || Everything { motion: &motion, parameters: &parameters };
        for (torque, regressor, energy) in [batch::run(work()), work().run()] {
            for (lane, [q, dq, ddq]) in samples.iter().enumerate() {
                let expected = stanford_minimal::inverse_dynamics(q, dq, ddq, &parameters);
                assert_eq!(torque.map(|x| x[lane]), <[f64; 6]>::from(expected));
                let expected = stanford_minimal::regressor(q, dq, ddq);
                let found = SMatrix::<f64, 6, { stanford_minimal::PARAMETERS }>::from_fn(|i, j| {
                    regressor[j][i][lane]
                });
                assert_eq!(expected, found);
                assert_eq!(energy[lane], stanford_minimal::kinetic_energy(q, dq, &parameters));
            }
        }
    }
}

/// Single precision differs from double by its rounding alone.
#[test]
fn single_precision_is_close() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..100 {
        let (q, dq, ddq): (SVector<f64, 7>, _, _) = (random(&mut rng), random(&mut rng), random(&mut rng));
        let parameters: SVector<f64, { panda_minimal::PARAMETERS }> = random(&mut rng);
        let single = |v: &SVector<f64, 7>| v.map(|x| x as f32);
        let torques = panda_minimal::inverse_dynamics(&q, &dq, &ddq, &parameters);
        let close = panda_minimal::inverse_dynamics(
            &single(&q),
            &single(&dq),
            &single(&ddq),
            &parameters.map(|x| x as f32),
        );
        let error = (torques - close.map(f64::from)).abs().max();
        // Some hundred operations, each rounded to 2⁻²⁴ of its result.
        assert!(error < 200.0 * 2f64.powi(-24) * torques.abs().max().max(1.0), "{error}");
        assert!(error > 0.0);
    }
}
