//! Columns that are added to a design: their products with it, from which the fit with them is a small solve.
//!
//! With the base's columns A, the added ones C and a signal y the normal equations of both need A'C, C'C and C'y
//! besides those of A (partitioned regression: Frisch and Waugh 1933).

use super::design::Design;
use super::solve::Solver;
use crate::logs::regression::Column;
use crate::logs::vector::dot;
use faer::Mat;
use std::ops::Range;

/// Weighted products of k added columns.
#[derive(Clone, Debug)]
pub struct Added {
    /// A'C: by column of C, over the columns of the design.
    pub cross: Vec<Vec<f64>>,
    /// C'C, k × k.
    pub square: Mat<f64>,
    /// C'y, k.
    pub right: Vec<f64>,
}

impl Added {
    /// Of no rows: k columns added to a design of `size`.
    #[must_use]
    pub fn zero(size: usize, k: usize) -> Added {
        Added { cross: vec![vec![0.0; size]; k], square: Mat::zeros(k, k), right: vec![0.0; k] }
    }

    /// Adds some rows of a joint; `signal` is y on all rows of the joint. A column that does not act on the joint is
    /// zero there.
    pub fn add_rows(
        &mut self,
        design: &Design,
        (joint, rows): (usize, &Range<usize>),
        columns: &[Column],
        signal: &[f64],
        weight: f64,
    ) {
        if weight == 0.0 || rows.is_empty() {
            return;
        }
        let acting = columns.iter().enumerate().filter_map(|(c, column)| Some((c, column.at(joint)?)));
        let (places, parts): (Vec<usize>, Vec<&[f64]>) = acting.unzip();
        for (g, values) in design.cross(joint, rows, &parts) {
            for (c, value) in places.iter().zip(values) {
                self.cross[*c][g] += weight * value;
            }
        }
        let parts: Vec<&[f64]> = parts.into_iter().map(|part| &part[rows.clone()]).collect();
        for (k, (a, part)) in places.iter().zip(&parts).enumerate() {
            for (b, other) in places.iter().zip(&parts).take(k + 1) {
                let product = weight * dot(part, other);
                self.square[(*a, *b)] += product;
                if a != b {
                    self.square[(*b, *a)] += product;
                }
            }
            self.right[*a] += weight * dot(part, &signal[rows.clone()]);
        }
    }

    /// Adds those of other rows, or takes them out again (`sign` −1).
    pub fn add(&mut self, other: &Added, sign: f64) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += sign * f);
        self.cross.iter_mut().zip(&other.cross).for_each(|(to, from)| add(to, from));
        self.square += faer::Scale(sign) * &other.square;
        add(&mut self.right, &other.right);
    }

    /// The base's shares in the added columns, by column, and the products with each other of what they have besides:
    /// C'C − C'A (A'A)⁻¹ A'C. `base` solves the normal equations of the design.
    #[must_use]
    pub fn without_base(&self, base: &Solver) -> (Vec<Vec<f64>>, Mat<f64>) {
        let shares: Vec<Vec<f64>> = self.cross.iter().map(|c| base.solve(c)).collect();
        let rest = Mat::from_fn(shares.len(), shares.len(), |a, b| {
            // By the lower triangle, so that it is symmetric to the last bit.
            let (a, b) = (a.max(b), a.min(b));
            self.square[(a, b)] - dot(&self.cross[a], &shares[b])
        });
        (shares, rest)
    }

    /// Solves for the added columns, from what they have besides the base; a column that the base imitates wholly is
    /// left out.
    #[must_use]
    pub fn solver(&self, rest: &Mat<f64>) -> Solver {
        Solver::new(rest, |a| rest[(a, a)] > IMITATED * self.square[(a, a)])
    }
}

/// A column of whose square less is left is imitated by the base.
const IMITATED: f64 = 1e-6;
