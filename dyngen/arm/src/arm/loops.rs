//! `[[loop]]`: planar loops of four bars, which close on the chain. Their bars that are no links are
//! [`Bar`]s. Joints of the chain in one parallelogram are affine functions of each other. In other loops,
//! which have one joint of the chain, the bars turn as a [`Linkage`] says.

use super::table::{Reader, Table, Value, describe};
use super::{Angle, Bar, Convention, Hinge, Joint, JointKind, Linkage, Mimic, ParameterKind};
use crate::exact::rational::{self, Rational, to_f64};
use num_traits::{Signed, Zero};
use std::f64::consts::TAU;
use toml::de::DeValue;

const KEYS: [&str; 6] = ["joints", "lengths", "inner", "outer", "middle", "bar"];
const BAR_KEYS: [&str; 2] = ["name", "zero"];
/// The bars of a loop.
const BARS: usize = 4;
/// The most loops that an arm may have.
const MAX_LOOPS: usize = 8;
/// Lengths and angles that differ by less are the same, m or rad.
pub(super) const SAME: f64 = 1e-9;

/// A loop as the file says it.
struct Loop {
    /// The loop's joints of the chain: one, or two neighbours.
    first: usize,
    last: usize,
    /// The names of its other joints, from the outer link on.
    pins: Vec<String>,
    /// Distance of each joint to the next.
    lengths: [Rational; BARS],
    /// Direction from the first joint to the last pin, on the link before it.
    inner: Angle,
    /// Direction from the last joint of the chain to the first pin, on the link behind it.
    outer: Angle,
    /// Whether the middle one of three pins is on the left of the way from the first to the last; nothing
    /// where a parallelogram is meant.
    left: Option<bool>,
}

/// Reads the loops of an arm and lets the joints that they tie follow each other.
pub(super) fn read(
    reader: &mut Reader<'_>,
    tables: &[Table<'_, '_>],
    convention: Convention,
    joints: &mut [Joint],
) -> Option<Vec<Bar>> {
    if let Some(t) = tables.get(MAX_LOOPS) {
        reader
            .errors
            .error(t.span.clone(), format!("{}: an arm may have at most {MAX_LOOPS} loops", t.place));
        return None;
    }
    let mut bars = Vec::new();
    let mut linkages: Vec<(&Table<'_, '_>, Linkage)> = Vec::new();
    let mut sound = true;
    for t in tables {
        reader.unknown_keys(t, &KEYS);
        let found = read_one(reader, t, convention, joints).and_then(|found| {
            tie(joints, convention, &found)
                .map_err(|why| reader.errors.error(t.span.clone(), format!("{}: {why}", t.place)))
                .ok()?;
            let own = found.bars(convention, joints);
            described(reader, t, own)
        });
        let Some(own) = found else {
            sound = false;
            continue;
        };
        if let Some(hinge) = own.iter().find_map(|bar| bar.hinge.as_ref()) {
            if linkages.iter().any(|(_, other)| other.joint == hinge.linkage.joint) {
                let message = format!("{}: its joint has another loop that is no parallelogram", t.place);
                reader.errors.error(t.span.clone(), message);
                sound = false;
            }
            linkages.push((t, hinge.linkage.clone()));
        }
        for bar in own {
            if bars.iter().any(|other: &Bar| other.name == bar.name) {
                let message = format!(
                    "{}: the name '{}' is already that of another bar: give each its own in [[loop.bar]]",
                    t.place, bar.name
                );
                reader.errors.error(t.span.clone(), message);
                sound = false;
            }
            bars.push(bar);
        }
    }
    // Now every joint that follows another one is known.
    for (t, linkage) in &linkages {
        if let Some(why) = open(joints, linkage) {
            reader.errors.error(t.span.clone(), format!("{}: {why}", t.place));
            sound = false;
        }
    }
    sound.then_some(bars)
}

fn read_one(
    reader: &mut Reader<'_>,
    t: &Table<'_, '_>,
    convention: Convention,
    joints: &[Joint],
) -> Option<Loop> {
    let place = &t.place;
    let named = reader.required(t, "joints").and_then(|v| names(reader, v, place, joints));
    let lengths = reader.required(t, "lengths").and_then(|v| lengths(reader, v, place));
    let mut direction =
        |key: &str| reader.required(t, key).and_then(|v| reader.angle(v, &format!("{place}: {key}")));
    let (inner, outer) = (direction("inner"), direction("outer"));
    let left = reader.optional(t, "middle", |r, v| side(r, v, place));
    let (first, last, pins) = named?;
    let found = Loop { first, last, pins, lengths: lengths?, inner: inner?, outer: outer?, left: left? };
    let wrong = planar(joints, convention, &found).or_else(|| found.unequal(convention, joints));
    if let Some(why) = wrong {
        reader.errors.error(t.span.clone(), format!("{place}: {why}"));
        return None;
    }
    Some(found)
}

/// Why a linkage does not close within the limits of its joint; of one that follows others, within those of
/// the joint that moves on its own.
fn open(joints: &[Joint], linkage: &Linkage) -> Option<String> {
    let joint = &joints[linkage.joint];
    let (mut leader, mut ratio, mut offset) = (joint, 1.0, 0.0);
    // A circle of joints is reported elsewhere.
    for _ in joints {
        let Some(mimic) = &leader.mimic else { break };
        offset += ratio * to_f64(&mimic.offset);
        ratio *= to_f64(&mimic.ratio);
        leader = &joints[mimic.joint];
    }
    // Without limits the joint that moves on its own may turn as far as it likes.
    let limits = leader.position.map(|limits| limits.map(|q| ratio * q + offset));
    let limits = limits.map(|[a, b]| [a.min(b), a.max(b)]);
    let closes = linkage.open_within(limits, joint.theta.radians())?;
    let of = if joint.mimic.is_some() { ", of the joint that it follows," } else { "" };
    Some(format!(
        "it closes only where q of joint {} is {closes}, and at these ends it is at a dead point: give the \
         joint{of} limits (position) within",
        linkage.joint + 1
    ))
}

/// The four joints of a loop: the first and the last of the chain, and the names of the others.
fn names(
    reader: &mut Reader<'_>,
    v: &Value<'_>,
    place: &str,
    joints: &[Joint],
) -> Option<(usize, usize, Vec<String>)> {
    let items: Vec<&Value<'_>> = v.get_ref().as_array().map(|a| a.iter().collect()).unwrap_or_default();
    let mut fail = |span, message: String| {
        reader.errors.error(span, format!("{place}: joints {message}"));
        None
    };
    if items.len() != BARS {
        let message = "must be the four joints around the loop: first one or two of the chain, by name or \
                       number, then names for its other pins";
        return fail(v.span(), format!("{message}, found {}", describe(v)));
    }
    let (mut of_chain, mut pins): (Vec<usize>, Vec<String>) = (Vec::new(), Vec::new());
    for item in items {
        let number = match item.get_ref() {
            DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse::<usize>().ok(),
            _ => None,
        };
        let text = item.get_ref().as_str().map(str::trim).filter(|text| !text.is_empty());
        let by_name = text.and_then(|text| joints.iter().position(|j| j.name.as_deref() == Some(text)));
        let joint = number.filter(|n| (1..=joints.len()).contains(n)).map(|n| n - 1).or(by_name);
        match (joint, text) {
            (Some(_), _) if !pins.is_empty() => {
                return fail(item.span(), "must begin with those of the chain: pins follow".to_string());
            }
            (Some(joint), _) => of_chain.push(joint),
            (None, Some(text)) if !pins.iter().any(|pin| pin == text) => pins.push(text.to_string()),
            (None, Some(text)) => return fail(item.span(), format!("names the pin '{text}' twice")),
            (None, None) => {
                let message = format!(
                    "names {}, which is no joint of this arm: they are 1 to {}",
                    describe(item),
                    joints.len()
                );
                return fail(item.span(), message);
            }
        }
    }
    match of_chain[..] {
        [first] => Some((first, first, pins)),
        [first, last] if last == first + 1 => Some((first, last, pins)),
        [] => fail(v.span(), "has no joint of the chain: name one or two of them first".to_string()),
        [_, _] => fail(v.span(), "of the chain must be neighbours, from the base outwards".to_string()),
        _ => fail(
            v.span(),
            "has more than two of the chain: where the chain itself runs round the loop, give its joints \
            mimic"
                .to_string(),
        ),
    }
}

fn lengths(reader: &mut Reader<'_>, v: &Value<'_>, place: &str) -> Option<[Rational; BARS]> {
    let items: Vec<&Value<'_>> = v.get_ref().as_array().map(|a| a.iter().collect()).unwrap_or_default();
    let what = "must be four lengths in m, from each joint to the next and from the last to the first";
    let read: Vec<Option<Rational>> =
        items.iter().map(|item| reader.number(item, &format!("{place}: lengths"), "m")).collect();
    let read: Vec<Rational> = read.into_iter().collect::<Option<_>>()?;
    let Ok(lengths) = <[Rational; BARS]>::try_from(read) else {
        reader.errors.error(v.span(), format!("{place}: lengths {what}, found {}", describe(v)));
        return None;
    };
    let mut sound = true;
    let total = lengths.iter().fold(Rational::zero(), |sum, x| sum + x);
    for (length, item) in lengths.iter().zip(&items) {
        let message = if !length.is_positive() {
            "must be greater than zero".to_string()
        } else if length + length >= total {
            format!("do not close: {} m is as long as the other three together, or longer", to_f64(length))
        } else {
            continue;
        };
        sound = false;
        reader.errors.error(item.span(), format!("{place}: lengths {message}"));
    }
    sound.then_some(lengths)
}

/// Whether a loop's middle pin is on the left.
fn side(reader: &mut Reader<'_>, v: &Value<'_>, place: &str) -> Option<bool> {
    match v.get_ref().as_str().map(str::trim) {
        Some("left") => Some(true),
        Some("right") => Some(false),
        _ => {
            let message = format!("{place}: middle must be \"left\" or \"right\", found {}", describe(v));
            reader.errors.error(v.span(), message);
            None
        }
    }
}

/// Why the joints of a loop do not turn in one plane.
fn planar(joints: &[Joint], convention: Convention, found: &Loop) -> Option<String> {
    let of_loop = &joints[found.first..=found.last];
    if let Some(k) = of_loop.iter().position(|joint| joint.kind != JointKind::Revolute) {
        return Some(format!("joint {} slides: every joint of a loop turns", found.first + k + 1));
    }
    (found.first != found.last && found.sign(convention, joints).is_none()).then(|| {
        let (first, last) = (found.first + 1, found.last + 1);
        format!(
            "is not planar: the axes of joints {first} and {last} are not parallel (alpha between them is \
             not 0 or pi)"
        )
    })
}

/// Lets one of a loop's two joints of the chain follow the other: the outer one, or the one that the file
/// says.
fn tie(joints: &mut [Joint], convention: Convention, found: &Loop) -> Result<(), String> {
    let (a, b) = (found.first, found.last);
    let Some(sign) = found.sign(convention, joints).filter(|_| a != b) else { return Ok(()) };
    // In the plane: theta_a + q_a + sign·(theta_b + q_b + outer) = inner.
    let (one, minus) = (rational::integer(sign), rational::integer(-sign));
    let terms = [
        (found.inner.clone(), one.clone()),
        (joints[a].theta.clone(), minus.clone()),
        (joints[b].theta.clone(), rational::integer(-1)),
        (found.outer.clone(), rational::integer(-1)),
    ];
    let offset = wrapped(&Angle::sum(&terms));
    let outer = Mimic { joint: a, ratio: minus.clone(), offset: offset.clone() };
    let inner = Mimic { joint: b, ratio: minus, offset: one * offset };
    let follows_outer = joints[a].mimic.as_ref().is_some_and(|mimic| mimic.joint == b);
    let (follower, right) = if follows_outer { (a, inner) } else { (b, outer) };
    let Some(said) = &joints[follower].mimic else {
        joints[follower].mimic = Some(right);
        return Ok(());
    };
    let apart = to_f64(&(&said.offset - &right.offset)) / TAU;
    let same = said.joint == right.joint && said.ratio == right.ratio && (apart - apart.round()).abs() < SAME;
    if same {
        return Ok(());
    }
    Err(format!(
        "its parallelogram makes joint {} follow joint {}: ratio = {}, offset = {}; mimic says otherwise (it \
         may be left out)",
        follower + 1,
        right.joint + 1,
        right.ratio,
        to_f64(&right.offset)
    ))
}

/// An angle between −pi and pi as a number of radians; zero where it is a whole number of turns.
fn wrapped(angle: &Angle) -> Rational {
    let radians = angle.radians();
    let rest = radians - TAU * (radians / TAU).round();
    if rest.abs() < SAME { Rational::zero() } else { decimal(rest) }
}

/// A number to 15 decimals.
fn decimal(x: f64) -> Rational {
    rational::parse_rational(&format!("{x:.15}")).unwrap_or_default()
}

/// A vector of the plane, turned by an angle.
fn turned(angle: &Angle, [x, y]: [Rational; 2]) -> [Rational; 2] {
    match angle.quarter_turns() {
        Some(0) => [x, y],
        Some(1) => [-y, x],
        Some(2) => [-x, -y],
        Some(_) => [y, -x],
        None => {
            let ((sin, cos), [x, y]) = (angle.sin_cos(), [to_f64(&x), to_f64(&y)]);
            [decimal(cos * x - sin * y), decimal(sin * x + cos * y)]
        }
    }
}

impl Loop {
    /// Whether the axes of its two joints of the chain point the same way, 1, or opposite ways, -1.
    fn sign(&self, convention: Convention, joints: &[Joint]) -> Option<i64> {
        let twist = match convention {
            Convention::Modified => &joints[self.last].alpha,
            Convention::Standard => &joints[self.first].alpha,
        };
        match twist.quarter_turns() {
            Some(0) => Some(1),
            Some(2) => Some(-1),
            _ => None,
        }
    }

    /// Why its lengths are those of no loop that can be described, or not those of the table.
    fn unequal(&self, convention: Convention, joints: &[Joint]) -> Option<String> {
        let [first, second, third, fourth] = &self.lengths;
        let equal = first == third && second == fourth;
        if self.first != self.last && (!equal || self.left.is_some()) {
            return Some(format!(
                "lengths {}, {}, {}, {} are no parallelogram: with two joints of the chain only loops whose \
                 opposite bars are equal are supported (the first and third, the second and fourth length), \
                 without middle",
                to_f64(first),
                to_f64(second),
                to_f64(third),
                to_f64(fourth)
            ));
        }
        // Then the number of which a root is taken is a square, and the loop may change its way to close.
        let same = |a: &Rational, b: &Rational| to_f64(&(a - b)).abs() < SAME;
        let two_pairs =
            same(first, third) && same(second, fourth) || same(first, second) && same(third, fourth);
        if two_pairs && (self.left.is_some() || !equal) {
            return Some(
                "its bars are two pairs of equal ones: of such loops only parallelograms are supported \
                 (opposite bars are equal, without middle)"
                    .to_string(),
            );
        }
        if !equal && self.left.is_none() {
            return Some(
                "opposite bars are not equal, so the loop closes in two ways: say with middle = \"left\" or \
                 \"right\" on which side of the way from the first pin to the last the middle pin is (about \
                 the joint's axis)"
                    .to_string(),
            );
        }
        let row = match convention {
            Convention::Modified => &joints[self.last],
            Convention::Standard => &joints[self.first],
        };
        let between = to_f64(&row.a).hypot(to_f64(&row.b));
        (self.first != self.last && (to_f64(first) - between).abs() > SAME).then(|| {
            format!(
                "its first length is {} m: joints {} and {} are {between} m apart in the table (a and b)",
                to_f64(first),
                self.first + 1,
                self.last + 1
            )
        })
    }

    /// The linkage of a loop that is no parallelogram.
    fn linkage(&self) -> Option<Linkage> {
        let pin =
            |direction: &Angle, length: &Rational| turned(direction, [length.clone(), Rational::zero()]);
        let [outer, rod, rocker, inner] = &self.lengths;
        Some(Linkage {
            joint: self.first,
            outer: pin(&self.outer, outer),
            inner: pin(&self.inner, inner),
            rod: rod.clone(),
            rocker: rocker.clone(),
            left: self.left?,
        })
    }

    /// The loop's bars that are no links, from the outer link on.
    fn bars(&self, convention: Convention, joints: &[Joint]) -> Vec<Bar> {
        let inner_link = self.first.checked_sub(1);
        let name = |from: usize| {
            let at = |k: usize| self.pins.get(k).cloned().unwrap_or_default();
            format!("{}-{}", at(from), at(from + 1))
        };
        let bar = |name: String, carrier, pin, parallel| Bar {
            name,
            carrier,
            pin,
            parallel,
            hinge: None,
            zero: Vec::new(),
        };
        let outer = self.outer_pin(convention, &joints[self.last]);
        // Its outer pin is on the outer link, and it is parallel to the bar opposite.
        if self.first != self.last {
            return vec![bar(name(0), Some(self.last), outer, Some(self.first))];
        }
        let inner = self.inner_pin(convention, &joints[self.first]);
        if let Some(linkage) = self.linkage() {
            let hinged =
                |bar: Bar, rocker| Bar { hinge: Some(Hinge { linkage: linkage.clone(), rocker }), ..bar };
            return vec![
                hinged(bar(name(0), Some(self.last), outer, Some(self.last)), false),
                hinged(bar(name(1), inner_link, inner, inner_link), true),
            ];
        }
        vec![
            bar(name(0), Some(self.last), outer, inner_link),
            bar(name(1), inner_link, inner, Some(self.first)),
        ]
    }

    /// The first pin in the outer link's frame.
    fn outer_pin(&self, convention: Convention, joint: &Joint) -> [Rational; 3] {
        // On the outer link: the bar opposite to the third length's, or to the fourth's.
        let length = self.lengths[self.last - self.first].clone();
        let [x, y] = turned(&self.outer, [length, Rational::zero()]);
        match convention {
            Convention::Modified => [x, y, Rational::zero()],
            Convention::Standard => {
                let back = Angle::sum(&[(joint.alpha.clone(), rational::integer(-1))]);
                let [y, z] = turned(&back, [y - &joint.b, Rational::zero()]);
                [x - &joint.a, y, z]
            }
        }
    }

    /// The last pin in the inner link's frame.
    fn inner_pin(&self, convention: Convention, joint: &Joint) -> [Rational; 3] {
        // In the plane in which the first joint's frame is.
        let [x, y] = turned(&self.inner, [self.lengths[BARS - 1].clone(), Rational::zero()]);
        match convention {
            Convention::Standard => [x, y, joint.d.clone()],
            Convention::Modified => {
                let [y, z] = turned(&joint.alpha, [y, joint.d.clone()]);
                [x + &joint.a, y + &joint.b, z]
            }
        }
    }
}

/// The bars with the names and the symmetries that the file gives them.
fn described(reader: &mut Reader<'_>, t: &Table<'_, '_>, mut bars: Vec<Bar>) -> Option<Vec<Bar>> {
    let tables = reader.tables(t, "loop.bar");
    if tables.len() > bars.len() {
        let (span, count) = (tables[bars.len()].span.clone(), bars.len());
        let message = format!(
            "{}: {} tables [[loop.bar]]: its bars that are no links of the chain are {count}, from the outer \
            link on",
            t.place,
            tables.len()
        );
        reader.errors.error(span, message);
        return None;
    }
    let mut sound = true;
    for (bar, table) in bars.iter_mut().zip(&tables) {
        reader.unknown_keys(table, &BAR_KEYS);
        let place = format!("{}: {}", t.place, table.place);
        let name = reader.optional(table, "name", |r, v| r.text(v, &format!("{place}: name")));
        let zero: Option<Vec<ParameterKind>> = match table.table.get("zero") {
            Some(v) => reader.symmetries(v, &place),
            None => Some(Vec::new()),
        };
        sound &= name.is_some() && zero.is_some();
        if let Some(Some(name)) = name {
            bar.name = name;
        }
        bar.zero = zero.unwrap_or_default();
    }
    sound.then_some(bars)
}
