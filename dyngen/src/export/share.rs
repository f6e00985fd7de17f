//! The body of each link of a robot description: links that move together are one link of the arm.

use super::body::{Body, apart, frames, placed};
use super::known::Known;
use crate::arm::{Arm, Hinge, Joint};
use crate::exact::rational::{Rational, to_f64};
use crate::import::Options;
use crate::import::chain::{self, Chain};
use crate::import::pose::Pose;
use crate::import::rounding;
use crate::import::text::plain;
use crate::import::urdf::Robot;
use nalgebra::Matrix3;

/// Largest distance of the arm's axes from the file's, m and rad: exact numbers in place of rounded ones
/// cause it.
const APART: f64 = 5e-3;

/// The share of one link of the description.
pub(super) struct Share {
    pub(super) link: String,
    /// In the link's frame.
    pub(super) body: Body,
    /// Links that are fixed to it whose inertia is in it.
    pub(super) emptied: Vec<String>,
    pub(super) note: Option<String>,
}

/// The chain of the original, by the letter.
pub(super) fn chain(robot: &Robot, arm: &Arm, options: &Options) -> Result<Chain, Vec<String>> {
    let options = by_the_letter(robot, arm, options);
    let mut chain = chain::chain(robot, &options)?;
    if arm.bars.is_empty() {
        chain.loops.clear();
    }
    // With numbers that are rounded a loop may not close.
    if chain.bars().count() < arm.bars.len() {
        chain.loops = chain::chain(&rounding::nearest(robot, &chain.read).0, &options)?.loops;
    }
    Ok(chain)
}

/// How the original is read: by the letter, and to the arm's last joint where no tip is given.
fn by_the_letter(robot: &Robot, arm: &Arm, options: &Options) -> Options {
    let mut options = Options { exact: true, ..options.clone() };
    if options.tip.is_none() {
        let last = arm.joints.last().and_then(|joint| joint.name.as_ref());
        options.tip = robot
            .joints
            .iter()
            .find(|j| Some(plain(&j.name)) == last.cloned())
            .map(|joint| joint.child.clone());
    }
    options
}

/// The share of a link behind each joint, then of one of each bar; `holds` says whether a link of the
/// description can hold an inertia.
pub(super) fn shares(
    arm: &Arm,
    chain: &Chain,
    robot: &Robot,
    known: &Known,
    holds: &dyn Fn(&str) -> bool,
) -> Result<Vec<Share>, String> {
    same_arm(arm, chain)?;
    let (mut frames, _) = frames(arm);
    let base = placed(&arm.base);
    let bars = chain.bars().zip(&arm.bars);
    let of_bars: Vec<Pose> = bars.map(|((_, bar), own)| bar.frame(own, &base, &frames)).collect();
    same_bars(arm, chain, &of_bars)?;
    frames.extend(of_bars);
    let links = chain.joints.iter().map(|joint| Rigid {
        what: format!("the link behind joint '{}'", joint.name),
        links: &joint.links,
        poses: &joint.poses,
    });
    let bars = chain.bars().map(|(_, bar)| Rigid {
        what: format!("bar '{}'", bar.name),
        links: &bar.links,
        poses: &bar.poses,
    });
    let each = links.chain(bars).zip(&frames).enumerate();
    each.map(|(i, (rigid, frame))| {
        // From the arm's frame to the root link's.
        let back = frame.rotation.transpose();
        let back = Pose { rotation: back, origin: -(back * frame.origin) };
        let body = Body::of_parameters(&known.values[11 * i..][..10]).seen_from(&back);
        share(&rigid, &body, robot, holds)
    })
    .collect()
}

/// Links of the description that are one body of the arm.
struct Rigid<'c> {
    /// The body in words.
    what: String,
    links: &'c [String],
    /// The frame of each of them.
    poses: &'c [Pose],
}

/// A link that is fixed to the first one keeps its own inertia, if the rest is possible for the first one.
fn share(
    Rigid { what, links, poses }: &Rigid<'_>,
    body: &Body,
    robot: &Robot,
    holds: &dyn Fn(&str) -> bool,
) -> Result<Share, String> {
    let all = || links.iter().zip(*poses).filter(|(name, _)| holds(name));
    let Some((name, pose)) = all().next() else {
        if body.mass == 0.0 && body.tensor.iter().all(|x| *x == 0.0) {
            let link = links.first().cloned().unwrap_or_default();
            return Ok(Share { link, body: *body, emptied: Vec::new(), note: None });
        }
        return Err(format!("{what} has no body of its own: there is no place for its {} kg", body.mass));
    };
    let others: Vec<&String> = all().skip(1).map(|(name, _)| name).collect();
    let rest = all().skip(1).fold(*body, |rest, (name, pose)| rest.less(&own(robot, name, pose)));
    let link = name.clone();
    if others.is_empty() || rest.is_possible() {
        return Ok(Share { link, body: rest.seen_from(pose), emptied: Vec::new(), note: None });
    }
    let note = format!(
        "link '{name}' has the whole inertia of {}: if the others kept theirs, no body could have the rest",
        links.join(", ")
    );
    let emptied = others.into_iter().cloned().collect();
    Ok(Share { link, body: body.seen_from(pose), emptied, note: Some(note) })
}

/// The inertia that the description gives a link, in the root link's frame.
fn own(robot: &Robot, name: &str, pose: &Pose) -> Body {
    let link = robot.links.iter().find(|link| link.name == *name);
    link.map_or(Body::of_parameters(&[0.0; 10]), |link| {
        let [xx, xy, xz, yy, yz, zz] = link.inertia;
        let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let at = pose.then(&Pose::of(&link.origin, 1e-12));
        let inertia = at.rotation * tensor * at.rotation.transpose();
        Body::about_centre(link.mass, at.origin, &inertia)
    })
}

/// The names of all joints, including those that follow others.
fn all_names(arm: &Arm) -> Vec<String> {
    let name = |(i, joint): (usize, &Joint)| joint.name.clone().unwrap_or_else(|| (i + 1).to_string());
    arm.joints.iter().enumerate().map(name).collect()
}

/// The joints' names and axes must be the arm's.
fn same_arm(arm: &Arm, chain: &Chain) -> Result<(), String> {
    let names: Vec<&str> = chain.joints.iter().map(|joint| joint.name.as_str()).collect();
    let named = |i: usize| arm.joints[i].name.as_deref().is_none_or(|name| name == plain(names[i]));
    if names.len() != arm.links() || !(0..names.len()).all(named) {
        return Err(format!(
            "its joints are {}, those of the arm {}: give the same base, tip and lock as for the import",
            names.join(", "),
            all_names(arm).join(", ")
        ));
    }
    let (_, axes) = frames(arm);
    for (joint, axis) in chain.joints.iter().zip(&axes) {
        let (distance, angle) = apart(axis, joint.kind, &joint.point, &joint.direction);
        if distance > APART || angle > APART {
            return Err(format!(
                "joint '{}': its axis lies {:.3} mm and {:.3} mrad from that of the arm file: it is another \
                    arm, or it was imported with another base",
                joint.name,
                1e3 * distance,
                1e3 * angle
            ));
        }
    }
    Ok(())
}

/// The description's loops must have the arm's bars.
fn same_bars(arm: &Arm, chain: &Chain, frames: &[Pose]) -> Result<(), String> {
    let count = chain.bars().count();
    if count != arm.bars.len() {
        let found = if count == 0 { "none".to_string() } else { count.to_string() };
        return Err(format!(
            "of the bars of closed loops that the arm has ({}), {found} are here: only a MuJoCo model with \
             <connect> has them",
            arm.bar_names()
        ));
    }
    for (((closed, bar), frame), own) in chain.bars().zip(frames).zip(&arm.bars) {
        let near = |length: f64, of_arm: &Rational| (length - to_f64(of_arm)).abs() <= APART;
        let same = match &own.hinge {
            None => closed.left.is_none(),
            Some(Hinge { linkage, .. }) => {
                let [_, rod, rocker, _] = closed.lengths;
                closed.left.is_some() && near(rod, &linkage.rod) && near(rocker, &linkage.rocker)
            }
        };
        if !same {
            return Err(format!(
                "bar '{}': its loop has other lengths than that of bar '{}' of the arm file: it is another arm",
                bar.name, own.name
            ));
        }
        let (normal, way) = (chain.joints[closed.first].direction, bar.pin - frame.origin);
        let distance = (way - normal * normal.dot(&way)).norm();
        if distance > APART {
            return Err(format!(
                "bar '{}': its pin lies {:.3} mm from that of bar '{}' of the arm file: it is another arm",
                bar.name,
                1e3 * distance,
                own.name
            ));
        }
    }
    Ok(())
}
