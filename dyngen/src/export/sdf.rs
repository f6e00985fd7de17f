//! An arm as a model of SDFormat, for Gazebo and Drake.

use super::edit::{comment, escaped, shortest};
use super::known::Known;
use super::tree::{Link, Tree};
use super::urdf::Exported;
use crate::arm::{Arm, JointKind};
use crate::exact::rational::to_f64;
use crate::import::pose::Pose;
use std::fmt::Write;

/// The version of the format; joints that follow others need a later one.
const VERSIONS: [&str; 2] = ["1.9", "1.11"];

/// An arm with what is known of it as an SDF model that stands fixed in its world: inertias, friction,
/// damping, limits.
///
/// The frame of each link is on its joint's axis, z along it. `by` says in the first line what wrote the
/// file; `more` are the caller's own notes, which stand in the file too.
///
/// # Errors
/// If the arm has bars of closed loops.
pub fn sdf(arm: &Arm, known: &Known, by: &str, more: &[String]) -> Result<Exported, String> {
    let tree = Tree::new(arm, known)?;
    let mut notes = [more, &tree.notes].concat();
    let rotors: Vec<String> = (tree.links.iter())
        .filter_map(|link| Some(format!("'{}' {:.4e}", link.name, link.armature?)))
        .collect();
    if !rotors.is_empty() {
        notes.push(format!(
            "rotor inertias are left out: SDF has no place for them; about the joints they are, kg·m² or \
             kg: {}",
            rotors.join(", ")
        ));
    }
    let g = tree.gravity;
    notes.push(format!(
        "gravity is the world's in SDF: the values were found with ({}, {}, {}) m/s² in the model's frame",
        shortest(g.x),
        shortest(g.y),
        shortest(g.z)
    ));
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = model(arm, &tree, by, &notes, &mut text);
    Ok(Exported { text, notes })
}

fn model(arm: &Arm, tree: &Tree<'_>, by: &str, notes: &[String], text: &mut String) -> std::fmt::Result {
    let root = escaped(&tree.root);
    writeln!(text, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>{}", comment(by))?;
    for note in notes {
        writeln!(text, "{}", comment(note))?;
    }
    writeln!(text, "<sdf version=\"{}\">", VERSIONS[usize::from(arm.has_mimics())])?;
    writeln!(text, "  <model name=\"{}\">", escaped(&arm.name))?;
    writeln!(text, "    <link name=\"{root}\"/>")?;
    writeln!(text, "    <joint name=\"{root}_on_world\" type=\"fixed\">")?;
    writeln!(text, "      <parent>world</parent>\n      <child>{root}</child>\n    </joint>")?;
    let mut before = &tree.root;
    for link in &tree.links {
        write_link(text, link, before)?;
        write_joint(text, tree, link, before)?;
        before = &link.link;
    }
    for frame in &tree.fixed {
        let on = escaped(&tree.links[frame.link].link);
        writeln!(text, "    <frame name=\"{}\" attached_to=\"{on}\">", escaped(&frame.name))?;
        writeln!(text, "      {}\n    </frame>", pose(&frame.pose, ""))?;
    }
    writeln!(text, "  </model>\n</sdf>")
}

fn write_link(text: &mut String, link: &Link<'_>, before: &str) -> std::fmt::Result {
    let (centre, tensor) = link.body.centre();
    writeln!(text, "    <link name=\"{}\">", escaped(&link.link))?;
    writeln!(text, "      {}", pose(&link.pose, before))?;
    writeln!(text, "      <inertial>")?;
    for line in link.words {
        writeln!(text, "        {}", comment(line))?;
    }
    let at = Pose { origin: centre, ..Pose::identity() };
    writeln!(text, "        {}", pose(&at, ""))?;
    writeln!(text, "        <mass>{}</mass>", shortest(link.body.mass))?;
    writeln!(text, "        <inertia>")?;
    for (name, i, j) in
        [("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2)]
    {
        writeln!(text, "          <{name}>{}</{name}>", shortest(tensor[(i, j)]))?;
    }
    writeln!(text, "        </inertia>\n      </inertial>\n    </link>")
}

fn write_joint(text: &mut String, tree: &Tree<'_>, link: &Link<'_>, before: &str) -> std::fmt::Result {
    let kind = match link.joint.kind {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    };
    writeln!(text, "    <joint name=\"{}\" type=\"{kind}\">", escaped(&link.name))?;
    writeln!(text, "      <parent>{}</parent>", escaped(before))?;
    writeln!(text, "      <child>{}</child>", escaped(&link.link))?;
    writeln!(text, "      <axis>\n        <xyz>0 0 1</xyz>")?;
    let [lower, upper] = link.joint.position.map_or([None; 2], |limits| limits.map(Some));
    let limits = [
        ("lower", lower),
        ("upper", upper),
        ("effort", link.joint.torque),
        ("velocity", link.joint.velocity),
    ];
    element(text, "limit", &limits)?;
    if let Some(friction) = &link.friction {
        let error = |k: usize| friction.std[k].map_or("unknown".to_string(), |s| format!("{s:.3e}"));
        let words = format!("standard errors: damping {}, friction {}", error(0), error(1));
        writeln!(text, "        {}", comment(&words))?;
        element(text, "dynamics", &[("damping", friction.viscous), ("friction", Some(friction.coulomb))])?;
    }
    if let Some(mimic) = &link.joint.mimic {
        writeln!(text, "        <mimic joint=\"{}\">", escaped(&tree.links[mimic.joint].name))?;
        writeln!(text, "          <multiplier>{}</multiplier>", shortest(to_f64(&mimic.ratio)))?;
        writeln!(text, "          <offset>{}</offset>", shortest(to_f64(&mimic.offset)))?;
        writeln!(text, "          <reference>0</reference>\n        </mimic>")?;
    }
    writeln!(text, "      </axis>\n    </joint>")
}

/// An element of numbers, where there is one.
fn element(text: &mut String, name: &str, numbers: &[(&str, Option<f64>)]) -> std::fmt::Result {
    if numbers.iter().all(|(_, value)| value.is_none()) {
        return Ok(());
    }
    writeln!(text, "        <{name}>")?;
    for (key, value) in numbers.iter().filter_map(|(key, value)| Some((key, (*value)?))) {
        writeln!(text, "          <{key}>{}</{key}>", shortest(value))?;
    }
    writeln!(text, "        </{name}>")
}

/// The element of a pose, in the frame of a link where one is named.
fn pose(pose: &Pose, of: &str) -> String {
    let numbers: Vec<String> = pose.origin.iter().copied().chain(pose.rpy()).map(shortest).collect();
    let relative = match of {
        "" => String::new(),
        link => format!(" relative_to=\"{}\"", escaped(link)),
    };
    format!("<pose{relative}>{}</pose>", numbers.join(" "))
}

#[cfg(test)]
mod tests {
    use super::super::tree::tests::{arm, known};
    use super::*;
    use roxmltree::Document;

    #[test]
    fn what_is_known_stands_in_the_model() {
        let arm = arm("standard");
        let known = known(&arm);
        let exported = sdf(&arm, &known, "written by a test", &["of the caller".to_string()]).unwrap();
        assert!(exported.text.lines().next().unwrap().ends_with("<!-- written by a test -->"));
        let document = Document::parse(&exported.text).unwrap();
        let all = |name: &str| -> Vec<f64> {
            let of = document.descendants().filter(|n| n.tag_name().name() == name);
            of.map(|n| n.text().unwrap().parse().unwrap()).collect()
        };
        assert_eq!(all("mass"), [2.0, 1.5, 1.0]);
        assert_eq!((all("damping"), all("friction")), (vec![0.5, 1.5, 2.5], vec![1.5, 1.25, 1.0]));
        assert_eq!((all("lower"), all("upper")), (vec![-2.5, 0.0], vec![2.0, 0.4]));
        assert_eq!((all("effort"), all("velocity")), (vec![50.0], vec![3.0]));
        let notes = exported.notes.join("\n");
        assert!(notes.contains("'shoulder' 3.0000e-1"), "{notes}");
        assert!(
            notes.starts_with("of the caller") && exported.text.contains("<!-- of the caller -->"),
            "{notes}"
        );
        // Down in frame 0 is along y of the base, which is turned about x by a quarter, and then about z.
        let expected = 9.81 * nalgebra::Vector3::new(-0.3f64.sin(), 0.3f64.cos(), 0.0);
        assert!((Tree::new(&arm, &known).unwrap().gravity - expected).norm() < 1e-12);
    }

    /// A name cannot end a comment or an attribute, and no link has the name of a joint.
    #[test]
    fn names_are_kept_apart_and_escaped() {
        let mut arm = arm("modified");
        let known = known(&arm);
        arm.name = "a <b> & \"c\"".to_string();
        arm.joints[0].name = Some("base".to_string());
        arm.joints[1].name = Some("base_link".to_string());
        let text = sdf(&arm, &known, "-- a -->", &[]).unwrap().text;
        let document = Document::parse(&text).unwrap();
        let names = |kind: &str| -> Vec<String> {
            let of = document.descendants().filter(|n| n.tag_name().name() == kind);
            of.map(|n| n.attribute("name").unwrap().to_string()).collect()
        };
        assert_eq!(names("model"), ["a <b> & \"c\""]);
        assert_eq!(names("link"), ["base_", "base_link_", "base_link_link", "wrist_link"]);
        assert_eq!(names("joint"), ["base__on_world", "base", "base_link", "wrist"]);
    }
}
