//! The named effects in addition to the rigid arm and its friction: the terms of a `model.json`.

use crate::arm::Arm;
use serde_json::Value;

/// An additional torque that the motor of a joint must supply, N·m or N: a coefficient times a law of the
/// joint's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The link behind the joint, from 0.
    pub link: usize,
    /// The effect's name, such as `position_ripple`.
    pub effect: String,
    /// N·m or N.
    pub coefficient: f64,
    /// Standard error of the coefficient, where it is known.
    pub std: Option<f64>,
    /// The law that the coefficient multiplies.
    pub law: Law,
}

/// A law for which a robot description may have a place; q in rad or m.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// cos(order·q).
    Cosine {
        /// Cycles a turn.
        order: f64,
    },
    /// sin(order·q).
    Sine {
        /// Cycles a turn.
        order: f64,
    },
    /// Dahl's z: dz/dq = (1 − z·sign q̇)·sign q̇/distance.
    Presliding {
        /// rad or m.
        distance: f64,
    },
    /// tanh(γ·q̇)·exp(−(q̇/velocity)²).
    Stribeck {
        /// rad/s or m/s.
        velocity: f64,
    },
    /// q.
    Position,
    /// 1.
    Constant,
    /// One for which there is none, by its name.
    Other(String),
}

/// The list `terms`; a file without one has none.
///
/// # Errors
/// Which number is missing or out of place; the file is not named.
pub(super) fn read(arm: &Arm, json: &Value) -> Result<Vec<Term>, String> {
    let coordinates = arm.coordinates();
    let list = json.get("terms").and_then(Value::as_array);
    let term = |(i, entry): (usize, &Value)| -> Result<Term, String> {
        let effect = entry["effect"].as_str().unwrap_or("without a name").to_string();
        let wrong = |what: String| format!("term {}, {effect}: {what}", i + 1);
        let number = |key: &str| {
            let found = entry[key].as_f64().filter(|x| x.is_finite());
            found.ok_or_else(|| wrong(format!("'{key}' must be a number, found {}", entry[key])))
        };
        let size = |key: &str| match number(key)? {
            size if size > 0.0 => Ok(size),
            size => Err(wrong(format!("'{key}' must be positive, found {size}"))),
        };
        let joint = entry["joint"].as_u64().and_then(|joint| usize::try_from(joint).ok());
        let joint = joint.and_then(|joint| coordinates.get(joint.checked_sub(1)?).copied());
        let link = joint.ok_or_else(|| {
            wrong(format!("'joint' must be 1 to {}, found {}", coordinates.len(), entry["joint"]))
        })?;
        let law = match entry["law"].as_str() {
            Some("cosine") => Law::Cosine { order: size("order")? },
            Some("sine") => Law::Sine { order: size("order")? },
            Some("presliding") => Law::Presliding { distance: size("distance")? },
            Some("stribeck") => Law::Stribeck { velocity: size("velocity")? },
            Some("position") => Law::Position,
            Some("constant") => Law::Constant,
            Some(other) => Law::Other(other.to_string()),
            None => return Err(wrong(format!("'law' must be a name, found {}", entry["law"]))),
        };
        let std = entry["std"].as_f64().filter(|x| x.is_finite() && *x >= 0.0);
        Ok(Term { link, coefficient: number("coefficient")?, std, law, effect })
    };
    list.into_iter().flatten().enumerate().map(term).collect()
}
