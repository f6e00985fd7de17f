//! A signal by joint and row: torques, or the residual of a model.

use super::{Column, Data};
use std::ops::{Deref, DerefMut};

/// A signal of all joints on the rows of some [`Data`]: by joint one value a row. As a slice it is a list of
/// joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signals(pub Vec<Vec<f64>>);

impl Signals {
    /// Zero on the rows of some data.
    #[must_use]
    pub fn zeros(data: &Data<'_>) -> Signals {
        data.joints.iter().map(|joint| vec![0.0; joint.len()]).collect()
    }

    /// Sum of squares by joint.
    #[must_use]
    pub fn squares(&self) -> Vec<f64> {
        self.iter().map(|values| square(values)).collect()
    }

    /// Root mean square by joint; 0 for a joint without rows.
    #[must_use]
    pub fn rms(&self) -> Vec<f64> {
        self.iter().map(|values| (square(values) / values.len().max(1) as f64).sqrt()).collect()
    }

    /// Sum of squares, each joint times a weight.
    #[must_use]
    pub fn weighted_square(&self, weights: &[f64]) -> f64 {
        self.iter().zip(weights).map(|(values, weight)| weight * square(values)).sum()
    }

    /// Adds columns with their coefficients.
    pub fn add(&mut self, columns: &[Column], coefficients: &[f64]) {
        columns.iter().zip(coefficients).for_each(|(column, c)| column.add_to(self, *c));
    }

    /// Takes columns with their coefficients out.
    pub fn subtract(&mut self, columns: &[Column], coefficients: &[f64]) {
        columns.iter().zip(coefficients).for_each(|(column, c)| column.add_to(self, -c));
    }

    /// Adds another signal of the same rows, times a factor.
    pub fn add_signal(&mut self, other: &[Vec<f64>], factor: f64) {
        for (values, other) in self.iter_mut().zip(other) {
            values.iter_mut().zip(other).for_each(|(value, o)| *value += factor * o);
        }
    }

    /// This signal minus another one.
    #[must_use]
    pub fn without(&self, other: &[Vec<f64>]) -> Signals {
        let mut left = self.clone();
        left.add_signal(other, -1.0);
        left
    }
}

fn square(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

impl Deref for Signals {
    type Target = [Vec<f64>];

    fn deref(&self) -> &[Vec<f64>] {
        &self.0
    }
}

impl DerefMut for Signals {
    fn deref_mut(&mut self) -> &mut [Vec<f64>] {
        &mut self.0
    }
}

impl<'s> IntoIterator for &'s Signals {
    type Item = &'s Vec<f64>;
    type IntoIter = std::slice::Iter<'s, Vec<f64>>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl FromIterator<Vec<f64>> for Signals {
    fn from_iter<I: IntoIterator<Item = Vec<f64>>>(joints: I) -> Signals {
        Signals(joints.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_go_in_and_out_by_joint() {
        let mut signals: Signals = [vec![1.0, 2.0], vec![3.0]].into_iter().collect();
        let columns = [Column::on(0, vec![1.0, -1.0]), Column::on(1, vec![2.0])];
        let before = signals.clone();
        signals.add(&columns, &[0.5, 1.5]);
        assert_eq!(signals.0, [vec![1.5, 1.5], vec![6.0]]);
        assert_eq!(signals.squares(), [4.5, 36.0]);
        assert_eq!(signals.rms(), [1.5, 6.0]);
        assert_eq!(signals.weighted_square(&[2.0, 0.5]), 27.0);
        assert_eq!(signals.without(&before).0, [vec![0.5, -0.5], vec![3.0]]);
        signals.subtract(&columns, &[0.5, 1.5]);
        assert_eq!(signals, before);
    }
}
