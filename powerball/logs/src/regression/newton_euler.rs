//! A numeric Newton–Euler regressor, independent of the generator: for arms that are tried without a
//! derivation, and for the plant and the reference in tests.

use dyngen::Arm;
use dyngen::arm::{Convention, JointKind};
use dyngen::exact::rational::to_f64;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// The regressor of all eleven parameters of every link, then of every bar (n × p, row-major) at one state,
/// for gravity `g` in the base frame. Bars of loops that are no parallelograms count as if they were fixed to
/// the link that carries their pin.
pub fn regressor(arm: &Arm, q: &[f64], v: &[f64], a: &[f64], g: [f64; 3]) -> Vec<f64> {
    let n = arm.dof();
    let width = 11 * arm.bodies();
    let mut y = vec![0.0; n * width];
    let mut links = vec![Link::base(g)];
    for i in 0..n {
        let next = links[i].next(arm, i, [q[i], v[i], a[i]]);
        rotor(arm, i, [v, a], &links, next.axis, |j, torque| y[j * width + 11 * i + 10] += torque);
        links.push(next);
        body(arm, &links, i + 1, i + 1, Vector3::zeros(), |j, c, torque| y[j * width + 11 * i + c] = torque);
    }
    for (k, bar) in arm.bars.iter().enumerate() {
        let after = |link: Option<usize>| link.map_or(0, |link| link + 1);
        let pin = Vector3::from(bar.pin.each_ref().map(to_f64));
        body(arm, &links, after(bar.carrier), after(bar.parallel), pin, |j, c, torque| {
            y[j * width + 11 * (n + k) + c] = torque;
        });
    }
    y
}

/// A link's frame in the base frame: axes, origin, angular velocity and acceleration, acceleration less
/// gravity; and the axis of its joint with a point on it, which are fixed in the link before.
#[derive(Clone, Copy)]
struct Link {
    r: Matrix3<f64>,
    p: Vector3<f64>,
    w: Vector3<f64>,
    dw: Vector3<f64>,
    acc: Vector3<f64>,
    axis: Vector3<f64>,
    point: Vector3<f64>,
}

impl Link {
    fn base(g: [f64; 3]) -> Link {
        let zero = Vector3::zeros();
        Link {
            r: Matrix3::identity(),
            p: zero,
            w: zero,
            dw: zero,
            acc: -Vector3::from(g),
            axis: zero,
            point: zero,
        }
    }

    /// The link after joint `i`, from the joint's position, velocity and acceleration.
    fn next(&self, arm: &Arm, i: usize, [q, v, a]: [f64; 3]) -> Link {
        let Link { r, p, w, dw, .. } = *self;
        let joint = &arm.joints[i];
        let prismatic = joint.kind == JointKind::Prismatic;
        let (turned, moved) = if prismatic { (0.0, q) } else { (q, 0.0) };
        let twist = *Rotation3::from_axis_angle(&Vector3::x_axis(), joint.alpha.radians()).matrix();
        let turn = *Rotation3::from_axis_angle(&Vector3::z_axis(), joint.theta.radians() + turned).matrix();
        let shift = Vector3::new(to_f64(&joint.a), to_f64(&joint.b), 0.0);
        let along = Vector3::new(0.0, 0.0, to_f64(&joint.d) + moved);
        let (axis, point, r_next, p_next) = match arm.convention {
            Convention::Standard => {
                let next = r * turn * twist;
                (r * Vector3::z(), p, next, p + r * (along + turn * shift))
            }
            Convention::Modified => {
                let frame = r * twist;
                let point = p + r * shift;
                (frame * Vector3::z(), point, frame * turn, point + frame * along)
            }
        };
        let (w_next, dw_next, slide) = if prismatic {
            (w, dw, axis * a + w.cross(&axis) * (2.0 * v))
        } else {
            (w + axis * v, dw + axis * a + w.cross(&axis) * v, Vector3::zeros())
        };
        // To the joint's axis with the link before, from there with this one; a prismatic joint does not
        // turn, so both parts move alike.
        let (to_axis, from_axis) = (point - p, p_next - point);
        let acc = self.acc
            + dw.cross(&to_axis)
            + w.cross(&w.cross(&to_axis))
            + dw_next.cross(&from_axis)
            + w_next.cross(&w_next.cross(&from_axis))
            + slide;
        Link { r: r_next, p: p_next, w: w_next, dw: dw_next, acc, axis, point }
    }
}

/// The torque of each joint for unit inertia of rotor `i`, which sits on link i − 1: Eq. 5.
fn rotor(
    arm: &Arm,
    i: usize,
    [v, a]: [&[f64]; 2],
    links: &[Link],
    axis: Vector3<f64>,
    mut add: impl FnMut(usize, f64),
) {
    let Some(ratio) = &arm.joints[i].rotor_ratio else { return };
    let k = to_f64(ratio);
    let motors = arm.motor_velocity_matrix_f64();
    let rate = |of: &[f64]| -> f64 { motors[i].iter().zip(of).map(|(m, x)| m * x).sum() };
    let (velocity, change) = (rate(v), rate(a));
    let Link { w, dw, .. } = links[i];
    for (j, factor) in motors[i].iter().enumerate() {
        add(j, factor * (k * k * change + k * axis.dot(&dw)));
    }
    let moment = axis * (k * change) + w.cross(&axis) * (k * velocity);
    for j in (0..i).filter(|j| arm.joints[*j].kind == JointKind::Revolute) {
        add(j, links[j + 1].axis.dot(&moment));
    }
}

/// The torque of each joint for each unit parameter of a body that turns with one link, and whose origin is
/// `pin` in the frame of another (the same one, and its origin, for a link). Both count from the base, 0.
fn body(
    arm: &Arm,
    links: &[Link],
    carrier: usize,
    turning: usize,
    pin: Vector3<f64>,
    mut set: impl FnMut(usize, usize, f64),
) {
    let (at, with) = (links[carrier], links[turning]);
    let reach = at.r * pin;
    let acc = at.acc + at.dw.cross(&reach) + at.w.cross(&at.w.cross(&reach));
    let local = with.r.transpose();
    let columns = link_columns(local * with.w, local * with.dw, local * acc);
    for j in 0..carrier.max(turning) {
        let Link { axis, point, .. } = links[j + 1];
        let (z, lever) = (local * axis, local * (at.p + reach - point));
        for (c, (force, moment)) in columns.iter().enumerate() {
            let (force, moment) = (felt_part(j < carrier, force), felt_part(j < turning, moment));
            let torque = match arm.joints[j].kind {
                JointKind::Revolute => z.dot(&(moment + lever.cross(&force))),
                JointKind::Prismatic => z.dot(&force),
            };
            set(j, c, torque);
        }
    }
}

/// A joint feels the force of a bar where it moves the pin, and its moment where it turns the bar.
fn felt_part(felt: bool, v: &Vector3<f64>) -> Vector3<f64> {
    if felt { *v } else { Vector3::zeros() }
}

/// Force on a link and moment about the origin of its frame for unit mass, first moments and inertias, from
/// its angular velocity, angular acceleration and acceleration (gravity taken off), all in its frame.
fn link_columns(w: Vector3<f64>, dw: Vector3<f64>, acc: Vector3<f64>) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let mut columns = vec![(acc, Vector3::zeros())];
    for e in [Vector3::x(), Vector3::y(), Vector3::z()] {
        columns.push((dw.cross(&e) + w.cross(&w.cross(&e)), e.cross(&acc)));
    }
    for (m, k) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
        let mut inertia = Matrix3::zeros();
        let sign = if m == k { 1.0 } else { -1.0 };
        inertia[(m, k)] = sign;
        inertia[(k, m)] = sign;
        columns.push((Vector3::zeros(), inertia * dw + w.cross(&(inertia * w))));
    }
    columns
}
