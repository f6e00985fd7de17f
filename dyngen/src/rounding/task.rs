//! Where Λ and J̄ have bounds: at poses where the tool feels no more than a stated inertia.
//!
//! A = Λ⁻¹ is singular where J loses rank, and Λ near such a pose is as large as one likes. So bounds hold at
//! the poses where no entry of Λ's diagonal is above its limit lᵢ. There all follows that a solve with A
//! needs: (A⁻¹)ᵢᵢ ≤ lᵢ, and a pivot of A is at least 1/Λᵢᵢ, since xᵀ·A·x ≥ xᵢ²/Λᵢᵢ (Cauchy and Schwarz).

use super::Where;
use super::factors::{Factors, ROUNDED};
use crate::consistency;
use crate::dynamics::Function;
use crate::evaluator::Evaluator;
use crate::model::Model;
use crate::parameters::SetKind;

/// Λ⁻¹ at the poses within limits of Λ's diagonal.
#[derive(Clone, Debug)]
pub(super) struct Task {
    /// Of Λ⁻¹.
    pub(super) factors: Factors,
    pub(super) poses: Where,
}

/// The size of Λ.
const N: usize = 6;

impl Task {
    /// For values of the minimal set, the largest sizes of J's entries, and the ranges for B.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub(super) fn new(
        model: &Model,
        values: &[f64],
        jacobian: &[f64],
        mass: &Factors,
    ) -> Result<Task, String> {
        let poses = poses(model, values)?;
        let n = mass.n;
        // Of rows: |Jᵢ|·|B⁻¹|·|Jᵢ|ᵀ.
        let most = jacobian.chunks(n).map(|row| {
            let term = |k: usize| row[k / n] * mass.inverse[k].magnitude() * row[k % n];
            (0..n * n).map(term).sum::<f64>() * ROUNDED
        });
        let least: Vec<f64> = poses.largest_inertia.iter().map(|l| 1.0 / l).collect();
        let most: Vec<f64> = most.collect();
        let factors = Factors::of_energy(&least, &poses.largest_inertia, &most);
        Ok(Task { factors: factors.ok_or("Λ is not positive definite")?, poses })
    }
}

/// Limits that all six entries of Λ's diagonal keep at [`SHARE`] of poses that are drawn at random: one
/// multiple of each entry's median.
fn poses(model: &Model, values: &[f64]) -> Result<Where, String> {
    let inertia =
        Evaluator::new(model, Function::TaskInertia, SetKind::Minimal).map_err(|e| e.to_string())?;
    let drawn: Vec<[f64; N]> = (consistency::poses(model.arm()).iter())
        .map(|q| {
            let mut flat = [0.0; N * N];
            inertia.evaluate(q, &[], &[], values, &mut flat);
            std::array::from_fn(|i| or_infinite(flat[i * N + i]))
        })
        .collect();
    let medians: [f64; N] = std::array::from_fn(|i| kept_by(drawn.iter().map(|x| x[i]).collect(), 0.5));
    if !medians.iter().all(|median| median.is_finite() && *median > 0.0) {
        return Err("J loses rank at half of the poses".to_string());
    }
    let multiple =
        |x: &[f64; N]| x.iter().zip(&medians).fold(0.0, |most: f64, (x, median)| most.max(x / median));
    let most = kept_by(drawn.iter().map(multiple).collect(), SHARE);
    let largest_inertia: Vec<f64> = medians.iter().map(|median| two_digits(most * median)).collect();
    let within = |diagonal: &&[f64; N]| diagonal.iter().zip(&largest_inertia).all(|(x, l)| x <= l);
    let share = drawn.iter().filter(within).count() as f64 / drawn.len() as f64;
    Ok(Where { largest_inertia, share })
}

/// The number that a share of all is no larger than.
fn kept_by(mut all: Vec<f64>, share: f64) -> f64 {
    all.sort_by(f64::total_cmp);
    all[(all.len() as f64 * share) as usize]
}

/// A Λ that is no number is none within limits.
fn or_infinite(x: f64) -> f64 {
    if x.is_nan() || x < 0.0 { f64::INFINITY } else { x }
}

/// The next number above with two digits, so that a reader can compare with it.
fn two_digits(x: f64) -> f64 {
    let power = x.log10().floor() as i32 - 1;
    // By its text: products with powers of ten have more digits.
    format!("{}e{power}", (x / 10f64.powi(power)).ceil()).parse().unwrap_or(x)
}

/// The share of poses for which Λ has a bound. With more of them limits grow, and bounds with their square.
const SHARE: f64 = 0.5;
