//! Numbers of the prime field with infinitesimals, none of which has a square: derivatives of any order by
//! one evaluation.

use dyngen_arm::exact::prime::Fp;

/// Σ coefficient·(product of some infinitesimals); the bits of a coefficient's index say which. One with
/// fewer coefficients than another has zeros in place of the rest.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dual(Vec<Fp>);

impl Dual {
    /// A number without infinitesimals.
    pub(crate) fn number(x: Fp) -> Dual {
        Dual(vec![x])
    }

    /// A number times the product of the infinitesimals of an index.
    pub(crate) fn along(index: usize, x: Fp) -> Dual {
        let mut coefficients = vec![Fp::ZERO; (index + 1).next_power_of_two()];
        coefficients[index] = x;
        Dual(coefficients)
    }

    /// The coefficient of an index.
    pub(crate) fn at(&self, index: usize) -> Fp {
        self.0.get(index).copied().unwrap_or(Fp::ZERO)
    }

    /// The derivative by one infinitesimal, of which `index` has the bit.
    pub(crate) fn by(&self, index: usize) -> Dual {
        let without = |k: usize| if k & index == 0 { self.at(k | index) } else { Fp::ZERO };
        Dual((0..self.0.len()).map(without).collect())
    }

    /// The number times a factor of the field.
    pub(crate) fn times(&self, factor: Fp) -> Dual {
        Dual(self.0.iter().map(|x| *x * factor).collect())
    }

    fn with(&self, other: &Dual, operation: impl Fn(Fp, Fp) -> Fp) -> Dual {
        let length = self.0.len().max(other.0.len());
        Dual((0..length).map(|k| operation(self.at(k), other.at(k))).collect())
    }

    /// Sine and cosine of an angle of which those of the finite part are known.
    pub(crate) fn sine_and_cosine(&self, (s, c): (Fp, Fp)) -> (Dual, Dual) {
        let change = self - &Dual::number(self.at(0));
        let (mut power, mut sums) = (Dual::number(Fp::ONE), [Dual(vec![]), Dual(vec![])]);
        // A power beyond the number of infinitesimals is zero.
        for k in 0..=self.0.len().trailing_zeros() as usize {
            let sign = if k % 4 < 2 { Fp::ONE } else { -Fp::ONE };
            sums[k % 2] = &sums[k % 2] + &power.times(sign);
            let inverse = Fp::from_integer(k as i64 + 1).inverse().unwrap_or(Fp::ZERO);
            power = (&power * &change).times(inverse);
        }
        let [even, odd] = sums;
        (&even.times(s) + &odd.times(c), &even.times(c) - &odd.times(s))
    }
}

impl Dual {
    /// Σ (coefficient of a power)·(change from the finite part, as a share of it)ᵏ, times a number. `None`
    /// where the finite part is zero.
    fn series(&self, scale: Fp, coefficient: impl Fn(i64) -> Fp) -> Option<Dual> {
        let finite = self.at(0);
        let change = (self - &Dual::number(finite)).times(finite.inverse()?);
        let (mut power, mut sum, mut factor) = (Dual::number(Fp::ONE), Dual(vec![]), scale);
        // A power beyond the number of infinitesimals is zero.
        for k in 0..=self.0.len().trailing_zeros() as i64 {
            sum = &sum + &power.times(factor);
            power = &power * &change;
            factor = factor * coefficient(k);
        }
        Some(sum)
    }

    /// 1/x; `None` where the finite part is zero.
    pub(crate) fn inverse(&self) -> Option<Dual> {
        self.series(self.at(0).inverse()?, |_| -Fp::ONE)
    }

    /// √x, whose finite part is a square itself; `None` where that of x is none.
    pub(crate) fn root(&self) -> Option<Dual> {
        let root = self.at(0).square_root()?;
        // Newton's series: the next coefficient is the last one times (1/2 − k)/(k + 1).
        let next =
            |k: i64| Fp::from_integer(1 - 2 * k) * Fp::from_integer(2 * k + 2).inverse().unwrap_or(Fp::ZERO);
        self.series(root, next)
    }
}

impl std::ops::Add for &Dual {
    type Output = Dual;
    fn add(self, other: &Dual) -> Dual {
        self.with(other, |x, y| x + y)
    }
}

impl std::ops::Sub for &Dual {
    type Output = Dual;
    fn sub(self, other: &Dual) -> Dual {
        self.with(other, |x, y| x - y)
    }
}

impl std::ops::Mul for &Dual {
    type Output = Dual;
    fn mul(self, other: &Dual) -> Dual {
        let mut product = vec![Fp::ZERO; self.0.len().max(other.0.len())];
        for (i, x) in self.0.iter().enumerate().filter(|(_, x)| **x != Fp::ZERO) {
            for (j, y) in other.0.iter().enumerate().filter(|(j, _)| i & j == 0) {
                product[i | j] = product[i | j] + *x * *y;
            }
        }
        Dual(product)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dyngen_arm::exact::prime::Draws;

    #[test]
    fn inverses_and_roots_undo_products() {
        let mut draws = Draws::new(2);
        for _ in 0..4 {
            let parts = [1, 2, 4, 5, 3, 7].map(|index| Dual::along(index, draws.element()));
            let root = draws.element();
            let x = parts.iter().fold(Dual::number(root * root), |sum, part| &sum + part);
            let one = &x * &x.inverse().unwrap();
            assert_eq!(&one - &Dual::number(Fp::ONE), &x - &x);
            let y = x.root().unwrap();
            assert_eq!(&(&y * &y) - &x, &x - &x);
        }
    }

    #[test]
    fn sines_obey_the_theorem_of_addition_with_infinitesimals_too() {
        let mut draws = Draws::new(1);
        let mut angle = || {
            let change = [1, 2, 4, 5].map(|index| Dual::along(index, draws.element()));
            let sum = change.iter().fold(Dual::number(Fp::ZERO), |sum, x| &sum + x);
            let at = draws.element().circle_point();
            (sum, at)
        };
        let ((x, (s, c)), (y, (t, d))) = (angle(), angle());
        let (sum, cosine) = (&x + &y).sine_and_cosine((s * d + c * t, c * d - s * t));
        let ((sx, cx), (sy, cy)) = (x.sine_and_cosine((s, c)), y.sine_and_cosine((t, d)));
        assert_eq!(sum, &(&sx * &cy) + &(&cx * &sy));
        assert_eq!(cosine, &(&cx * &cy) - &(&sx * &sy));
        // ∂ sin = cos · ∂, where the infinitesimal itself is zero.
        let right = &cosine * &(&x + &y).by(2);
        for index in [0, 1, 4, 5] {
            assert_eq!(sum.by(2).at(index), right.at(index));
        }
    }
}
