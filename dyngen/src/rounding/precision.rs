//! What one operation rounds, in single and in double precision.

use crate::exact::rational::{self, Rational};

/// A floating-point format that emitted code runs in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// `f32`
    Single,
    /// `f64`
    Double,
}

impl Precision {
    /// Half the distance between one and the next number.
    pub(super) const fn unit(self) -> f64 {
        match self {
            Precision::Single => 0.5 * f32::EPSILON as f64,
            Precision::Double => 0.5 * f64::EPSILON,
        }
    }

    /// At most what rounding a number of that size or less to the nearest changes: half a unit in the last
    /// place, also where the result is subnormal.
    #[inline]
    pub(super) fn half_ulp(self, magnitude: f64) -> f64 {
        // The power of two at or below; the smallest subnormal number of the format on top.
        let power = f64::from_bits(magnitude.to_bits() & (0x7ff << 52));
        match self {
            Precision::Single => power * self.unit() + SUBNORMAL_SINGLE,
            Precision::Double => power * self.unit() + f64::MIN_POSITIVE,
        }
    }

    /// A number of 53 bits in this format.
    fn round(self, x: f64) -> f64 {
        match self {
            Precision::Single => f64::from(x as f32),
            Precision::Double => x,
        }
    }

    /// How far a constant of the emitted code is from the number that it stands for: it is written as a
    /// double, and converted.
    pub(super) fn of_constant(self, exact: &Rational) -> f64 {
        let written = rational::to_f64(exact);
        let is_exact = rational::from_f64(written).as_ref() == Some(exact);
        let of_text = if is_exact { 0.0 } else { Precision::Double.half_ulp(written.abs()) };
        self.of_double(written, of_text)
    }

    /// As [`Self::of_constant`], for a double that is known within `error`.
    pub(super) fn of_double(self, written: f64, error: f64) -> f64 {
        let converted = (self.round(written) - written).abs();
        if converted + error == 0.0 { 0.0 } else { (converted + error) * (1.0 + 4.0 * f64::EPSILON) }
    }
}

/// Both.
pub(super) const PRECISIONS: [Precision; 2] = [Precision::Single, Precision::Double];

/// Of `f32`: 2⁻¹⁴⁹.
const SUBNORMAL_SINGLE: f64 = f32::MIN_POSITIVE as f64 * f32::EPSILON as f64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::rational::parse_rational;

    #[test]
    fn rounding_is_half_a_unit_of_the_last_place_and_never_more() {
        let single = |x: f64| (f64::from(x as f32) - x).abs();
        for k in 0..2000 {
            let x = (1.0 + f64::from(k) * 0.000_911_7).powi(37);
            let bound = Precision::Single.half_ulp(x);
            assert!(single(x) <= bound, "{x}");
        }
        assert_eq!(Precision::Single.half_ulp(1.9) as f32, 0.5 * f32::EPSILON);
        assert!(Precision::Single.half_ulp(1e-42) >= single(1e-42 + 0.6e-45));
    }

    #[test]
    fn a_constant_errs_by_what_its_text_and_its_format_round() {
        let of = |text: &str, precision: Precision| precision.of_constant(&parse_rational(text).unwrap());
        assert_eq!(of("0.5", Precision::Single), 0.0);
        assert!((of("0.1", Precision::Single) - 1.49e-9).abs() < 0.01e-9);
        assert!(of("0.1", Precision::Double) > 5e-18 && of("0.1", Precision::Double) < 1e-17);
    }
}
