//! From a URDF's tree of links to the chain of bodies between its root and a tip.

use super::Options;
use super::loops::{self, ChainBar, ChainLoop};
use super::pose::Pose;
use super::tree::Tree;
use super::urdf::{Joint, Link, Mimic, Motor, Origin, Robot};
use crate::arm::{JointKind, MAX_JOINTS};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Downwards in a URDF's root link, m/s².
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A serial arm at q = 0, everything in the root link's frame.
pub(crate) struct Chain {
    pub(crate) name: String,
    pub(crate) root: String,
    /// In the root link, m/s².
    pub(crate) gravity: Vector3<f64>,
    pub(crate) tip: String,
    /// The tip link's frame.
    pub(crate) tip_pose: Pose,
    pub(crate) joints: Vec<ChainJoint>,
    /// Parallelograms that close on it.
    pub(crate) loops: Vec<ChainLoop>,
    /// The robot's joints that it is read from, those that do not move too: from root to tip, then those on
    /// the way to what an equality connects.
    pub(crate) read: Vec<usize>,
    pub(crate) notes: Vec<String>,
}

impl Chain {
    /// The bars of its loops in the order of the arm's, each with its loop.
    pub(crate) fn bars(&self) -> impl Iterator<Item = (&ChainLoop, &ChainBar)> {
        self.loops.iter().flat_map(|closed| closed.bars.iter().map(move |bar| (closed, bar)))
    }
}

/// A joint that moves, with the body behind it.
pub(crate) struct ChainJoint {
    pub(crate) name: String,
    pub(crate) kind: JointKind,
    /// A point on the axis, m.
    pub(crate) point: Vector3<f64>,
    /// The direction of the axis, of length 1.
    pub(crate) direction: Vector3<f64>,
    pub(crate) position: Option<[f64; 2]>,
    pub(crate) velocity: Option<f64>,
    pub(crate) torque: Option<f64>,
    /// The joint of the chain that it follows, by its index there, with ratio and offset.
    pub(crate) follows: Option<(usize, Mimic)>,
    /// What the file states about its drive.
    pub(crate) motor: Option<Motor>,
    /// The links that move as one behind the joint.
    pub(crate) links: Vec<String>,
    /// The frame of each of them.
    pub(crate) poses: Vec<Pose>,
    /// Frames that have names of their own on the body: of links that are fixed to its first one, and sites.
    pub(crate) frames: Vec<(String, Pose)>,
    /// Links of the body that have mass.
    pub(crate) masses: Vec<Mass>,
}

/// The inertia of one link.
pub(crate) struct Mass {
    /// kg
    pub(crate) mass: f64,
    /// Centre of mass, m.
    pub(crate) centre: Vector3<f64>,
    /// Inertia tensor about the centre of mass, kg·m².
    pub(crate) inertia: Matrix3<f64>,
}

/// Reads the chain, or says every reason why there is none.
pub(crate) fn chain(robot: &Robot, options: &Options) -> Result<Chain, Vec<String>> {
    let tree = Tree::new(robot, options)?;
    let (tip, path) = tip_and_path(&tree, options).map_err(|reason| vec![reason])?;
    let mut walk = Walk {
        tree: &tree,
        options,
        path: &path,
        joints: Vec::new(),
        refused: Vec::new(),
        notes: Vec::new(),
    };
    let mut pose = Pose::identity();
    walk.body(tree.root, &pose);
    for (index, joint) in path.iter().map(|j| (*j, &robot.joints[*j])) {
        let (at, moves) = walk.joint(index, joint, &pose);
        pose = at;
        // What is fixed to a body was found with the body.
        if let (true, Some(child)) = (moves, tree.link(&joint.child)) {
            walk.body(child, &pose);
        }
    }
    let Walk { mut joints, mut refused, mut notes, .. } = walk;
    let (root, tip) = (robot.links[tree.root].name.clone(), robot.links[tip].name.clone());
    if refused.is_empty() || joints.len() > MAX_JOINTS {
        refused.extend(wrong_count(&joints, &root, &tip));
    }
    if !refused.is_empty() {
        return Err(refused);
    }
    find_leaders(&mut joints, robot);
    let loops = close_loops(&tree, options, &path, &mut joints, &mut notes);
    notes.extend(robot.notes.iter().cloned());
    notes.extend(without_mass(&joints));
    let gravity = robot.gravity.map_or(GRAVITY, Vector3::from);
    let read = with_ways_to_connects(&tree, path);
    Ok(Chain { name: robot.name.clone(), root, gravity, tip, tip_pose: pose, joints, loops, read, notes })
}

/// The joints of a path, then those on the way to what an equality connects.
fn with_ways_to_connects(tree: &Tree<'_>, mut path: Vec<usize>) -> Vec<usize> {
    let links = tree.robot.connects.iter().flat_map(|connect| &connect.links);
    for joint in links.filter_map(|name| tree.path(tree.link(name)?)).flatten() {
        if !path.contains(&joint) {
            path.push(joint);
        }
    }
    path
}

/// The link at the chain's end, and the joints from the root to it; why there is none.
fn tip_and_path(tree: &Tree<'_>, options: &Options) -> Result<(usize, Vec<usize>), String> {
    let tip = match &options.tip {
        Some(name) => tree.link(name).ok_or_else(|| format!("there is no link '{name}' to be the tip"))?,
        None => tree.only_tip()?,
    };
    let path = tree.path(tip).ok_or_else(|| {
        let (base, tip) = (&tree.robot.links[tree.root].name, &tree.robot.links[tip].name);
        format!("the tip '{tip}' is not behind the base '{base}': choose another base or tip")
    })?;
    Ok((tip, path))
}

/// Where an arm may not have as many joints: why.
fn wrong_count(joints: &[ChainJoint], root: &str, tip: &str) -> Option<String> {
    match joints {
        [] => Some(format!("no joint moves between the root link '{root}' and the tip '{tip}'")),
        [first, .., last] if joints.len() > MAX_JOINTS => Some(format!(
            "{} joints move, from '{}' to '{}': an arm may have 1 to {MAX_JOINTS}",
            joints.len(),
            first.name,
            last.name
        )),
        _ => None,
    }
}

/// Lets every joint that follows another one say which of the chain's.
fn find_leaders(joints: &mut [ChainJoint], robot: &Robot) {
    let names: Vec<String> = joints.iter().map(|joint| joint.name.clone()).collect();
    for joint in joints {
        let mimic = robot.joints.iter().find(|j| j.name == joint.name).and_then(|j| j.mimic.clone());
        joint.follows = mimic.and_then(|m| Some((names.iter().position(|n| *n == m.joint)?, m)));
    }
}

/// The loops that a file's equalities close on the chain, and notes about those that are none.
fn close_loops(
    tree: &Tree<'_>,
    options: &Options,
    path: &[usize],
    joints: &mut [ChainJoint],
    notes: &mut Vec<String>,
) -> Vec<ChainLoop> {
    let mut found: Vec<ChainLoop> = Vec::new();
    for connect in &tree.robot.connects {
        let single = |(closed, more): (ChainLoop, Vec<String>)| {
            let on_one = |other: &ChainLoop| other.first == closed.first && other.left.is_some();
            match closed.left.is_some() && found.iter().any(on_one) {
                true => Err("its joint has another loop that is no parallelogram".to_string()),
                false => Ok((closed, more)),
            }
        };
        match loops::close(tree, options.angle_tolerance, path, joints, connect).and_then(single) {
            Ok((closed, more)) => {
                // Its bars are bodies of the arm.
                let of_bar = |note: &String| {
                    let left = |pin: &String| note.starts_with(&format!("left out: joint '{pin}' on "));
                    closed.pins.iter().any(left)
                };
                notes.retain(|note| !of_bar(note));
                notes.extend(more);
                found.push(closed);
            }
            Err(why) => {
                notes.push(format!("line {}: the equality <connect> is left out: {why}", connect.line));
            }
        }
    }
    found
}

/// What to report about joints behind which no link has mass.
fn without_mass(joints: &[ChainJoint]) -> Option<String> {
    let massless = joints.iter().filter(|joint| joint.masses.is_empty());
    let massless: Vec<String> = massless.map(|joint| format!("'{}'", joint.name)).collect();
    if massless.len() == joints.len() {
        return Some("no link has an inertia: there are no parameter values".to_string());
    }
    (!massless.is_empty()).then(|| {
        format!(
            "behind {} no link has an inertia of its own: where nothing heavier follows, the mass matrix is \
             singular",
            massless.join(", ")
        )
    })
}

/// The way along the chain, with what it finds.
struct Walk<'r> {
    tree: &'r Tree<'r>,
    options: &'r Options,
    path: &'r [usize],
    joints: Vec<ChainJoint>,
    refused: Vec<String>,
    notes: Vec<String>,
}

impl Walk<'_> {
    /// Adds a joint of the chain and gives the pose behind it, and whether it moves.
    fn joint(&mut self, index: usize, joint: &Joint, parent: &Pose) -> (Pose, bool) {
        let name = joint.name.clone();
        if !self.tree.moves(index) {
            return (self.fixed(index, joint, parent), false);
        }
        let kind = match joint.kind.as_str() {
            "revolute" | "continuous" => Some(JointKind::Revolute),
            "prismatic" => Some(JointKind::Prismatic),
            other => {
                self.refused.push(format!(
                    "line {}: joint '{name}' is {other}: an arm file has revolute and prismatic joints only \
                     (with '{}' as the base the arm starts behind it)",
                    joint.line, joint.child
                ));
                None
            }
        };
        let pose = self.origin(&joint.origin, parent, &format!("joint '{name}'"));
        let Some(kind) = kind else { return (pose, false) };
        self.notes.extend(joint.note.clone());
        if let Some(mimic) = &joint.mimic {
            self.may_follow(joint, mimic);
        }
        let axis = Vector3::from(joint.axis);
        let length = axis.norm();
        if !length.is_finite() || length < 1e-9 {
            self.refused.push(format!("joint '{name}': its axis {:?} has no direction", joint.axis));
        }
        let Joint { lower, upper, velocity, effort, .. } = *joint;
        let bounded = joint.kind != "continuous" && usable(lower) && usable(upper);
        if lower.is_nan() || upper.is_nan() || bounded && lower > upper {
            self.notes.push(format!(
                "line {}: joint '{name}': its limits {lower} … {upper} are no range and are left out",
                joint.line
            ));
        }
        if joint.kind != "continuous" && lower == upper {
            self.notes.push(format!("joint '{name}' has no position limits"));
        }
        self.joints.push(ChainJoint {
            name,
            kind,
            point: pose.origin,
            direction: pose.rotation * (axis / length),
            position: (bounded && lower < upper).then_some([lower, upper]),
            velocity: (velocity > 0.0 && usable(velocity)).then_some(velocity),
            torque: (effort > 0.0 && usable(effort)).then_some(effort),
            follows: None,
            motor: joint.motor,
            links: Vec::new(),
            poses: Vec::new(),
            frames: Vec::new(),
            masses: Vec::new(),
        });
        (pose, true)
    }

    /// A joint that follows another one must follow one of the chain, by a ratio that moves it.
    fn may_follow(&mut self, joint: &Joint, Mimic { joint: leader, ratio, offset }: &Mimic) {
        let name = &joint.name;
        let leads = |j: &usize| self.tree.moves(*j) && self.tree.robot.joints[*j].name == *leader;
        if !usable(*ratio) || !usable(*offset) || *ratio == 0.0 {
            self.refused.push(format!(
                "line {}: joint '{name}' mimics joint '{leader}' with the multiplier {ratio} and the offset \
                 {offset}: --lock {name}=0 holds it",
                joint.line
            ));
        } else if *leader == *name {
            self.refused.push(format!("line {}: joint '{name}' mimics itself", joint.line));
        } else if self.path.iter().any(leads) {
            self.notes.push(format!(
                "joint '{name}' follows joint '{leader}': q({name}) = {ratio}·q({leader}) + {offset}. It is \
                 a link of the arm without a coordinate of its own"
            ));
        } else {
            self.refused.push(format!(
                "joint '{name}' mimics joint '{leader}', which is not on the chain: --lock {leader}=0 holds \
                both"
            ));
        }
    }

    /// The pose behind a joint that is fixed, or held at a position.
    fn fixed(&mut self, index: usize, joint: &Joint, parent: &Pose) -> Pose {
        let pose = self.origin(&joint.origin, parent, &format!("joint '{}'", joint.name));
        let Some(value) = self.tree.locked.get(&index) else { return pose };
        let axis = Vector3::from(joint.axis);
        if axis.norm().is_nan() || axis.norm() < 1e-9 {
            self.refused.push(format!("joint '{}': its axis {:?} has no direction", joint.name, joint.axis));
            return pose;
        }
        pose.then(&held(joint, *value))
    }

    /// Adds a link and all that is fixed to it to the body of the last joint.
    fn body(&mut self, link: usize, pose: &Pose) {
        let mut rigid = vec![(link, *pose)];
        let mut next = 0;
        while let Some((at, pose)) = rigid.get(next).copied() {
            let link = &self.tree.robot.links[at];
            self.link(link, &pose);
            self.frames(link, &pose, next > 0);
            for j in &self.tree.below[at] {
                let joint = &self.tree.robot.joints[*j];
                if !self.tree.moves(*j) {
                    let pose = self.fixed(*j, joint, &pose);
                    rigid.push((self.tree.child(*j), pose));
                } else if !self.path.contains(j) {
                    self.notes.push(format!(
                        "left out: joint '{}' on link '{}', with all that it carries: {} kg (--lock {}=0 \
                         keeps it at a position)",
                        joint.name,
                        self.tree.robot.links[at].name,
                        self.tree.mass_below(self.tree.child(*j)),
                        joint.name
                    ));
                }
            }
            next += 1;
        }
    }

    /// The frames of a link that have names of their own.
    fn frames(&mut self, link: &Link, pose: &Pose, is_fixed: bool) {
        let tolerance = self.options.angle_tolerance;
        let Some(joint) = self.joints.last_mut() else { return };
        if is_fixed && link.is_named {
            joint.frames.push((link.name.clone(), *pose));
        }
        let site = |(name, at): &(String, Origin)| (name.clone(), pose.then(&Pose::of(at, tolerance)));
        joint.frames.extend(link.sites.iter().map(site));
    }

    fn link(&mut self, link: &Link, pose: &Pose) {
        // What stands still has no part in the dynamics.
        if self.joints.is_empty() {
            return;
        }
        self.notes.extend(link.note.clone());
        let place = format!("line {}: link '{}'", link.line, link.name);
        let (mass, [xx, xy, xz, yy, yz, zz]) = (link.mass, link.inertia);
        let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        if !usable(mass) || !tensor.iter().all(|x| usable(*x)) {
            self.refused.push(format!("{place}: its inertia has a number that is not finite"));
        } else if mass < 0.0 {
            self.refused.push(format!("{place}: its mass {mass} kg is negative"));
        }
        self.origin(&link.origin, pose, &format!("{place}: inertial"));
        if let Some(joint) = self.joints.last_mut() {
            joint.links.push(link.name.clone());
            joint.poses.push(*pose);
            if let Some(reason) = impossible(mass, &tensor) {
                self.notes.push(format!("{place}: {reason}"));
            }
            joint.masses.extend(masses(link, pose, self.options.angle_tolerance));
        }
    }

    fn origin(&mut self, origin: &Origin, parent: &Pose, place: &str) -> Pose {
        if !origin.xyz.iter().chain(&origin.rpy).all(|x| usable(*x)) {
            self.refused.push(format!("{place}: its origin has a number that is not finite"));
        }
        parent.then(&Pose::of(origin, self.options.angle_tolerance))
    }
}

/// How a joint that is held at a position moves what is behind it.
pub(super) fn held(joint: &Joint, value: f64) -> Pose {
    let way = Vector3::from(joint.axis).normalize() * value;
    match joint.kind.as_str() {
        "prismatic" => Pose { rotation: Matrix3::identity(), origin: way },
        _ => Pose { rotation: Rotation3::new(way).into_inner(), origin: Vector3::zeros() },
    }
}

/// The inertia of a link in the frame in which its pose is given; none without mass.
pub(super) fn masses(link: &Link, pose: &Pose, tolerance: f64) -> Option<Mass> {
    let (mass, [xx, xy, xz, yy, yz, zz]) = (link.mass, link.inertia);
    let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let frame = pose.then(&Pose::of(&link.origin, tolerance));
    let inertia = frame.rotation * tensor * frame.rotation.transpose();
    let heavy = mass != 0.0 || tensor.iter().any(|x| *x != 0.0);
    heavy.then_some(Mass { mass, centre: frame.origin, inertia })
}

/// Finite, and not so large that it stands for infinity.
fn usable(value: f64) -> bool {
    value.abs() < 1e30
}

/// Why no body has this mass and inertia about its centre of mass.
fn impossible(mass: f64, tensor: &Matrix3<f64>) -> Option<String> {
    let mut moments: Vec<f64> = tensor.symmetric_eigenvalues().iter().copied().collect();
    moments.sort_by(f64::total_cmp);
    let [least, middle, most] = moments[..] else { return None };
    let rounding = 1e-6 * most.abs();
    if mass == 0.0 && most > 0.0 {
        return Some("it has moments of inertia but no mass".to_string());
    }
    if least < -rounding {
        return Some(format!("its inertia is that of no body: the principal moment {least:.3e} is negative"));
    }
    (most > least + middle + rounding).then(|| {
        format!(
            "its inertia is that of no body: the principal moment {most:.3e} exceeds the sum of the other \
             two, {:.3e}",
            least + middle
        )
    })
}
