//! The closed loop of one position servo and what it moves, simulated along a log.
//!
//! (I + J)·q̈ = motor − back_emf·q̇ − rest(q) − friction, with motor = torque·u while the drive is switched on. Friction is
//! coulomb + load·½·|motor + rest| (what the gear carries between the two) + stribeck·exp(−|q̇|/stribeck_velocity), against the
//! motion, and viscous·q̇. A step is linearly implicit in what is proportional to q̇; dry friction takes away what it can of the
//! new velocity and no more, so that a joint sticks without chatter (as velocity-level contact solvers do; Duclusaud et al.,
//! *Extended Friction Models for the Physics Simulation of Servo Actuators*, 2024, for the friction itself).

use super::body::Moved;
use super::constants::{Constant, Constants};

/// The longest step, s.
pub const STEP: f64 = 2.5e-3;
/// Samples over which the first velocity is taken.
const FIRST: usize = 4;

/// One joint along one piece of a log.
#[derive(Clone, Copy, Debug)]
pub struct Track<'l> {
    /// Rising times, s.
    pub t: &'l [f64],
    /// Measured positions, rad: the first one is where the simulation begins.
    pub q: &'l [f64],
    /// Set-points, rad.
    pub goal: &'l [f64],
    /// Whether the drive is switched on; always where it is not there.
    pub on: Option<&'l [bool]>,
}

/// The positions of the simulated joint at the times of a track, rad. What it moves is one entry, or one a sample.
#[must_use]
pub fn simulate(track: &Track<'_>, moved: &[Moved], constants: &Constants) -> Vec<f64> {
    let mut joint = Joint::at_start(track, constants);
    let mut out = Vec::with_capacity(track.t.len());
    out.push(joint.q);
    for k in 1..track.t.len() {
        let (from, to) = (track.t[k - 1], track.t[k]);
        let steps = ((to - from) / STEP).ceil().max(1.0);
        let h = (to - from) / steps;
        let moved = moved.get(k - 1).unwrap_or(&moved[0]);
        for s in 0..steps as usize {
            joint.step(track, moved, constants, from + h * (s as f64 + 0.5), h);
        }
        out.push(joint.q);
    }
    out
}

/// The set-point at a time, between two samples.
fn goal_at(track: &Track<'_>, cursor: &mut usize, time: f64) -> f64 {
    let (t, goal) = (track.t, track.goal);
    if time <= t[0] {
        return goal[0];
    }
    while *cursor + 1 < t.len() && t[*cursor + 1] <= time {
        *cursor += 1;
    }
    match t.get(*cursor + 1) {
        None => goal[*cursor],
        Some(next) => {
            let share = (time - t[*cursor]) / (next - t[*cursor]);
            goal[*cursor] + share * (goal[*cursor + 1] - goal[*cursor])
        }
    }
}

/// Where a joint and its drive are.
struct Joint {
    q: f64,
    v: f64,
    /// The goal as the drive has it.
    goal: f64,
    integral: f64,
    cursor: usize,
}

impl Joint {
    fn at_start(track: &Track<'_>, constants: &Constants) -> Joint {
        let last = FIRST.min(track.t.len() - 1);
        let passed = track.t[last] - track.t[0];
        let v = if passed > 0.0 { (track.q[last] - track.q[0]) / passed } else { 0.0 };
        let mut cursor = 0;
        let goal = goal_at(track, &mut cursor, track.t[0] - constants.of(Constant::Delay));
        Joint { q: track.q[0], v, goal, integral: 0.0, cursor }
    }

    fn step(&mut self, track: &Track<'_>, moved: &Moved, c: &Constants, time: f64, h: f64) {
        let of = |constant| c.of(constant);
        let seen = time - of(Constant::Delay);
        let wanted = goal_at(track, &mut self.cursor, seen);
        let farthest = of(Constant::SpeedLimit) * h;
        self.goal += (wanted - self.goal).clamp(-farthest, farthest);
        let is_on = track.on.is_none_or(|on| on[self.cursor]);
        let rest = moved.rest(self.q + of(Constant::Zero));
        let inertia = moved.inertia + of(Constant::Armature);
        let (motor, back_emf) = match is_on {
            true => (of(Constant::Torque) * self.duty(c, h), of(Constant::BackEmf)),
            false => (0.0, 0.0),
        };
        let braked = inertia + h * (back_emf + of(Constant::Viscous));
        let free = (inertia * self.v + h * (motor - rest)) / braked;
        let dry = of(Constant::Coulomb)
            + of(Constant::Load) * 0.5 * (motor - back_emf * self.v + rest).abs()
            + of(Constant::Stribeck) * (-(self.v / of(Constant::StribeckVelocity)).abs()).exp();
        self.v = free.signum() * (free.abs() - h * dry / braked).max(0.0);
        self.q += h * self.v;
    }

    fn duty(&mut self, c: &Constants, h: f64) -> f64 {
        let of = |constant| c.of(constant);
        let error = self.goal - self.q;
        let error = error.signum() * (error.abs() - of(Constant::DeadZone)).max(0.0);
        let own = of(Constant::Kp) * error - of(Constant::Kd) * self.v;
        let limit = of(Constant::PwmLimit);
        let duty = of(Constant::Gain) * (own + of(Constant::Ki) * (self.integral + h * error));
        // A drive at its limit does not integrate further.
        if duty.abs() < limit {
            self.integral += h * error;
        }
        duty.clamp(-limit, limit)
    }
}
