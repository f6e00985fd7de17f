//! Loops that a MuJoCo model closes by `<connect>`: loops of four bars on one joint of the chain and
//! parallelograms on two become `[[loop]]`, with the bodies of their bars.

use super::chain::{ChainJoint, Mass, held, masses};
use super::pose::Pose;
use super::tree::Tree;
use super::urdf::{Connect, Mimic};
use crate::arm::{Bar, Linkage};
use crate::exact::rational;
use nalgebra::Vector3;

/// Points and directions nearer than this are the same, m or as a sine.
const SAME: f64 = 1e-6;
/// The joints of a loop.
const CORNERS: usize = 4;

/// A loop of four bars on the chain, at q = 0 in the root link's frame.
pub(crate) struct ChainLoop {
    /// The loop's first and last joint of the chain.
    pub(crate) first: usize,
    pub(crate) last: usize,
    /// The names of its other pins, from the link behind it on.
    pub(crate) pins: Vec<String>,
    /// From each joint to the next, m.
    pub(crate) lengths: [f64; CORNERS],
    /// From the last joint of the chain to the first pin, and from the first joint to the last pin.
    pub(crate) outer: Vector3<f64>,
    pub(crate) inner: Vector3<f64>,
    /// Of a loop that is no parallelogram, whether its middle pin is on the left of the way from the first to
    /// the last about the joint's axis.
    pub(crate) left: Option<bool>,
    /// The loop's bars that are no links of the chain, in the order of the pins between them.
    pub(crate) bars: Vec<ChainBar>,
}

/// A bar of a loop.
pub(crate) struct ChainBar {
    pub(crate) name: String,
    /// The pin at which its frame is, m.
    pub(crate) pin: Vector3<f64>,
    /// The links that move as one, with the frame of each of them.
    pub(crate) links: Vec<String>,
    pub(crate) poses: Vec<Pose>,
    /// Of a loop that is no parallelogram the bar's axes x and z: along it, and along the joint's axis.
    pub(crate) axes: Option<[Vector3<f64>; 2]>,
    pub(crate) masses: Vec<Mass>,
}

impl ChainBar {
    /// The frame of this bar in an arm, whose base and links have these frames at q = 0.
    pub(crate) fn frame(&self, in_arm: &Bar, base: &Pose, links: &[Pose]) -> Pose {
        let frame = |link: Option<usize>| link.map_or(base, |link| &links[link]);
        let pin = Vector3::from(in_arm.pin.each_ref().map(rational::to_f64));
        let origin = frame(in_arm.carrier).point(pin);
        match self.axes {
            None => Pose { rotation: frame(in_arm.parallel).rotation, origin },
            Some([x, z]) => Pose::from_axes(z, x, origin),
        }
    }
}

/// A loop's joint: what it joins, by the joints that move them, and where it is.
struct Pin {
    name: String,
    between: [Option<usize>; 2],
    point: Vector3<f64>,
    /// None for a `<connect>`, which holds in every direction.
    direction: Option<Vector3<f64>>,
}

/// The loop that an equality closes, or why it is none that an arm file has.
pub(super) fn close(
    tree: &Tree<'_>,
    tolerance: f64,
    path: &[usize],
    joints: &mut [ChainJoint],
    connect: &Connect,
) -> Result<(ChainLoop, Vec<String>), String> {
    let seen = Seen { tree, tolerance };
    let ends = connect.links.each_ref().map(|name| tree.link(name).and_then(|link| seen.moving(link)));
    let [Some(one), Some(other)] = &ends else {
        return Err("its bodies are not behind the base".to_string());
    };
    let common = one.iter().zip(other).take_while(|(a, b)| a == b).count();
    let tied: Vec<usize> = one[common..].iter().chain(&other[common..]).copied().collect();
    let (of_chain, of_bars): (Vec<usize>, Vec<usize>) = tied.iter().partition(|j| path.contains(j));
    let place = |joint: &usize| joints.iter().position(|j| j.name == tree.robot.joints[*joint].name);
    let mut places: Vec<usize> = of_chain.iter().filter_map(place).collect();
    places.sort_unstable();
    let (first, last) = match places[..] {
        [first] => (first, first),
        [first, last] if last == first + 1 => (first, last),
        _ => return Err("it closes no loop of one or two neighbouring joints of the chain".to_string()),
    };
    if tied.len() != CORNERS - 1 || tied.iter().any(|j| !seen.turns(*j)) {
        return Err("it closes no loop of four bars on hinges".to_string());
    }
    let at = |link: usize, point: [f64; 3]| {
        seen.pose(tree.link(&connect.links[link]).unwrap_or(tree.root)).point(point.into())
    };
    let anchor = at(0, connect.anchor);
    if let Some(apart) = connect.other.map(|other| (at(1, other) - anchor).norm()).filter(|x| *x > SAME) {
        return Err(format!(
            "its sites are {apart:.6} m apart where all joints are at 0: place them at one point, or write \
             body1, body2 and anchor"
        ));
    }
    let mut open: Vec<Pin> = of_bars.iter().map(|j| seen.pin(*j)).collect();
    open.push(Pin {
        name: format!("connect in line {}", connect.line),
        between: [one.last().copied(), other.last().copied()],
        point: anchor,
        direction: None,
    });
    let chain = |k: usize| path.iter().copied().filter(|j| tree.moves(*j)).nth(k);
    let (pins, bars) = in_order(open, chain(last), first.checked_sub(1).and_then(chain))
        .ok_or("its bars do not lead from the link behind the loop to the one before it")?;
    let (first_joint, last_joint) = (&joints[first], &joints[last]);
    let own = if first == last { vec![first_joint.point] } else { vec![first_joint.point, last_joint.point] };
    let corners: Vec<Vector3<f64>> = own.into_iter().chain(pins.iter().map(|pin| pin.point)).collect();
    let directions = pins.iter().filter_map(|pin| pin.direction).chain([last_joint.direction]);
    let sides = sides(&corners, first_joint.direction, directions)?;
    let left = match (sides[0] + sides[2]).norm() > SAME {
        false => None,
        true if first != last => {
            return Err(
                "with two joints of the chain only loops whose opposite bars are equal and parallel \
                        are supported"
                    .to_string(),
            );
        }
        true => Some(middle_pin(&sides, first_joint)?),
    };
    let bar = |(k, node): (usize, &Option<usize>)| {
        // To the middle pin, from either side.
        let axes = left.map(|_| [[sides[1], -sides[2]][k].normalize(), first_joint.direction]);
        // The first bar's frame is at the first pin, that of a second one at the last pin.
        seen.bar(*node, pins[[0, pins.len() - 1][k]].point, axes)
    };
    let mut notes = Vec::new();
    for joint in of_bars.iter().map(|j| &tree.robot.joints[*j]) {
        if joint.motor.is_some_and(|motor| motor.armature != 0.0) {
            notes.push(format!("joint '{}' moves a bar: its armature is left out", joint.name));
        }
    }
    let found = ChainLoop {
        first,
        last,
        lengths: std::array::from_fn(|k| sides[if left.is_some() { k } else { k % 2 }].norm()),
        left,
        outer: sides[last - first],
        inner: -sides[CORNERS - 1],
        bars: bars.iter().enumerate().map(bar).collect(),
        pins: pins.into_iter().map(|pin| pin.name).collect(),
    };
    if first != last {
        let ratio = if first_joint.direction.dot(&last_joint.direction) > 0.0 { -1.0 } else { 1.0 };
        let mimic = Mimic { joint: first_joint.name.clone(), ratio, offset: 0.0 };
        joints[last].follows.get_or_insert((first, mimic));
    }
    Ok((found, notes))
}

/// The pins of a loop from the link behind it to the one before it, and the bars between them; `None` where
/// they do not lead there.
fn in_order(
    mut open: Vec<Pin>,
    mut at: Option<usize>,
    inner: Option<usize>,
) -> Option<(Vec<Pin>, Vec<Option<usize>>)> {
    let (mut pins, mut bars) = (Vec::new(), Vec::new());
    while let Some(k) = open.iter().position(|pin| pin.between.contains(&at)) {
        let pin = open.swap_remove(k);
        at = if pin.between[0] == at { pin.between[1] } else { pin.between[0] };
        pins.push(pin);
        bars.push(at);
    }
    bars.pop();
    (open.is_empty() && at == inner).then_some((pins, bars))
}

/// The sides of a loop from corner to corner, in its plane, m; or why it has none.
fn sides(
    corners: &[Vector3<f64>],
    normal: Vector3<f64>,
    mut directions: impl Iterator<Item = Vector3<f64>>,
) -> Result<[Vector3<f64>; CORNERS], String> {
    if directions.any(|d| d.cross(&normal).norm() > SAME) {
        return Err("it is not planar: its hinges are not parallel".to_string());
    }
    let flat = |v: Vector3<f64>| v - normal * normal.dot(&v);
    let sides: [Vector3<f64>; CORNERS] =
        std::array::from_fn(|k| flat(corners[(k + 1) % CORNERS] - corners[k]));
    if sides.iter().any(|side| side.norm() < SAME) {
        return Err("two of its hinges are at one place".to_string());
    }
    Ok(sides)
}

/// Whether the middle pin of a loop that is no parallelogram is on the left, or why an arm file has no such
/// loop.
fn middle_pin(sides: &[Vector3<f64>; CORNERS], joint: &ChainJoint) -> Result<bool, String> {
    let [first, rod, rocker, last] = sides.each_ref().map(|side| side.norm());
    let same = |a: f64, b: f64| (a - b).abs() < SAME;
    if same(first, rocker) && same(rod, last) || same(first, rod) && same(rocker, last) {
        return Err("its bars are two pairs of equal ones, and it is no parallelogram".to_string());
    }
    let (x, y) = (sides[0] / first, joint.direction.cross(&sides[0]) / first);
    let exact = |v: f64| rational::from_f64(v).unwrap_or_default();
    let in_plane = |v: Vector3<f64>| [v.dot(&x), v.dot(&y)].map(exact);
    let across = (sides[1] + sides[2]).cross(&sides[1]).dot(&joint.direction);
    if across.abs() < SAME * rod * (rod + rocker) {
        return Err("at q = 0 it is at a dead point, where its middle pin may be on either side".to_string());
    }
    let left = across > 0.0;
    let linkage = Linkage {
        joint: 0,
        outer: in_plane(sides[0]),
        inner: in_plane(-sides[CORNERS - 1]),
        rod: exact(rod),
        rocker: exact(rocker),
        left,
    };
    match linkage.open_within(joint.position, 0.0) {
        None => Ok(left),
        Some(closes) => Err(format!(
            "it closes only where q of joint '{}' is {closes}: give it a range within, away from these dead \
             points",
            joint.name
        )),
    }
}

/// The tree at q = 0.
struct Seen<'t, 'r> {
    tree: &'t Tree<'r>,
    tolerance: f64,
}

impl Seen<'_, '_> {
    /// The joints from the root to a link that move.
    fn moving(&self, link: usize) -> Option<Vec<usize>> {
        Some(self.tree.path(link)?.into_iter().filter(|j| self.tree.moves(*j)).collect())
    }

    fn turns(&self, joint: usize) -> bool {
        matches!(self.tree.robot.joints[joint].kind.as_str(), "revolute" | "continuous")
    }

    /// The pose of a link.
    fn pose(&self, link: usize) -> Pose {
        let path = self.tree.path(link).unwrap_or_default();
        path.into_iter().fold(Pose::identity(), |pose, joint| {
            let of = &self.tree.robot.joints[joint];
            let pose = pose.then(&Pose::of(&of.origin, self.tolerance));
            self.tree.locked.get(&joint).map_or(pose, |value| pose.then(&held(of, *value)))
        })
    }

    /// A hinge.
    fn pin(&self, joint: usize) -> Pin {
        let of = &self.tree.robot.joints[joint];
        let parent = self.tree.link(&of.parent).and_then(|link| self.moving(link));
        let pose = self.pose(self.tree.child(joint));
        Pin {
            name: of.name.clone(),
            between: [parent.and_then(|moving| moving.last().copied()), Some(joint)],
            point: pose.origin,
            direction: Some(pose.rotation * Vector3::from(of.axis).normalize()),
        }
    }

    /// The links that move with a joint as one.
    fn rigid(&self, joint: Option<usize>) -> impl Iterator<Item = usize> {
        let moves =
            move |link: &usize| self.moving(*link).is_some_and(|moving| moving.last().copied() == joint);
        (0..self.tree.robot.links.len()).filter(moves)
    }

    /// A bar behind a joint, whose frame is at a pin.
    fn bar(&self, joint: Option<usize>, pin: Vector3<f64>, axes: Option<[Vector3<f64>; 2]>) -> ChainBar {
        let links: Vec<usize> = self.rigid(joint).collect();
        let masses = |link: &usize| masses(&self.tree.robot.links[*link], &self.pose(*link), self.tolerance);
        ChainBar {
            name: self.name(joint),
            pin,
            axes,
            links: links.iter().map(|link| self.tree.robot.links[*link].name.clone()).collect(),
            poses: links.iter().map(|link| self.pose(*link)).collect(),
            masses: links.iter().filter_map(masses).collect(),
        }
    }

    fn name(&self, joint: Option<usize>) -> String {
        let links = &self.tree.robot.links;
        let heavy = self.rigid(joint).find(|link| links[*link].mass != 0.0);
        heavy.or_else(|| self.rigid(joint).last()).map_or(String::new(), |link| links[link].name.clone())
    }
}
