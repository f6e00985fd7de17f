//! The demo's plant moved along a new path with the base model and with the explained one.

use super::{DemoError, Session, SessionError};
use crate::commands::model_arm::{self, ModelArm};
use crate::procedure::Envelope;
use crate::procedure::follow::{Followed, Law, Parts, Path as DrivenPath, Run, Track};
use dyngen::arm::Parameter;
use dyngen::{Arm, Diagnostics, Model, SetKind};
use powerball_bus::driver::Driver;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{Master, Memory};
use powerball_controller::laws::ComputedTorque;
use powerball_explanation::torque_model::{Additions, TorqueModel};
use powerball_identification::Identified;
use powerball_identification::estimate::{JointFriction, ParameterEstimate};
use powerball_identification::excite::{self, ExcitationSettings};
use powerball_virtual_arm::{VirtualArm, lwa4p};
use std::f64::consts::TAU;
use std::path::Path;

/// The path's period, s: none of the recorded ones.
const PERIOD: f64 = 8.5;
/// Condition numbers count for nothing here: the best of a few paths will do.
const EVALUATIONS: usize = 50;
/// Paths go up to the joints' limits, and an arm that is off its path passes them: this share of the
/// velocities leaves a margin.
const PACE: f64 = 0.8;
/// A path may take more torque of a joint than it has, by one of the models; this many are tried.
const PATHS: u64 = 8;

/// An arm that was moved with two models.
#[derive(Debug)]
pub struct Driven {
    /// Tracking errors and torques, `base` and `explained`.
    pub followed: Followed,
    /// The runs as tracks, in the order in which they were driven.
    pub tracks: Vec<(&'static str, Track<6>)>,
    /// The path.
    pub path: DrivenPath<6>,
}

/// The base model as a controller takes it: the parameters that a real arm can have. Where the logs have an
/// effect that the model lacks, the best fit itself need not be an arm's.
///
/// # Errors
/// Where the arm file cannot be derived.
pub(super) fn base_model(arm: &Arm, identified: &Identified) -> Result<TorqueModel, DemoError> {
    let model = Model::derive(arm.clone()).map_err(excite::Error::Model).map_err(SessionError::Excitation)?;
    let set = model.set(SetKind::Minimal).map_err(excite::Error::Model).map_err(SessionError::Excitation)?;
    let value =
        |p: Parameter| identified.consistent.parameters.get(&p.to_string()).copied().unwrap_or_default();
    let all: Vec<f64> = arm.all_parameters().into_iter().map(value).collect();
    let values = model.set_values(set, &all);
    let friction = identified.consistent.friction.iter().enumerate();
    Ok(TorqueModel {
        arm: arm.name.clone(),
        set: SetKind::Minimal.to_string(),
        parameters: set
            .names()
            .iter()
            .zip(values)
            .map(|(name, x)| ParameterEstimate::plain(name, x))
            .collect(),
        friction: friction.map(|(j, gammas)| JointFriction::plain(j, *gammas)).collect(),
        joint_bands: Vec::new(),
        additions: Additions::default(),
        colour: None,
    })
}

/// Moves the arm of a session, in current mode with computed torque, along a path that no model has seen:
/// with the model of `base` and with that of `explained`, both files of models. The path is written into
/// `folder`.
///
/// # Errors
/// Where a model does not fit the arm, no path is within the joints' torques, or the arm stopped.
pub(super) fn drive(
    session: &Session,
    folder: &Path,
    [base, explained]: [&Path; 2],
    seed: u64,
) -> Result<Driven, DemoError> {
    let arm = Arm::read(&session.arm_file).map_err(|e| DemoError::Read(e.to_string()))?;
    let [base, explained] = [base, explained].map(|file| model_arm::read(&arm, file, true));
    let (base, explained) = (base.map_err(DemoError::Drive)?, explained.map_err(DemoError::Drive)?);
    let (path, path_csv, parts_of_both) = path(&[&base, &explained], session, seed)?;
    super::write(&folder.join("path.csv"), &path_csv)?;
    let law = Law::Torque(ComputedTorque::for_period(LWA4P.period_seconds()));
    for (name, model) in [("base", &base), ("explained", &explained)] {
        let stable = law.judge(&model.numeric, model_arm::poses(), LWA4P.period_seconds());
        stable.map_err(|why| DemoError::Drive(format!("by the {name} model {why}")))?;
    }
    let guard = model_arm::torque_guard(&explained);
    // The two runs are independent.
    let models = [("base", &base, &parts_of_both[0]), ("explained", &explained, &parts_of_both[1])];
    let tracks = powerball_logs::parallel::map(&models, |&(name, model, parts)| {
        let setup = session.undeclared.setup(path.start().into(), seed).map_err(SessionError::Arm)?;
        let plant = VirtualArm::new(lwa4p::with_current_mode(setup)).ok_or_else(|| {
            SessionError::Arm(Diagnostics::whole_file("lwa4p.toml", "six joints are needed"))
        })?;
        let driver = Driver::new(LWA4P).map_err(SessionError::Driver)?;
        let run = Run {
            path: &path,
            arm: &model.numeric,
            parts: Some(parts),
            best: &parts_of_both[1],
            give: 0.0,
            guard: Some(guard),
            law,
            contact: None,
            accept_unverified: true,
        };
        let on_bus = Master::new(driver, Memory::new(plant, LWA4P.bitrate));
        let (_, track, _) = run
            .follow(on_bus, Envelope::new(|_| None), None, |_, _| ())
            .map_err(|e| DemoError::Drive(format!("with the {name} model {e}")))?;
        Ok((name, track))
    });
    let tracks = tracks.into_iter().collect::<Result<Vec<_>, DemoError>>()?;
    let followed = Followed::of(&arm.name, &law, &path, &tracks);
    Ok(Driven { followed, tracks, path })
}

/// The first of the paths drawn that both models find within the joints' torques, and what they predict for
/// it.
fn path(
    models: &[&ModelArm; 2],
    session: &Session,
    seed: u64,
) -> Result<(DrivenPath<6>, String, Vec<Parts<6>>), DemoError> {
    let model = Model::derive(lwa4p::arm().map_err(SessionError::Arm)?).map_err(excite::Error::Model);
    let model = model.map_err(SessionError::Excitation)?;
    let mut why = String::new();
    for k in 0..PATHS {
        let settings = ExcitationSettings {
            harmonics: 5,
            fundamental: TAU / PERIOD,
            evaluations: EVALUATIONS,
            // Away from the seeds of the paths that were recorded.
            seed: (1 << 32) + seed.wrapping_mul(PATHS).wrapping_add(k),
            ..ExcitationSettings::default()
        };
        let found =
            excite::optimise(&model, SetKind::Minimal, &settings).map_err(SessionError::Excitation)?;
        let rate = session.plant.sensors().rate;
        let Some(motion) = found.paths.first().map(|path| path.sample(rate / PACE).slower(PACE)) else {
            continue;
        };
        let path =
            DrivenPath::clear(&motion, &Envelope::new(|_| None), &LWA4P).map_err(SessionError::Record)?;
        let parts: Result<Vec<_>, _> =
            models.iter().map(|model| model_arm::parts(model, &path, session.undeclared.age)).collect();
        match parts {
            Ok(parts) => return Ok((path, motion.to_csv(), parts)),
            Err(what) => why = what,
        }
    }
    Err(DemoError::Drive(format!("none of {PATHS} paths is within the joints' torques: {why}")))
}
