//! A torque model that drives the arm that it was fitted to.

use crate::procedure::follow::{OBSERVER, Parts, Path as DrivenPath};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use nalgebra::SVector;
use powerball_bus::driver::TorqueGuard;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_controller::correction::{Instant, Memory, Term, add_torques};
use powerball_controller::dynamics::{ArmModel, State};
use powerball_controller::friction::TanhFriction;
use powerball_controller::laws::ContactDetector;
use powerball_explanation::torque_model::{JointColour, LogChanges, ModelFile, ModelOnArm, rows_a_second};
use rand::{RngExt, SeedableRng};
use std::path::Path;

/// External torque is noise up to this many standard deviations.
const DEVIATIONS: f64 = 6.0;
/// Random poses at which gains are judged.
const POSES: usize = 300;

/// A model of the arm on the bus.
pub type ModelArm = ModelOnArm<6>;

/// Reads a model of the arm of a file, with its effects or without.
///
/// # Errors
/// Those of [`ModelOnArm::new`]; an arm of another number of joints.
pub fn read(arm: &Arm, file: &Path, effects: bool) -> Result<ModelArm, String> {
    let (has, needs) = (arm.dof(), LWA4P.joints.len());
    if has != needs {
        return Err(format!("the arm file has {has} joints, the arm on the bus {needs}"));
    }
    ModelOnArm::new(arm, &ModelFile::read(file).map_err(|e| e.to_string())?, effects)
}

/// The torques that the model predicts for a path on an arm that has been working for `running` s.
///
/// # Errors
/// If the path needs more torque than a joint has.
pub fn parts(on: &ModelArm, path: &DrivenPath<6>, running: f64) -> Result<Parts<6>, String> {
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
            "the trajectory needs {torque:.1} N·m of joint {} at {:.3} s, above its limit {:.1} N·m",
            joint + 1,
            sample as f64 * path.motion().period,
            limits[joint]
        )),
    }
}

/// The detector of contact, from the residual of the model while it holds.
///
/// # Errors
/// A model whose file does not have this residual.
pub fn contact_detector(on: &ModelArm) -> Result<ContactDetector<f64, 6>, String> {
    let colour = on.model.colour.as_ref().ok_or(
        "the model file has no spectrum of its residual (`colour`): take model.json of `powerball explain`",
    )?;
    let rate = rows_a_second(colour.rate);
    let of = |joint: &JointColour| {
        let [deviation, mean] = joint.low_passed(OBSERVER, rate);
        DEVIATIONS * deviation + mean
    };
    // A joint that is not known is never touched.
    let noise =
        SVector::from_fn(|j, _| colour.joints.get(j).and_then(Option::as_ref).map_or(f64::INFINITY, of));
    let gammas = on.model.gammas();
    let laws = std::array::from_fn(|j| TanhFriction::new(gammas.get(j).copied().unwrap_or_default()));
    Ok(ContactDetector::new(laws, noise))
}

/// The model for the driver's guard of current mode: rigid arm, friction, and effects that hold a position.
/// It stays in memory until the program ends.
pub fn torque_guard(on: &ModelArm) -> TorqueGuard<6> {
    let (arm, terms, changes) =
        (on.numeric.clone(), on.model.holding_terms(), on.model.additions.log_changes.clone());
    let gammas = on.model.gammas();
    let laws: [TanhFriction<f64>; 6] =
        std::array::from_fn(|j| TanhFriction::new(gammas.get(j).copied().unwrap_or_default()));
    let torque = move |q: &[f64; 6], dq: &[f64; 6], ddq: &[f64; 6]| -> [f64; 6] {
        let state = State { q: (*q).into(), dq: (*dq).into() };
        let friction = SVector::from_fn(|j, _| laws[j].torque(dq[j]));
        let mut torque = arm.mass_matrix(&state.q) * SVector::from(*ddq)
            + arm.coriolis_times_velocity(&state.q, &state.dq)
            + arm.gravity(&state.q)
            + friction;
        hold(&changes, &terms, &mut vec![Memory::default(); terms.len()], &state, &mut torque);
        torque.into()
    };
    TorqueGuard::new(Box::leak(Box::new(torque)))
}

/// Adds what a model's [terms of position](powerball_explanation::torque_model::TorqueModel::holding_terms)
/// hold against.
pub fn hold(
    changes: &LogChanges,
    terms: &[Term<f64>],
    memory: &mut [Memory<f64>],
    state: &State<f64, 6>,
    torque: &mut SVector<f64, 6>,
) {
    let place = SVector::<f64, 6>::from_fn(|j, _| state.q[j] - changes.offset(j));
    let now = Instant {
        q: place.as_slice(),
        dq: state.dq.as_slice(),
        ddq: &[],
        rigid: &[],
        friction: &[],
        temperature: &[],
        running: 0.0,
    };
    add_torques(terms, memory, &now, torque.as_mut_slice());
}

/// Poses within the joints' limits, always the same ones.
pub fn poses() -> Vec<SVector<f64, 6>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let limits = LWA4P.joints.map(|joint| joint.position);
    let pose = |_| SVector::from(limits.map(|[low, high]| rng.random_range(low..high)));
    (0..POSES).map(pose).collect()
}
