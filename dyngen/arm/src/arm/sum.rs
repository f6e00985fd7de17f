//! Linear combinations of parameters as people write them: `Ixx2 - Iyy2 + 49/400*m3`.

use super::parameter::Parameter;
use crate::exact::rational::{self, Rational};
use num_traits::{One, Signed, Zero};
use std::collections::BTreeMap;

/// Reads a sum of parameters with exact coefficients: `Iyy1 + Izz3`, `mx2 - 0.35*m3`, `7/20*m3`.
///
/// Terms of the same parameter are added; the result is in the order of the parameters.
pub fn parse_sum(text: &str) -> Result<Vec<(Parameter, Rational)>, String> {
    let mut total: BTreeMap<Parameter, Rational> = BTreeMap::new();
    for (negative, term) in split_terms(text)? {
        let (coefficient, name) = match term.rsplit_once('*') {
            Some((number, name)) => (rational::parse_rational(number)?, name.trim()),
            None => (Rational::one(), term.as_str()),
        };
        let parameter = Parameter::parse(name).ok_or_else(|| {
            format!(
                "'{name}' names no parameter: they are m mx my mz Ixx Ixy Ixz Iyy Iyz Izz Im with the \
                link's number, as in Iyy2"
            )
        })?;
        let signed = if negative { -coefficient } else { coefficient };
        *total.entry(parameter).or_insert_with(Rational::zero) += signed;
    }
    total.retain(|_, coefficient| !coefficient.is_zero());
    if total.is_empty() {
        return Err("the sum is empty".to_string());
    }
    Ok(total.into_iter().collect())
}

/// Splits at the signs that stand between terms, not at those of an exponent.
fn split_terms(text: &str) -> Result<Vec<(bool, String)>, String> {
    let mut terms: Vec<(bool, String)> = Vec::new();
    let (mut negative, mut current, mut previous) = (false, String::new(), ' ');
    for c in text.chars() {
        let exponent = matches!(previous, 'e' | 'E')
            && current.trim_start().starts_with(|d: char| d.is_ascii_digit() || d == '.');
        if matches!(c, '+' | '-') && !exponent {
            if !current.trim().is_empty() {
                terms.push((negative, current.trim().to_string()));
                negative = c == '-';
            } else if terms.is_empty() && previous == ' ' {
                negative = c == '-';
            } else {
                return Err(format!("two signs follow each other in '{text}'"));
            }
            current.clear();
            previous = '+';
            continue;
        }
        current.push(c);
        if !c.is_whitespace() {
            previous = c;
        }
    }
    if current.trim().is_empty() {
        return Err(if terms.is_empty() {
            "the sum is empty".into()
        } else {
            format!("'{text}' ends with a sign")
        });
    }
    terms.push((negative, current.trim().to_string()));
    Ok(terms)
}

/// Writes a linear combination as people do: `Ixx2 - Iyy2 + 49/400*m3`; `0` where it is empty.
pub fn sum_text<'a, N: std::fmt::Display>(terms: impl IntoIterator<Item = (N, &'a Rational)>) -> String {
    let mut text = String::new();
    for (name, coefficient) in terms {
        let magnitude = coefficient.abs();
        text.push_str(match (text.is_empty(), coefficient.is_negative()) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        });
        if !magnitude.is_one() {
            text.push_str(&rational::to_text(&magnitude));
            text.push('*');
        }
        text.push_str(&name.to_string());
    }
    if text.is_empty() { "0".to_string() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_read_exactly_and_printed_back() {
        for text in ["Iyy1 + Iyy2 + Izz3 + Im1", "mx2 - 7/20*m3", "-Ixx4 + 2*Izz4", "49/400*m3 - Iyy2"] {
            let sum = parse_sum(text).unwrap();
            let printed = sum_text(sum.iter().map(|(p, c)| (p, c)));
            assert_eq!(parse_sum(&printed).unwrap(), sum, "{text} became {printed}");
        }
        let sum = parse_sum("mx2 - 0.35*m3 + 1e-1*m3").unwrap();
        assert_eq!(rational::to_text(&sum.iter().find(|(p, _)| p.to_string() == "m3").unwrap().1), "-1/4");
    }

    #[test]
    fn nonsense_is_refused_with_a_reason() {
        for (bad, reason) in [
            ("", "empty"),
            ("m1 +", "ends"),
            ("m1 ++ m2", "signs"),
            ("x1", "names no"),
            ("2*", "names no"),
            ("m1 - m1", "empty"),
        ] {
            let error = parse_sum(bad).unwrap_err();
            assert!(error.contains(reason), "'{bad}': {error}");
        }
    }
}
