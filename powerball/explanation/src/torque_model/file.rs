//! The model as JSON.

use super::{NamedTerm, TorqueModel};
use powerball_controller::correction::{Law, Term};
use powerball_identification::servo::no_torques;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Why a file is not a model of an arm.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct FileError(String);

/// A term in the file: joints from 1.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct TermEntry {
    effect: String,
    joint: usize,
    coefficient: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    std: Option<f64>,
    #[serde(flatten, with = "LawEntry")]
    law: Law<f64>,
}

impl From<TermEntry> for NamedTerm {
    fn from(e: TermEntry) -> NamedTerm {
        let term = Term { joint: e.joint.saturating_sub(1), coefficient: e.coefficient, law: e.law };
        NamedTerm { effect: e.effect, term, std: e.std }
    }
}

impl From<NamedTerm> for TermEntry {
    fn from(t: NamedTerm) -> TermEntry {
        let Term { joint, coefficient, law } = t.term;
        TermEntry { effect: t.effect, joint: joint + 1, coefficient, std: t.std, law }
    }
}

/// A law in the file: its name under `law`, its numbers next to it.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Law<f64>", tag = "law", rename_all = "snake_case")]
enum LawEntry {
    Constant,
    VelocityMagnitude,
    Load {
        steepness: f64,
    },
    Stribeck {
        steepness: f64,
        velocity: f64,
    },
    Power {
        steepness: f64,
        power: f64,
    },
    Presliding {
        distance: f64,
    },
    Position,
    Cosine {
        order: f64,
    },
    Sine {
        order: f64,
    },
    DirectionCosine {
        order: f64,
        steepness: f64,
    },
    DirectionSine {
        order: f64,
        steepness: f64,
    },
    CoolFriction {
        time_constant: f64,
    },
    CoolVelocity {
        time_constant: f64,
    },
    HotFriction {
        reference: f64,
    },
    HotVelocity {
        reference: f64,
    },
    OtherDirection {
        #[serde(with = "from_one")]
        other: usize,
        steepness: f64,
    },
    OtherVelocity {
        #[serde(with = "from_one")]
        other: usize,
    },
    OtherAcceleration {
        #[serde(with = "from_one")]
        other: usize,
    },
    SumDirection {
        #[serde(with = "from_one")]
        other: usize,
        own: f64,
        theirs: f64,
        steepness: f64,
    },
    SumVelocity {
        #[serde(with = "from_one")]
        other: usize,
        own: f64,
        theirs: f64,
    },
    SumAcceleration {
        #[serde(with = "from_one")]
        other: usize,
        own: f64,
        theirs: f64,
    },
    OtherPosition {
        #[serde(with = "from_one")]
        other: usize,
    },
    PositionProduct {
        #[serde(with = "pair_from_one")]
        joints: [usize; 2],
    },
    CosineOfTwo {
        #[serde(with = "pair_from_one")]
        joints: [usize; 2],
        orders: [f64; 2],
    },
    SineOfTwo {
        #[serde(with = "pair_from_one")]
        joints: [usize; 2],
        orders: [f64; 2],
    },
    VelocityProduct {
        #[serde(with = "from_one")]
        other: usize,
    },
    VelocityByMagnitude {
        #[serde(with = "from_one")]
        other: usize,
    },
    Torque,
    TorqueMagnitude {
        scale: f64,
    },
    TorqueSquare {
        scale: f64,
    },
    Gap {
        gap: f64,
    },
    Flight {
        reach: f64,
    },
    Compliance,
    HangingBack {
        scale: f64,
    },
}

/// Joints are counted from 1 in files.
mod from_one {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(joint: &usize, to: S) -> Result<S::Ok, S::Error> {
        (joint + 1).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<usize, D::Error> {
        Ok(usize::deserialize(from)?.saturating_sub(1))
    }
}

/// Like [`from_one`], for two joints.
mod pair_from_one {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(joints: &[usize; 2], to: S) -> Result<S::Ok, S::Error> {
        joints.map(|joint| joint + 1).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<[usize; 2], D::Error> {
        Ok(<[usize; 2]>::deserialize(from)?.map(|joint| joint.saturating_sub(1)))
    }
}

/// The text of a model's file.
pub(super) fn read_text(path: &Path) -> Result<String, FileError> {
    dyngen::file::text(path).map_err(|e| FileError(format!("{}: cannot be read: {e}", path.display())))
}

impl TorqueModel {
    /// Reads a model: `model.json` or `identified.json`.
    ///
    /// # Errors
    /// [`FileError`] where the file cannot be read or is not a model.
    pub fn read(path: &Path) -> Result<TorqueModel, FileError> {
        TorqueModel::parse(&read_text(path)?, path)
    }

    /// Like [`TorqueModel::read`], from the text of a file; `path` is its name in errors.
    ///
    /// # Errors
    /// [`FileError`] if it is not a model.
    pub fn parse(text: &str, path: &Path) -> Result<TorqueModel, FileError> {
        let wrong = |what: String| FileError(format!("{}: {what}", path.display()));
        let json: Value = serde_json::from_str(text).map_err(|e| wrong(format!("is no JSON: {e}")))?;
        if let Some(why) = no_torques(&json) {
            return Err(wrong(why));
        }
        for key in ["parameters", "friction"] {
            if !json[key].is_array() {
                return Err(wrong(format!("has no list '{key}': it is not a model.json or identified.json")));
            }
        }
        serde_json::from_value(json).map_err(|e| wrong(format!("is not a torque model: {e}")))
    }

    /// Whether the model is one of an arm whose minimal set has these names; every number must be finite.
    /// Brings the parameters and joints into their order.
    ///
    /// # Errors
    /// [`FileError`] with what does not fit; `file` names the model's file in it.
    pub fn checked(mut self, names: &[String], dof: usize, file: &Path) -> Result<TorqueModel, FileError> {
        let wrong = |what: String| Err(FileError(format!("{}: {what}", file.display())));
        let mut parameters = Vec::with_capacity(names.len());
        for name in names {
            match self.parameters.iter().find(|p| p.name == *name) {
                Some(p) => parameters.push(p.clone()),
                None => {
                    return wrong(format!(
                        "has no value for the parameter {name}: it was identified for another arm file, or \
                            in mountings that do not determine it"
                    ));
                }
            }
        }
        let mut friction = Vec::with_capacity(dof);
        for joint in 1..=dof {
            match self.friction.iter().find(|f| f.joint == joint) {
                Some(f) => friction.push(f.clone()),
                None => return wrong(format!("has no friction for joint {joint}")),
            }
        }
        for NamedTerm { effect, term, .. } in &self.additions.terms {
            let other = match term.law {
                Law::OtherDirection { other, .. }
                | Law::OtherVelocity { other }
                | Law::SumDirection { other, .. }
                | Law::SumVelocity { other, .. }
                | Law::SumAcceleration { other, .. }
                | Law::OtherPosition { other }
                | Law::VelocityProduct { other }
                | Law::VelocityByMagnitude { other }
                | Law::OtherAcceleration { other } => other,
                Law::PositionProduct { joints }
                | Law::CosineOfTwo { joints, .. }
                | Law::SineOfTwo { joints, .. } => joints[0].max(joints[1]),
                _ => 0,
            };
            if term.joint >= dof || other >= dof {
                return wrong(format!("the term '{effect}' is on a joint that the arm does not have"));
            }
        }
        for (key, list) in [
            ("encoder_offset", &self.additions.log_changes.encoder_offset),
            ("delay", &self.additions.log_changes.delay),
        ] {
            if !list.is_empty() && list.len() != dof {
                return wrong(format!("log_changes.{key} has {} numbers for {dof} joints", list.len()));
            }
        }
        (self.parameters, self.friction) = (parameters, friction);
        Ok(self)
    }
}
