//! Derivatives of evenly sampled signals by central differences.

/// dx/dt of samples `dt` seconds apart: central inside, one-sided of second order at the ends.
#[must_use]
pub fn derivative(x: &[f64], dt: f64) -> Vec<f64> {
    let n = x.len();
    if n < 3 {
        let slope = if n == 2 { (x[1] - x[0]) / dt } else { 0.0 };
        return vec![slope; n];
    }
    let mut d = vec![0.0; n];
    for k in 1..n - 1 {
        d[k] = (x[k + 1] - x[k - 1]) / (2.0 * dt);
    }
    d[0] = (-3.0 * x[0] + 4.0 * x[1] - x[2]) / (2.0 * dt);
    d[n - 1] = (3.0 * x[n - 1] - 4.0 * x[n - 2] + x[n - 3]) / (2.0 * dt);
    d
}

/// d²x/dt² of samples `dt` seconds apart: the three-point formula, its neighbour's value at the ends.
#[must_use]
pub fn second_derivative(x: &[f64], dt: f64) -> Vec<f64> {
    let n = x.len();
    if n < 3 {
        return vec![0.0; n];
    }
    let mut d = vec![0.0; n];
    for k in 1..n - 1 {
        d[k] = (x[k + 1] - 2.0 * x[k] + x[k - 1]) / (dt * dt);
    }
    d[0] = d[1];
    d[n - 1] = d[n - 2];
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_exact_everywhere() {
        let dt = 0.01;
        let x: Vec<f64> = (0..50).map(|k| 3.0 * (k as f64 * dt).powi(2) - 1.0).collect();
        for (k, (v, a)) in derivative(&x, dt).iter().zip(second_derivative(&x, dt)).enumerate() {
            approx::assert_abs_diff_eq!(*v, 6.0 * k as f64 * dt, epsilon = 1e-9);
            approx::assert_abs_diff_eq!(a, 6.0, epsilon = 1e-7);
        }
        assert_eq!(derivative(&[1.0], dt), vec![0.0]);
        assert!(second_derivative(&[], dt).is_empty());
    }
}
