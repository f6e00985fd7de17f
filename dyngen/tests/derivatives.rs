//! What optimal control asks for: derivatives of the accelerations, rates of B and J, and the tool's inertia, of arms in
//! both conventions with sliding, coupled and following joints. Each function is proven against the Lagrangian as it is
//! built; here it is compared with other functions at states drawn by lot.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use dyngen::{Evaluator, Function, Model, SetKind};

use rand::SeedableRng;
use support::{State, evaluate, model};

fn arms() -> Vec<(String, String)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/arms");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    let text = |path: &std::path::PathBuf| std::fs::read_to_string(path).unwrap();
    let name = |path: &std::path::PathBuf| path.file_stem().unwrap().to_string_lossy().into_owned();
    let mut arms: Vec<(String, String)> = files.iter().map(|path| (name(path), text(path))).collect();
    arms.push(("tied".into(), TIED.into()));
    arms
}

/// Joints that follow others, one of them with a motor that turns with both.
const TIED: &str = r#"
name = "tied"
convention = "standard"
gravity = [1, 0.5, -9]
joint = [
    { kind = "prismatic", a = 0, alpha = "pi/2", d = 0.1, theta = 0 },
    { kind = "prismatic", a = 0.1, alpha = "-pi/2", d = 0.2, theta = "pi/2", mimic = { joint = 1, ratio = "3/2", offset = -0.05 } },
    { kind = "revolute", a = 0.2, alpha = "pi", d = 0, theta = 0.4, mimic = { joint = 4, ratio = "1/2", offset = 0.2 } },
    { kind = "revolute", a = 0.15, alpha = "pi/2", d = 0.05, theta = 0 },
    { kind = "revolute", a = 0.12, alpha = 0, d = 0.03, theta = 0, rotor_ratio = 30 },
]

[[transmission]]
joints = [5, 4]
matrix = [[1, "1/2"], [0, 1]]
"#;

/// A model with values of its parameters that make B positive definite, and what its functions give at a state.
struct Arm {
    model: Model,
    values: Vec<f64>,
    state: State,
}

impl Arm {
    fn new(text: &str, seed: u64) -> Arm {
        let model = model(text);
        let set = model.set(SetKind::Minimal).unwrap();
        // A ball of 2 kg at each link's origin, and rotors.
        let of = |k: usize| [2.0, 0.02, -0.03, 0.04, 0.5, 0.0, 0.0, 0.6, 0.0, 0.7, 1e-4][k];
        let all: Vec<f64> = (0..11 * model.arm().links()).map(|i| of(i % 11)).collect();
        let values = model.set_values(set, &all);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let state = State::draw(&mut random, model.arm().dof(), 1.0);
        Arm { model, values, state }
    }

    fn has(&self, function: Function) -> bool {
        self.model.functions().any(|f| f == function)
    }

    fn at(&self, function: Function, state: &State) -> Matrix {
        let evaluator = Evaluator::new(&self.model, function, SetKind::Minimal).unwrap();
        let values = if function.takes(dyngen::dynamics::function::Argument::Parameters) {
            &self.values[..]
        } else {
            &[]
        };
        let (rows, columns) = evaluator.shape();
        Matrix { columns, values: evaluate(&evaluator, &state.samples(values)), rows }
    }

    fn of(&self, function: Function) -> Matrix {
        self.at(function, &self.state)
    }

    /// The derivative of a function's result as a column by each number of a part of the state, by Richardson's
    /// extrapolation of central differences.
    fn differences(&self, function: Function, part: fn(&mut State) -> &mut Vec<f64>) -> Matrix {
        let column = |j: usize| {
            let difference = |step: f64| {
                let moved = |by: f64| {
                    let mut state = self.state.clone();
                    part(&mut state)[j] += by;
                    self.at(function, &state)
                };
                moved(step).plus(&moved(-step), -1.0).times(&Matrix::number(0.5 / step))
            };
            difference(1e-3).times(&Matrix::number(4.0 / 3.0)).plus(&difference(2e-3), -1.0 / 3.0)
        };
        let n = self.model.arm().dof();
        let columns: Vec<Matrix> = (0..n).map(column).collect();
        Matrix::of(n, n, |i, j| columns[j].values[i])
    }
}

fn close(name: &str, what: &str, found: &Matrix, expected: &Matrix, tolerance: f64) {
    assert_eq!((found.rows, found.columns), (expected.rows, expected.columns), "{name}: {what}");
    let miss = found.plus(expected, -1.0).largest() / (1.0 + expected.largest());
    assert!(miss < tolerance, "{name}: {what} is off by {miss:e}");
}

/// Row-major.
struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Matrix {
    fn of(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix {
        let values = (0..rows * columns).map(|k| entry(k / columns, k % columns)).collect();
        Matrix { rows, columns, values }
    }

    fn column(values: &[f64]) -> Matrix {
        Matrix { rows: values.len(), columns: 1, values: values.to_vec() }
    }

    /// 1 × 1: what scales a column.
    fn number(value: f64) -> Matrix {
        Matrix::column(&[value])
    }

    fn identity(n: usize) -> Matrix {
        Matrix::of(n, n, |i, j| f64::from(u8::from(i == j)))
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.columns + j]
    }

    fn times(&self, other: &Matrix) -> Matrix {
        assert_eq!(self.columns, other.rows);
        let entry = |i, j| (0..self.columns).map(|k| self.at(i, k) * other.at(k, j)).sum();
        Matrix::of(self.rows, other.columns, entry)
    }

    fn transpose(&self) -> Matrix {
        Matrix::of(self.columns, self.rows, |i, j| self.at(j, i))
    }

    fn plus(&self, other: &Matrix, factor: f64) -> Matrix {
        Matrix::of(self.rows, self.columns, |i, j| self.at(i, j) + factor * other.at(i, j))
    }

    fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()))
    }
}

#[test]
fn accelerations_change_as_differences_say() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, seed as u64);
        let by = |part| arm.differences(Function::ForwardDynamics, part);
        close(name, "∂q̈/∂q", &arm.of(Function::AccelerationByPosition), &by(|s| &mut s.q), 1e-7);
        close(name, "∂q̈/∂q̇", &arm.of(Function::AccelerationByVelocity), &by(|s| &mut s.dq), 1e-9);
        close(name, "∂q̈/∂τ", &arm.of(Function::MassMatrixInverse), &by(|s| &mut s.tau), 1e-9);
    }
}

#[test]
fn rates_of_matrices_agree_with_their_other_forms() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, 100 + seed as u64);
        let coriolis = arm.of(Function::CoriolisMatrix);
        close(
            name,
            "Ḃ",
            &arm.of(Function::MassMatrixRate),
            &coriolis.plus(&coriolis.transpose(), 1.0),
            1e-12,
        );
        let velocities = Matrix::column(&arm.state.dq);
        let rate = arm.of(Function::JacobianRate);
        close(name, "J̇·q̇", &rate.times(&velocities), &arm.of(Function::JacobianRateTimesVelocity), 1e-12);
        let torque = arm.of(Function::Jacobian).transpose().times(&Matrix::column(&arm.state.f));
        close(name, "Jᵀ·f", &arm.of(Function::JacobianTransposeTimes), &torque, 1e-12);
        // f·J̇·e = Σ fᵀ·∂J/∂qₖ·e·q̇ₖ
        let by_position = arm.of(Function::JacobianTransposeTimesByPosition);
        close(
            name,
            "∂(Jᵀ·f)/∂q·q̇",
            &by_position.times(&velocities),
            &rate.transpose().times(&Matrix::column(&arm.state.f)),
            1e-12,
        );
        let errors = Matrix::column(&arm.state.e);
        let along = arm.of(Function::MassMatrixTimesByPosition).times(&velocities);
        close(name, "∂(B·e)/∂q·q̇", &along, &arm.of(Function::MassMatrixRate).times(&errors), 1e-12);
    }
}

#[test]
fn the_tool_s_inertia_is_khatib_s() {
    let mut six = 0;
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, 200 + seed as u64);
        let (jacobian, inverse) = (arm.of(Function::Jacobian), arm.of(Function::MassMatrixInverse));
        let expected = jacobian.times(&inverse).times(&jacobian.transpose());
        close(name, "Λ⁻¹", &arm.of(Function::TaskInertiaInverse), &expected, 1e-12);
        if !arm.has(Function::TaskInertia) {
            let refused = Evaluator::new(&arm.model, Function::TaskInertia, SetKind::Minimal).unwrap_err();
            assert!(refused.to_string().contains("cannot accelerate in every direction"), "{refused}");
            continue;
        }
        six += 1;
        let inertia = arm.of(Function::TaskInertia);
        close(name, "Λ·Λ⁻¹", &inertia.times(&expected), &Matrix::identity(6), 1e-8);
        let consistent = arm.of(Function::ConsistentInverse);
        close(name, "J̄", &consistent, &inverse.times(&jacobian.transpose()).times(&inertia), 1e-8);
        close(name, "J·J̄", &jacobian.times(&consistent), &Matrix::identity(6), 1e-8);
    }
    assert!(six >= 3);
}
