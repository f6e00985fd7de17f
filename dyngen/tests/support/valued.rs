//! Arms with values of their parameters, and what their functions give, as matrices.

use super::{State, evaluate, model};
use dyngen::{Evaluator, Function, Model, SetKind};
use rand::SeedableRng;

pub(crate) fn arms() -> Vec<(String, String)> {
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

/// A model with values of its parameters that make B positive definite, and what its functions give at a
/// state.
pub(crate) struct Arm {
    pub(crate) model: Model,
    kind: SetKind,
    pub(crate) values: Vec<f64>,
    pub(crate) state: State,
}

impl Arm {
    pub(crate) fn new(text: &str, seed: u64) -> Arm {
        Arm::of_set(text, SetKind::Minimal, seed)
    }

    pub(crate) fn of_set(text: &str, kind: SetKind, seed: u64) -> Arm {
        let model = model(text);
        let set = model.set(kind).unwrap();
        // A ball of 2 kg at each link's origin, and rotors.
        let of = |k: usize| [2.0, 0.02, -0.03, 0.04, 0.5, 0.0, 0.0, 0.6, 0.0, 0.7, 1e-4][k];
        let all: Vec<f64> = (0..11 * model.arm().links()).map(|i| of(i % 11)).collect();
        let values = model.set_values(set, &all);
        let mut random = chacha20::ChaCha8Rng::seed_from_u64(seed);
        let state = State::draw(&mut random, model.arm().dof(), 1.0);
        Arm { model, kind, values, state }
    }

    pub(crate) fn has(&self, function: Function) -> bool {
        self.model.functions(self.kind).any(|f| f == function)
    }

    pub(crate) fn at(&self, function: Function, state: &State) -> Matrix {
        let evaluator = Evaluator::new(&self.model, function, self.kind).unwrap();
        let values = if function.takes(dyngen::dynamics::function::Argument::Parameters) {
            &self.values[..]
        } else {
            &[]
        };
        let (rows, columns) = evaluator.shape();
        Matrix { columns, values: evaluate(&evaluator, &state.samples(values)), rows }
    }

    pub(crate) fn of(&self, function: Function) -> Matrix {
        self.at(function, &self.state)
    }

    /// The derivative of a function's result as a column by each number of a part of the state, by
    /// Richardson's extrapolation of central differences.
    pub(crate) fn differences(&self, function: Function, part: fn(&mut State) -> &mut Vec<f64>) -> Matrix {
        let column = |j: usize| {
            let difference = |step: f64| {
                let moved = |by: f64| {
                    let mut state = self.state.clone();
                    part(&mut state)[j] += by;
                    self.at(function, &state)
                };
                moved(step).plus(&moved(-step), -1.0).times_number(0.5 / step)
            };
            difference(1e-3).times_number(4.0 / 3.0).plus(&difference(2e-3), -1.0 / 3.0)
        };
        let n = self.model.arm().dof();
        let columns: Vec<Matrix> = (0..n).map(column).collect();
        Matrix::of(columns[0].values.len(), n, |i, j| columns[j].values[i])
    }
}

pub(crate) fn close(name: &str, what: &str, found: &Matrix, expected: &Matrix, tolerance: f64) {
    assert_eq!((found.rows, found.columns), (expected.rows, expected.columns), "{name}: {what}");
    let miss = found.plus(expected, -1.0).largest() / (1.0 + expected.largest());
    assert!(miss < tolerance, "{name}: {what} is off by {miss:e}");
}

/// Row-major.
pub(crate) struct Matrix {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) values: Vec<f64>,
}

impl Matrix {
    pub(crate) fn of(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix {
        let values = (0..rows * columns).map(|k| entry(k / columns, k % columns)).collect();
        Matrix { rows, columns, values }
    }

    pub(crate) fn column(values: &[f64]) -> Matrix {
        Matrix { rows: values.len(), columns: 1, values: values.to_vec() }
    }

    pub(crate) fn identity(n: usize) -> Matrix {
        Matrix::of(n, n, |i, j| f64::from(u8::from(i == j)))
    }

    pub(crate) fn at(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.columns + j]
    }

    pub(crate) fn times(&self, other: &Matrix) -> Matrix {
        assert_eq!(self.columns, other.rows);
        let entry = |i, j| (0..self.columns).map(|k| self.at(i, k) * other.at(k, j)).sum();
        Matrix::of(self.rows, other.columns, entry)
    }

    pub(crate) fn transpose(&self) -> Matrix {
        Matrix::of(self.columns, self.rows, |i, j| self.at(j, i))
    }

    pub(crate) fn plus(&self, other: &Matrix, factor: f64) -> Matrix {
        Matrix::of(self.rows, self.columns, |i, j| self.at(i, j) + factor * other.at(i, j))
    }

    pub(crate) fn times_number(&self, factor: f64) -> Matrix {
        Matrix::of(self.rows, self.columns, |i, j| factor * self.at(i, j))
    }

    pub(crate) fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()))
    }
}
