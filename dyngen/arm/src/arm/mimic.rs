//! Joints that follow another one: q_k = ratio·q_j + offset. They have no coordinate of their own.

use super::table::{Reader, Table, Value, describe};
use super::{Arm, Joint, JointKind};
use crate::exact::angle::Angle;
use crate::exact::rational::{self, Rational};
use num_traits::{One, Zero};
use toml::de::DeValue;

const KEYS: [&str; 3] = ["joint", "ratio", "offset"];

/// What a joint follows: its position is ratio · the other's + offset.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// The joint that it follows, from 0, which moves on its own.
    pub joint: usize,
    /// Velocity of the following joint for a unit of the other's; not zero.
    pub ratio: Rational,
    /// Position of the following joint where the other's is zero, rad or m.
    pub offset: Rational,
}

/// How a joint moves with the coordinates: its own, or that of the joint that it follows.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Index among the coordinates.
    pub coordinate: usize,
    /// The joint whose position that coordinate is.
    pub joint: usize,
    /// Velocity for a unit of the coordinate's.
    pub ratio: Rational,
    /// Position where the coordinate is zero, rad or m.
    pub offset: Rational,
}

impl Arm {
    /// The number of links, each with a joint before it that may follow another one.
    pub fn links(&self) -> usize {
        self.joints.len()
    }

    /// The joints that move on their own, from the base: their positions are the coordinates q.
    pub fn coordinates(&self) -> Vec<usize> {
        (0..self.links()).filter(|i| self.joints[*i].mimic.is_none()).collect()
    }

    /// The joints that move on their own, in the order of the coordinates.
    pub fn moving_joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(|joint| joint.mimic.is_none())
    }

    /// Whether a joint follows another one.
    pub fn has_mimics(&self) -> bool {
        self.joints.iter().any(|joint| joint.mimic.is_some())
    }

    /// For whoever takes joints and coordinates to be the same.
    ///
    /// # Errors
    /// Which joints follow others.
    pub fn without_mimics(&self) -> Result<(), String> {
        let follows = |(i, joint): (usize, &Joint)| joint.mimic.as_ref().map(|_| (i + 1).to_string());
        let follow: Vec<String> = self.joints.iter().enumerate().filter_map(follows).collect();
        if follow.is_empty() {
            return Ok(());
        }
        Err(format!(
            "joint {} of the arm follows another one (mimic): dyngen's functions know such arms, logs and \
             drives are read for arms all of whose joints move on their own",
            follow.join(", ")
        ))
    }

    /// How every joint moves with the coordinates.
    pub fn drives(&self) -> Vec<Drive> {
        let coordinates = self.coordinates();
        let of = |(i, joint): (usize, &Joint)| {
            let (leader, ratio, offset) = match &joint.mimic {
                None => (i, Rational::one(), Rational::zero()),
                Some(mimic) => (mimic.joint, mimic.ratio.clone(), mimic.offset.clone()),
            };
            // A file's leaders move on their own.
            let coordinate = coordinates.iter().position(|c| *c == leader).unwrap_or_default();
            Drive { coordinate, joint: leader, ratio, offset }
        };
        self.joints.iter().enumerate().map(of).collect()
    }

    /// The constant between the angle of a revolute joint that follows another and its ratio times the
    /// other's: each angle with its theta where that is no multiple of pi/2. Zero for other joints.
    pub fn phase(&self, joint: usize) -> Angle {
        let Some(mimic) = &self.joints[joint].mimic else { return Angle::zero() };
        let leader = &self.joints[mimic.joint];
        let minus_ratio = -&mimic.ratio;
        let mut parts = vec![(self.joints[joint].theta_in_angle(), Rational::one())];
        if leader.kind == JointKind::Revolute {
            parts.push((leader.theta_in_angle(), minus_ratio));
        }
        parts.push((Angle::from_radians(mimic.offset.clone()), Rational::one()));
        Angle::sum(&parts)
    }
}

impl Joint {
    /// What the joint's angle, as sines and cosines take it, holds in addition to q: theta where it is no
    /// multiple of pi/2.
    pub fn theta_in_angle(&self) -> Angle {
        if self.theta.quarter_turns().is_some() { Angle::zero() } else { self.theta.clone() }
    }
}

/// Reads the table `mimic` of a joint; `dof` joints are in the file.
pub(super) fn read(reader: &mut Reader<'_>, v: &Value<'_>, place: &str, dof: usize) -> Option<Mimic> {
    let place = format!("{place}: mimic");
    let Some(table) = v.get_ref().as_table() else {
        let message =
            format!("{place} must be a table, as {{ joint = 2, ratio = -1 }}, found {}", describe(v));
        reader.errors.error(v.span(), message);
        return None;
    };
    let t = Table { table, span: v.span(), place: place.clone() };
    reader.unknown_keys(&t, &KEYS);
    let joint = reader.required(&t, "joint").and_then(|v| {
        let number = match v.get_ref() {
            DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse::<usize>().ok(),
            _ => None,
        };
        let joint = number.filter(|n| (1..=dof).contains(n)).map(|n| n - 1);
        if joint.is_none() {
            let message = format!("{place}: {} is no joint of this arm: they are 1 to {dof}", describe(v));
            reader.errors.error(v.span(), message);
        }
        joint
    });
    let mut exact = |key: &str, unit: &str| {
        reader.optional(&t, key, |r, v| {
            let quantity = format!("{place}: {key}");
            match v.get_ref().as_str() {
                Some(text) => rational::parse_rational(text)
                    .map_err(|e| r.errors.error(v.span(), format!("{quantity}: {e}")))
                    .ok(),
                None => r.number(v, &quantity, unit),
            }
        })
    };
    let ratio = exact("ratio", "1, or text such as \"-1/2\"");
    let offset = exact("offset", "rad or m");
    let ratio = ratio?.unwrap_or_else(Rational::one);
    if ratio.is_zero() {
        let message = format!("{place}: ratio is zero: a joint that never moves is no joint");
        reader.errors.error(v.span(), message);
        return None;
    }
    Some(Mimic { joint: joint?, ratio, offset: offset?.unwrap_or_else(Rational::zero) })
}

/// Lets every joint that follows name one that moves on its own; the error for one that follows itself.
pub(super) fn resolve(joints: &mut [Joint]) -> Result<(), (usize, String)> {
    for i in 0..joints.len() {
        let Some(mut mimic) = joints[i].mimic.clone() else { continue };
        let mut steps = 0;
        while let Some(further) = joints[mimic.joint].mimic.clone() {
            steps += 1;
            if mimic.joint == i || steps > joints.len() {
                return Err((i, "it follows itself: one joint of the circle must move on its own".into()));
            }
            mimic = Mimic {
                joint: further.joint,
                offset: &mimic.ratio * &further.offset + &mimic.offset,
                ratio: &mimic.ratio * &further.ratio,
            };
        }
        joints[i].mimic = Some(mimic);
    }
    Ok(())
}
