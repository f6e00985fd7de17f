//! The chain in expressions: stages of parallel axes with their angles, ready for a recursion.

use super::angles::Angles;
use super::bars::BarBody;
use super::body::{Vector, ZERO};
use super::chain::{self, LinkGeometry, Origins};
use crate::arm::{Arm, JointKind};
use crate::exact::algebra::Algebra;
use crate::exact::rational::Rational;
use crate::graph::{Builder, Expr};
use crate::lagrangian::elements::ArmElements;

/// Sine and cosine.
pub type SinCos = (Expr, Expr);

/// No turn.
pub const STRAIGHT: SinCos = (Expr::ZERO, Expr::ONE);

/// The form of a recursion: all forms give the same function, which is cheaper depends on the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Form {
    /// The positions of origins on their axes.
    pub origins: Origins,
    /// Within a stage vectors are turned from link to link, not through the frame before the stage.
    pub link_to_link: bool,
    /// The last link keeps the axes of the frame before it, and its moments are turned instead.
    pub last_in_frame_before: bool,
    /// The regressor's forces are turned back to where their origin is at rest, not the axes' velocities
    /// outwards.
    pub forces_home: bool,
}

impl Form {
    /// One of them.
    pub const FIRST: Form =
        Form { origins: Origins::Inner, link_to_link: true, last_in_frame_before: true, forces_home: true };

    /// Every form with some origins.
    pub fn all(origins: Origins) -> impl Iterator<Item = Form> {
        (0..8).map(move |k| Form {
            origins,
            link_to_link: k & 1 == 0,
            last_in_frame_before: k & 2 == 0,
            forces_home: k & 4 == 0,
        })
    }
}

/// A link in its stage.
#[derive(Clone, Debug)]
pub struct Member {
    /// The link's joint.
    pub joint: usize,
    /// Whether z points against the joint's axis.
    pub reversed: bool,
    /// The angle from the frame before the stage.
    pub angle: SinCos,
    /// The angle from the member before; for the first that from the frame before the stage.
    pub step: SinCos,
    /// From its origin to the next link's, in its own axes.
    pub reach: Vector,
    /// Gear ratio of its rotor.
    pub ratio: Option<Expr>,
    /// If its motor turns with several joints: its velocity about the chain's z for a unit of each joint's
    /// velocity.
    pub coupled: Option<Vec<(usize, Expr)>>,
}

/// Joints with parallel axes, or one prismatic joint.
#[derive(Clone, Debug)]
pub struct Stage {
    /// How its joints move.
    pub kind: JointKind,
    /// The twist about x before it.
    pub twist: SinCos,
    /// The stage's links.
    pub members: Vec<Member>,
    /// Shift along z before its frame, of a prismatic joint.
    pub shift: Expr,
}

/// An arm's stages from the base.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Gravity in the base frame.
    pub gravity: Vector,
    /// The stages.
    pub stages: Vec<Stage>,
    /// In which form recursions run along it.
    pub form: Form,
    /// The angle by which the last link's moments are turned back; straight unless the form says so.
    pub last_turn: SinCos,
    /// The bars of closed loops, without bodies until they are given.
    pub bars: Vec<BarBody>,
}

impl Chain {
    /// The chain of an arm.
    pub fn build(b: &Builder, arm: &Arm, angles: &Angles, elements: &ArmElements<Expr>, form: Form) -> Chain {
        let links = chain::geometry(b, arm, form.origins, elements);
        let stages = chain::stages(arm);
        let mut stages: Vec<Stage> =
            stages.into_iter().map(|joints| stage(b, arm, angles, elements, &links, joints)).collect();
        let mut last_turn = STRAIGHT;
        if let Some(last) =
            stages.last_mut().filter(|s| form.last_in_frame_before && s.kind == JointKind::Revolute)
            && let Some(member) = last.members.last_mut()
        {
            // Vectors that are turned back to the frame before the stage must be passed from there to the
            // others.
            last_turn = std::mem::replace(&mut member.angle, STRAIGHT);
            member.reach = back_z(b, last_turn, &member.reach);
            if let [.., before, member] = &mut last.members[..] {
                member.step = (-before.angle.0, before.angle.1);
            } else if let Some(member) = last.members.last_mut() {
                member.step = STRAIGHT;
            }
        }
        let mut chain = Chain { gravity: elements.gravity, stages, form, last_turn, bars: Vec::new() };
        chain.bars = elements.bars.iter().map(|bar| BarBody::new(b, &chain, &links, bar)).collect();
        chain
    }

    /// This chain without bars.
    pub fn without_bars(&self) -> Chain {
        Chain { bars: Vec::new(), ..self.clone() }
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.stages.iter().map(|s| s.members.len()).sum()
    }
}

/// One stage, of joints that follow each other in the chain.
fn stage(
    b: &Builder,
    arm: &Arm,
    angles: &Angles,
    elements: &ArmElements<Expr>,
    links: &[LinkGeometry<Expr>],
    joints: std::ops::Range<usize>,
) -> Stage {
    let first = joints.start;
    let kind = arm.joints[first].kind;
    let turn = |joints: std::ops::RangeInclusive<usize>| {
        let signs: Vec<(usize, bool)> = joints.map(|i| (i, links[i].reversed)).collect();
        angles.of_chain(b, &signs)
    };
    let members = joints
        .map(|i| {
            let angle = match kind {
                JointKind::Revolute => turn(first..=i),
                JointKind::Prismatic => {
                    signed(links[i].reversed, (elements.joints[i].sin, elements.joints[i].cos))
                }
            };
            let step = if i == first { angle } else { turn(i..=i) };
            let LinkGeometry { reversed, reach, .. } = links[i];
            let about_z = |(joint, factor): (usize, Rational)| {
                (joint, b.constant(&if reversed { -factor } else { factor }))
            };
            let coupled = arm.coupled_motor(i).map(|row| row.into_iter().map(about_z).collect());
            Member { joint: i, reversed, angle, step, reach, ratio: elements.joints[i].ratio, coupled }
        })
        .collect();
    let shift = match kind {
        JointKind::Revolute => Expr::ZERO,
        JointKind::Prismatic if links[first].reversed => -elements.joints[first].shift,
        JointKind::Prismatic => elements.joints[first].shift,
    };
    Stage { kind, twist: links[first].twist, members, shift }
}

fn signed(negative: bool, (s, c): SinCos) -> SinCos {
    (if negative { -s } else { s }, c)
}

impl Member {
    /// How fast its motor turns about the chain's z, for rates of the joints, where it turns with several.
    pub fn coupled_rate(&self, b: &Builder, of_joint: &[Expr]) -> Option<Expr> {
        let row = self.coupled.as_ref()?;
        Some(row.iter().fold(Expr::ZERO, |sum, (j, factor)| b.add(&sum, &b.mul(factor, &of_joint[*j]))))
    }

    /// Adds the joints' torques from a torque of its motor about the chain's z.
    pub fn add_coupled_torque(&self, b: &Builder, torque: Expr, torques: &mut [Expr]) {
        for (joint, factor) in self.coupled.iter().flatten() {
            torques[*joint] = b.add(&torques[*joint], &b.mul(factor, &torque));
        }
    }
}

impl Stage {
    /// The coordinates of the stage's links for values of the joints: about parallel axes the sums up to each
    /// joint.
    pub fn coordinates(&self, b: &Builder, of_joint: &[Expr]) -> Vec<Expr> {
        let mut sum = Expr::ZERO;
        let own = |m: &Member| if m.reversed { -of_joint[m.joint] } else { of_joint[m.joint] };
        self.members
            .iter()
            .map(|m| {
                sum = b.add(&sum, &own(m));
                sum
            })
            .collect()
    }

    /// Each member's reach in the axes of the frame before the stage.
    pub fn reach_before(&self, b: &Builder, k: usize) -> Vector {
        back_z(b, self.members[k].angle, &self.members[k].reach)
    }
}

/// A vector's components in the axes before a turn about z.
pub fn back_z(b: &Builder, (sin, cos): SinCos, v: &Vector) -> Vector {
    crate::lagrangian::elements::turn_z(b, &-sin, &cos, v)
}

/// A vector's components in the axes before a turn about x.
pub fn back_x(b: &Builder, (sin, cos): SinCos, v: &Vector) -> Vector {
    crate::lagrangian::elements::turn_x(b, &-sin, &cos, v)
}

/// A vector's components in the axes before a turn about y.
pub fn back_y(b: &Builder, (sin, cos): SinCos, v: &Vector) -> Vector {
    crate::lagrangian::elements::turn_y(b, &-sin, &cos, v)
}

/// u + v
pub fn plus(b: &Builder, u: &Vector, v: &Vector) -> Vector {
    std::array::from_fn(|i| b.add(&u[i], &v[i]))
}

/// x·v
pub fn scaled(b: &Builder, x: Expr, v: &Vector) -> Vector {
    if x == Expr::ZERO { ZERO } else { v.map(|y| b.mul(&x, &y)) }
}
