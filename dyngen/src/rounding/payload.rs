//! Ranges of LᵀDL and of B⁻¹ with a payload that a body can have, each of its ten numbers within ±1.
//!
//! It only adds energy. So pivots are at least, and (B⁻¹)ᵢᵢ at most, those of the arm alone. Where joint i
//! moves with 1, the tool's frame has velocities v and ω, and twice the payload's energy is m·v² + 2·v·(ω ×
//! m·c) + ωᵀIω. The mass m and each entry of m·c and of I are at most 1, so |m·c| ≤ √3, and the largest
//! eigenvalue of a body's I is at most half its trace, 3/2.

use super::factors::{Factors, ROUNDED};

/// The ranges from those of the arm alone, the largest entries of its B's diagonal and the largest sizes of
/// the entries of J, 6 × n.
pub(super) fn factors(alone: &Factors, most: &[f64], jacobian: &[f64]) -> Option<Factors> {
    let n = alone.n;
    let length = |i: usize, rows: std::ops::Range<usize>| {
        rows.map(|row| jacobian[row * n + i].powi(2)).sum::<f64>().sqrt()
    };
    let with_payload = |i: usize| {
        let (v, w) = (length(i, 0..3), length(i, 3..6));
        (most[i] + v * v + 2.0 * 3f64.sqrt() * v * w + 1.5 * w * w) * ROUNDED
    };
    let most: Vec<f64> = (0..n).map(with_payload).collect();
    let least: Vec<f64> = alone.pivots.iter().map(|d| d.low).collect();
    Factors::of_energy(&least, &alone.mobility(), &most)
}
