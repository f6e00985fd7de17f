//! Checks of the commands that move the arm, before it moves.

use super::Failure;
use super::excite::{FloorAt, floor};
use crate::procedure::Envelope;
use crate::procedure::built_in_masses;
use clap::Args;
use dyngen::Arm;
use powerball_identification::excite::Masses;
use powerball_identification::mounting::Mounting;
use powerball_virtual_arm::lwa4p;
use std::path::{Path, PathBuf};

/// The shoulder, which is the base frame's origin, stands 205 mm above what the arm is mounted on.
const FLOOR: f64 = -0.2;

/// The surroundings with which motions are checked before the arm moves.
#[derive(Args, Clone, Debug)]
pub(crate) struct Surroundings {
    /// The arm file: its geometry and limits, for the floor, the links and the torques; the built-in hardware
    /// arm where this is left out.
    #[arg(long, value_name = "ARM.toml")]
    pub(crate) arm: Option<PathBuf>,
    /// Height of the floor above the base frame's origin along the vertical, m, or `none`. Where this is left
    /// out it is -0.2 under the upright built-in arm, and as for `powerball excite` under others.
    #[arg(long, value_name = "Z", value_parser = floor, allow_hyphen_values = true)]
    floor: Option<FloorAt>,
    /// The arm's masses for the torques: an identified.json, or a values file `{"parameter": number, …}`.
    /// Where this is left out they are the CAD model's of the built-in arm, and guessed from the capsules for
    /// another arm file.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
}

impl Surroundings {
    /// Takes the masses of a model where none were given.
    pub(crate) fn values_or(&mut self, model: &Path) {
        self.values.get_or_insert_with(|| model.to_path_buf());
    }

    /// The arm file.
    pub(crate) fn arm(&self) -> Result<Arm, Failure> {
        let arm = match &self.arm {
            Some(path) => Arm::read(path),
            None => lwa4p::arm(),
        };
        arm.map_err(|e| Failure::Unusable(e.to_string()))
    }

    /// Everything that motions must keep with the base in a mounting.
    pub(crate) fn envelope(&self, arm: &Arm, mounting: &Mounting) -> Result<Envelope<6>, Failure> {
        let unusable = |e: String| Failure::Unusable(e);
        let masses = match (&self.values, &self.arm) {
            (Some(path), _) => Some(Masses::read(path, arm).map_err(|e| unusable(e.to_string()))?),
            (None, None) => Some(built_in_masses()),
            (None, Some(_)) => None,
        };
        let upright = self.arm.is_none() && mounting.up(arm).z > 0.5;
        let floor = self.floor.or(upright.then_some(FloorAt(Some(FLOOR))));
        Envelope::of(arm, mounting, floor, masses.as_ref()).map_err(|e| unusable(e.to_string()))
    }
}
