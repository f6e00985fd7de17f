//! Angles of joints that follow others, in any algebra: multiples of an angle by the addition theorem.

use super::linkage::square;
use crate::arm::{Angle, Arm, JointKind, Linkage};
use crate::exact::algebra::Algebra;
use crate::exact::angle::circle_point_near;
use crate::exact::prime::{Fp, PrimeField};
use crate::exact::rational::{self, Rational};
use dashu_int::IBig;
use num_traits::{One, Signed};

/// Sine and cosine of the trigonometric input of every joint, where each group of joints that move together
/// is at a point of the circle that `draw` gives.
///
/// An angle that is p/q of another is p times one of which the other is q times. Where p or q exceeds
/// `largest`, the angle gets a point of its own: no sum of fewer than p or q angles distinguishes the two, so
/// for functions of the low degrees of a Lagrangian the sine and cosine of both are as good as free. A
/// constant between two angles that is not a multiple of pi/2 is taken to 1e-12 rad.
pub fn input_angles<A: Algebra>(
    alg: &A,
    arm: &Arm,
    number: &dyn Fn(&Rational) -> A::Value,
    draw: &mut dyn FnMut() -> (A::Value, A::Value),
    largest: Option<u32>,
) -> Vec<(A::Value, A::Value)> {
    let free = |x: &IBig| largest.is_some_and(|most| x.abs() > IBig::from(most));
    let revolute = |i: usize| arm.joints[i].kind == JointKind::Revolute;
    let drives = arm.drives();
    let mut angles: Vec<Option<(A::Value, A::Value)>> = vec![None; arm.links()];
    for leader in arm.coordinates() {
        let point = draw();
        let together: Vec<(usize, &Rational)> = (drives.iter().enumerate())
            .filter(|(i, drive)| drive.joint == leader && revolute(*i))
            .map(|(i, drive)| (i, &drive.ratio))
            .collect();
        let tied = |ratio: &Rational| !free(ratio.numerator()) && !free(&rational::denominator(ratio));
        // The least common multiple: b/a in lowest terms has in its numerator what a lacks.
        let common = |a: IBig, b: &IBig| rational::ratio(b.clone(), a.clone()).numerator() * a;
        let tied_ratios = together.iter().filter(|(_, ratio)| tied(ratio));
        let parts =
            tied_ratios.fold(IBig::one(), |parts, (_, ratio)| common(parts, &rational::denominator(ratio)));
        for (joint, ratio) in together {
            // A free angle has no constant relation to another angle.
            if !tied(ratio) {
                angles[joint] = Some(draw());
                continue;
            }
            let turned =
                multiple_of(alg, &(ratio.numerator() * &parts / rational::denominator(ratio)), &point);
            let shift = match arm.phase(joint) {
                phase if phase.quarter_turns().is_some() => {
                    with_theta(alg, &phase, (alg.integer(0), alg.integer(1)))
                }
                phase => {
                    let (sin, cos) = circle_point_near(phase.radians());
                    (number(&sin), number(&cos))
                }
            };
            angles[joint] = Some(sum_of_angles(alg, &turned, &shift));
        }
    }
    let zero = || (alg.integer(0), alg.integer(1));
    angles.into_iter().map(|angle| angle.unwrap_or_else(zero)).collect()
}

/// Poses that are tried until one is found at which all loops close.
const TRIES: i64 = 1 << 12;

/// Sines and cosines of [`input_angles`] modulo the prime, at which every linkage of the arm closes: the
/// number of which it takes a root is a square. `circle` gives a point for an attempt.
pub fn closing_angles(
    arm: &Arm,
    number: &dyn Fn(&Rational) -> Fp,
    circle: &mut dyn FnMut(i64) -> (Fp, Fp),
) -> Vec<(Fp, Fp)> {
    let mut angles = Vec::new();
    for attempt in 0..TRIES {
        angles = input_angles(&PrimeField, arm, number, &mut || circle(attempt), None);
        let closes = |linkage: &Linkage| {
            let turn = with_theta(&PrimeField, &arm.joints[linkage.joint].theta, angles[linkage.joint]);
            let [distance, square] = square(&PrimeField, linkage, number, &turn);
            distance != Fp::ZERO && square != Fp::ZERO && square.square_root().is_some()
        };
        if arm.linkages().all(closes) {
            break;
        }
    }
    angles
}

/// As [`closing_angles`], the same for every coordinate: zero, where loops close there.
pub fn still_angles(arm: &Arm, number: &dyn Fn(&Rational) -> Fp) -> Vec<(Fp, Fp)> {
    closing_angles(arm, number, &mut |attempt| Fp::from_integer(attempt).circle_point())
}

/// Sine and cosine of an angle and quarter turns, 0 to 3, from those of the angle.
pub fn quarter_turned<A: Algebra>(alg: &A, turns: u8, (s, c): (A::Value, A::Value)) -> (A::Value, A::Value) {
    match turns {
        1 => (c, alg.neg(&s)),
        2 => (alg.neg(&s), alg.neg(&c)),
        3 => (alg.neg(&c), s),
        _ => (s, c),
    }
}

/// Sine and cosine of q + theta of a joint from those of its trigonometric input, which holds theta already
/// where that is not a multiple of pi/2.
pub fn with_theta<A: Algebra>(alg: &A, theta: &Angle, input: (A::Value, A::Value)) -> (A::Value, A::Value) {
    quarter_turned(alg, theta.quarter_turns().unwrap_or(0), input)
}

/// Sine and cosine of a sum of two angles.
fn sum_of_angles<A: Algebra>(
    alg: &A,
    (s, c): &(A::Value, A::Value),
    (t, d): &(A::Value, A::Value),
) -> (A::Value, A::Value) {
    (alg.add(&alg.mul(s, d), &alg.mul(c, t)), alg.sub(&alg.mul(c, d), &alg.mul(s, t)))
}

/// Sine and cosine of a multiple of an angle, by doubling.
fn multiple_of<A: Algebra>(alg: &A, count: &IBig, angle: &(A::Value, A::Value)) -> (A::Value, A::Value) {
    let mut total = (alg.integer(0), alg.integer(1));
    let mut power = angle.clone();
    let mut rest = count.abs();
    while !rest.is_zero() {
        if &rest % 2 != 0 {
            total = sum_of_angles(alg, &total, &power);
        }
        rest >>= 1usize;
        if !rest.is_zero() {
            power = sum_of_angles(alg, &power, &power);
        }
    }
    if count.is_negative() { (alg.neg(&total.0), total.1) } else { total }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::prime::Draws;

    #[test]
    fn multiples_of_an_angle_are_sums_of_it() {
        let point = Draws::new(7).element().circle_point();
        let mut added = (Fp::ZERO, Fp::ONE);
        for count in 0..40 {
            let (s, c) = multiple_of(&PrimeField, &IBig::from(count), &point);
            assert_eq!((s, c), added);
            assert_eq!(multiple_of(&PrimeField, &IBig::from(-count), &point), (-s, c));
            added = sum_of_angles(&PrimeField, &added, &point);
        }
    }
}
