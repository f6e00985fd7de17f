//! An arm as robot descriptions have it that know no table of Denavit and Hartenberg: bodies on joints, each
//! body's frame on the axis of its joint, with z along the axis.

use super::body::{Body, frames, placed};
use super::known::{Friction, Known};
use crate::arm::{Arm, Joint, Placement};
use crate::exact::rational::to_f64;
use crate::import::pose::Pose;
use nalgebra::Vector3;

/// A link with the joint before it.
pub(super) struct Link<'a> {
    /// The joint of the arm file.
    pub(super) joint: &'a Joint,
    /// The joint's name.
    pub(super) name: String,
    /// The link's own name, which no joint has.
    pub(super) link: String,
    /// The link's frame in that of the link before it (the root link's for the first one) where q is zero.
    pub(super) pose: Pose,
    /// The link's frame in the root link's where q is zero.
    pub(super) at: Pose,
    /// In the link's frame.
    pub(super) body: Body,
    /// Of the joint; none where its motor turns with several joints.
    pub(super) friction: Option<Friction>,
    /// What the rotor adds to the inertia about the joint, kg·m² or kg.
    pub(super) armature: Option<f64>,
    /// What is known of its parameters, in words.
    pub(super) words: &'a [String],
}

/// A frame that is fixed on a link.
pub(super) struct Fixed {
    pub(super) name: String,
    /// From 0.
    pub(super) link: usize,
    /// In the link's frame.
    pub(super) pose: Pose,
}

/// An arm as bodies on joints.
pub(super) struct Tree<'a> {
    pub(super) root: String,
    pub(super) links: Vec<Link<'a>>,
    pub(super) fixed: Vec<Fixed>,
    /// In the root link's frame, m/s².
    pub(super) gravity: Vector3<f64>,
    /// What no description of this kind holds.
    pub(super) notes: Vec<String>,
}

impl<'a> Tree<'a> {
    /// The tree of an arm that has no bars of closed loops.
    pub(super) fn new(arm: &'a Arm, known: &'a Known) -> Result<Tree<'a>, String> {
        arm.without_bars("this format")
            .map_err(|e| format!("{e}; a MuJoCo model has their place (`dyngen export` --to mjcf)"))?;
        let (bodies, axes) = frames(arm);
        let names: Vec<String> = (0..arm.links()).map(|i| joint_name(arm, i)).collect();
        let links = (0..arm.links()).map(|i| {
            let joint = &arm.joints[i];
            let before = i.checked_sub(1).map_or_else(Pose::identity, |before| axes[before]);
            let rotor = known.values[11 * i + 10];
            Link {
                joint,
                name: names[i].clone(),
                link: free(format!("{}_link", names[i]), &names),
                pose: before.see(&axes[i]),
                at: axes[i],
                body: Body::of_parameters(&known.values[11 * i..][..10]).seen_from(&bodies[i].see(&axes[i])),
                friction: known
                    .friction
                    .as_ref()
                    .and_then(|f| f[i])
                    .filter(|_| arm.coupled_motor(i).is_none()),
                armature: joint.rotor_ratio.as_ref().map(|k| to_f64(k).powi(2) * rotor).filter(|x| *x != 0.0),
                words: &known.words[i],
            }
        });
        let links: Vec<Link<'_>> = links.collect();
        let base = placed(&arm.base);
        Ok(Tree {
            root: free("base".to_string(), &names),
            fixed: fixed(arm, &bodies, &axes),
            gravity: base.rotation * Vector3::from(arm.gravity.each_ref().map(to_f64)),
            notes: notes(arm, known, &links),
            links,
        })
    }
}

fn joint_name(arm: &Arm, i: usize) -> String {
    arm.joints[i].name.clone().unwrap_or_else(|| format!("joint{}", i + 1))
}

/// A name that none of `taken` is.
fn free(mut name: String, taken: &[String]) -> String {
    while taken.contains(&name) {
        name.push('_');
    }
    name
}

/// The frames of the arm file on its links: its own, and the tool's.
fn fixed(arm: &Arm, bodies: &[Pose], axes: &[Pose]) -> Vec<Fixed> {
    let on = |name: &str, link: usize, placement: &Option<Placement>| Fixed {
        name: name.to_string(),
        link,
        pose: axes[link].see(&bodies[link].then(&placed(placement))),
    };
    let own = arm.frames.iter().map(|f| on(&f.name, f.link, &Some(f.placement.clone())));
    own.chain([on("tool", arm.tool_carrier(), &arm.tool)]).collect()
}

/// What neither bodies nor two terms of friction can hold.
fn notes(arm: &Arm, known: &Known, links: &[Link<'_>]) -> Vec<String> {
    let mut notes = Vec::new();
    for link in links.iter().filter(|link| !link.body.is_possible()) {
        notes.push(format!(
            "link '{}': no body with mass has these values: a physics engine may refuse them (`dyngen check` \
             says why)",
            link.link
        ));
    }
    if links.iter().any(|link| link.friction.is_some_and(|f| f.coulomb != 0.0)) {
        notes.push(
            "friction: the steps of tanh are one step of Coulomb friction of their sum (γ1 + γ3): how it \
             rises near standstill is left out"
                .to_string(),
        );
    }
    for i in (0..arm.links()).filter(|i| arm.coupled_motor(*i).is_some()) {
        notes.push(format!(
            "joint '{}': its motor turns with several joints: the motor's friction is left out",
            links[i].name
        ));
    }
    for term in &known.terms {
        let (joint, effect) = (&links[term.link].name, &term.effect);
        notes.push(format!("left out: joint '{joint}': {effect} (coefficient {:.4e})", term.coefficient));
    }
    notes
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::arm::{Angle, JointKind};
    use crate::exact::rational::from_f64;
    use nalgebra::Matrix3;

    /// Two revolute joints and a prismatic one, in either convention, with frames, base and tool.
    pub(crate) fn arm(convention: &str) -> Arm {
        let text = format!(
            "name = \"three\"\nconvention = \"{convention}\"\ngravity = [0.0, 0.0, -9.81]\n[base]\n\
             xyz = [0.1, 0.2, 0.3]\nrpy = [\"pi/2\", 0, 0.3]\n[[joint]]\nkind = \"revolute\"\na = 0.3\n\
             alpha = \"pi/2\"\nd = 0.1\ntheta = 0.4\nname = \"shoulder\"\nrotor_ratio = 100\n\
             position = [-2.5, 2.0]\nvelocity = 3.0\ntorque = 50.0\n[[joint]]\nkind = \"prismatic\"\n\
             a = 0.05\nalpha = -0.7\nd = 0.2\ntheta = \"pi/3\"\nname = \"slide\"\nposition = [0.0, 0.4]\n\
             [[joint]]\nkind = \"revolute\"\na = 0.2\nalpha = 0.9\nd = -0.1\ntheta = 0\nname = \"wrist\"\n\
             [tool]\nxyz = [0, 0, 0.1]\nrpy = [0, 0, 0]\n"
        );
        Arm::parse(&text, "three.toml").unwrap()
    }

    /// Boxes off their frames' origins, and a rotor.
    pub(crate) fn known(arm: &Arm) -> Known {
        let of_link = |i: usize| {
            let (m, c) = (2.0 - 0.5 * i as f64, Vector3::new(0.1, -0.05 + 0.04 * i as f64, 0.03));
            let inertia = Matrix3::new(0.02, 0.001, -0.002, 0.001, 0.03, 0.003, -0.002, 0.003, 0.025);
            let body = Body::about_centre(m, c, &inertia);
            let (s, t) = (body.moment, body.tensor);
            let products = [-t[(0, 1)], -t[(0, 2)], t[(1, 1)], -t[(1, 2)], t[(2, 2)]];
            let rotor = if i == 0 { 3e-5 } else { 0.0 };
            [&[m, s.x, s.y, s.z, t[(0, 0)]][..], &products, &[rotor]].concat()
        };
        let friction = |i: usize| {
            let viscous = Some(0.5 + i as f64);
            Some(Friction { viscous, coulomb: 1.5 - 0.25 * i as f64, std: [Some(0.01), None] })
        };
        Known {
            values: (0..arm.links()).flat_map(of_link).collect(),
            words: vec![Vec::new(); arm.links()],
            friction: Some((0..arm.links()).map(friction).collect()),
            servos: None,
            terms: Vec::new(),
        }
    }

    fn along_z(kind: JointKind, q: f64) -> Pose {
        let (s, c) = q.sin_cos();
        match kind {
            JointKind::Revolute => Pose {
                rotation: Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0),
                origin: Vector3::zeros(),
            },
            JointKind::Prismatic => Pose { rotation: Matrix3::identity(), origin: Vector3::z() * q },
        }
    }

    /// A table with other constants says where the links are when the joints have moved.
    #[test]
    fn links_move_along_their_own_z_as_the_table_says() {
        for convention in ["standard", "modified"] {
            let (arm, known) = (arm(convention), known(&arm(convention)));
            let tree = Tree::new(&arm, &known).unwrap();
            let q = [0.7, 0.25, -1.3];
            let mut moved = arm.clone();
            for (joint, q) in moved.joints.iter_mut().zip(q) {
                let number = |x: f64| from_f64(x).unwrap();
                match joint.kind {
                    JointKind::Revolute => joint.theta = Angle::Radians(number(joint.theta.radians() + q)),
                    JointKind::Prismatic => joint.d += number(q),
                }
            }
            let ((expected, _), (still, axes)) = (frames(&moved), frames(&arm));
            let mut pose = Pose::identity();
            for (i, link) in tree.links.iter().enumerate() {
                pose = pose.then(&link.pose).then(&along_z(link.joint.kind, q[i]));
                let found = pose.then(&axes[i].see(&still[i]));
                assert!((found.rotation - expected[i].rotation).norm() < 1e-12, "{convention} {i}");
                assert!((found.origin - expected[i].origin).norm() < 1e-12, "{convention} {i}");
            }
        }
    }
}
