//! The regressor: each parameter's wrench projected onto the motion of each coordinate.

use super::bars;
use super::body::{Vector, ZERO};
use super::chain::LinkGeometry;
use super::inverse::entry_wrench;
use super::motion::{Drive, LinkMotion, StageMotion, axis_rate, motions};
use super::spin::{Spin, turned_tensor};
use super::stage::{Chain, Member, STRAIGHT, SinCos, Stage, back_x, back_z, plus, scaled};
use super::wrench::Wrench;
use crate::arm::{JointKind, Parameter, ParameterKind};
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::graph::{Builder, Expr};
use crate::parameters::ParameterSet;

/// The motion of a frame for a unit of a coordinate's velocity.
#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Angular velocity.
    angular: Vector,
    /// Velocity of the origin.
    linear: Vector,
}

/// The view in which a link's columns are projected.
#[derive(Clone, Debug)]
struct LinkView {
    motion: LinkMotion,
    /// The coordinates up to the link's own, in its axes.
    axes: Vec<Axis>,
    /// The way of a force back to the link whose end is this link's origin, and the velocities of that end
    /// there.
    home: Option<(Vec<Turn>, Vec<Vector>)>,
}

/// A turn back by a sine and cosine about x or z.
#[derive(Clone, Copy, Debug)]
enum Turn {
    X(SinCos),
    Z(SinCos),
}

impl Turn {
    fn back(self, b: &Builder, v: &Vector) -> Vector {
        match self {
            Turn::X(trig) => back_x(b, trig, v),
            Turn::Z(trig) => back_z(b, trig, v),
        }
    }
}

/// The data from which the columns are made.
#[derive(Clone, Copy, Debug)]
pub struct Columns<'a> {
    /// The parameter set.
    pub set: &'a ParameterSet,
    /// The field of its factors.
    pub field: &'a ConstantField,
    /// Poses of the file's frames in those of the chain.
    pub links: &'a [LinkGeometry<Expr>],
    /// Whether forces are turned back to where their origin is at rest, not the axes' velocities outwards.
    pub forces_home: bool,
}

/// Y(q, q̇, q̈), row-major n × p: τ = Y·π for the parameters of a set; with reference velocities the
/// regressor of Slotine and Li, Y(q, q̇, q̇ᵣ, q̈ᵣ)·π = B·q̈ᵣ + C·q̇ᵣ + g.
pub fn regressor(b: &Builder, chain: &Chain, columns: &Columns<'_>, drive: &Drive) -> Vec<Expr> {
    let (n, p) = (chain.dof(), columns.set.parameters.len());
    let motions = motions(b, chain, drive);
    let (views, before) = views(b, chain, &motions);
    let mut rows = vec![Expr::ZERO; n * p];
    for (index, parameter) in columns.set.parameters.iter().enumerate() {
        let mut column = vec![Expr::ZERO; n];
        for (carrier, factor) in &parameter.carriers {
            let factor = super::body::constant(b, columns.field, factor);
            let own = match carrier.kind {
                kind if carrier.link >= n => bars::column(b, chain, carrier.link - n, kind as usize, drive),
                ParameterKind::Im => rotor_column(b, chain, &motions, &before, carrier.link),
                _ => body_column(b, chain, columns, &views[carrier.link], *carrier),
            };
            for (total, torque) in column.iter_mut().zip(own) {
                *total = b.add(total, &b.mul(&factor, &torque));
            }
        }
        for (row, torque) in column.into_iter().enumerate() {
            rows[row * p + index] = torque;
        }
    }
    rows
}

/// Carries every coordinate's axis outwards: to each link, and to the axes before each stage.
fn views(b: &Builder, chain: &Chain, motions: &[StageMotion]) -> (Vec<LinkView>, Vec<Vec<Axis>>) {
    let mut seen: Vec<Axis> = Vec::new();
    let (mut views, mut before_stages) = (Vec::with_capacity(chain.dof()), Vec::new());
    let mut home: Option<(Vec<Turn>, Vec<Vector>)> = None;
    for (stage, motion) in chain.stages.iter().zip(motions) {
        let (s, c) = stage.twist;
        for axis in &mut seen {
            axis.angular = crate::lagrangian::elements::turn_x(b, &s, &c, &axis.angular);
            axis.linear = crate::lagrangian::elements::turn_x(b, &s, &c, &axis.linear);
        }
        if let Some((turns, _)) = &mut home {
            turns.push(Turn::X(stage.twist));
        }
        before_stages.push(seen.clone());
        let first = seen.len();
        let before = seen.clone();
        for (k, member) in stage.members.iter().enumerate() {
            let unit = [Expr::ZERO, Expr::ZERO, Expr::ONE];
            let link_to_link = chain.form.link_to_link && k > 0;
            let mut axes = seen_from(b, member, &seen, link_to_link.then_some(&before));
            let own = match stage.kind {
                JointKind::Revolute => Axis { angular: unit, linear: ZERO },
                JointKind::Prismatic => {
                    let shift = [Expr::ZERO, Expr::ZERO, stage.shift];
                    for axis in &mut axes {
                        axis.linear = plus(b, &axis.linear, &b.cross(&axis.angular, &shift));
                    }
                    home = None;
                    Axis { angular: ZERO, linear: unit }
                }
            };
            axes.push(own);
            if let Some((turns, _)) = &mut home {
                turns.push(Turn::Z(if k == 0 { member.angle } else { member.step }));
            }
            views.push(LinkView { motion: motion.links[k], axes: axes.clone(), home: home.clone() });
            // To the next origin.
            let last = k + 1 == stage.members.len();
            for (j, axis) in axes.iter_mut().enumerate() {
                axis.linear = plus(b, &axis.linear, &b.cross(&axis.angular, &member.reach));
                if j == first + k && !last {
                    axis.angular = ZERO;
                }
            }
            if member.reach != ZERO {
                home = Some((Vec::new(), axes.iter().map(|axis| axis.linear).collect()));
            }
            seen = axes;
            if !last && !chain.form.link_to_link {
                for axis in &mut seen {
                    axis.angular = back_z(b, member.angle, &axis.angular);
                    axis.linear = back_z(b, member.angle, &axis.linear);
                }
            }
        }
    }
    (views, before_stages)
}

/// The axes of earlier coordinates in a member's own axes. From link to link only their linear parts grow:
/// their angular parts stay those from before the stage, where members of the stage have none.
fn seen_from(b: &Builder, member: &Member, seen: &[Axis], link_to_link: Option<&Vec<Axis>>) -> Vec<Axis> {
    let turn_z = |(s, c): SinCos, v: &Vector| crate::lagrangian::elements::turn_z(b, &s, &c, v);
    let Some(before) = link_to_link else {
        let in_axes = |axis: &Axis| Axis {
            angular: turn_z(member.angle, &axis.angular),
            linear: turn_z(member.angle, &axis.linear),
        };
        return seen.iter().map(in_axes).collect();
    };
    let angular = before.iter().map(|axis| turn_z(member.angle, &axis.angular));
    let within = std::iter::repeat(ZERO);
    let linear = seen.iter().map(|axis| turn_z(member.step, &axis.linear));
    angular.chain(within).zip(linear).map(|(angular, linear)| Axis { angular, linear }).collect()
}

/// The torques of a unit of one inertial parameter.
fn body_column(
    b: &Builder,
    chain: &Chain,
    columns: &Columns<'_>,
    view: &LinkView,
    parameter: Parameter,
) -> Vec<Expr> {
    let geometry = &columns.links[parameter.link];
    let wrench = unit_wrench(b, chain, geometry, &view.motion, parameter);
    let origin = file_origin(b, chain, geometry, parameter.link);
    let at_file = !is_second(parameter.kind) && origin != ZERO;
    let forced = |axis: usize| -> Expr {
        let Axis { angular, linear } = view.axes[axis];
        match &view.home {
            Some((turns, velocities)) if columns.forces_home && !at_file && axis < velocities.len() => {
                let home = turns.iter().rev().fold(wrench.force, |f, turn| turn.back(b, &f));
                b.dot(&velocities[axis], &home)
            }
            _ if at_file => {
                let velocity = plus(b, &linear, &b.cross(&angular, &origin));
                b.dot(&velocity, &wrench.force)
            }
            _ => b.dot(&linear, &wrench.force),
        }
    };
    let coordinates: Vec<Expr> = (0..view.axes.len())
        .map(|j| b.add(&b.dot(&view.axes[j].angular, &wrench.moment), &forced(j)))
        .collect();
    of_joints(b, chain, &coordinates)
}

/// The joints' torques from what the coordinates feel: a joint moves its link and all after it.
fn of_joints(b: &Builder, chain: &Chain, coordinates: &[Expr]) -> Vec<Expr> {
    let mut torques = vec![Expr::ZERO; chain.dof()];
    for stage in &chain.stages {
        let mut sum = Expr::ZERO;
        for member in stage.members.iter().rev() {
            sum = b.add(&sum, coordinates.get(member.joint).unwrap_or(&Expr::ZERO));
            torques[member.joint] = if member.reversed { -sum } else { sum };
        }
    }
    torques
}

/// The origin of the file's frame in the chain's axes.
fn file_origin(b: &Builder, chain: &Chain, geometry: &LinkGeometry<Expr>, link: usize) -> Vector {
    match link + 1 == chain.dof() {
        true => back_z(b, chain.last_turn, &geometry.file_origin),
        false => geometry.file_origin,
    }
}

fn is_second(kind: ParameterKind) -> bool {
    !matches!(kind, ParameterKind::M | ParameterKind::Mx | ParameterKind::My | ParameterKind::Mz)
}

/// The wrench of a unit of one inertial parameter about the origin of the file's frame, in the chain's axes.
fn unit_wrench(
    b: &Builder,
    chain: &Chain,
    geometry: &LinkGeometry<Expr>,
    motion: &LinkMotion,
    parameter: Parameter,
) -> Wrench {
    use ParameterKind::*;
    let last = parameter.link + 1 == chain.dof();
    let turn = |v: &Vector| {
        let v = back_x(b, geometry.file_turn, v);
        if last { back_z(b, chain.last_turn, &v) } else { v }
    };
    let unit =
        |axis: usize| -> Vector { std::array::from_fn(|i| if i == axis { Expr::ONE } else { Expr::ZERO }) };
    let origin = file_origin(b, chain, geometry, parameter.link);
    let acceleration = plus(b, &motion.acceleration, &motion.spin.times(b, &origin));
    let first = |axis: usize| {
        let arm = turn(&unit(axis));
        Wrench { force: motion.spin.times(b, &arm), moment: b.cross(&arm, &acceleration) }
    };
    let tensor = |i: usize, j: usize, sign: Expr| {
        let axis = back_x(b, geometry.file_turn, &unit(i));
        if i == j && last && chain.last_turn != STRAIGHT && axis[2] == Expr::ZERO {
            let across = axis[0] == Expr::ZERO;
            return Wrench { force: ZERO, moment: turned_moment(b, chain.last_turn, across, motion) };
        }
        let mut rows = [ZERO; 3];
        (rows[i][j], rows[j][i]) = (sign, sign);
        Wrench { force: ZERO, moment: tensor_moment(b, &turned_tensor(&rows, turn), motion) }
    };
    match parameter.kind {
        M => Wrench { force: acceleration, moment: ZERO },
        Mx => first(0),
        My => first(1),
        Mz => first(2),
        Ixx => tensor(0, 0, Expr::ONE),
        Iyy => tensor(1, 1, Expr::ONE),
        Izz => tensor(2, 2, Expr::ONE),
        // The tensor's element is minus the product of inertia.
        Iyz => tensor(1, 2, -Expr::ONE),
        Ixz => tensor(0, 2, -Expr::ONE),
        Ixy => tensor(0, 1, -Expr::ONE),
        Im => Wrench::NONE,
    }
}

/// I α + ω×(I ω) of a unit moment of inertia about an axis that is turned about z from x, or from y across
/// it.
///
/// With the second moment across the axis: with e that direction it is e×(U e), less the moment of the
/// inertia about z.
fn turned_moment(b: &Builder, trig: SinCos, across: bool, motion: &LinkMotion) -> Vector {
    let spin = &motion.spin;
    let turn = |v: &Vector| crate::lagrangian::elements::turn_z(b, &trig.0, &trig.1, v);
    let own = Spin { omega: turn(&spin.omega), reference: turn(&spin.reference), ..*spin };
    let [along, aside, _] = turn(&spin.rows[2]);
    let (height, about_z) =
        if across { (along, own.product(b, 0, 1)) } else { (aside, -own.product(b, 0, 1)) };
    let lever = if across { [Expr::ZERO, -height, about_z] } else { [height, Expr::ZERO, about_z] };
    let turned = back_z(b, trig, &lever);
    let zz = [spin.product(b, 1, 2), -spin.product(b, 2, 0), Expr::ZERO];
    std::array::from_fn(|i| b.sub(&turned[i], &zz[i]))
}

/// I α + ω×(I ω) of a tensor by rows.
fn tensor_moment(b: &Builder, tensor: &[Vector; 3], motion: &LinkMotion) -> Vector {
    let mut moment = ZERO;
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        if tensor[i][i] != Expr::ZERO {
            let mut own = ZERO;
            own[i] = motion.spin.alpha(b, i);
            own[j] = motion.spin.product(b, k, i);
            own[k] = -motion.spin.product(b, i, j);
            moment = plus(b, &moment, &scaled(b, tensor[i][i], &own));
        }
        // Off the diagonal minus the second moments.
        if tensor[j][k] != Expr::ZERO {
            let own = entry_wrench(b, 7 + i, motion).moment;
            moment = plus(b, &moment, &scaled(b, -tensor[j][k], &own));
        }
    }
    moment
}

/// The torques of a unit of a rotor's inertia: on its own joint k·(k q̈ + z·α of the link before), and on
/// that link the rate of the rotor's own angular momentum, k·(q̈ z + q̇ ω×z). If the motor turns with several
/// joints, its velocity replaces q̇, and its torque acts on each of them.
fn rotor_column(
    b: &Builder,
    chain: &Chain,
    motions: &[StageMotion],
    before: &[Vec<Axis>],
    joint: usize,
) -> Vec<Expr> {
    let mut coordinates = vec![Expr::ZERO; chain.dof()];
    let Some((s, k)) = place(&chain.stages, joint) else { return coordinates };
    let (stage, motion) = (&chain.stages[s], &motions[s]);
    let Some(ratio) = stage.members[k].ratio else { return coordinates };
    let ddq = motion.motor_acceleration(b, k);
    let (velocity, reference) = motion.motor_rates(b, k);
    let mut moment = scaled(b, ratio, &axis_rate(b, &motion.before, velocity, reference));
    moment[2] = b.mul(&ratio, &ddq);
    for (j, axis) in before[s].iter().enumerate() {
        coordinates[j] = b.dot(&axis.angular, &moment);
    }
    // Within the stage the link before the rotor is the last that it turns.
    let mut alpha = motion.before.alpha_z(b);
    if let Some(inner) = k.checked_sub(1) {
        coordinates[stage.members[inner].joint] = moment[2];
        alpha = b.add(&alpha, &motion.accelerations[inner]);
    }
    let mut torques = of_joints(b, chain, &coordinates);
    let own = b.mul(&ratio, &b.add(&b.mul(&ratio, &ddq), &alpha));
    match stage.members[k].coupled {
        Some(_) => stage.members[k].add_coupled_torque(b, own, &mut torques),
        None => torques[joint] = if stage.members[k].reversed { -own } else { own },
    }
    torques
}

/// Stage and member of a joint.
fn place(stages: &[Stage], joint: usize) -> Option<(usize, usize)> {
    stages
        .iter()
        .enumerate()
        .find_map(|(s, stage)| stage.members.iter().position(|m| m.joint == joint).map(|k| (s, k)))
}
