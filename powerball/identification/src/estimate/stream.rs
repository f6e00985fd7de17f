//! Least squares over states that need no filter: any number of blocks in constant memory.
//!
//! For states of a simulation, or of logs that were filtered elsewhere. Steepnesses of friction are given;
//! logs as they were recorded go through [`powerball_logs::summary`] instead.

use super::solve::NormalEquations;
use powerball_logs::parallel;
use powerball_logs::regression::RigidArm;
use powerball_logs::summary::RFactor;

/// Samples that are worked on together: their rows stay in a second-level cache.
const BLOCK: usize = 128;
/// Friction columns of a joint: tanh(γ2·q̇), tanh(γ4·q̇), q̇.
const FRICTION: usize = 3;

/// States and torques of the joints: n numbers a sample, one sample after another.
#[derive(Clone, Copy, Debug)]
pub struct States<'a> {
    /// Positions, rad or m.
    pub q: &'a [f64],
    /// Velocities.
    pub dq: &'a [f64],
    /// Accelerations.
    pub ddq: &'a [f64],
    /// Torques, N·m or N.
    pub tau: &'a [f64],
}

/// The factors of all states so far.
#[derive(Clone, Debug)]
pub struct Stream<'a> {
    body: &'a RigidArm,
    /// γ2, γ4 by joint, s/rad.
    shapes: Vec<[f64; 2]>,
    /// By joint: the columns of the minimal set that are not zero everywhere.
    columns: Vec<Vec<usize>>,
    factors: Vec<RFactor>,
}

/// The fit to the states of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamFit {
    /// The minimal set's values; 0 where nothing determines one.
    pub inertial: Vec<f64>,
    /// γ1 … γ5 by joint, or motor where a transmission couples joints.
    pub friction: Vec<[f64; 5]>,
    /// rms of the error by joint, N·m.
    pub rms: Vec<f64>,
}

impl<'a> Stream<'a> {
    /// No states yet; `shapes` are γ2, γ4 of every joint.
    #[must_use]
    pub fn new(body: &'a RigidArm, shapes: &[[f64; 2]]) -> Stream<'a> {
        let (n, p) = (body.dof(), body.names().len());
        // An entry that is exactly zero at three states without any symmetry is zero.
        let odd = |k: usize| 0.3 + 0.7 * ((k * k) as f64).sin();
        let states: [Vec<f64>; 3] = std::array::from_fn(|s| (0..3 * n).map(|k| odd(k + 3 * n * s)).collect());
        let y = body.regressor(&states[0], &states[1], &states[2]);
        let columns: Vec<Vec<usize>> = (0..n)
            .map(|j| (0..p).filter(|c| (0..3).any(|s| y[(s * n + j) * p + c] != 0.0)).collect())
            .collect();
        let factors = columns.iter().map(|c| RFactor::new(c.len() + FRICTION + 1)).collect();
        Stream { body, shapes: shapes.to_vec(), columns, factors }
    }

    /// Takes states in, on all cores.
    ///
    /// # Panics
    /// Where the slices are not of one length.
    pub fn push(&mut self, states: States<'_>) {
        let n = self.body.dof();
        let count = states.q.len() / n;
        for given in [states.dq, states.ddq, states.tau] {
            assert_eq!(given.len(), states.q.len(), "all slices of a block of states are of one length");
        }
        let turned = self.body.motors().map(|motors| {
            let [q, dq, ddq] = [states.q, states.dq, states.ddq].map(|state| motors.positions(state));
            [q, dq, ddq, motors.torques(states.tau, 1)]
        });
        let states = match &turned {
            None => states,
            Some([q, dq, ddq, tau]) => States { q, dq, ddq, tau },
        };
        let cores = parallel::threads();
        let shares: Vec<(usize, usize)> =
            (0..cores).map(|c| (count * c / cores, count * (c + 1) / cores)).collect();
        let parts = parallel::map(&shares, |(from, to)| {
            let mut part = Stream::new(self.body, &self.shapes);
            part.push_share(states, *from, *to);
            part.factors
        });
        for part in parts {
            self.factors.iter_mut().zip(&part).for_each(|(f, p)| f.merge(p));
        }
    }

    /// Takes another stream's states in.
    pub fn merge(&mut self, other: &Stream<'_>) {
        self.factors.iter_mut().zip(&other.factors).for_each(|(f, o)| f.merge(o));
    }

    fn push_share(&mut self, states: States<'_>, from: usize, to: usize) {
        let (n, p) = (self.body.dof(), self.body.names().len());
        let mut y = vec![0.0; BLOCK * n * p];
        let mut rows = Vec::new();
        for first in (from..to).step_by(BLOCK) {
            let count = BLOCK.min(to - first);
            let at = first * n..(first + count) * n;
            let y = &mut y[..count * n * p];
            self.body.regressor_into(
                &states.q[at.clone()],
                &states.dq[at.clone()],
                &states.ddq[at.clone()],
                y,
            );
            let (dq, tau) = (&states.dq[at.clone()], &states.tau[at]);
            for j in 0..n {
                rows.clear();
                for c in &self.columns[j] {
                    rows.extend(y.chunks_exact(n * p).map(|sample| sample[j * p + c]));
                }
                let [g2, g4] = self.shapes[j];
                let velocities = || dq.iter().skip(j).step_by(n);
                rows.extend(velocities().map(|v| (g2 * v).tanh()));
                rows.extend(velocities().map(|v| (g4 * v).tanh()));
                rows.extend(velocities());
                rows.extend(tau.iter().skip(j).step_by(n));
                self.factors[j].push_block(&mut rows, count);
            }
        }
    }

    /// The least-squares fit, joints weighted by what they leave.
    #[must_use]
    pub fn fit(&self) -> StreamFit {
        let (n, p) = (self.body.dof(), self.body.names().len());
        let size = p + FRICTION * n;
        let global = |j: usize, k: usize| {
            let own = &self.columns[j];
            own.get(k).copied().unwrap_or_else(|| p + FRICTION * j + k - own.len())
        };
        let mut rms = vec![1.0; n];
        let mut theta = vec![0.0; size];
        for _ in 0..3 {
            let mut sum = NormalEquations::zero(size);
            for (j, factor) in self.factors.iter().enumerate().filter(|(j, _)| rms[*j] > 0.0) {
                let last = factor.width() - 1;
                let columns: Vec<&[f64]> = (0..last).map(|k| factor.column(k)).collect();
                let places: Vec<usize> = (0..last).map(|k| global(j, k)).collect();
                let weight = 1.0 / (rms[j] * rms[j]);
                sum.add_columns(&places, &columns, factor.column(last), weight);
            }
            theta = sum.solve();
            for (j, factor) in self.factors.iter().enumerate() {
                let last = factor.width() - 1;
                let mut left = factor.column(last).to_vec();
                for k in 0..last {
                    left.iter_mut().zip(factor.column(k)).for_each(|(l, c)| *l -= theta[global(j, k)] * c);
                }
                rms[j] = (left.iter().map(|l| l * l).sum::<f64>() / factor.rows().max(1) as f64).sqrt();
            }
        }
        let friction = (0..n)
            .map(|j| {
                let at = p + FRICTION * j;
                let [g2, g4] = self.shapes[j];
                [theta[at], g2, theta[at + 1], g4, theta[at + 2]]
            })
            .collect();
        StreamFit { inertial: theta[..p].to_vec(), friction, rms }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dyngen::Arm;
    use powerball_controller::friction::{TABLE_2, TanhFriction};
    use rand::{RngExt, SeedableRng};

    /// Torques of known values give these values back, however the states were cut.
    #[test]
    fn known_values_come_back_from_any_blocks() {
        let arm = Arm::parse(include_str!("../../../controller/arm.toml"), "arm.toml").unwrap();
        let body = RigidArm::new(&arm).unwrap();
        let n = arm.dof();
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(8);
        let mut draw = |count: usize| (0..count).map(|_| rng.random_range(-1.5..1.5)).collect::<Vec<f64>>();
        let (q, dq, ddq) = (draw(1000 * n), draw(1000 * n), draw(1000 * n));
        let values = draw(body.names().len());
        let mut tau = body.torque(&q, &dq, &ddq, &values);
        for (k, torque) in tau.iter_mut().enumerate() {
            *torque += TanhFriction::new(TABLE_2[k % n]).torque(dq[k]);
        }
        let shapes: Vec<[f64; 2]> = TABLE_2.iter().map(|g| [g[1], g[3]]).collect();
        let mut stream = Stream::new(&body, &shapes);
        let mut other = Stream::new(&body, &shapes);
        for (from, to, first) in [(0, 1, true), (1, 700, true), (700, 1000, false)] {
            let cut = from * n..to * n;
            let states =
                States { q: &q[cut.clone()], dq: &dq[cut.clone()], ddq: &ddq[cut.clone()], tau: &tau[cut] };
            if first { stream.push(states) } else { other.push(states) }
        }
        stream.merge(&other);
        let fit = stream.fit();
        for (found, value) in fit.inertial.iter().zip(&values) {
            approx::assert_abs_diff_eq!(found, value, epsilon = 1e-8);
        }
        for (found, gamma) in fit.friction.iter().zip(&TABLE_2) {
            for k in 0..5 {
                approx::assert_abs_diff_eq!(found[k], gamma[k], epsilon = 1e-7);
            }
        }
    }
}
