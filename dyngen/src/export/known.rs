//! Identified values from their files: every link's parameters with their errors, and friction.

use super::servo::{self, Servo};
use super::term::{self, Term};
use crate::arm::sum::parse_sum;
use crate::arm::{Arm, Parameter, ParameterKind};
use crate::consistency::pseudo_inertia;
use crate::values::Values;
use serde_json::Value;

/// Rounding error that an eigenvalue of a pseudo-inertia is allowed, relative to its largest entry.
const ROUNDING: f64 = 1e-10;

/// A joint's friction in the two terms that URDF and MJCF have, with standard errors where they are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Viscous friction, N·m·s/rad or N·s/m; `None` if it is not to be written.
    pub viscous: Option<f64>,
    /// Sum of the saturating terms, N·m or N.
    pub coulomb: f64,
    /// Standard errors of both; if a file lacks that of the sum of saturating terms, the sum of their errors
    /// is taken, which is an upper limit.
    pub std: [Option<f64>; 2],
}

/// The values to write into a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// Eleven parameters a body in the order of [`Arm::all_parameters`].
    pub values: Vec<f64>,
    /// For each link, then each bar, what is known of its parameters, in words: sums with values and standard
    /// errors.
    pub words: Vec<Vec<String>>,
    /// By joint; `None` for joints that follow others, whose friction acts at the joint that they follow.
    pub friction: Option<Vec<Option<Friction>>>,
    /// Effects beyond friction.
    pub terms: Vec<Term>,
    /// Position servos by joint, where the file has them.
    pub servos: Option<Vec<Option<Servo>>>,
}

impl Known {
    /// Reads a values file and, if there is one, a file with friction and effects, by their texts and names.
    ///
    /// # Errors
    /// Missing values of the files: each link and each bar needs all its parameters, and they must be those
    /// of a body.
    pub fn read(arm: &Arm, values: (&str, &str), friction: Option<(&str, &str)>) -> Result<Known, String> {
        let (text, file) = values;
        // Text that is not JSON, and keys that stand twice, are reported as for any values file.
        let json: Value = serde_json::from_str(text).map_err(|e| format!("{file}: not valid JSON: {e}"))?;
        let consistent = json.get("consistent").and_then(|c| c.get("parameters")).map(Value::to_string);
        let given = Values::parse(consistent.as_deref().unwrap_or(text), file).map_err(|e| e.to_string())?;
        let kept = arm.kept_parameters();
        let unknown: Vec<&str> = given.names().filter(|n| !is_of(arm, n)).collect();
        if !unknown.is_empty() {
            return Err(format!(
                "{file}: {} are sums of parameters, which do not give the values of a single link: take the \
                 identified.json of `powerball identify`, which has a body for each link, or a values file \
                 with every parameter of the arm",
                unknown.join(", ")
            ));
        }
        let mut all = vec![0.0; arm.all_parameters().len()];
        let mut missing = Vec::new();
        for parameter in &kept {
            match given.get(&parameter.to_string()) {
                Some(value) => all[parameter.index()] = value,
                None if parameter.kind == ParameterKind::Im => {}
                None => missing.push(parameter.to_string()),
            }
        }
        if !missing.is_empty() {
            return Err(format!("{file}: no value for {}", missing.join(", ")));
        }
        for body in 0..arm.bodies() {
            let ten: [f64; 10] = std::array::from_fn(|k| all[11 * body + k]);
            let scale = ten.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let least = pseudo_inertia(&ten).symmetric_eigenvalues().min();
            if least < -ROUNDING * scale {
                return Err(format!(
                    "{file}: {}: no body has these parameters (its pseudo-inertia has the eigenvalue \
                     {least:.3e}): `dyngen check` says why",
                    arm.body_name(body)
                ));
            }
        }
        let words = words(arm, &json);
        let Some((text, file)) = friction else {
            return Ok(Known { values: all, words, friction: None, terms: Vec::new(), servos: None });
        };
        let wrong = |what: String| format!("{file}: {what}");
        let json: Value = serde_json::from_str(text).map_err(|e| wrong(format!("not valid JSON: {e}")))?;
        let servos = servo::read(arm, &json).map_err(wrong)?;
        let friction = match &servos {
            Some(servos) => servos.iter().map(|servo| servo.as_ref().map(|servo| servo.friction)).collect(),
            None => read_friction(arm, &json).map_err(wrong)?,
        };
        let terms = term::read(arm, &json).map_err(wrong)?;
        Ok(Known { values: all, words, friction: Some(friction), terms, servos })
    }
}

impl Known {
    /// Removes the damping of joints that is not larger than its own standard error, so that the robot
    /// description keeps its value; returns notes about that.
    pub fn without_uncertain_damping(&mut self, arm: &Arm) -> Vec<String> {
        let mut said = Vec::new();
        let names = arm.joints.iter().enumerate();
        for ((i, joint), friction) in names.zip(self.friction.iter_mut().flatten()) {
            let Some(friction) = friction else { continue };
            let (Some(viscous), [Some(std), _]) = (friction.viscous, friction.std) else { continue };
            if viscous > std {
                continue;
            }
            friction.viscous = None;
            let name = joint.name.as_ref().map_or(format!("{}", i + 1), |name| format!("'{name}'"));
            said.push(format!(
                "joint {name}: its damping {viscous:.3e} is not larger than its standard error {std:.3e} and \
                 is not written (--uncertain writes it)"
            ));
        }
        said
    }
}

fn is_of(arm: &Arm, name: &str) -> bool {
    Parameter::parse(name).is_some_and(|p| p.link < arm.bodies())
}

/// The sums that an identification lists, with their errors, at each body whose parameters they hold.
fn words(arm: &Arm, json: &Value) -> Vec<Vec<String>> {
    let mut words = vec![Vec::new(); arm.bodies()];
    for entry in json.get("parameters").and_then(Value::as_array).into_iter().flatten() {
        let (Some(name), Some(value)) = (entry["name"].as_str(), entry["value"].as_f64()) else { continue };
        let body = match parse_sum(name) {
            // The sum's first term is its own; others only add to it.
            Ok(terms) => terms.first().map(|(p, _)| p.link).filter(|body| *body < arm.bodies()),
            Err(_) => None,
        };
        if let Some(body) = body {
            let std = entry["std"].as_f64().map_or("not determined".to_string(), |s| format!("± {s:.3e}"));
            words[body].push(format!("{name} = {value:.6e} {std}"));
        }
    }
    words
}

/// Eq. 16 of the paper, γ1 tanh(γ2 q̇) + γ3 tanh(γ4 q̇) + γ5 q̇: the sum of its saturating terms is γ1 + γ3.
fn read_friction(arm: &Arm, json: &Value) -> Result<Vec<Option<Friction>>, String> {
    let list = json.get("friction").and_then(Value::as_array);
    let list = list.ok_or_else(|| "it has no list 'friction'".to_string())?;
    let of_joint = |joint: usize| -> Result<Friction, String> {
        let entry = list.iter().find(|e| e["joint"].as_u64() == Some(joint as u64 + 1));
        let number = |key: &str| entry.and_then(|e| e[key].as_f64()).filter(|x| x.is_finite());
        let (Some(first), Some(second), Some(viscous)) =
            (number("gamma1"), number("gamma3"), number("gamma5"))
        else {
            return Err(format!("no gamma1, gamma3 and gamma5 for joint {}", joint + 1));
        };
        if first + second < 0.0 || viscous < 0.0 {
            return Err(format!("the friction of joint {} is negative", joint + 1));
        }
        let std = |k: usize| entry.and_then(|e| e["std"][k].as_f64());
        let given = entry.and_then(|e| e["coulomb_std"].as_f64());
        let coulomb_std = given.or_else(|| std(0).map(|s| s + std(2).unwrap_or(0.0)));
        Ok(Friction { viscous: Some(viscous), coulomb: first + second, std: [std(4), coulomb_std] })
    };
    let coordinates = arm.coordinates();
    let coordinate = |link: usize| coordinates.iter().position(|joint| *joint == link);
    (0..arm.links()).map(|link| coordinate(link).map(of_joint).transpose()).collect()
}
