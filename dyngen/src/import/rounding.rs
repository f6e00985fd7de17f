//! Numbers of a URDF that are rounded: 1.5708 for pi/2, 3e-8 m for nothing.
//!
//! Taken by the letter they make axes almost parallel and almost meet: parameters are then identifiable by
//! residues alone, and common normals lie far away. The nearest arm with angles that are multiples of pi/12
//! and lengths that are zero is what was meant, where each number that moves is one that writing it out
//! rounds to the one that stands there, or is off by less than any arm is made or measured to.

use super::pose::twelfths;
use super::urdf::{Joint, Robot};
use crate::exact::angle::Angle;
use crate::exact::rational;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// What is smaller is residue of a calculation: m, rad, or a share of an axis.
const RESIDUE: f64 = 1e-6;
/// What is smaller is not reported: double precision makes it.
const SILENT: f64 = 1e-12;
/// Decimals with which a multiple of pi/2, of pi/6 or pi/4, and of pi/12 is recognised.
const DECIMALS: [i32; 3] = [2, 3, 4];

/// The robot with the rounded numbers of some joints as they were meant, and what was moved: a line for each
/// joint.
pub(crate) fn nearest(robot: &Robot, joints: &[usize]) -> (Robot, Vec<String>) {
    let mut nearest = robot.clone();
    let mut moved = Vec::new();
    for index in joints {
        let joint: &mut Joint = &mut nearest.joints[*index];
        let mut changes = Vec::new();
        for (axis, angle) in ["roll", "pitch", "yaw"].iter().zip(&mut joint.origin.rpy) {
            if let Some((multiple, text)) = meant_angle(*angle) {
                if (*angle - multiple).abs() > SILENT {
                    changes.push(format!("{axis} {angle} is {text}"));
                }
                *angle = multiple;
            }
        }
        let length = Vector3::from(joint.axis).norm();
        let shares = joint.axis.iter_mut().map(|x| (x, length, "axis"));
        for (x, unit, what) in joint.origin.xyz.iter_mut().map(|x| (x, 1.0, "origin")).chain(shares) {
            if *x != 0.0 && x.abs() <= RESIDUE * unit {
                if x.abs() > SILENT * unit {
                    changes.push(format!("{x} of its {what} is 0"));
                }
                *x = 0.0;
            }
        }
        if !changes.is_empty() {
            moved.push(format!("joint '{}': {}", joint.name, changes.join(", ")));
        }
    }
    (nearest, moved)
}

/// The multiple of pi/12 that an angle was rounded from, and its name.
fn meant_angle(angle: f64) -> Option<(f64, String)> {
    let count = (angle / (PI / 12.0)).round();
    if count.abs() > 48.0 || angle == 0.0 {
        return None;
    }
    let meant = count * PI / 12.0;
    let kind = match count as i64 {
        k if k % 6 == 0 => 0,
        k if k % 2 == 0 || k % 3 == 0 => 1,
        _ => 2,
    };
    let digits = decimals(angle);
    let unit = 10f64.powi(digits);
    let written = |x: f64| (x - angle * unit).abs() < 1e-3;
    let rounded = count != 0.0
        && (DECIMALS[kind]..15).contains(&digits)
        && (written((meant * unit).round()) || written((meant * unit).trunc()));
    let text = multiple_text(count as i64);
    (rounded || (angle - meant).abs() <= RESIDUE).then_some((meant, text))
}

/// Decimals of the shortest text that is the number.
fn decimals(x: f64) -> i32 {
    let text = format!("{x}");
    text.split_once('.').map_or(0, |(_, after)| after.len() as i32)
}

/// What angles within a tolerance of a multiple of pi/12 are taken for, a line for each joint.
pub(super) fn snapped(robot: &Robot, joints: &[usize], tolerance: f64) -> Vec<String> {
    let mut said = Vec::new();
    for joint in joints.iter().map(|index| &robot.joints[*index]) {
        let angles = ["roll", "pitch", "yaw"].iter().zip(&joint.origin.rpy);
        let change = |(axis, angle): (&&str, &f64)| {
            let count = twelfths(*angle, tolerance)?;
            let moved = (angle - count as f64 * PI / 12.0).abs() > SILENT;
            moved.then(|| format!("{axis} {angle} is {}", multiple_text(count)))
        };
        let changes: Vec<String> = angles.filter_map(change).collect();
        if !changes.is_empty() {
            said.push(format!("joint '{}': {}", joint.name, changes.join(", ")));
        }
    }
    said
}

/// A multiple of pi/12 by its name.
fn multiple_text(count: i64) -> String {
    Angle::PiMultiple(rational::integer(count) / rational::integer(12)).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_what_writing_it_rounds_to() {
        for (written, meant) in [
            ("1.5708", "pi/2"),
            ("1.571", "pi/2"),
            ("1.57", "pi/2"),
            ("-3.14159", "-pi"),
            ("1.570796", "pi/2"),
            ("1.57079", "pi/2"),
            ("0.7854", "pi/4"),
            ("0.785", "pi/4"),
            ("-0.5236", "-pi/6"),
            ("1.5707963705062866", "pi/2"),
            ("4.3e-8", "0"),
            ("1.3089969389957472", "5*pi/12"),
        ] {
            assert_eq!(
                meant_angle(written.parse().unwrap()).map(|(_, text)| text).as_deref(),
                Some(meant),
                "{written}"
            );
        }
        for general in
            [0.0, 0.5, 0.52, 0.26, 1.5, 1.6, 1.58, 1.5718, 1.5706, 1.3e-5, -1.2217, 0.279310074519612]
        {
            assert_eq!(meant_angle(general), None, "{general}");
        }
    }
}
