//! The Lagrangian of Eq. 5 and 6, linear in the dynamic parameters: all other results are derived from this
//! definition or proven against it.

pub mod bars;
pub mod elements;
pub mod followers;
pub mod linkage;

use crate::arm::{Convention, JointKind, ParameterKind};
use crate::exact::algebra::Algebra;
use elements::{ArmElements, JointElements, PlacementElements, turn_x, turn_y, turn_z};

/// The motion of a link frame relative to the base, in the frame's own axes.
#[derive(Clone, Debug)]
pub struct Motion<V> {
    /// Angular velocity.
    pub omega: [V; 3],
    /// Velocity of the origin.
    pub velocity: [V; 3],
    /// Gravity.
    pub gravity: [V; 3],
    /// Gravity · position of the origin.
    pub height: V,
}

/// Twice the coefficient of every dynamic parameter in the Lagrangian, eleven a link, then a bar, in the
/// order of Eq. 10: L = ½ Σ columns·π.
///
/// Twice, so that integer polynomials stay integer. Positions of frame origins enter the potential
/// energy U = −gᵀ(m p + m r) of Eq. 6 (p: origin, r: centre of mass).
pub fn twice_lagrangian<A: Algebra>(alg: &A, arm: &ArmElements<A::Value>) -> Vec<A::Value> {
    twice_lagrangian_on(alg, arm, Motion::base(alg, arm))
}

/// Like [`twice_lagrangian`], for a moving frame 0.
pub fn twice_lagrangian_on<A: Algebra>(
    alg: &A,
    arm: &ArmElements<A::Value>,
    base: Motion<A::Value>,
) -> Vec<A::Value> {
    let mut columns = Vec::with_capacity((arm.joints.len() + arm.bars.len()) * ParameterKind::ALL.len());
    let mut links: Vec<Motion<A::Value>> = Vec::with_capacity(arm.joints.len());
    for joint in &arm.joints {
        let mut state = links.last().unwrap_or(&base).clone();
        let axis = step(alg, arm.convention, joint, &mut state);
        columns.extend(link_columns(alg, &state));
        columns.push(axis.rotor);
        links.push(state);
    }
    for bar in &arm.bars {
        columns.extend(bar.columns(alg, arm, &base, &links));
    }
    columns
}

/// The motions of the frames of all links, where frame 0 rests under gravity.
pub fn motions<A: Algebra>(alg: &A, arm: &ArmElements<A::Value>) -> Vec<Motion<A::Value>> {
    let next = |state: &mut Motion<A::Value>, joint| {
        step(alg, arm.convention, joint, state);
        Some(state.clone())
    };
    arm.joints.iter().scan(Motion::base(alg, arm), next).collect()
}

/// Twice the coefficients of the ten inertial parameters of a body that is fixed to the tool's frame of a
/// link.
pub fn twice_lagrangian_of_tool<A: Algebra>(
    alg: &A,
    arm: &ArmElements<A::Value>,
    carrier: usize,
    tool: &PlacementElements<A::Value>,
) -> Vec<A::Value> {
    let mut state = Motion::base(alg, arm);
    for joint in &arm.joints[..=carrier] {
        step(alg, arm.convention, joint, &mut state);
    }
    link_columns(alg, &state.placed(alg, tool))
}

impl<V: Clone> Motion<V> {
    /// Frame 0 at rest under gravity.
    pub fn base<A: Algebra<Value = V>>(alg: &A, arm: &ArmElements<V>) -> Self {
        let zero = || std::array::from_fn(|_| alg.integer(0));
        Motion { omega: zero(), velocity: zero(), gravity: arm.gravity.clone(), height: alg.integer(0) }
    }

    /// The motion of a frame that is fixed in this one: a shift, then Rz(yaw)·Ry(pitch)·Rx(roll).
    pub fn placed<A: Algebra<Value = V>>(&self, alg: &A, frame: &PlacementElements<V>) -> Self {
        let shift = alg.cross(&self.omega, &frame.origin);
        let velocity = std::array::from_fn(|i| alg.add(&self.velocity[i], &shift[i]));
        let height = alg.add(&self.height, &alg.dot(&self.gravity, &frame.origin));
        let [(sr, cr), (sp, cp), (sy, cy)] = &frame.rpy;
        let turned = |v: &[V; 3]| turn_x(alg, sr, cr, &turn_y(alg, sp, cp, &turn_z(alg, sy, cy, v)));
        Motion {
            omega: turned(&self.omega),
            velocity: turned(&velocity),
            gravity: turned(&self.gravity),
            height,
        }
    }
}

/// The quantities on a joint's axis in the link before it.
#[derive(Clone, Debug)]
pub struct Axis<V> {
    /// The link's angular velocity about it.
    pub omega: V,
    /// The column of the rotor there.
    pub rotor: V,
}

/// From the motion of a link to that of the next one; returns what happens on the axis between them.
pub fn step<A: Algebra>(
    alg: &A,
    convention: Convention,
    joint: &JointElements<A::Value>,
    state: &mut Motion<A::Value>,
) -> Axis<A::Value> {
    if convention == Convention::Modified {
        twist(alg, joint, state);
    }
    // Before it turns, z is the joint axis in axes that are fixed in the link before.
    let omega = state.omega[2].clone();
    let rotor = rotor_column(alg, joint, &omega);
    advance(alg, joint, state);
    if convention == Convention::Standard {
        twist(alg, joint, state);
    }
    Axis { omega, rotor }
}

/// Tx(a) Ty(b) Rx(α).
fn twist<A: Algebra>(alg: &A, joint: &JointElements<A::Value>, state: &mut Motion<A::Value>) {
    if !alg.is_zero(&joint.a) {
        let [_, wy, wz] = &state.omega;
        state.velocity[1] = alg.add(&state.velocity[1], &alg.mul(&joint.a, wz));
        state.velocity[2] = alg.sub(&state.velocity[2], &alg.mul(&joint.a, wy));
        state.height = alg.add(&state.height, &alg.mul(&joint.a, &state.gravity[0]));
    }
    if !alg.is_zero(&joint.b) {
        let [wx, _, wz] = &state.omega;
        state.velocity[0] = alg.sub(&state.velocity[0], &alg.mul(&joint.b, wz));
        state.velocity[2] = alg.add(&state.velocity[2], &alg.mul(&joint.b, wx));
        state.height = alg.add(&state.height, &alg.mul(&joint.b, &state.gravity[1]));
    }
    for v in [&mut state.omega, &mut state.velocity, &mut state.gravity] {
        *v = turn_x(alg, &joint.sin_alpha, &joint.cos_alpha, v);
    }
}

/// Rz(θ) Tz(d) and the joint's own motion along or about z.
fn advance<A: Algebra>(alg: &A, joint: &JointElements<A::Value>, state: &mut Motion<A::Value>) {
    if !alg.is_zero(&joint.shift) {
        let [wx, wy, _] = &state.omega;
        state.velocity[0] = alg.add(&state.velocity[0], &alg.mul(&joint.shift, wy));
        state.velocity[1] = alg.sub(&state.velocity[1], &alg.mul(&joint.shift, wx));
        state.height = alg.add(&state.height, &alg.mul(&joint.shift, &state.gravity[2]));
    }
    for v in [&mut state.omega, &mut state.velocity, &mut state.gravity] {
        *v = turn_z(alg, &joint.sin, &joint.cos, v);
    }
    let moved = match joint.kind {
        JointKind::Revolute => &mut state.omega[2],
        JointKind::Prismatic => &mut state.velocity[2],
    };
    *moved = alg.add(moved, &joint.velocity);
}

/// 2·(k q̇ (z·ω) + ½ k² q̇²), the rotor's terms of Eq. 5, with the motor's velocity for q̇; zero without a
/// rotor.
fn rotor_column<A: Algebra>(alg: &A, joint: &JointElements<A::Value>, omega_z: &A::Value) -> A::Value {
    let Some(ratio) = &joint.ratio else { return alg.integer(0) };
    let spin = alg.mul(ratio, &joint.motor_velocity);
    let coupling = alg.mul(&alg.integer(2), omega_z);
    alg.mul(&spin, &alg.add(&coupling, &spin))
}

/// The ten inertial columns of a link: m, first moments, then the inertia tensor with the signs of Eq. 8.
pub fn link_columns<A: Algebra>(alg: &A, state: &Motion<A::Value>) -> Vec<A::Value> {
    let two = alg.integer(2);
    let Motion { omega: w, velocity: v, gravity: g, height } = state;
    let mut columns = vec![alg.add(&alg.dot(v, v), &alg.mul(&two, height))];
    // v·(ω × r) = r·(v × ω)
    for (moment, gravity) in alg.cross(v, w).iter().zip(g) {
        columns.push(alg.mul(&two, &alg.add(moment, gravity)));
    }
    for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
        let product = alg.mul(&w[i], &w[j]);
        columns.push(if i == j { product } else { alg.neg(&alg.mul(&two, &product)) });
    }
    columns
}
