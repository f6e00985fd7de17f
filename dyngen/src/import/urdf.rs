//! A URDF's links and joints as values, read as tolerantly as ROS tools read them: only what an arm needs is
//! looked at, in whatever company it stands.

use roxmltree::{Document, Error, Node, ParsingOptions};

/// The links and joints of a robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
    /// Points where links are held together in addition to their joints.
    pub(crate) connects: Vec<Connect>,
    /// Gravity in the root link, where the file says it, m/s².
    pub(crate) gravity: Option<[f64; 3]>,
    /// What of the file is left out, whatever chain is taken.
    pub(crate) notes: Vec<String>,
}

/// A link, with zeros where it has no `<inertial>`.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    /// In the file, from 1.
    pub(crate) line: u32,
    /// Of the centre of mass and the axes of the inertia tensor in the link's frame.
    pub(crate) origin: Origin,
    /// kg
    pub(crate) mass: f64,
    /// ixx, ixy, ixz, iyy, iyz, izz, kg·m²
    pub(crate) inertia: [f64; 6],
    /// Whether it is more than a part of a joint: where it is fixed to another link its frame has a name of
    /// its own.
    pub(crate) is_named: bool,
    /// Frames on it by their names.
    pub(crate) sites: Vec<(String, Origin)>,
    /// What may surprise, where it takes part in the dynamics.
    pub(crate) note: Option<String>,
}

/// A joint between two links.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) name: String,
    /// In the file, from 1.
    pub(crate) line: u32,
    pub(crate) kind: String,
    pub(crate) parent: String,
    pub(crate) child: String,
    pub(crate) origin: Origin,
    pub(crate) axis: [f64; 3],
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) effort: f64,
    pub(crate) velocity: f64,
    /// The joint that it follows.
    pub(crate) mimic: Option<Mimic>,
    /// What a MuJoCo model states about its drive.
    pub(crate) motor: Option<Motor>,
    /// What may surprise, where it is a joint of the chain.
    pub(crate) note: Option<String>,
}

/// Two links that have a point in common where all joints are at zero.
#[derive(Clone, Debug)]
pub(crate) struct Connect {
    /// In the file, from 1.
    pub(crate) line: u32,
    pub(crate) links: [String; 2],
    /// The point in the first link's frame, m.
    pub(crate) anchor: [f64; 3],
    /// That in the second link's, m, where the file states it: it should be the same.
    pub(crate) other: Option<[f64; 3]>,
}

/// What a joint follows: its position is ratio · the other's + offset.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mimic {
    pub(crate) joint: String,
    pub(crate) ratio: f64,
    /// rad or m
    pub(crate) offset: f64,
}

/// A joint's drive in a MuJoCo model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Motor {
    /// Inertia of the rotor on the joint's side of the gear, kg·m² or kg.
    pub(crate) armature: f64,
    /// N·m·s/rad or N·s/m
    pub(crate) damping: f64,
    /// N·m or N
    pub(crate) friction: f64,
    /// Gear ratio of the joint's actuator, where it has one.
    pub(crate) gear: Option<f64>,
}

/// A pose: m, and roll, pitch, yaw in rad.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Origin {
    pub(crate) xyz: [f64; 3],
    pub(crate) rpy: [f64; 3],
}

/// A larger file is no robot.
const LARGEST_FILE: usize = 64 << 20;
/// A deeper document is no URDF.
const DEEPEST: usize = 100;
/// Prefixes without a namespace that are put up with.
const PREFIXES: usize = 20;

/// Reads a URDF, or says what is wrong with it, one line for each error.
pub(crate) fn read(text: &str) -> Result<Robot, String> {
    if text.len() > LARGEST_FILE {
        return Err("larger than 64 MiB".to_string());
    }
    nested(text)?;
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if text.get(..200.min(text.len())).is_some_and(|head| head.to_lowercase().contains("<!doctype html")) {
        return Err(format!("it is an HTML page{FROM_THE_WEB}"));
    }
    let mut text = text.to_string();
    for _ in 0..PREFIXES {
        let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
        match Document::parse_with_options(&text, options) {
            Ok(document) => return robot(&document),
            // ROS tools do not ask where a prefix was declared.
            Err(Error::UnknownNamespace(prefix, at)) => {
                text = declared(&text, &prefix)
                    .ok_or_else(|| format!("line {}: unknown prefix '{prefix}'", at.row))?;
            }
            Err(e) => return Err(broken(&text, &e)),
        }
    }
    Err("its elements have too many prefixes without a namespace".to_string())
}

const FROM_THE_WEB: &str = ", not a robot: download the raw file";

/// Why a text is no XML, with the line.
pub(crate) fn broken(text: &str, error: &Error) -> String {
    match error {
        // The reader says the first line of what was never closed.
        Error::UnexpectedEndOfStream | Error::UnclosedRootNode => {
            format!("line {}: the file ends within an element: is it all there?", text.lines().count())
        }
        e => format!("line {}: {e}", e.pos().row),
    }
}

/// The text with a namespace for a prefix in its first element.
fn declared(text: &str, prefix: &str) -> Option<String> {
    let starts = text.match_indices('<').map(|(i, _)| i);
    let tag = starts.into_iter().find(|i| text[i + 1..].starts_with(|c: char| c.is_alphabetic()))?;
    let end = tag + text[tag..].find(|c: char| c.is_whitespace() || c == '>' || c == '/')?;
    Some(format!("{} xmlns:{prefix}=\"{prefix}\"{}", &text[..end], &text[end..]))
}

/// XML readers follow nesting by recursion.
pub(crate) fn nested(text: &str) -> Result<(), String> {
    let mut depth = 0usize;
    for piece in text.split('<').skip(1) {
        let tag = piece.split('>').next().unwrap_or("");
        match tag.as_bytes().first() {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'?' | b'!') => {}
            _ if tag.ends_with('/') => {}
            _ => depth += 1,
        }
        if depth > DEEPEST {
            return Err(format!("elements are nested more than {DEEPEST} deep"));
        }
    }
    Ok(())
}

/// Elements of xacro itself: what is not among them is a call of a macro.
const XACRO: [&str; 10] =
    ["macro", "include", "property", "arg", "if", "unless", "insert_block", "element", "attribute", "call"];

fn is_xacro(node: &Node<'_, '_>) -> bool {
    node.tag_name().namespace().is_some_and(|n| n.contains("xacro"))
}

fn robot(document: &Document<'_>) -> Result<Robot, String> {
    let root = document.root_element();
    let macros: Vec<Node<'_, '_>> = document.descendants().filter(is_xacro).collect();
    // A call of a macro that nobody defined is left in files that were expanded otherwise.
    let left_over =
        |node: &Node<'_, '_>| node.parent_element() == Some(root) && !XACRO.contains(&node.tag_name().name());
    let computed = || document.descendants().flat_map(|n| n.attributes()).any(|a| a.value().contains("${"));
    if !macros.is_empty() && (!macros.iter().all(left_over) || computed()) {
        return Err("it is a xacro: expand it first with `xacro FILE.xacro -o robot.urdf`".to_string());
    }
    match root.tag_name().name() {
        "robot" => {}
        "sdf" | "gazebo" => return Err("it is SDF, not URDF: convert it, or export URDF instead".to_string()),
        "html" => return Err(format!("it is an HTML page{FROM_THE_WEB}")),
        "mujoco" => return Err("it is MJCF, not URDF: export URDF instead".to_string()),
        other => return Err(format!("its root element is <{other}>, not <robot>")),
    }
    let mut reader = Reader { document, errors: Vec::new() };
    let mut robot = Robot { name: root.attribute("name").unwrap_or("").to_string(), ..Robot::default() };
    for node in macros {
        let (line, name) = (reader.line(node), node.tag_name().name());
        robot.notes.push(format!("line {line}: the macro <xacro:{name}> was not expanded and is left out"));
    }
    // An element of another namespace, <drake:joint>, is none of the robot's.
    let own = |node: &Node<'_, '_>| node.tag_name().namespace() == root.tag_name().namespace();
    for node in root.children().filter(|node| node.is_element() && own(node)) {
        match node.tag_name().name() {
            "link" => robot.links.extend(reader.link(node)),
            // In a <gazebo> or <transmission> a joint is something else; here it is one of the robot's.
            "joint" => robot.joints.extend(reader.joint(node)),
            _ => {}
        }
    }
    if reader.errors.is_empty() { Ok(robot) } else { Err(reader.errors.join("\n")) }
}

struct Reader<'d, 'i> {
    document: &'d Document<'i>,
    errors: Vec<String>,
}

impl<'d, 'i> Reader<'d, 'i> {
    fn line(&self, node: Node<'d, 'i>) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }

    fn error(&mut self, node: Node<'d, 'i>, message: String) {
        let line = self.line(node);
        self.errors.push(format!("line {line}: {message}"));
    }

    fn link(&mut self, node: Node<'d, 'i>) -> Option<Link> {
        let name = self.name(node, "link")?;
        let place = format!("link '{name}'");
        let inertial = child(node, "inertial");
        let origin = inertial.map_or(Origin::default(), |i| self.origin(i, &format!("{place}: inertial")));
        let mass = inertial.and_then(|i| child(i, "mass"));
        let mass = mass.map_or(0.0, |m| self.number(m, "value", &place));
        let tensor = inertial.and_then(|i| child(i, "inertia"));
        let inertia = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
            .map(|key| tensor.map_or(0.0, |t| self.number(t, key, &place)));
        let line = self.line(node);
        Some(Link { name, line, origin, mass, inertia, is_named: true, sites: Vec::new(), note: None })
    }

    fn joint(&mut self, node: Node<'d, 'i>) -> Option<Joint> {
        let name = self.name(node, "joint")?;
        let place = format!("joint '{name}'");
        let Some(kind) = node.attribute("type") else {
            self.error(node, format!("{place} has no type"));
            return None;
        };
        let mut end = |key: &str| {
            let link = child(node, key).and_then(|n| n.attribute("link"));
            if link.is_none() {
                self.error(node, format!("{place} has no <{key} link=\"…\"/>"));
            }
            link.map(str::to_string)
        };
        let (parent, child_link) = (end("parent"), end("child"));
        let axis = child(node, "axis");
        let axis = axis.map_or([1.0, 0.0, 0.0], |a| self.three(a, "xyz", [1.0, 0.0, 0.0], &place));
        let limit = child(node, "limit");
        let [lower, upper, effort, velocity] = ["lower", "upper", "effort", "velocity"]
            .map(|key| limit.map_or(0.0, |l| self.number(l, key, &place)));
        let mimic = child(node, "mimic").map(|m| Mimic {
            joint: m.attribute("joint").unwrap_or("").to_string(),
            ratio: if m.has_attribute("multiplier") { self.number(m, "multiplier", &place) } else { 1.0 },
            offset: self.number(m, "offset", &place),
        });
        Some(Joint {
            line: self.line(node),
            kind: kind.trim().to_string(),
            parent: parent?,
            child: child_link?,
            origin: self.origin(node, &place),
            axis,
            lower,
            upper,
            effort,
            velocity,
            mimic,
            motor: None,
            note: None,
            name,
        })
    }

    fn name(&mut self, node: Node<'d, 'i>, what: &str) -> Option<String> {
        let name = node.attribute("name").filter(|n| !n.is_empty());
        if name.is_none() {
            self.error(node, format!("a {what} has no name"));
        }
        name.map(str::to_string)
    }

    fn origin(&mut self, node: Node<'d, 'i>, place: &str) -> Origin {
        child(node, "origin").map_or(Origin::default(), |origin| Origin {
            xyz: self.three(origin, "xyz", [0.0; 3], place),
            rpy: self.three(origin, "rpy", [0.0; 3], place),
        })
    }

    /// An attribute of three numbers.
    fn three(&mut self, node: Node<'d, 'i>, key: &str, missing: [f64; 3], place: &str) -> [f64; 3] {
        let Some(text) = node.attribute(key) else { return missing };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|t| t.parse().ok()).collect();
        match numbers.as_deref() {
            Some([x, y, z]) => [*x, *y, *z],
            _ => {
                let element = node.tag_name().name();
                let what = format!("{place}: {key} of <{element}> must be three numbers, found '{text}'");
                self.error(node, what);
                missing
            }
        }
    }

    /// An attribute that is a number; 0 where it is missing.
    fn number(&mut self, node: Node<'d, 'i>, key: &str, place: &str) -> f64 {
        let Some(text) = node.attribute(key) else { return 0.0 };
        text.trim().parse().unwrap_or_else(|_| {
            let element = node.tag_name().name();
            self.error(node, format!("{place}: {key} of <{element}> must be a number, found '{text}'"));
            0.0
        })
    }
}

/// The first element of that name below another.
fn child<'d, 'i>(node: Node<'d, 'i>, name: &str) -> Option<Node<'d, 'i>> {
    let namespace = node.tag_name().namespace();
    node.children()
        .find(|n| n.is_element() && n.tag_name().name() == name && n.tag_name().namespace() == namespace)
}
