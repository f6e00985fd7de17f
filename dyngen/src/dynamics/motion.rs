//! The forward pass: how every frame of the chain moves.

use super::body::{Vector, ZERO};
use super::spin::Spin;
use super::stage::{Chain, Member, Stage, back_z, plus, scaled};
use crate::arm::JointKind;
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};
use crate::lagrangian::elements::turn_z;

/// The inputs of the recursion in addition to the joints' positions.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Velocities q̇.
    pub velocities: Vec<Expr>,
    /// Reference velocities q̇ᵣ: the velocities themselves, or those of Slotine and Li.
    pub reference: Vec<Expr>,
    /// Accelerations q̈, or reference accelerations q̈ᵣ.
    pub accelerations: Vec<Expr>,
    /// Whether gravity acts.
    pub gravity: bool,
}

/// How a link moves.
#[derive(Clone, Copy, Debug)]
pub struct LinkMotion {
    /// Motion of the link's frame.
    pub spin: Spin,
    /// Acceleration of its origin, less gravity, in its own axes.
    pub acceleration: Vector,
    /// Acceleration of the next link's origin, in its own axes.
    pub next: Vector,
}

/// How the frames at a stage move.
#[derive(Clone, Debug)]
pub struct StageMotion {
    /// Before its joints: the link before, in axes whose z is the stage's.
    pub before: Spin,
    /// Velocities of its coordinates.
    pub velocities: Vec<Expr>,
    /// Reference velocities of its coordinates.
    pub reference: Vec<Expr>,
    /// Accelerations of its coordinates.
    pub accelerations: Vec<Expr>,
    /// The stage's links.
    pub links: Vec<LinkMotion>,
    /// For each of its joints the velocity, reference velocity and acceleration of the motor about the
    /// stage's z, where that turns with several joints.
    coupled: Vec<Option<[Expr; 3]>>,
}

impl StageMotion {
    /// The velocity and reference velocity of a joint's motor about the stage's z.
    pub fn motor_rates(&self, b: &Builder, k: usize) -> (Expr, Expr) {
        match self.coupled[k] {
            Some([velocity, reference, _]) => (velocity, reference),
            None => (own_rate(b, &self.velocities, k), own_rate(b, &self.reference, k)),
        }
    }

    /// The acceleration of a joint's motor about the stage's z.
    pub fn motor_acceleration(&self, b: &Builder, k: usize) -> Expr {
        match self.coupled[k] {
            Some([_, _, acceleration]) => acceleration,
            None => own_rate(b, &self.accelerations, k),
        }
    }
}

/// Runs from the base to the last link.
pub fn motions(b: &Builder, chain: &Chain, drive: &Drive) -> Vec<StageMotion> {
    let mut spin = Spin::REST;
    let mut acceleration = if drive.gravity { chain.gravity.map(|g| -g) } else { ZERO };
    let mut all = Vec::with_capacity(chain.stages.len());
    for stage in &chain.stages {
        let before = spin.turned_x(b, stage.twist);
        let (sin, cos) = stage.twist;
        acceleration = crate::lagrangian::elements::turn_x(b, &sin, &cos, &acceleration);
        let velocities = stage.coordinates(b, &drive.velocities);
        let reference = stage.coordinates(b, &drive.reference);
        let accelerations = stage.coordinates(b, &drive.accelerations);
        let of_motor = |member: &Member| {
            let rate = |rates: &[Expr]| member.coupled_rate(b, rates);
            Some([rate(&drive.velocities)?, rate(&drive.reference)?, rate(&drive.accelerations)?])
        };
        let coupled = stage.members.iter().map(of_motor).collect();
        let mut motion =
            StageMotion { before, velocities, reference, accelerations, links: Vec::new(), coupled };
        motion.links = match stage.kind {
            JointKind::Revolute => revolute(b, stage, &motion, acceleration, chain.form.link_to_link),
            JointKind::Prismatic => vec![prismatic(b, stage, &motion, acceleration)],
        };
        if let Some(last) = motion.links.last() {
            (spin, acceleration) = (last.spin, last.next);
        }
        all.push(motion);
    }
    all
}

fn revolute(
    b: &Builder,
    stage: &Stage,
    motion: &StageMotion,
    mut before: Vector,
    link_to_link: bool,
) -> Vec<LinkMotion> {
    let mut links: Vec<LinkMotion> = Vec::with_capacity(stage.members.len());
    for (k, member) in stage.members.iter().enumerate() {
        let (velocity, reference) = (motion.velocities[k], motion.reference[k]);
        let spin = motion.before.joined(b, member.angle, velocity, reference, motion.accelerations[k]);
        let turn = |(sin, cos): (Expr, Expr), v: &Vector| turn_z(b, &sin, &cos, v);
        let acceleration = match links.last() {
            Some(inner) if link_to_link => turn(member.step, &inner.next),
            _ => turn(member.angle, &before),
        };
        let relative = spin.times(b, &member.reach);
        let next = plus(b, &acceleration, &relative);
        before = plus(b, &before, &back_z(b, member.angle, &relative));
        links.push(LinkMotion { spin, acceleration, next });
    }
    links
}

fn prismatic(b: &Builder, stage: &Stage, motion: &StageMotion, before: Vector) -> LinkMotion {
    let member = &stage.members[0];
    let (sin, cos) = member.angle;
    let turn = |v: &Vector| turn_z(b, &sin, &cos, v);
    let spin = Spin {
        omega: turn(&motion.before.omega),
        reference: turn(&motion.before.reference),
        rows: super::spin::turned_tensor(&motion.before.rows, turn),
    };
    let carried = scaled(b, stage.shift, &motion.before.column(2));
    // Coriolis acceleration 2 ω×(q̇ z), symmetric in velocities and reference velocities.
    let turned = axis_rate_sum(b, &motion.before, motion.velocities[0], motion.reference[0]);
    let own = [turned[0], turned[1], motion.accelerations[0]];
    let acceleration = turn(&plus(b, &before, &plus(b, &carried, &own)));
    let next = plus(b, &acceleration, &spin.times(b, &member.reach));
    LinkMotion { spin, acceleration, next }
}

/// q̇ᵣ ω×z + q̇ ωᵣ×z
fn axis_rate_sum(b: &Builder, before: &Spin, velocity: Expr, reference: Expr) -> Vector {
    let across = |i: usize| {
        if before.omega == before.reference && velocity == reference {
            return b.mul(&b.add(&velocity, &velocity), &before.omega[i]);
        }
        b.add(&b.mul(&reference, &before.omega[i]), &b.mul(&velocity, &before.reference[i]))
    };
    [across(1), -across(0), Expr::ZERO]
}

/// q̇·ω×z for a joint axis z, symmetric in velocities and reference velocities.
pub fn axis_rate(b: &Builder, before: &Spin, velocity: Expr, reference: Expr) -> Vector {
    if before.omega == before.reference && velocity == reference {
        return [b.mul(&velocity, &before.omega[1]), -b.mul(&velocity, &before.omega[0]), Expr::ZERO];
    }
    let half = b.constant(&crate::exact::rational::ratio(1, 2));
    axis_rate_sum(b, before, velocity, reference).map(|x| b.mul(&half, &x))
}

/// A joint's own rate from the rates of its stage's coordinates.
fn own_rate(b: &Builder, coordinates: &[Expr], k: usize) -> Expr {
    let inner = k.checked_sub(1).map_or(Expr::ZERO, |inner| coordinates[inner]);
    b.sub(&coordinates[k], &inner)
}
