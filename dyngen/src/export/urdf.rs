//! Identified values in a copy of a URDF: inertials, damping, friction and limits; every other byte stays.

use super::body::Body;
use super::edit::{Edits, child, comment, indentation, shortest};
use super::known::{Friction, Known};
use super::share;
use crate::arm::{Arm, Joint};
use crate::import::urdf::read;
use crate::import::{ImportError, Options};
use roxmltree::{Document, Node, ParsingOptions};
use std::fmt::Write;

/// A robot description with identified values.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The whole file.
    pub text: String,
    /// Notes about the export.
    pub notes: Vec<String>,
}

/// Writes identified values of an arm into a copy of the URDF that it was imported from; `file` is its name
/// in errors, and `options` give base, tip and locked joints as for the import.
///
/// # Errors
/// If the file is not a URDF of this arm: the joints' names and axes must be those of the arm.
pub fn urdf(
    text: &str,
    file: &str,
    arm: &Arm,
    known: &Known,
    options: &Options,
) -> Result<Exported, ImportError> {
    let refused = |reasons| ImportError::refused(file, reasons);
    let robot =
        read(text).map_err(|e| ImportError::Unreadable(format!("{file}: cannot be read as a URDF: {e}")))?;
    let chain = share::chain(&robot, arm, options).map_err(refused)?;
    let shares = share::shares(arm, &chain, &robot, known, &|_| true).map_err(|e| refused(vec![e]))?;
    let parsing = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, parsing).map_err(|e| {
        ImportError::Unreadable(format!(
            "{file}: line {}: {e}: correct it before values are written",
            e.pos().row
        ))
    })?;
    let mut writer = Writer { text, document: &document, edits: Edits::default(), notes: Vec::new() };
    for (i, share) in shares.into_iter().enumerate() {
        writer.inertial(&share.link, &share.body, &known.words[i]);
        for other in &share.emptied {
            let inertial = writer.element("link", other).and_then(|l| child(l, "inertial"));
            if let Some(inertial) = inertial {
                let what = comment(&format!("dyngen: its inertia is part of link '{}'", share.link));
                writer.edits.replace(inertial.range(), what);
            }
        }
        writer.notes.extend(share.note);
        let mut friction = known.friction.as_ref().and_then(|f| f[i]);
        if arm.coupled_motor(i).is_some() && friction.take().is_some() {
            writer.notes.push(format!(
                "joint '{}': its motor turns with several joints, and its friction is the motor's: a URDF \
                    has no place for it, and the joint keeps its values",
                chain.joints[i].name
            ));
        }
        writer.joint(&chain.joints[i].name, &arm.joints[i], friction);
    }
    let mut effects: Vec<&str> = known.terms.iter().map(|term| term.effect.as_str()).collect();
    effects.sort_unstable();
    effects.dedup();
    if !effects.is_empty() {
        writer.notes.push(format!("a URDF has no place for effects: {} are left out", effects.join(", ")));
    }
    if known.servos.is_some() {
        let what = "gains, limits and rotors of position servos are left out: a URDF has no place for them";
        writer.notes.push(what.to_string());
    }
    if (0..arm.links()).any(|i| known.values[11 * i + 10] != 0.0) {
        let what = "rotor inertias are left out: a URDF has no place for them".to_string();
        writer.notes.push(what);
    }
    let Writer { edits, notes, .. } = writer;
    Ok(Exported { text: edits.apply(text), notes })
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
            "<inertial>\n{}\n{margin}  <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n{margin}  <mass \
             value=\"{}\"/>\n{margin}  <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" \
             izz=\"{}\"/>\n{margin}</inertial>",
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
            let damping = friction.viscous.map(|viscous| ("damping", viscous));
            let values: Vec<(&str, f64)> =
                damping.into_iter().chain([("friction", friction.coulomb)]).collect();
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
