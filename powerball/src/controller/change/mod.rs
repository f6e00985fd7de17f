//! Says when a torque model no longer holds: a sequential test of its innovations with a stated rate of false alarms.
//!
//! A joint's residual r (measured less predicted torque) has a colour: e(t) = r(t) − Σ a_k·r(t−k) is what nobody
//! could tell from its past, and z = e/σ. **The null hypothesis**: given all before it and the whole motion, the mean
//! of z(t), cut at −[`LOSS`] and [`GAIN`], is at most m(t), and that of −z(t), cut alike, is too;
//! m = margin + range·|f(t)|. The margin is what the model errs even where nothing has changed; f is the joint's
//! friction seen through the same filter, over σ, so that friction may wander by ± range of itself. Nothing else
//! is assumed: no normal distribution, no variance, no independence of joints. (The means of normal innovations that
//! are cut so are 0.0085, less than [`LEAST_MARGIN`].)
//!
//! **The test** bets against it. A bet puts the share λ(t) ≥ 0, known before z(t), on one sign, and its capital is
//! multiplied by 1 + λ·(±z − m), z cut. Under the null the mean of that factor is at most 1, whenever the bet began: it
//! is an e-process. A bet is begun anew at every sample, and all its beginnings together have C ← (C + 1)·factor (e-SR).
//! Under the null the mean of C grows by at most 1 a sample, and so does that of C's mean over all bets and joints. The
//! alarm rises when that exceeds A: then the mean time to a false alarm is at least A samples, whatever the noise is like
//! (J. Shin, A. Ramdas, A. Rinaldo, "E-detectors: a nonparametric framework for sequential change detection",
//! 2022; I. Waudby-Smith, A. Ramdas, "Estimating means of bounded random variables by betting", 2023).
//!
//! What is bet on is what changes look like: a constant, a share of the friction, of the whole torque, and of its rate.
//! The bet with the largest capital says the joint, and its best beginning (e-CUSUM) is when the change began.

use nalgebra::RealField;

/// Past values in a colour.
pub const ORDER: usize = 6;
/// An innovation against a bet counts up to so many standard deviations …
pub const LOSS: f64 = 2.0;
/// … and one for it up to so many: a clear change shows within a few samples.
pub const GAIN: f64 = 8.0;
/// No margin is less: cutting more on one side moves a mean a little.
pub const LEAST_MARGIN: f64 = 0.02;
/// Signals whose shares are bet on: friction, whole torque, and by how much that changes within [`LATE`].
pub const COLUMNS: usize = 3;
/// Torque that is late by this is the third signal, s.
pub const LATE: f64 = 0.01;
/// Bets on a constant: shares of the capital for each standard deviation.
const CONSTANT: [f64; 3] = [0.04, 0.12, 0.4];
/// Bets on a column: changes of it by so much of itself.
const SHARES: [f64; 3] = [0.05, 0.15, 0.5];
/// Bets of a joint, each with two signs.
pub const BETS: usize = 2 * (CONSTANT.len() + COLUMNS * SHARES.len());
/// What a bet may lose at most of its capital.
const MOST: f64 = 0.9;
/// Capital beyond this is not counted: it fits into single precision, and the alarm is far below.
const RICH: f64 = 1e25;

/// The colour of a joint's residual, and what its model errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour<T> {
    /// a_1 … of r(t) = Σ a_k·r(t−k) + e(t).
    pub coefficients: [T; ORDER],
    /// σ of e, N·m.
    pub deviation: T,
    /// Largest mean of z without a change.
    pub margin: T,
}

/// What one joint shows at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown<T> {
    /// Measured less predicted torque, N·m.
    pub residual: T,
    /// The model's friction, its whole torque, and the latter's change within [`LATE`], N·m.
    pub columns: [T; COLUMNS],
}

/// One bet against the null.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bet<T> {
    /// Of all its beginnings together.
    capital: T,
    /// Of the best one, and which that is.
    largest: T,
    since: u64,
}

impl<T: RealField + Copy> Bet<T> {
    /// Sample `number` multiplies the capital by `factor`.
    fn grow(&mut self, factor: T, number: u64) {
        if self.largest <= T::one() {
            (self.largest, self.since) = (T::one(), number);
        }
        let rich = nalgebra::convert(RICH);
        self.capital = ((self.capital + T::one()) * factor).clamp(T::zero(), rich);
        self.largest = (self.largest * factor).clamp(T::zero(), rich);
    }
}

/// The test of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTest<T> {
    colour: Colour<T>,
    /// By how much of itself friction may wander.
    range: T,
    /// Latest first.
    past: [Shown<T>; ORDER],
    seen: usize,
    bets: [Bet<T>; BETS],
}

/// A model that no longer holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alarm<T> {
    /// The joint, from 0, on which it shows most.
    pub joint: usize,
    /// The number of the sample with which the change began, as the tests were told it.
    pub since: u64,
    /// The mean capital of all bets over the level.
    pub capital: T,
}

impl<T: RealField + Copy> JointTest<T> {
    /// A joint with the colour of its residual; `range` is by how much of itself its friction may wander.
    #[must_use]
    pub fn new(colour: Colour<T>, range: T) -> Self {
        let nothing = Shown { residual: T::zero(), columns: [T::zero(); COLUMNS] };
        let bets = [Bet { capital: T::zero(), largest: T::zero(), since: 0 }; BETS];
        JointTest { colour, range, past: [nothing; ORDER], seen: 0, bets }
    }

    /// Forgets what came before a gap; capitals stay.
    pub fn interrupt(&mut self) {
        self.seen = 0;
    }

    /// All bets begin anew.
    pub fn restart(&mut self) {
        self.bets.iter_mut().for_each(|bet| (bet.capital, bet.largest) = (T::zero(), T::zero()));
    }

    /// A residual through the joint's colour, over σ: the innovation and the same of the columns; `None` until
    /// [`ORDER`] samples came before it.
    fn whiten(&mut self, now: Shown<T>) -> Option<(T, [T; COLUMNS])> {
        let mut white = now;
        for (a, before) in self.colour.coefficients.iter().zip(&self.past) {
            white.residual -= *a * before.residual;
            for (column, other) in white.columns.iter_mut().zip(&before.columns) {
                *column -= *a * *other;
            }
        }
        self.past.copy_within(..ORDER - 1, 1);
        self.past[0] = now;
        self.seen = (self.seen + 1).min(ORDER + 1);
        let over = T::one() / self.colour.deviation;
        (self.seen > ORDER).then(|| (white.residual * over, white.columns.map(|c| c * over)))
    }

    /// Takes sample `number`. One that is not finite is as a gap.
    pub fn update(&mut self, now: Shown<T>, number: u64) {
        if !(now.residual.is_finite() && now.columns.iter().all(|c| c.is_finite())) {
            return self.interrupt();
        }
        let Some((innovation, columns)) = self.whiten(now) else { return };
        let of = |x: f64| nalgebra::convert::<f64, T>(x);
        let margin = self.colour.margin.max(of(LEAST_MARGIN)) + self.range * columns[0].abs();
        let most = of(MOST) / (of(LOSS) + margin);
        // What all bets share is computed once, and constants are converted while this is compiled: a microcontroller
        // would convert each double anew.
        let cut = |for_it: T| for_it.clamp(-of(LOSS), of(GAIN)) - margin;
        let won = [cut(innovation), cut(-innovation)];
        let (constant, shares) = (CONSTANT.map(of), SHARES.map(of));
        let of_columns = columns.iter().flat_map(|c| shares.map(|share| *c * share));
        let mut pairs = self.bets.chunks_exact_mut(2);
        constant.into_iter().chain(of_columns).for_each(|stake| {
            // The first of two bets goes with the stake's sign, the other against it.
            let won = if stake < T::zero() { [won[1], won[0]] } else { won };
            let share = stake.abs();
            let share = if share < most { share } else { most };
            for (bet, won) in pairs.next().into_iter().flatten().zip(won) {
                bet.grow(T::one() + share * won, number);
            }
        });
    }

    /// The sum of all capitals.
    #[must_use]
    pub fn capital(&self) -> T {
        self.bets.iter().fold(T::zero(), |sum, bet| sum + bet.capital)
    }

    /// The largest capital, and since when it grows.
    fn best(&self) -> (T, u64) {
        let larger = |best: (T, u64), bet: &Bet<T>| {
            if bet.capital > best.0 { (bet.capital, bet.since) } else { best }
        };
        self.bets.iter().fold((T::zero(), 0), larger)
    }
}

/// The alarm of the tests of some joints (each by its place) together: the mean time to a false one is at least
/// `level` samples.
#[must_use]
pub fn alarm<'t, T: RealField + Copy>(
    tests: impl IntoIterator<Item = (usize, &'t JointTest<T>)>,
    level: T,
) -> Option<Alarm<T>> {
    let (mut sum, mut count, mut best) = (T::zero(), T::zero(), None::<(usize, (T, u64))>);
    for (joint, test) in tests {
        sum += test.capital();
        count += nalgebra::convert::<f64, T>(BETS as f64);
        let own = test.best();
        if best.is_none_or(|(_, (most, _))| own.0 > most) {
            best = Some((joint, own));
        }
    }
    let (joint, (_, since)) = best?;
    (sum >= level * count).then(|| Alarm { joint, since, capital: sum / (level * count) })
}

#[cfg(test)]
mod tests;
