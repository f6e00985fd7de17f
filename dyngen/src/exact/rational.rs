//! Rational numbers, and decimals read as what they say: 0.305 is 61/200.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Pow, Signed, ToPrimitive, Zero};

/// An exact rational number of any size.
pub type Rational = BigRational;

/// Powers of ten beyond this are no length, mass or angle, and would only fill the memory.
const LARGEST_EXPONENT: i64 = 60;
/// Longer literals are refused for the same reason.
const LONGEST_LITERAL: usize = 80;

/// Reads an integer, a decimal with or without exponent, or a fraction `p/q`, exactly.
///
/// Returns the reason as text where `text` is none of these.
pub fn parse_rational(text: &str) -> Result<Rational, String> {
    let text = text.trim();
    if text.len() > LONGEST_LITERAL {
        return Err(format!("a number of more than {LONGEST_LITERAL} characters"));
    }
    if let Some((numerator, denominator)) = text.split_once('/') {
        let (p, q) = (parse_decimal(numerator)?, parse_decimal(denominator)?);
        if q.is_zero() {
            return Err(format!("'{text}' divides by zero"));
        }
        return Ok(p / q);
    }
    parse_decimal(text)
}

fn parse_decimal(text: &str) -> Result<Rational, String> {
    let not_a_number = || format!("'{text}' is not a number");
    let clean: String = text.trim().chars().filter(|c| *c != '_').collect();
    let (sign, digits) = match clean.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, clean.strip_prefix('+').unwrap_or(&clean)),
    };
    let (mantissa, exponent) = match digits.split_once(['e', 'E']) {
        Some((m, e)) => (m, e.parse::<i64>().map_err(|_| not_a_number())?),
        None => (digits, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let all: String = [whole, fraction].concat();
    if all.is_empty() || !all.bytes().all(|b| b.is_ascii_digit()) {
        return Err(not_a_number());
    }
    if exponent.abs() > LARGEST_EXPONENT {
        return Err(format!("the exponent of '{text}' is beyond ±{LARGEST_EXPONENT}"));
    }
    let value = BigInt::parse_bytes(all.as_bytes(), 10).ok_or_else(not_a_number)? * sign;
    let shift = exponent - fraction.len() as i64;
    let power = BigInt::from(10).pow(shift.unsigned_abs());
    Ok(if shift >= 0 { Rational::from_integer(value * power) } else { Rational::new(value, power) })
}

/// The nearest `f64`.
pub fn to_f64(value: &Rational) -> f64 {
    // Decimal input stays the f64 that the same literal gives: both round the exact value once.
    value.to_f64().unwrap_or(f64::NAN)
}

/// The text of a coefficient: `1`, `-49/400`.
pub fn to_text(value: &Rational) -> String {
    if value.is_integer() {
        value.numer().to_string()
    } else {
        format!("{}/{}", value.numer(), value.denom())
    }
}

/// Shorthand for small integers.
pub fn integer(value: i64) -> Rational {
    Rational::from_integer(BigInt::from(value))
}

/// `Some(sign)` where the value is ±1.
pub fn unit_sign(value: &Rational) -> Option<bool> {
    value.abs().is_one().then(|| value.is_negative())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_what_they_say() {
        assert_eq!(to_text(&parse_rational("0.305").unwrap()), "61/200");
        assert_eq!(to_text(&parse_rational("-1.2e1").unwrap()), "-12");
        assert_eq!(to_text(&parse_rational("7/20").unwrap()), "7/20");
        assert_eq!(to_text(&parse_rational("-2.5e-1").unwrap()), "-1/4");
        for bad in ["", ".", "nan", "inf", "1e999", "1/0", "abc", "1.2.3", "0x10", "--1"] {
            assert!(parse_rational(bad).is_err(), "{bad} was accepted");
        }
    }

    #[test]
    fn literals_round_as_the_compiler_rounds_them() {
        for (text, value) in [("0.35", 0.35), ("-9.81", -9.81), ("0.1225", 0.1225), ("1e-7", 1e-7)] {
            assert_eq!(to_f64(&parse_rational(text).unwrap()), value);
        }
    }
}
