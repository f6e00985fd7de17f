//! The figures of an effect in words: each with its unit and, where the fit gives one, its standard error.

use super::ByJoint;

/// How the figures of an effect are written.
#[derive(Clone, Copy, Debug)]
pub struct Words<'a> {
    /// Whether its joints slide, so that torques are forces and angles are distances.
    pub slides: bool,
    /// Standard errors of its sizes, each a share of it; `None` where none is known.
    pub relative_std: &'a [Option<f64>],
}

impl Words<'_> {
    /// The unit of torques.
    #[must_use]
    pub fn torque(&self) -> &'static str {
        if self.slides { "N" } else { "N·m" }
    }

    /// The unit of positions.
    #[must_use]
    pub fn position(&self) -> &'static str {
        if self.slides { "m" } else { "rad" }
    }

    /// One of several sizes with its standard error, both times a factor.
    #[must_use]
    pub fn size(&self, which: usize, value: f64) -> String {
        with_error(value, self.relative_std.get(which).copied().flatten())
    }

    /// All sizes, times a factor.
    #[must_use]
    pub fn sizes(&self, values: &[f64], factor: f64) -> String {
        list(values.iter().enumerate().map(|(which, value)| self.size(which, factor * value)))
    }
}

/// Parts of one sentence.
pub(super) fn list(parts: impl IntoIterator<Item = String>) -> String {
    parts.into_iter().collect::<Vec<_>>().join(", ")
}

/// Numbers without an error.
pub(super) fn numbers(ByJoint(values): &ByJoint) -> String {
    list(values.iter().map(|value| number(*value)))
}

/// A number with three significant digits, as a reader wants it in a table: `0.0123`, `1.23`, `123`.
#[must_use]
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    let magnitude = value.abs().log10().floor();
    let text = if (-4.0..5.0).contains(&magnitude) {
        let decimals = (2.0 - magnitude).max(0.0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    };
    typographic(&text)
}

/// A value to the digits that are known of it: `0.061 ± 0.002`; without a standard error three digits.
#[must_use]
pub fn with_error(value: f64, relative_std: Option<f64>) -> String {
    let std = relative_std.map_or(f64::NAN, |share| (share * value).abs());
    if !(std.is_finite() && std > 0.0 && (1e-6..1e6).contains(&std)) {
        return number(value);
    }
    // One digit of the error; two where that digit is 1.
    let first = std.log10().floor();
    let digit = (std / 10f64.powf(first)).round();
    let decimals = (if digit <= 1.0 { 1.0 - first } else { -first }).max(0.0) as usize;
    typographic(&format!("{value:.decimals$} ± {std:.decimals$}"))
}

/// A real minus sign, which has the width of a digit.
#[must_use]
pub fn typographic(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_digits_that_its_error_leaves() {
        for (value, relative_std, text) in [
            (0.061_23, Some(0.033), "0.061 ± 0.002"),
            (14_870.0, Some(0.02), "14870 ± 297"),
            (1.234_56, Some(0.01), "1.235 ± 0.012"),
            (-0.5, Some(0.6), "−0.5 ± 0.3"),
            (0.000_479_999_999_999_999_96, None, "0.000480"),
            (3.0, Some(f64::NAN), "3.00"),
        ] {
            assert_eq!(with_error(value, relative_std), text);
        }
    }

    #[test]
    fn numbers_keep_three_digits() {
        for (value, text) in [
            (0.0123456, "0.0123"),
            (-1.0, "−1.00"),
            (123.4, "123"),
            (4e-7, "4.00e−7"),
            (f64::NAN, "–"),
            (0.0, "0"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
