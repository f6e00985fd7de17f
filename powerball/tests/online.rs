//! An estimate that follows the samples, on the virtual arm.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::arm::ParameterKind;
use dyngen::{Model, SetKind};
use nalgebra::SVector;
use powerball::controller::online::SquareRoot;
use powerball::identification::excite::{ExcitationSettings, optimise};
use powerball::logs::regression::RigidArm;
use powerball::virtual_arm::lwa4p;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// A thing is put into the hand of an arm whose model is known: its mass is there within 5 % after 2 s of
/// motion.
#[test]
fn a_payload_is_weighed_in_two_seconds() {
    let arm = lwa4p::arm().unwrap();
    let body = RigidArm::new(&arm).unwrap();
    let model = Model::derive(arm.clone()).unwrap();
    let settings = ExcitationSettings { evaluations: 50, ..ExcitationSettings::default() };
    let motion = optimise(&model, SetKind::Minimal, &settings).unwrap().paths[0].sample(200.0);
    let known: Vec<f64> = lwa4p::links().iter().flat_map(|link| link.parameters()).collect();
    let chosen: Vec<usize> = [ParameterKind::M, ParameterKind::Mx, ParameterKind::My, ParameterKind::Mz]
        .into_iter()
        .map(|kind| body.last_link(kind))
        .collect();
    let all: Vec<usize> = (0..known.len()).collect();
    // 1.5 kg, 8 cm before the flange and a little aside, as small as a ball.
    let (mass, at) = (1.5, [0.02, -0.01, 0.165]);
    let mut loaded = known.clone();
    let [x, y, z] = at;
    let tensor = [y * y + z * z, x * y, x * z, x * x + z * z, y * z, x * x + y * y];
    let last = &mut loaded[11 * 5..];
    last[0] += mass;
    (0..3).for_each(|k| last[1 + k] += mass * at[k]);
    (0..6).for_each(|k| last[4 + k] += mass * tensor[k]);
    let noise = [0.25, 0.25, 0.22, 0.18, 0.035, 0.030];
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut online = SquareRoot::<f64, 4>::new(1e-3);
    // From the second half of the first second on: at the start the arm is nearly at rest.
    for [q, dq, ddq] in motion.samples().skip(100).take(400) {
        let columns = body.parameter_columns(&all, q, dq, ddq).unwrap();
        let few = body.parameter_columns(&chosen, q, dq, ddq).unwrap();
        for j in 0..6 {
            let row = &columns[j * all.len()..][..all.len()];
            let extra: f64 = row.iter().zip(loaded.iter().zip(&known)).map(|(y, (a, b))| y * (a - b)).sum();
            let e: f64 = StandardNormal.sample(&mut rng);
            let row = SVector::<f64, 4>::from_column_slice(&few[4 * j..][..4]);
            online.update(&row, extra + noise[j] * e, noise[j].powi(-2));
        }
    }
    let found = online.estimate().unwrap();
    assert!((found[0] - mass).abs() < 0.05 * mass, "{found}");
}
