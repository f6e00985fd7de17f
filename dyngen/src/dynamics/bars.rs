//! Bars of closed loops on the chain.
//!
//! A bar's origin is a point of one link, and it turns with another. So its force acts on the one link at the
//! pin, and its moment on the other: v·f + ω·n is its power, whatever moves. The forces in its pins never
//! appear. With these two wrenches the recursion gives the torques of bars; the matrices follow from it
//! column by column.
//!
//! A bar of a linkage turns on the link that carries its pin, at ρ(q)·q̇ about the axis of the linkage's
//! joint. Its whole wrench acts on that link, and ρ times the moment about the axis on the joint.

use super::body::{Vector, ZERO};
use super::chain::LinkGeometry;
use super::inverse::{moments_wrench, newton_euler};
use super::moments::{ENTRIES, Moments};
use super::momentum::kinetic_energy;
use super::motion::{Drive, LinkMotion, StageMotion};
use super::regroup::LinkBody;
use super::spin::Spin;
use super::stage::{Chain, Member, STRAIGHT, SinCos, Stage, back_x, back_z, plus};
use super::wrench::Wrench;
use crate::exact::algebra::Algebra;
use crate::exact::rational;
use crate::graph::{Builder, Expr, differentiate};
use crate::lagrangian::bars::{BarElements, HingeElements};
use crate::lagrangian::elements::{turn_x, turn_z};

/// A bar in the axes of the chain.
#[derive(Clone, Debug)]
pub struct BarBody {
    /// The link that carries its pin; `None` is the base.
    carrier: Option<usize>,
    /// The pin in that link's axes.
    pin: Vector,
    /// The link that it turns with; `None` is the base.
    parallel: Option<usize>,
    /// From the chain's axes of that link to the file's: about x, and about z where the chain turns the last
    /// link back.
    file_turn: SinCos,
    last_turn: SinCos,
    /// How it turns on that link, where it does.
    hinge: Option<Hinge>,
    /// The bar's body about the pin, in the chain's axes of the link that it turns with; where it has a hinge
    /// in those axes turned so that z is the hinge's axis.
    moments: Moments<Expr>,
}

/// A bar's own turn on a link.
#[derive(Clone, Debug)]
struct Hinge {
    /// The joint that turns it.
    joint: usize,
    /// The turn about x from the chain's axes of the link to those whose z is the axis.
    twist: SinCos,
    /// Whether that z points against the joint's axis.
    reversed: bool,
    /// From there to the bar's axes, seen about the joint's axis.
    turn: SinCos,
    /// Derivatives of the bar's angle by the joint's, about that z.
    rate: Expr,
    bend: Expr,
}

impl Hinge {
    fn new(links: &[LinkGeometry<Expr>], hinge: &HingeElements<Expr>) -> Hinge {
        let HingeElements { joint, rocker, ref turn, .. } = *hinge;
        let reversed = links[joint].reversed;
        let signed = |x: Expr| if reversed { -x } else { x };
        Hinge {
            joint,
            // Links behind the joint have its axis.
            twist: if rocker { links[joint].twist } else { STRAIGHT },
            reversed,
            turn: (turn.sin, turn.cos),
            rate: signed(turn.rate),
            bend: signed(turn.bend),
        }
    }

    /// How a bar moves on a link that moves.
    fn on(&self, b: &Builder, link: &LinkMotion, drive: &Drive) -> LinkMotion {
        let Hinge { joint, twist: (sin, cos), rate, bend, .. } = *self;
        let [velocity, reference, acceleration] =
            [&drive.velocities, &drive.reference, &drive.accelerations].map(|rates| rates[joint]);
        let of_speed = b.mul(&bend, &b.mul(&velocity, &reference));
        let acceleration = b.add(&b.mul(&rate, &acceleration), &of_speed);
        let [velocity, reference] = [velocity, reference].map(|speed| b.mul(&rate, &speed));
        let spin = link.spin.turned_x(b, self.twist).joined(b, STRAIGHT, velocity, reference, acceleration);
        LinkMotion { spin, acceleration: turn_x(b, &sin, &cos, &link.acceleration), next: ZERO }
    }
}

impl BarBody {
    /// A bar without a body.
    pub fn new(b: &Builder, chain: &Chain, links: &[LinkGeometry<Expr>], bar: &BarElements<Expr>) -> BarBody {
        let last_turn = |link: Option<usize>| match link {
            Some(link) if link + 1 == chain.dof() => chain.last_turn,
            _ => STRAIGHT,
        };
        let pin = bar.carrier.map_or(bar.pin, |carrier| {
            let LinkGeometry { file_turn, file_origin, .. } = &links[carrier];
            let in_chain = plus(b, file_origin, &back_x(b, *file_turn, &bar.pin));
            back_z(b, last_turn(bar.carrier), &in_chain)
        });
        let file_turn = bar.parallel.map_or(STRAIGHT, |link| links[link].file_turn);
        let (carrier, parallel, last_turn) = (bar.carrier, bar.parallel, last_turn(bar.parallel));
        let hinge = bar.hinge.as_ref().map(|hinge| Hinge::new(links, hinge));
        BarBody { carrier, pin, parallel, file_turn, last_turn, hinge, moments: Moments::none(b) }
    }

    /// This bar with the ten inertial parameters of its body.
    pub fn carrying(&self, b: &Builder, parameters: &[Expr; ENTRIES]) -> BarBody {
        let half = b.constant(&rational::ratio(1, 2));
        let ((s, c), (t, d)) = (self.file_turn, self.last_turn);
        let body = Moments::of_parameters(b, &half, parameters);
        let body = match &self.hinge {
            None => body.turned_back_x(b, &s, &c),
            Some(Hinge { turn: (sin, cos), reversed, .. }) => {
                let body = body.turned_back_z(b, sin, cos);
                if *reversed { body.turned_back_x(b, &Expr::ZERO, &-Expr::ONE) } else { body }
            }
        };
        BarBody { moments: body.turned_back_z(b, &t, &d), ..self.clone() }
    }

    /// This bar with a body of which one parameter is 1, all others 0.
    pub fn unit(&self, b: &Builder, parameter: usize) -> BarBody {
        self.carrying(b, &std::array::from_fn(|i| b.integer(i64::from(i == parameter))))
    }
}

/// What bars exert on each link about its origin, in its axes, and on each joint.
pub fn wrenches(
    b: &Builder,
    chain: &Chain,
    motions: &[StageMotion],
    drive: &Drive,
) -> (Vec<Wrench>, Vec<Expr>) {
    let mut sums = vec![Wrench::NONE; chain.dof()];
    let mut torques = vec![Expr::ZERO; chain.dof()];
    let motion = |link: Option<usize>| match link.and_then(|link| place(chain, link)) {
        Some((s, k)) => motions[s].links[k],
        None => {
            let acceleration = if drive.gravity { chain.gravity.map(|g| -g) } else { ZERO };
            LinkMotion { spin: Spin::REST, acceleration, next: ZERO }
        }
    };
    for bar in chain.bars.iter().filter(|bar| bar.moments.entries().iter().any(|x| *x != Expr::ZERO)) {
        let (carrier, parallel) = (motion(bar.carrier), motion(bar.parallel));
        let of_pin = plus(b, &carrier.acceleration, &carrier.spin.times(b, &bar.pin));
        let acceleration = turned(b, chain, &of_pin, bar.carrier, bar.parallel);
        let with = LinkMotion { acceleration, ..parallel };
        let own = match &bar.hinge {
            None => moments_wrench(b, &bar.moments, &with),
            Some(hinge) => {
                let own = moments_wrench(b, &bar.moments, &hinge.on(b, &with, drive));
                let torque = &mut torques[hinge.joint];
                *torque = b.add(torque, &b.mul(&hinge.rate, &own.moment[2]));
                own.turned_back_x(b, hinge.twist)
            }
        };
        if let Some(link) = bar.carrier {
            let force = turned(b, chain, &own.force, bar.parallel, bar.carrier);
            let at_pin = Wrench { force, moment: ZERO }.shifted(b, &bar.pin);
            sums[link] = sums[link].plus(b, &at_pin);
        }
        if let Some(link) = bar.parallel {
            sums[link] = sums[link].plus(b, &Wrench { force: ZERO, moment: own.moment });
        }
    }
    (sums, torques)
}

/// Stage and member of a link.
fn place(chain: &Chain, link: usize) -> Option<(usize, usize)> {
    let member = |stage: &Stage| stage.members.iter().position(|m| m.joint == link);
    chain.stages.iter().enumerate().find_map(|(s, stage)| Some((s, member(stage)?)))
}

/// A vector in the axes of one link, given in those of another; `None` is the base.
fn turned(b: &Builder, chain: &Chain, v: &Vector, from: Option<usize>, to: Option<usize>) -> Vector {
    if from == to {
        return *v;
    }
    let at = |link: Option<usize>| link.and_then(|link| place(chain, link));
    let member = |s: usize, k: usize| -> &Member { &chain.stages[s].members[k] };
    let turn = |(sin, cos): SinCos, v: &Vector| turn_z(b, &sin, &cos, v);
    let before = |s: usize| chain.stages[..s].last().and_then(|stage| Some(stage.members.last()?.joint));
    match (at(from), at(to)) {
        (Some((s, k)), Some((t, l))) if s == t && k + 1 == l => turn(member(t, l).step, v),
        (Some((s, k)), Some((t, l))) if s == t && l + 1 == k => back_z(b, member(s, k).step, v),
        (Some((s, k)), Some((t, l))) if s == t => turn(member(t, l).angle, &back_z(b, member(s, k).angle, v)),
        (Some((s, k)), to_place) if to_place.is_none_or(|(t, _)| t < s) => {
            let inwards = back_x(b, chain.stages[s].twist, &back_z(b, member(s, k).angle, v));
            turned(b, chain, &inwards, before(s), to)
        }
        (_, Some((t, l))) => {
            let (sin, cos) = chain.stages[t].twist;
            let v = turned(b, chain, v, from, before(t));
            turn(member(t, l).angle, &turn_x(b, &sin, &cos, &v))
        }
        (_, None) => *v,
    }
}

/// The torques of the bars alone for a motion.
fn torques(b: &Builder, chain: &Chain, drive: &Drive) -> Vec<Expr> {
    newton_euler(b, chain, &massless(b, chain), drive).torques
}

fn massless(b: &Builder, chain: &Chain) -> Vec<LinkBody> {
    vec![LinkBody::none(b); chain.dof()]
}

fn unit(n: usize, j: usize) -> Vec<Expr> {
    (0..n).map(|i| if i == j { Expr::ONE } else { Expr::ZERO }).collect()
}

fn sum(b: &Builder, of_links: Vec<Expr>, of_bars: &[Expr]) -> Vec<Expr> {
    of_links.iter().zip(of_bars).map(|(x, y)| b.add(x, y)).collect()
}

/// Adds to a matrix of the links that of the bars, whose columns are the torques of motions.
fn add_columns(
    b: &Builder,
    chain: &Chain,
    matrix: Vec<Expr>,
    motion: impl Fn(Vec<Expr>) -> Drive,
) -> Vec<Expr> {
    if chain.bars.is_empty() {
        return matrix;
    }
    let n = chain.dof();
    let columns: Vec<Vec<Expr>> = (0..n).map(|j| torques(b, chain, &motion(unit(n, j)))).collect();
    let of_bars: Vec<Expr> = (0..n * n).map(|k| columns[k % n][k / n]).collect();
    sum(b, matrix, &of_bars)
}

/// B(q) of links and bars from that of the links.
pub fn mass_matrix(b: &Builder, chain: &Chain, of_links: Vec<Expr>) -> Vec<Expr> {
    let rest = vec![Expr::ZERO; chain.dof()];
    add_columns(b, chain, of_links, |accelerations| Drive {
        velocities: rest.clone(),
        reference: rest.clone(),
        accelerations,
        gravity: false,
    })
}

/// C(q, q̇) of links and bars from that of the links: its columns are C times a unit reference velocity.
pub fn coriolis_matrix(b: &Builder, chain: &Chain, velocities: &[Expr], of_links: Vec<Expr>) -> Vec<Expr> {
    let rest = vec![Expr::ZERO; chain.dof()];
    add_columns(b, chain, of_links, |reference| Drive {
        velocities: velocities.to_vec(),
        reference,
        accelerations: rest.clone(),
        gravity: false,
    })
}

/// g(q) of links and bars from that of the links.
pub fn gravity(b: &Builder, chain: &Chain, of_links: Vec<Expr>) -> Vec<Expr> {
    if chain.bars.is_empty() {
        return of_links;
    }
    let rest = vec![Expr::ZERO; chain.dof()];
    let drive =
        Drive { velocities: rest.clone(), reference: rest.clone(), accelerations: rest, gravity: true };
    sum(b, of_links, &torques(b, chain, &drive))
}

/// Cᵀ·q̇ of links and bars from that of the links: ∂T/∂q.
pub fn coriolis_transpose_times_velocity(
    b: &Builder,
    chain: &Chain,
    velocities: &[Expr],
    of_links: Vec<Expr>,
) -> Vec<Expr> {
    if chain.bars.is_empty() {
        return of_links;
    }
    let energy = kinetic_energy(b, chain, &massless(b, chain), velocities);
    let [by_position, _] = differentiate::gradient(b, energy, chain.dof());
    sum(b, of_links, &by_position)
}

/// The torques of a motion for a unit of a bar's parameter.
pub fn column(b: &Builder, chain: &Chain, bar: usize, parameter: usize, drive: &Drive) -> Vec<Expr> {
    let bars = vec![chain.bars[bar].unit(b, parameter)];
    torques(b, &Chain { bars, ..chain.clone() }, drive)
}
