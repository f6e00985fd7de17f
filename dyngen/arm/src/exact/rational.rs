//! Rational numbers, and decimals that are read exactly: 0.305 is 61/200.

use dashu_int::IBig;
use dashu_ratio::RBig;
use num_traits::Signed;

/// An exact rational number of any size.
pub type Rational = RBig;

/// Powers of ten beyond this are not a length, mass or angle, and would only fill the memory.
const LARGEST_EXPONENT: i64 = 60;
/// Longer literals are refused for the same reason.
const LONGEST_LITERAL: usize = 80;

/// Reads an integer, a decimal with or without exponent, or a fraction `p/q`, exactly.
///
/// Returns the reason as text if `text` is none of these.
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
    let value = IBig::from_str_radix(&all, 10).map_err(|_| not_a_number())? * sign;
    let shift = exponent - fraction.len() as i64;
    // The exponent and the digits are few.
    let power = IBig::from(10).pow(shift.unsigned_abs() as usize);
    Ok(if shift >= 0 { Rational::from(value * power) } else { ratio(value, power) })
}

/// The nearest `f64`.
pub fn to_f64(value: &Rational) -> f64 {
    // Decimal input stays the f64 that the same literal gives: both round the exact value once.
    value.to_f64().value()
}

/// The text of a coefficient: `1`, `-49/400`.
pub fn to_text(value: &Rational) -> String {
    if is_integer(value) {
        value.numerator().to_string()
    } else {
        format!("{}/{}", value.numerator(), value.denominator())
    }
}

/// Shorthand for small integers.
pub fn integer(value: i64) -> Rational {
    Rational::from(value)
}

/// p/q for q other than zero.
pub fn ratio(p: impl Into<IBig>, q: impl Into<IBig>) -> Rational {
    Rational::from_parts_signed(p.into(), q.into())
}

/// The denominator, above zero.
pub fn denominator(value: &Rational) -> IBig {
    value.denominator().clone().into()
}

/// The value of a finite `f64`.
pub fn from_f64(value: f64) -> Option<Rational> {
    Rational::try_from(value).ok()
}

/// Whether it is a whole number.
pub fn is_integer(value: &Rational) -> bool {
    value.denominator().is_one()
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
