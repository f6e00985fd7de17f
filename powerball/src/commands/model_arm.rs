//! A torque model that drives the arm that it was fitted to.

use crate::bus::driver::lwa4p::LWA4P;
use crate::explanation::torque_model::{ModelFile, TorqueModel};
use crate::identification::mounting::Mounting;
use crate::identification::{KnownModel, NumericArm};
use crate::logs::regression::RigidArm;
use crate::procedure::follow::{Parts, Path as DrivenPath};
use dyngen::Arm;
use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Random poses at which gains are judged.
const POSES: usize = 300;

/// A model that fits its arm.
#[derive(Debug)]
pub(crate) struct ModelArm {
    pub(crate) body: RigidArm,
    pub(crate) model: TorqueModel,
    pub(crate) numeric: NumericArm<6>,
}

impl ModelArm {
    /// Reads a model of the arm of a file, with its effects or without.
    pub(crate) fn read(arm: &Arm, file: &Path, effects: bool) -> Result<ModelArm, String> {
        let read = ModelFile::read(file).map_err(|e| e.to_string())?;
        let (named, name) = (read.model.arm.clone(), file.display());
        if !named.is_empty() && named != arm.name {
            return Err(format!(
                "{name}: is a model of the arm '{named}', and the arm file is of '{}': take the arm file that it was \
                    identified with",
                arm.name
            ));
        }
        if arm.dof() != LWA4P.joints.len() {
            let (has, needs) = (arm.dof(), LWA4P.joints.len());
            return Err(format!("the arm file has {has} joints, the arm on the bus {needs}"));
        }
        if !arm.transmissions.is_empty() {
            let what = "the arm file couples joints by a transmission, which control laws here do not know";
            return Err(what.to_string());
        }
        let arm = read.arm(arm, Mounting::Filed)?;
        let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
        let model = read.checked(&body).map_err(|e| e.to_string())?;
        let model = if effects { model } else { model.base() };
        let numeric = model.numeric_arm(&body).map_err(|e| e.to_string())?;
        let numeric = numeric.ok_or_else(|| format!("{name}: does not fit the arm file"))?;
        Ok(ModelArm { body, model, numeric })
    }

    /// What the model says of a path on an arm that has been working for `running` s.
    ///
    /// # Errors
    /// Where the path takes more torque than a joint has, in words.
    pub(crate) fn parts(&self, path: &DrivenPath<6>, running: f64) -> Result<Parts<6>, String> {
        let planned = self.model.planned(&self.body, path.motion(), running);
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
    pub(crate) fn poses(&self) -> Vec<SVector<f64, 6>> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let limits = LWA4P.joints.map(|joint| joint.position);
        let pose = |_| SVector::from(limits.map(|[low, high]| rng.random_range(low..high)));
        (0..POSES).map(pose).collect()
    }
}
