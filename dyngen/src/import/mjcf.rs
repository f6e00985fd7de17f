//! A MuJoCo model's bodies and joints as the links and joints of a robot.
//!
//! A body is a link; a body with several joints gets a link without mass between each two. Where a joint does
//! not sit at the body's origin, a fixed joint leads back from it. MuJoCo's documentation of `compiler`,
//! `default` classes and orientations: mujoco.readthedocs.io, XMLreference and modeling.

use super::equality::{self, Equality};
use super::numbers::finite;
use super::orientation::{Angles, turn};
use super::pose::Pose;
use super::shapes::{GROUPS, Solid};
use super::urdf::{Connect, Joint, Link, Mimic, Motor, Origin, Robot, broken, nested};
use nalgebra::{Matrix3, Rotation3, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::BTreeMap;

/// What the body that stands still is called in MuJoCo.
pub(super) const WORLD: &str = "world";
/// Elements of which MuJoCo makes bodies when it compiles.
const UNREADABLE: [&str; 5] = ["include", "attach", "replicate", "composite", "flexcomp"];

/// Whether a text looks like a MuJoCo model.
pub(super) fn is_mjcf(text: &str) -> bool {
    let parsed =
        Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..ParsingOptions::default() });
    match parsed {
        Ok(document) => document.root_element().has_tag_name("mujoco"),
        Err(_) => text.contains("<mujoco") && !text.contains("<robot"),
    }
}

/// Reads a model, or says what is wrong with it, one line for each error.
pub(crate) fn read(text: &str) -> Result<Robot, String> {
    nested(text)?;
    let document = Document::parse(text).map_err(|e| broken(text, &e))?;
    let root = document.root_element();
    if !root.has_tag_name("mujoco") {
        return Err(format!("its root element is <{}>, not <mujoco>", root.tag_name().name()));
    }
    let mut reader = Reader {
        document: &document,
        compiler: Compiler::default(),
        classes: BTreeMap::new(),
        gears: BTreeMap::new(),
        references: BTreeMap::new(),
        robot: Robot { name: root.attribute("model").unwrap_or("").to_string(), ..Robot::default() },
        errors: Vec::new(),
    };
    reader.model(root);
    if reader.errors.is_empty() { Ok(reader.robot) } else { Err(reader.errors.join("\n")) }
}

/// Whether a model's angles are radians, not degrees.
pub(crate) fn angles_are_radians(document: &Document<'_>) -> bool {
    let compilers = elements(document.root_element()).filter(|n| n.has_tag_name("compiler"));
    compilers.filter_map(|n| n.attribute("angle")).last() == Some("radian")
}

/// What `<compiler>` states about numbers.
struct Compiler {
    angles: Angles,
    /// Whether a joint with a range is limited without saying so; it is unless this is set.
    no_auto_limits: bool,
    /// Of shapes whose mass counts.
    groups: [f64; 2],
    /// Whether bodies have the inertia of their shapes, whatever `<inertial>` says.
    of_shapes: bool,
    /// That of all bodies together, where it is asked for, kg.
    total_mass: Option<f64>,
}

impl Default for Compiler {
    fn default() -> Self {
        Compiler {
            angles: Angles::default(),
            no_auto_limits: false,
            groups: GROUPS,
            of_shapes: false,
            total_mass: None,
        }
    }
}

/// Attributes that a default class gives to joints and to geoms.
type Class = [BTreeMap<String, String>; 2];
const JOINT: usize = 0;
const GEOM: usize = 1;

struct Reader<'d, 'i> {
    document: &'d Document<'i>,
    compiler: Compiler,
    /// Attributes of joints and shapes by class, with those of the classes around.
    classes: BTreeMap<String, Class>,
    /// Gear of the actuator of a joint.
    gears: BTreeMap<String, f64>,
    /// Positions of joints where the model is drawn, where they are not zero, rad or m.
    references: BTreeMap<String, f64>,
    robot: Robot,
    errors: Vec<String>,
}

impl<'d, 'i> Reader<'d, 'i> {
    fn line(&self, node: Node<'d, 'i>) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }

    fn error(&mut self, node: Node<'d, 'i>, message: impl std::fmt::Display) {
        let line = self.line(node);
        self.errors.push(format!("line {line}: {message}"));
    }

    fn model(&mut self, root: Node<'d, 'i>) {
        let sections = |name: &'static str| elements(root).filter(move |n| n.has_tag_name(name));
        for node in root.descendants().filter(|n| n.is_element() && UNREADABLE.contains(&n.tag_name().name()))
        {
            let name = node.tag_name().name();
            self.error(
                node,
                format!(
                    "<{name}> is not followed here: save the compiled model first, with \
                     mujoco.mj_saveLastXML or `compile model.xml whole.xml`"
                ),
            );
        }
        for node in sections("compiler") {
            self.compiler(node);
        }
        self.robot.gravity = Some([0.0, 0.0, -9.81]);
        for node in sections("option") {
            if let Some(g) = self.numbers::<3>(node, "gravity") {
                self.robot.gravity = Some(g);
            }
        }
        for node in sections("default") {
            self.class(node, "main", &Class::default());
        }
        for node in sections("actuator").flat_map(elements) {
            let has = |key: &str| node.attribute(key).is_some();
            if node.has_tag_name("dcmotor") && (has("lugre") || has("cogging")) {
                let line = self.line(node);
                self.robot.notes.push(format!("line {line}: friction and cogging of <dcmotor> are left out"));
            }
            // A passive one drives nothing: its gear is the order of its cogging.
            if node.attribute("input") == Some("none") {
                continue;
            }
            if let (Some(joint), Some(gear)) = (node.attribute("joint"), node.attribute("gear")) {
                let first = gear.split_whitespace().next().and_then(|g| g.parse::<f64>().ok());
                self.gears.extend(first.filter(|g| g.abs() > 1.0).map(|g| (joint.to_string(), g.abs())));
            }
        }
        self.robot.links.push(massless(WORLD, 1));
        for node in sections("worldbody") {
            self.children(node, WORLD, &Pose::identity(), "main");
        }
        self.scale_masses();
        for node in sections("equality").flat_map(elements) {
            self.equality(node);
        }
    }

    /// Gives all bodies together the mass that the compiler asks for.
    fn scale_masses(&mut self) {
        let total: f64 = self.robot.links.iter().map(|link| link.mass).sum();
        let Some(factor) = self.compiler.total_mass.map(|mass| mass / total).filter(|f| f.is_finite()) else {
            return;
        };
        self.robot.notes.push(format!("settotalmass: masses and inertias are multiplied by {factor:.6}"));
        for link in &mut self.robot.links {
            link.mass *= factor;
            link.inertia.iter_mut().for_each(|x| *x *= factor);
        }
    }

    /// A joint that follows another one by a straight line is one that mimics it; other equalities are
    /// reported.
    fn equality(&mut self, node: Node<'d, 'i>) {
        let (line, kind) = (self.line(node), node.tag_name().name());
        let reference = |joint: &str| self.references.get(joint).copied().unwrap_or(0.0);
        let left_out = |what: &str| format!("line {line}: the equality <{kind}> is left out: {what}");
        match equality::read(node) {
            Ok(None) => {}
            Ok(Some(Equality::LeftOut(why))) => self.robot.notes.push(left_out(why)),
            Ok(Some(Equality::Stands { joint, offset })) => {
                let held = offset + reference(&joint);
                let what = left_out(&format!("it holds joint '{joint}', as --lock {joint}={held} does"));
                self.robot.notes.push(what);
            }
            Ok(Some(Equality::Connects { bodies, sites, anchor })) => {
                match self.connect(line, bodies, sites, anchor) {
                    Ok(connect) => self.robot.connects.push(connect),
                    Err(message) => self.error(node, message),
                }
            }
            Ok(Some(Equality::Follows { joint, leader, offset, ratio })) => {
                let offset = offset + reference(&joint) - ratio * reference(&leader);
                match self.robot.joints.iter_mut().find(|j| j.name == joint) {
                    Some(follower) => follower.mimic = Some(Mimic { joint: leader, ratio, offset }),
                    None => self.error(node, format!("<joint joint1=\"{joint}\">: there is no such joint")),
                }
            }
            Err(message) => self.error(node, message),
        }
    }

    /// The links that a `<connect>` holds together, and where.
    fn connect(
        &self,
        line: u32,
        bodies: [String; 2],
        sites: Option<[String; 2]>,
        anchor: [f64; 3],
    ) -> Result<Connect, String> {
        let links = &self.robot.links;
        let Some(sites) = sites else {
            let missing = bodies.iter().find(|body| !links.iter().any(|link| link.name == **body));
            return match missing {
                Some(body) => Err(format!("<connect>: there is no body '{body}'")),
                None => Ok(Connect { line, links: bodies, anchor, other: None }),
            };
        };
        let of = |site: &String| {
            let at = |link: &Link| {
                let (_, origin) = link.sites.iter().find(|(name, _)| name == site)?;
                Some((link.name.clone(), origin.xyz))
            };
            links.iter().find_map(at).ok_or_else(|| format!("<connect>: there is no site '{site}' on a body"))
        };
        let ((one, anchor), (another, other)) = (of(&sites[0])?, of(&sites[1])?);
        Ok(Connect { line, links: [one, another], anchor, other: Some(other) })
    }

    fn compiler(&mut self, node: Node<'d, 'i>) {
        match node.attribute("angle") {
            Some("radian") => self.compiler.angles.radian = true,
            Some("degree") | None => {}
            Some(other) => {
                self.error(node, format!("compiler: angle must be degree or radian, found '{other}'"))
            }
        }
        if let Some(order) = node.attribute("eulerseq") {
            let known = order.len() == 3 && order.chars().all(|c| "xyzXYZ".contains(c));
            match known {
                true => self.compiler.angles.order = order.to_string(),
                false => {
                    self.error(node, format!("compiler: eulerseq '{order}' is no sequence of three axes"))
                }
            }
        }
        self.compiler.no_auto_limits |= node.attribute("autolimits") == Some("false");
        if let Some([mass]) = self.numbers::<1>(node, "settotalmass") {
            self.compiler.total_mass = Some(mass).filter(|mass| *mass > 0.0);
        }
        for key in ["boundmass", "boundinertia"] {
            if node.attribute(key).and_then(|x| x.trim().parse::<f64>().ok()).is_some_and(|x| x > 0.0) {
                self.error(node, format!("compiler: {key} changes masses: save the compiled model first"));
            }
        }
        self.compiler.of_shapes |= node.attribute("inertiafromgeom") == Some("true");
        if let Some(groups) = self.numbers::<2>(node, "inertiagrouprange") {
            self.compiler.groups = groups;
        }
        if node.attribute("coordinate") == Some("global") {
            self.error(node, "compiler: global coordinates are not read: save the compiled model first");
        }
    }

    fn class(&mut self, node: Node<'d, 'i>, name: &str, around: &Class) {
        let name = node.attribute("class").unwrap_or(name);
        let mut own = around.clone();
        for (own, kind) in own.iter_mut().zip(["joint", "geom"]) {
            for element in elements(node).filter(|n| n.has_tag_name(kind)) {
                own.extend(attributes(element));
            }
        }
        self.classes.insert(name.to_string(), own.clone());
        for inner in elements(node).filter(|n| n.has_tag_name("default")) {
            self.class(inner, "main", &own);
        }
    }

    /// The bodies of a body, or of a frame in it, which lies at `pose` in the body.
    fn children(&mut self, node: Node<'d, 'i>, parent: &str, pose: &Pose, class: &str) {
        for child in elements(node) {
            match child.tag_name().name() {
                "body" => self.body(child, parent, pose, class),
                "frame" => {
                    let inner = pose.then(&self.pose(child));
                    let class = child.attribute("childclass").unwrap_or(class).to_string();
                    self.children(child, parent, &inner, &class);
                }
                _ => {}
            }
        }
    }

    fn body(&mut self, node: Node<'d, 'i>, parent: &str, pose: &Pose, class: &str) {
        let line = self.line(node);
        let name = match node.attribute("name") {
            Some(name) => name.to_string(),
            None => format!("body in line {line}"),
        };
        let class = node.attribute("childclass").unwrap_or(class).to_string();
        // Where the next joint, or the body, sits in the link that it hangs on.
        let mut at = pose.then(&self.pose(node));
        let mut parent = parent.to_string();
        let joints: Vec<Node<'d, 'i>> =
            elements(node).filter(|n| n.has_tag_name("joint") || n.has_tag_name("freejoint")).collect();
        for (k, joint) in joints.iter().enumerate() {
            let link = format!("{name}, joint {}", k + 1);
            at = self.joint(*joint, &parent, &link, &at, &class, &name);
            self.robot.links.push(massless(&link, line));
            parent = link;
        }
        self.robot.joints.push(fixed(&parent, &name, &at, line));
        let mut link = self.inertial(node, &name, line, &class);
        link.is_named = joints.is_empty() && node.has_attribute("name");
        self.sites(node, &Pose::identity(), &mut link.sites);
        self.robot.links.push(link);
        self.children(node, &name, &Pose::identity(), &class);
    }

    /// The named sites of a body, or of a frame in it, which lies at `pose` in the body.
    fn sites(&mut self, node: Node<'d, 'i>, pose: &Pose, sites: &mut Vec<(String, Origin)>) {
        for child in elements(node) {
            match (child.tag_name().name(), child.attribute("name")) {
                ("site", Some(name)) => {
                    let at = pose.then(&self.pose(child));
                    sites.push((name.to_string(), origin(&at)));
                }
                ("frame", _) => {
                    let inner = pose.then(&self.pose(child));
                    self.sites(child, &inner, sites);
                }
                _ => {}
            }
        }
    }

    /// Adds a joint of a body that lies at `at` in the link `parent`; gives the body's place in the link
    /// behind it.
    fn joint(
        &mut self,
        node: Node<'d, 'i>,
        parent: &str,
        child: &str,
        at: &Pose,
        class: &str,
        body: &str,
    ) -> Pose {
        let line = self.line(node);
        let name = match node.attribute("name") {
            Some(name) => name.to_string(),
            None => format!("{body}, joint in line {line}"),
        };
        let class = node.attribute("class").unwrap_or(class);
        let all = self.all_attributes(node, class, JOINT);
        let place = format!("line {line}: joint '{name}'");
        let axis = self.numbers_among(&all, "axis", &place).unwrap_or([0.0, 0.0, 1.0]);
        let point = Vector3::from(self.numbers_among(&all, "pos", &place).unwrap_or([0.0; 3]));
        let range = self.numbers_among::<2>(&all, "range", &place);
        let mut number = |key: &str| self.numbers_among(&all, key, &place).map_or(0.0, |[x]| x);
        let (armature, damping, loss, reference, stiffness) = (
            number("armature"),
            number("damping"),
            number("frictionloss"),
            number("ref"),
            number("stiffness"),
        );
        let force = self.numbers_among(&all, "actuatorfrcrange", &place);
        let kind = kind_of_joint(node, &all);
        let limited = match all.get("limited").map(String::as_str) {
            Some("true") => true,
            Some("false") => false,
            _ => !self.compiler.no_auto_limits,
        };
        let unit = if kind == "revolute" { self.compiler.angles.unit() } else { 1.0 };
        let range = range.filter(|[low, high]| limited && low < high).map(|r| r.map(|x| x * unit));
        let motor = Motor { armature, damping, friction: loss, gear: self.gears.get(&name).copied() };
        let note = (stiffness != 0.0)
            .then(|| format!("{place}: its spring of {stiffness} N·m/rad (or N/m) is left out"));
        let reference = reference * unit;
        if reference != 0.0 {
            self.references.insert(name.clone(), reference);
        }
        // Where the model is drawn the joint is at its reference: it goes back by that to zero.
        let back = back(kind, Vector3::from(axis), reference);
        let joint_at = Pose { origin: at.point(point), ..*at }.then(&back);
        self.robot.joints.push(Joint {
            name,
            line,
            kind: if kind == "revolute" && range.is_none() { "continuous" } else { kind }.to_string(),
            parent: parent.to_string(),
            child: child.to_string(),
            origin: origin(&joint_at),
            axis,
            lower: range.map_or(0.0, |r| r[0]),
            upper: range.map_or(0.0, |r| r[1]),
            effort: force.map_or(0.0, |[low, high]: [f64; 2]| low.abs().min(high.abs())),
            velocity: 0.0,
            mimic: None,
            motor: Some(motor),
            note,
        });
        Pose { rotation: Matrix3::identity(), origin: -point }
    }

    /// The numbers of an attribute among those of an element and its class.
    fn numbers_among<const N: usize>(
        &mut self,
        all: &BTreeMap<String, String>,
        key: &str,
        place: &str,
    ) -> Option<[f64; N]> {
        let text = all.get(key)?;
        let found = finite(text).and_then(|n| <[f64; N]>::try_from(n).ok());
        if found.is_none() {
            self.errors.push(format!("{place}: {key} must be {N} numbers, found '{text}'"));
        }
        found
    }

    /// An element's attributes, with those of its class.
    fn all_attributes(&self, node: Node<'d, 'i>, class: &str, kind: usize) -> BTreeMap<String, String> {
        let class = self.classes.get(node.attribute("class").unwrap_or(class));
        let mut all = class.map(|class| class[kind].clone()).unwrap_or_default();
        all.extend(attributes(node));
        all
    }

    /// The shapes of a body, or of a frame in it, which lies at `pose` in the body.
    fn solids(
        &mut self,
        node: Node<'d, 'i>,
        pose: &Pose,
        class: &str,
        solids: &mut Vec<Solid>,
    ) -> Result<(), String> {
        for child in elements(node) {
            match child.tag_name().name() {
                "geom" => {
                    let all = self.all_attributes(child, class, GEOM);
                    let at = self.pose(child);
                    let solid = Solid::read(&all, at, self.compiler.groups)?;
                    solids.extend(solid.map(|solid| solid.seen_from(pose)));
                }
                "frame" => {
                    let inner = pose.then(&self.pose(child));
                    let class = child.attribute("childclass").unwrap_or(class).to_string();
                    self.solids(child, &inner, &class, solids)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A body without `<inertial>` has the inertia of its shapes.
    fn of_shapes(&mut self, node: Node<'d, 'i>, name: &str, line: u32, class: &str) -> Link {
        let mut solids = Vec::new();
        if let Err(why) = self.solids(node, &Pose::identity(), class, &mut solids) {
            let note = format!(
                "line {line}: body '{name}' has no <inertial>, and {why}: here it has no mass \
                 (mujoco.mj_saveLastXML writes inertials)"
            );
            return Link { note: Some(note), ..massless(name, line) };
        }
        let (mass, centre, t) = Solid::together(&solids);
        let note = (mass > 0.0).then(|| {
            format!("line {line}: body '{name}' has no <inertial>: it has the {mass:.6} kg of its shapes")
        });
        let inertia = [t[(0, 0)], t[(0, 1)], t[(0, 2)], t[(1, 1)], t[(1, 2)], t[(2, 2)]];
        let origin = Origin { xyz: centre.into(), rpy: [0.0; 3] };
        Link { origin, mass, inertia, note, ..massless(name, line) }
    }

    fn inertial(&mut self, node: Node<'d, 'i>, name: &str, line: u32, class: &str) -> Link {
        let given = elements(node).find(|n| n.has_tag_name("inertial")).filter(|_| !self.compiler.of_shapes);
        let Some(inertial) = given else {
            return self.of_shapes(node, name, line, class);
        };
        let pose = self.pose(inertial);
        let [mass] = self.numbers::<1>(inertial, "mass").unwrap_or([0.0]);
        let full = self.numbers::<6>(inertial, "fullinertia");
        let [xx, yy, zz, xy, xz, yz] = full.unwrap_or_else(|| {
            let [x, y, z] = self.numbers::<3>(inertial, "diaginertia").unwrap_or([0.0; 3]);
            [x, y, z, 0.0, 0.0, 0.0]
        });
        Link { origin: origin(&pose), mass, inertia: [xx, xy, xz, yy, yz, zz], ..massless(name, line) }
    }

    /// pos with quat, axisangle, euler, xyaxes or zaxis.
    fn pose(&mut self, node: Node<'d, 'i>) -> Pose {
        let place = Vector3::from(self.numbers::<3>(node, "pos").unwrap_or([0.0; 3]));
        match turn(node, &self.compiler.angles) {
            Ok(rotation) => Pose { rotation, origin: place },
            Err(message) => {
                self.error(node, message);
                Pose { rotation: Matrix3::identity(), origin: place }
            }
        }
    }

    fn numbers<const N: usize>(&mut self, node: Node<'d, 'i>, key: &str) -> Option<[f64; N]> {
        let text = node.attribute(key)?;
        let found = finite(text).and_then(|n| <[f64; N]>::try_from(n).ok());
        if found.is_none() {
            let element = node.tag_name().name();
            self.error(node, format!("{key} of <{element}> must be {N} numbers, found '{text}'"));
        }
        found
    }
}

fn attributes<'i>(node: Node<'_, 'i>) -> impl Iterator<Item = (String, String)> {
    let all: Vec<_> = node.attributes().map(|a| (a.name().to_string(), a.value().to_string())).collect();
    all.into_iter()
}

fn elements<'d, 'i>(node: Node<'d, 'i>) -> impl Iterator<Item = Node<'d, 'i>> {
    node.children().filter(|n| n.is_element())
}

/// From where a joint is at its reference to where it is at zero.
fn back(kind: &str, axis: Vector3<f64>, reference: f64) -> Pose {
    let still = Pose::identity();
    match (kind, axis.try_normalize(1e-9)) {
        ("revolute", Some(axis)) => {
            Pose { rotation: Rotation3::new(-axis * reference).into_inner(), ..still }
        }
        ("prismatic", Some(axis)) => Pose { origin: -axis * reference, ..still },
        _ => still,
    }
}

fn massless(name: &str, line: u32) -> Link {
    let (name, origin) = (name.to_string(), Origin::default());
    Link { name, line, origin, mass: 0.0, inertia: [0.0; 6], is_named: false, sites: Vec::new(), note: None }
}

fn fixed(parent: &str, child: &str, at: &Pose, line: u32) -> Joint {
    Joint {
        name: format!("{child}, fixed"),
        line,
        kind: "fixed".to_string(),
        parent: parent.to_string(),
        child: child.to_string(),
        origin: origin(at),
        axis: [1.0, 0.0, 0.0],
        lower: 0.0,
        upper: 0.0,
        effort: 0.0,
        velocity: 0.0,
        mimic: None,
        motor: None,
        note: None,
    }
}

fn origin(pose: &Pose) -> Origin {
    Origin { xyz: pose.origin.into(), rpy: pose.rpy() }
}

/// A URDF's word for the kind of a joint; a model's own where there is none.
fn kind_of_joint<'a>(node: Node<'_, '_>, all: &'a BTreeMap<String, String>) -> &'a str {
    match all.get("type").map(String::as_str) {
        _ if node.has_tag_name("freejoint") => "floating",
        None | Some("hinge") => "revolute",
        Some("slide") => "prismatic",
        Some("free") => "floating",
        Some(other) => other,
    }
}
