//! How often a name with such evidence is right: a curve that was fitted to arms whose effects are known.

use super::super::named::NamedEffect;

/// What is known of a name besides what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Its penalised gain over that of the next best name.
    pub margin: f64,
    /// Whether another name fits as well.
    pub alike: bool,
    /// Share of the excess over noise that stays on its joints.
    pub leftover: f64,
}

/// Numbers that the logit of the probability is linear in.
pub const FEATURES: usize = 4;

/// What they are weighted with: logistic regression (D. R. Cox, "The regression analysis of binary sequences", 1958) on one
/// half of drawn arms, judged on the other half. `cargo run --release -p xtask -- probability` fits them anew.
const COEFFICIENTS: [f64; FEATURES] = [1.74, 2.36, 1.81, -2.71];

/// A larger margin says no more.
const LARGEST_MARGIN: f64 = 20.0;
/// Some hundred names cannot speak of less than one in a hundred.
const SUREST: f64 = 0.99;

impl Evidence {
    /// What is known of a name that was given.
    pub(super) fn of(effect: &NamedEffect) -> Evidence {
        let alike = effect.rivals.iter().any(|rival| rival.alike);
        Evidence { margin: effect.margin, alike, leftover: effect.leftover }
    }

    /// 1, whether another name fits as well, the logarithm of the margin, and what is left over.
    #[must_use]
    pub fn features(&self) -> [f64; FEATURES] {
        let margin = within(self.margin, [1.0, LARGEST_MARGIN]).ln();
        // By what is gone, since what is no number counts as the lower end.
        let leftover = 1.0 - within(1.0 - self.leftover, [0.0, 1.0]);
        [1.0, f64::from(u8::from(self.alike)), margin, leftover]
    }

    /// How often such a name is right, or where another one fits as well, how often one of them is.
    #[must_use]
    pub fn probability(&self) -> f64 {
        let logit: f64 = COEFFICIENTS.iter().zip(self.features()).map(|(c, x)| c * x).sum();
        (1.0 / (1.0 + (-logit).exp())).min(SUREST)
    }
}

/// What is no number counts as the lower end, which `clamp` would keep.
#[allow(clippy::manual_clamp)]
fn within(x: f64, [low, high]: [f64; 2]) -> f64 {
    x.max(low).min(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLEAR: Evidence = Evidence { margin: 5.0, alike: false, leftover: 0.02 };

    #[test]
    fn less_evidence_makes_no_name_more_probable() {
        let sure = CLEAR.probability();
        assert!(sure > 0.9 && sure <= SUREST, "{sure}");
        for worse in [Evidence { margin: 1.05, ..CLEAR }, Evidence { leftover: 0.6, ..CLEAR }] {
            assert!(worse.probability() < sure, "{worse:?}: {} against {sure}", worse.probability());
        }
    }

    #[test]
    fn what_is_no_number_is_no_evidence() {
        let nothing = Evidence { margin: f64::NAN, leftover: f64::NAN, ..CLEAR };
        let least = Evidence { margin: 1.0, leftover: 1.0, ..CLEAR };
        assert_eq!(nothing.probability(), least.probability());
        let endless = Evidence { margin: f64::INFINITY, ..CLEAR };
        assert!(endless.probability() >= CLEAR.probability());
    }
}
