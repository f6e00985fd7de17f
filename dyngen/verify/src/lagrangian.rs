//! The Lagrangian of an arm, body by body: L = Σ ½·tr(Ṫ·J·Ṫᵀ) + gᵀ·T·(first moments), where T is the
//! transform of a body's frame and J holds its second moments, linear in its parameters.
//!
//! So ∂L/∂q̇ and ∂L/∂q are traces of derivatives of T, and the Euler–Lagrange equations are τⱼ = Σ
//! tr(∂T/∂qⱼ·J·T̈ᵀ) − gᵀ·∂T/∂qⱼ·(first moments): of d/dt ∂L/∂q̇ⱼ − ∂L/∂qⱼ the terms with one time derivative
//! cancel. T is evaluated with infinitesimals, so that its derivatives are exact.

use crate::angles::{Affine, Circle, of_joint, residue};
use crate::dual::Dual;
use crate::linkage;
use dyngen_arm::arm::{Arm, Bar, Convention, Hinge, JointKind, Placement};
use dyngen_arm::exact::prime::Fp;
use dyngen_arm::exact::rational::Rational;

/// Infinitesimals of a first and a second direction of motion: their product has accelerations.
pub(crate) const FIRST: usize = 1;
/// See [`FIRST`].
pub(crate) const SECOND: usize = 2;
/// The infinitesimal of a virtual displacement.
pub(crate) const VIRTUAL: usize = 4;
/// Further directions of derivatives.
pub(crate) const DIRECTIONS: [usize; 2] = [8, 16];

/// A frame in another: its axes and its origin.
#[derive(Clone, Debug)]
pub(crate) struct Frame(pub(crate) [[Dual; 3]; 4]);

/// The index of the origin behind the axes.
pub(crate) const ORIGIN: usize = 3;

impl Frame {
    fn same() -> Frame {
        let one = |is: bool| Dual::number(if is { Fp::ONE } else { Fp::ZERO });
        Frame(std::array::from_fn(|a| std::array::from_fn(|i| one(a == i))))
    }

    /// Turns about its own axis, by sine and cosine.
    fn turn(&mut self, axis: usize, (sine, cosine): &(Dual, Dual)) {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        for row in 0..3 {
            let (x, y) = (&self.0[i][row], &self.0[j][row]);
            let turned = [&(cosine * x) + &(sine * y), &(cosine * y) - &(sine * x)];
            [self.0[i][row], self.0[j][row]] = turned;
        }
    }

    /// Moves along its own axis.
    fn shift(&mut self, axis: usize, by: &Dual) {
        for row in 0..3 {
            self.0[ORIGIN][row] = &self.0[ORIGIN][row] + &(by * &self.0[axis][row]);
        }
    }

    fn constant_turn(&mut self, axis: usize, (s, c): (Fp, Fp)) {
        self.turn(axis, &(Dual::number(s), Dual::number(c)));
    }

    fn constant_shift(&mut self, by: &[Rational]) {
        by.iter().enumerate().for_each(|(axis, x)| self.shift(axis, &Dual::number(residue(x))));
    }

    /// A frame that is fixed in this one: a shift, then Rz(yaw)·Ry(pitch)·Rx(roll).
    fn placed(mut self, circle: &Circle, placement: Option<&Placement>) -> Frame {
        if let Some(placement) = placement {
            self.constant_shift(&placement.xyz);
            (0..3).rev().for_each(|axis| self.constant_turn(axis, circle.of_constant(&placement.rpy[axis])));
        }
        self
    }

    /// Velocity of the origin and angular velocity, linear in one infinitesimal: of Ṙ·Rᵀ.
    pub(crate) fn twist(&self, by: usize) -> [Dual; 6] {
        let spin = |i: usize, j: usize| {
            let term = |a: usize| &self.0[a][i].by(by) * &self.0[a][j];
            &(&term(0) + &term(1)) + &term(2)
        };
        let [x, y, z] = self.0[ORIGIN].each_ref().map(|x| x.by(by));
        [x, y, z, spin(2, 1), spin(0, 2), spin(1, 0)]
    }
}

/// A body: what its eleven parameters multiply.
pub(crate) struct Body {
    /// Its frame, of which the ten inertial parameters are.
    pub(crate) frame: Frame,
    /// The rotor of its joint: the frame on the axis in the link before, and that frame turned with the
    /// motor.
    pub(crate) rotor: Option<[Frame; 2]>,
}

/// An arm whose coordinates change by infinitesimals.
pub(crate) struct Chain<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) circle: &'a Circle,
    /// Coordinates as numbers.
    pub(crate) q: &'a [Fp],
    /// The change of each coordinate.
    pub(crate) change: Vec<Dual>,
}

impl Chain<'_> {
    /// What follows the coordinates with some factors: the sum of these factors with their changes.
    fn changed(&self, by: &Affine) -> Dual {
        let term =
            |(coordinate, factor): (&usize, &Rational)| self.change[*coordinate].times(residue(factor));
        by.of.iter().fold(Dual::number(Fp::ZERO), |sum, pair| &sum + &term(pair))
    }

    /// The frames of the bodies and of the tool: in frame 0, or in the root link, where the base stands in
    /// it.
    pub(crate) fn bodies(&self, in_root: bool) -> (Vec<Body>, Frame) {
        let Chain { arm, circle, .. } = self;
        let start = Frame::same().placed(circle, arm.base.as_ref().filter(|_| in_root));
        let mut frame = start.clone();
        let mut bodies: Vec<Body> = Vec::new();
        for (i, joint) in arm.joints.iter().enumerate() {
            let twist = |frame: &mut Frame| {
                frame.constant_shift(&[joint.a.clone(), joint.b.clone()]);
                frame.constant_turn(0, circle.of_constant(&joint.alpha));
            };
            if arm.convention == Convention::Modified {
                twist(&mut frame);
            }
            let rotor = joint.rotor_ratio.as_ref().map(|ratio| self.rotor(i, ratio, &frame));
            self.advance(i, &mut frame);
            if arm.convention == Convention::Standard {
                twist(&mut frame);
            }
            bodies.push(Body { frame: frame.clone(), rotor });
        }
        let of = |link: Option<usize>| link.map_or(&start, |link| &bodies[link].frame);
        let bar = |bar: &Bar| {
            if let Some(hinge) = &bar.hinge {
                return Body { frame: self.hinged(of(bar.carrier).clone(), bar, hinge), rotor: None };
            }
            let (mut pin, mut frame) = (of(bar.carrier).clone(), of(bar.parallel).clone());
            pin.constant_shift(&bar.pin);
            frame.0[ORIGIN] = pin.0[ORIGIN].clone();
            Body { frame, rotor: None }
        };
        let bars: Vec<Body> = arm.bars.iter().map(bar).collect();
        let tool = of(Some(arm.tool_carrier())).clone().placed(circle, arm.tool.as_ref());
        bodies.extend(bars);
        (bodies, tool)
    }

    /// The frame of a bar that turns on a link.
    fn hinged(&self, mut link: Frame, bar: &Bar, hinge: &Hinge) -> Frame {
        let joint = hinge.linkage.joint;
        link.constant_shift(&bar.pin);
        if let Some(back) = linkage::twist(self.arm.convention, hinge) {
            let (sine, cosine) = self.circle.of_constant(&self.arm.joints[joint].alpha);
            link.constant_turn(0, (if back { -sine } else { sine }, cosine));
        }
        link.turn(2, &linkage::turn(hinge, &self.turned(joint)));
        link
    }

    /// Sine and cosine of the angle of a joint that turns.
    fn turned(&self, joint: usize) -> (Dual, Dual) {
        let position = of_joint(self.arm, joint);
        // `Verifier::new` has seen that every angle of a joint has a sine.
        let at = self.circle.sine_and_cosine(&position).unwrap_or((Fp::ZERO, Fp::ZERO));
        self.changed(&position).sine_and_cosine(at)
    }

    /// The joint's own motion: about its axis or along it.
    fn advance(&self, joint: usize, frame: &mut Frame) {
        let row = &self.arm.joints[joint];
        let position = of_joint(self.arm, joint);
        let change = self.changed(&position);
        let d = Dual::number(residue(&row.d));
        match row.kind {
            JointKind::Revolute => {
                frame.turn(2, &self.turned(joint));
                frame.shift(2, &d);
            }
            JointKind::Prismatic => {
                let at = position.of.iter().fold(residue(&position.radians), |sum, (coordinate, factor)| {
                    sum + residue(factor) * self.q[*coordinate]
                });
                frame.constant_turn(2, self.circle.of_constant(&row.theta));
                frame.shift(2, &(&(&d + &Dual::number(at)) + &change));
            }
        }
    }

    /// A frame on a joint's axis, and the same turned with the motor: by the gear ratio times what the motor
    /// turns on the joint's side of its gear. Where the motor stands does not matter, since a rotor is round.
    fn rotor(&self, joint: usize, ratio: &Rational, axis: &Frame) -> [Frame; 2] {
        let row = self.arm.coupled_motor(joint).unwrap_or(vec![(joint, Rational::ONE)]);
        let turned = row.iter().fold(Affine::default(), |sum, (joint, factor)| {
            sum.plus(&(ratio * factor), &of_joint(self.arm, *joint))
        });
        let mut rotor = axis.clone();
        rotor.turn(2, &self.changed(&turned).sine_and_cosine((Fp::ZERO, Fp::ONE)));
        [axis.clone(), rotor]
    }
}

/// What the ten inertial parameters multiply in Σ J_ab·product(a, b), in the order m, mx, my, mz, Ixx, Ixy,
/// Ixz, Iyy, Iyz, Izz.
pub(crate) fn inertial(product: impl Fn(usize, usize) -> Dual) -> Vec<Dual> {
    let both = |a: usize, b: usize| &product(a, b) + &product(b, a);
    let half = Fp::from_integer(2).inverse().unwrap_or(Fp::ZERO);
    let [x, y, z] = [0, 1, 2].map(|a| product(a, a));
    // ∫x² = (Iyy + Izz − Ixx)/2
    let moment = |minus: &Dual, one: &Dual, other: &Dual| (&(one + other) - minus).times(half);
    vec![
        product(ORIGIN, ORIGIN),
        both(0, ORIGIN),
        both(1, ORIGIN),
        both(2, ORIGIN),
        moment(&x, &y, &z),
        both(0, 1),
        both(0, 2),
        moment(&y, &z, &x),
        both(1, 2),
        moment(&z, &x, &y),
    ]
}

/// What the first moments multiply: mass and mx, my, mz of the ten.
pub(crate) fn first_moments(of: impl Fn(usize) -> Dual) -> Vec<Dual> {
    let zero = Dual::number(Fp::ZERO);
    let moments = [ORIGIN, 0, 1, 2].map(of);
    moments.into_iter().chain(std::iter::repeat_n(zero, 6)).collect()
}

impl Body {
    /// What its eleven parameters multiply in Σ J_ab·product(frame, a, b). A rotor has Izz alone, and of it
    /// the link has what does not turn with the motor.
    pub(crate) fn columns(&self, product: impl Fn(&Frame, usize, usize) -> Dual) -> Vec<Dual> {
        let of = |frame: &Frame| inertial(|a, b| product(frame, a, b));
        let mut columns = of(&self.frame);
        columns.push(match &self.rotor {
            Some([axis, rotor]) => &of(rotor)[9] - &of(axis)[9],
            None => Dual::number(Fp::ZERO),
        });
        columns
    }
}
