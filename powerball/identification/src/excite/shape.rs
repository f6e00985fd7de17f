//! The arm as capsules along its Denavit–Hartenberg geometry, and how near they come to each other and to the
//! floor.
//!
//! The origins of the frames, and the corners between the parts of length d and a of each row, are a polyline
//! from the base to the last frame (and the tool). Every part of it that has a length is a capsule. An arm
//! file has no more of a shape: the radius and the clearance account for thick joints and cables.
//!
//! The bars of a parallelogram on one joint are capsules between their pins, in the plane of that joint's
//! frame. How far along the joint's axis they are is not in the file: so they are compared with the floor
//! alone.

use super::constraints::{JointLimits, Segment};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::arm::{Bar, Convention, Joint, JointKind};
use dyngen::exact::rational::to_f64;
use nalgebra::{Rotation3, Vector3};
use powerball_logs::chain::Chain;
use rand::{RngExt, SeedableRng};
use std::fmt;

/// Two parts count as joined within this many radii of the joints between them: their capsules overlap there
/// whatever the arm does.
const JOINED: f64 = 6.0;
/// Number of poses that show which links always touch and which never move.
const POSES: usize = 256;

/// The nearest pair in a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// Two links, from 1; 0 is the base.
    Links(usize, usize),
    /// A link and the floor.
    Floor(usize),
    /// A bar of a closed loop, from 1 in the order of the arm, and the floor.
    BarFloor(usize),
}

impl fmt::Display for Contact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |link: &usize| if *link == 0 { "the base".to_string() } else { format!("link {link}") };
        match self {
            Contact::Links(a, b) => write!(f, "{} and {}", name(a), name(b)),
            Contact::Floor(link) => write!(f, "{} and the floor", name(link)),
            Contact::BarFloor(bar) => write!(f, "bar {bar} of the closed loops and the floor"),
        }
    }
}

/// How near an arm comes to something: the surfaces' distance, m, below zero inside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearness {
    /// m
    pub distance: f64,
    /// The nearest pair.
    pub contact: Contact,
}

/// A part of the polyline.
#[derive(Clone, Copy, Debug)]
struct Part {
    /// The vertex that it begins at; it ends at the next one.
    vertex: usize,
    link: usize,
}

/// The rod and the crank of a parallelogram on one joint.
#[derive(Clone, Debug)]
struct Rods {
    /// The rod's number among the bars, from 1; the crank's is the next.
    number: usize,
    /// The vertex at the joint.
    joint: usize,
    /// The pins on the link behind the joint and on the one before it: the link, from 0, or the base, and the
    /// pin in its frame, m.
    pins: [(Option<usize>, Vector3<f64>); 2],
}

/// The capsules of an arm.
#[derive(Clone, Debug)]
pub struct Shape {
    chain: Chain,
    modified: bool,
    across: Vec<Vector3<f64>>,
    tool: Option<Vector3<f64>>,
    radius: f64,
    parts: Vec<Part>,
    rods: Vec<Rods>,
    /// What may touch the floor with an end at a vertex.
    ends: Vec<(Contact, usize)>,
    pairs: Vec<(usize, usize)>,
    always: Vec<(usize, usize)>,
}

/// A floor: what is below this height above the base frame's origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Upwards in the base frame.
    pub up: Vector3<f64>,
    /// m
    pub height: f64,
    /// The vertices that move up or down; what stands still is where it was built.
    moving: Vec<bool>,
}

/// The part of a joint's row across its axes, a and b, m.
fn normal(joint: &Joint) -> Vector3<f64> {
    Vector3::new(to_f64(&joint.a), to_f64(&joint.b), 0.0)
}

impl Shape {
    /// The capsules of an arm, of one radius (m). Parts that touch in every pose within the limits are not
    /// checked again: see [`Shape::always_touching`].
    #[must_use]
    pub fn new(arm: &Arm, limits: &[JointLimits], radius: f64) -> Shape {
        let modified = arm.convention == Convention::Modified;
        let mut parts = Vec::new();
        for (i, joint) in arm.joints.iter().enumerate() {
            let (along_a, along_d) = (normal(joint).norm() != 0.0, to_f64(&joint.d) != 0.0);
            let along_d = along_d || joint.kind == JointKind::Prismatic;
            // Modified rows go along a first, and that part is rigid with the link before.
            let (first, second) = if modified { (along_a, along_d) } else { (along_d, along_a) };
            if first {
                parts.push(Part { vertex: 2 * i, link: if modified { i } else { i + 1 } });
            }
            if second {
                parts.push(Part { vertex: 2 * i + 1, link: i + 1 });
            }
        }
        let tool = arm.tool.as_ref().map(|tool| Vector3::from(tool.xyz.each_ref().map(to_f64)));
        if tool.is_some_and(|tool| tool.norm() > 0.0) {
            parts.push(Part { vertex: 2 * arm.dof(), link: arm.dof() });
        }
        // x of frame i is that after Rx(alpha) too (standard), x of frame i − 1 that before it (modified).
        let across = |joint: &Joint| match modified {
            true => normal(joint),
            false => Rotation3::from_axis_angle(&Vector3::x_axis(), -joint.alpha.radians()) * normal(joint),
        };
        let across = arm.joints.iter().map(across).collect();
        let rods = rods(arm, modified);
        let ends = parts.iter().flat_map(|part| [0, 1].map(|k| (Contact::Floor(part.link), part.vertex + k)));
        let mut ends: Vec<(Contact, usize)> = ends.collect();
        // Their three pins come after the chain and the tool.
        let first = 2 * arm.dof() + 1 + usize::from(tool.is_some());
        for (k, rods) in rods.iter().enumerate() {
            let end = |bar: usize, pin: usize| (Contact::BarFloor(rods.number + bar), first + 3 * k + pin);
            ends.extend([end(0, 0), end(0, 1), end(1, 1), end(1, 2)]);
        }
        let all = (0..parts.len()).flat_map(|k| (k + 1..parts.len()).map(move |l| (k, l))).collect();
        let mut shape = Shape {
            chain: Chain::new(arm),
            modified,
            across,
            tool,
            radius,
            parts,
            rods,
            ends,
            pairs: all,
            always: Vec::new(),
        };
        let mut touching = vec![true; shape.pairs.len()];
        for q in poses(limits) {
            let vertices = shape.vertices(&q);
            for (pair, touching) in shape.pairs.iter().zip(&mut touching) {
                *touching &= shape.between(*pair, &vertices).is_some_and(|distance| distance <= 0.0);
            }
        }
        let (always, pairs) =
            shape.pairs.iter().zip(touching).partition::<Vec<_>, _>(|(_, touching)| *touching);
        let links = |(k, l): (usize, usize)| (shape.parts[k].link, shape.parts[l].link);
        shape.always = always.into_iter().map(|(pair, _)| links(*pair)).collect();
        shape.pairs = pairs.into_iter().map(|(pair, _)| *pair).collect();
        shape
    }

    /// Links that touch in every pose, from 1: their capsules are thicker than the arm, and nothing is
    /// reported about them.
    #[must_use]
    pub fn always_touching(&self) -> &[(usize, usize)] {
        &self.always
    }

    /// The bars of closed loops, from 0, that are compared with the floor.
    pub fn bars(&self) -> impl Iterator<Item = usize> + '_ {
        self.rods.iter().flat_map(|rods| [rods.number - 1, rods.number])
    }

    /// A floor at a height (m) along `up` from the base frame's origin.
    #[must_use]
    pub fn floor(&self, up: Vector3<f64>, height: f64, limits: &[JointLimits]) -> Floor {
        let mut range: Vec<[f64; 2]> = Vec::new();
        for q in poses(limits) {
            let heights: Vec<f64> = self.vertices(&q).iter().map(|v| v.dot(&up)).collect();
            range.resize(heights.len(), [f64::INFINITY, f64::NEG_INFINITY]);
            for ([low, high], h) in range.iter_mut().zip(heights) {
                (*low, *high) = (low.min(h), high.max(h));
            }
        }
        Floor { up, height, moving: range.iter().map(|[low, high]| high - low > 1e-6).collect() }
    }

    /// Share of the poses within the limits in which the floor is nearer than the clearance (m), and nearer
    /// than anything else.
    #[must_use]
    pub fn blocked(&self, floor: &Floor, clearance: f64, limits: &[JointLimits]) -> f64 {
        let at_floor = |q: &Vec<f64>| {
            self.nearest(q, Some(floor))
                .is_some_and(|near| near.distance < clearance && !matches!(near.contact, Contact::Links(..)))
        };
        poses(limits).filter(at_floor).count() as f64 / POSES as f64
    }

    /// The polyline in a pose: base origin, then for each joint its corner and its frame's origin, and the
    /// tool; then of each parallelogram on one joint the three other pins. In m.
    #[must_use]
    pub fn vertices(&self, q: &[f64]) -> Vec<Vector3<f64>> {
        let poses = self.chain.poses(q);
        let mut vertices = Vec::with_capacity(2 * poses.len() + 2);
        vertices.push(Vector3::zeros());
        let mut before = (nalgebra::Matrix3::identity(), Vector3::zeros());
        for ((rotation, origin), across) in poses.iter().zip(&self.across) {
            vertices.push(match self.modified {
                true => before.1 + before.0 * across,
                false => origin - rotation * across,
            });
            vertices.push(*origin);
            before = (*rotation, *origin);
        }
        vertices.extend(self.tool.map(|tool| before.1 + before.0 * tool));
        for Rods { joint, pins, .. } in &self.rods {
            let [outer, inner] = pins.map(|(link, pin)| match link {
                Some(link) => poses[link].1 + poses[link].0 * pin,
                None => pin,
            });
            vertices.extend([outer, outer - vertices[*joint] + inner, inner]);
        }
        vertices
    }

    /// The capsules' axes in a pose with their links, from 1; 0 is the base.
    pub fn segments(&self, q: &[f64]) -> impl Iterator<Item = (usize, Segment)> + '_ {
        let vertices = self.vertices(q);
        self.parts.iter().map(move |part| (part.link, segment(part, &vertices)))
    }

    /// The capsules' radius, m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The nearest pair in a pose; `None` if nothing can touch.
    #[must_use]
    pub fn nearest(&self, q: &[f64], floor: Option<&Floor>) -> Option<Nearness> {
        let vertices = self.vertices(q);
        let links = self.pairs.iter().filter_map(|pair| {
            let contact = Contact::Links(self.parts[pair.0].link, self.parts[pair.1].link);
            self.between(*pair, &vertices).map(|distance| Nearness { distance, contact })
        });
        let floor = floor.into_iter().flat_map(|floor| {
            self.ends.iter().filter_map(|(contact, vertex)| {
                let distance = vertices[*vertex].dot(&floor.up) - floor.height - self.radius;
                floor.moving[*vertex].then_some(Nearness { distance, contact: *contact })
            })
        });
        links.chain(floor).min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// Distance of two parts' surfaces but for what is joined; `None` where nothing else is left of one.
    fn between(&self, (k, l): (usize, usize), vertices: &[Vector3<f64>]) -> Option<f64> {
        let [first, second] = [k, l].map(|part| segment(&self.parts[part], vertices));
        let gap: f64 = self.parts[k + 1..l].iter().map(|part| segment(part, vertices).length()).sum();
        let cut = 0.5 * (JOINED * self.radius - gap).max(0.0);
        Some(first.cut(0.0, cut)?.distance(&second.cut(cut, 0.0)?) - 2.0 * self.radius)
    }
}

/// The parallelograms of an arm that are on one joint.
fn rods(arm: &Arm, modified: bool) -> Vec<Rods> {
    let pin = |bar: &Bar| (bar.carrier, Vector3::from(bar.pin.each_ref().map(to_f64)));
    let pair = |(k, pair): (usize, &[Bar])| match pair {
        // Each turns with the link that carries the other's pin, the rod's behind the joint.
        [rod, crank]
            if rod.carrier == crank.parallel
                && crank.carrier == rod.parallel
                && rod.parallel < rod.carrier =>
        {
            let joint = 2 * rod.carrier? + 1 + usize::from(modified);
            Some(Rods { number: k + 1, joint, pins: [pin(rod), pin(crank)] })
        }
        _ => None,
    };
    arm.bars.windows(2).enumerate().filter_map(pair).collect()
}

fn segment(part: &Part, vertices: &[Vector3<f64>]) -> Segment {
    Segment { from: vertices[part.vertex], to: vertices[part.vertex + 1] }
}

/// Random poses within the limits, the same ones every time.
pub(super) fn poses(limits: &[JointLimits]) -> impl Iterator<Item = Vec<f64>> + '_ {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    (0..POSES).map(move |_| {
        limits
            .iter()
            .map(|l| l.position[0] + rng.random_range(0.0..=1.0) * (l.position[1] - l.position[0]))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::super::constraints::Limits;
    use super::*;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};

    /// Points along the arm every few millimetres, with the place of each along the chain, by transforms of
    /// its own.
    fn points(arm: &Arm, q: &[f64]) -> Vec<(f64, Vector3<f64>)> {
        let turn = |axis, angle| {
            Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&axis, angle))
        };
        let (x, z) = (Vector3::x_axis(), Vector3::z_axis());
        let (mut frame, mut place, mut out) = (Isometry3::identity(), 0.0, Vec::new());
        let mut slide = |frame: &mut Isometry3<f64>, by: Vector3<f64>| {
            let steps = (by.norm() / 0.004).ceil() as usize;
            for k in 0..=steps.max(1) {
                let share = k as f64 / steps.max(1) as f64;
                if by.norm() > 0.0 {
                    out.push((
                        place + share * by.norm(),
                        (*frame * Translation3::from(by * share)).translation.vector,
                    ));
                }
            }
            place += by.norm();
            *frame *= Translation3::from(by);
        };
        for (joint, q) in arm.joints.iter().zip(q) {
            let (mut theta, mut d) = (joint.theta.radians(), to_f64(&joint.d));
            *(if joint.kind == JointKind::Prismatic { &mut d } else { &mut theta }) += q;
            let (along_a, along_d) = (Vector3::x() * to_f64(&joint.a), Vector3::z() * d);
            if arm.convention == Convention::Modified {
                frame *= turn(x, joint.alpha.radians());
                slide(&mut frame, along_a);
                frame *= turn(z, theta);
                slide(&mut frame, along_d);
            } else {
                frame *= turn(z, theta);
                slide(&mut frame, along_d);
                slide(&mut frame, along_a);
                frame *= turn(x, joint.alpha.radians());
            }
        }
        out
    }

    const SCARA: &str = r#"
name = "scara"
convention = "standard"
gravity = [0, 0, -9.81]
[[joint]]
kind = "revolute"
a = 0.4
alpha = 0
d = 0.5
theta = 0
position = [-2.5, 2.5]
velocity = 2
acceleration = 5
[[joint]]
kind = "revolute"
a = 0.3
alpha = "pi"
d = 0
theta = 0
position = [-2.8, 2.8]
velocity = 2
acceleration = 5
[[joint]]
kind = "prismatic"
a = 0
alpha = 0
d = 0.1
theta = 0
position = [0, 0.35]
velocity = 0.5
acceleration = 3
"#;

    /// Against points in their thousands: the floor, and links away from the joints between them, in both
    /// conventions and with a joint that slides.
    #[test]
    fn the_nearest_is_that_of_many_points() {
        let file = |text: &str| Arm::parse(text, "arm.toml").unwrap();
        let lwa4p = include_str!("../../../lwa4p.toml");
        let modified = lwa4p.replace("\"standard\"", "\"modified\"").replace("d = 0.0\n", "d = 0.11\n");
        let radius = 0.03;
        for arm in [file(lwa4p), file(&modified), file(SCARA)] {
            let limits = Limits::of(&arm, 0.0).unwrap().0;
            let shape = Shape::new(&arm, &limits, radius);
            assert!(shape.always_touching().is_empty());
            let up = Vector3::new(0.1, -0.2, 1.0).normalize();
            let floor = shape.floor(up, -0.3, &limits);
            for q in poses(&limits).take(60) {
                let all = points(&arm, &q);
                let lowest = all.iter().map(|(_, p)| p.dot(&up)).fold(f64::INFINITY, f64::min);
                // Further apart along the arm than what counts as joined; cut evenly from both.
                let links = shape.nearest(&q, None).map_or(f64::INFINITY, |near| near.distance);
                for (k, (s, a)) in all.iter().enumerate() {
                    for (t, b) in &all[k..] {
                        let joint_between = (t - s) > JOINED * radius + 0.6;
                        if joint_between {
                            assert!((a - b).norm() - 2.0 * radius >= links - 1e-9, "{q:?}");
                        }
                    }
                }
                let with_floor = shape.nearest(&q, Some(&floor)).map_or(f64::INFINITY, |near| near.distance);
                let to_floor = lowest + 0.3 - radius;
                // Links that stand still are not checked.
                assert!(with_floor <= links + 1e-12);
                if floor.moving.iter().skip(1).all(|m| *m) && lowest < 0.0 {
                    approx::assert_abs_diff_eq!(with_floor, links.min(to_floor), epsilon = 1e-9);
                }
            }
        }
    }

    /// The forearm of an elbow arm against its upper arm: free when stretched, touching when folded, by the
    /// triangle's own formula.
    #[test]
    fn an_elbow_folds_as_far_as_its_triangle_says() {
        let arm = Arm::parse(include_str!("../../../lwa4p.toml"), "lwa4p.toml").unwrap();
        let limits = Limits::of(&arm, 0.0).unwrap().0;
        let shape = Shape::new(&arm, &limits, 0.05);
        for fold in [-2.6, -1.9, -1.0, 1.0, 2.0, 2.6] {
            let near = shape.nearest(&[0.3, 0.1, fold, 0.0, 0.0, 0.0], None).unwrap();
            // Both are cut three radii from the elbow; the shorter one ends 0.305 m from it.
            let ends = 2.0 * 0.15 * (0.5 * (std::f64::consts::PI - f64::abs(fold))).sin();
            approx::assert_abs_diff_eq!(near.distance, ends - 0.1, epsilon = 1e-9);
        }
    }

    /// The pins of a loop are as far apart as its file says, in the plane of its joint, and the lowest point
    /// is what is nearest to a floor.
    #[test]
    fn bars_are_above_the_floor() {
        for (convention, rows) in [
            (
                "modified",
                ["a = 0\nalpha = 0.4\nd = 0.5\ntheta = 0", "a = 0.5\nalpha = 0\nd = 0.1\ntheta = 0.3"],
            ),
            (
                "standard",
                ["a = 0.5\nalpha = 0\nd = 0.5\ntheta = 0", "a = 0.4\nalpha = 0.7\nd = 0.1\ntheta = 0.3"],
            ),
        ] {
            let joint = |row: &str| {
                format!(
                    "[[joint]]\nkind = \"revolute\"\n{row}\nposition = [-1, 1]\nvelocity = 1\n\
                     acceleration = 3\n"
                )
            };
            let text = format!(
                "name = \"bars\"\nconvention = \"{convention}\"\ngravity = [0, 0, -9.81]\n{}{}\
                 [[loop]]\njoints = [2, \"a\", \"b\", \"c\"]\nlengths = [0.2, 0.5, 0.2, 0.5]\ninner = \"pi\"\n\
                 outer = 2.5\n[tool]\nxyz = [0.1, 0, 0]\nrpy = [0, 0, 0]\n",
                joint(rows[0]),
                joint(rows[1])
            );
            let arm = Arm::parse(&text, "bars.toml").unwrap();
            let limits = Limits::of(&arm, 0.0).unwrap().0;
            let shape = Shape::new(&arm, &limits, 0.03);
            assert_eq!(shape.bars().collect::<Vec<_>>(), [0, 1]);
            for q in poses(&limits).take(20) {
                let vertices = shape.vertices(&q);
                let (joint, pins) = (shape.rods[0].joint, &vertices[6..]);
                let ([outer, middle, inner], joint) = ([pins[0], pins[1], pins[2]], vertices[joint]);
                for (a, b, length) in
                    [(joint, outer, 0.2), (outer, middle, 0.5), (middle, inner, 0.2), (inner, joint, 0.5)]
                {
                    approx::assert_abs_diff_eq!((a - b).norm(), length, epsilon = 1e-12);
                }
                // All four are in one plane, at right angles to the joint's axis.
                let turned = shape.vertices(&[q[0], q[1] + 0.3]);
                let axis = (turned[6] - joint).cross(&(outer - joint)).normalize();
                for pin in pins {
                    approx::assert_abs_diff_eq!((pin - joint).dot(&axis), 0.0, epsilon = 1e-12);
                }
                // The inner pin does not turn with the joint.
                approx::assert_abs_diff_eq!(turned[8], inner, epsilon = 1e-12);
                let up = (joint - middle).normalize();
                let floor = Floor { up, height: middle.dot(&up) + 1.0, moving: vec![true; vertices.len()] };
                let low = vertices.iter().map(|v| v.dot(&up)).fold(f64::INFINITY, f64::min);
                let near = shape.nearest(&q, Some(&floor)).unwrap();
                approx::assert_abs_diff_eq!(near.distance, low - floor.height - 0.03, epsilon = 1e-12);
                if low == middle.dot(&up) {
                    assert!(matches!(near.contact, Contact::BarFloor(1 | 2)), "{near:?}");
                }
            }
        }
    }
}
