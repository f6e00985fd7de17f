//! Detects when a torque model no longer holds: a sequential test of its innovations with a stated rate of
//! false alarms.
//!
//! **Innovations** ([`Joint`]). A joint's residual r (measured less predicted torque) has a colour: r(t) − Σ
//! a_k·r(t−k) is what its past could not predict, and over its deviation σ it is z. Friction wanders by ±
//! range of itself without a change; it does so slowly, so it is followed: z(t) − ρ(t)·f(t), with f the
//! friction through the same filter and ρ its share by least squares over the last [`FOLLOWED`] samples,
//! within ± range, is the innovation.
//!
//! **The null hypothesis**: given all before it and the whole motion, the mean of the innovation, cut at
//! −[`LOSS`] and [`GAIN`], is at most m(t), and so is that of its negative, cut alike; m = margin +
//! [`SLIP`]·range·|f(t)|. The margin is the model's error even where nothing has changed, the rest by how
//! much a friction that wanders over its range within minutes is ahead of what was followed. Nothing else is
//! assumed: no normal distribution, no variance, no independence of joints. (The means of normal innovations
//! that are cut so are 0.0085, less than [`LEAST_MARGIN`].)
//!
//! **The test** ([`Bet`]) bets against it. A change adds Σ c_i·x_i to the torques: x are columns that are
//! known (a kilogram in the hand, a radian of a joint's zero), c is its size, which is not. The bet takes c
//! from the samples before: least squares over the last [`WINDOW`], so it is known before the sample that it
//! is put on. With μ_j = Σ c_i·x_ij the share λ_j ∝ |μ_j| − m_j goes on joint j, in the direction of μ_j, and
//! the capital is multiplied by 1 + Σ λ_j·(±z_j − m_j), z cut. A lasting model error along x is not a change:
//! its size over the last minute is followed as friction is, and z is less that as well. Under the null the
//! mean of that factor is at most 1, whichever joints depend on each other and whenever the bet began: it is
//! an e-process. A new bet starts at every sample, with a capital b ≤ 1 that is known before, and all its
//! beginnings together have C ← (C + b)·factor (e-SR). Under the null the mean of C grows by at most 1 a
//! sample, and so does that of an average of C over bets. The alarm rises when the average exceeds A
//! ([`alarm`]): then the mean time to a false alarm is at least A samples, whatever the noise is like (J.
//! Shin, A. Ramdas, A. Rinaldo, "E-detectors: a nonparametric framework for sequential change detection",
//! 2022; I. Waudby-Smith, A. Ramdas, "Estimating means of bounded random variables by betting", 2023).

mod bet;
mod joint;

pub use bet::{Bet, Term};
pub use joint::{Colour, Innovation, Joint, Whitener};

use nalgebra::RealField;

/// Past values in a colour.
pub const ORDER: usize = 6;
/// An innovation against a bet counts up to this many standard deviations …
pub const LOSS: f64 = 2.0;
/// … and one for it up to this many: a clear change shows within a few samples.
pub const GAIN: f64 = 8.0;
/// No margin is less: cutting more on one side moves a mean a little.
pub const LEAST_MARGIN: f64 = 0.02;
/// Friction is followed over this many samples.
pub const FOLLOWED: f64 = 500.0;
/// Share of its range by which friction may be ahead of the followed value.
pub const SLIP: f64 = 0.1;
/// The size of a change is computed over this many samples.
pub const WINDOW: f64 = 25.0;

/// How a bet stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing<T> {
    /// The bet's share of all: shares add up to 1.
    pub weight: T,
    /// The bet's capital.
    pub capital: T,
    /// The number of the sample with which its best beginning was.
    pub since: u64,
}

/// A model that no longer holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alarm<T> {
    /// The place of the bet that says most.
    pub bet: usize,
    /// The number of the sample at which the change began, in the numbering of the bets.
    pub since: u64,
    /// The average capital of all bets over the level.
    pub capital: T,
}

/// The alarm of bets together: the mean time to a false one is at least `level` samples.
pub fn alarm<T: RealField + Copy>(bets: impl IntoIterator<Item = Standing<T>>, level: T) -> Option<Alarm<T>> {
    let (mut sum, mut best) = (T::zero(), None::<(usize, T, u64)>);
    for (place, Standing { weight, capital, since }) in bets.into_iter().enumerate() {
        let own = weight * capital;
        sum += own;
        if best.is_none_or(|(_, most, _)| own > most) {
            best = Some((place, own, since));
        }
    }
    let (bet, _, since) = best?;
    (sum >= level).then(|| Alarm { bet, since, capital: sum / level })
}

#[cfg(test)]
mod tests;
