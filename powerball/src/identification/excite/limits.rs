//! What the joints may do, from the arm file.

use dyngen::Arm;
use std::fmt;

/// The limits of one joint, rad (m for prismatic joints) and s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lowest and highest position.
    pub position: [f64; 2],
    /// Highest velocity.
    pub velocity: f64,
    /// Highest acceleration.
    pub acceleration: f64,
    /// Highest torque, N·m (N), where the file gives one.
    pub torque: Option<f64>,
}

/// The limits of every joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits(pub Vec<JointLimits>);

/// The arm file misses limits: one text for each joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingLimits(pub Vec<String>);

impl Limits {
    /// The limits of an arm, drawn in by `margin`: 0.05 leaves 5 % of the range, the velocity, the
    /// acceleration and the torque unused.
    ///
    /// # Errors
    /// Every limit that the arm file misses, joint by joint.
    pub fn of(arm: &Arm, margin: f64) -> Result<Limits, MissingLimits> {
        let mut missing = Vec::new();
        let share = 1.0 - margin;
        let mut limits = Vec::new();
        for (i, joint) in arm.joints.iter().enumerate() {
            let keys = [
                ("`position`", joint.position.is_some()),
                ("`velocity`", joint.velocity.is_some()),
                ("`acceleration`", joint.acceleration.is_some()),
            ];
            let absent: Vec<&str> = keys.iter().filter(|(_, there)| !there).map(|(key, _)| *key).collect();
            if !absent.is_empty() {
                missing.push(format!("joint {}: {}", i + 1, absent.join(", ")));
            }
            let [low, high] = joint.position.unwrap_or_default();
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            limits.push(JointLimits {
                position: [middle - share * half, middle + share * half],
                velocity: share * joint.velocity.unwrap_or_default(),
                acceleration: share * joint.acceleration.unwrap_or_default(),
                torque: joint.torque.map(|torque| share * torque),
            });
        }
        if missing.is_empty() { Ok(Limits(limits)) } else { Err(MissingLimits(missing)) }
    }
}

impl fmt::Display for MissingLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "an exciting trajectory needs limits that the arm file does not give: {}",
            self.0.join("; ")
        )
    }
}

impl std::error::Error for MissingLimits {}
