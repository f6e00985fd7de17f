//! The coordinates of the motors, where a `[[transmission]]` of the arm file couples joints.
//!
//! Friction, gears and encoders sit on motors. In the motors' coordinates m = M·q, τₘ = M⁻ᵀ·τ every motor's
//! friction is in its own row alone, as it is in a joint's where each motor turns one joint; so regressions
//! work in them, and their rows, states and torques with the number of a coupled joint are its motor's.

use super::Log;
use dyngen::Arm;
use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use std::borrow::Cow;

/// How an arm's motors turn with its joints.
#[derive(Clone, Debug)]
pub struct Motors {
    /// M: motor positions, velocities and accelerations = M · those of the joints.
    matrix: Mat<f64>,
    /// M⁻¹.
    inverse: Mat<f64>,
}

impl Motors {
    /// The motors of an arm; `None` where each turns with its own joint alone.
    #[must_use]
    pub fn of(arm: &Arm) -> Option<Motors> {
        if arm.transmissions.is_empty() {
            return None;
        }
        let rows = arm.motor_velocity_matrix_f64();
        let matrix = Mat::from_fn(rows.len(), rows.len(), |i, j| rows[i][j]);
        let inverse = matrix.partial_piv_lu().inverse();
        Some(Motors { matrix, inverse })
    }

    /// M by rows.
    #[must_use]
    pub fn matrix(&self) -> Vec<Vec<f64>> {
        rows(&self.matrix)
    }

    /// M⁻¹ by rows.
    #[must_use]
    pub fn inverse(&self) -> Vec<Vec<f64>> {
        rows(&self.inverse)
    }

    /// Motor positions of joint positions, n a sample; velocities and accelerations likewise.
    #[must_use]
    pub fn positions(&self, joints: &[f64]) -> Vec<f64> {
        times(&self.matrix, false, joints, 1)
    }

    /// Joint positions of motor positions, n a sample; velocities and accelerations likewise.
    #[must_use]
    pub fn joints(&self, motors: &[f64]) -> Vec<f64> {
        times(&self.inverse, false, motors, 1)
    }

    /// Motor torques of joint torques, N·m on the joint's side of the gear: n rows of `width` numbers a
    /// sample.
    #[must_use]
    pub fn torques(&self, joints: &[f64], width: usize) -> Vec<f64> {
        times(&self.inverse, true, joints, width)
    }

    /// Joint torques of motor torques, n a sample.
    #[must_use]
    pub fn joint_torques(&self, motors: &[f64]) -> Vec<f64> {
        times(&self.matrix, true, motors, 1)
    }

    /// A log of the motors: positions and torques are theirs. What was measured before the gears stays.
    #[must_use]
    pub fn log(&self, joints: &Log) -> Log {
        let (q, torque) =
            (by_joint(&joints.q, |q| self.positions(q)), by_joint(&joints.torque, |x| self.torques(x, 1)));
        Log { q, torque, ..joints.clone() }
    }

    /// The log of the joints of one of the motors.
    #[must_use]
    pub fn log_of_joints(&self, motors: &Log) -> Log {
        let q = by_joint(&motors.q, |q| self.joints(q));
        Log { q, torque: self.joint_torque_signals(&motors.torque), ..motors.clone() }
    }

    /// Joint torques of motor torques, each a signal.
    pub(super) fn joint_torque_signals(&self, motors: &[Vec<f64>]) -> Vec<Vec<f64>> {
        by_joint(motors, |x| self.joint_torques(x))
    }

    /// The largest velocity of a motor, rad/s or m/s, by the limits of the joints that turn it; `None` where
    /// one has none.
    #[must_use]
    pub fn velocity_limit(&self, arm: &Arm, motor: usize) -> Option<f64> {
        let turning = (0..self.matrix.ncols()).filter(|j| self.matrix[(motor, *j)] != 0.0);
        turning.map(|j| Some(self.matrix[(motor, j)].abs() * arm.joints[j].velocity?)).sum()
    }
}

/// The logs of the motors; as they are where no transmission couples joints.
#[must_use]
pub fn logs_of_motors<'l>(arm: &Arm, logs: &'l [Log]) -> Cow<'l, [Log]> {
    match Motors::of(arm) {
        None => Cow::Borrowed(logs),
        Some(motors) => Cow::Owned(logs.iter().map(|log| motors.log(log)).collect()),
    }
}

/// What is to be reported about an arm file before any log: its own notes, and whose the results are where a
/// transmission couples joints.
#[must_use]
pub fn notes_of(arm: &Arm) -> Vec<String> {
    arm.notes().into_iter().chain(motors_note(arm)).collect()
}

fn motors_note(arm: &Arm) -> Option<String> {
    let mut coupled: Vec<usize> =
        arm.transmissions.iter().flat_map(|t| t.joints.iter().map(|j| j + 1)).collect();
    coupled.sort_unstable();
    let coupled: Vec<String> = coupled.iter().map(ToString::to_string).collect();
    (!coupled.is_empty()).then(|| {
        format!(
            "the arm file's [[transmission]] couples joints {}: friction, errors, bands and effects with \
             these numbers are those of their motors, on the joints' side of the gears",
            coupled.join(", ")
        )
    })
}

fn rows(matrix: &Mat<f64>) -> Vec<Vec<f64>> {
    (0..matrix.nrows()).map(|i| matrix.row(i).iter().copied().collect()).collect()
}

/// Signals by joint as a map of samples makes them.
fn by_joint(signals: &[Vec<f64>], map: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Vec<f64>> {
    let (n, samples) = (signals.len(), signals.first().map_or(0, Vec::len));
    let all: Vec<f64> = (0..samples).flat_map(|k| signals.iter().map(move |x| x[k])).collect();
    let all = map(&all);
    (0..n).map(|j| all.iter().skip(j).step_by(n).copied().collect()).collect()
}

/// A matrix, or its transpose, times the n rows of `width` numbers of every sample.
fn times(matrix: &Mat<f64>, transposed: bool, rows: &[f64], width: usize) -> Vec<f64> {
    let n = matrix.nrows();
    let entry = |i: usize, j: usize| if transposed { matrix[(j, i)] } else { matrix[(i, j)] };
    // Most joints stand alone.
    let sums: Vec<Vec<(usize, f64)>> = (0..n)
        .map(|i| (0..n).map(|j| (j, entry(i, j))).filter(|(_, factor)| *factor != 0.0).collect())
        .collect();
    let mut out = vec![0.0; rows.len()];
    if width == 0 {
        return out;
    }
    for (to, from) in out.chunks_exact_mut(n * width).zip(rows.chunks_exact(n * width)) {
        for (to, sum) in to.chunks_exact_mut(width).zip(&sums) {
            for (j, factor) in sum {
                let row = &from[j * width..(j + 1) * width];
                to.iter_mut().zip(row).for_each(|(to, x)| *to += factor * x);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrist() -> Arm {
        let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\nvelocity = 2\n";
        let head = "name = \"x\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n";
        let coupled = "[[transmission]]\njoints = [2, 3]\nmatrix = [[1, 0], [\"-3/2\", 1]]\n";
        Arm::parse(&format!("{head}{}{coupled}", joint.repeat(3)), "x.toml").unwrap()
    }

    /// Power is the same in both coordinates, and the way back leads back.
    #[test]
    fn motors_do_the_work_of_the_joints() {
        let motors = Motors::of(&wrist()).unwrap();
        let (velocity, torque) = ([0.3, -0.7, 1.1, 0.2, 0.0, -2.0], [4.0, 5.0, -6.0, 1.0, 2.0, 3.0]);
        let (of_motors, on_motors) = (motors.positions(&velocity), motors.torques(&torque, 1));
        assert_eq!(of_motors[..3], [0.3, -0.7, 1.5 * 0.7 + 1.1]);
        for k in 0..2 {
            let power = |v: &[f64], t: &[f64]| -> f64 { (3 * k..3 * k + 3).map(|i| v[i] * t[i]).sum() };
            approx::assert_relative_eq!(
                power(&of_motors, &on_motors),
                power(&velocity, &torque),
                epsilon = 1e-12
            );
        }
        for (a, b) in motors.joints(&of_motors).iter().zip(&velocity) {
            approx::assert_abs_diff_eq!(a, b, epsilon = 1e-15);
        }
        for (a, b) in motors.joint_torques(&on_motors).iter().zip(&torque) {
            approx::assert_abs_diff_eq!(a, b, epsilon = 1e-14);
        }
        assert_eq!(motors.velocity_limit(&wrist(), 2), Some(5.0));
        assert!(motors_note(&wrist()).unwrap().contains("joints 2, 3"));
    }
}
