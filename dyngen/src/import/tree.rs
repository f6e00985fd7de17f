//! The links of a robot as a tree: what hangs on what, which joints move, where the one chain ends.

use super::Options;
use super::urdf::{Joint, Robot};
use std::collections::BTreeMap;

/// The links of a URDF by their joints.
pub(super) struct Tree<'r> {
    pub(super) robot: &'r Robot,
    by_name: BTreeMap<&'r str, usize>,
    /// The joint above a link.
    above: Vec<Option<usize>>,
    /// The joints below a link.
    pub(super) below: Vec<Vec<usize>>,
    /// The link that stands still: the robot's root, or another one that was asked for.
    pub(super) root: usize,
    /// Joints that are held at a position, rad or m.
    pub(super) locked: BTreeMap<usize, f64>,
}

impl<'r> Tree<'r> {
    /// The tree as it is asked for, or every reason why it is none.
    pub(super) fn new(robot: &'r Robot, options: &Options) -> Result<Self, Vec<String>> {
        let mut tree = Tree::of_links(robot)?;
        tree.locked = locked(robot, options)?;
        if let Some(name) = &options.base {
            tree.root =
                tree.link(name).ok_or_else(|| vec![format!("there is no link '{name}' to be the base")])?;
        }
        Ok(tree)
    }

    fn of_links(robot: &'r Robot) -> Result<Self, Vec<String>> {
        let mut reasons = Vec::new();
        let mut by_name = BTreeMap::new();
        for (i, link) in robot.links.iter().enumerate() {
            if by_name.insert(link.name.as_str(), i).is_some() {
                reasons.push(format!("two links have the name '{}'", link.name));
            }
        }
        let mut above = vec![None; robot.links.len()];
        let mut below = vec![Vec::new(); robot.links.len()];
        for (j, joint) in robot.joints.iter().enumerate() {
            let ends = [&joint.parent, &joint.child].map(|name| by_name.get(name.as_str()).copied());
            let [Some(parent), Some(child)] = ends else {
                let missing = if ends[0].is_none() { &joint.parent } else { &joint.child };
                reasons
                    .push(format!("joint '{}' names the link '{missing}', which is not there", joint.name));
                continue;
            };
            if let Some(first) = above[child].replace(j) {
                let first: &Joint = &robot.joints[first];
                reasons.push(format!(
                    "link '{}' is the child of two joints, '{}' and '{}': a closed loop is no serial chain",
                    joint.child, first.name, joint.name
                ));
            }
            below[parent].push(j);
        }
        let roots: Vec<usize> = (0..robot.links.len()).filter(|i| above[*i].is_none()).collect();
        let names = |links: &[usize]| {
            links.iter().map(|i| format!("'{}'", robot.links[*i].name)).collect::<Vec<_>>().join(", ")
        };
        match roots[..] {
            [root] if reasons.is_empty() => {
                let tree = Tree { robot, by_name, above, below, root, locked: BTreeMap::new() };
                let reached = tree.all_below(root);
                let lost: Vec<usize> = (0..robot.links.len()).filter(|i| !reached.contains(i)).collect();
                if lost.is_empty() {
                    return Ok(tree);
                }
                reasons.push(format!("the links {} form a loop", names(&lost)));
            }
            [] if robot.links.is_empty() => reasons.push("the robot has no links".to_string()),
            [] => reasons
                .push("every link is the child of a joint: the links form a loop without a base".to_string()),
            [_] => {}
            _ => reasons.push(format!("the links {} hang on no joint: an arm has one base", names(&roots))),
        }
        Err(reasons)
    }

    pub(super) fn link(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    pub(super) fn child(&self, joint: usize) -> usize {
        self.link(&self.robot.joints[joint].child).unwrap_or(self.root)
    }

    pub(super) fn moves(&self, joint: usize) -> bool {
        self.robot.joints[joint].kind != "fixed" && !self.locked.contains_key(&joint)
    }

    /// A link and all links below it.
    fn all_below(&self, link: usize) -> Vec<usize> {
        let mut found = vec![link];
        let mut next = 0;
        while let Some(link) = found.get(next).copied() {
            found.extend(self.below[link].iter().map(|j| self.child(*j)));
            next += 1;
        }
        found
    }

    /// The mass of a link and all links below it, kg.
    pub(super) fn mass_below(&self, link: usize) -> f64 {
        self.all_below(link).into_iter().map(|l| self.robot.links[l].mass).sum()
    }

    /// The joints from the root to a link; none where it is not below the root.
    pub(super) fn path(&self, link: usize) -> Option<Vec<usize>> {
        let mut path = Vec::new();
        let mut at = link;
        while at != self.root {
            let joint = self.above[at]?;
            path.push(joint);
            at = self.link(&self.robot.joints[joint].parent).unwrap_or(self.root);
        }
        path.reverse();
        Some(path)
    }

    /// The end of the one chain that moves, or where it branches.
    pub(super) fn only_tip(&self) -> Result<usize, String> {
        let mut body = self.root;
        loop {
            let (mut rigid, mut moving) = (vec![body], Vec::new());
            let mut next = 0;
            while let Some(link) = rigid.get(next).copied() {
                for joint in &self.below[link] {
                    if self.moves(*joint) { moving.push(*joint) } else { rigid.push(self.child(*joint)) }
                }
                next += 1;
            }
            match moving[..] {
                [joint] => body = self.child(joint),
                // A tool that is fixed to the last body in one line is the tip, else the body is.
                [] if rigid.iter().all(|l| self.below[*l].len() <= 1) => return Ok(rigid[rigid.len() - 1]),
                [] => return Ok(body),
                _ => {
                    let joints: Vec<String> =
                        moving.iter().map(|j| format!("'{}'", self.robot.joints[*j].name)).collect();
                    // Where the branches hang first: there the arm ends more often than in a finger.
                    let forks = moving.iter().map(|j| self.robot.joints[*j].parent.as_str());
                    let leaves = self.all_below(body).into_iter().filter(|l| self.below[*l].is_empty());
                    let mut ends: Vec<&str> = forks.collect();
                    ends.extend(leaves.map(|l| self.robot.links[l].name.as_str()));
                    ends.dedup();
                    return Err(format!(
                        "the robot is a tree: the joints {} all move on link '{}'; choose the arm's \
                            tip, such as {}",
                        joints.join(", "),
                        self.robot.links[body].name,
                        ends.join(", ")
                    ));
                }
            }
        }
    }
}

/// The joints that are held at a position, by their index.
fn locked(robot: &Robot, options: &Options) -> Result<BTreeMap<usize, f64>, Vec<String>> {
    let mut locked = BTreeMap::new();
    let mut wrong = Vec::new();
    for (name, value) in &options.lock {
        let moving = |j: &Joint| matches!(j.kind.as_str(), "revolute" | "continuous" | "prismatic");
        match robot.joints.iter().position(|j| j.name == *name) {
            Some(index) if moving(&robot.joints[index]) && value.is_finite() => {
                locked.insert(index, *value);
            }
            Some(_) => wrong.push(format!("joint '{name}' cannot be held at {value}")),
            None => wrong.push(format!("there is no joint '{name}' to be held at {value}")),
        }
    }
    // What follows a joint that is held is held as well.
    for _ in &robot.joints {
        for (index, joint) in robot.joints.iter().enumerate().filter(|(_, joint)| joint.kind != "fixed") {
            let Some(mimic) = &joint.mimic else { continue };
            let leader = robot.joints.iter().position(|j| j.name == mimic.joint);
            if let Some(value) = leader.and_then(|leader| locked.get(&leader).copied()) {
                locked.entry(index).or_insert(mimic.ratio * value + mimic.offset);
            }
        }
    }
    if wrong.is_empty() { Ok(locked) } else { Err(wrong) }
}
