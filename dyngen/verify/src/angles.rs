//! Sines and cosines of an arm's angles at a point of the prime field: of every angle that is a sum of
//! multiples of the coordinates and of constants of the arm.

use dyngen_arm::arm::{Angle, Arm, JointKind};
use dyngen_arm::exact::angle::circle_point_near;
use dyngen_arm::exact::prime::{Draws, Fp};
use dyngen_arm::exact::rational::{self, Rational, denominator, integer, is_integer, ratio};
use dyngen_arm::exact::symbols::{AngleSymbols, Trig};
use std::collections::BTreeMap;

/// A number of the arm modulo the prime; zero where the prime divides its denominator, which no file has.
pub(crate) fn residue(x: &Rational) -> Fp {
    Fp::from_rational(x).unwrap_or(Fp::ZERO)
}

/// Σ factor·q + radians + turns·pi.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Affine {
    /// Factors of coordinates, none of them zero.
    pub(crate) of: BTreeMap<usize, Rational>,
    pub(crate) radians: Rational,
    pub(crate) turns: Rational,
}

impl Affine {
    pub(crate) fn constant(radians: Rational, turns: Rational) -> Affine {
        Affine { of: BTreeMap::new(), radians, turns }
    }

    pub(crate) fn coordinate(index: usize) -> Affine {
        Affine { of: BTreeMap::from([(index, integer(1))]), ..Affine::default() }
    }

    /// self + factor·other
    pub(crate) fn plus(&self, factor: &Rational, other: &Affine) -> Affine {
        let mut of = self.of.clone();
        for (coordinate, x) in &other.of {
            *of.entry(*coordinate).or_default() += factor * x;
        }
        of.retain(|_, x| *x != Rational::ZERO);
        Affine {
            of,
            radians: &self.radians + factor * &other.radians,
            turns: &self.turns + factor * &other.turns,
        }
    }

    /// The number, where it is one.
    pub(crate) fn as_number(&self) -> Option<&Rational> {
        (self.of.is_empty() && self.turns == Rational::ZERO).then_some(&self.radians)
    }
}

fn affine(angle: &Angle) -> Affine {
    match angle {
        Angle::PiMultiple(turns) => Affine::constant(Rational::ZERO, turns.clone()),
        Angle::Radians(x) => Affine::constant(x.clone(), Rational::ZERO),
    }
}

/// The position of a joint of the chain by the coordinates; of a revolute one with its theta.
pub(crate) fn of_joint(arm: &Arm, joint: usize) -> Affine {
    match arm.joints[joint].kind {
        JointKind::Revolute => position(arm, joint).plus(&integer(1), &affine(&arm.joints[joint].theta)),
        JointKind::Prismatic => position(arm, joint),
    }
}

/// Ratio·q + offset.
fn position(arm: &Arm, joint: usize) -> Affine {
    let drive = &arm.drives()[joint];
    Affine::constant(drive.offset.clone(), Rational::ZERO)
        .plus(&drive.ratio, &Affine::coordinate(drive.coordinate))
}

/// The arm's constant angles whose sine and cosine are no rational numbers: twists, fixed angles of prismatic
/// joints, and those of frames.
pub(crate) fn constant_angles(arm: &Arm) -> AngleSymbols {
    let fixed =
        arm.joints.iter().filter(|joint| joint.kind == JointKind::Prismatic).map(|joint| &joint.theta);
    let of_joints = arm.joints.iter().map(|joint| &joint.alpha).chain(fixed);
    let frames = arm.tool.iter().chain(&arm.base).chain(arm.frames.iter().map(|frame| &frame.placement));
    AngleSymbols::collect(of_joints.chain(frames.flat_map(|placement| &placement.rpy)))
}

/// What stands for sines and cosines at a point: as good as free, but for what holds between them.
#[derive(Clone, Debug)]
pub(crate) struct Circle {
    constants: AngleSymbols,
    /// Sine and cosine of each constant angle.
    of_constants: Vec<(Fp, Fp)>,
    coordinates: Vec<Unit>,
    /// Sums of constants between angles of joints that move together: radians and a multiple of pi without
    /// quarter turns, with sine and cosine.
    phases: BTreeMap<(Rational, Rational), (Fp, Fp)>,
}

/// An angle of which all angles of a kind are multiples.
#[derive(Clone, Debug)]
struct Unit {
    /// How many of it make the coordinate with `with`.
    parts: Rational,
    /// What a coordinate's own joint adds to it: theta, where that is no quarter turn.
    with: Affine,
    sine_and_cosine: (Fp, Fp),
}

/// Sums of the constants of more joints than this are not looked for.
const MOST_PHASES: usize = 6;

impl Circle {
    /// A random one; `constants` are those of the arm with all its frames.
    pub(crate) fn draw(arm: &Arm, constants: &AngleSymbols, draws: &mut Draws) -> Circle {
        let of_constants = (0..constants.angles.len()).map(|k| constants.modular(k, draws)).collect();
        let drives = arm.drives();
        let of_coordinate = |(coordinate, leader): (usize, usize)| {
            let following = drives.iter().filter(|drive| drive.coordinate == coordinate);
            // The least common multiple of denominators: b/a in lowest terms has in its numerator what a
            // lacks.
            let more = |a: Rational, ratio: Rational| {
                let lacking = rational::ratio(denominator(&ratio), 1) / &a;
                a * rational::ratio(lacking.numerator().clone(), 1)
            };
            Unit {
                parts: following.map(|drive| drive.ratio.clone()).fold(integer(1), more),
                with: match arm.joints[leader].kind {
                    JointKind::Revolute => affine(&arm.joints[leader].theta_in_angle()),
                    JointKind::Prismatic => Affine::default(),
                },
                sine_and_cosine: draws.element().circle_point(),
            }
        };
        let coordinates: Vec<Unit> = arm.coordinates().into_iter().enumerate().map(of_coordinate).collect();
        let following = (0..arm.links()).filter(|i| arm.phase(*i).quarter_turns().is_none());
        let none = (Rational::ZERO, Rational::ZERO);
        let mut phases = BTreeMap::from([(none.clone(), (Fp::ZERO, Fp::ONE))]);
        for (n, joint) in following.enumerate() {
            let theta = affine(&arm.joints[joint].theta_in_angle());
            let phase = rest(&position(arm, joint).plus(&integer(1), &theta), &coordinates);
            // Where only the sum of two angles matters, their constants must be numbers: to 1e-12 rad, as
            // everywhere in dyngen.
            let (s, c) = circle_point_near(arm.phase(joint).radians());
            let (s, c) = (residue(&s), residue(&c));
            // Each joint's own angle must be there; sums would become too many.
            let summed = phases.iter().filter(|(k, _)| n < MOST_PHASES || **k == none);
            let known: Vec<_> = summed.map(|(k, x)| (k.clone(), *x)).collect();
            for ((radians, turns), at) in known {
                for sign in [1, -1] {
                    let sum = Affine::constant(radians.clone(), turns.clone()).plus(&integer(sign), &phase);
                    let (quarters, left) = remainder(&sum.turns);
                    let point = added(at, (if sign < 0 { -s } else { s }, c));
                    phases.entry((sum.radians, left)).or_insert(turned(point, 4 - quarters));
                }
            }
        }
        Circle { constants: constants.clone(), of_constants, coordinates, phases }
    }

    /// This one where every coordinate with its theta has one angle: zero for `k` zero.
    pub(crate) fn at(&self, k: i64) -> Circle {
        let sine_and_cosine = Fp::from_integer(k).circle_point();
        let still = |unit: &Unit| Unit { sine_and_cosine, ..unit.clone() };
        Circle { coordinates: self.coordinates.iter().map(still).collect(), ..self.clone() }
    }

    /// The sine (`true`) or cosine of a constant angle.
    pub(crate) fn constant(&self, index: usize, sine: bool) -> Option<Fp> {
        self.of_constants.get(index).map(|(s, c)| if sine { *s } else { *c })
    }

    /// The constant angle of a text.
    pub(crate) fn constant_named(&self, text: &str) -> Option<usize> {
        self.constants.angles.iter().position(|angle| angle.to_string() == text)
    }

    /// What a coordinate's own joint adds to it: theta, where that is no quarter turn.
    pub(crate) fn added_to(&self, coordinate: usize) -> Option<&Affine> {
        self.coordinates.get(coordinate).map(|unit| &unit.with)
    }

    /// Sine and cosine of a coordinate that turns, with theta where that is no quarter turn.
    pub(crate) fn of_coordinate(&self, index: usize) -> (Fp, Fp) {
        let unit = &self.coordinates[index];
        unit.multiple(&integer(1)).unwrap_or(unit.sine_and_cosine)
    }

    /// Sine and cosine of a constant angle of the arm.
    pub(crate) fn of_constant(&self, angle: &Angle) -> (Fp, Fp) {
        let signed = |negative: bool, x: Fp| if negative { -x } else { x };
        let of = |trig: Trig| match trig {
            Trig::Zero => Fp::ZERO,
            Trig::One { negative } => signed(negative, Fp::ONE),
            Trig::Symbol { index, sine, negative } => {
                signed(negative, self.constant(index, sine).unwrap_or(Fp::ZERO))
            }
        };
        let (sine, cosine) = self.constants.sin_cos(angle);
        (of(sine), of(cosine))
    }

    /// Sine and cosine of an angle; nothing where it is none of the arm's.
    pub(crate) fn sine_and_cosine(&self, angle: &Affine) -> Option<(Fp, Fp)> {
        let mut sum = (Fp::ZERO, Fp::ONE);
        for (coordinate, factor) in &angle.of {
            sum = added(sum, self.coordinates.get(*coordinate)?.multiple(factor)?);
        }
        let rest = rest(angle, &self.coordinates);
        let (quarters, left) = remainder(&rest.turns);
        let phase = self.phases.get(&(rest.radians, left))?;
        Some(turned(added(sum, *phase), quarters))
    }
}

/// What an angle is more than multiples of the coordinates with their thetas: a constant.
fn rest(angle: &Affine, coordinates: &[Unit]) -> Affine {
    let without = |sum: Affine, (coordinate, factor): (&usize, &Rational)| {
        coordinates.get(*coordinate).map_or(sum.clone(), |unit| sum.plus(&-factor, &unit.with))
    };
    let rest = angle.of.iter().fold(angle.clone(), without);
    Affine::constant(rest.radians, rest.turns)
}

/// Sine and cosine after quarter turns.
fn turned(at: (Fp, Fp), quarters: usize) -> (Fp, Fp) {
    (0..quarters % 4).fold(at, |(s, c), _| (c, -s))
}

impl Unit {
    /// A multiple of the angle that has the `parts`, by doubling.
    fn multiple(&self, factor: &Rational) -> Option<(Fp, Fp)> {
        let count = factor * &self.parts;
        if !is_integer(&count) {
            return None;
        }
        let mut rest = num_traits::abs(count.numerator().clone());
        let (mut sum, mut power) = ((Fp::ZERO, Fp::ONE), self.sine_and_cosine);
        while rest != dashu_int::IBig::ZERO {
            if &rest % 2 != 0 {
                sum = added(sum, power);
            }
            rest >>= 1usize;
            power = added(power, power);
        }
        Some(if *factor < Rational::ZERO { (-sum.0, sum.1) } else { sum })
    }
}

/// Sine and cosine of the sum of two angles.
fn added((s, c): (Fp, Fp), (t, d): (Fp, Fp)) -> (Fp, Fp) {
    (s * d + c * t, c * d - s * t)
}

/// Quarter turns, 0 to 3, and the nearest rest of a multiple of pi.
fn remainder(turns: &Rational) -> (usize, Rational) {
    let quarters = (turns * integer(2) + ratio(1, 2)).floor();
    let rest = turns - rational::ratio(quarters.clone(), 2);
    let whole = usize::try_from(((quarters % 4) + 4) % 4).unwrap_or(0);
    (whole, rest)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const ARM: &str = r#"
name = "a"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 1, alpha = 0, d = 0, theta = "pi/2" },
    { kind = "revolute", a = 1, alpha = 0.4, d = 0, theta = 0.3 },
    { kind = "revolute", a = 1, alpha = "pi/3", d = 0, theta = "pi/3", mimic = { joint = 2, ratio = "-2/3", offset = 0.1 } },
]
"#;

    #[test]
    fn sines_of_sums_are_sums() {
        let arm = Arm::parse(ARM, "arm.toml").unwrap();
        let circle = Circle::draw(&arm, &constant_angles(&arm), &mut Draws::new(3));
        let joints: Vec<Affine> = (0..3).map(|i| of_joint(&arm, i)).collect();
        let of = |angle: &Affine| circle.sine_and_cosine(angle).unwrap();
        for (i, j) in [(0, 1), (1, 2), (0, 2)] {
            let sum = joints[i].plus(&integer(1), &joints[j]);
            assert_eq!(of(&sum), added(of(&joints[i]), of(&joints[j])));
        }
        // The third is −2/3 of the second, and a constant.
        let constants = joints[2].plus(&ratio(2, 3), &joints[1]);
        assert!(constants.of.is_empty());
        assert_eq!(circle.sine_and_cosine(&Affine::coordinate(1).plus(&ratio(1, 2), &joints[1])), None);
        assert!(circle.sine_and_cosine(&constants).is_some());
        let (s, c) = of(&Affine::constant(Rational::ZERO, ratio(3, 2)));
        assert_eq!((s, c), (-Fp::ONE, Fp::ZERO));
        assert_eq!(circle.of_constant(&Angle::parse("0.4").unwrap()), circle.of_constants[0]);
    }

    #[test]
    fn each_of_many_followers_has_a_sine() {
        let follower = |k: usize| {
            let mimic = "mimic = { joint = 2, ratio = -1 }";
            format!("{{ kind = \"revolute\", a = 1, alpha = 0, d = 0, theta = 0.{k}1, {mimic} }},\n")
        };
        let followers: String = (1..=MOST_PHASES + 2).map(follower).collect();
        let text = format!("{}{followers}]", ARM.trim_end().trim_end_matches(']'));
        let arm = Arm::parse(&text, "arm.toml").unwrap();
        let circle = Circle::draw(&arm, &constant_angles(&arm), &mut Draws::new(3));
        let lacks = (0..arm.joints.len()).find(|i| circle.sine_and_cosine(&of_joint(&arm, *i)).is_none());
        assert_eq!((arm.joints.len(), lacks), (MOST_PHASES + 5, None));
    }
}
