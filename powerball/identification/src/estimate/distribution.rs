//! Tail probabilities that tests of significance need.

/// Degrees of freedom that are as good as any number of them: those of a normal distribution.
pub const MANY: f64 = 1e6;

/// P(F > x) of Fisher's F with `d1` and `d2` degrees of freedom.
#[must_use]
pub fn f_tail(x: f64, d1: f64, d2: f64) -> f64 {
    if x.is_nan() || x <= 0.0 || d1 <= 0.0 || d2 <= 0.0 {
        return 1.0;
    }
    incomplete_beta(d2 / (d2 + d1 * x), d2 / 2.0, d1 / 2.0)
}

/// The 97.5 % quantile of Student's t with `d` degrees of freedom: half the width of a 95 % interval in
/// standard errors.
#[must_use]
pub fn t_quantile_975(d: f64) -> f64 {
    // t² is distributed as F with 1 and d degrees of freedom.
    let (mut low, mut high) = (1.9, 1000.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if f_tail(middle * middle, 1.0, d) > 0.05 { low = middle } else { high = middle }
    }
    high
}

/// The value that |t| of Student's t with `d` degrees of freedom exceeds with probability `p`, down to 1e-12.
#[must_use]
pub fn t_critical(p: f64, d: f64) -> f64 {
    let (mut low, mut high) = (0.0f64, 1e12f64);
    for _ in 0..120 {
        // Halves the exponent first: the tails of few degrees of freedom are long.
        let middle = if high > 2.0 * low + 1.0 {
            ((low + 1.0) * (high + 1.0)).sqrt() - 1.0
        } else {
            0.5 * (low + high)
        };
        if f_tail(middle * middle, 1.0, d) > p { low = middle } else { high = middle }
    }
    high
}

/// The degrees of freedom whose 97.5 % quantile of Student's t it is.
#[must_use]
pub fn freedom_of(quantile: f64) -> f64 {
    // The quantile falls as the freedom grows.
    let (mut low, mut high) = (1.0f64, 65_535.0f64);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if t_quantile_975(middle) > quantile { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

/// The regularised incomplete beta function I_x(a, b), by its continued fraction (modified Lentz).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // The fraction converges fast below the mean only.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (a * x.ln() + b * (1.0 - x).ln() + ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b)).exp() / a;
    let tiny = 1e-300;
    let (mut c, mut d) = (1.0, 1.0 - (a + b) * x / (a + 1.0));
    d = 1.0 / if d.abs() < tiny { tiny } else { d };
    let mut fraction = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for term in [even, odd] {
            d = 1.0 + term * d;
            d = 1.0 / if d.abs() < tiny { tiny } else { d };
            c = 1.0 + term / c;
            c = if c.abs() < tiny { tiny } else { c };
            change = c * d;
            fraction *= change;
        }
        if (change - 1.0).abs() < 1e-14 {
            break;
        }
    }
    (front * fraction).clamp(0.0, 1.0)
}

/// ln Γ(x) for x > 0, by Stirling's series after shifting x upwards.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let s = 1.0 / (x * x);
    let series = 1.0 / (12.0 * x) * (1.0 - s / 30.0 + s * s / 105.0 - s * s * s / 140.0);
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_scipy() {
        // scipy.stats.f.sf(x, d1, d2)
        for (x, d1, d2, p) in [
            (1.0, 1.0, 10.0, 3.40893132302060e-01),
            (4.0, 1.0, 100.0, 4.82121787311336e-02),
            (3.2, 4.0, 60.0, 1.89753960014414e-02),
            (25.0, 1.0, 130.0, 1.81712458976649e-06),
            (60.0, 3.0, 90.0, 2.12076900246154e-21),
            (0.2, 10.0, 7.0, 9.88538792954589e-01),
            (250.0, 1.0, 200.0, 4.55578454531192e-37),
        ] {
            approx::assert_relative_eq!(f_tail(x, d1, d2), p, max_relative = 1e-8);
        }
        // scipy.stats.t.ppf(0.975, d)
        for (d, t) in [(1.0, 12.7062047364), (4.0, 2.7764451052), (30.0, 2.0422724563), (200.0, 1.9718962236)]
        {
            approx::assert_relative_eq!(t_quantile_975(d), t, max_relative = 1e-8);
            approx::assert_relative_eq!(freedom_of(t), d, max_relative = 1e-5);
            approx::assert_relative_eq!(t_critical(0.05, d), t, max_relative = 1e-8);
        }
        // By numerical integration of the density.
        approx::assert_relative_eq!(t_critical(2e-5, 40.0), 4.835023895055, max_relative = 1e-8);
        // scipy.stats.norm.isf(p / 2)
        approx::assert_relative_eq!(t_critical(1.25e-3, MANY), 3.2272187, max_relative = 1e-5);
        assert_eq!(f_tail(-1.0, 1.0, 5.0), 1.0);
        assert_eq!(f_tail(f64::NAN, 1.0, 5.0), 1.0);
    }
}
