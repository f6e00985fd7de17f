//! Generated code over the dual numbers of the crate num-dual.

use chacha20::ChaCha8Rng;
use nalgebra::SVector;
use num_dual::Dual64;
use powerball_workspace::generated::stanford_minimal;
use rand::{RngExt, SeedableRng};

fn random<const N: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, N> {
    SVector::from_fn(|_, _| rng.random_range(-1.5..1.5))
}

/// Derivatives by dual numbers are the emitted derivatives.
#[test]
fn dual_numbers_carry_the_derivatives() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (q, dq, ddq): (SVector<f64, 6>, _, _) = (random(&mut rng), random(&mut rng), random(&mut rng));
    let parameters: SVector<f64, { stanford_minimal::PARAMETERS }> = random(&mut rng);
    let constant = |v: &SVector<f64, 6>| v.map(Dual64::from_re);
    let by_position = stanford_minimal::torque_by_position(&q, &dq, &ddq, &parameters);
    let by_velocity = stanford_minimal::torque_by_velocity(&q, &dq, &ddq, &parameters);
    for j in 0..6 {
        let seeded = |v: &SVector<f64, 6>| {
            let mut v = constant(v);
            v[j] = v[j].derivative();
            v
        };
        let torque = |q: &_, dq: &_| {
            stanford_minimal::inverse_dynamics(q, dq, &constant(&ddq), &parameters.map(Dual64::from_re))
        };
        let (a, b) = (torque(&seeded(&q), &constant(&dq)), torque(&constant(&q), &seeded(&dq)));
        for i in 0..6 {
            assert!((a[i].eps - by_position[(i, j)]).abs() < 1e-11, "{i} {j}");
            assert!((b[i].eps - by_velocity[(i, j)]).abs() < 1e-11, "{i} {j}");
        }
    }
}
