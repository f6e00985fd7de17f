//! SI on the caller's side, the drives' units on the wire; every conversion that can overflow says so.

use core::f64::consts::PI;
use num_traits::Float;

/// Counts of a radian where a count is 0.001°.
pub const MILLIDEGREES_PER_RADIAN: f64 = 180_000.0 / PI;

/// A value that the wire's type could not hold, and was cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Saturated<T> {
    /// The nearest value of the type; 0 for NaN.
    pub value: T,
    /// Whether it differs from the requested one.
    pub cut: bool,
}

fn saturate(value: f64, min: f64, max: f64) -> Saturated<i32> {
    let rounded = Float::round(value);
    let kept = if rounded.is_nan() { 0.0 } else { rounded.clamp(min, max) };
    Saturated { value: kept as i32, cut: kept != rounded }
}

/// `value` rounded to an i16.
pub fn to_i16(value: f64) -> Saturated<i32> {
    saturate(value, f64::from(i16::MIN), f64::from(i16::MAX))
}

/// `value` rounded to an i32.
pub fn to_i32(value: f64) -> Saturated<i32> {
    saturate(value, f64::from(i32::MIN), f64::from(i32::MAX))
}

/// How a joint's counts, currents and torques scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointUnits {
    /// Counts of position in a radian; negative where the drive counts against the joint.
    pub counts_per_radian: f64,
    /// Rated current, A, if the drive's own 0x6075 is not available: the scale of 0x6077.
    pub rated_current: f64,
    /// Joint torque, N·m, at the rated current, with its sign: it comes from a calibration. The
    /// torque constant is this over the rated current.
    pub rated_torque: f64,
    /// Whether `rated_torque` was measured on this arm.
    pub torque_verified: bool,
}

impl JointUnits {
    /// rad of `counts` (0x6064, 0x607A, 0x60C1).
    pub fn position(&self, counts: i32) -> f64 {
        f64::from(counts) / self.counts_per_radian
    }

    /// Counts of `position` in rad; also rad/s and rad/s² to mdeg/s and mdeg/s² (0x606C, 0x6081, 0x6083).
    pub fn counts(&self, position: f64) -> Saturated<i32> {
        to_i32(position * self.counts_per_radian)
    }

    /// A of `per_mille` of the rated current, with the joint's sign.
    pub fn current(&self, per_mille: i32) -> f64 {
        f64::from(per_mille) / 1000.0 * self.rated_current * self.sign()
    }

    /// N·m of `per_mille` of the rated current.
    pub fn torque(&self, per_mille: i32) -> f64 {
        f64::from(per_mille) / 1000.0 * self.rated_torque
    }

    /// Per mille of the rated current for `current` in A with the joint's sign.
    pub fn per_mille(&self, current: f64) -> Saturated<i32> {
        to_i16(current / self.rated_current * 1000.0 * self.sign())
    }

    /// Per mille of the rated current for a joint torque in N·m; cut where the torque constant is not known.
    pub fn per_mille_of_torque(&self, torque: f64) -> Saturated<i32> {
        to_i16(torque / self.rated_torque * 1000.0)
    }

    /// N·m at the joint of an ampere with the joint's sign.
    pub fn torque_constant(&self) -> f64 {
        self.rated_torque.abs() / self.rated_current
    }

    fn sign(&self) -> f64 {
        if self.rated_torque < 0.0 { -1.0 } else { 1.0 }
    }
}

/// The scale of mode VL's target 0x6042: at dimension factor `numerator`/`denominator` (0x604C) one count is
/// `millidegrees` mdeg/s, and for others in proportion to the denominator (1/6000 is 1 mdeg/s, 1/24000 is 4
/// mdeg/s: what two drivers of this arm use). The literal reading of the standard would be the inverse: not
/// verified on hardware.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityScale {
    /// 0x604C:1 at which `millidegrees` holds.
    pub numerator: i32,
    /// 0x604C:2 at which `millidegrees` holds.
    pub denominator: i32,
    /// mdeg/s of one count.
    pub millidegrees: f64,
    /// Whether a slow move on the arm has confirmed it.
    pub verified_on_hardware: bool,
}

impl VelocityScale {
    /// mdeg/s of one count at the dimension factor that the drive reads back, or `None` where that makes no
    /// sense.
    pub fn at(&self, numerator: i32, denominator: i32) -> Option<f64> {
        if numerator <= 0 || denominator <= 0 {
            return None;
        }
        let ratio = f64::from(denominator) / f64::from(numerator);
        Some(self.millidegrees * ratio * f64::from(self.numerator) / f64::from(self.denominator))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNITS: JointUnits = JointUnits {
        counts_per_radian: MILLIDEGREES_PER_RADIAN,
        rated_current: 5.0,
        rated_torque: -1.409,
        torque_verified: false,
    };
    const SCALE: VelocityScale =
        VelocityScale { numerator: 1, denominator: 6000, millidegrees: 1.0, verified_on_hardware: false };

    #[test]
    fn a_radian_is_57295_8_millidegrees() {
        assert!((MILLIDEGREES_PER_RADIAN - 57_295.779_513_1).abs() < 1e-7);
        assert_eq!(UNITS.counts(PI).value, 180_000);
        assert!((UNITS.position(-170_000) + 2.967).abs() < 1e-3);
    }

    #[test]
    fn an_i16_of_millidegrees_ends_at_32_767_degrees_a_second() {
        let degrees = |v: f64| to_i16(v * 1000.0 / SCALE.at(1, 6000).unwrap());
        assert_eq!(degrees(32.767), Saturated { value: 32_767, cut: false });
        assert_eq!(degrees(32.8), Saturated { value: 32_767, cut: true });
        assert_eq!(degrees(-40.0), Saturated { value: -32_768, cut: true });
    }

    /// With the denominator that one driver writes, the same i16 reaches 131°/s.
    #[test]
    fn the_velocity_scale_follows_the_dimension_factor_read_back() {
        assert_eq!(SCALE.at(1, 24_000), Some(4.0));
        assert_eq!(SCALE.at(0, 6000), None);
        assert_eq!(SCALE.at(1, -1), None);
    }

    #[test]
    fn nan_is_cut_to_zero_and_reported() {
        assert_eq!(to_i32(f64::NAN), Saturated { value: 0, cut: true });
        assert_eq!(to_i32(f64::INFINITY), Saturated { value: i32::MAX, cut: true });
    }

    /// A peer's torque scale was an integer division, 1000 / rated, and so zero.
    #[test]
    fn current_and_torque_are_inverse_with_the_joints_sign() {
        let raw = UNITS.per_mille(2.0);
        assert_eq!(raw, Saturated { value: -400, cut: false });
        assert!((UNITS.current(raw.value) - 2.0).abs() < 1e-12);
        assert!((UNITS.torque(1000) + 1.409).abs() < 1e-12);
        assert!((UNITS.torque(1) + 0.001_409).abs() < 1e-12);
    }
}
