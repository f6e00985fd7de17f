//! Bars of closed loops in any algebra: their motion follows from those of two links, or from that of one
//! link and their own turn on it.

use super::elements::{ArmElements, turn_x, turn_z};
use super::linkage::BarTurn;
use super::{Motion, link_columns};
use crate::arm::{Bar, Convention};
use crate::exact::algebra::Algebra;
use crate::exact::rational::Rational;

/// A bar's quantities.
#[derive(Clone, Debug)]
pub struct BarElements<V> {
    /// The link that carries its pin; `None` is the base.
    pub carrier: Option<usize>,
    /// The pin in that link's frame.
    pub pin: [V; 3],
    /// The link that it turns with; `None` is the base.
    pub parallel: Option<usize>,
    /// How it turns on that link, where it does.
    pub hinge: Option<HingeElements<V>>,
}

/// A bar's own turn on the link that carries its pin.
#[derive(Clone, Debug)]
pub struct HingeElements<V> {
    /// The joint that turns it.
    pub joint: usize,
    /// Whether the bar is the rocker, which is on the link before the joint.
    pub rocker: bool,
    /// Sine and cosine of the turn about x from the link's axes to those whose z is the joint's axis.
    pub tilt: (V, V),
    /// The turn about z from there to the bar's axes.
    pub turn: BarTurn<V>,
}

impl<V: Clone> BarElements<V> {
    /// A bar's quantities without its hinge; `exact` gives a number of the arm.
    pub fn build<A: Algebra<Value = V>>(alg: &A, bar: &Bar, exact: &mut dyn FnMut(&Rational) -> V) -> Self {
        let mut length = |x: &Rational| if *x == Rational::ZERO { alg.integer(0) } else { exact(x) };
        let pin = bar.pin.each_ref().map(&mut length);
        BarElements { carrier: bar.carrier, pin, parallel: bar.parallel, hinge: None }
    }

    /// The motion of the bar's frame, where the links' frames move as `links` and frame 0 as `base`.
    pub fn motion<A: Algebra<Value = V>>(
        &self,
        alg: &A,
        arm: &ArmElements<V>,
        base: &Motion<V>,
        links: &[Motion<V>],
    ) -> Motion<V> {
        let mut motion = self.motion_at_pin(alg, arm, base, links);
        if let Some(HingeElements { tilt: (s, c), turn, .. }) = &self.hinge {
            for v in [&mut motion.omega, &mut motion.velocity, &mut motion.gravity] {
                *v = turn_z(alg, &turn.sin, &turn.cos, &turn_x(alg, s, c, v));
            }
        }
        motion
    }

    /// The motion of the bar in the axes of the link that it turns with, or turns on, about its pin.
    pub fn motion_at_pin<A: Algebra<Value = V>>(
        &self,
        alg: &A,
        arm: &ArmElements<V>,
        base: &Motion<V>,
        links: &[Motion<V>],
    ) -> Motion<V> {
        let of = |link: Option<usize>| link.map_or(base, |link| &links[link]);
        let (carrier, parallel) = (of(self.carrier), of(self.parallel));
        let turning = alg.cross(&carrier.omega, &self.pin);
        let velocity = std::array::from_fn(|i| alg.add(&carrier.velocity[i], &turning[i]));
        let mut omega = parallel.omega.clone();
        if let Some(HingeElements { joint, tilt: (s, c), turn, .. }) = &self.hinge {
            let rate = alg.mul(&turn.rate, &arm.joints[*joint].velocity);
            // The joint's axis in the link's axes.
            omega[1] = alg.sub(&omega[1], &alg.mul(s, &rate));
            omega[2] = alg.add(&omega[2], &alg.mul(c, &rate));
        }
        Motion {
            omega,
            velocity: turned(alg, arm, &velocity, self.carrier, self.parallel),
            gravity: parallel.gravity.clone(),
            height: alg.add(&carrier.height, &alg.dot(&carrier.gravity, &self.pin)),
        }
    }

    /// Twice the coefficients of the bar's eleven parameters in the Lagrangian.
    pub(super) fn columns<A: Algebra<Value = V>>(
        &self,
        alg: &A,
        arm: &ArmElements<V>,
        base: &Motion<V>,
        links: &[Motion<V>],
    ) -> Vec<V> {
        let mut columns = link_columns(alg, &self.motion(alg, arm, base, links));
        columns.push(alg.integer(0));
        columns
    }
}

/// A vector in the axes of the frame of one link, given in those of another's.
pub fn turned<A: Algebra>(
    alg: &A,
    arm: &ArmElements<A::Value>,
    vector: &[A::Value; 3],
    from: Option<usize>,
    to: Option<usize>,
) -> [A::Value; 3] {
    let count = |link: Option<usize>| link.map_or(0, |link| link + 1);
    let (from, to) = (count(from), count(to));
    let mut v = vector.clone();
    for joint in &arm.joints[from.min(to)..to] {
        let twist = |v: &[A::Value; 3]| turn_x(alg, &joint.sin_alpha, &joint.cos_alpha, v);
        let turn = |v: &[A::Value; 3]| turn_z(alg, &joint.sin, &joint.cos, v);
        v = match arm.convention {
            Convention::Modified => turn(&twist(&v)),
            Convention::Standard => twist(&turn(&v)),
        };
    }
    for joint in arm.joints[to.min(from)..from].iter().rev() {
        let twist = |v: &[A::Value; 3]| turn_x(alg, &alg.neg(&joint.sin_alpha), &joint.cos_alpha, v);
        let turn = |v: &[A::Value; 3]| turn_z(alg, &alg.neg(&joint.sin), &joint.cos, v);
        v = match arm.convention {
            Convention::Modified => twist(&turn(&v)),
            Convention::Standard => turn(&twist(&v)),
        };
    }
    v
}
