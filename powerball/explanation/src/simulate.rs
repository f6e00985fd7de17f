//! Simulation of an arm that moves by a torque model, under a control law that uses the same model or another
//! one.
//!
//! B(q)·q̈ + C·q̇ + g + friction + effects = τ, with a zero-order hold of τ over a cycle. Each of ten steps a
//! cycle is linearly implicit in Eq. 16: friction is s·q̇' against the new velocity q̇', with s = f(q̇')/q̇'
//! found by iteration, so that a joint sticks without chatter. Effects are taken at the old velocity.

use super::torque_model::{ModelFile, ModelOnArm};
use dyngen::Arm;
use nalgebra::{SMatrix, SVector};
use powerball_controller::correction::{Instant, Memory, Term, add_torques};
use powerball_controller::dynamics::{ArmModel, Reference, State};
use powerball_controller::friction::TanhFriction;
use powerball_controller::laws::{ComputedTorque, JointImpedance, largest_pole};
use powerball_logs::motion::Motion;

/// Steps a cycle.
const STEPS: usize = 10;
/// Iterations for the friction of a step.
const ITERATIONS: usize = 8;
/// Below this a joint rests, rad/s: friction is its slope there.
const REST: f64 = 1e-9;
/// A joint that is faster than this is lost, rad/s.
const LOST: f64 = 1e3;

/// How the arm is controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Gravity alone is compensated.
    Gravity,
    /// [`ComputedTorque`] with the model's friction and effects along the path.
    ComputedTorque {
        /// rad/s.
        bandwidth: f64,
        /// Ratio.
        damping: f64,
    },
    /// [`JointImpedance`] with the model's friction and effects along the path.
    Impedance {
        /// rad/s at the path's first pose.
        bandwidth: f64,
        /// Ratio.
        damping: f64,
    },
}

/// The input of a controller in a cycle; n values each.
#[derive(Clone, Copy, Debug)]
pub struct Cycle<'a> {
    /// Since the path began, s.
    pub t: f64,
    /// Positions and velocities, as the encoders have them.
    pub q: &'a [f64],
    /// rad/s.
    pub dq: &'a [f64],
    /// The path: `[q, q̇, q̈]`.
    pub reference: [&'a [f64]; 3],
}

/// The simulated motion: n values per sample, one sample per cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moved {
    /// Positions, rad.
    pub q: Vec<f64>,
    /// Velocities, rad/s.
    pub dq: Vec<f64>,
    /// Torque of the motors, N·m.
    pub torque: Vec<f64>,
}

/// Why there is no motion.
#[derive(Debug)]
pub enum SimulateError<E> {
    /// A model, a path or a gain that cannot be, in words.
    Input(String),
    /// The arm ran away: joint from 1, time in s.
    Lost(usize, f64),
    /// An error of the controller.
    Controller(E),
}

/// Moves an arm along a path: `plant` is how it truly is, `known` what the law has of it.
///
/// # Errors
/// Models of another arm, arms of more than 7 joints, gains that are not stable at the path's rate.
pub fn simulate(
    arm: &Arm,
    plant: &ModelFile,
    known: &ModelFile,
    law: Law,
    path: &Motion,
) -> Result<Moved, SimulateError<std::convert::Infallible>> {
    with_joints!(arm.dof(), N => {
        let known = ModelOnArm::<N>::new(arm, known, true).map_err(SimulateError::Input)?;
        let mut control = controller(&known, law, path)?;
        run::<N, _>(arm, plant, path, |cycle| Ok(control(cycle)))
    })
}

/// Like [`simulate`], with a controller of the caller, which gives n torques, N·m.
///
/// # Errors
/// The errors of [`simulate`], and those of the controller.
pub fn simulate_with<E>(
    arm: &Arm,
    plant: &ModelFile,
    path: &Motion,
    control: impl FnMut(&Cycle<'_>) -> Result<Vec<f64>, E>,
) -> Result<Moved, SimulateError<E>> {
    with_joints!(arm.dof(), N => run::<N, E>(arm, plant, path, control))
}

/// Code for a number of joints that is known at run time alone.
macro_rules! with_joints {
    ($dof:expr, $n:ident => $body:expr) => {
        with_joints!(@ $dof, $n => $body, 1 2 3 4 5 6 7)
    };
    (@ $dof:expr, $n:ident => $body:expr, $($joints:literal)+) => {
        match $dof {
            $($joints => { const $n: usize = $joints; $body })+
            other => Err(SimulateError::Input(format!("the arm has {other} joints, 1 to 7 can be \
                simulated"))),
        }
    };
}
use with_joints;

/// The controller of a law: torques of a cycle.
fn controller<'a, E, const N: usize>(
    known: &'a ModelOnArm<N>,
    law: Law,
    path: &'a Motion,
) -> Result<impl FnMut(&Cycle<'_>) -> Vec<f64> + 'a, SimulateError<E>> {
    let start = SVector::<f64, N>::from_fn(|j, _| path.q.get(j).copied().unwrap_or(0.0));
    let inertia = known.numeric.mass_matrix(&start);
    let computed = |bandwidth: f64, damping: f64| {
        let mut law = ComputedTorque::<f64, N>::of_bandwidth(bandwidth);
        law.derivative *= damping;
        law
    };
    let impedance =
        move |bandwidth: f64, damping: f64| JointImpedance::of_inertia(&inertia, bandwidth, damping);
    let gains = match law {
        Law::Gravity => None,
        Law::ComputedTorque { bandwidth, damping } => {
            Some(computed(bandwidth, damping).stiffness_and_damping(&inertia))
        }
        Law::Impedance { bandwidth, damping } => Some(impedance(bandwidth, damping).stiffness_and_damping()),
    };
    if let Some([stiffness, damping]) = gains {
        let pole = largest_pole(&inertia, &stiffness, &damping, path.period);
        if !pole.is_stable() {
            return Err(SimulateError::Input(format!(
                "these gains are not stable at {:.0} Hz: the largest pole of the sampled loop is {:.4} where \
                    the path begins, and must be below 1. Take a lower bandwidth, or damping above 0",
                1.0 / path.period,
                pole.0
            )));
        }
    }
    let planned = known.model.planned(&known.body, path, 0.0);
    Ok(move |cycle: &Cycle<'_>| {
        let vector = |x: &[f64]| SVector::<f64, N>::from_column_slice(x);
        let state = State { q: vector(cycle.q), dq: vector(cycle.dq) };
        let [q, dq, ddq] = cycle.reference.map(vector);
        let reference = Reference { q, dq, ddq };
        let k = (cycle.t / path.period).round() as usize;
        let losses = SVector::<f64, N>::from_fn(|j, _| {
            [&planned.friction, &planned.effects].iter().filter_map(|part| part.get(k * N + j)).sum()
        });
        let torque = match law {
            Law::Gravity => known.numeric.gravity(&state.q),
            Law::ComputedTorque { bandwidth, damping } => {
                computed(bandwidth, damping).torque(&known.numeric, &state, &reference) + losses
            }
            Law::Impedance { bandwidth, damping } => {
                impedance(bandwidth, damping).torque(&known.numeric, &state, &reference) + losses
            }
        };
        torque.as_slice().to_vec()
    })
}

fn run<const N: usize, E>(
    arm: &Arm,
    plant: &ModelFile,
    path: &Motion,
    mut control: impl FnMut(&Cycle<'_>) -> Result<Vec<f64>, E>,
) -> Result<Moved, SimulateError<E>> {
    if path.dof() != N || path.is_empty() || !(path.period.is_finite() && path.period > 0.0) {
        let what =
            format!("the path must have samples of {N} joints at even times, and has {} joints", path.dof());
        return Err(SimulateError::Input(what));
    }
    let on = ModelOnArm::<N>::new(arm, plant, true).map_err(SimulateError::Input)?;
    let mut plant = Plant::new(&on, path);
    let mut moved = Moved::default();
    for (k, reference) in path.samples().enumerate() {
        let (t, q, dq) = (k as f64 * path.period, plant.state.q, plant.state.dq);
        let cycle = Cycle { t, q: q.as_slice(), dq: dq.as_slice(), reference };
        let asked = control(&cycle).map_err(SimulateError::Controller)?;
        let torque = match asked.len() == N && asked.iter().all(|x| x.is_finite()) {
            true => SVector::<f64, N>::from_column_slice(&asked),
            false => {
                let what = format!(
                    "the controller gave {asked:?} at {t:.3} s: {N} finite torques in N·m are needed"
                );
                return Err(SimulateError::Input(what));
            }
        };
        moved.q.extend_from_slice(q.as_slice());
        moved.dq.extend_from_slice(dq.as_slice());
        moved.torque.extend_from_slice(torque.as_slice());
        for _ in 0..STEPS {
            plant.step(&torque, path.period / STEPS as f64);
        }
        let fine = |x: &f64| x.is_finite() && x.abs() < LOST;
        if let Some(joint) = plant.state.dq.iter().position(|x| !fine(x)) {
            return Err(SimulateError::Lost(joint + 1, t));
        }
    }
    Ok(moved)
}

/// The arm as it moves.
struct Plant<'a, const N: usize> {
    on: &'a ModelOnArm<N>,
    laws: Vec<TanhFriction<f64>>,
    terms: Vec<Term<f64>>,
    memory: Vec<Memory<f64>>,
    state: State<f64, N>,
    ddq: SVector<f64, N>,
    time: f64,
}

impl<'a, const N: usize> Plant<'a, N> {
    /// The arm at rest where the path begins.
    fn new(on: &'a ModelOnArm<N>, path: &Motion) -> Self {
        let terms: Vec<Term<f64>> = on.model.terms().iter().map(|t| t.term).collect();
        let q = SVector::from_fn(|j, _| path.q.get(j).copied().unwrap_or(0.0));
        Plant {
            on,
            laws: on.model.gammas().into_iter().map(TanhFriction::new).collect(),
            memory: vec![Memory::default(); terms.len()],
            terms,
            state: State { q, dq: SVector::zeros() },
            ddq: SVector::zeros(),
            time: 0.0,
        }
    }

    fn step(&mut self, torque: &SVector<f64, N>, h: f64) {
        let State { q, dq } = self.state;
        let arm = &self.on.numeric;
        let inertia = arm.mass_matrix(&q);
        let rigid = inertia * self.ddq + arm.coriolis_times_velocity(&q, &dq) + arm.gravity(&q);
        let free = torque - (rigid - inertia * self.ddq) - self.effects(&rigid);
        let Some(next) = self.velocity(&inertia, &dq, &free, h) else { return };
        self.ddq = (next - dq) / h;
        self.state = State { q: q + next * h, dq: next };
        self.time += h;
    }

    /// The new velocity: B·(q̇' − q̇) = h·(free − f(q̇')).
    fn velocity(
        &self,
        inertia: &SMatrix<f64, N, N>,
        dq: &SVector<f64, N>,
        free: &SVector<f64, N>,
        h: f64,
    ) -> Option<SVector<f64, N>> {
        let mut next = *dq;
        for _ in 0..ITERATIONS {
            let secant = SVector::<f64, N>::from_fn(|j, _| {
                let law = &self.laws[j];
                if next[j].abs() < REST { law.slope(0.0) } else { law.torque(next[j]) / next[j] }
            });
            let left = inertia + SMatrix::from_diagonal(&(secant * h));
            next = left.cholesky()?.solve(&(inertia * dq + free * h));
        }
        Some(next)
    }

    /// Torque of what goes beyond rigid arm and Eq. 16.
    fn effects(&mut self, rigid: &SVector<f64, N>) -> SVector<f64, N> {
        let State { q, dq } = self.state;
        let place = SVector::<f64, N>::from_fn(|j, _| q[j] - self.on.model.additions.log_changes.offset(j));
        let friction = SVector::<f64, N>::from_fn(|j, _| self.laws[j].torque(dq[j]));
        let now = Instant {
            q: place.as_slice(),
            dq: dq.as_slice(),
            ddq: self.ddq.as_slice(),
            rigid: rigid.as_slice(),
            friction: friction.as_slice(),
            temperature: &[],
            running: self.time,
        };
        let mut torque = SVector::<f64, N>::zeros();
        add_torques(&self.terms, &mut self.memory, &now, torque.as_mut_slice());
        torque
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pendulum of 2 kg at 0.5 m, in a plane with gravity along −y.
    const ARM: &str = "name = \"pendulum\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\n\
        kind = \"revolute\"\na = 0.5\nalpha = 0\nd = 0\ntheta = 0\n";
    const INERTIA: f64 = 0.5;
    const WEIGHT: f64 = 9.81;

    fn arm() -> Arm {
        Arm::parse(ARM, "pendulum.toml").unwrap()
    }

    /// Friction γ1·tanh(γ2·q̇) + γ5·q̇, and a spring where `spring` is not 0.
    fn model(gammas: [f64; 5], spring: f64) -> ModelFile {
        let body = powerball_logs::regression::RigidArm::new(&arm()).unwrap();
        // m = 2, mx = −0 about the frame at the end: I about the axis is m·a², so all mass at the frame.
        let all: Vec<f64> = dyngen::arm::ParameterKind::ALL
            .iter()
            .map(|kind| if *kind == dyngen::arm::ParameterKind::M { 2.0 } else { 0.0 })
            .collect();
        let values = body.model().set_values(body.model().set(dyngen::SetKind::Minimal).unwrap(), &all);
        let parameters: Vec<_> = (body.names().iter().zip(values))
            .map(|(name, value)| serde_json::json!({"name": name, "value": value}))
            .collect();
        let [g1, g2, g3, g4, g5] = gammas;
        let mut json = serde_json::json!({
            "arm": "pendulum", "set": "minimal", "parameters": parameters,
            "friction": [{"joint": 1, "gamma1": g1, "gamma2": g2, "gamma3": g3, "gamma4": g4, "gamma5": g5}],
        });
        if spring != 0.0 {
            json["terms"] = serde_json::json!([{"effect": "spring", "joint": 1, "law": "position", "coefficient": spring}]);
        }
        ModelFile::parse(&json.to_string(), "model.json".as_ref()).unwrap()
    }

    fn still(q: f64, cycles: usize) -> Motion {
        let mut path = Motion::new(1, 0.002);
        (0..cycles).for_each(|_| path.push([[q, 0.0, 0.0]]));
        path
    }

    /// Without torque and losses a pendulum keeps its energy and swings as the elliptic integral says.
    #[test]
    fn a_free_pendulum_swings_with_its_period_and_energy() {
        let from = -std::f64::consts::FRAC_PI_2 + 1.0;
        let none = |_: &Cycle<'_>| Ok::<_, std::convert::Infallible>(vec![0.0]);
        let path = still(from, 3000);
        let moved = simulate_with(&arm(), &model([0.0; 5], 0.0), &path, none).unwrap();
        // T = 4·√(a/g)·K(sin(1/2)) by the arithmetic-geometric mean.
        let (mut a, mut b) = (1.0, 0.5f64.cos());
        for _ in 0..6 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        let period = std::f64::consts::TAU * (0.5f64 / 9.81).sqrt() / a;
        let crossings: Vec<f64> = (1..3000)
            .filter(|k| moved.dq[k - 1] > 0.0 && moved.dq[*k] <= 0.0)
            .map(|k| 0.002 * k as f64)
            .collect();
        let measured = (crossings[2] - crossings[0]) / 2.0;
        assert!((measured - period).abs() < 2e-3, "{measured} {period}");
        let energy = |k: usize| 0.5 * INERTIA * moved.dq[k].powi(2) + WEIGHT * moved.q[k].sin();
        assert!(
            (0..3000).all(|k| (energy(k) - energy(0)).abs() < 0.02 * WEIGHT),
            "{} {}",
            energy(0),
            energy(2999)
        );
    }

    /// Dry friction holds what is less than it, and constant torque against viscous friction ends at their
    /// quotient.
    #[test]
    fn a_joint_sticks_and_reaches_its_speed() {
        let gravity = |q: f64| WEIGHT * q.cos();
        let held = |push: f64| {
            let path = still(0.3, 1000);
            let control = |c: &Cycle<'_>| Ok::<_, std::convert::Infallible>(vec![gravity(c.q[0]) + push]);
            let moved =
                simulate_with(&arm(), &model([3.0, 400.0, 0.0, 0.0, 2.0], 0.0), &path, control).unwrap();
            moved.dq[999]
        };
        // tanh creeps: at half of its level γ1·tanh(γ2·v) = 1.5.
        assert!((held(1.5) - 0.5f64.atanh() / 400.0).abs() < 1e-4, "{}", held(1.5));
        assert!((held(5.0) - 1.0).abs() < 0.03, "{}", held(5.0));
    }

    #[test]
    fn a_law_that_knows_the_spring_follows_and_one_that_does_not_is_off() {
        let mut path = Motion::new(1, 0.002);
        for k in 0..2000 {
            let w = std::f64::consts::TAU / 4.0;
            let t = 0.002 * f64::from(k);
            path.push([[0.5 * (1.0 - (w * t).cos()), 0.5 * w * (w * t).sin(), 0.5 * w * w * (w * t).cos()]]);
        }
        let gammas = [0.5, 100.0, 0.2, 30.0, 0.8];
        let law = Law::ComputedTorque { bandwidth: 20.0, damping: 1.0 };
        let off = |known: ModelFile| {
            let moved = simulate(&arm(), &model(gammas, 8.0), &known, law, &path).unwrap();
            let errors = moved.q.iter().zip(&path.q).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            (errors / 2000.0).sqrt()
        };
        let [base, explained] = [off(model(gammas, 0.0)), off(model(gammas, 8.0))];
        // A spring of k·q leaves k·q/(B·ω²) at rest: 8·0.61/(0.5·400).
        assert!((0.01..0.05).contains(&base) && explained < 0.1 * base, "{base} {explained}");
        let fast = Law::ComputedTorque { bandwidth: 2000.0, damping: 1.0 };
        let refused = simulate(&arm(), &model(gammas, 0.0), &model(gammas, 0.0), fast, &path);
        assert!(matches!(refused, Err(SimulateError::Input(what)) if what.contains("not stable at 500 Hz")));
    }
}
