//! A hand that guides the virtual arm: a spring and a damper from each link to a path.

use powerball_logs::motion::Motion;
use std::sync::{Arc, Mutex};

/// The action of the hand in one tick.
#[derive(Clone, Debug, PartialEq)]
pub struct HandSample {
    /// Since it took hold, s.
    pub t: f64,
    /// Links' positions, rad, and velocities, rad/s.
    pub q: Vec<f64>,
    /// rad/s.
    pub dq: Vec<f64>,
    /// Torques that the hand gives at the joints, N·m; zeros once it has let go.
    pub torque: Vec<f64>,
}

/// The actions of a hand so far.
pub type HandLog = Arc<Mutex<Vec<HandSample>>>;

/// A hand that pulls every joint along a path and lets go at its end. It takes hold when all joints are free:
/// brakes open and drives in their current mode.
#[derive(Clone, Debug)]
pub struct Hand {
    path: Motion,
    /// N·m/rad.
    stiffness: f64,
    /// N·m·s/rad.
    damping: f64,
    t: f64,
    ticks: u64,
    log: HandLog,
}

/// One tick in this many is written down.
const EVERY: u64 = 10;

impl Hand {
    /// A hand along a path, its spring (N·m/rad) and damper (N·m·s/rad); its actions are written to `log`.
    #[must_use]
    pub fn new(path: Motion, [stiffness, damping]: [f64; 2], log: HandLog) -> Hand {
        Hand { path, stiffness, damping, t: 0.0, ticks: 0, log }
    }

    /// The next `h` s with the links at `q` and `dq`: its torques, N·m.
    pub(super) fn pull(&mut self, h: f64, q: &[f64], dq: &[f64]) -> Vec<f64> {
        let n = self.path.dof();
        let at = self.t / self.path.period;
        let (k, part) = (at as usize, at.fract());
        let place = |k: usize, j: usize| self.path.q.get(k * n + j).copied();
        let pull = |j: usize| {
            let (Some(a), Some(b)) = (place(k, j), place(k + 1, j)) else { return 0.0 };
            let (target, rate) = (a + part * (b - a), (b - a) / self.path.period);
            self.stiffness * (target - q[j]) + self.damping * (rate - dq[j])
        };
        let torque: Vec<f64> = (0..n.min(q.len())).map(pull).collect();
        if self.ticks.is_multiple_of(EVERY)
            && let Ok(mut log) = self.log.lock()
        {
            let (q, dq) = (q.to_vec(), dq.to_vec());
            log.push(HandSample { t: self.t, q, dq, torque: torque.clone() });
        }
        (self.t, self.ticks) = (self.t + h, self.ticks + 1);
        torque
    }
}
