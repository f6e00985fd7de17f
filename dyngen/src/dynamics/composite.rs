//! Composite bodies carried inwards along the chain: the mass matrix, and gravity.

use super::body::Vector;
use super::moments::Moments;
use super::regroup::LinkBody;
use super::stage::{Chain, Member, STRAIGHT, SinCos, Stage, back_z, plus};
use super::wrench::{Wrench, lever};
use crate::arm::JointKind;
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// A link of a stage, in the axes in which the recursion sees it.
#[derive(Clone, Debug)]
pub struct Piece {
    /// The piece's body.
    pub moments: Moments<Expr>,
    /// From its origin to the next link's.
    pub reach: Vector,
    /// The turn from the axes of the piece before, or from those before the stage.
    pub step: SinCos,
}

/// The links of a stage, each in its own axes or all in those before the stage.
pub fn pieces(b: &Builder, chain: &Chain, stage: &Stage, bodies: &[LinkBody]) -> Vec<Piece> {
    let own_axes = chain.form.link_to_link || stage.kind == JointKind::Prismatic;
    let piece = |k: usize| {
        let member = &stage.members[k];
        let moments = &bodies[member.joint].moments;
        if own_axes || member.angle == STRAIGHT {
            let step = if own_axes { member.step } else { STRAIGHT };
            return Piece { moments: moments.clone(), reach: member.reach, step };
        }
        let (sin, cos) = member.angle;
        let moments = moments.turned_back_z(b, &sin, &cos);
        Piece { moments, reach: stage.reach_before(b, k), step: STRAIGHT }
    };
    let mut pieces: Vec<Piece> = (0..stage.members.len()).map(piece).collect();
    // The last link stays in its own axes: what lies beyond it is seen from there.
    if let (Some(piece), Some(member)) = (pieces.last_mut(), stage.members.last()) {
        *piece = Piece {
            moments: bodies[member.joint].moments.clone(),
            reach: member.reach,
            step: if own_axes { member.step } else { member.angle },
        };
    }
    pieces
}

/// A body with a mass added at its origin.
pub fn with_mass(b: &Builder, body: &Moments<Expr>, mass: Expr) -> Moments<Expr> {
    Moments { mass: b.add(&body.mass, &mass), ..body.clone() }
}

/// The wrench of momentum for a unit velocity about z: f = z×s, n = I z; or along z: f = m z, n = s×z.
pub fn unit_momentum(b: &Builder, body: &Moments<Expr>, kind: JointKind) -> Wrench {
    let [sx, sy, _] = body.first;
    match kind {
        JointKind::Revolute => {
            let [yz, xz, _] = body.mixed;
            Wrench { force: [-sy, sx, Expr::ZERO], moment: [-xz, -yz, body.about_z(b)] }
        }
        JointKind::Prismatic => {
            Wrench { force: [Expr::ZERO, Expr::ZERO, body.mass], moment: [sy, -sx, Expr::ZERO] }
        }
    }
}

/// z×p
pub fn z_cross(p: &Vector) -> Vector {
    [-p[1], p[0], Expr::ZERO]
}

/// B(q), row-major n × n, by the composite rigid body recursion.
pub fn mass_matrix(b: &Builder, chain: &Chain, bodies: &[LinkBody]) -> Vec<Expr> {
    let n = chain.dof();
    let mut matrix = vec![Expr::ZERO; n * n];
    let mut coupled = Vec::new();
    let mut outer = Moments::none(b);
    for (s, stage) in chain.stages.iter().enumerate().rev() {
        let mut columns = Vec::new();
        let before = match stage.kind {
            JointKind::Revolute => revolute(b, chain, stage, bodies, &outer, &mut matrix, &mut columns),
            JointKind::Prismatic => prismatic(b, chain, stage, bodies, &outer, &mut matrix, &mut columns),
        };
        // From sums of angles to the joints' own: a joint moves its link and all after it.
        let mut column = Wrench::NONE;
        for (k, member) in stage.members.iter().enumerate().rev() {
            column = column.plus(b, &columns[k]);
            let mut carried = column;
            if let (Some(_), Some(ratio)) = (&member.coupled, member.ratio) {
                let rotor = b.mul(&ratio, &bodies[member.joint].rotor);
                let own = b.mul(&ratio, &rotor);
                coupled.push((member, own, carried_by(b, chain, s, k, rotor)));
            } else if let Some(ratio) = member.ratio {
                let rotor = b.mul(&ratio, &bodies[member.joint].rotor);
                let diagonal = &mut matrix[member.joint * n + member.joint];
                *diagonal = b.add(diagonal, &b.mul(&ratio, &rotor));
                for inner in &stage.members[..k] {
                    let entry = &mut matrix[inner.joint * n + member.joint];
                    *entry = b.add(entry, &rotor);
                }
                carried.moment[2] = b.add(&carried.moment[2], &rotor);
            }
            project_inwards(b, &chain.stages[..s], chain.form.link_to_link, stage, carried, |row, value| {
                matrix[row * n + member.joint] = value;
            });
        }
        outer = before.turned_back_x(b, &stage.twist.0, &stage.twist.1);
    }
    let mut matrix = mirrored(chain, matrix);
    for (member, own, carried) in &coupled {
        add_coupled(b, member, *own, (carried, carried), &mut matrix);
    }
    matrix
}

/// The torques of the joints from a moment about the z of a stage on the link before its k-th joint.
fn carried_by(b: &Builder, chain: &Chain, s: usize, k: usize, moment: Expr) -> Vec<Expr> {
    let mut felt = vec![Expr::ZERO; chain.dof()];
    let (stage, inner) = (&chain.stages[s], &chain.stages[..s]);
    let wrench = Wrench { force: super::body::ZERO, moment: [Expr::ZERO, Expr::ZERO, moment] };
    project_inwards(b, inner, chain.form.link_to_link, stage, wrench, |joint, value| felt[joint] = value);
    for member in &stage.members[..k] {
        felt[member.joint] = moment;
    }
    for member in chain.stages.iter().flat_map(|stage| &stage.members).filter(|m| m.reversed) {
        felt[member.joint] = -felt[member.joint];
    }
    felt
}

/// Adds to a matrix over the joints what a rotor brings whose motor turns with several of them, with m its
/// row of the transmission's matrix: m·rowᵀ + column·mᵀ for the joints that carry it, and own·m·mᵀ.
pub fn add_coupled(
    b: &Builder,
    member: &Member,
    own: Expr,
    (row, column): (&[Expr], &[Expr]),
    matrix: &mut [Expr],
) {
    let n = row.len();
    let mut add = |i: usize, j: usize, term: Expr| matrix[i * n + j] = b.add(&matrix[i * n + j], &term);
    for (i, factor) in member.coupled.iter().flatten() {
        for j in 0..n {
            add(*i, j, b.mul(factor, &row[j]));
            add(j, *i, b.mul(factor, &column[j]));
        }
        for (j, other) in member.coupled.iter().flatten() {
            add(*i, *j, b.mul(&b.mul(factor, other), &own));
        }
    }
}

/// The lower triangle from the upper one, with the signs of the axes in the arm's file.
fn mirrored(chain: &Chain, mut matrix: Vec<Expr>) -> Vec<Expr> {
    let n = chain.dof();
    let reversed: Vec<bool> =
        chain.stages.iter().flat_map(|s| s.members.iter().map(|m| m.reversed)).collect();
    for i in 0..n {
        for j in i..n {
            if reversed[i] != reversed[j] {
                matrix[i * n + j] = -matrix[i * n + j];
            }
            matrix[j * n + i] = matrix[i * n + j];
        }
    }
    matrix
}

/// Fills the stage's own entries, in the joints' coordinates, and gives the momentum from each of the stage's
/// coordinates, about the first origin in the axes before the stage, and the composite of all links from the
/// stage on.
fn revolute(
    b: &Builder,
    chain: &Chain,
    stage: &Stage,
    bodies: &[LinkBody],
    outer: &Moments<Expr>,
    matrix: &mut [Expr],
    columns: &mut Vec<Wrench>,
) -> Moments<Expr> {
    let (n, count) = (chain.dof(), stage.members.len());
    let pieces = pieces(b, chain, stage, bodies);
    let mut own = vec![Expr::ZERO; count * count];
    columns.resize(count, Wrench::NONE);
    let mut composite = outer.clone();
    for (k, piece) in pieces.iter().enumerate().rev() {
        let end_mass = bodies[stage.members[k].joint].end_mass;
        let rest = with_mass(b, &composite, end_mass);
        composite = piece.moments.plus(b, &rest.shifted(b, &piece.reach));
        if k + 1 == count {
            columns[k] = unit_momentum(b, &composite, stage.kind);
        } else {
            let point = with_mass(b, &Moments::none(b), rest.mass).shifted(b, &piece.reach);
            columns[k] = unit_momentum(b, &piece.moments.plus(b, &point), stage.kind);
        }
        own[k * count + k] = columns[k].moment[2];
        for l in k + 1..count {
            own[k * count + l] = lever(b, &piece.reach, &columns[l].force);
            own[l * count + k] = own[k * count + l];
            columns[l] = columns[l].shifted(b, &piece.reach);
        }
        if k + 1 < count {
            // The bodies beyond it move along: their first moment times that velocity.
            let [_, _, sz] = rest.first;
            for (i, p) in piece.reach.iter().take(2).enumerate() {
                columns[k].moment[i] = b.sub(&columns[k].moment[i], &b.mul(&sz, p));
            }
        }
        let (sin, cos) = piece.step;
        composite = composite.turned_back_z(b, &sin, &cos);
        for column in &mut columns[k..] {
            column.force = back_z(b, piece.step, &column.force);
            column.moment = back_z(b, piece.step, &column.moment);
        }
    }
    for k in 0..count {
        let wheel = bodies[stage.members[k].joint].flywheel;
        own[k * count + k] = b.add(&own[k * count + k], &wheel);
        let row = own[k * count..][..count].iter().rev();
        columns[k].moment[2] = row.fold(Expr::ZERO, |sum, x| b.add(&sum, x));
    }
    let sums = sums_of_links(b, &own, count);
    for i in 0..count {
        for j in i..count {
            matrix[stage.members[i].joint * n + stage.members[j].joint] = sums[i * count + j];
        }
    }
    composite
}

/// A symmetric matrix over the joints from one over the links: a joint moves its link and all after it.
fn sums_of_links(b: &Builder, own: &[Expr], count: usize) -> Vec<Expr> {
    let mut sums = vec![Expr::ZERO; count * count];
    for i in (0..count).rev() {
        let mut row = Expr::ZERO;
        for j in (i..count).rev() {
            row = b.add(&row, &own[i * count + j]);
            // The rows below, of which the one on the diagonal is this row's mirror.
            let below = if i + 1 < count { sums[(i + 1) * count + j] } else { Expr::ZERO };
            sums[i * count + j] = b.add(&row, &below);
            sums[j * count + i] = sums[i * count + j];
        }
    }
    sums
}

fn prismatic(
    b: &Builder,
    chain: &Chain,
    stage: &Stage,
    bodies: &[LinkBody],
    outer: &Moments<Expr>,
    matrix: &mut [Expr],
    columns: &mut Vec<Wrench>,
) -> Moments<Expr> {
    let member = &stage.members[0];
    let rest = with_mass(b, outer, bodies[member.joint].end_mass);
    let (sin, cos) = member.angle;
    let composite = bodies[member.joint].moments.plus(b, &rest.shifted(b, &member.reach));
    let shift = [Expr::ZERO, Expr::ZERO, stage.shift];
    let at_link = composite.turned_back_z(b, &sin, &cos);
    matrix[member.joint * chain.dof() + member.joint] = composite.mass;
    columns.push(unit_momentum(b, &at_link, stage.kind).shifted(b, &shift));
    at_link.shifted(b, &shift)
}

/// Carries a wrench about a stage's first origin, in the axes before the stage, through all stages before it
/// and reports what each joint feels.
pub fn project_inwards(
    b: &Builder,
    stages: &[Stage],
    link_to_link: bool,
    from: &Stage,
    wrench: Wrench,
    mut feels: impl FnMut(usize, Expr),
) {
    let mut wrench = wrench.turned_back_x(b, from.twist);
    for stage in stages.iter().rev() {
        let count = stage.members.len();
        let mut sum = Expr::ZERO;
        for (k, member) in stage.members.iter().enumerate().rev() {
            let before_stage = !link_to_link && k + 1 < count;
            let reach = if before_stage { stage.reach_before(b, k) } else { member.reach };
            let carried = wrench.shifted(b, &reach);
            let own = match stage.kind {
                JointKind::Revolute if k + 1 == count => carried.moment[2],
                JointKind::Revolute => lever(b, &reach, &wrench.force),
                JointKind::Prismatic => carried.force[2],
            };
            sum = b.add(&sum, &own);
            feels(member.joint, sum);
            let turn = match (before_stage, link_to_link) {
                (true, _) => STRAIGHT,
                (false, true) => member.step,
                (false, false) => member.angle,
            };
            wrench =
                Wrench { force: back_z(b, turn, &carried.force), moment: back_z(b, turn, &carried.moment) };
        }
        match stage.kind {
            JointKind::Revolute => wrench.moment[2] = sum,
            JointKind::Prismatic => wrench = wrench.shifted(b, &[Expr::ZERO, Expr::ZERO, stage.shift]),
        }
        wrench = wrench.turned_back_x(b, stage.twist);
    }
}

/// The torques that hold the arm still, g(q) = ∂U/∂q: first moments carried inwards, gravity outwards.
pub fn gravity(b: &Builder, chain: &Chain, bodies: &[LinkBody]) -> Vec<Expr> {
    let mut torques = vec![Expr::ZERO; chain.dof()];
    // Along an axis of the base its size goes into the moments, which do not depend on the pose.
    let along: Vec<usize> = (0..3).filter(|i| chain.gravity[*i] != Expr::ZERO).collect();
    let (size, mut g) = match along[..] {
        [axis] => {
            (chain.gravity[axis], std::array::from_fn(|i| if i == axis { Expr::ONE } else { Expr::ZERO }))
        }
        _ => (Expr::ONE, chain.gravity),
    };
    let weight = |mass: Expr| b.mul(&size, &mass);
    // Gravity in the axes before each stage, and in each link's.
    let mut before = Vec::with_capacity(chain.stages.len());
    for stage in &chain.stages {
        g = crate::lagrangian::elements::turn_x(b, &stage.twist.0, &stage.twist.1, &g);
        before.push(g);
        if let Some(last) = stage.members.last() {
            g = crate::lagrangian::elements::turn_z(b, &last.angle.0, &last.angle.1, &g);
        }
    }
    let (mut mass, mut first) = (Expr::ZERO, super::body::ZERO);
    for (stage, g) in chain.stages.iter().zip(&before).rev() {
        let mut at_first = super::body::ZERO;
        let mut sum = Expr::ZERO;
        for (k, member) in stage.members.iter().enumerate().rev() {
            let body = &bodies[member.joint];
            mass = b.add(&mass, &weight(body.end_mass));
            let first_moment = body.moments.first.map(weight);
            let mut own = plus(b, &first_moment, &super::stage::scaled(b, mass, &member.reach));
            if k + 1 == stage.members.len() {
                own = plus(b, &own, &first);
            }
            mass = b.add(&mass, &weight(body.moments.mass));
            let own = back_z(b, member.angle, &own);
            at_first = plus(b, &at_first, &own);
            let torque = match stage.kind {
                // −z·(s×g)
                JointKind::Revolute => b.sub(&b.mul(&own[1], &g[0]), &b.mul(&own[0], &g[1])),
                JointKind::Prismatic => -b.mul(&mass, &g[2]),
            };
            sum = b.add(&sum, &torque);
            torques[member.joint] = if member.reversed { -sum } else { sum };
        }
        at_first[2] = b.add(&at_first[2], &b.mul(&mass, &stage.shift));
        first = super::stage::back_x(b, stage.twist, &at_first);
    }
    torques
}
