//! The Coriolis matrix of Christoffel symbols, for which Ḃ − 2C is skew-symmetric.
//!
//! A point of the arm at x moves by ẋ = Σ Jⱼ q̇ⱼ, and ∂Jⱼ/∂qₖ = ∂²x/∂qⱼ∂qₖ is symmetric in j and k, so C = Σ
//! m JᵀJ̇ over all points is the matrix of Christoffel symbols. With r from the origin of a frame, Jⱼ = yⱼ +
//! zⱼ×r and J̇ⱼ = ẏⱼ + żⱼ×r + zⱼ×ṙ, so in addition to a composite's mass, first moment s and second moments
//! only Q = Σ m ṙ and K = Σ m ṙ rᵀ are needed. One pass inwards carries them; nothing is differentiated.
//! Within a stage of parallel axes a coordinate turns one link and only displaces the bodies beyond it, by t
//! = z×p at its reach p.

use super::body::{Vector, ZERO};
use super::composite::{add_coupled, pieces, unit_momentum, with_mass, z_cross};
use super::moments::Moments;
use super::motion::{Drive, StageMotion, motions};
use super::regroup::LinkBody;
use super::spin::turned_tensor;
use super::stage::{Chain, Member, STRAIGHT, Stage, back_x, back_z, plus, scaled};
use super::wrench::{Wrench, lever};
use crate::arm::JointKind;
use crate::exact::algebra::Algebra;
use crate::exact::rational;
use crate::graph::{Builder, Expr};

/// A composite body with its momentum relative to the origin.
#[derive(Clone, Debug)]
struct Moving {
    body: Moments<Expr>,
    /// Q = Σ m ṙ
    momentum: Vector,
    /// K = Σ m ṙ rᵀ, by rows.
    spread: [Vector; 3],
}

/// The contribution of a coordinate from the links that it moves, about an origin.
#[derive(Clone, Copy, Debug)]
struct Share {
    /// Σ m J̇ and Σ r×m J̇: its column of C.
    column: Wrench,
    /// Σ m J and Σ r×m J; with the drift Σ m ṙ×J its row: C_ij = ẏⱼ·force + żⱼ·moment + zⱼ·drift.
    row: Wrench,
    drift: Vector,
}

/// C(q, q̇), row-major n × n.
pub fn coriolis_matrix(b: &Builder, chain: &Chain, bodies: &[LinkBody], velocities: &[Expr]) -> Vec<Expr> {
    let n = chain.dof();
    let drive = Drive {
        velocities: velocities.to_vec(),
        reference: velocities.to_vec(),
        accelerations: vec![Expr::ZERO; n],
        gravity: false,
    };
    let motions = motions(b, chain, &drive);
    let mut matrix = vec![Expr::ZERO; n * n];
    let mut coupled = Vec::new();
    let mut outer = Moving::none(b);
    for (s, (stage, motion)) in chain.stages.iter().zip(&motions).enumerate().rev() {
        let (shares, own, mut before) = match stage.kind {
            JointKind::Revolute => revolute(b, chain, stage, motion, bodies, &outer),
            JointKind::Prismatic => prismatic(b, stage, motion, bodies, &outer),
        };
        fill_own(b, stage, &own, n, &mut matrix);
        // From sums of angles to the joints' own: a joint moves its link and all after it.
        let mut share = Share::NONE;
        for (k, member) in stage.members.iter().enumerate().rev() {
            let body = &bodies[member.joint];
            let mut turning = shares[k];
            turning.add_wheel(b, body.flywheel, motion);
            before.add_wheel(b, body.flywheel, motion.velocities[k]);
            share = share.plus(b, &turning);
            let mut carried = share;
            if let Some(ratio) = member.ratio {
                let rotor = b.mul(&ratio, &body.rotor);
                match member.coupled {
                    Some(_) => coupled.push((s, member, rotor)),
                    None => carried.add_wheel(b, rotor, motion),
                }
                before.add_wheel(b, rotor, motion.motor_rates(b, k).0);
            }
            let inner = (&chain.stages[..s], &motions[..s]);
            project(b, inner, chain.form.link_to_link, stage, carried, |j, upper, lower| {
                matrix[j * n + member.joint] = upper;
                matrix[member.joint * n + j] = lower;
            });
        }
        outer = before.turned(
            b,
            |v| back_x(b, stage.twist, v),
            |m| m.turned_back_x(b, &stage.twist.0, &stage.twist.1),
        );
    }
    let reversed: Vec<bool> =
        chain.stages.iter().flat_map(|s| s.members.iter().map(|m| m.reversed)).collect();
    let signed = |k: usize| if reversed[k / n] == reversed[k % n] { matrix[k] } else { -matrix[k] };
    let mut matrix: Vec<Expr> = (0..n * n).map(signed).collect();
    for motor in coupled {
        add_coupled_motor(b, chain, &motions, &reversed, motor, &mut matrix);
    }
    matrix
}

/// Adds the contribution to C of the rotor of a member of a stage whose motor turns with several joints.
fn add_coupled_motor(
    b: &Builder,
    chain: &Chain,
    motions: &[StageMotion],
    reversed: &[bool],
    (s, member, rotor): (usize, &Member, Expr),
    matrix: &mut [Expr],
) {
    // About the chain's z, which the joints of its own stage do not turn.
    let mut wheel = Share::NONE;
    wheel.add_wheel(b, rotor, &motions[s]);
    let n = reversed.len();
    let (mut row, mut column) = (vec![Expr::ZERO; n], vec![Expr::ZERO; n]);
    let inner = (&chain.stages[..s], &motions[..s]);
    project(b, inner, chain.form.link_to_link, &chain.stages[s], wheel, |j, upper, lower| {
        let sign = |x: Expr| if reversed[j] { -x } else { x };
        (column[j], row[j]) = (sign(upper), sign(lower));
    });
    add_coupled(b, member, Expr::ZERO, (&row, &column), matrix);
}

/// The stage's own entries for its joints from those for its links: a joint moves its link and all after it.
fn fill_own(b: &Builder, stage: &Stage, own: &[Expr], n: usize, matrix: &mut [Expr]) {
    let count = stage.members.len();
    let mut below = vec![Expr::ZERO; count];
    for i in (0..count).rev() {
        let mut row = Expr::ZERO;
        for j in (0..count).rev() {
            row = b.add(&row, &own[i * count + j]);
            below[j] = b.add(&below[j], &row);
            matrix[stage.members[i].joint * n + stage.members[j].joint] = below[j];
        }
    }
}

/// The rate of change of a joint's axis z: ω×z, in a frame that has it as z.
fn axis_rate(omega: &Vector) -> Vector {
    [omega[1], -omega[0], Expr::ZERO]
}

/// The shares of a stage's coordinates about its first origin in the axes before it, its own entries of C,
/// and the composite of all links from it on.
fn revolute(
    b: &Builder,
    chain: &Chain,
    stage: &Stage,
    motion: &StageMotion,
    bodies: &[LinkBody],
    outer: &Moving,
) -> (Vec<Share>, Vec<Expr>, Moving) {
    let count = stage.members.len();
    let pieces = pieces(b, chain, stage, bodies);
    let mut own = vec![Expr::ZERO; count * count];
    let mut shares = vec![Share::NONE; count];
    let mut composite = outer.clone();
    for (k, piece) in pieces.iter().enumerate().rev() {
        let end_mass = bodies[stage.members[k].joint].end_mass;
        let omega = seen_omega(b, chain, motion, k, count);
        let reach = &piece.reach;
        let rate = b.cross(&omega, reach);
        let rest = Moving { body: with_mass(b, &composite.body, end_mass), ..composite };
        let link = Moving::of_link(b, &piece.moments, &omega);
        composite = link.plus(b, &rest.shifted(b, reach, &rate));
        let z_rate = axis_rate(&omega);
        if k + 1 == count {
            shares[k] = composite.share(b, stage.kind, &z_rate);
        } else {
            let mass = Moving { body: with_mass(b, &Moments::none(b), rest.body.mass), ..Moving::none(b) };
            let carried = link.plus(b, &mass.shifted(b, reach, &rate));
            shares[k] = carried.share(b, stage.kind, &z_rate);
        }
        own[k * count + k] = shares[k].column.moment[2];
        // t = z×p and its rate, which all beyond shares.
        let t = z_cross(reach);
        let t_rate = plus(b, &b.cross(&z_rate, reach), &z_cross(&rate));
        for l in k + 1..count {
            own[k * count + l] = lever(b, reach, &shares[l].column.force);
            own[l * count + k] = b.dot(&shares[l].row.force, &t_rate);
            shares[l] = shares[l].shifted(b, reach, &rate);
        }
        if k + 1 < count {
            let own = &mut shares[k];
            own.column.moment = plus(b, &own.column.moment, &b.cross(&rest.body.first, &t_rate));
            own.row.moment = plus(b, &own.row.moment, &b.cross(&rest.body.first, &t));
            own.drift = plus(b, &own.drift, &b.cross(&rest.momentum, &t));
        }
        let (sin, cos) = piece.step;
        composite = composite.turned(b, |v| back_z(b, piece.step, v), |m| m.turned_back_z(b, &sin, &cos));
        for share in &mut shares[k..] {
            *share = share.turned(|v| back_z(b, piece.step, v));
        }
    }
    for l in 0..count {
        let column = (0..count).rev().fold(Expr::ZERO, |sum, k| b.add(&sum, &own[k * count + l]));
        shares[l].column.moment[2] = column;
    }
    (shares, own, composite)
}

/// A member's angular velocity in the axes in which its piece is seen.
fn seen_omega(b: &Builder, chain: &Chain, motion: &StageMotion, k: usize, count: usize) -> Vector {
    if chain.form.link_to_link || k + 1 == count {
        return motion.links[k].spin.omega;
    }
    let [x, y, z] = motion.before.omega;
    [x, y, b.add(&z, &motion.velocities[k])]
}

fn prismatic(
    b: &Builder,
    stage: &Stage,
    motion: &StageMotion,
    bodies: &[LinkBody],
    outer: &Moving,
) -> (Vec<Share>, Vec<Expr>, Moving) {
    let member = &stage.members[0];
    let omega = motion.links[0].spin.omega;
    let rest = Moving { body: with_mass(b, &outer.body, bodies[member.joint].end_mass), ..outer.clone() };
    let rate = b.cross(&omega, &member.reach);
    let link = Moving::of_link(b, &bodies[member.joint].moments, &omega);
    let composite = link.plus(b, &rest.shifted(b, &member.reach, &rate));
    let (sin, cos) = member.angle;
    let at_link = composite.turned(b, |v| back_z(b, member.angle, v), |m| m.turned_back_z(b, &sin, &cos));
    let share = at_link.share(b, stage.kind, &axis_rate(&motion.before.omega));
    let shift = [Expr::ZERO, Expr::ZERO, stage.shift];
    let mut shift_rate = b.cross(&motion.before.omega, &shift);
    shift_rate[2] = b.add(&shift_rate[2], &motion.velocities[0]);
    let own = vec![share.column.force[2]];
    (vec![share.shifted(b, &shift, &shift_rate)], own, at_link.shifted(b, &shift, &shift_rate))
}

/// Carries a share from a stage's first origin, in the axes before the stage, inwards and reports C_ji and
/// C_ij.
fn project(
    b: &Builder,
    (stages, motions): (&[Stage], &[StageMotion]),
    link_to_link: bool,
    from: &Stage,
    share: Share,
    mut entry: impl FnMut(usize, Expr, Expr),
) {
    let mut share = share.turned(|v| back_x(b, from.twist, v));
    for (stage, motion) in stages.iter().zip(motions).rev() {
        let count = stage.members.len();
        let (mut upper, mut lower) = (Expr::ZERO, Expr::ZERO);
        for (k, member) in stage.members.iter().enumerate().rev() {
            let before_stage = !link_to_link && k + 1 < count;
            let reach = if before_stage { stage.reach_before(b, k) } else { member.reach };
            let omega = match before_stage {
                false => motion.links[k].spin.omega,
                true => {
                    let [x, y, z] = motion.before.omega;
                    [x, y, b.add(&z, &motion.velocities[k])]
                }
            };
            let (rate, z_rate) = (b.cross(&omega, &reach), axis_rate(&omega));
            let carried = share.shifted(b, &reach, &rate);
            let own = match stage.kind {
                JointKind::Revolute if k + 1 == count => {
                    let row = b.add(&b.dot(&z_rate, &carried.row.moment), &carried.drift[2]);
                    (carried.column.moment[2], row)
                }
                JointKind::Revolute => {
                    let t_rate = plus(b, &b.cross(&z_rate, &reach), &z_cross(&rate));
                    (lever(b, &reach, &share.column.force), b.dot(&share.row.force, &t_rate))
                }
                JointKind::Prismatic => (carried.column.force[2], b.dot(&z_rate, &carried.row.force)),
            };
            (upper, lower) = (b.add(&upper, &own.0), b.add(&lower, &own.1));
            entry(member.joint, upper, lower);
            let turn = match (before_stage, link_to_link) {
                (true, _) => STRAIGHT,
                (false, true) => member.step,
                (false, false) => member.angle,
            };
            share = carried.turned(|v| back_z(b, turn, v));
        }
        match stage.kind {
            JointKind::Revolute => share.column.moment[2] = upper,
            JointKind::Prismatic => {
                let shift = [Expr::ZERO, Expr::ZERO, stage.shift];
                let mut rate = b.cross(&motion.before.omega, &shift);
                rate[2] = b.add(&rate[2], &motion.velocities[0]);
                share = share.shifted(b, &shift, &rate);
            }
        }
        share = share.turned(|v| back_x(b, stage.twist, v));
    }
}

impl Moving {
    fn none(b: &Builder) -> Moving {
        Moving { body: Moments::none(b), momentum: ZERO, spread: [ZERO; 3] }
    }

    /// A link that turns about its origin: Q = ω×s and K = [ω×] J.
    fn of_link(b: &Builder, body: &Moments<Expr>, omega: &Vector) -> Moving {
        let [xx, yy, zz] = body.square;
        let [yz, xz, xy] = body.mixed;
        let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|column| b.cross(omega, &column));
        Moving {
            body: body.clone(),
            momentum: b.cross(omega, &body.first),
            spread: std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i])),
        }
    }

    fn plus(&self, b: &Builder, other: &Moving) -> Moving {
        Moving {
            body: self.body.plus(b, &other.body),
            momentum: plus(b, &self.momentum, &other.momentum),
            spread: std::array::from_fn(|i| plus(b, &self.spread[i], &other.spread[i])),
        }
    }

    fn turned(
        &self,
        _: &Builder,
        turn: impl Fn(&Vector) -> Vector,
        body: impl Fn(&Moments<Expr>) -> Moments<Expr>,
    ) -> Moving {
        Moving {
            body: body(&self.body),
            momentum: turn(&self.momentum),
            spread: turned_tensor(&self.spread, turn),
        }
    }

    /// About the origin of a frame in which this one's lies at p and moves by ṗ: Q + m ṗ, and K + Q pᵀ + ṗ (s
    /// + m p)ᵀ.
    fn shifted(&self, b: &Builder, p: &Vector, rate: &Vector) -> Moving {
        let body = self.body.shifted(b, p);
        let spread = std::array::from_fn(|i| {
            let carried = plus(b, &self.spread[i], &scaled(b, self.momentum[i], p));
            plus(b, &carried, &scaled(b, rate[i], &body.first))
        });
        let momentum = plus(b, &self.momentum, &scaled(b, self.body.mass, rate));
        Moving { body, momentum, spread }
    }

    /// (tr K − K)·z, or (tr K − Kᵀ)·z.
    fn spread_times_z(&self, b: &Builder, transposed: bool) -> Vector {
        let k = &self.spread;
        let (x, y) = if transposed { (k[2][0], k[2][1]) } else { (k[0][2], k[1][2]) };
        [-x, -y, b.add(&k[0][0], &k[1][1])]
    }

    /// The contribution of a coordinate that turns all of it about z, or moves it along z.
    fn share(&self, b: &Builder, kind: JointKind, z_rate: &Vector) -> Share {
        let s = &self.body.first;
        let row = unit_momentum(b, &self.body, kind);
        match kind {
            JointKind::Revolute => {
                let (turned, carried) = (b.cross(z_rate, s), z_cross(&self.momentum));
                let (inertia, spread) = (self.body.inertia_times(b, z_rate), self.spread_times_z(b, false));
                let column = Wrench { force: plus(b, &turned, &carried), moment: plus(b, &inertia, &spread) };
                Share { column, row, drift: self.spread_times_z(b, true) }
            }
            JointKind::Prismatic => {
                let column = Wrench { force: scaled(b, self.body.mass, z_rate), moment: b.cross(s, z_rate) };
                Share { column, row, drift: z_cross(&self.momentum).map(|x| -x) }
            }
        }
    }

    /// A wheel of inertia κ on the link before that turns about z: what ½κ q̇ [z×] adds to K is what pairs of
    /// joints further in get of it, ½κ q̇ᵢ zⱼ·(zₗ×zᵢ).
    fn add_wheel(&mut self, b: &Builder, wheel: Expr, velocity: Expr) {
        let spin = b.mul(&half(b, wheel), &velocity);
        self.spread[1][0] = b.add(&self.spread[1][0], &spin);
        self.spread[0][1] = b.sub(&self.spread[0][1], &spin);
    }
}

fn half(b: &Builder, x: Expr) -> Expr {
    b.mul(&b.constant(&rational::ratio(1, 2)), &x)
}

impl Share {
    const NONE: Share = Share { column: Wrench::NONE, row: Wrench::NONE, drift: ZERO };

    fn plus(&self, b: &Builder, other: &Share) -> Share {
        Share {
            column: self.column.plus(b, &other.column),
            row: self.row.plus(b, &other.row),
            drift: plus(b, &self.drift, &other.drift),
        }
    }

    fn turned(&self, turn: impl Fn(&Vector) -> Vector) -> Share {
        let of = |w: &Wrench| Wrench { force: turn(&w.force), moment: turn(&w.moment) };
        Share { column: of(&self.column), row: of(&self.row), drift: turn(&self.drift) }
    }

    /// About the origin of a frame in which this one's lies at p and moves by ṗ. ẏⱼ seen from the new origin
    /// is ẏⱼ + żⱼ×p + zⱼ×ṗ, so the drift gains ṗ × force.
    fn shifted(&self, b: &Builder, p: &Vector, rate: &Vector) -> Share {
        Share {
            column: self.column.shifted(b, p),
            row: self.row.shifted(b, p),
            drift: plus(b, &self.drift, &b.cross(rate, &self.row.force)),
        }
    }

    /// A wheel of inertia κ on the link before: C_ij and C_ji get ½κ(ω×zᵢ)·zⱼ, C_ij also κ zᵢ·żⱼ.
    fn add_wheel(&mut self, b: &Builder, wheel: Expr, motion: &StageMotion) {
        let turning = scaled(b, half(b, wheel), &axis_rate(&motion.before.omega));
        self.column.moment = plus(b, &self.column.moment, &turning);
        self.drift = plus(b, &self.drift, &turning);
        self.row.moment[2] = b.add(&self.row.moment[2], &wheel);
    }
}
