//! The constants of a servo and of the friction behind it: names, units, and how they are kept.

use serde::Serialize;

/// A constant of a servo or of its friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constant {
    /// Torque at the joint at rest and full duty.
    Torque,
    /// Torque that the turning motor itself takes away while it is switched on.
    BackEmf,
    /// Rotor and gear as the joint feels them.
    Armature,
    /// What is added to the logged position to have that of the arm file.
    Zero,
    /// Friction that does not depend on speed or load.
    Coulomb,
    /// Friction that grows with speed; with the back-EMF where that is not known apart.
    Viscous,
    /// Friction for each N·m that the gear carries.
    Load,
    /// Friction at rest beyond that in motion.
    Stribeck,
    /// Speed at which that has fallen to a third.
    StribeckVelocity,
    /// Supply for which the torque at full duty holds: where it is above 0, that follows the logged voltage.
    Supply,
    /// Change of Coulomb and viscous friction, as a share of it when cold: when warm, or over 10 K.
    Warmth,
    /// Time in which the joint becomes warm; 0 where friction follows the logged temperature.
    WarmthTime,
    /// Logged temperature at which friction is as the other constants have it.
    Cold,
    /// Duty for an error of 1 rad at kp = 1.
    Gain,
    /// Errors below this do nothing.
    DeadZone,
    /// From the logged goal to what the motor does.
    Delay,
    /// The goal moves no faster inside the drive.
    SpeedLimit,
    /// The drive's own gains, as the arm file has them.
    Kp,
    /// Integral gain.
    Ki,
    /// Derivative gain.
    Kd,
    /// Largest duty.
    PwmLimit,
}

use Constant::{
    Armature, BackEmf, Cold, Coulomb, DeadZone, Delay, Gain, Kd, Ki, Kp, Load, PwmLimit, SpeedLimit,
    Stribeck, StribeckVelocity, Supply, Torque, Viscous, Warmth, WarmthTime, Zero,
};

/// How many there are.
pub const COUNT: usize = 21;

/// All of them in order, with their names and units; those of the second list are in torques.
pub const ALL: [(Constant, &str, &str); COUNT] = [
    (Torque, "torque", "N·m"),
    (BackEmf, "back_emf", "N·m·s/rad"),
    (Armature, "armature", "kg·m²"),
    (Zero, "zero", "rad"),
    (Coulomb, "coulomb", "N·m"),
    (Viscous, "viscous", "N·m·s/rad"),
    (Load, "load", "1"),
    (Stribeck, "stribeck", "N·m"),
    (StribeckVelocity, "stribeck_velocity", "rad/s"),
    (Supply, "supply", "V"),
    (Warmth, "warmth", "1"),
    (WarmthTime, "warmth_time", "s"),
    (Cold, "cold", "°C"),
    (Gain, "gain", "1/rad"),
    (DeadZone, "dead_zone", "rad"),
    (Delay, "delay", "s"),
    (SpeedLimit, "speed_limit", "rad/s"),
    (Kp, "kp", "1"),
    (Ki, "ki", "1/s"),
    (Kd, "kd", "s"),
    (PwmLimit, "pwm_limit", "1"),
];

impl Constant {
    /// The constant's name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        ALL[self as usize].1
    }

    /// Whether it is a torque, or one for each rad/s or rad/s².
    #[must_use]
    pub fn is_torque(self) -> bool {
        matches!(self, Torque | BackEmf | Armature | Coulomb | Viscous | Stribeck)
    }

    /// The constant's unit. Where nothing says how large torques are, they are shares of the torque at full
    /// duty.
    #[must_use]
    pub fn unit(self, absolute: bool) -> &'static str {
        match (absolute, self) {
            (false, Torque | Coulomb | Stribeck) => "1 (torque at full duty)",
            (false, BackEmf | Viscous) => "s/rad (torque at full duty)",
            (false, Armature) => "s² (torque at full duty)",
            _ => ALL[self as usize].2,
        }
    }
}

/// A value for each constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants([f64; COUNT]);

impl Constants {
    /// No friction, no delay, no limit, a gain of 1.
    #[must_use]
    pub fn ideal() -> Constants {
        let mut own = Constants([0.0; COUNT]);
        for (constant, value) in [
            (Torque, 1.0),
            (StribeckVelocity, 0.1),
            (Gain, 1.0),
            (SpeedLimit, f64::INFINITY),
            (Kp, 1.0),
            (PwmLimit, 1.0),
        ] {
            own.set(constant, value);
        }
        own
    }

    /// The value of one.
    #[must_use]
    pub fn of(&self, constant: Constant) -> f64 {
        self.0[constant as usize]
    }

    /// Sets one.
    pub fn set(&mut self, constant: Constant, value: f64) {
        self.0[constant as usize] = value;
    }

    /// Sets one of the constants.
    #[must_use]
    pub fn with(mut self, constant: Constant, value: f64) -> Constants {
        self.set(constant, value);
        self
    }
}

/// A constant or an inertial parameter as it was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Found {
    /// The constant's name.
    pub name: String,
    /// The constant's value.
    pub value: f64,
    /// The standard error; `None` where the arm file gives it or the logs do not show it.
    pub std: Option<f64>,
    /// The unit of both.
    pub unit: String,
    /// Whether the arm file gives it.
    pub known: bool,
}
