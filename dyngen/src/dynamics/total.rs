//! The whole arm as one body: its centre of mass and its momentum, which depend on every parameter.
//!
//! Bodies are those of the arm file, not the sums that torques depend on: moving mass from one link to the
//! next keeps the torques but not the momentum.

use super::body::ZERO;
use super::composite::unit_momentum;
use super::moments::Moments;
use super::stage::{plus, scaled};
use super::wrench::Wrench;
use crate::arm::{Convention, Parameter, ParameterKind};
use crate::exact::algebra::Algebra;
use crate::exact::rational;
use crate::graph::{Builder, Expr};
use crate::lagrangian::bars::{BarElements, HingeElements, turned};
use crate::lagrangian::elements::{ArmElements, JointElements, PlacementElements};
use crate::lagrangian::{Motion, motions};

/// All links together, about the origin and in the axes of the root link.
pub(super) struct Total {
    /// The body of the arm in its pose.
    pub(super) body: Moments<Expr>,
    /// The momentum that a unit of each joint's velocity makes: linear as force, angular as moment.
    pub(super) momenta: Vec<Wrench>,
}

impl Total {
    /// From the values of the arm's parameters; `coupled` gives how fast a motor turns with each joint where
    /// its transmission has several.
    pub(super) fn build(
        b: &Builder,
        arm: &ArmElements<Expr>,
        base: &PlacementElements<Expr>,
        value: impl Fn(Parameter) -> Expr,
        coupled: impl Fn(usize) -> Option<Vec<(usize, Expr)>>,
    ) -> Total {
        let half = b.constant(&rational::ratio(1, 2));
        let body = |link: usize| {
            let of = |i: usize| value(Parameter { link, kind: ParameterKind::ALL[i] });
            Moments::of_parameters(b, &half, &std::array::from_fn(of))
        };
        let bars = || arm.bars.iter().zip(arm.joints.len()..).map(|(bar, link)| (bar, body(link)));
        let n = arm.joints.len();
        let mut total = Total { body: Moments::none(b), momenta: vec![Wrench::NONE; n] };
        for (i, joint) in arm.joints.iter().enumerate().rev() {
            total.body = total.body.plus(b, &body(i));
            if arm.convention == Convention::Standard {
                total.before_twist(b, joint);
            }
            total.before_screw(b, joint);
            total.momenta[i] = total.momenta[i].plus(b, &unit_momentum(b, &total.body, joint.kind));
            if let Some(ratio) = &joint.ratio {
                let spin = b.mul(ratio, &value(Parameter { link: i, kind: ParameterKind::Im }));
                for (j, factor) in coupled(i).unwrap_or_else(|| vec![(i, Expr::ONE)]) {
                    let moment = &mut total.momenta[j].moment[2];
                    *moment = b.add(moment, &b.mul(&factor, &spin));
                }
            }
            if arm.convention == Convention::Modified {
                total.before_twist(b, joint);
            }
        }
        for part in bars().flat_map(|(bar, body)| of_bar(b, arm, bar, &body)) {
            total.body = total.body.plus(b, &part.body);
            total.momenta = total.momenta.iter().zip(&part.momenta).map(|(x, y)| x.plus(b, y)).collect();
        }
        total.before_placement(b, base);
        total
    }

    /// From the frame of a link to frame 0.
    fn carried(mut self, b: &Builder, arm: &ArmElements<Expr>, link: Option<usize>) -> Total {
        for joint in arm.joints[..link.map_or(0, |link| link + 1)].iter().rev() {
            if arm.convention == Convention::Standard {
                self.before_twist(b, joint);
            }
            self.before_screw(b, joint);
            if arm.convention == Convention::Modified {
                self.before_twist(b, joint);
            }
        }
        self
    }

    /// Before Rz(θ) Tz(d).
    fn before_screw(&mut self, b: &Builder, joint: &JointElements<Expr>) {
        let shift = [Expr::ZERO, Expr::ZERO, joint.shift];
        self.body = self.body.turned_back_z(b, &joint.sin, &joint.cos).shifted(b, &shift);
        for momentum in &mut self.momenta {
            *momentum = momentum.turned_back_z(b, (joint.sin, joint.cos)).shifted(b, &shift);
        }
    }

    /// Before Tx(a) Ty(b) Rx(α).
    fn before_twist(&mut self, b: &Builder, joint: &JointElements<Expr>) {
        let shift = [joint.a, joint.b, Expr::ZERO];
        let twist = (joint.sin_alpha, joint.cos_alpha);
        self.body = self.body.turned_back_x(b, &twist.0, &twist.1).shifted(b, &shift);
        for momentum in &mut self.momenta {
            *momentum = momentum.turned_back_x(b, twist).shifted(b, &shift);
        }
    }

    /// Before a fixed placement.
    fn before_placement(&mut self, b: &Builder, frame: &PlacementElements<Expr>) {
        self.body = self.body.placed_back(b, frame);
        let [roll, pitch, yaw] = frame.rpy;
        for momentum in &mut self.momenta {
            let turned = momentum.turned_back_x(b, roll).turned_back_y(b, pitch).turned_back_z(b, yaw);
            *momentum = turned.shifted(b, &frame.origin);
        }
    }

    /// 6 × n: linear above angular.
    pub(super) fn matrix(&self) -> Vec<Expr> {
        let entry = |i: usize, momentum: &Wrench| match i {
            0..3 => momentum.force[i],
            _ => momentum.moment[i - 3],
        };
        (0..6).flat_map(|i| self.momenta.iter().map(move |m| entry(i, m))).collect()
    }
}

/// A bar in frame 0: what moves with its pin, and what turns with its parallel link.
fn of_bar(b: &Builder, arm: &ArmElements<Expr>, bar: &BarElements<Expr>, body: &Moments<Expr>) -> [Total; 2] {
    let body = &match &bar.hinge {
        Some(HingeElements { tilt: (s, c), turn, .. }) => {
            body.turned_back_z(b, &turn.sin, &turn.cos).turned_back_x(b, s, c)
        }
        None => body.clone(),
    };
    let momenta = (0..arm.joints.len()).map(|j| unit_momenta(b, arm, bar, body, j));
    let (of_pin, of_turn) = momenta.unzip();
    let none = Moments::none(b);
    let mass = Moments { mass: body.mass, ..none.clone() }.shifted(b, &bar.pin);
    let first = Moments { first: body.first, ..none };
    [
        Total { body: mass, momenta: of_pin }.carried(b, arm, bar.carrier),
        Total { body: first, momenta: of_turn }.carried(b, arm, bar.parallel),
    ]
}

/// A bar's momentum for a unit of a joint's velocity: m·v + ω×h at the pin on the link that carries it, I·ω +
/// h×v on the link that it turns with, each about that link's origin and in its axes.
fn unit_momenta(
    b: &Builder,
    arm: &ArmElements<Expr>,
    bar: &BarElements<Expr>,
    body: &Moments<Expr>,
    joint: usize,
) -> (Wrench, Wrench) {
    let mut moving = ArmElements { gravity: ZERO, ..arm.clone() };
    for (i, of) in moving.joints.iter_mut().enumerate() {
        of.velocity = if i == joint { Expr::ONE } else { Expr::ZERO };
    }
    let rest = Motion::base(b, &moving);
    let Motion { omega, velocity, .. } = bar.motion_at_pin(b, &moving, &rest, &motions(b, &moving));
    let linear = plus(b, &scaled(b, body.mass, &velocity), &b.cross(&omega, &body.first));
    let angular = plus(b, &body.inertia_times(b, &omega), &b.cross(&body.first, &velocity));
    let force = turned(b, arm, &linear, bar.parallel, bar.carrier);
    (Wrench { force, moment: ZERO }.shifted(b, &bar.pin), Wrench { force: ZERO, moment: angular })
}
