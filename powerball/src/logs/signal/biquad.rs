//! A recursive filter of second order.

/// One second-order section with a0 = 1: y = b0·x + b1·x₋₁ + b2·x₋₂ − a1·y₋₁ − a2·y₋₂.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Biquad {
    /// b0, b1, b2.
    pub b: [f64; 3],
    /// a1, a2.
    pub a: [f64; 2],
}

impl Biquad {
    /// The state that a long constant input of 1 leaves behind (transposed direct form II).
    pub(super) fn settled(&self) -> [f64; 2] {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        let gain = (b0 + b1 + b2) / (1.0 + a1 + a2);
        [gain - b0, b2 - a2 * gain]
    }

    /// One sample through the section in the given state.
    ///
    /// The next state is written in the present one alone, not in the output: a sample waits for one product
    /// and one sum of the sample before it.
    #[inline(always)]
    pub(super) fn step(&self, [s1, s2]: &mut [f64; 2], x: f64) -> f64 {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        let (state, y) = (*s1, b0 * x + *s1);
        *s1 = ((b1 - a1 * b0) * x + *s2) - a1 * state;
        *s2 = (b2 - a2 * b0) * x - a2 * state;
        y
    }
}
