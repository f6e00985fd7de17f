//! A bet on a change of which the columns are known and the size is not.

use super::{GAIN, Innovation, LOSS, WINDOW};
use nalgebra::{RealField, SMatrix, SVector};

/// The size is held to zero as by this many usual samples without a change.
const HELD: f64 = 10.0;
/// Number of samples over which the usual value is computed …
const USUAL: f64 = 3000.0;
/// … and is held to zero as by this many.
const USUALLY: f64 = 1000.0;
/// The largest share of its capital that a bet may lose.
const MOST: f64 = 0.9;
/// Capital beyond this is not counted: it fits into single precision, and the alarm is far below.
const RICH: f64 = 1e25;

/// The contribution of one joint to a bet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T, const P: usize> {
    /// The joint's innovation.
    pub innovation: Innovation<T>,
    /// The change's columns through the joint's colour, over σ.
    pub columns: [T; P],
}

/// A bet on a change with P columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bet<T, const P: usize> {
    /// Σ x·xᵀ and Σ x·z of the last samples.
    information: SMatrix<T, P, P>,
    score: SVector<T, P>,
    /// Σ x·xᵀ and Σ x·z of many samples, and how many these are.
    usual: SMatrix<T, P, P>,
    usual_score: SVector<T, P>,
    samples: T,
    /// Capital of the bets that started at all samples, together.
    capital: T,
    /// Capital of the best of these bets; `since` is the sample at which it started.
    largest: T,
    since: u64,
}

impl<T: RealField + Copy, const P: usize> Default for Bet<T, P> {
    fn default() -> Self {
        Bet {
            information: SMatrix::zeros(),
            score: SVector::zeros(),
            usual: SMatrix::zeros(),
            usual_score: SVector::zeros(),
            samples: T::zero(),
            capital: T::zero(),
            largest: T::zero(),
            since: 0,
        }
    }
}

impl<T: RealField + Copy, const P: usize> Bet<T, P> {
    /// Takes sample `number`: one term for each joint that moves.
    pub fn update(&mut self, terms: &[Term<T, P>], number: u64) {
        if terms.is_empty() {
            return;
        }
        let of = |x: f64| nalgebra::convert::<f64, T>(x);
        if self.largest <= T::one() {
            (self.largest, self.since) = (T::one(), number);
        }
        let usual = self.usual_size();
        let (factor, begins) = self.factor(terms, &usual);
        self.capital = ((self.capital + begins) * factor).clamp(T::zero(), of(RICH));
        self.largest = (self.largest * factor).clamp(T::zero(), of(RICH));
        self.learn(terms, &usual);
    }

    /// The factor of a bet's capital, and the capital with which a new bet starts: the part of it that may be
    /// lost, as a share of the largest one. Otherwise all bets that wait with little put on would add up.
    pub(super) fn factor(&self, terms: &[Term<T, P>], usual: &SVector<T, P>) -> (T, T) {
        let of = |x: f64| nalgebra::convert::<f64, T>(x);
        let size = self.size();
        let expected = |term: &Term<T, P>| SVector::from(term.columns).dot(&size);
        let square = terms.iter().fold(T::zero(), |sum, term| sum + expected(term) * expected(term));
        // The best share of a small mean μ with variance 1 is μ.
        let share = |term: &Term<T, P>| {
            (expected(term).abs() - term.innovation.allowed).max(T::zero()) / (T::one() + square)
        };
        let risk = terms
            .iter()
            .fold(T::zero(), |sum, term| sum + share(term) * (of(LOSS) + term.innovation.allowed));
        let scale = if risk > of(MOST) { of(MOST) / risk } else { T::one() };
        let factor = terms.iter().fold(T::one(), |factor, term| {
            let Innovation { value, allowed, .. } = term.innovation;
            let value = value - SVector::from(term.columns).dot(usual);
            let for_it = if expected(term) < T::zero() { -value } else { value };
            factor + scale * share(term) * (for_it.clamp(-of(LOSS), of(GAIN)) - allowed)
        });
        (factor, (risk / of(MOST)).min(T::one()))
    }

    /// The size of the change, by the last samples.
    fn size(&self) -> SVector<T, P> {
        solved(self.information + self.usual * self.held(HELD), &self.score)
    }

    /// The size that is usual: a lasting model error along the change's columns is not a change.
    pub(super) fn usual_size(&self) -> SVector<T, P> {
        solved(self.usual * (T::one() + self.held(USUALLY)), &self.usual_score)
    }

    /// `samples` usual samples as a share of those that were seen.
    fn held(&self, samples: f64) -> T {
        nalgebra::convert::<f64, T>(samples) / self.samples.max(T::one())
    }

    fn learn(&mut self, terms: &[Term<T, P>], usual: &SVector<T, P>) {
        let of = |x: f64| nalgebra::convert::<f64, T>(x);
        let keep = |samples: f64| T::one() - T::one() / of(samples);
        self.information *= keep(WINDOW);
        self.score *= keep(WINDOW);
        self.usual *= keep(USUAL);
        self.usual_score *= keep(USUAL);
        self.samples = self.samples * keep(USUAL) + T::one();
        for term in terms {
            let x = SVector::from(term.columns);
            let follows = x.dot(usual);
            let left = (term.innovation.value - follows).clamp(-of(GAIN), of(GAIN));
            let square = x * x.transpose();
            self.information += square;
            self.usual += square;
            self.score += x * left;
            self.usual_score += x * (left + follows);
        }
    }

    /// The capital of all beginnings together.
    #[must_use]
    pub fn capital(&self) -> T {
        self.capital
    }

    /// The number of the sample of its best beginning.
    #[must_use]
    pub fn since(&self) -> u64 {
        self.since
    }
}

/// The solution of normal equations; what no sample shows stays zero.
fn solved<T: RealField + Copy, const P: usize>(
    mut matrix: SMatrix<T, P, P>,
    score: &SVector<T, P>,
) -> SVector<T, P> {
    let of = |x: f64| nalgebra::convert::<f64, T>(x);
    for k in 0..P {
        let own = matrix[(k, k)];
        matrix[(k, k)] = own + own * of(1e-5) + of(1e-9);
    }
    matrix.cholesky().map_or_else(SVector::zeros, |root| root.solve(score))
}
