//! The quantities of an arm's kinematics as elements of an algebra.

use super::bars::{BarElements, HingeElements};
use super::linkage::BarTurns;
use crate::arm::{Angle, Arm, Bar, Convention, JointKind, Linkage, Placement};
use crate::exact::algebra::Algebra;
use crate::exact::rational::Rational;
use crate::exact::symbols::{AngleSymbols, Trig};

/// The arm's angles whose sine and cosine are not rational: twists and the fixed angles of prismatic joints
/// ([`joint_symbols`] of them), then those of the tool, the base and the other frames.
pub fn angle_symbols(arm: &Arm) -> AngleSymbols {
    let frames = arm.frames.iter().map(|frame| &frame.placement);
    let fixed = arm.tool.iter().chain(&arm.base).chain(frames).flat_map(|frame| &frame.rpy);
    AngleSymbols::collect(joint_angles(arm).chain(fixed))
}

/// How many of them are the joints', so that they take part in the dynamics.
pub fn joint_symbols(arm: &Arm) -> usize {
    AngleSymbols::collect(joint_angles(arm)).angles.len()
}

fn joint_angles(arm: &Arm) -> impl Iterator<Item = &Angle> {
    arm.joints.iter().flat_map(|joint| {
        let fixed = (joint.kind == JointKind::Prismatic).then_some(&joint.theta);
        std::iter::once(&joint.alpha).chain(fixed)
    })
}

/// One joint's quantities.
#[derive(Clone, Debug)]
pub struct JointElements<V> {
    /// How the joint moves.
    pub kind: JointKind,
    /// Sine of the angle about z: q + theta, or theta of a prismatic joint.
    pub sin: V,
    /// Cosine of that angle.
    pub cos: V,
    /// Shift along z: d, or d + q of a prismatic joint.
    pub shift: V,
    /// Joint velocity q̇.
    pub velocity: V,
    /// Velocity of the joint's motor on the joint's side of its gear: q̇ unless a transmission couples it.
    pub motor_velocity: V,
    /// Link length a.
    pub a: V,
    /// Offset b in addition to it, along y.
    pub b: V,
    /// Sine of the twist.
    pub sin_alpha: V,
    /// Cosine of the twist.
    pub cos_alpha: V,
    /// Gear ratio, where the joint has a rotor.
    pub ratio: Option<V>,
}

/// An arm's quantities.
#[derive(Clone, Debug)]
pub struct ArmElements<V> {
    /// Which convention orders the two screws of a joint.
    pub convention: Convention,
    /// Gravity in the base frame.
    pub gravity: [V; 3],
    /// The joints from the base.
    pub joints: Vec<JointElements<V>>,
    /// The bars of closed loops.
    pub bars: Vec<BarElements<V>>,
}

/// The place of a frame in another: the tool's in the last link's, frame 0's in the root link's.
#[derive(Clone, Debug)]
pub struct PlacementElements<V> {
    /// Origin of the placement.
    pub origin: [V; 3],
    /// Sine and cosine of roll, pitch and yaw.
    pub rpy: [(V, V); 3],
}

impl<V: Clone> PlacementElements<V> {
    /// Builds the elements of a placement; without a placement, those of the same frame.
    pub fn build<A: Algebra<Value = V>>(
        algebra: &A,
        placement: Option<&Placement>,
        symbols: &AngleSymbols,
        length: impl Fn(&Rational) -> V,
        symbol: impl Fn(usize, bool) -> V,
    ) -> Self {
        let Some(placement) = placement else {
            let (zero, one) = (algebra.integer(0), algebra.integer(1));
            return PlacementElements {
                origin: std::array::from_fn(|_| zero.clone()),
                rpy: std::array::from_fn(|_| (zero.clone(), one.clone())),
            };
        };
        let length = |x: &Rational| if x.is_zero() { algebra.integer(0) } else { length(x) };
        let turn = |angle: &Angle| {
            let (sin, cos) = symbols.sin_cos(angle);
            (
                constant(algebra, sin, &mut |i, s| symbol(i, s)),
                constant(algebra, cos, &mut |i, s| symbol(i, s)),
            )
        };
        let (origin, rpy) = (placement.xyz.each_ref().map(length), placement.rpy.each_ref().map(turn));
        PlacementElements { origin, rpy }
    }
}

/// A constant sine or cosine in an algebra; `symbol` gives those that are symbols.
fn constant<A: Algebra>(
    algebra: &A,
    trig: Trig,
    symbol: &mut dyn FnMut(usize, bool) -> A::Value,
) -> A::Value {
    match trig {
        Trig::Zero => algebra.integer(0),
        Trig::One { negative } => algebra.integer(if negative { -1 } else { 1 }),
        Trig::Symbol { index, sine, negative } => {
            let value = symbol(index, sine);
            if negative { algebra.neg(&value) } else { value }
        }
    }
}

/// The source of the elements: symbols, numbers, inputs of a graph.
pub trait Source<V> {
    /// Sine and cosine of q + theta of a revolute joint, which may follow another one.
    fn joint_trig(&mut self, joint: usize) -> (V, V);
    /// q of a prismatic joint.
    fn position(&mut self, joint: usize) -> V;
    /// q̇.
    fn velocity(&mut self, joint: usize) -> V;
    /// Link length; requested only if it is not zero.
    fn a(&mut self, joint: usize) -> V;
    /// Offset along y in addition to the link length; requested only if it is not zero.
    fn b(&mut self, joint: usize) -> V;
    /// Link offset; requested only if it is not zero.
    fn d(&mut self, joint: usize) -> V;
    /// Gear ratio.
    fn ratio(&mut self, joint: usize) -> V;
    /// A number of the arm that is none of its sizes: an entry of a transmission's matrix, a coordinate of
    /// the pin of a bar.
    fn exact(&mut self, value: &Rational) -> V;
    /// How rod and rocker of a linkage turn; `None` where the algebra has no roots, or none at this pose.
    fn linkage(&mut self, linkage: &Linkage) -> Option<BarTurns<V>>;
    /// Component of gravity; requested only if it is not zero.
    fn gravity(&mut self, axis: usize) -> V;
    /// Sine or cosine of an angle symbol.
    fn symbol(&mut self, index: usize, sine: bool) -> V;
}

impl<V: Clone> ArmElements<V> {
    /// Builds the elements of an arm.
    pub fn build<A: Algebra<Value = V>>(
        algebra: &A,
        arm: &Arm,
        symbols: &AngleSymbols,
        source: &mut impl Source<V>,
    ) -> Self {
        let mut joints = Vec::with_capacity(arm.links());
        for (i, joint) in arm.joints.iter().enumerate() {
            let d = if joint.d.is_zero() { algebra.integer(0) } else { source.d(i) };
            let (sin, cos, shift) = match joint.kind {
                JointKind::Revolute => {
                    let (sin, cos) = source.joint_trig(i);
                    (sin, cos, d)
                }
                JointKind::Prismatic => {
                    let (sin, cos) = symbols.sin_cos(&joint.theta);
                    let sin = constant(algebra, sin, &mut |m, s| source.symbol(m, s));
                    let cos = constant(algebra, cos, &mut |m, s| source.symbol(m, s));
                    (sin, cos, algebra.add(&d, &source.position(i)))
                }
            };
            let (sin_alpha, cos_alpha) = symbols.sin_cos(&joint.alpha);
            let velocity = source.velocity(i);
            joints.push(JointElements {
                kind: joint.kind,
                sin,
                cos,
                shift,
                velocity: velocity.clone(),
                motor_velocity: velocity,
                a: if joint.a.is_zero() { algebra.integer(0) } else { source.a(i) },
                b: if joint.b.is_zero() { algebra.integer(0) } else { source.b(i) },
                sin_alpha: constant(algebra, sin_alpha, &mut |m, s| source.symbol(m, s)),
                cos_alpha: constant(algebra, cos_alpha, &mut |m, s| source.symbol(m, s)),
                ratio: joint.rotor_ratio.is_some().then(|| source.ratio(i)),
            });
        }
        for motor in 0..joints.len() {
            if let Some(row) = arm.coupled_motor(motor) {
                let term = |(joint, factor): &(usize, Rational)| {
                    algebra.mul(&source.exact(factor), &joints[*joint].velocity)
                };
                let terms: Vec<V> = row.iter().map(term).collect();
                joints[motor].motor_velocity =
                    terms.iter().fold(algebra.integer(0), |sum, term| algebra.add(&sum, term));
            }
        }
        let gravity = std::array::from_fn(|axis| {
            if arm.gravity[axis].is_zero() { algebra.integer(0) } else { source.gravity(axis) }
        });
        // Of each linkage once: its bars share a root.
        let turns: Vec<(usize, Option<BarTurns<V>>)> =
            arm.linkages().map(|linkage| (linkage.joint, source.linkage(linkage))).collect();
        let bar = |bar: &Bar| BarElements {
            hinge: hinge(algebra, arm.convention, &joints, bar, &turns),
            ..BarElements::build(algebra, bar, &mut |x| source.exact(x))
        };
        let bars = arm.bars.iter().map(bar).collect();
        ArmElements { convention: arm.convention, gravity, joints, bars }
    }
}

/// A bar's own turn. Where its linkage has none the bar does not turn with anything, which no proof passes.
fn hinge<A: Algebra>(
    algebra: &A,
    convention: Convention,
    joints: &[JointElements<A::Value>],
    bar: &Bar,
    turns: &[(usize, Option<BarTurns<A::Value>>)],
) -> Option<HingeElements<A::Value>> {
    let hinge = bar.hinge.as_ref()?;
    let (joint, rocker) = (hinge.linkage.joint, hinge.rocker);
    let (sin, cos) = (&joints[joint].sin_alpha, &joints[joint].cos_alpha);
    // The twist is between the joint's axis and the link before it, or the one behind it.
    let tilt = match (convention, rocker) {
        (Convention::Modified, true) => (sin.clone(), cos.clone()),
        (Convention::Standard, false) => (algebra.neg(sin), cos.clone()),
        _ => (algebra.integer(0), algebra.integer(1)),
    };
    let of_linkage = turns.iter().find(|(of, _)| *of == joint)?.1.as_ref()?;
    Some(HingeElements { joint, rocker, tilt, turn: of_linkage[usize::from(rocker)].clone() })
}

/// Rx(α)ᵀ·v: a vector's components after the frame turned by α about x.
pub fn turn_x<A: Algebra>(alg: &A, sin: &A::Value, cos: &A::Value, v: &[A::Value; 3]) -> [A::Value; 3] {
    let (y, z) = turn(alg, sin, cos, &v[1], &v[2]);
    [v[0].clone(), y, z]
}

/// Ry(β)ᵀ·v: a vector's components after the frame turned by β about y.
pub fn turn_y<A: Algebra>(alg: &A, sin: &A::Value, cos: &A::Value, v: &[A::Value; 3]) -> [A::Value; 3] {
    let (z, x) = turn(alg, sin, cos, &v[2], &v[0]);
    [x, v[1].clone(), z]
}

/// Rz(θ)ᵀ·v: a vector's components after the frame turned by θ about z.
pub fn turn_z<A: Algebra>(alg: &A, sin: &A::Value, cos: &A::Value, v: &[A::Value; 3]) -> [A::Value; 3] {
    let (x, y) = turn(alg, sin, cos, &v[0], &v[1]);
    [x, y, v[2].clone()]
}

fn turn<A: Algebra>(alg: &A, s: &A::Value, c: &A::Value, u: &A::Value, v: &A::Value) -> (A::Value, A::Value) {
    let first = alg.add(&alg.mul(c, u), &alg.mul(s, v));
    let second = alg.sub(&alg.mul(c, v), &alg.mul(s, u));
    (first, second)
}
