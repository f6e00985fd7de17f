//! A signal by cycles of a turn: what repeats with a joint's or its motor's position.

use std::f64::consts::TAU;

/// Amplitudes of a signal by order, cycles a joint turn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turns {
    /// Cycles a turn.
    pub orders: Vec<f64>,
    /// Amplitude of that order alone, in the signal's unit.
    pub amplitudes: Vec<f64>,
}

/// The amplitudes of `signal` at positions `q` (rad), from `least` to `most` cycles a turn.
///
/// Each order is fitted alone with a constant, a·cos(order·q) + b·sin(order·q) + c, by least squares:
/// positions need not be even. Orders stand near enough that none is missed between two: a quarter of one
/// cycle over the range of q apart.
#[must_use]
pub fn turns(q: &[f64], signal: &[f64], least: f64, most: f64) -> Turns {
    let (low, high) = q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(*q), h.max(*q)));
    let range = high - low;
    if q.len() < 20 || q.len() != signal.len() || !(range > 0.05 && most > least) {
        return Turns::default();
    }
    let step = 0.25 * TAU / range;
    let first = (least / step).ceil().max(4.0) as usize;
    let orders: Vec<f64> = (first..).map(|k| k as f64 * step).take_while(|order| *order <= most).collect();
    let amplitudes = orders.iter().map(|order| amplitude(q, signal, *order)).collect();
    Turns { orders, amplitudes }
}

fn amplitude(q: &[f64], signal: &[f64], order: f64) -> f64 {
    let n = q.len() as f64;
    let [mut sc, mut ss, mut scc, mut sss, mut scs, mut sy, mut scy, mut ssy] = [0.0; 8];
    for (q, y) in q.iter().zip(signal) {
        let (s, c) = (order * q).sin_cos();
        sc += c;
        ss += s;
        scc += c * c;
        sss += s * s;
        scs += c * s;
        sy += y;
        scy += c * y;
        ssy += s * y;
    }
    // Without the constant.
    let (cc, cs, s2) = (scc - sc * sc / n, scs - sc * ss / n, sss - ss * ss / n);
    let (cy, sy) = (scy - sc * sy / n, ssy - ss * sy / n);
    let determinant = cc * s2 - cs * cs;
    if determinant <= 1e-9 * n * n {
        return 0.0;
    }
    let (a, b) = ((s2 * cy - cs * sy) / determinant, (cc * sy - cs * cy) / determinant);
    a.hypot(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two ripples and a constant, positions as uneven as those of a swinging joint.
    #[test]
    fn ripples_stand_at_their_orders_with_their_amplitudes() {
        let q: Vec<f64> = (0..6000).map(|k| 1.4 * (0.01 * f64::from(k)).sin() + 0.3).collect();
        let y: Vec<f64> =
            q.iter().map(|q| 5.0 + 0.8 * (161.0 * q + 0.4).cos() + 0.3 * (7.0 * q).sin()).collect();
        let found = turns(&q, &y, 1.0, 400.0);
        let at = |order: f64| {
            let near = found.orders.iter().zip(&found.amplitudes).filter(|(o, _)| (*o - order).abs() < 1.2);
            near.map(|(_, a)| *a).fold(0.0, f64::max)
        };
        approx::assert_abs_diff_eq!(at(161.0), 0.8, epsilon = 0.1);
        approx::assert_abs_diff_eq!(at(7.0), 0.3, epsilon = 0.06);
        // A swing's positions leak like the Bessel function J0, about √(2/(π·1.4·Δ)) at Δ cycles a turn from
        // a ripple: 0.8 of it at 71 and 0.3 of it at 83.
        assert!(at(90.0) < 0.1 && at(322.0) < 0.1 && found.orders.len() > 100);
        assert_eq!(turns(&[1.0; 50], &[0.0; 50], 1.0, 9.0), Turns::default());
    }
}
