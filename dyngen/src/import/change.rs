//! How far two chains with the same joints are apart: their tips and their mass matrices.

use super::chain::{Chain, ChainJoint};
use super::pose::Pose;
use crate::arm::{JointKind, MAX_JOINTS};
use crate::exact::prime::Draws;
use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use std::f64::consts::PI;

/// Poses at which two arms are compared.
const POSES: usize = 500;

/// The largest differences over poses in the joints' ranges.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Change {
    /// Between the tips, m.
    pub(super) distance: f64,
    /// Between the tips' axes, rad.
    pub(super) turn: f64,
    /// Of an element of the mass matrix M, relative to √(M_ii M_jj).
    pub(super) inertia: f64,
    /// Of the torque of a joint that holds the arm still, gravity along −z of the root link, N·m (N).
    pub(super) torque: f64,
    /// Of the acceleration of a joint when the arm falls from rest, rad/s² (m/s²).
    pub(super) acceleration: f64,
}

impl Change {
    /// Between two chains at the same positions of their joints.
    pub(super) fn between(one: &Chain, other: &Chain) -> Change {
        let mut draws = Draws::new(0x0072_6f75_6e64);
        let mut change = Change::default();
        for _ in 0..POSES {
            let mut q: Vec<f64> = one.joints.iter().map(|joint| within(joint, &mut draws)).collect();
            // Of those that follow one that follows in turn only the range is looked at.
            for (i, joint) in one.joints.iter().enumerate() {
                if let Some((leader, mimic)) = &joint.follows {
                    q[i] = mimic.ratio * q[*leader] + mimic.offset;
                }
            }
            let [(a, m, g), (b, n, h)] = [one, other].map(|chain| {
                let moved = displacements(chain, &q);
                let tip = moved.last().map_or(chain.tip_pose, |last| last.then(&chain.tip_pose));
                let (matrix, torques) = mass_matrix_and_weight(chain, &moved);
                (tip, matrix, torques)
            });
            change.torque = g.iter().zip(&h).fold(change.torque, |most, (g, h)| most.max((g - h).abs()));
            let falls = [fall(&m, &g), fall(&n, &h)];
            if let [Some(one), Some(other)] = falls {
                change.acceleration = change.acceleration.max((one - other).amax());
            }
            change.distance = change.distance.max((a.origin - b.origin).norm());
            // Of a small rotation the sine of its angle, from the part that is skew.
            let r = a.rotation.transpose() * b.rotation;
            let skew = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
            change.turn = change.turn.max((skew.norm() / 2.0).min(1.0).asin());
            for i in 0..q.len() {
                for j in 0..q.len() {
                    let share = (m[i][j] - n[i][j]).abs() / (m[i][i] * m[j][j]).sqrt();
                    // Joints that move no mass say nothing.
                    change.inertia =
                        if share.is_finite() { change.inertia.max(share) } else { change.inertia };
                }
            }
        }
        change
    }
}

/// How the arm begins to fall, M⁻¹·g; none where M is singular, as it is with links without mass.
fn fall(matrix: &[Vec<f64>], weight: &[f64]) -> Option<SVector<f64, MAX_JOINTS>> {
    // The largest arm's, padded with ones.
    let entry = |i: usize, j: usize| matrix.get(i).and_then(|row| row.get(j)).copied();
    let padded = SMatrix::<f64, MAX_JOINTS, MAX_JOINTS>::from_fn(|i, j| {
        entry(i, j).unwrap_or(if i == j { 1.0 } else { 0.0 })
    });
    let weight = SVector::from_fn(|i, _| weight.get(i).copied().unwrap_or(0.0));
    Some(padded.cholesky()?.solve(&weight))
}

fn within(joint: &ChainJoint, draws: &mut Draws) -> f64 {
    let [low, high] = joint.position.unwrap_or(match joint.kind {
        JointKind::Revolute => [-PI, PI],
        JointKind::Prismatic => [-0.5, 0.5],
    });
    low + (high - low) * (draws.element().residue() as f64 / (1u64 << 61) as f64)
}

/// Where each joint has taken what stood behind it at q = 0, in the root link's frame.
fn displacements(chain: &Chain, q: &[f64]) -> Vec<Pose> {
    let mut moved = Pose::identity();
    let step = |(joint, q): (&ChainJoint, &f64)| {
        let own = match joint.kind {
            JointKind::Revolute => {
                let rotation = Rotation3::new(joint.direction * *q).into_inner();
                Pose { rotation, origin: joint.point - rotation * joint.point }
            }
            JointKind::Prismatic => Pose { origin: joint.direction * *q, ..Pose::identity() },
        };
        moved = moved.then(&own);
        moved
    };
    chain.joints.iter().zip(q).map(step).collect()
}

/// m/s²
const GRAVITY: f64 = 9.81;

/// The mass matrix, Σ over bodies of m·vᵢ·vⱼ + ωᵢᵀ·I·ωⱼ with the velocities that unit joint velocities give;
/// and the torques that hold the bodies' weight, Σ m·g·v_z.
fn mass_matrix_and_weight(chain: &Chain, moved: &[Pose]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let n = chain.joints.len();
    let (mut matrix, mut torques) = (vec![vec![0.0; n]; n], vec![0.0; n]);
    // A joint's axis is carried by the joints before it, and does not move when it turns itself.
    let axes: Vec<(Vector3<f64>, Vector3<f64>)> = (chain.joints.iter().zip(moved))
        .map(|(joint, pose)| (pose.rotation * joint.direction, pose.point(joint.point)))
        .collect();
    for (k, (link, pose)) in chain.joints.iter().zip(moved).enumerate() {
        for body in &link.masses {
            let centre = pose.point(body.centre);
            let inertia = pose.rotation * body.inertia * pose.rotation.transpose();
            let motion = |j: usize| match chain.joints[j].kind {
                JointKind::Revolute => (axes[j].0.cross(&(centre - axes[j].1)), axes[j].0),
                JointKind::Prismatic => (axes[j].0, Vector3::zeros()),
            };
            let motions: Vec<_> = (0..=k).map(motion).collect();
            for (i, (v, w)) in motions.iter().enumerate() {
                torques[i] += body.mass * GRAVITY * v.z;
                for (j, (other_v, other_w)) in motions.iter().enumerate() {
                    matrix[i][j] += body.mass * v.dot(other_v) + w.dot(&(inertia * other_w));
                }
            }
        }
    }
    (matrix, torques)
}
