//! Identified values in a copy of a MuJoCo model: inertials, damping, frictionloss, armature, springs and
//! ranges; every other byte stays.

use super::body::Body;
use super::dcmotor::{self, Motor, Motors, Spring};
use super::edit::{Edits, child, comment, escaped, indentation, shortest};
use super::known::{Friction, Known};
use super::servo::Servo;
use super::share::{self, Share};
use super::term::Term;
use super::urdf::Exported;
use crate::arm::{Arm, Joint, JointKind};
use crate::exact::rational::{Rational, to_f64};
use crate::import::chain::ChainJoint;
use crate::import::mjcf::{angles_are_radians, read};
use crate::import::urdf::Robot;
use crate::import::{ImportError, Options};
use roxmltree::{Document, Node};

/// Writes what is known of an arm into a copy of the MuJoCo model that it was imported from; `file` names it
/// in errors, and `options` say base, tip and locked joints as they did for the import.
///
/// # Errors
/// Where the file is not a model of this arm, or has no body for a link that has mass.
pub fn mjcf(
    text: &str,
    file: &str,
    arm: &Arm,
    known: &Known,
    options: &Options,
) -> Result<Exported, ImportError> {
    let refused = |reasons| ImportError::refused(file, reasons);
    let unreadable =
        |e: String| ImportError::Unreadable(format!("{file}: cannot be read as a MuJoCo model: {e}"));
    let robot = read(text).map_err(unreadable)?;
    let chain = share::chain(&robot, arm, options).map_err(refused)?;
    let document = Document::parse(text).map_err(|e| unreadable(e.to_string()))?;
    let degrees = !angles_are_radians(&document);
    let mut writer = Writer { text, robot: &robot, document: &document, degrees, edits: Edits::default() };
    let holds = |name: &str| writer.body(name).is_some();
    let shares = share::shares(arm, &chain, &robot, known, &holds).map_err(|e| refused(vec![e]))?;
    let (mut notes, mut actuators, mut tendons) = (Vec::new(), Actuators::default(), Vec::new());
    for (i, share) in shares.into_iter().enumerate() {
        writer.inertials(&share, &known.words[i]);
        notes.extend(share.note);
        let Some(joint) = chain.joints.get(i) else { continue };
        let (held, effects) = held(arm, known, i);
        let turns = match arm.coupled_motor(i) {
            None => {
                writer.joint(joint, &arm.joints[i], &held);
                format!("joint=\"{}\"", escaped(&joint.name))
            }
            Some(joints) => {
                writer.joint(joint, &arm.joints[i], &held.moved_away());
                let of = |(j, factor): (usize, Rational)| (chain.joints[j].name.as_str(), to_f64(&factor));
                let joints: Vec<(&str, f64)> = joints.into_iter().map(of).collect();
                joints.iter().for_each(|(name, _)| writer.name_joint(name));
                let tendon = format!("{OURS}motor {}", joint.name);
                notes.push(format!(
                    "joint '{}': its motor turns with several joints: friction and rotor are on the tendon \
                     '{tendon}', whose length is the motor's position",
                    joint.name
                ));
                tendons.extend(tendon_lines(&tendon, &joints, &held));
                format!("tendon=\"{}\"", escaped(&tendon))
            }
        };
        if !effects.motors.is_empty() {
            writer.name_joint(&joint.name);
        }
        if let Some(servo) = known.servos.as_ref().and_then(|servos| servos[i].as_ref()) {
            let left_out = servo.left_out.iter().map(|what| format!("joint '{}': {what}", joint.name));
            actuators.left_out.extend(left_out);
            writer.servo(&joint.name, servo, &mut actuators.servos);
        }
        actuators.add(&joint.name, &turns, effects);
    }
    for closed in &chain.loops {
        let follows = arm.joints[closed.first].mimic.is_some();
        let (of_chain, _) = held(arm, known, if follows { closed.last } else { closed.first });
        // What was identified is that of the whole loop, and stands at its joint of the chain.
        for pin in &closed.pins {
            writer.pin(pin, &of_chain.moved_away());
        }
    }
    notes.extend(actuators.left_out.iter().map(|what| format!("left out: {what}")));
    writer.tendons(&tendons);
    writer.actuators(&actuators);
    Ok(Exported { text: writer.edits.apply(text), notes })
}

/// The values of a joint, or of its motor's tendon, and the effects in addition to them.
fn held(arm: &Arm, known: &Known, i: usize) -> (Held, Motors) {
    let rotor = known.values[11 * i + 10];
    let servo = known.servos.as_ref().and_then(|servos| servos[i].as_ref());
    let armature = arm.joints[i].rotor_ratio.as_ref().map(|k| to_f64(k).powi(2) * rotor);
    let armature = servo.map(|servo| servo.armature).or(armature);
    let mut friction = known.friction.as_ref().and_then(|f| f[i]);
    let terms: Vec<&Term> = known.terms.iter().filter(|term| term.link == i).collect();
    let mut effects = dcmotor::motors(arm.joints[i].kind, friction, &terms);
    if let Some(friction) = friction.as_mut().filter(|_| effects.has_coulomb) {
        friction.coulomb = 0.0;
    }
    (Held { friction, armature, spring: effects.spring.take() }, effects)
}

/// The values of a joint in addition to its range, or of the tendon of a motor that turns with several
/// joints.
struct Held {
    friction: Option<Friction>,
    armature: Option<f64>,
    spring: Option<Spring>,
}

impl Held {
    /// The values that stay at a joint if a tendon, or another joint of its loop, holds these.
    fn moved_away(&self) -> Held {
        let none = |friction: Friction| Friction {
            viscous: friction.viscous.map(|_| 0.0),
            coulomb: 0.0,
            std: [None; 2],
        };
        Held { friction: self.friction.map(none), armature: self.armature.map(|_| 0.0), spring: None }
    }
}

/// Effects of all joints.
#[derive(Default)]
struct Actuators {
    motors: Vec<Placed>,
    /// Position servos of joints that have none in the model.
    servos: Vec<String>,
    left_out: Vec<String>,
}

impl Actuators {
    /// Adds the effects of a joint, whose torque acts on the part named by `turns`.
    fn add(&mut self, joint: &str, turns: &str, effects: Motors) {
        self.left_out.extend(effects.left_out.into_iter().map(|why| format!("joint '{joint}': {why}")));
        let placed = |motor| Placed { joint: joint.to_string(), turns: turns.to_string(), motor };
        self.motors.extend(effects.motors.into_iter().map(placed));
    }
}

struct Placed {
    joint: String,
    /// The attribute that says what its torque acts on.
    turns: String,
    motor: Motor,
}

/// The fixed tendon of a motor, whose length is the motor's position: the sum of joint positions times
/// factors.
fn tendon_lines(name: &str, joints: &[(&str, f64)], held: &Held) -> Vec<String> {
    let mut words = vec!["dyngen: a motor that turns with several joints".to_string()];
    let mut attributes = format!("name=\"{}\"", escaped(name));
    let mut add = |key: &str, value: f64| attributes += &format!(" {key}=\"{}\"", shortest(value));
    if let Some(friction) = &held.friction {
        words.push(errors(friction));
        if let Some(viscous) = friction.viscous {
            add("damping", viscous);
        }
        add("frictionloss", friction.coulomb);
    }
    if let Some(armature) = held.armature {
        add("armature", armature);
    }
    if let Some(spring) = &held.spring {
        words.push(spring.words.clone());
        add("stiffness", spring.stiffness);
        add("springlength", spring.rest);
    }
    let joint = |(name, factor): &(&str, f64)| {
        format!("  <joint joint=\"{}\" coef=\"{}\"/>", escaped(name), shortest(*factor))
    };
    let mut lines = vec![comment(&words.join("; ")), format!("<fixed {attributes}>")];
    lines.extend(joints.iter().map(joint));
    lines.push("</fixed>".to_string());
    lines
}

/// The standard errors of friction, in words.
fn errors(friction: &Friction) -> String {
    let error = |k: usize| friction.std[k].map_or("unknown".to_string(), |s| format!("{s:.3e}"));
    format!("standard errors: damping {}, frictionloss {}", error(0), error(1))
}

/// Prefix of the names of actuators that an export writes, and that the next one replaces.
const OURS: &str = "dyngen ";

struct Writer<'t, 'd> {
    text: &'t str,
    robot: &'d Robot,
    document: &'d Document<'t>,
    /// Whether its angles are degrees, not radians.
    degrees: bool,
    edits: Edits,
}

impl<'t, 'd> Writer<'t, 'd> {
    /// The element of that kind and name, or without a name in that line.
    fn element(&self, kind: &str, name: &str, line: u32) -> Option<Node<'d, 't>> {
        let place = |n: &Node<'d, 't>| self.document.text_pos_at(n.range().start).row;
        let world = child(self.document.root_element(), "worldbody")?;
        let mut all = world.descendants().filter(|n| n.has_tag_name(kind));
        all.clone().find(|n| n.attribute("name") == Some(name)).or_else(|| {
            all.find(|n| n.attribute("name").is_none() && place(n) == line && name.contains(" in line "))
        })
    }

    fn body(&self, name: &str) -> Option<Node<'d, 't>> {
        let link = self.robot.links.iter().find(|link| link.name == name);
        self.element("body", name, link.map_or(0, |link| link.line))
    }

    fn joint_element(&self, name: &str) -> Option<Node<'d, 't>> {
        let joint = self.robot.joints.iter().find(|joint| joint.name == name);
        self.element("joint", name, joint.map_or(0, |joint| joint.line))
    }

    /// A link's inertia, and none for those whose inertia is in it.
    fn inertials(&mut self, Share { link, body, emptied, .. }: &Share, words: &[String]) {
        self.inertial(link, body, words);
        let none = Body::of_parameters(&[0.0; 10]);
        for other in emptied {
            self.inertial(other, &none, &[format!("its inertia is part of body '{link}'")]);
        }
    }

    fn inertial(&mut self, name: &str, body: &Body, words: &[String]) {
        let Some(node) = self.body(name) else { return };
        let old = child(node, "inertial");
        let at = old.map_or(node.range().start, |inertial| inertial.range().start);
        let margin = indentation(self.text, at);
        let margin = if old.is_some() { margin.to_string() } else { format!("{margin}  ") };
        let (centre, t) = body.centre();
        let comments: String = words.iter().map(|line| format!("{}\n{margin}", comment(line))).collect();
        let list = |values: &[f64]| values.iter().map(|x| shortest(*x)).collect::<Vec<_>>().join(" ");
        let new = format!(
            "{}\n{margin}{comments}<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            comment("identified by dyngen"),
            list(centre.as_slice()),
            shortest(body.mass),
            list(&[t[(0, 0)], t[(1, 1)], t[(2, 2)], t[(0, 1)], t[(0, 2)], t[(1, 2)]])
        );
        match (old, node.first_child()) {
            (Some(old), _) => self.edits.replace(old.range(), new),
            // A body that moves has a joint in it.
            (None, Some(first)) => self.edits.insert(first.range().start, format!("\n{margin}{new}")),
            (None, None) => {}
        }
    }

    /// Writes the values of a joint of the chain, and its range if it has changed.
    fn joint(&mut self, old: &ChainJoint, joint: &Joint, held: &Held) {
        let Some(node) = self.joint_element(&old.name) else { return };
        self.drive(node, held);
        let unit = if self.degrees && joint.kind == JointKind::Revolute {
            180.0 / std::f64::consts::PI
        } else {
            1.0
        };
        if let Some(spring) = &held.spring {
            self.edits.insert(node.range().start, comment(&format!("dyngen: {}", spring.words)));
            self.attribute(node, "stiffness", shortest(spring.stiffness));
            self.attribute(node, "springref", shortest(spring.rest * unit));
        }
        if let Some([low, high]) = joint.position.filter(|p| Some(*p) != old.position) {
            self.attribute(node, "range", format!("{} {}", shortest(low * unit), shortest(high * unit)));
        }
    }

    /// Writes friction and armature of a hinge between two bars; a `<connect>` has none.
    fn pin(&mut self, name: &str, held: &Held) {
        if let Some(node) = self.joint_element(name) {
            self.drive(node, held);
        }
    }

    /// Writes friction and armature of a joint.
    fn drive(&mut self, node: Node<'d, 't>, held: &Held) {
        if let Some(friction) = &held.friction {
            if friction.viscous != Some(0.0) || friction.coulomb != 0.0 || friction.std != [None; 2] {
                self.edits.insert(node.range().start, comment(&format!("dyngen: {}", errors(friction))));
            }
            if let Some(viscous) = friction.viscous {
                self.attribute(node, "damping", shortest(viscous));
            }
            self.attribute(node, "frictionloss", shortest(friction.coulomb));
        }
        if let Some(armature) = held.armature {
            self.attribute(node, "armature", shortest(armature));
        }
    }

    /// A joint that an actuator turns has a name.
    fn name_joint(&mut self, name: &str) {
        if let Some(node) = self.joint_element(name).filter(|node| node.attribute("name").is_none()) {
            self.attribute(node, "name", escaped(name));
        }
    }

    /// Writes a servo into the model's own `<position>` of that joint, or as a new one into `more`.
    fn servo(&mut self, joint: &str, servo: &Servo, more: &mut Vec<String>) {
        let range = servo.force.map(|force| format!("{} {}", shortest(-force), shortest(force)));
        let values =
            [("kp", Some(shortest(servo.kp))), ("kv", Some(shortest(servo.kv))), ("forcerange", range)];
        let values = values.into_iter().filter_map(|(key, value)| Some((key, value?)));
        let root = self.document.root_element();
        let mut all =
            root.children().filter(|n| n.has_tag_name("actuator")).flat_map(|n| n.children()).filter(|n| {
                let name = n.attribute("name").unwrap_or_default();
                n.has_tag_name("position") && n.attribute("joint") == Some(joint) && !name.starts_with(OURS)
            });
        match all.next() {
            Some(own) => {
                values.for_each(|(key, value)| self.attribute(own, key, value));
                // MuJoCo takes one of the two.
                if let Some(ratio) = own.attribute_node("dampratio") {
                    self.edits.replace(ratio.range(), "");
                }
            }
            None => {
                self.name_joint(joint);
                let values: String = values.map(|(key, value)| format!(" {key}=\"{value}\"")).collect();
                let joint = escaped(joint);
                more.push(format!("<position name=\"{OURS}servo {joint}\" joint=\"{joint}\"{values}/>"));
            }
        }
    }

    /// Writes servos, and effects as passive actuators, in the place of those of an earlier export.
    fn actuators(&mut self, Actuators { motors, servos, left_out }: &Actuators) {
        let (last, old) = self.cleared("actuator", &["dcmotor", "position"]);
        let mut states = -(old.iter().filter(|node| node.attribute("lugre").is_some()).count() as i64);
        if motors.is_empty() && servos.is_empty() && left_out.is_empty() && states == 0 {
            return;
        }
        let mut lines: Vec<String> =
            left_out.iter().map(|what| comment(&format!("dyngen: left out: {what}"))).collect();
        lines.extend(servos.iter().cloned());
        for (k, Placed { joint, turns, motor }) in motors.iter().enumerate() {
            states += i64::from(motor.has_state);
            lines.push(comment(&format!("dyngen: joint '{joint}': {}", motor.words)));
            let name = escaped(&format!("{OURS}{} {joint}", k + 1));
            lines.push(format!(
                "<dcmotor name=\"{name}\" {turns} input=\"none\" motorconst=\"0 0\" resistance=\"1\" {}/>",
                motor.attributes
            ));
        }
        self.append("actuator", last, &lines);
        self.states(states);
    }

    /// Writes motors that turn with several joints, in the place of those of an earlier export.
    fn tendons(&mut self, lines: &[String]) {
        let (last, _) = self.cleared("tendon", &["fixed"]);
        self.append("tendon", last, lines);
    }

    /// Takes out what an earlier export wrote into the sections of a name: elements of some kinds, and
    /// comments. Returns the last of the sections, and what was in.
    fn cleared(&mut self, section: &str, kinds: &[&str]) -> (Option<Node<'d, 't>>, Vec<Node<'d, 't>>) {
        let root = self.document.root_element();
        let sections: Vec<Node<'d, 't>> = root.children().filter(|n| n.has_tag_name(section)).collect();
        let ours = |n: &Node<'d, 't>| {
            kinds.iter().any(|kind| n.has_tag_name(*kind))
                && n.attribute("name").is_some_and(|name| name.starts_with(OURS))
                || n.is_comment() && n.text().is_some_and(|text| text.trim_start().starts_with("dyngen: "))
        };
        let old: Vec<Node<'d, 't>> =
            sections.iter().flat_map(|section| section.children()).filter(ours).collect();
        for node in &old {
            let before = self.text[..node.range().start].trim_end().len();
            self.edits.replace(before..node.range().end, "");
        }
        (sections.last().copied(), old)
    }

    /// Puts lines at the end of a section: actuators come last then, as their states do.
    fn append(&mut self, name: &str, section: Option<Node<'d, 't>>, lines: &[String]) {
        if lines.is_empty() {
            return;
        }
        let root = self.document.root_element();
        let inner =
            |margin: &str| -> String { lines.iter().map(|line| format!("\n{margin}{line}")).collect() };
        match section.map(|section| (section, section.last_child())) {
            Some((section, Some(last))) => {
                let margin = indentation(self.text, section.range().start);
                let end = last.range().start + self.text[last.range()].trim_end().len();
                self.edits.insert(end, inner(&format!("{margin}  ")));
            }
            // <actuator/>
            Some((section, None)) => {
                let margin = indentation(self.text, section.range().start);
                let inner = inner(&format!("{margin}  "));
                self.edits.replace(section.range(), format!("<{name}>{inner}\n{margin}</{name}>"));
            }
            None => {
                let end = root.last_child().map_or(root.range().end, |last| last.range().end);
                let end = self.text[..end].trim_end().len();
                self.edits.insert(end, format!("\n  <{name}>{}\n  </{name}>", inner("    ")));
            }
        }
    }

    /// Key frames have a number for each state.
    fn states(&mut self, more: i64) {
        let root = self.document.root_element();
        let keys = root.children().filter(|n| n.has_tag_name("keyframe")).flat_map(|n| n.children());
        for act in keys.filter_map(|key| key.attribute_node("act")) {
            let mut states: Vec<&str> = act.value().split_whitespace().collect();
            let kept = states.len().saturating_sub(usize::try_from(-more).unwrap_or(0));
            states.truncate(kept);
            states.resize(kept + usize::try_from(more).unwrap_or(0), "0");
            self.edits.replace(act.range_value(), states.join(" "));
        }
    }

    /// Gives an element an attribute; others stay.
    fn attribute(&mut self, node: Node<'d, 't>, key: &str, value: String) {
        match node.attribute_node(key) {
            Some(attribute) => self.edits.replace(attribute.range_value(), value),
            None => {
                let start = node.range().start + 1 + node.tag_name().name().len();
                self.edits.insert(start, format!(" {key}=\"{value}\""));
            }
        }
    }
}
