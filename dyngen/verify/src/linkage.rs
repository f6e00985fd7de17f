//! Bars of linkages: where two circles about the outer pins of a loop meet is its middle pin.
//!
//! All is in the plane of the loop, in the axes before the joint's turn. With d the way from the first pin to
//! the last, and lengths L₂ and L₃ of rod and rocker, the middle pin is at (a·d ± h·(d turned left))/(2 d²)
//! from the first with a = d² + L₂² − L₃² and h the root of ((L₂ + L₃)² − d²)·(d² − (L₂ − L₃)²), which is 4
//! L₂² d² − a². Of the two roots modulo the prime it is the one that is a square itself, as for a root in the
//! file.

use crate::angles::{Circle, of_joint, residue};
use crate::dual::Dual;
use dyngen_arm::arm::{Arm, Convention, Hinge, Linkage};
use dyngen_arm::exact::prime::Fp;
use dyngen_arm::exact::rational::Rational;

type Point = [Dual; 2];

fn number(x: &Rational) -> Dual {
    Dual::number(residue(x))
}

fn dot(u: &Point, v: &Point) -> Dual {
    &(&u[0] * &v[0]) + &(&u[1] * &v[1])
}

fn minus(u: &Point, v: &Point) -> Point {
    std::array::from_fn(|i| &u[i] - &v[i])
}

/// The first and the last pin for the sine and cosine of the joint's angle.
fn pins(linkage: &Linkage, (sine, cosine): &(Dual, Dual)) -> [Point; 2] {
    let [x, y] = linkage.outer.each_ref().map(number);
    let first = [&(cosine * &x) - &(sine * &y), &(sine * &x) + &(cosine * &y)];
    [first, linkage.inner.each_ref().map(number)]
}

/// The square of the distance of the pins, and the number of which a root is taken.
fn squares(linkage: &Linkage, [first, last]: &[Point; 2]) -> [Dual; 2] {
    let way = minus(last, first);
    let distance = dot(&way, &way);
    let square = |x: Rational| number(&(&x * &x));
    let most = square(&linkage.rod + &linkage.rocker);
    let least = square(&linkage.rod - &linkage.rocker);
    let root_of = &(&most - &distance) * &(&distance - &least);
    [distance, root_of]
}

/// The squares of each linkage of an arm where sines and cosines are these; `None` where its joint's angle
/// has none.
pub(crate) fn at<'a>(arm: &'a Arm, circle: &'a Circle) -> impl Iterator<Item = Option<[Dual; 2]>> + 'a {
    arm.linkages().map(|linkage| {
        let (sine, cosine) = circle.sine_and_cosine(&of_joint(arm, linkage.joint))?;
        let pins = pins(linkage, &(Dual::number(sine), Dual::number(cosine)));
        Some(squares(linkage, &pins))
    })
}

/// Whether every linkage of an arm closes where sines and cosines are these.
pub(crate) fn close(arm: &Arm, circle: &Circle) -> bool {
    at(arm, circle).all(|squares| {
        squares.is_some_and(|[distance, square]| {
            distance.inverse().is_some() && square.inverse().is_some() && square.root().is_some()
        })
    })
}

/// Sine and cosine of the angle about the joint's axis from the axes of the link that carries a bar to the
/// bar, for those of the joint's angle. Zeros where the loop does not close: no point is taken there.
pub(crate) fn turn(hinge: &Hinge, joint: &(Dual, Dual)) -> (Dual, Dual) {
    let nothing = || (Dual::number(Fp::ZERO), Dual::number(Fp::ZERO));
    along(hinge, joint).unwrap_or_else(nothing)
}

fn along(hinge: &Hinge, joint: &(Dual, Dual)) -> Option<(Dual, Dual)> {
    let Hinge { linkage, rocker } = hinge;
    let pins = pins(linkage, joint);
    let [distance, root_of] = squares(linkage, &pins);
    let [first, last] = &pins;
    let way = minus(last, first);
    let left = [&Dual::number(Fp::ZERO) - &way[1], way[0].clone()];
    let a = &distance + &number(&(&linkage.rod * &linkage.rod - &linkage.rocker * &linkage.rocker));
    let h = root_of.root()?.times(if linkage.left { Fp::ONE } else { -Fp::ONE });
    let scale = distance.times(Fp::from_integer(2)).inverse()?;
    let middle: Point =
        std::array::from_fn(|i| &first[i] + &(&scale * &(&(&a * &way[i]) + &(&h * &left[i]))));
    if *rocker {
        let length = residue(&linkage.rocker).inverse()?;
        let [x, y] = minus(&middle, last).map(|x| x.times(length));
        return Some((y, x));
    }
    let length = residue(&linkage.rod).inverse()?;
    let along = minus(&middle, first).map(|x| x.times(length));
    // In axes that turn with the joint.
    let (sine, cosine) = joint;
    let x = dot(&along, &[cosine.clone(), sine.clone()]);
    let y = &(cosine * &along[1]) - &(sine * &along[0]);
    Some((y, x))
}

/// The twist between the joint's axis and the link that carries a bar, where there is one: of the joint's
/// alpha, or against it.
pub(crate) fn twist(convention: Convention, hinge: &Hinge) -> Option<bool> {
    match (convention, hinge.rocker) {
        (Convention::Modified, true) => Some(false),
        (Convention::Standard, false) => Some(true),
        _ => None,
    }
}
