//! Position servos: what is known of a joint's drive that takes a position and closes its own loop.
//!
//! The voltage that the drive puts on its motor is a share u of its supply (the duty),
//!
//! u = clamp(gain·(kp·e + ki·∫e dt − kd·q̇), ± pwm_limit), e = goal − q beyond the dead zone,
//!
//! and the motor's torque at the joint is τ = k/R·(u·supply − k·q̇), with `torque_constant` k and
//! `resistance` R. The goal comes `delay` late and moves no faster than `speed_limit`. Nothing of it enters
//! the arm's rigid dynamics.

use super::table::{Reader, Table, Value, describe};
use crate::exact::rational;
use num_traits::Signed;

/// `[joint.servo]`: what is known of a position servo; what is not there is unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Servo {
    /// Proportional gain in the drive's own unit; 1 where it is not there.
    pub kp: Option<f64>,
    /// Integral gain in that unit a second; 0 where it is not there.
    pub ki: Option<f64>,
    /// Derivative gain in that unit, s; 0 where it is not there.
    pub kd: Option<f64>,
    /// Duty for an error of 1 rad (1 m) and a gain kp of 1.
    pub gain: Option<f64>,
    /// Errors of the position below this do nothing, rad or m; 0 where it is not there.
    pub dead_zone: Option<f64>,
    /// The largest duty, above 0 to 1; 1 where it is not there.
    pub pwm_limit: Option<f64>,
    /// The goal moves no faster inside the drive, rad/s or m/s.
    pub speed_limit: Option<f64>,
    /// From the logged goal to what the motor does, s.
    pub delay: Option<f64>,
    /// Voltage of the supply, V.
    pub supply: Option<f64>,
    /// k, at the joint: N·m/A, which is also V·s/rad (N/A, V·s/m).
    pub torque_constant: Option<f64>,
    /// R, of the winding and the bridge, Ω.
    pub resistance: Option<f64>,
    /// Rotor and gear as the joint feels them, kg·m² or kg.
    pub armature: Option<f64>,
}

impl Servo {
    /// Torque at the joint at rest and full duty, k/R·supply, where all three are known, N·m or N.
    #[must_use]
    pub fn stall_torque(&self) -> Option<f64> {
        Some(self.torque_constant? / self.resistance? * self.supply?)
    }

    /// Torque that the turning motor itself takes away for each rad/s, k²/R, where both are known, N·m·s/rad
    /// or N·s/m.
    #[must_use]
    pub fn back_emf(&self) -> Option<f64> {
        Some(self.torque_constant?.powi(2) / self.resistance?)
    }
}

/// What a number of the table may be.
#[derive(Clone, Copy, PartialEq)]
enum Range {
    Positive,
    NotNegative,
    /// Above 0, up to 1.
    Share,
}

/// A key, its unit and range, and where its value stands.
type Key = (&'static str, &'static str, Range, fn(&mut Servo) -> &mut Option<f64>);

const KEYS: [Key; 12] = [
    ("kp", "in the drive's own unit", Range::Positive, |s| &mut s.kp),
    ("ki", "kp a second", Range::NotNegative, |s| &mut s.ki),
    ("kd", "kp·s", Range::NotNegative, |s| &mut s.kd),
    ("gain", "duty for 1 rad or 1 m at kp = 1", Range::Positive, |s| &mut s.gain),
    ("dead_zone", "rad or m", Range::NotNegative, |s| &mut s.dead_zone),
    ("pwm_limit", "a share of the supply", Range::Share, |s| &mut s.pwm_limit),
    ("speed_limit", "rad/s or m/s", Range::Positive, |s| &mut s.speed_limit),
    ("delay", "s", Range::NotNegative, |s| &mut s.delay),
    ("supply", "V", Range::Positive, |s| &mut s.supply),
    ("torque_constant", "N·m/A at the joint", Range::Positive, |s| &mut s.torque_constant),
    ("resistance", "Ω", Range::Positive, |s| &mut s.resistance),
    ("armature", "kg·m² or kg", Range::NotNegative, |s| &mut s.armature),
];

/// Reads `[joint.servo]`.
pub(super) fn read(reader: &mut Reader<'_>, v: &Value<'_>, place: &str) -> Option<Servo> {
    let Some(table) = v.get_ref().as_table() else {
        let message = format!("{place}: servo must be a table: write [joint.servo], found {}", describe(v));
        reader.errors.error(v.span(), message);
        return None;
    };
    let t = Table { table, span: v.span(), place: format!("{place}: servo") };
    reader.unknown_keys(&t, &KEYS.map(|(key, ..)| key));
    let mut servo = Servo::default();
    let mut sound = true;
    for (key, unit, range, field) in KEYS {
        let quantity = format!("{place}: servo: {key}");
        let value = reader.optional(&t, key, |r, v| number(r, v, &quantity, unit, range));
        sound &= value.is_some();
        *field(&mut servo) = value.flatten();
    }
    sound.then_some(servo)
}

fn number(r: &mut Reader<'_>, v: &Value<'_>, quantity: &str, unit: &str, range: Range) -> Option<f64> {
    let value = r.number(v, quantity, unit)?;
    let number = rational::to_f64(&value);
    let (fits, must) = match range {
        Range::Positive => (value.is_positive(), "greater than zero"),
        Range::NotNegative => (!value.is_negative(), "zero or greater"),
        Range::Share => (value.is_positive() && number <= 1.0, "above 0 and not above 1"),
    };
    if !fits {
        r.errors.error(v.span(), format!("{quantity} must be {must} ({unit}), found {number}"));
    }
    fits.then_some(number)
}

#[cfg(test)]
mod tests {
    use crate::Arm;

    const JOINT: &str = "name = \"one\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\n\
        kind = \"revolute\"\na = 0.1\nalpha = 0\nd = 0\ntheta = 0\n";

    #[test]
    fn what_is_known_of_a_servo_is_read_and_the_rest_is_unknown() {
        let text = format!(
            "{JOINT}[joint.servo]\nkp = 16\nsupply = 12.0\ntorque_constant = 3.5\nresistance = 7\nkd = 0\n"
        );
        let arm = Arm::parse(&text, "one.toml").unwrap();
        let servo = arm.joints[0].servo.clone().unwrap();
        assert_eq!((servo.kp, servo.kd, servo.gain), (Some(16.0), Some(0.0), None));
        assert_eq!((servo.stall_torque(), servo.back_emf()), (Some(6.0), Some(1.75)));
        assert_eq!(Arm::parse(JOINT, "one.toml").unwrap().joints[0].servo, None);
    }

    #[test]
    fn what_cannot_be_is_named_with_its_place() {
        let wrong = |table: &str| Arm::parse(&format!("{JOINT}{table}"), "one.toml").unwrap_err().to_string();
        let all = wrong("[joint.servo]\nkp = 0\npwm_limit = 1.2\ndelay = -1\ngains = 2\n");
        for part in [
            "one.toml:11:6: joint 1: servo: kp must be greater than zero",
            "servo: pwm_limit must be above 0 and not above 1",
            "servo: delay must be zero or greater (s), found -1",
            "joint 1: servo: unknown key 'gains': known are kp, ki, kd",
        ] {
            assert!(all.contains(part), "{all}");
        }
        assert!(wrong("servo = 3\n").contains("write [joint.servo]"));
    }
}
