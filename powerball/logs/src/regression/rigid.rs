//! The rigid arm of a file at run time: columns of its minimal set and of the parameters outside it.
//!
//! [`RigidArm`] also gives the parameters that a vertical gravity hides.

use crate::log::Motors;
use dyngen::arm::ParameterKind;
use dyngen::base::span::combinations;
use dyngen::consistency::Possibility;
use dyngen::exact::rational::{self, Rational};
use dyngen::{Arm, Error, Evaluator, Function, Model, SetKind};
use faer::{Mat, Side};
use std::borrow::Cow;
use std::sync::OnceLock;

/// The rigid-body functions that an analysis needs, proven once and run over any number of samples.
///
/// States are slices with n numbers a sample, one sample after another. States and torques are those of the
/// motors, on the joints' side of the gears: where no `[[transmission]]` couples joints, the joints' own.
#[derive(Debug)]
pub struct RigidArm {
    model: Model,
    motors: Option<Motors>,
    regressor: Evaluator,
    torque: Evaluator,
    names: Vec<String>,
    /// Gravity as the arm file has it, m/s².
    filed: [Rational; 3],
    /// The arm without its declared symmetries, all parameters apart: built at the first use.
    unconstrained: OnceLock<Option<Wide>>,
    /// The arm at unit gravity along x, y and z of the base.
    unit_gravity: OnceLock<Option<[Wide; 3]>>,
    /// See [`RigidArm::gravity_unobservable`].
    gravity_unobservable: OnceLock<Vec<Vec<f64>>>,
}

/// A regressor with every parameter of a modified arm.
#[derive(Debug)]
struct Wide {
    evaluator: Evaluator,
    /// The column of each parameter of [`Arm::all_parameters`].
    column: Vec<Option<usize>>,
}

impl Wide {
    fn new(arm: &Arm, gravity: Option<[i64; 3]>) -> Result<Wide, Error> {
        let mut arm = arm.clone();
        arm.groupings.clear();
        (0..arm.bodies()).for_each(|body| arm.declared_zero_mut(body).clear());
        if let Some(g) = gravity {
            arm.gravity = g.map(rational::integer);
        }
        let kept = arm.kept_parameters();
        let column = arm.all_parameters().iter().map(|p| kept.iter().position(|k| k == p)).collect();
        let model = Model::derive(arm)?;
        Ok(Wide { evaluator: Evaluator::new(&model, Function::Regressor, SetKind::Full)?, column })
    }
}

impl RigidArm {
    /// Derives and proves the minimal-set functions of an arm.
    ///
    /// # Errors
    /// Those of [`Model::derive`] and [`Evaluator::new`]; [`Error::Mimics`] where a joint follows another
    /// one.
    pub fn new(arm: &Arm) -> Result<RigidArm, Error> {
        RigidArm::mounted(arm, arm)
    }

    /// Like [`RigidArm::new`], for an arm under another gravity than that of its file.
    ///
    /// # Errors
    /// Those of [`RigidArm::new`].
    pub fn mounted(arm: &Arm, filed: &Arm) -> Result<RigidArm, Error> {
        arm.without_mimics().map_err(Error::Mimics)?;
        let model = Model::derive(arm.clone())?;
        let regressor = Evaluator::new(&model, Function::Regressor, SetKind::Minimal)?;
        let torque = Evaluator::new(&model, Function::InverseDynamics, SetKind::Minimal)?;
        let names = model.set(SetKind::Minimal)?.names();
        Ok(RigidArm {
            motors: Motors::of(arm),
            model,
            regressor,
            torque,
            names,
            filed: filed.gravity.clone(),
            unconstrained: OnceLock::new(),
            unit_gravity: OnceLock::new(),
            gravity_unobservable: OnceLock::new(),
        })
    }

    /// The arm.
    #[must_use]
    pub fn arm(&self) -> &Arm {
        self.model.arm()
    }

    /// Gravity in the base frame, m/s².
    #[must_use]
    pub fn gravity(&self) -> [f64; 3] {
        self.arm().gravity.each_ref().map(rational::to_f64)
    }

    /// The arm under the gravity of its file.
    #[must_use]
    pub fn filed(&self) -> Arm {
        Arm { gravity: self.filed.clone(), ..self.arm().clone() }
    }

    /// The parameters of the minimal set as combinations of those of the same arm under another gravity, by
    /// row; `None` if the latter do not determine them.
    #[must_use]
    pub fn parameters_from(&self, other: &RigidArm) -> Option<Vec<Vec<f64>>> {
        let sums = |body: &RigidArm| Some(body.model.sums(body.model.set(SetKind::Minimal).ok()?));
        combinations(&sums(self)?, &sums(other)?)
    }

    /// The arm with its parameter sets.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Joints.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.model.arm().dof()
    }

    /// The parameters of the minimal set, in the order of the columns.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The minimal-set regressor, n × p a sample, row-major.
    #[must_use]
    pub fn regressor(&self, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; q.len() / self.dof() * self.regressor.outputs()];
        self.regressor_into(q, v, a, &mut out);
        out
    }

    /// Like [`Self::regressor`], into a slice of n × p numbers per sample.
    pub fn regressor_into(&self, q: &[f64], v: &[f64], a: &[f64], out: &mut [f64]) {
        let [q, v, a] = self.of_joints([q, v, a]);
        self.regressor.evaluate(&q, &v, &a, &[], out);
        if let Some(motors) = &self.motors {
            out.copy_from_slice(&motors.torques(out, self.names.len()));
        }
    }

    /// The motors, where a transmission couples joints.
    #[must_use]
    pub fn motors(&self) -> Option<&Motors> {
        self.motors.as_ref()
    }

    /// The limit of a motor's velocity, where the arm file's limits say one.
    #[must_use]
    pub fn velocity_limit(&self, motor: usize) -> Option<f64> {
        match &self.motors {
            None => self.arm().joints[motor].velocity,
            Some(motors) => motors.velocity_limit(self.arm(), motor),
        }
    }

    /// Positions, velocities and accelerations of the joints for those of the motors.
    fn of_joints<'s>(&self, states: [&'s [f64]; 3]) -> [Cow<'s, [f64]>; 3] {
        states.map(|state| match &self.motors {
            None => Cow::Borrowed(state),
            Some(motors) => Cow::Owned(motors.joints(state)),
        })
    }

    /// Torques of the minimal set's `parameters`, n a sample.
    #[must_use]
    pub fn torque(&self, q: &[f64], v: &[f64], a: &[f64], parameters: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; q.len()];
        let [q, v, a] = self.of_joints([q, v, a]);
        self.torque.evaluate(&q, &v, &a, parameters, &mut out);
        self.on_motors(out, 1)
    }

    /// Rows of the motors for those of the joints, `width` numbers each.
    fn on_motors(&self, rows: Vec<f64>, width: usize) -> Vec<f64> {
        match &self.motors {
            None => rows,
            Some(motors) => motors.torques(&rows, width),
        }
    }

    /// Whether a real arm can have these values of the minimal set.
    ///
    /// # Errors
    /// Those of [`Model::function`].
    pub fn possibility(&self, values: &[f64]) -> Result<Possibility, Error> {
        dyngen::consistency::check(&self.model, SetKind::Minimal, values)
    }

    /// Values of all eleven parameters a link that move like the minimal set's `values`.
    #[must_use]
    pub fn carried(&self, values: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.arm().all_parameters().len()];
        if let Ok(set) = self.model.set(SetKind::Minimal) {
            for (parameter, value) in set.parameters.iter().zip(values) {
                for (carrier, coefficient) in &parameter.carriers {
                    all[carrier.index()] += self.model.sets().field.value(coefficient) * value;
                }
            }
        }
        all
    }

    /// The torque columns of chosen parameters of [`Arm::all_parameters`], symmetries ignored: by sample, n ×
    /// chosen.
    #[must_use]
    pub fn parameter_columns(&self, chosen: &[usize], q: &[f64], v: &[f64], a: &[f64]) -> Option<Vec<f64>> {
        let wide = self.unconstrained.get_or_init(|| Wide::new(self.arm(), None).ok()).as_ref()?;
        let [q, v, a] = self.of_joints([q, v, a]);
        Some(self.on_motors(pick(wide, chosen, &q, &v, &a, self.dof())?, chosen.len()))
    }

    /// The static torque of chosen parameters under unit gravity along base axis `axis`: by sample, n ×
    /// chosen.
    #[must_use]
    pub fn gravity_columns(&self, axis: usize, chosen: &[usize], q: &[f64]) -> Option<Vec<f64>> {
        let wides = self
            .unit_gravity
            .get_or_init(|| {
                let unit = |g| Wide::new(self.arm(), Some(g)).ok();
                Some([unit([1, 0, 0])?, unit([0, 1, 0])?, unit([0, 0, 1])?])
            })
            .as_ref()?;
        let still = vec![0.0; q.len()];
        let [q, v, a] = self.of_joints([q, &still, &still]);
        Some(self.on_motors(pick(&wides[axis], chosen, &q, &v, &a, self.dof())?, chosen.len()))
    }

    /// The point at which a force on the last link is assumed to act, in its frame, m: the tool of the arm
    /// file, else the origin.
    #[must_use]
    pub fn force_point(&self) -> [f64; 3] {
        let on_last = self.arm().tool_carrier() + 1 == self.arm().links();
        let tool = self.arm().tool.as_ref().filter(|_| on_last);
        tool.map_or([0.0; 3], |tool| tool.xyz.each_ref().map(rational::to_f64))
    }

    /// A point of a link's frame in the frame that the robot description gives the link, where the arm file
    /// has that (`link_frame`), m.
    #[must_use]
    pub fn in_link_frame(&self, link: usize, point: [f64; 3]) -> [f64; 3] {
        let frame = self.arm().joints.get(link).and_then(|joint| joint.link_frame.as_ref());
        frame.map_or(point, |frame| frame.see(point))
    }

    /// Torques for unit forces there along the base axes: by axis and sample, n. `None` where they cannot be
    /// had.
    #[must_use]
    pub fn force_columns(&self, q: &[f64]) -> Option<[Vec<f64>; 3]> {
        // The static torque of a unit mass under unit gravity is that of a unit force; its first moments say
        // where.
        let first = self.last_link(ParameterKind::M);
        let point = self.force_point();
        let of = |axis: usize| {
            let columns = self.gravity_columns(axis, &[first, first + 1, first + 2, first + 3], q)?;
            let at = |c: &[f64]| c[0] + (0..3).map(|k| point[k] * c[k + 1]).sum::<f64>();
            Some(columns.chunks_exact(4).map(at).collect())
        };
        Some([of(0)?, of(1)?, of(2)?])
    }

    /// Directions in the space of all parameters, eleven a link in the order of [`Arm::all_parameters`], that
    /// no motion under the arm's own gravity shows and that a gravity from another side does: how far from an
    /// upright first axis its link's weight is, say.
    pub fn gravity_unobservable(&self) -> &[Vec<f64>] {
        self.gravity_unobservable.get_or_init(|| gravity_unobservable(self).unwrap_or_default())
    }

    /// The index among [`Arm::all_parameters`] of a parameter of the last link.
    #[must_use]
    pub fn last_link(&self, kind: ParameterKind) -> usize {
        11 * (self.dof() - 1) + kind as usize
    }
}

fn pick(wide: &Wide, chosen: &[usize], q: &[f64], v: &[f64], a: &[f64], n: usize) -> Option<Vec<f64>> {
    let columns: Vec<usize> =
        chosen.iter().map(|c| wide.column.get(*c).copied().flatten()).collect::<Option<_>>()?;
    let width = wide.evaluator.outputs() / n;
    let (samples, chunk) = (q.len() / n, 1024);
    let mut out = Vec::with_capacity(samples * n * columns.len());
    let mut buffer = Vec::new();
    for first in (0..samples).step_by(chunk) {
        let range = first * n..(first + chunk).min(samples) * n;
        buffer.resize(range.len() * width, 0.0);
        wide.evaluator.evaluate(&q[range.clone()], &v[range.clone()], &a[range], &[], &mut buffer);
        for row in buffer.chunks_exact(width) {
            out.extend(columns.iter().map(|c| row[*c]));
        }
    }
    Some(out)
}

// Parameters that a vertical gravity hides: no motion shows them until gravity has another direction.

/// Poses at which it is seen whether a gravity from another side shows a parameter.
const HIDDEN_POSES: usize = 8;

/// See [`RigidArm::gravity_unobservable`].
pub(super) fn gravity_unobservable(body: &RigidArm) -> Option<Vec<Vec<f64>>> {
    let arm = body.arm();
    let kept: Vec<usize> = arm.kept_parameters().iter().map(|p| p.index()).collect();
    let mut shown = Mat::<f64>::zeros(body.names().len(), kept.len());
    for (row, sum) in body.model().sums(body.model().set(SetKind::Minimal).ok()?).iter().enumerate() {
        for (parameter, coefficient) in sum {
            let column = kept.iter().position(|k| *k == parameter.index())?;
            shown[(row, column)] = *coefficient;
        }
    }
    let moments: Vec<usize> = kept.iter().copied().filter(|k| k % 11 < 4).collect();
    let poses: Vec<f64> =
        (0..HIDDEN_POSES * body.dof()).map(|k| (1.0 + k as f64 * 2.399).sin() * 2.0).collect();
    let mut pulled = Mat::<f64>::zeros(3 * poses.len(), kept.len());
    for axis in 0..3 {
        let columns = body.gravity_columns(axis, &moments, &poses)?;
        for (row, values) in columns.chunks_exact(moments.len().max(1)).enumerate() {
            for (value, moment) in values.iter().zip(&moments) {
                let column = kept.iter().position(|k| k == moment)?;
                pulled[(axis * poses.len() + row, column)] = *value;
            }
        }
    }
    let (_, unseen) = split(&shown, shown.norm_l2())?;
    let (felt, _) = split(&(&pulled * &unseen), pulled.norm_l2())?;
    let directions = unseen * felt;
    let whole = |d: usize| {
        let mut all = vec![0.0; arm.all_parameters().len()];
        kept.iter().enumerate().for_each(|(row, k)| all[*k] = directions[(row, d)]);
        all
    };
    Some((0..directions.ncols()).map(whole).collect())
}

/// Orthonormal directions that a matrix does not map to zero, and those that it does, for a matrix made of
/// one of some norm.
fn split(matrix: &Mat<f64>, norm: f64) -> Option<(Mat<f64>, Mat<f64>)> {
    let found = (matrix.transpose() * matrix).self_adjoint_eigen(Side::Lower).ok()?;
    let (values, vectors) = (found.S().column_vector(), found.U());
    let pick = |seen: bool| {
        let chosen: Vec<usize> =
            (0..matrix.ncols()).filter(|k| (values[*k] > 1e-10 * norm * norm) == seen).collect();
        Mat::from_fn(matrix.ncols(), chosen.len(), |row, k| vectors[(row, chosen[k])])
    };
    Some((pick(true), pick(false)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Chain;
    use crate::regression::newton_euler;
    use rand::{RngExt, SeedableRng};

    /// A force on the tool is felt as the slopes of its work by the joints' positions: by the poses of the
    /// chain alone.
    #[test]
    fn a_force_on_the_tool_is_the_slope_of_its_work() {
        let text = include_str!("../../../../tests/arms/ur5e.toml");
        let tool = nalgebra::Vector3::new(0.05, -0.12, 0.23);
        for placed in [false, true] {
            let with =
                format!("{text}\n[tool]\nxyz = [{}, {}, {}]\nrpy = [0, 0.3, 0]\n", tool.x, tool.y, tool.z);
            let arm = Arm::parse(if placed { &with } else { text }, "ur5e.toml").unwrap();
            let (body, chain) = (RigidArm::new(&arm).unwrap(), Chain::new(&arm));
            let at = if placed { tool } else { nalgebra::Vector3::zeros() };
            let mut rng = chacha20::ChaCha8Rng::seed_from_u64(8);
            let q: Vec<f64> = (0..arm.dof()).map(|_| rng.random_range(-1.5..1.5)).collect();
            let point = |q: &[f64]| {
                let (rotation, origin) = chain.poses(q).pop().unwrap();
                origin + rotation * at
            };
            let columns = body.force_columns(&q).unwrap();
            for (j, axis) in (0..arm.dof()).flat_map(|j| (0..3).map(move |axis| (j, axis))) {
                let moved = |by: f64| {
                    let mut q = q.clone();
                    q[j] += by;
                    point(&q)[axis]
                };
                // The motors hold against what is outside.
                let slope = -(moved(1e-5) - moved(-1e-5)) / 2e-5;
                approx::assert_abs_diff_eq!(columns[axis][j], slope, epsilon = 1e-8);
            }
        }
    }

    #[test]
    fn columns_agree_with_newton_euler() {
        let text =
            include_str!("../../../controller/arm.toml").replace("rotor_ratio = 1\n", "rotor_ratio = 100\n");
        let arm = Arm::parse(&text, "arm.toml").unwrap();
        let body = RigidArm::new(&arm).unwrap();
        let n = arm.dof();
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(3);
        let mut draw = |count: usize| (0..count).map(|_| rng.random_range(-1.5..1.5)).collect::<Vec<f64>>();
        let (q, v, a) = (draw(3 * n), draw(3 * n), draw(3 * n));
        let values = draw(body.names().len());
        let all = body.carried(&values);
        let torque = body.torque(&q, &v, &a, &values);
        let y = body.regressor(&q, &v, &a);
        let p = values.len();
        for s in 0..3 {
            let at = s * n..(s + 1) * n;
            let full = newton_euler::regressor(
                &arm,
                &q[at.clone()],
                &v[at.clone()],
                &a[at.clone()],
                [0.0, 0.0, -9.81],
            );
            for j in 0..n {
                let expected: f64 = (0..11 * n).map(|k| full[j * 11 * n + k] * all[k]).sum();
                let row: f64 = (0..p).map(|k| y[(s * n + j) * p + k] * values[k]).sum();
                approx::assert_relative_eq!(torque[s * n + j], expected, epsilon = 1e-9, max_relative = 1e-9);
                approx::assert_relative_eq!(row, expected, epsilon = 1e-9, max_relative = 1e-9);
            }
        }
        // Outside the symmetries, and under another gravity.
        let chosen = [2, 11 * 2 + 1, body.last_link(ParameterKind::M), body.last_link(ParameterKind::My)];
        let columns = body.parameter_columns(&chosen, &q, &v, &a).unwrap();
        let sideways = body.gravity_columns(1, &chosen, &q).unwrap();
        for s in 0..3 {
            let at = s * n..(s + 1) * n;
            let full = newton_euler::regressor(
                &arm,
                &q[at.clone()],
                &v[at.clone()],
                &a[at.clone()],
                [0.0, 0.0, -9.81],
            );
            let still = newton_euler::regressor(&arm, &q[at], &[0.0; 6], &[0.0; 6], [0.0, 1.0, 0.0]);
            for j in 0..n {
                for (k, c) in chosen.iter().enumerate() {
                    let index = (s * n + j) * chosen.len() + k;
                    approx::assert_relative_eq!(columns[index], full[j * 11 * n + c], epsilon = 1e-9);
                    approx::assert_relative_eq!(sideways[index], still[j * 11 * n + c], epsilon = 1e-9);
                }
            }
        }
    }
}

#[cfg(test)]
mod bar_tests {
    use super::*;
    use crate::regression::newton_euler;
    use rand::{RngExt, SeedableRng};

    /// A loop on the base and one around an axis behind a sliding joint.
    const ARM: &str = r#"
name = "loops"
convention = "standard"
gravity = [1, 2, -9]
joint = [
    { kind = "revolute", a = 0.1, alpha = "-pi/2", d = 0.2, theta = 0.3, rotor_ratio = 50 },
    { kind = "prismatic", a = 0.2, alpha = "pi/2", d = 0.1, theta = 0 },
    { kind = "revolute", a = 0.3, b = 0.05, alpha = 0.4, d = 0.1, theta = 0, rotor_ratio = 50, zero = ["mz"] },
]
[[loop]]
joints = [1, "a", "b", "c"]
lengths = [0.2, 0.5, 0.2, 0.5]
inner = 1
outer = 2
[[loop]]
joints = [3, "d", "e", "f"]
lengths = [0.15, 0.4, 0.15, 0.4]
inner = "pi/2"
outer = -0.7
bar = [{ zero = ["mz", "Ixz"] }]
"#;

    #[test]
    fn columns_of_bars_agree_with_newton_euler() {
        let arm = Arm::parse(ARM, "arm.toml").unwrap();
        let body = RigidArm::new(&arm).unwrap();
        let (n, all) = (arm.dof(), arm.all_parameters().len());
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(4);
        let mut draw = |count: usize| (0..count).map(|_| rng.random_range(-1.5..1.5)).collect::<Vec<f64>>();
        let chosen: Vec<usize> = (0..all).filter(|k| k % 11 < 10).collect();
        for _ in 0..3 {
            let (q, v, a) = (draw(n), draw(n), draw(n));
            let expected = newton_euler::regressor(&arm, &q, &v, &a, [1.0, 2.0, -9.0]);
            let columns = body.parameter_columns(&chosen, &q, &v, &a).unwrap();
            let values = draw(body.names().len());
            let (carried, torque) = (body.carried(&values), body.torque(&q, &v, &a, &values));
            for j in 0..n {
                for (k, c) in chosen.iter().enumerate() {
                    let index = j * chosen.len() + k;
                    approx::assert_relative_eq!(columns[index], expected[j * all + c], epsilon = 1e-9);
                }
                let sum: f64 = (0..all).map(|k| expected[j * all + k] * carried[k]).sum();
                approx::assert_relative_eq!(torque[j], sum, epsilon = 1e-9, max_relative = 1e-9);
            }
        }
    }
}

#[cfg(test)]
mod gravity_unobservable_tests {
    use super::*;
    use dyngen::Arm;

    #[test]
    fn what_gravity_from_the_side_shows_is_known() {
        let gravity_unobservable = |text: &str, gravity: &str| {
            let text = text.replace("[0, 0, -9.81]", gravity).replace("[0.0, 0.0, -9.81]", gravity);
            RigidArm::new(&Arm::parse(&text, "arm.toml").unwrap()).unwrap().gravity_unobservable().len()
        };
        let ur5e = include_str!("../../../../tests/arms/ur5e.toml");
        // The weight of all that turns about the upright first axis: how far from it, and whereto. Hung on a
        // wall, it shows.
        assert_eq!(gravity_unobservable(ur5e, "[0, 0, -9.81]"), 2);
        assert_eq!(gravity_unobservable(ur5e, "[0, -9.81, 0]"), 0);
        assert_eq!(
            gravity_unobservable(include_str!("../../../../tests/arms/scara.toml"), "[0, 0, -9.81]"),
            2
        );
        let planar = include_str!("../../../../tests/arms/planar2r.toml");
        assert_eq!(gravity_unobservable(planar, "[0, -9.81, 0]"), 0);
        // The numbers of base parameters say the same.
        let count = |gravity: &str| {
            let arm = Arm::parse(&ur5e.replace("[0, 0, -9.81]", gravity), "arm.toml").unwrap();
            RigidArm::new(&arm).unwrap().names().len()
        };
        assert_eq!(count("[1, 2, -9]"), count("[0, 0, -9.81]") + 2);
    }
}
