//! Columns tanh(γ·q̇) for every γ at once.
//!
//! A reduced log cannot be asked for the column of a steepness that is found later. As a function of ln γ the
//! column is smooth (it is analytic in the strip |Im ln γ| < π/2), so its interpolant at Chebyshev's nodes
//! comes near it as fast as a geometric series: with [`NODES`] nodes over [`Steepness::range`] no value is
//! off by more than 4e-5 (a test finds it). The columns at the nodes therefore hold those of all steepnesses
//! between, and their derivatives, as linear combinations.

use std::f64::consts::PI;

/// Columns that stand for all steepnesses.
pub const NODES: usize = 32;
/// The range of a joint whose velocity limit is v: nearly straight up to v, and a step for all that is
/// measurable.
const LOW: f64 = 0.5;
const HIGH: f64 = 2000.0;

/// The steepnesses of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steepness {
    low: f64,
    high: f64,
}

impl Steepness {
    /// For a joint of velocity limit `velocity`, rad/s or m/s.
    #[must_use]
    pub fn new(velocity: f64) -> Steepness {
        Steepness { low: LOW / velocity, high: HIGH / velocity }
    }

    /// Over a given range, s/rad.
    #[must_use]
    pub fn between(low: f64, high: f64) -> Steepness {
        Steepness { low, high }
    }

    /// Lowest and highest steepness, s/rad.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The steepnesses of the columns that are kept, s/rad.
    #[must_use]
    pub fn nodes(&self) -> [f64; NODES] {
        let (middle, half) = self.scale();
        std::array::from_fn(|k| (middle + half * node(k).cos()).exp())
    }

    /// What of each node's column makes the column of `gamma`.
    #[must_use]
    pub fn weights(&self, gamma: f64) -> [f64; NODES] {
        let angle = self.angle(gamma);
        // Lagrange's polynomials in Chebyshev's: ℓₖ = (1 + 2·Σ Tₘ(xₖ)·Tₘ(x))/N.
        std::array::from_fn(|k| {
            let sum: f64 = (1..NODES).map(|m| (m as f64 * node(k)).cos() * (m as f64 * angle).cos()).sum();
            (1.0 + 2.0 * sum) / NODES as f64
        })
    }

    /// The same for the column's derivative by ln γ.
    #[must_use]
    pub fn slopes(&self, gamma: f64) -> [f64; NODES] {
        let (_, half) = self.scale();
        let angle = self.angle(gamma);
        // dTₘ/dx = m·sin(mφ)/sin φ at x = cos φ, m² at the upper end and ±m² at the lower one.
        let slope = |m: usize| {
            let m = m as f64;
            if angle.sin() < 1e-9 {
                m * m * if angle < 1.0 { 1.0 } else { -(m * PI).cos() }
            } else {
                m * (m * angle).sin() / angle.sin()
            }
        };
        std::array::from_fn(|k| {
            let sum: f64 = (1..NODES).map(|m| (m as f64 * node(k)).cos() * slope(m)).sum();
            2.0 * sum / (NODES as f64 * half)
        })
    }

    fn scale(&self) -> (f64, f64) {
        let (low, high) = (self.low.ln(), self.high.ln());
        (0.5 * (low + high), 0.5 * (high - low))
    }

    /// The angle φ with cos φ the place of ln γ in the range, which it does not leave.
    fn angle(&self, gamma: f64) -> f64 {
        let (middle, half) = self.scale();
        ((gamma.ln() - middle) / half).clamp(-1.0, 1.0).acos()
    }
}

fn node(k: usize) -> f64 {
    PI * (2 * k + 1) as f64 / (2 * NODES) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_and_tangents_are_those_of_the_law() {
        let velocity = 1.3;
        let steepness = Steepness::new(velocity);
        let (low, high) = steepness.range();
        let (mut off, mut off_slope) = (0.0f64, 0.0f64);
        for i in 0..=300 {
            let gamma = (low * (high / low).powf(f64::from(i) / 300.0)).clamp(low, high);
            let (weights, slopes) = (steepness.weights(gamma), steepness.slopes(gamma));
            approx::assert_abs_diff_eq!(weights.iter().sum::<f64>(), 1.0, epsilon = 1e-9);
            for k in -40..=10 {
                let v = velocity * 1.4f64.powi(k);
                let at = |w: &[f64; NODES]| -> f64 {
                    steepness.nodes().iter().zip(w).map(|(g, w)| w * (g * v).tanh()).sum()
                };
                let t = (gamma * v).tanh();
                off = off.max((at(&weights) - t).abs());
                off_slope = off_slope.max((at(&slopes) - gamma * v * (1.0 - t * t)).abs());
            }
        }
        println!("off by {off:.1e}, tangents by {off_slope:.1e}");
        assert!(off < 4e-5 && off_slope < 4e-3, "{off:.1e} {off_slope:.1e}");
    }
}
