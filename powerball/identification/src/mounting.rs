//! The mounting of a base: gravity in its frame, and the upward direction.

use dyngen::Arm;
use dyngen::exact::rational::{self, Rational, parse_rational};
use nalgebra::{Rotation3, Vector3};
use std::fmt;
use std::str::FromStr;

/// The mounting of the base for a trajectory or for a log of one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Mounting {
    /// The mounting that the gravity of the arm file gives.
    #[default]
    Filed,
    /// Turned from there about its own x axis and then about the fixed y axis, degrees.
    Turned {
        /// About x.
        roll: f64,
        /// About y.
        pitch: f64,
    },
    /// The mounting that this gravity in the base frame gives, m/s².
    Gravity([f64; 3]),
}

impl Mounting {
    /// Gravity in the base frame, m/s².
    #[must_use]
    pub fn gravity(&self, arm: &Arm) -> [f64; 3] {
        let filed = arm.gravity.each_ref().map(rational::to_f64);
        match self {
            Mounting::Filed => filed,
            Mounting::Turned { roll, pitch } => {
                let about = |axis, angle: &f64| Rotation3::from_axis_angle(&axis, angle.to_radians());
                let base = about(Vector3::y_axis(), pitch) * about(Vector3::x_axis(), roll);
                (base.inverse() * Vector3::from(filed)).into()
            }
            Mounting::Gravity(gravity) => *gravity,
        }
    }

    /// The mounting that has this gravity in the base frame, m/s².
    #[must_use]
    pub fn with(gravity: [f64; 3], arm: &Arm) -> Mounting {
        if gravity == Mounting::Filed.gravity(arm) { Mounting::Filed } else { Mounting::Gravity(gravity) }
    }

    /// The mounting in the form of the command line.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Mounting::Filed => "filed".to_string(),
            Mounting::Turned { roll, pitch } => format!("{roll},{pitch}"),
            Mounting::Gravity([x, y, z]) => format!("{x},{y},{z}"),
        }
    }

    /// Upwards in the base frame; z where there is no gravity.
    #[must_use]
    pub fn up(&self, arm: &Arm) -> Vector3<f64> {
        (-Vector3::from(self.gravity(arm))).try_normalize(1e-9).unwrap_or_else(Vector3::z)
    }

    /// The arm mounted so. Gravity is taken to six decimals: turns by right angles stay exact.
    ///
    /// # Errors
    /// Gravity that is not a number: which; joints that follow others.
    pub fn of(&self, arm: &Arm) -> Result<Arm, String> {
        arm.without_mimics()?;
        let mut mounted = arm.clone();
        if *self != Mounting::Filed {
            let [x, y, z] = self.gravity(arm).map(decimal);
            mounted.gravity = [x?, y?, z?];
        }
        Ok(mounted)
    }
}

/// An arm, given as it is mounted for each of some paths, under gravity in a general direction: its minimal
/// set is what the mountings determine together. The arm itself where there is one mounting alone.
///
/// # Errors
/// No mounting, or gravity that is NaN.
pub fn together(arms: &[&Arm]) -> Result<Arm, String> {
    let mut arm = (*arms.first().ok_or("no mounting was given")?).clone();
    if let [_, _, ..] = arms {
        let mut sum = [0.0; 3];
        for (k, arm) in arms.iter().enumerate() {
            let gravity = arm.gravity.each_ref().map(rational::to_f64);
            (0..3).for_each(|i| sum[i] += gravity[i] / (1.0 + 0.37 * k as f64));
        }
        let [x, y, z] = sum.map(decimal);
        arm.gravity = [x?, y?, z?];
    }
    Ok(arm)
}

fn decimal(value: f64) -> Result<Rational, String> {
    parse_rational(&format!("{value:.6}"))
}

impl FromStr for Mounting {
    type Err = String;

    /// `filed`, `ROLL,PITCH` in degrees, or gravity in the base frame as `X,Y,Z` in m/s².
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "filed" {
            return Ok(Mounting::Filed);
        }
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|x| x.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
        match numbers.as_deref() {
            Some([roll, pitch]) => Ok(Mounting::Turned { roll: *roll, pitch: *pitch }),
            Some([x, y, z]) if x.hypot(*y).hypot(*z) < 100.0 => Ok(Mounting::Gravity([*x, *y, *z])),
            _ => Err(format!(
                "'{text}' is no mounting: give filed, ROLL,PITCH in degrees, or gravity in the base frame as \
                    X,Y,Z in m/s²"
            )),
        }
    }
}

impl fmt::Display for Mounting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mounting::Filed => f.write_str("as in the arm file"),
            Mounting::Turned { roll, pitch } => write!(f, "rolled by {roll}° and pitched by {pitch}°"),
            Mounting::Gravity([x, y, z]) => write!(f, "with gravity ({x}, {y}, {z}) m/s² in its frame"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_angles_put_gravity_along_the_axes_exactly() {
        let arm = Arm::parse(include_str!("../../lwa4p.toml"), "lwa4p.toml").unwrap();
        let cases = [
            ("filed", [0.0, 0.0, -9.81]),
            ("90,0", [0.0, -9.81, 0.0]),
            ("0,90", [9.81, 0.0, 0.0]),
            ("180,0", [0.0, 0.0, 9.81]),
            ("0,-9.81,0", [0.0, -9.81, 0.0]),
        ];
        for (text, gravity) in cases {
            let mounting: Mounting = text.parse().unwrap();
            assert_eq!(mounting.text(), text);
            assert_eq!(
                mounting.of(&arm).unwrap().gravity.each_ref().map(rational::to_f64),
                gravity,
                "{text}"
            );
        }
        for wrong in ["upright", "1", "1,2,3,4", "nan,0", "0,0,9810"] {
            assert!(wrong.parse::<Mounting>().is_err(), "{wrong}");
        }
    }
}
