//! How the bars of a linkage turn with its joint, in any algebra with roots.
//!
//! All is in the plane of the loop, in axes that turn with the joint: there the first pin p stands still, and
//! the last one is w, at d from it. The middle pin is at the ends of rod and rocker, so from the first one
//! u/(2D²) with u = (D² + L₂² − L₃²)·d ± √S·(d turned left), where D² = d·d and S is the linkage's number.
//! The pins' distances stay as they are, which gives the rates, and their rates.

use crate::arm::Linkage;
use crate::exact::algebra::Roots;
use crate::exact::rational::{self, Rational};

/// How a bar turns on the link that carries its pin.
#[derive(Clone, Debug)]
pub struct BarTurn<V> {
    /// Sine of the angle from the plane's axes on that link to the bar.
    pub sin: V,
    /// Cosine of that angle.
    pub cos: V,
    /// The angle's derivative by the joint's position.
    pub rate: V,
    /// Its second derivative.
    pub bend: V,
}

/// How the rod and the rocker of a linkage turn.
pub type BarTurns<V> = [BarTurn<V>; 2];

impl<V> BarTurn<V> {
    /// This turn with something else in place of each quantity.
    pub fn map<W>(self, mut f: impl FnMut(V) -> W) -> BarTurn<W> {
        BarTurn { sin: f(self.sin), cos: f(self.cos), rate: f(self.rate), bend: f(self.bend) }
    }
}

/// The square of the distance of the first pin from the last, D², and the number S of which a root is taken,
/// for the sine and cosine of the joint's angle q + theta.
pub fn square<A: Roots>(
    alg: &A,
    linkage: &Linkage,
    number: &dyn Fn(&Rational) -> A::Value,
    turn: &(A::Value, A::Value),
) -> [A::Value; 2] {
    let Linkage { outer: p, inner, rod, rocker, .. } = linkage;
    let w = inner_pin(alg, linkage, number, turn);
    let twice = |x: &Rational| number(&(x + x));
    let along = alg.add(&alg.mul(&twice(&p[0]), &w[0]), &alg.mul(&twice(&p[1]), &w[1]));
    let squares = p.iter().chain(inner).fold(rational::integer(0), |sum, x| sum + x * x);
    let distance = alg.sub(&number(&squares), &along);
    let [sum, difference] = [rod + rocker, rod - rocker];
    let outwards = alg.sub(&number(&(&sum * &sum)), &distance);
    let inwards = alg.sub(&distance, &number(&(&difference * &difference)));
    let square = alg.mul(&outwards, &inwards);
    [distance, square]
}

/// The last pin in the axes that turn with the joint.
fn inner_pin<A: Roots>(
    alg: &A,
    linkage: &Linkage,
    number: &dyn Fn(&Rational) -> A::Value,
    (sin, cos): &(A::Value, A::Value),
) -> [A::Value; 2] {
    let [x, y] = linkage.inner.each_ref().map(number);
    [alg.add(&alg.mul(cos, &x), &alg.mul(sin, &y)), alg.sub(&alg.mul(cos, &y), &alg.mul(sin, &x))]
}

/// How rod and rocker turn for the sine and cosine of the joint's angle q + theta; `None` at a dead point, or
/// where S has no root.
pub fn turns<A: Roots>(
    alg: &A,
    linkage: &Linkage,
    number: &dyn Fn(&Rational) -> A::Value,
    turn: &(A::Value, A::Value),
) -> Option<BarTurns<A::Value>> {
    let Linkage { rod, rocker, left, .. } = linkage;
    let [distance, square] = square(alg, linkage, number, turn);
    let root = alg.root(&square)?;
    let half = number(&rational::ratio(1, 2));
    let signed = |x: A::Value| if *left { x } else { alg.neg(&x) };
    let across =
        |u: &[A::Value; 2], v: &[A::Value; 2]| alg.sub(&alg.mul(&u[0], &v[1]), &alg.mul(&u[1], &v[0]));
    let along =
        |u: &[A::Value; 2], v: &[A::Value; 2]| alg.add(&alg.mul(&u[0], &v[0]), &alg.mul(&u[1], &v[1]));
    let p = linkage.outer.each_ref().map(number);
    let w = inner_pin(alg, linkage, number, turn);
    let d = [alg.sub(&w[0], &p[0]), alg.sub(&w[1], &p[1])];
    let [rod_square, rocker_square] = [rod * rod, rocker * rocker];
    let by_half = alg.mul(&half, &alg.inverse(&distance)?);
    let share = alg.mul(&by_half, &alg.add(&distance, &number(&(&rod_square - &rocker_square))));
    let height = alg.mul(&by_half, &signed(root.clone()));
    // From the first pin to the middle one, and from the last.
    let of_rod = [
        alg.sub(&alg.mul(&share, &d[0]), &alg.mul(&height, &d[1])),
        alg.add(&alg.mul(&share, &d[1]), &alg.mul(&height, &d[0])),
    ];
    let of_rocker = [alg.sub(&of_rod[0], &d[0]), alg.sub(&of_rod[1], &d[1])];
    let scale = signed(alg.mul(&number(&rational::integer(2)), &alg.inverse(&root)?));
    let lever = across(&of_rod, &p);
    // Of both bars against the link before the joint.
    let rates = [alg.mul(&scale, &alg.sub(&lever, &across(&w, &p))), alg.mul(&scale, &lever)];
    let squares = rates.each_ref().map(|rate| alg.mul(rate, rate));
    let both = alg.mul(&half, &alg.sub(&number(&(&rod_square + &rocker_square)), &distance));
    let bend = |of: &[A::Value; 2], first: &A::Value, second: &A::Value| {
        let turned = alg.sub(&alg.mul(first, &squares[0]), &alg.mul(second, &squares[1]));
        alg.mul(&scale, &alg.add(&along(of, &p), &turned))
    };
    let bends =
        [bend(&of_rocker, &both, &number(&rocker_square)), bend(&of_rod, &number(&rod_square), &both)];
    let inverse = |length: &Rational| number(&(rational::integer(1) / length));
    let (sin, cos) = turn;
    // The rocker's direction in the axes before the turn.
    let before = [
        alg.sub(&alg.mul(cos, &of_rocker[0]), &alg.mul(sin, &of_rocker[1])),
        alg.add(&alg.mul(sin, &of_rocker[0]), &alg.mul(cos, &of_rocker[1])),
    ];
    let unit = |v: &[A::Value; 2], length: &Rational| v.each_ref().map(|x| alg.mul(&inverse(length), x));
    let ([rod_cos, rod_sin], [rocker_cos, rocker_sin]) = (unit(&of_rod, rod), unit(&before, rocker));
    let [rod_rate, rocker_rate] = rates;
    let [rod_bend, rocker_bend] = bends;
    // The rod is on the link behind the joint.
    let rod_rate = alg.sub(&rod_rate, &alg.integer(1));
    Some([
        BarTurn { sin: rod_sin, cos: rod_cos, rate: rod_rate, bend: rod_bend },
        BarTurn { sin: rocker_sin, cos: rocker_cos, rate: rocker_rate, bend: rocker_bend },
    ])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::exact::dual::Duals;
    use crate::exact::prime::{Draws, Fp, PrimeField};

    /// The rates are the derivatives of sines, the second derivatives those of the rates.
    #[test]
    fn rates_are_derivatives() {
        let number = |x: &Rational| (Fp::from_rational(x).unwrap(), Fp::ZERO);
        let mut draws = Draws::new(3);
        for left in [true, false] {
            let length = |n: i64| rational::ratio(n, 10);
            let linkage = Linkage {
                joint: 0,
                outer: [length(2), length(1)],
                inner: [length(9), length(-2)],
                rod: length(7),
                rocker: length(5),
                left,
            };
            let mut seen = 0;
            while seen < 3 {
                let (s, c) = draws.element().circle_point();
                let turn = ((s, c), (c, -s));
                let Some(turns) = turns(&Duals(PrimeField), &linkage, &number, &turn) else { continue };
                seen += 1;
                for BarTurn { sin, cos, rate, bend } in turns {
                    assert_eq!(sin.0 * sin.0 + cos.0 * cos.0, Fp::ONE);
                    assert_eq!(sin.1, cos.0 * rate.0);
                    assert_eq!(rate.1, bend.0);
                }
            }
        }
    }
}
