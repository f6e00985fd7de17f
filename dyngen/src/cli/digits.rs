//! How many digits of a number are shown: six, or all of them.

use dyngen::arm::sum::sum_text;
use dyngen::arm::{Angle, Parameter};
use dyngen::exact::constant::{Constant, ConstantField};
use dyngen::exact::rational;

/// An exact coefficient of more characters is shown in six digits: 49/400 stays, 6863823083365249/1000000…
/// not.
const SHORT: usize = 12;
/// Of a relation that is text already.
const LONGEST: usize = 160;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Digits {
    Six,
    All,
}

impl Digits {
    pub(super) fn number(self, x: f64) -> String {
        match self {
            Digits::All => x.to_string(),
            Digits::Six => six(x),
        }
    }

    pub(super) fn angle(self, angle: &Angle) -> String {
        match angle {
            Angle::Radians(x) => self.number(rational::to_f64(x)),
            Angle::PiMultiple(_) => angle.to_string(),
        }
    }

    /// A sum of parameters, whose exact text is `name`.
    pub(super) fn sum(self, field: &ConstantField, terms: &[(Parameter, Constant)], name: &str) -> String {
        let short = |c: &Constant| field.text(c).chars().count() <= SHORT;
        if self == Digits::All || terms.iter().all(|(_, c)| short(c)) {
            return name.to_string();
        }
        // Few rationals are left by then: each coefficient is written as a number.
        let written = |(parameter, c): &(Parameter, Constant)| match c.as_rational().filter(|_| short(c)) {
            Some(exact) => (parameter.to_string(), exact),
            None => {
                let (sign, size) = (field.value(c) < 0.0, six(field.value(c).abs()));
                (format!("{size}*{parameter}"), rational::integer(if sign { -1 } else { 1 }))
            }
        };
        let written: Vec<(String, rational::Rational)> = terms.iter().map(written).collect();
        sum_text(written.iter().map(|(name, sign)| (name, sign)))
    }

    /// A text, cut where it is long.
    pub(super) fn text(self, text: &str) -> String {
        match text.char_indices().nth(LONGEST) {
            Some((end, _)) if self == Digits::Six => format!("{} … (--exact shows all)", &text[..end]),
            _ => text.to_string(),
        }
    }
}

/// Six significant digits.
fn six(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let size = x.abs().log10().floor() as i32;
    if !(-5..6).contains(&size) {
        let text = format!("{x:.5e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'));
    }
    let digits = (5 - size).max(0) as usize;
    let text = format!("{x:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn six_digits_and_no_zeros_behind_them() {
        for (x, text) in [
            (0.0891589999961, "0.089159"),
            (-1.570279330556899, "-1.57028"),
            (6.863823083365249e-9, "6.86382e-9"),
            (0.35, "0.35"),
            (160.0, "160"),
            (123456.7, "123457"),
            (1e-12, "1e-12"),
        ] {
            assert_eq!(super::six(x), text);
        }
    }
}
