//! Normal equations, summed over joints and parts of logs.

use faer::Mat;

/// Σ w·A'A, Σ w·A'y, Σ w·y'y.
pub(super) type Products = (Mat<f64>, Vec<f64>, f64);

/// Σ aᵢ·bᵢ in the order of the rows: standard errors of nearly dependent columns hang on the last digits of
/// these sums.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Of no row yet, for so many coefficients.
pub(super) fn zeros(size: usize) -> Products {
    (Mat::zeros(size, size), vec![0.0; size], 0.0)
}

/// Adds columns `a` and their torque `y` times a weight; `global[i]` is the place of column i among all
/// coefficients.
pub(super) fn add_columns(
    (gram, right, square): &mut Products,
    global: &[usize],
    a: &[impl AsRef<[f64]>],
    y: &[f64],
    weight: f64,
) {
    for (i, (column, gi)) in a.iter().zip(global).enumerate() {
        let column = column.as_ref();
        for (other, gk) in a.iter().zip(global).take(i + 1) {
            let value = weight * dot(column, other.as_ref());
            gram[(*gi, *gk)] += value;
            if gi != gk {
                gram[(*gk, *gi)] += value;
            }
        }
        right[*gi] += weight * dot(column, y);
    }
    *square += weight * dot(y, y);
}

/// Adds products that were formed before, times a weight.
pub(super) fn add_products(
    (gram, right, square): &mut Products,
    global: &[usize],
    (a, b, c): &Products,
    weight: f64,
) {
    for (i, gi) in global.iter().enumerate() {
        for (k, gk) in global.iter().enumerate() {
            gram[(*gk, *gi)] += weight * a[(k, i)];
        }
        right[*gi] += weight * b[i];
    }
    *square += weight * c;
}
