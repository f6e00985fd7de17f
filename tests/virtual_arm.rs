//! The virtual arm's numeric dynamics against references that share nothing with them: stored numbers of
//! another library, Lagrange's equations of an energy written from homogeneous transforms, and conservation
//! of energy.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::Arm;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use powerball::identification::chain::Chain;
use powerball::virtual_arm::{Body, Dynamics};
use rand::{RngExt, SeedableRng};

/// Every kind of joint in both conventions, with and without rotors.
const ARMS: [&str; 4] = [
    r#"
name = "standard, all revolute, rotors"
convention = "standard"
gravity = [0.3, -1.2, -9.81]
joint = [
  { kind = "revolute", a = 0.1, alpha = "pi/2", d = 0.2, theta = "0", rotor_ratio = 160 },
  { kind = "revolute", a = 0.35, alpha = "pi", d = 0.0, theta = "pi/2", rotor_ratio = 1 },
  { kind = "revolute", a = -0.02, alpha = 0.7, d = 0.1, theta = "pi/2", rotor_ratio = 100 },
  { kind = "revolute", a = 0.0, alpha = "-pi/2", d = 0.305, theta = 0.3 },
]"#,
    r#"
name = "modified, all revolute, rotors"
convention = "modified"
gravity = [0.0, 0.0, -9.81]
joint = [
  { kind = "revolute", a = 0.0, alpha = "0", d = 0.3, theta = "0", rotor_ratio = 50 },
  { kind = "revolute", a = 0.2, alpha = "-pi/2", d = 0.2435, theta = "0", rotor_ratio = 80 },
  { kind = "revolute", a = 0.4318, alpha = 0.4, d = -0.0934, theta = 0.2, rotor_ratio = 1.5 },
  { kind = "revolute", a = -0.0203, alpha = "pi/2", d = 0.4331, theta = "0" },
]"#,
    r#"
name = "standard, with sliding joints"
convention = "standard"
gravity = [0.0, 2.0, -9.0]
joint = [
  { kind = "revolute", a = 0.0, alpha = "-pi/2", d = 0.412, theta = "0", rotor_ratio = 30 },
  { kind = "prismatic", a = 0.1, alpha = 0.5, d = 0.1, theta = 0.4, rotor_ratio = 200 },
  { kind = "revolute", a = 0.2, alpha = "pi/2", d = 0.154, theta = "0" },
  { kind = "prismatic", a = 0.0, alpha = "0", d = 0.1, theta = "-pi/2", rotor_ratio = 20 },
  { kind = "revolute", a = 0.05, alpha = "pi/2", d = 0.0, theta = "0", rotor_ratio = 10 },
]"#,
    r#"
name = "modified, with sliding joints"
convention = "modified"
gravity = [1.0, 2.0, -9.0]
joint = [
  { kind = "prismatic", a = 0.1, alpha = 0.3, d = 0.0, theta = 0.2, rotor_ratio = 40 },
  { kind = "revolute", a = 0.2, alpha = -0.8, d = 0.1, theta = "0", rotor_ratio = 60 },
  { kind = "prismatic", a = 0.3, alpha = "pi/2", d = 0.1, theta = 0.4, rotor_ratio = 200 },
  { kind = "revolute", a = 0.1, alpha = 1.1, d = 0.2, theta = "pi/2", rotor_ratio = 10 },
]"#,
];

fn random_body(rng: &mut ChaCha8Rng) -> Body {
    let b: Matrix3<f64> = Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let c = Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2));
    // A tensor from a density: trace(S)·E − S with S positive definite.
    let s: Matrix3<f64> = 0.01 * b * b.transpose() + 0.002 * Matrix3::identity();
    let tensor = Matrix3::identity() * s.trace() - s;
    Body::about_centre(rng.random_range(0.5..4.0), c, tensor, rng.random_range(1e-5..1e-4))
}

fn random_dynamics(text: &str, rng: &mut ChaCha8Rng) -> (Arm, Dynamics) {
    let arm = Arm::parse(text, "test").unwrap_or_else(|e| panic!("{e}"));
    let bodies = (0..arm.dof()).map(|_| random_body(rng)).collect();
    let dynamics = Dynamics::new(Chain::new(&arm), bodies).unwrap();
    (arm, dynamics)
}

fn random_state(n: usize, rng: &mut ChaCha8Rng) -> [Vec<f64>; 3] {
    [(); 3].map(|()| (0..n).map(|_| rng.random_range(-2.0..2.0)).collect())
}

fn assert_close(what: &str, got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len(), "{what}");
    let scale = want.iter().fold(1e-3, |m: f64, v| m.max(v.abs()));
    for (i, (g, w)) in got.iter().zip(want).enumerate() {
        assert!((g - w).abs() <= tolerance * scale, "{what}[{i}]: {g} against {w}, scale {scale}");
    }
}

/// The Lagrangian, written from the definition of the table alone: homogeneous transforms and
/// pseudo-inertias.
mod lagrangian {
    use super::*;
    use dyngen::arm::{Convention, JointKind};
    use dyngen::exact::rational::to_f64;

    fn turn(axis: usize, angle: f64) -> Matrix4<f64> {
        let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        nalgebra::Rotation3::from_axis_angle(&axes[axis], angle).to_homogeneous()
    }

    fn shift(axis: usize, by: f64) -> Matrix4<f64> {
        let mut v = Vector3::zeros();
        v[axis] = by;
        Matrix4::new_translation(&v)
    }

    /// One joint's transform and its derivative by q.
    fn joint(arm: &Arm, i: usize, q: f64) -> (Matrix4<f64>, Matrix4<f64>) {
        let row = &arm.joints[i];
        let revolute = row.kind == JointKind::Revolute;
        let (a, d) = (to_f64(&row.a), to_f64(&row.d));
        let (theta, d) = if revolute { (row.theta.radians() + q, d) } else { (row.theta.radians(), d + q) };
        let (spin, slide) = (turn(2, theta), shift(2, d));
        let mut generator = Matrix4::zeros();
        if revolute {
            (generator[(0, 1)], generator[(1, 0)]) = (-1.0, 1.0);
        } else {
            generator[(2, 3)] = 1.0;
        }
        let bend = turn(0, row.alpha.radians()) * shift(0, a);
        match arm.convention {
            Convention::Standard => (spin * slide * bend, generator * spin * slide * bend),
            Convention::Modified => (bend * spin * slide, bend * generator * spin * slide),
        }
    }

    /// Kinetic minus potential energy.
    pub(super) fn value(arm: &Arm, bodies: &[Body], q: &[f64], dq: &[f64]) -> f64 {
        let gravity = Vector3::from_iterator(arm.gravity.iter().map(to_f64));
        let (mut t, mut t_dot): (Matrix4<f64>, Matrix4<f64>) = (Matrix4::identity(), Matrix4::zeros());
        let mut sum = 0.0;
        for i in 0..bodies.len() {
            let (m, b) = (&arm.joints[i], &bodies[i]);
            // The rotor: k·Im·q̇·z·ω + ½k²·Im·q̇², with ω of link i−1 from Ṙ Rᵀ and z by the table.
            let (r, r_dot) = (t.fixed_view::<3, 3>(0, 0), t_dot.fixed_view::<3, 3>(0, 0));
            let omega: Matrix3<f64> = r_dot * r.transpose();
            let omega = Vector3::new(omega[(2, 1)], omega[(0, 2)], omega[(1, 0)]);
            let z = match arm.convention {
                Convention::Standard => t * Vector4::z(),
                Convention::Modified => t * turn(0, m.alpha.radians()) * Vector4::z(),
            };
            let k = m.rotor_ratio.as_ref().map_or(0.0, to_f64);
            sum += k * b.rotor * dq[i] * z.xyz().dot(&omega) + 0.5 * k * k * b.rotor * dq[i] * dq[i];

            let (j, j_prime) = joint(arm, i, q[i]);
            t_dot = t_dot * j + t * j_prime * dq[i];
            t *= j;
            // ½ tr(Ṫ J Ṫᵀ) with J = ∫ (x,1)(x,1)ᵀ dm.
            let second = Matrix3::identity() * (0.5 * b.inertia.trace()) - b.inertia;
            let mut pseudo: Matrix4<f64> = second.to_homogeneous();
            pseudo.fixed_view_mut::<3, 1>(0, 3).copy_from(&b.moment);
            pseudo.fixed_view_mut::<1, 3>(3, 0).copy_from(&b.moment.transpose());
            pseudo[(3, 3)] = b.mass;
            sum += 0.5 * (t_dot * pseudo * t_dot.transpose()).trace();
            let weighted = t * Vector4::new(b.moment.x, b.moment.y, b.moment.z, b.mass);
            sum += gravity.dot(&weighted.xyz());
        }
        sum
    }

    /// Lagrange's equations by finite differences of [`value`].
    pub(super) fn torque(arm: &Arm, bodies: &[Body], q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let n = q.len();
        let moved = |v: &[f64], i: usize, by: f64| -> Vec<f64> {
            v.iter().enumerate().map(|(k, x)| if k == i { x + by } else { *x }).collect()
        };
        // Fourth-order central differences.
        let slope =
            |f: &dyn Fn(f64) -> f64, h: f64| (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h);
        (0..n)
            .map(|i| {
                // The kinetic energy is quadratic in the velocities: a step of 1 is exact.
                let momentum = |s: f64| {
                    let at_q: Vec<f64> = (0..n).map(|k| q[k] + s * dq[k] + 0.5 * s * s * ddq[k]).collect();
                    let at_dq: Vec<f64> = (0..n).map(|k| dq[k] + s * ddq[k]).collect();
                    0.5 * (value(arm, bodies, &at_q, &moved(&at_dq, i, 1.0))
                        - value(arm, bodies, &at_q, &moved(&at_dq, i, -1.0)))
                };
                let along_q = |s: f64| value(arm, bodies, &moved(q, i, s), dq);
                slope(&momentum, 1e-3) - slope(&along_q, 1e-3)
            })
            .collect()
    }
}

#[test]
fn torques_are_lagranges_equations() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for text in ARMS {
        let (arm, dynamics) = random_dynamics(text, &mut rng);
        for _ in 0..20 {
            let [q, dq, ddq] = random_state(arm.dof(), &mut rng);
            let want = lagrangian::torque(&arm, dynamics.bodies(), &q, &dq, &ddq);
            // Differences of the fourth order with h = 1e-3 lose about h⁴ and 1e-16/h.
            assert_close(&arm.name, &dynamics.inverse(&q, &dq, &ddq), &want, 1e-9);
            let energy = dynamics.kinetic_energy(&q, &dq) - dynamics.potential_energy(&q);
            let rotors_and_bodies = lagrangian::value(&arm, dynamics.bodies(), &q, &dq);
            approx::assert_relative_eq!(energy, rotors_and_bodies, max_relative = 1e-11, epsilon = 1e-11);
        }
    }
}

#[test]
fn the_functions_belong_together() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for text in ARMS {
        let (arm, dynamics) = random_dynamics(text, &mut rng);
        let n = arm.dof();
        let product = |m: &[f64], v: &[f64]| -> Vec<f64> {
            (0..n)
                .map(|i| m[i * v.len()..(i + 1) * v.len()].iter().zip(v).map(|(a, b)| a * b).sum())
                .collect()
        };
        let parameters: Vec<f64> = dynamics.bodies().iter().flat_map(Body::parameters).collect();
        for _ in 0..10 {
            let [q, dq, ddq] = random_state(n, &mut rng);
            let tau = dynamics.inverse(&q, &dq, &ddq);
            assert_close("Y·π", &product(&dynamics.regressor(&q, &dq, &ddq), &parameters), &tau, 1e-12);

            let (b, c, g) =
                (dynamics.mass_matrix(&q), dynamics.coriolis_matrix(&q, &dq), dynamics.gravity(&q));
            let terms = [product(&b, &ddq), product(&c, &dq), g];
            let sum: Vec<f64> = (0..n).map(|i| terms.iter().map(|t| t[i]).sum()).collect();
            assert_close("B·ddq + C·dq + g", &sum, &tau, 1e-12);
            assert_close("forward dynamics", &dynamics.forward(&q, &dq, &tau).unwrap(), &ddq, 1e-9);

            // Ḃ − 2C is skew-symmetric for the Christoffel matrix, and Ḃ = C + Cᵀ.
            let h = 1e-5;
            let along = |s: f64| dynamics.mass_matrix(&(0..n).map(|k| q[k] + s * dq[k]).collect::<Vec<_>>());
            let b_dot: Vec<f64> = along(h).iter().zip(along(-h)).map(|(p, m)| (p - m) / (2.0 * h)).collect();
            let twice: Vec<f64> = (0..n * n).map(|k| c[k] + c[(k % n) * n + k / n]).collect();
            assert_close("Ḃ = C + Cᵀ", &twice, &b_dot, 1e-7);
            let mirrored: Vec<f64> = (0..n * n).map(|k| b[(k % n) * n + k / n]).collect();
            assert_close("B symmetric", &b, &mirrored, 1e-13);
        }
    }
}

#[test]
fn energy_stays_without_torque_and_work_is_its_change_with_torque() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for text in ARMS {
        let (arm, dynamics) = random_dynamics(text, &mut rng);
        let n = arm.dof();
        for push in [0.0, 3.0] {
            let [mut q, mut dq, _] = random_state(n, &mut rng);
            // State: q, dq and the work done so far.
            let torque = |t: f64, i: usize| push * (3.0 * t + i as f64).sin();
            let slope = |t: f64, q: &[f64], dq: &[f64]| -> (Vec<f64>, f64) {
                let tau: Vec<f64> = (0..n).map(|i| torque(t, i)).collect();
                (dynamics.forward(q, dq, &tau).unwrap(), tau.iter().zip(dq).map(|(a, b)| a * b).sum())
            };
            let energy =
                |q: &[f64], dq: &[f64]| dynamics.kinetic_energy(q, dq) + dynamics.potential_energy(q);
            let start = energy(&q, &dq);
            let largest_part = dynamics.kinetic_energy(&q, &dq).abs() + dynamics.potential_energy(&q).abs();
            let (mut work, h) = (0.0, 5e-4);
            let step = |x: &[f64], v: &[f64], s: f64| -> Vec<f64> {
                x.iter().zip(v).map(|(x, v)| x + s * v).collect()
            };
            for k in 0..1000 {
                let t = k as f64 * h;
                let (a1, w1) = slope(t, &q, &dq);
                let v2 = step(&dq, &a1, h / 2.0);
                let (a2, w2) = slope(t + h / 2.0, &step(&q, &dq, h / 2.0), &v2);
                let v3 = step(&dq, &a2, h / 2.0);
                let (a3, w3) = slope(t + h / 2.0, &step(&q, &v2, h / 2.0), &v3);
                let v4 = step(&dq, &a3, h);
                let (a4, w4) = slope(t + h, &step(&q, &v3, h), &v4);
                for i in 0..n {
                    q[i] += h / 6.0 * (dq[i] + 2.0 * v2[i] + 2.0 * v3[i] + v4[i]);
                    dq[i] += h / 6.0 * (a1[i] + 2.0 * a2[i] + 2.0 * a3[i] + a4[i]);
                }
                work += h / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4);
            }
            let drift = energy(&q, &dq) - start - work;
            assert!(drift.abs() < 1e-6 * (1.0 + largest_part), "{}: {drift} of {largest_part}", arm.name);
            assert!(push == 0.0 || work.abs() > 1e-3, "the torques must do some work");
        }
    }
}

#[test]
fn numbers_agree_with_pinocchio() {
    let text = include_str!("data/pinocchio_lwa4p.json");
    let json: serde_json::Value = serde_json::from_str(text).unwrap();
    let numbers = |v: &serde_json::Value| -> Vec<f64> {
        v.as_array()
            .unwrap()
            .iter()
            .flat_map(|x| x.as_array().cloned().unwrap_or(vec![x.clone()]))
            .map(|x| x.as_f64().unwrap())
            .collect()
    };
    let arm = Arm::parse(include_str!("../powerball/arm.toml"), "arm.toml").unwrap();
    let bodies = json["dh_inertias"]
        .as_array()
        .unwrap()
        .iter()
        .map(|link| {
            let tensor = Matrix3::from_row_slice(&numbers(&link["Ic"]));
            Body::about_centre(
                link["m"].as_f64().unwrap(),
                Vector3::from_row_slice(&numbers(&link["c"])),
                tensor,
                0.0,
            )
        })
        .collect();
    let dynamics = Dynamics::new(Chain::new(&arm), bodies).unwrap();
    let [q, v, a] = ["q", "v", "a"].map(|key| numbers(&json[key]));
    assert_close("tau", &dynamics.inverse(&q, &v, &a), &numbers(&json["tau"]), 1e-12);
    assert_close("M", &dynamics.mass_matrix(&q), &numbers(&json["M"]), 1e-12);
    assert_close("C", &dynamics.coriolis_matrix(&q, &v), &numbers(&json["C"]), 1e-12);
    assert_close("g", &dynamics.gravity(&q), &numbers(&json["g"]), 1e-12);
}

#[test]
fn an_outside_force_does_the_work_that_it_should() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for text in ARMS {
        let (arm, dynamics) = random_dynamics(text, &mut rng);
        let n = arm.dof();
        let [q, dq, ddq] = random_state(n, &mut rng);
        let force = [3.0, -5.0, 7.0];
        let free = dynamics.inverse(&q, &dq, &ddq);
        let pushed = dynamics.inverse_in_contact(&q, &dq, &ddq, force, [0.0; 3]);
        // Virtual work: the joints give up Fᵀ ∂p/∂q.
        for i in 0..n {
            let tip = |by: f64| {
                let mut moved = q.clone();
                moved[i] += by;
                dynamics.chain().poses(&moved)[n - 1].1
            };
            let jacobian = (tip(1e-6) - tip(-1e-6)) / 2e-6;
            let want = -jacobian.dot(&Vector3::from(force));
            approx::assert_relative_eq!(pushed[i] - free[i], want, epsilon = 1e-7);
        }
    }
}
