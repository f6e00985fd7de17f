//! A numeric Newton–Euler regressor, independent of the generator: for arms that are tried without a
//! derivation, and for the plant and the reference in tests.

use dyngen::Arm;
use dyngen::arm::{Convention, JointKind};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// The regressor of all eleven parameters of every link, then of every bar (n × p, row-major) at one state,
/// for gravity `g` in the base frame.
pub fn regressor(arm: &Arm, q: &[f64], v: &[f64], a: &[f64], g: [f64; 3]) -> Vec<f64> {
    let n = arm.dof();
    let motors = arm.motor_velocity_matrix_f64();
    let rate = |motor: usize, of: &[f64]| -> f64 { motors[motor].iter().zip(of).map(|(m, x)| m * x).sum() };
    let number = dyngen::exact::rational::to_f64;
    let width = 11 * arm.bodies();
    let mut y = vec![0.0; n * width];
    let (mut axes, mut points) = (Vec::new(), Vec::new());
    let (mut r, mut p) = (Matrix3::identity(), Vector3::zeros());
    let (mut w, mut dw, mut acc) = (Vector3::zeros(), Vector3::zeros(), -Vector3::from(g));
    let mut frames = vec![Moving { r, p, w, dw, acc }];
    for (i, joint) in arm.joints.iter().enumerate() {
        let prismatic = joint.kind == JointKind::Prismatic;
        let (theta, d) = if prismatic {
            (joint.theta.radians(), number(&joint.d) + q[i])
        } else {
            (joint.theta.radians() + q[i], number(&joint.d))
        };
        let twist = *Rotation3::from_axis_angle(&Vector3::x_axis(), joint.alpha.radians()).matrix();
        let turn = *Rotation3::from_axis_angle(&Vector3::z_axis(), theta).matrix();
        let shift = Vector3::new(number(&joint.a), number(&joint.b), 0.0);
        let along = Vector3::new(0.0, 0.0, d);
        // The joint's axis and a point on it are fixed in link i − 1.
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
        if let Some(ratio) = &joint.rotor_ratio {
            let (k, column) = (number(ratio), 11 * i + 10);
            let (velocity, change) = (rate(i, v), rate(i, a));
            for (j, factor) in motors[i].iter().enumerate() {
                y[j * width + column] += factor * (k * k * change + k * axis.dot(&dw));
            }
            let moment = axis * (k * change) + w.cross(&axis) * (k * velocity);
            for j in 0..i {
                if arm.joints[j].kind == JointKind::Revolute {
                    let z: Vector3<f64> = axes[j];
                    y[j * width + column] += z.dot(&moment);
                }
            }
        }
        axes.push(axis);
        points.push(point);
        let arm_vector = p_next - p;
        let (w0, dw0) = (w, dw);
        if prismatic {
            acc += dw0.cross(&arm_vector)
                + w0.cross(&w0.cross(&arm_vector))
                + axis * a[i]
                + w0.cross(&axis) * (2.0 * v[i]);
        } else {
            w = w0 + axis * v[i];
            dw = dw0 + axis * a[i] + w0.cross(&axis) * v[i];
            // To the axis with link i − 1, from there with link i.
            let (to_axis, from_axis) = (point - p, p_next - point);
            acc += dw0.cross(&to_axis)
                + w0.cross(&w0.cross(&to_axis))
                + dw.cross(&from_axis)
                + w.cross(&w.cross(&from_axis));
        }
        (r, p) = (r_next, p_next);
        frames.push(Moving { r, p, w, dw, acc });

        let local = r.transpose();
        let columns = link_columns(local * w, local * dw, local * acc);
        for j in 0..=i {
            let z = local * axes[j];
            let lever = local * (p - points[j]);
            for (k, (force, moment)) in columns.iter().enumerate() {
                y[j * width + 11 * i + k] = match arm.joints[j].kind {
                    JointKind::Revolute => z.dot(&(moment + lever.cross(force))),
                    JointKind::Prismatic => z.dot(force),
                };
            }
        }
    }
    for (k, bar) in arm.bars.iter().enumerate() {
        let of =
            |link: Option<usize>| (link.map_or(0, |link| link + 1), frames[link.map_or(0, |link| link + 1)]);
        let ((carriers, carrier), (turning, parallel)) = (of(bar.carrier), of(bar.parallel));
        let reach = carrier.r * Vector3::from(bar.pin.each_ref().map(number));
        let acc = carrier.acc + carrier.dw.cross(&reach) + carrier.w.cross(&carrier.w.cross(&reach));
        let local = parallel.r.transpose();
        let columns = link_columns(local * parallel.w, local * parallel.dw, local * acc);
        for j in 0..carriers.max(turning) {
            let (z, lever) = (local * axes[j], local * (carrier.p + reach - points[j]));
            for (c, (force, moment)) in columns.iter().enumerate() {
                let (force, moment) = (felt_part(j < carriers, force), felt_part(j < turning, moment));
                y[j * width + 11 * (n + k) + c] = match arm.joints[j].kind {
                    JointKind::Revolute => z.dot(&(moment + lever.cross(&force))),
                    JointKind::Prismatic => z.dot(&force),
                };
            }
        }
    }
    y
}

/// A link's frame in the base frame: axes, origin, angular velocity and acceleration, acceleration less
/// gravity.
#[derive(Clone, Copy)]
struct Moving {
    r: Matrix3<f64>,
    p: Vector3<f64>,
    w: Vector3<f64>,
    dw: Vector3<f64>,
    acc: Vector3<f64>,
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
