//! Joints that follow others: every function is proven, and equals what the same chain with every joint free
//! gives at q_chain = G·q + o, projected by Gᵀ; ranks are those of the regressor's columns in numbers.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::dynamics::function::Size;
use dyngen::exact::rational::to_f64;
use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use rand::{RngExt, SeedableRng};
use support::{State, evaluate, model, proven, rank};

mod support;

/// A palletizer: a parallelogram keeps the wrist upright.
const PALLETIZER: &str = r#"
name = "palletizer"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = 0, d = 0.5, theta = 0, rotor_ratio = 100 },
    { kind = "revolute", a = 0.3, alpha = "-pi/2", d = 0, theta = "-pi/2", rotor_ratio = 100 },
    { kind = "revolute", a = 1.1, alpha = 0, d = 0, theta = 0, mimic = { joint = 2, ratio = -1 } },
    { kind = "revolute", a = 0.2, alpha = 0, d = 0, theta = "pi/2", rotor_ratio = 80 },
    { kind = "revolute", a = 1.2, alpha = 0, d = 0, theta = 0, mimic = { joint = 4, ratio = -1, offset = 0.3 } },
    { kind = "revolute", a = 0.2, alpha = "pi/2", d = 0.1, theta = 0 },
]
"#;

/// Halves, multiples and decimals, forwards and backwards, a lift of two stages, and a motor of a joint that
/// follows.
const MIXED: &str = r#"
name = "mixed"
convention = "standard"
gravity = [1, 0.5, -9]
joint = [
    { kind = "prismatic", a = 0, alpha = "pi/2", d = 0.1, theta = 0 },
    { kind = "prismatic", a = 0.1, alpha = "-pi/2", d = 0.2, theta = "pi/2", mimic = { joint = 1, ratio = "3/2", offset = -0.05 } },
    { kind = "revolute", a = 0.2, alpha = "pi", d = 0, theta = 0.4, mimic = { joint = 4, ratio = "1/2", offset = 0.2 } },
    { kind = "revolute", a = 0.15, alpha = "pi/2", d = 0.05, theta = 0 },
    { kind = "revolute", a = 0.12, alpha = 0, d = 0.03, theta = 0, rotor_ratio = 30, mimic = { joint = 4, ratio = -2 } },
    { kind = "revolute", a = 0.1, alpha = "pi/2", d = 0, theta = "pi/6", mimic = { joint = 3, ratio = 1.06399 } },
]

[[transmission]]
joints = [5, 4]
matrix = [[1, "1/2"], [0, 1]]
"#;

/// A screw, a rack that turns a joint, and a general twist.
const SCREW: &str = r#"
name = "screw"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = 0, d = 0.1, theta = "pi/2" },
    { kind = "prismatic", a = 0.1, alpha = 0, d = 0.2, theta = 0, mimic = { joint = 1, ratio = 0.004, offset = 0.01 } },
    { kind = "prismatic", a = 0.2, alpha = 0.7, d = 0.1, theta = 0 },
    { kind = "revolute", a = 0.05, alpha = "pi/2", d = 0, theta = 0, mimic = { joint = 3, ratio = 20, offset = 0.5 } },
]
"#;

const ARMS: [&str; 3] = [PALLETIZER, MIXED, SCREW];

/// The chain of `text` with every joint free.
fn free(text: &str) -> Model {
    let mut arm = Arm::parse(text, "arm.toml").unwrap();
    arm.joints.iter_mut().for_each(|joint| joint.mimic = None);
    Model::derive(arm).unwrap()
}

/// For the other sets they are proven where they are compared.
#[test]
fn every_function_is_proven_for_every_size() {
    for text in ARMS {
        let model = model(text);
        let functions = model.functions(SetKind::Symbolic).count();
        assert_eq!(proven(&model, SetKind::Symbolic).len(), functions);
    }
}

/// A matrix by rows.
type Matrix = Vec<Vec<f64>>;

fn transpose(a: &Matrix) -> Matrix {
    (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
}

fn dot(u: &[f64], v: &[f64]) -> f64 {
    u.iter().zip(v).map(|(x, y)| x * y).sum()
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transpose(b);
    a.iter().map(|row| columns.iter().map(|column| dot(row, column)).collect()).collect()
}

fn applied(a: &Matrix, v: &[f64]) -> Vec<f64> {
    a.iter().map(|row| dot(row, v)).collect()
}

/// A⁻¹·B by Gauss and Jordan with row pivots.
fn solved(mut a: Matrix, mut b: Matrix) -> Matrix {
    let n = a.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        let scale = a[k][k];
        a[k].iter_mut().chain(&mut b[k]).for_each(|x| *x /= scale);
        for r in (0..n).filter(|r| *r != k) {
            let factor = a[r][k];
            let (row, right) = (a[k].clone(), b[k].clone());
            a[r].iter_mut().zip(&row).chain(b[r].iter_mut().zip(&right)).for_each(|(x, y)| *x -= factor * y);
        }
    }
    b
}

/// G and o of an arm, from its joints alone.
fn chain(arm: &Arm) -> (Matrix, Vec<f64>) {
    let own = arm.coordinates();
    let mut g = vec![vec![0.0; own.len()]; arm.links()];
    let mut o = vec![0.0; arm.links()];
    for (i, joint) in arm.joints.iter().enumerate() {
        let leader = joint.mimic.as_ref().map_or(i, |mimic| mimic.joint);
        let column = own.iter().position(|j| *j == leader).unwrap();
        g[i][column] = joint.mimic.as_ref().map_or(1.0, |mimic| to_f64(&mimic.ratio));
        o[i] = joint.mimic.as_ref().map_or(0.0, |mimic| to_f64(&mimic.offset));
    }
    (g, o)
}

/// The motion of every joint of the chain; what is projected has no torques.
fn of_chain(state: &State, g: &Matrix, o: &[f64]) -> State {
    let of = |v: &[f64]| applied(g, v);
    State {
        q: of(&state.q).iter().zip(o).map(|(q, o)| q + o).collect(),
        dq: of(&state.dq),
        ddq: of(&state.ddq),
        dqr: of(&state.dqr),
        ddqr: of(&state.ddqr),
        e: of(&state.e),
        f: state.f.clone(),
        payload: state.payload.clone(),
        vq: of(&state.vq),
        vdq: of(&state.vdq),
        tau: vec![0.0; o.len()],
    }
}

/// Every function of a model for a set, with values of its parameters.
struct Valued {
    evaluators: Vec<Evaluator>,
    parameters: Vec<f64>,
}

impl Valued {
    fn new(model: &Model, kind: SetKind, all: &[f64]) -> Valued {
        let parameters = model.set_values(model.set(kind).unwrap(), all);
        Valued { evaluators: proven(model, kind), parameters }
    }

    fn at(&self, state: &State, function: Function) -> Matrix {
        let evaluator = &self.evaluators[function as usize];
        let out = evaluate(evaluator, &state.samples(&self.parameters));
        out.chunks(evaluator.shape().1).map(<[f64]>::to_vec).collect()
    }
}

/// Parameters of compact bodies.
fn bodies(arm: &Arm, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut values = Vec::new();
    for _ in 0..arm.links() {
        let mass: f64 = random.random_range(0.5..4.0);
        let r = [0; 3].map(|_| random.random_range(-0.2..0.2));
        let across = |i: usize, j: usize| mass * (0.03 + r[i] * r[i] + r[j] * r[j]);
        values.extend([mass, mass * r[0], mass * r[1], mass * r[2], across(1, 2), mass * r[0] * r[1]]);
        values.extend([mass * r[0] * r[2], across(0, 2), mass * r[1] * r[2], across(0, 1), 1e-4]);
    }
    values
}

#[test]
fn functions_are_those_of_the_free_chain_projected() {
    let mut random = ChaCha8Rng::seed_from_u64(19);
    for text in ARMS {
        let (tied, free) = (model(text), free(text));
        let (g, o) = chain(tied.arm());
        let all = bodies(tied.arm(), &mut random);
        let [minimal, full] = [SetKind::Minimal, SetKind::Full].map(|kind| Valued::new(&tied, kind, &all));
        let free = Valued::new(&free, SetKind::Full, &all);
        let back = transpose(&g);
        for _ in 0..5 {
            let s = State::draw(&mut random, tied.arm().dof(), 1.5);
            let whole = of_chain(&s, &g, &o);
            let free_chain = |function| free.at(&whole, function);
            let mass = times(&back, &times(&free_chain(Function::MassMatrix), &g));
            for function in
                tied.functions(SetKind::Minimal).filter(|f| *f <= Function::JacobianTransposeTimesByPosition)
            {
                let expected = match function {
                    // Tied joints accelerate otherwise than free ones: see `derivatives.rs`.
                    Function::AccelerationByPosition | Function::AccelerationByVelocity => continue,
                    Function::ForwardDynamics => {
                        let still = State { ddq: vec![0.0; g.len()], ..whole.clone() };
                        let bias = free.at(&still, Function::InverseDynamics);
                        let bias = times(&back, &bias);
                        let right = s.tau.iter().zip(&bias).map(|(tau, bias)| vec![tau - bias[0]]);
                        solved(mass.clone(), right.collect())
                    }
                    Function::MassMatrixInverse => {
                        let unit = |i: usize| (0..mass.len()).map(|j| f64::from(u8::from(i == j))).collect();
                        solved(mass.clone(), (0..mass.len()).map(unit).collect())
                    }
                    _ => {
                        let mut result = free_chain(function);
                        let (rows, columns) = function.size();
                        if rows == Size::Joints {
                            result = times(&back, &result);
                        }
                        if columns == Size::Joints {
                            result = times(&result, &g);
                        }
                        result
                    }
                };
                let found = full.at(&s, function);
                close(&found, &expected, &format!("{text} {function}"));
                let takes = function.takes(dyngen::dynamics::function::Argument::Parameters);
                if takes && function != Function::PotentialEnergy {
                    let found = minimal.at(&s, function);
                    close(&found, &expected, &format!("{text} {function}, minimal"));
                }
            }
        }
    }
}

fn close(found: &Matrix, expected: &Matrix, what: &str) {
    let entries = || found.iter().flatten().zip(expected.iter().flatten());
    assert_eq!(found.iter().flatten().count(), expected.iter().flatten().count(), "{what}");
    let scale = entries().fold(1e-3, |m: f64, (_, x)| m.max(x.abs()));
    let error = entries().fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
    assert!(error < 1e-10 * scale, "{what}: {error:e} of {scale:e}\n{found:?}\n{expected:?}");
}

#[test]
fn the_rank_is_that_of_the_columns_in_numbers() {
    let mut random = ChaCha8Rng::seed_from_u64(20);
    for text in ARMS {
        let (tied, free) = (model(text), free(text));
        let (g, o) = chain(tied.arm());
        let regressor = Evaluator::new(&free, Function::Regressor, SetKind::Full).unwrap();
        let p = regressor.shape().1;
        let mut rows = Matrix::new();
        for _ in 0..2 * p {
            let whole = of_chain(&State::draw(&mut random, tied.arm().dof(), 1.5), &g, &o);
            let out = evaluate(&regressor, &whole.samples(&[]));
            rows.extend(times(&transpose(&g), &out.chunks(p).map(<[f64]>::to_vec).collect()));
        }
        let found = rank(transpose(&rows));
        assert_eq!(tied.set(SetKind::Minimal).unwrap().parameters.len(), found, "{text}");
    }
}

#[test]
fn what_cannot_follow_is_reported() {
    let error = |mimic: &str| {
        let text = PALLETIZER.replace("mimic = { joint = 2, ratio = -1 }", mimic);
        assert_ne!(text, PALLETIZER);
        Arm::parse(&text, "arm.toml").unwrap_err().to_string()
    };
    for (mimic, words) in [
        ("mimic = { joint = 7 }", "joint 3: mimic: 7 is no joint of this arm"),
        ("mimic = { joint = 2, ratio = 0 }", "ratio is zero"),
        ("mimic = { ratio = 1 }", "the key 'joint' is missing"),
        ("mimic = 2", "mimic must be a table"),
        ("mimic = { joint = 3 }", "it follows itself"),
        ("mimic = { joint = 2, offset = \"x\" }", "offset"),
        ("mimic = { joint = 2, factor = 2 }", "unknown key 'factor'"),
    ] {
        let message = error(mimic);
        assert!(message.contains(words), "{mimic}: {message}");
        assert!(message.contains("arm.toml:8"), "{mimic}: {message}");
    }
    // One that follows a joint that follows.
    let text =
        PALLETIZER.replace("joint = 4, ratio = -1, offset = 0.3", "joint = 3, ratio = 2, offset = 0.3");
    let arm = Arm::parse(&text, "arm.toml").unwrap();
    let mimic = arm.joints[4].mimic.as_ref().unwrap();
    assert_eq!((mimic.joint, to_f64(&mimic.ratio), to_f64(&mimic.offset)), (1, -2.0, 0.3));
    assert_eq!((arm.dof(), arm.joint_names()), (4, ["1", "2", "3", "4"].map(String::from).to_vec()));
}
