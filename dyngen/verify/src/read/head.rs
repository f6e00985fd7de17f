//! What the head of a generated file says: of which arm and set it is, and what its rounded constants stand
//! for.

use crate::angles::constant_angles;
use crate::language::Exact;
use crate::{Checked, wrong};
use dyngen_arm::Arm;
use dyngen_arm::exact::angle::Angle;
use dyngen_arm::exact::rational::{self, Rational, integer, parse_rational, to_f64};
use dyngen_arm::exact::symbols::AngleSymbols;
use num_traits::{Signed, Zero};

/// The head of a file.
#[derive(Debug)]
pub(crate) struct Head {
    /// The hash of the arm's description.
    pub(crate) arm: String,
    /// The name of the parameter set.
    pub(crate) set: String,
}

/// What comments begin with in the languages of generated files.
fn comment(line: &str) -> Option<&str> {
    let line = line.strip_prefix("//").or(line.strip_prefix("/*")).or(line.strip_prefix(" *"))?;
    Some(line.strip_suffix("*/").unwrap_or(line).trim())
}

/// The comments that a file begins with, each with its line.
fn comments(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().map_while(comment).enumerate().map(|(i, line)| (i + 1, line))
}

impl Head {
    pub(crate) fn read(text: &str) -> Checked<Head> {
        let found = comments(text).find_map(|(line, text)| Some((line, text.strip_prefix("Arm: ")?)));
        let Some((line, rest)) = found else {
            return wrong(1, "no line '// Arm: …' at the head: dyngen did not write this file");
        };
        let (arm, rest) = rest.split_once(' ').unwrap_or((rest, ""));
        let set = rest.split_once("Parameter set: ").map(|(_, set)| set.trim_end_matches('.'));
        match set.filter(|set| ["full", "minimal", "symbolic", "published"].contains(set)) {
            Some(set) => Ok(Head { arm: arm.to_string(), set: set.to_string() }),
            None => wrong(line, "no parameter set is named here"),
        }
    }
}

/// Integers up to here are doubles, and no constant of an arm is larger.
const EXACT_INTEGERS: f64 = 9_007_199_254_740_992.0;

/// Digits that every double is printed with, or fewer.
const MOST_DIGITS: usize = 17;

/// What the constants of a file stand for where that is not what their digits say.
#[derive(Debug, Default)]
pub(crate) struct Literals(Vec<Meaning>);

#[derive(Debug)]
struct Meaning {
    literal: f64,
    /// Function and name, where the same digits stand for other numbers elsewhere.
    place: Option<String>,
    exact: Exact,
}

impl Literals {
    /// The lines `Rounded: LITERAL is EXACT` of the head, each of which must be true.
    pub(crate) fn read(text: &str, arm: &Arm) -> Checked<Literals> {
        let symbols = &constant_angles(arm);
        let rounded = comments(text).filter_map(|(line, text)| Some((line, text.strip_prefix("Rounded: ")?)));
        let meaning = |(line, text): (usize, &str)| {
            let parts = text.split_once(" is ").and_then(|(l, rest)| Some((l.parse::<f64>().ok()?, rest)));
            let Some((literal, rest)) = parts else {
                return wrong(line, "'Rounded: LITERAL is NUMBER' is expected");
            };
            let (exact, place) = match rest.split_once(" in ") {
                Some((exact, place)) => (exact, Some(place.to_string())),
                None => (rest, None),
            };
            match exact_of(exact, literal, symbols) {
                Some(exact) => Ok(Meaning { literal, place, exact }),
                None => wrong(line, &format!("{literal} is not {exact} rounded")),
            }
        };
        Ok(Literals(rounded.map(meaning).collect::<Checked<_>>()?))
    }

    /// What a literal stands for at `place`, a function and a name in it; what its digits say where the head
    /// says nothing. Nothing where they are none of a double: with a factor that is the prime a term would
    /// vanish.
    pub(crate) fn exact(&self, digits: &str, place: &str) -> Option<Exact> {
        let value: f64 = digits.parse().ok()?;
        let mantissa = digits.split('e').next()?.trim_start_matches(['0', '.']);
        let count = mantissa.bytes().filter(u8::is_ascii_digit).count();
        if value.abs() >= EXACT_INTEGERS || count > MOST_DIGITS || value == 0.0 && count > 0 {
            return None;
        }
        let of = || self.0.iter().filter(|m| m.literal == value);
        let here = of().find(|m| m.place.as_deref() == Some(place)).or(of().find(|m| m.place.is_none()));
        match here {
            Some(meaning) => Some(meaning.exact.clone()),
            None => Some(Exact::Number(parse_rational(digits).ok()?, Rational::zero())),
        }
    }

    /// Whether a literal has more digits than a number that was not rounded, and the head does not explain
    /// it.
    pub(crate) fn is_unexplained(&self, digits: &str) -> bool {
        let plain = digits.trim_matches('0').bytes().filter(u8::is_ascii_digit).count();
        plain > 15 && digits.parse().is_ok_and(|value: f64| !self.0.iter().any(|m| m.literal == value))
    }
}

/// The number that a text stands for, where `literal` is that number rounded.
fn exact_of(text: &str, literal: f64, symbols: &AngleSymbols) -> Option<Exact> {
    let rounded = rational::from_f64(literal)?;
    // Some units of the last place, and what rounding an angle of some size changes its sine by.
    let near = |value: &Rational, ulps: i64, angle: Rational| {
        let ulp = rational::from_f64(literal.next_up())? - &rounded;
        let change = angle * rational::from_f64(f64::EPSILON / 2.0)?;
        ((value - &rounded).abs() <= ulp * integer(ulps) + change).then_some(())
    };
    if text == "this f64" {
        return Some(Exact::Number(rounded, Rational::zero()));
    }
    if let Some((function, angle)) = text.strip_suffix(')').and_then(|t| t.split_once('(')) {
        let index = symbols.angles.iter().position(|a| a.to_string() == angle)?;
        let (sine, cosine) = sine_and_cosine(&symbols.angles[index]);
        let value = match function {
            "sin" => sine,
            "cos" => cosine,
            _ => return None,
        };
        near(&value, 1, radians(&symbols.angles[index]).abs())?;
        return Some(Exact::Symbol(index, function == "sin"));
    }
    if let Some(angle) = text.strip_prefix("the angle ") {
        let (number, turns) = match angle.strip_suffix("*pi") {
            None => (parse_rational(angle).ok()?, Rational::zero()),
            Some(both) => match both.split_once(" + ") {
                Some((number, turns)) => (parse_rational(number).ok()?, parse_rational(turns).ok()?),
                None => (Rational::zero(), parse_rational(both).ok()?),
            },
        };
        // Sums of rounded angles are rounded again.
        near(&(&number + &turns * pi()), 4, Rational::zero())?;
        return Some(Exact::Number(number, turns));
    }
    let (numerator, denominator) = text.split_once('/').unwrap_or((text, "1"));
    let denominator: dashu_int::IBig = denominator.parse().ok()?;
    if denominator.is_zero() {
        return None;
    }
    let value = rational::ratio(numerator.parse::<dashu_int::IBig>().ok()?, denominator);
    (to_f64(&value) == literal).then_some(Exact::Number(value, Rational::zero()))
}

/// To fifty digits.
fn pi() -> Rational {
    parse_rational("3.14159265358979323846264338327950288419716939937511").unwrap_or_default()
}

fn radians(angle: &Angle) -> Rational {
    match angle {
        Angle::PiMultiple(turns) => turns * pi(),
        Angle::Radians(x) => x.clone(),
    }
}

/// Far more exact than a double, by the power series.
fn sine_and_cosine(angle: &Angle) -> (Rational, Rational) {
    let x = radians(angle);
    let (mut term, mut sums) = (integer(1), [Rational::zero(), Rational::zero()]);
    let mut k = 0;
    while k < 20 || to_f64(&term).abs() > 1e-30 {
        let sign = integer(if k % 4 < 2 { 1 } else { -1 });
        sums[k % 2] += sign * &term;
        k += 1;
        term = term * &x / integer(k as i64);
    }
    let [cosine, sine] = sums;
    (sine, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_of_the_series_are_those_of_the_machine() {
        for text in ["pi/3", "pi/6", "0.7", "2.9"] {
            let angle = Angle::parse(text).unwrap();
            let (s, c) = sine_and_cosine(&angle);
            assert!((to_f64(&s) - angle.sin_cos().0).abs() < 2e-16, "{text}");
            assert!((to_f64(&c) - angle.sin_cos().1).abs() < 2e-16, "{text}");
        }
    }

    #[test]
    fn the_sine_of_a_rounded_angle_is_that_angles() {
        // The double of 1.1 is 1.1 + 8.9e-17: its cosine is more than a unit from that of 1.1.
        let symbols = AngleSymbols { angles: vec![Angle::parse("1.1").unwrap()] };
        let cosine = 1.1f64.cos();
        assert!(exact_of("cos(1.1)", cosine, &symbols).is_some());
        assert!(exact_of("cos(1.1)", cosine.next_down().next_down(), &symbols).is_none());
    }

    #[test]
    fn a_literal_must_be_what_the_head_says() {
        let symbols = AngleSymbols { angles: vec![Angle::parse("0.7").unwrap()] };
        let of = |text, literal| exact_of(text, literal, &symbols).is_some();
        assert!(of("1/3", 1.0 / 3.0) && !of("1/3", 0.333333333333333));
        assert!(
            of("sin(0.7)", 0.7f64.sin()) && !of("cos(0.7)", 0.7f64.sin()) && !of("sin(0.8)", 0.8f64.sin())
        );
        assert!(of("the angle 1/4*pi", 0.25 * std::f64::consts::PI) && !of("the angle 1/4*pi", 0.79));
        assert!(of("the angle -1/5 + 1/2*pi", -0.2 + 0.5 * std::f64::consts::PI));
        assert!(!of("1/0", 0.0) && of("this f64", 0.1));
    }
}
