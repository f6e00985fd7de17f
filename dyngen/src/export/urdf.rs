//! Identified values in a copy of a URDF: inertials, damping, friction and limits; every other byte stays.

use super::body::{Body, apart, frames};
use super::edit::{Edits, comment, indentation};
use super::known::{Friction, Known};
use crate::arm::{Arm, Joint};
use crate::import::chain::{self, Chain, ChainJoint};
use crate::import::pose::Pose;
use crate::import::urdf::{Robot, read};
use crate::import::{ImportError, Options};
use nalgebra::Matrix3;
use roxmltree::{Document, Node, ParsingOptions};
use std::fmt::Write;

/// How far the arm's axes may be from the file's, m and rad: what taking rounded numbers as meant makes.
const APART: f64 = 5e-3;

/// A robot description with identified values.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The whole file.
    pub text: String,
    /// What is to be said of it.
    pub notes: Vec<String>,
}

/// Writes what is known of an arm into a copy of the URDF that it was imported from; `file` names it in errors, and
/// `options` say base, tip and locked joints as they did for the import.
///
/// # Errors
/// Where the file is no URDF of this arm: the joints' names and axes must be those of the arm.
pub fn urdf(
    text: &str,
    file: &str,
    arm: &Arm,
    known: &Known,
    options: &Options,
) -> Result<Exported, ImportError> {
    let refused = |reasons: Vec<String>| {
        ImportError::Refused(reasons.into_iter().map(|reason| format!("{file}: {reason}")).collect())
    };
    let robot = read(text).map_err(|e| ImportError::Unreadable(format!("{file}: not a URDF: {e}")))?;
    let mut options = Options { exact: true, ..options.clone() };
    if options.tip.is_none() {
        // The arm ends with its last joint, whatever else the robot has.
        let last = arm.joints.last().and_then(|joint| joint.name.as_ref());
        options.tip = robot.joints.iter().find(|j| Some(&j.name) == last).map(|joint| joint.child.clone());
    }
    let chain = chain::chain(&robot, &options).map_err(refused)?;
    same_arm(arm, &chain).map_err(|reason| refused(vec![reason]))?;
    let parsing = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, parsing).map_err(|e| {
        ImportError::Unreadable(format!(
            "{file}: line {}: {e}: mend it before values are written",
            e.pos().row
        ))
    })?;
    let mut writer = Writer { text, document: &document, edits: Edits::default(), notes: Vec::new() };
    let (links, _) = frames(arm);
    for (i, (joint, frame)) in chain.joints.iter().zip(&links).enumerate() {
        let body = Body::of_parameters(&known.values[11 * i..][..10]);
        // From the arm's frame to the root link's.
        let back = Pose {
            rotation: frame.rotation.transpose(),
            origin: -(frame.rotation.transpose() * frame.origin),
        };
        writer.body(joint, &body.seen_from(&back), &robot, &known.words[i]);
        writer.joint(&joint.name, &arm.joints[i], known.friction.as_ref().map(|f| f[i]));
    }
    if (0..arm.dof()).any(|i| known.values[11 * i + 10] != 0.0) {
        let what = "rotor inertias are left out: a URDF has no place for them".to_string();
        writer.notes.push(what);
    }
    let Writer { edits, notes, .. } = writer;
    Ok(Exported { text: edits.apply(text), notes })
}

/// The joints' names and axes must be the arm's.
fn same_arm(arm: &Arm, chain: &Chain) -> Result<(), String> {
    let names: Vec<&str> = chain.joints.iter().map(|joint| joint.name.as_str()).collect();
    if names.len() != arm.dof() || arm.has_joint_names() && arm.joint_names() != names {
        return Err(format!(
            "its joints are {}, those of the arm {}: give --base, --tip and --lock as they were given to the import",
            names.join(", "),
            arm.joint_names().join(", ")
        ));
    }
    let (_, axes) = frames(arm);
    for (joint, axis) in chain.joints.iter().zip(&axes) {
        let (distance, angle) = apart(axis, joint.kind, &joint.point, &joint.direction);
        if distance > APART || angle > APART {
            return Err(format!(
                "joint '{}': its axis lies {:.3} mm and {:.3} mrad from that of the arm file, which is another arm or was \
                 imported with another --base",
                joint.name,
                1e3 * distance,
                1e3 * angle
            ));
        }
    }
    Ok(())
}

struct Writer<'t, 'd> {
    text: &'t str,
    document: &'d Document<'t>,
    edits: Edits,
    notes: Vec<String>,
}

impl<'t, 'd> Writer<'t, 'd> {
    /// The robot's own element of that kind and name.
    fn element(&self, kind: &str, name: &str) -> Option<Node<'d, 't>> {
        let root = self.document.root_element();
        root.children().find(|n| n.tag_name().name() == kind && n.attribute("name") == Some(name))
    }

    /// Writes a body, given in the root link's frame, on the links that move as one behind a joint.
    fn body(&mut self, joint: &ChainJoint, body: &Body, robot: &Robot, words: &[String]) {
        let (Some(name), Some(pose)) = (joint.links.first(), joint.poses.first()) else { return };
        // What is fixed to the first link keeps its own inertia, where that leaves the first one a body's.
        let others = joint.links.iter().zip(&joint.poses).skip(1).map(|(name, pose)| {
            let link = robot.links.iter().find(|link| link.name == *name);
            link.map_or(Body::of_parameters(&[0.0; 10]), |link| {
                let [xx, xy, xz, yy, yz, zz] = link.inertia;
                let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let at = pose.then(&Pose::of(&link.origin, 1e-12));
                let inertia = at.rotation * tensor * at.rotation.transpose();
                Body::about_centre(link.mass, at.origin, &inertia)
            })
        });
        let rest = others.fold(*body, |rest, other| rest.less(&other));
        let own = if joint.links.len() == 1 || rest.is_possible() {
            rest
        } else {
            for other in &joint.links[1..] {
                let Some(inertial) = self.element("link", other).and_then(|l| child(l, "inertial")) else {
                    continue;
                };
                let what = comment(&format!("dyngen: its inertia is part of link '{name}'"));
                self.edits.replace(inertial.range(), what);
            }
            self.notes.push(format!(
                "link '{name}' has the whole inertia of {}: with theirs left on them it would be that of no body",
                joint.links.join(", ")
            ));
            *body
        };
        self.inertial(name, &own.seen_from(pose), words);
    }

    fn inertial(&mut self, name: &str, body: &Body, words: &[String]) {
        let Some(link) = self.element("link", name) else { return };
        let old = child(link, "inertial");
        let at = old.map_or(link.range().start, |inertial| inertial.range().start);
        let margin = indentation(self.text, at);
        let margin = if old.is_some() { margin.to_string() } else { format!("{margin}  ") };
        let (centre, tensor) = body.centre();
        let t = |i: usize, j: usize| shortest(tensor[(i, j)]);
        let mut lines = vec![format!("{margin}  {}", comment("identified by dyngen"))];
        lines.extend(words.iter().map(|line| format!("{margin}  {}", comment(line))));
        let new = format!(
            "<inertial>\n{}\n{margin}  <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n{margin}  <mass value=\"{}\"/>\n{margin}  \
             <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n{margin}</inertial>",
            lines.join("\n"),
            shortest(centre[0]),
            shortest(centre[1]),
            shortest(centre[2]),
            shortest(body.mass),
            t(0, 0),
            t(0, 1),
            t(0, 2),
            t(1, 1),
            t(1, 2),
            t(2, 2)
        );
        match (old, link.first_child()) {
            (Some(old), _) => self.edits.replace(old.range(), new),
            (None, Some(first)) => {
                let start = first.range().start;
                self.edits.replace(start..start, format!("\n{margin}{new}"));
            }
            (None, None) => {
                // <link name="x"/> opens up.
                let whole = link.range();
                let tag = self.text[whole.clone()].trim_end_matches("</link>").trim_end_matches('>');
                let tag = tag.trim_end_matches('/').trim_end();
                let outer = indentation(self.text, whole.start).to_string();
                self.edits.replace(whole, format!("{tag}>\n{margin}{new}\n{outer}</link>"));
            }
        }
    }

    /// Friction where it is known, and limits where the arm file has others.
    fn joint(&mut self, name: &str, joint: &Joint, friction: Option<Friction>) {
        let Some(node) = self.element("joint", name) else { return };
        if let Some(friction) = friction {
            let values = [("damping", friction.viscous), ("friction", friction.coulomb)];
            let error = |k: usize| friction.std[k].map_or("unknown".to_string(), |s| format!("{s:.3e}"));
            let words = format!("dyngen: standard errors: damping {}, friction {}", error(0), error(1));
            self.attributes(node, "dynamics", &values, Some(words));
        }
        let [lower, upper] = joint.position.map_or([None, None], |[low, high]| [Some(low), Some(high)]);
        let wanted =
            [("lower", lower), ("upper", upper), ("velocity", joint.velocity), ("effort", joint.torque)];
        let limit = child(node, "limit");
        let there =
            |key: &str| limit.and_then(|l| l.attribute(key)).and_then(|x| x.trim().parse::<f64>().ok());
        let changed: Vec<(&str, f64)> = wanted
            .into_iter()
            .filter_map(|(key, value)| Some((key, value?)))
            .filter(|(key, value)| there(key) != Some(*value))
            .collect();
        if !changed.is_empty() {
            self.attributes(node, "limit", &changed, None);
        }
    }

    /// Gives an element below a joint some attributes; others stay.
    fn attributes(
        &mut self,
        joint: Node<'d, 't>,
        element: &str,
        values: &[(&str, f64)],
        words: Option<String>,
    ) {
        let mut text = match words {
            Some(words) => comment(&words),
            None => String::new(),
        };
        let Some(old) = child(joint, element) else {
            let list: String =
                values.iter().map(|(key, value)| format!(" {key}=\"{}\"", shortest(*value))).collect();
            // Before the end tag, which a joint always has: it has a parent and a child.
            let end = joint.range().start + self.text[joint.range()].rfind("</").unwrap_or_default();
            let margin = indentation(self.text, joint.range().start);
            let _ = write!(text, "<{element}{list}/>");
            self.edits.replace(end..end, format!("  {text}\n{margin}"));
            return;
        };
        if !text.is_empty() {
            self.edits.replace(old.range().start..old.range().start, text);
        }
        for (key, value) in values {
            match old.attribute_node(*key) {
                Some(attribute) => self.edits.replace(attribute.range_value(), shortest(*value)),
                None => {
                    let start = old.range().start + 1 + old.tag_name().name().len();
                    self.edits.replace(start..start, format!(" {key}=\"{}\"", shortest(*value)));
                }
            }
        }
    }
}

/// The shortest text that is the number.
fn shortest(x: f64) -> String {
    if x == 0.0 { "0".to_string() } else { format!("{x:?}") }
}

/// The first element of that name below another.
fn child<'d, 't>(node: Node<'d, 't>, name: &str) -> Option<Node<'d, 't>> {
    node.children().find(|n| n.is_element() && n.tag_name().name() == name)
}
