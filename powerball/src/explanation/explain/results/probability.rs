//! How often such a name is right: a curve over what is known of it.

/// What is known of a name besides what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Its penalised gain over that of the next best name.
    pub margin: f64,
    /// Whether another name fits as well.
    pub alike: bool,
    /// The share of its squared torque that no other column can take over.
    pub own_share: f64,
    /// Share of the excess over noise that stays on its joints.
    pub leftover: f64,
    /// How long the fitted logs are, s.
    pub fitted_time: f64,
}

/// Numbers that the curve is linear in.
pub const FEATURES: usize = 6;

/// A larger margin says no more.
const LARGEST_MARGIN: f64 = 20.0;
/// Nor does a smaller share of its own.
const LEAST_SHARE: f64 = 0.01;

impl Evidence {
    /// What the logit of the probability is linear in: 1, whether another name fits as well, the logarithms of the margin
    /// and of the own share, what is left over, the logarithm of the time in minutes.
    #[must_use]
    pub fn features(&self) -> [f64; FEATURES] {
        [
            1.0,
            f64::from(u8::from(self.alike)),
            self.margin.clamp(1.0, LARGEST_MARGIN).ln(),
            self.own_share.clamp(LEAST_SHARE, 1.0).ln(),
            self.leftover.clamp(0.0, 1.0),
            (self.fitted_time / 60.0).clamp(0.1, 10.0).ln(),
        ]
    }
}
