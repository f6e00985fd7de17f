//! Identified position servos, as `powerball identify` writes them for logs without torque, in the form of
//! MuJoCo's `<position>`: force = kp·(ctrl − q) − kv·q̇ within `forcerange`.

use super::edit::shortest;
use super::known::Friction;
use crate::arm::Arm;
use crate::values::Values;
use serde_json::Value;

/// The servo of a joint, N, m, rad, s.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    /// Torque for an error of 1 rad.
    pub kp: f64,
    /// Torque for each rad/s by the drive.
    pub kv: f64,
    /// The largest torque, where the logs show it ([`Values::is_shown`]) or the arm file has it.
    pub force: Option<f64>,
    /// Rotor and gear as the joint feels them.
    pub armature: f64,
    /// Coulomb friction; viscous friction with what the turning motor itself takes away.
    pub friction: Friction,
    /// What MuJoCo has no place for, in words.
    pub left_out: Vec<String>,
}

/// The list `servo` by link; a file without one has none.
///
/// # Errors
/// Which joint has none, or torques without a unit; the file is not named.
pub(super) fn read(arm: &Arm, json: &Value) -> Result<Option<Vec<Option<Servo>>>, String> {
    let Some(list) = json.get("servo").and_then(Value::as_array) else { return Ok(None) };
    let of_joint = |joint: usize| {
        let entry = list.iter().find(|entry| entry["joint"].as_u64() == Some(joint as u64 + 1));
        entry.ok_or_else(|| format!("no servo for joint {}", joint + 1)).and_then(|entry| servo(joint, entry))
    };
    let coordinates = arm.coordinates();
    let coordinate = |link: usize| coordinates.iter().position(|joint| *joint == link);
    (0..arm.links())
        .map(|link| coordinate(link).map(of_joint).transpose())
        .collect::<Result<_, _>>()
        .map(Some)
}

fn servo(joint: usize, entry: &Value) -> Result<Servo, String> {
    if entry["absolute"] != Value::Bool(true) {
        return Err(format!(
            "the torques of joint {} are shares of the torque at full duty: identify it with the arm's \
             masses (--values), or with torque_constant, resistance and supply in the arm file",
            joint + 1
        ));
    }
    let all = entry["parameters"].as_array().map_or(&[][..], Vec::as_slice);
    let found = |name: &str| all.iter().find(|p| p["name"] == name);
    let value = |name: &str| found(name).and_then(|p| p["value"].as_f64());
    let std = |name: &str| found(name).and_then(|p| p["std"].as_f64());
    let or = |name: &str, ideal: f64| value(name).unwrap_or(ideal);
    let torque = value("torque").ok_or_else(|| format!("no torque for joint {}", joint + 1))?;
    // Where no log reaches full duty, torque and gain are known as their product.
    let is_known = found("torque").is_some_and(|p| p["known"] == Value::Bool(true));
    let has_force = is_known || Values::is_shown(torque, std("torque"));
    let stiffness = torque * or("gain", 1.0);
    let mut left_out = Vec::new();
    if !has_force {
        left_out.push("forcerange: no log reaches the largest torque".to_string());
    }
    for (name, words) in [
        ("load", "friction for each N·m that the gear carries"),
        ("stribeck", "friction at rest beyond that in motion, N·m"),
        ("delay", "the delay of the goal, s"),
        ("speed_limit", "the largest speed of the goal, rad/s"),
        ("dead_zone", "errors that do nothing, rad"),
        ("ki", "the integral gain, kp/s"),
        ("zero", "what is added to logged positions, rad"),
    ] {
        let value = value(name).filter(|value| *value != 0.0);
        left_out.extend(value.map(|value| format!("{name} {}: {words}", shortest(value))));
    }
    let both = |a: Option<f64>, b: Option<f64>| a.map(|a| a + b.unwrap_or(0.0));
    Ok(Servo {
        kp: stiffness * or("kp", 1.0),
        kv: stiffness * or("kd", 0.0),
        force: has_force.then(|| torque * or("pwm_limit", 1.0)),
        armature: or("armature", 0.0),
        friction: Friction {
            viscous: Some(or("viscous", 0.0) + or("back_emf", 0.0)),
            coulomb: or("coulomb", 0.0),
            // An upper limit, as the errors of the two are opposite.
            std: [both(std("viscous"), std("back_emf")), std("coulomb")],
        },
        left_out,
    })
}
