//! A torque model that drives the arm that it was fitted to.

use crate::bus::driver::lwa4p::LWA4P;
use crate::explanation::torque_model::{ModelFile, ModelOnArm};
use crate::procedure::follow::{Parts, Path as DrivenPath};
use dyngen::Arm;
use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Random poses at which gains are judged.
const POSES: usize = 300;

/// A model of the arm on the bus.
pub(crate) type ModelArm = ModelOnArm<6>;

/// Reads a model of the arm of a file, with its effects or without.
///
/// # Errors
/// As [`ModelOnArm::new`]; an arm of another number of joints.
pub(crate) fn read(arm: &Arm, file: &Path, effects: bool) -> Result<ModelArm, String> {
    let (has, needs) = (arm.dof(), LWA4P.joints.len());
    if has != needs {
        return Err(format!("the arm file has {has} joints, the arm on the bus {needs}"));
    }
    ModelOnArm::new(arm, &ModelFile::read(file).map_err(|e| e.to_string())?, effects)
}

/// What the model says of a path on an arm that has been working for `running` s.
///
/// # Errors
/// Where the path takes more torque than a joint has, in words.
pub(crate) fn parts(on: &ModelArm, path: &DrivenPath<6>, running: f64) -> Result<Parts<6>, String> {
    let planned = on.model.planned(&on.body, path.motion(), running);
    let vectors = |x: &[f64]| x.chunks_exact(6).map(SVector::from_column_slice).collect::<Vec<_>>();
    let parts = Parts {
        rigid: vectors(&planned.rigid),
        friction: vectors(&planned.friction),
        effects: vectors(&planned.effects),
    };
    let limits = SVector::from(LWA4P.joints.map(|joint| joint.torque));
    match parts.beyond(&limits) {
        None => Ok(parts),
        Some((sample, joint, torque)) => Err(format!(
            "the trajectory takes {torque:.1} N·m of joint {} at {:.3} s, {:.1} N·m can be",
            joint + 1,
            sample as f64 * path.motion().period,
            limits[joint]
        )),
    }
}

/// Poses within the joints' limits, always the same ones.
pub(crate) fn poses() -> Vec<SVector<f64, 6>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let limits = LWA4P.joints.map(|joint| joint.position);
    let pose = |_| SVector::from(limits.map(|[low, high]| rng.random_range(low..high)));
    (0..POSES).map(pose).collect()
}
