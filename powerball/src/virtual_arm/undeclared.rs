//! The virtual arm with what no model is told of it, as a file: so that the arm of a session can be met
//! again.

use super::slave::Setup;
use super::{PlantEffect, VirtualArm, lwa4p};
use dyngen::Diagnostics;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A virtual LWA 4P by its undeclared effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Undeclared {
    /// What is in the plant and in no model.
    pub effect: PlantEffect,
    /// Its age, s: what warms has been warming for so long.
    pub age: f64,
}

impl Undeclared {
    /// The file's name in the folder of a session.
    pub const FILE: &'static str = "virtual_arm.json";

    /// Reads it.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn read(path: &Path) -> Result<Undeclared, String> {
        let text =
            std::fs::read_to_string(path).map_err(|e| format!("{}: cannot be read: {e}", path.display()))?;
        serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// The arm with closed brakes at `start`, rad; `seed` draws the sensors' noise, and where `commutated`
    /// the motors know their commutation already.
    ///
    /// # Errors
    /// None for the arm file that is built in.
    pub fn arm(&self, start: [f64; 6], seed: u64, commutated: bool) -> Result<VirtualArm, Diagnostics> {
        let mut setup = lwa4p::setup(start, seed)?;
        setup.modules.iter_mut().for_each(|module| module.commutated = commutated);
        let plant = setup.plant.clone().with(self.effect.clone());
        VirtualArm::new(Setup { plant, age: self.age, ..setup })
            .ok_or_else(|| Diagnostics::whole_file("lwa4p.toml", "six joints are needed"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_effect_survives_its_file() {
        let plant = lwa4p::plant().unwrap();
        for (seed, name) in PlantEffect::NAMES.into_iter().enumerate() {
            let mut rng = ChaCha8Rng::seed_from_u64(seed as u64);
            let effect = lwa4p::draw_effect(name, &plant, 100.0, 1.0..2.0, &mut rng).unwrap();
            let undeclared = Undeclared { effect, age: 100.0 };
            let text = serde_json::to_string(&undeclared).unwrap();
            assert!(text.contains(name), "{text}");
            // Numbers are read to the last digit but one.
            let read: Undeclared = serde_json::from_str(&text).unwrap();
            assert_eq!(read.effect.describe(), undeclared.effect.describe());
            assert_eq!((read.effect.joints(), read.age), (undeclared.effect.joints(), undeclared.age));
        }
        let wrong = serde_json::from_str::<Undeclared>("{\"effect\": {\"magic\": {}}, \"age\": 0}");
        assert!(wrong.unwrap_err().to_string().contains("magic"));
    }
}
