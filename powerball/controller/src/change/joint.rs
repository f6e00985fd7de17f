//! The innovation of a joint: the part of its residual that its past could not predict.

use super::{FOLLOWED, GAIN, LEAST_MARGIN, ORDER, SLIP};
use nalgebra::RealField;

/// The colour of a joint's residual, and its model's error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour<T> {
    /// a_1 … of r(t) = Σ a_k·r(t−k) + e(t).
    pub coefficients: [T; ORDER],
    /// σ of e, N·m.
    pub deviation: T,
    /// Largest mean of e/σ without a change.
    pub margin: T,
}

/// A signal through a joint's colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whitener<T> {
    /// Latest first.
    past: [T; ORDER],
    seen: usize,
}

impl<T: RealField + Copy> Default for Whitener<T> {
    fn default() -> Self {
        Whitener { past: [T::zero(); ORDER], seen: 0 }
    }
}

impl<T: RealField + Copy> Whitener<T> {
    /// The signal minus its prediction from its past, over σ; `None` until [`ORDER`] samples came before it.
    /// A sample that is not finite counts as a gap.
    pub fn update(&mut self, colour: &Colour<T>, now: T) -> Option<T> {
        if !now.is_finite() {
            self.interrupt();
            return None;
        }
        let pairs = colour.coefficients.iter().zip(&self.past);
        let white = pairs.fold(now, |left, (a, before)| left - *a * *before);
        self.past.copy_within(..ORDER - 1, 1);
        self.past[0] = now;
        self.seen = (self.seen + 1).min(ORDER + 1);
        (self.seen > ORDER).then(|| white / colour.deviation)
    }

    /// Forgets what came before a gap.
    pub fn interrupt(&mut self) {
        self.seen = 0;
    }
}

/// The innovation of one joint at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<T> {
    /// z less the friction that was followed.
    pub value: T,
    /// m: allowed difference of its mean from zero without a change.
    pub allowed: T,
    /// The friction through the joint's colour, over σ.
    pub friction: T,
}

/// A joint's residual as innovations, its friction followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint<T> {
    colour: Colour<T>,
    /// Share of itself by which friction may wander.
    range: T,
    residual: Whitener<T>,
    friction: Whitener<T>,
    /// Σ f² and Σ f·z of the samples that are followed.
    squares: T,
    products: T,
}

impl<T: RealField + Copy> Joint<T> {
    /// A joint with the colour of its residual; `range` is by how much of itself its friction may wander.
    #[must_use]
    pub fn new(colour: Colour<T>, range: T) -> Self {
        let [residual, friction] = [Whitener::default(); 2];
        Joint { colour, range, residual, friction, squares: T::zero(), products: T::zero() }
    }

    /// The colour of its residual.
    #[must_use]
    pub fn colour(&self) -> &Colour<T> {
        &self.colour
    }

    /// Clears the samples before a gap; the followed friction is kept.
    pub fn interrupt(&mut self) {
        self.residual.interrupt();
        self.friction.interrupt();
    }

    /// Takes measured less predicted torque and the model's friction, N·m; `None` until [`ORDER`] samples
    /// came before.
    pub fn update(&mut self, residual: T, friction: T) -> Option<Innovation<T>> {
        let of = |x: f64| nalgebra::convert::<f64, T>(x);
        let both =
            (self.residual.update(&self.colour, residual), self.friction.update(&self.colour, friction));
        let (Some(z), Some(f)) = both else {
            // If one of them has a gap, the other has it too.
            if !(residual.is_finite() && friction.is_finite()) {
                self.interrupt();
            }
            return None;
        };
        // Before the first sample, friction is that of the model, to within its range.
        let square = self.range * self.range;
        let share = square * self.products / (square * self.squares + T::one());
        let share = share.clamp(-self.range, self.range);
        let value = z - share * f;
        let fade = T::one() - T::one() / of(FOLLOWED);
        self.squares = self.squares * fade + f * f;
        self.products = self.products * fade + f * (value.clamp(-of(GAIN), of(GAIN)) + share * f);
        let allowed = self.colour.margin.max(of(LEAST_MARGIN)) + of(SLIP) * self.range * f.abs();
        Some(Innovation { value, allowed, friction: f })
    }
}
