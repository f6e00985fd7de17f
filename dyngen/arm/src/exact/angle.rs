//! Angles, exact if the file gives them exactly.

use super::rational::{self, Rational};
use dashu_int::IBig;
use num_traits::{FromPrimitive, One, Signed, Zero};
use std::f64::consts::{PI, TAU};
use std::fmt;

/// A constant angle of the kinematics, in radians.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Angle {
    /// A rational multiple of pi: exact.
    PiMultiple(Rational),
    /// Any other angle, in radians: its sine and cosine are kept as symbols with s² + c² = 1.
    Radians(Rational),
}

impl Angle {
    /// The angle zero.
    pub fn zero() -> Self {
        Angle::PiMultiple(Rational::zero())
    }

    /// Σ factor·angle: exact where all are multiples of pi, else in radians.
    pub fn sum(terms: &[(Angle, Rational)]) -> Angle {
        let (mut multiple, mut radians) = (Rational::zero(), Rational::zero());
        for (angle, factor) in terms {
            match angle {
                Angle::PiMultiple(x) => multiple += x * factor,
                Angle::Radians(x) => radians += x * factor,
            }
        }
        if radians.is_zero() {
            return Angle::PiMultiple(multiple);
        }
        // pi is not a rational; what is added to a number of radians is as near to it as a number can be.
        let turn = rational::from_f64(Angle::PiMultiple(multiple).radians()).unwrap_or_default();
        Angle::from_radians(radians + turn)
    }

    /// The number of quarter turns, 0 to 3, where the angle is a multiple of pi/2.
    pub fn quarter_turns(&self) -> Option<u8> {
        let Angle::PiMultiple(multiple) = self else { return None };
        let quarters = multiple * rational::integer(2);
        if !rational::is_integer(&quarters) {
            return None;
        }
        let four = dashu_int::IBig::from(4);
        let turns = ((quarters.numerator() % &four) + &four) % &four;
        u8::try_from(turns).ok()
    }

    /// The value in radians.
    pub fn radians(&self) -> f64 {
        match self {
            Angle::PiMultiple(multiple) => rational::to_f64(multiple) * PI,
            Angle::Radians(value) => rational::to_f64(value),
        }
    }

    /// Sine and cosine; exact zeros and ones where the angle is a multiple of pi/2.
    pub fn sin_cos(&self) -> (f64, f64) {
        match self.quarter_turns() {
            Some(0) => (0.0, 1.0),
            Some(1) => (1.0, 0.0),
            Some(2) => (0.0, -1.0),
            Some(_) => (-1.0, 0.0),
            None => self.radians().sin_cos(),
        }
    }

    /// Reads `pi`, `-pi/2`, `3*pi/4`, `2pi`, `0`, or a plain number of radians.
    pub fn parse(text: &str) -> Result<Angle, String> {
        let compact: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        let wrong = || {
            format!(
                "'{text}' is not an angle: write a number of radians, or a rational multiple of pi such as \
                 \"pi/2\", \"-pi/2\" or \"3*pi/4\""
            )
        };
        let Some((before, after)) = compact.split_once("pi") else {
            let value = rational::parse_rational(&compact).map_err(|_| wrong())?;
            return Ok(Angle::from_radians(value));
        };
        let factor = match before {
            "" | "+" => rational::integer(1),
            "-" => rational::integer(-1),
            number => {
                let number = number.strip_suffix('*').unwrap_or(number);
                rational::parse_rational(number).map_err(|_| wrong())?
            }
        };
        let divisor = match after.strip_prefix('/') {
            None if after.is_empty() => rational::integer(1),
            None => return Err(wrong()),
            Some(number) => rational::parse_rational(number).map_err(|_| wrong())?,
        };
        if divisor.is_zero() {
            return Err(format!("'{text}' divides by zero"));
        }
        Ok(Angle::PiMultiple(factor / divisor))
    }

    /// A number of radians; zero is the one such number that is an exact multiple of pi.
    pub fn from_radians(value: Rational) -> Angle {
        if value.is_zero() { Angle::zero() } else { Angle::Radians(value) }
    }

    /// A word of warning where a number of radians looks like a rounded quarter turn.
    pub fn looks_rounded(&self) -> Option<String> {
        let Angle::Radians(value) = self else { return None };
        let value = rational::to_f64(value);
        let quarters = (value / (PI / 2.0)).round();
        let near = (value - quarters * PI / 2.0).abs() < 1e-4;
        (near && quarters != 0.0).then(|| {
            let exact = match quarters as i64 {
                1 => "pi/2".to_string(),
                -1 => "-pi/2".to_string(),
                2 => "pi".to_string(),
                -2 => "-pi".to_string(),
                other => format!("{other}*pi/2"),
            };
            format!(
                "{value} is close to {exact} but is kept as a general angle; write \"{exact}\" if that \
                is meant"
            )
        })
    }
}

impl fmt::Display for Angle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Angle::PiMultiple(m) if m.is_zero() => write!(f, "0"),
            Angle::PiMultiple(m) => {
                let sign = if m.is_negative() { "-" } else { "" };
                let numerator = m.numerator().abs();
                let factor = if numerator == 1.into() { String::new() } else { format!("{numerator}*") };
                write!(f, "{sign}{factor}pi")?;
                if !rational::is_integer(m) {
                    write!(f, "/{}", rational::denominator(m))?;
                }
                Ok(())
            }
            Angle::Radians(value) => write!(f, "{}", rational::to_f64(value)),
        }
    }
}

/// A rational point of the circle within 1e-12 rad of an angle: from the tangent of its half by its continued
/// fraction.
pub fn circle_point_near(angle: f64) -> (Rational, Rational) {
    let tangent = (angle.rem_euclid(TAU) / 2.0).tan();
    let mut rest = tangent;
    let (mut before, mut t) = ([IBig::zero(), IBig::one()], [IBig::one(), IBig::zero()]);
    for _ in 0..40 {
        let whole = rest.floor();
        let Some(count) = IBig::from_f64(whole) else { break };
        let next = [&count * &t[0] + &before[0], &count * &t[1] + &before[1]];
        (before, t) = (t, next);
        let value = rational::to_f64(&rational::ratio(t[0].clone(), t[1].clone()));
        if (value - tangent).abs() < 4e-13 * (1.0 + tangent * tangent) || rest == whole {
            break;
        }
        rest = 1.0 / (rest - whole);
    }
    let [p, q] = t;
    let (square, scale) = (&q * &q - &p * &p, &q * &q + &p * &p);
    (rational::ratio(&p * &q * 2, scale.clone()), rational::ratio(square, scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_of_pi_are_exact() {
        for (text, turns) in [
            ("pi", 2),
            ("-pi/2", 3),
            ("pi/2", 1),
            ("3*pi/2", 3),
            ("0", 0),
            ("2pi", 0),
            ("-2*pi", 0),
            ("+pi", 2),
        ] {
            assert_eq!(Angle::parse(text).unwrap().quarter_turns(), Some(turns), "{text}");
        }
        assert_eq!(Angle::parse("3*pi/4").unwrap().to_string(), "3*pi/4");
        assert_eq!(Angle::parse("pi/4").unwrap().quarter_turns(), None);
        for bad in ["90deg", "pi/0", "", "pi pi", "tau", "pi/x"] {
            assert!(Angle::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_rounded_quarter_turn_is_noticed_but_not_changed() {
        let angle = Angle::parse("1.5708").unwrap();
        assert_eq!(angle.quarter_turns(), None);
        assert!(angle.looks_rounded().unwrap().contains("pi/2"));
        assert!(Angle::parse("1.2").unwrap().looks_rounded().is_none());
    }

    #[test]
    fn a_point_of_the_circle_is_near_its_angle() {
        for k in -50..50 {
            let angle = 0.137 * f64::from(k);
            let (s, c) = circle_point_near(angle);
            assert_eq!(&s * &s + &c * &c, rational::integer(1));
            assert!(
                (rational::to_f64(&s) - angle.sin()).abs() < 2e-12
                    && (rational::to_f64(&c) - angle.cos()).abs() < 2e-12,
                "{angle}"
            );
        }
    }
}
