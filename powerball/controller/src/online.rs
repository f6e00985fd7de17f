//! Recursive least squares for controllers, in square-root form: no allocation, no clock, constant time for
//! each row.

use nalgebra::{RealField, SMatrix, SVector};

/// Least squares over all rows so far, old ones forgotten exponentially where wanted.
///
/// What is kept is the triangular factor of the normal equations: Rᵀ·R = Σ λ^age·w·yᵀy + ε²·I and Rᵀ·z the
/// right-hand side. New rows are rotated in (Givens), so the condition number is that of the rows and not its
/// square, and R cannot lose its definiteness to rounding, as a recursive covariance does. Without forgetting
/// the estimate is that of a batch fit.
///
/// ```
/// use nalgebra::Vector2;
/// use powerball_controller::online::SquareRoot;
///
/// let mut line = SquareRoot::<f64, 2>::new(1e-9);
/// for x in [0.0, 1.0, 2.0, 3.0] {
///     line.update(&Vector2::new(1.0, x), 5.0 - 2.0 * x, 1.0);
/// }
/// let found = line.estimate().unwrap();
/// assert!((found - Vector2::new(5.0, -2.0)).norm() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareRoot<T, const P: usize> {
    /// Upper triangle; below it nothing is read.
    r: SMatrix<T, P, P>,
    z: SVector<T, P>,
    /// Root of the mean squared residual's numerator: what no estimate explains.
    rest: T,
    rows: T,
}

impl<T: RealField + Copy, const P: usize> SquareRoot<T, P> {
    /// An estimator that knows nothing: `prior` is ε, the weight with which every parameter is held at zero
    /// until rows say otherwise, in root units of a row (a row of weight 1 counts as 1).
    #[must_use]
    pub fn new(prior: T) -> Self {
        SquareRoot {
            r: SMatrix::from_diagonal_element(prior.abs()),
            z: SVector::zeros(),
            rest: T::zero(),
            rows: T::zero(),
        }
    }

    /// Lets everything so far count `factor` (λ, 0 to 1) times as much: once for each sample.
    ///
    /// Directions that new rows do not excite are forgotten all the same; a λ of exp(−Δt/T) remembers about
    /// T.
    pub fn forget(&mut self, factor: T) {
        let root = factor.clamp(T::zero(), T::one()).sqrt();
        self.r *= root;
        self.z *= root;
        self.rest *= root;
        self.rows *= factor.clamp(T::zero(), T::one());
    }

    /// Takes a row y·π = value with a weight, 1/σ². A row that is not finite, or has no positive weight, is
    /// left out, and `false` returned.
    pub fn update(&mut self, row: &SVector<T, P>, value: T, weight: T) -> bool {
        let finite = row.iter().all(|x| x.is_finite()) && value.is_finite() && weight.is_finite();
        if !finite || weight <= T::zero() {
            return false;
        }
        let root = weight.sqrt();
        let (mut row, mut value) = (row * root, value * root);
        for k in 0..P {
            // The rotation that turns (r_kk, row_k) into (length, 0).
            let (a, b) = (self.r[(k, k)], row[k]);
            if b == T::zero() {
                continue;
            }
            let length = hypotenuse(a, b);
            let (c, s) = (a / length, b / length);
            for j in k..P {
                let (above, below) = (self.r[(k, j)], row[j]);
                self.r[(k, j)] = c * above + s * below;
                row[j] = c * below - s * above;
            }
            let (above, below) = (self.z[k], value);
            self.z[k] = c * above + s * below;
            value = c * below - s * above;
        }
        self.rest = hypotenuse(self.rest, value);
        self.rows += T::one();
        true
    }

    /// The parameters that fit best; `None` if the rows do not determine one of them (with a prior of 0).
    #[must_use]
    pub fn estimate(&self) -> Option<SVector<T, P>> {
        let mut x = self.z;
        for k in (0..P).rev() {
            let mut sum = x[k];
            for j in k + 1..P {
                sum -= self.r[(k, j)] * x[j];
            }
            x[k] = sum / self.r[(k, k)];
        }
        x.iter().all(|v| v.is_finite()).then_some(x)
    }

    /// Standard deviation of the weighted residuals: 1 where the weights were 1/σ². Zero with no more rows
    /// than parameters.
    #[must_use]
    pub fn residual(&self) -> T {
        let freedom = self.rows - nalgebra::convert(P as f64);
        if freedom > T::zero() { self.rest / freedom.sqrt() } else { T::zero() }
    }

    /// Standard deviations of the parameters for rows of white noise; `None` as in
    /// [`estimate`](Self::estimate).
    #[must_use]
    pub fn deviations(&self) -> Option<SVector<T, P>> {
        let scale = self.residual();
        // (Rᵀ·R)⁻¹ = R⁻¹·R⁻ᵀ
        let out = SVector::<T, P>::from_fn(|k, _| scale * self.inverse_row_norm(k));
        out.iter().all(|v| v.is_finite()).then_some(out)
    }

    /// |row k of R⁻¹|
    fn inverse_row_norm(&self, k: usize) -> T {
        // R⁻ᵀ is lower triangular; row k of R⁻¹ is column k of R⁻ᵀ.
        let mut column = SVector::<T, P>::zeros();
        for i in k..P {
            let mut sum = if i == k { T::one() } else { T::zero() };
            for j in k..i {
                sum -= self.r[(j, i)] * column[j];
            }
            column[i] = sum / self.r[(i, i)];
        }
        column.norm()
    }
}

/// √(a² + b²) without overflow, in the scalar's own precision: libm's for `f32` computes in `f64`, which few
/// controllers have.
fn hypotenuse<T: RealField + Copy>(a: T, b: T) -> T {
    let (long, short) = if a.abs() > b.abs() { (a.abs(), b.abs()) } else { (b.abs(), a.abs()) };
    if long == T::zero() {
        return long;
    }
    let ratio = short / long;
    long * (T::one() + ratio * ratio).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    const P: usize = 6;
    type Rows = Vec<(SVector<f64, P>, f64)>;

    fn rows(count: usize, seed: u64) -> Rows {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = SVector::<f64, P>::from_fn(|i, _| i as f64 - 2.0);
        (0..count)
            .map(|_| {
                let row = SVector::<f64, P>::from_fn(|_, _| rng.random_range(-1.0..1.0));
                (row, row.dot(&truth) + rng.random_range(-0.1..0.1))
            })
            .collect()
    }

    /// Normal equations with weights, solved by LU: another way altogether.
    fn batch(rows: &Rows, weight: impl Fn(usize) -> f64) -> (SVector<f64, P>, SMatrix<f64, P, P>) {
        let (mut gram, mut right) = (SMatrix::<f64, P, P>::zeros(), SVector::<f64, P>::zeros());
        for (k, (row, y)) in rows.iter().enumerate() {
            gram += weight(k) * row * row.transpose();
            right += weight(k) * row * *y;
        }
        (gram.lu().solve(&right).unwrap(), gram)
    }

    #[test]
    fn without_forgetting_it_is_the_batch_answer() {
        let rows = rows(200, 1);
        let mut online = SquareRoot::<f64, P>::new(0.0);
        for (k, (row, y)) in rows.iter().enumerate() {
            assert!(online.update(row, *y, 1.0 + k as f64));
        }
        let (expected, gram) = batch(&rows, |k| 1.0 + k as f64);
        assert!((online.estimate().unwrap() - expected).norm() < 1e-12);
        let square: f64 = rows
            .iter()
            .enumerate()
            .map(|(k, (row, y))| (1.0 + k as f64) * (y - row.dot(&expected)).powi(2))
            .sum();
        let sigma = (square / (200.0 - P as f64)).sqrt();
        approx::assert_relative_eq!(online.residual(), sigma, max_relative = 1e-10);
        let covariance = gram.try_inverse().unwrap();
        for k in 0..P {
            let expected = sigma * covariance[(k, k)].sqrt();
            approx::assert_relative_eq!(online.deviations().unwrap()[k], expected, max_relative = 1e-9);
        }
    }

    #[test]
    fn forgetting_weighs_by_age() {
        let rows = rows(300, 2);
        let mut online = SquareRoot::<f64, P>::new(1e-12);
        for (row, y) in &rows {
            online.forget(0.97);
            online.update(row, *y, 1.0);
        }
        let (expected, _) = batch(&rows, |k| 0.97f64.powi(299 - k as i32));
        assert!((online.estimate().unwrap() - expected).norm() < 1e-10);
    }

    #[test]
    fn what_is_no_number_is_left_out() {
        let mut online = SquareRoot::<f64, P>::new(0.0);
        let row = SVector::<f64, P>::repeat(1.0);
        assert!(!online.update(&row, f64::NAN, 1.0) && !online.update(&row, 1.0, 0.0));
        assert!(!online.update(&(row * f64::INFINITY), 1.0, 1.0));
        assert!(online.estimate().is_none());
        assert_eq!(online, SquareRoot::new(0.0));
    }

    /// Normal equations square the condition number and fail here in single precision; the factor does not.
    #[test]
    fn single_precision_bears_an_ill_conditioned_problem() {
        let mut online = SquareRoot::<f32, 2>::new(0.0);
        for k in 0..100 {
            let x = 1.0 + 1e-4 * k as f32;
            online.update(&SVector::from([1.0, x]), 3.0 - x, 1.0);
        }
        let found = online.estimate().unwrap();
        assert!((found - SVector::from([3.0f32, -1.0])).norm() < 0.01, "{found}");
    }
}
