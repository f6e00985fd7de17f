//! The closed loop of one position servo and what it moves, simulated along a log.
//!
//! (I + J)·q̈ = motor − back_emf·q̇ − rest(q) − friction, with motor = torque·u while the drive is switched
//! on. Friction is coulomb + load·½·|motor + rest| (what the gear carries between the two) +
//! stribeck·exp(−|q̇|/stribeck_velocity), against the motion, and viscous·q̇ (Duclusaud et al., *Extended
//! Friction Models for the Physics Simulation of Servo Actuators*, 2024).
//!
//! The torque at full duty follows the logged voltage where a supply is given, and Coulomb and viscous
//! friction follow warmth.
//!
//! Velocities are those between the steps of positions (leapfrog, second order). What is proportional to q̇
//! is solved exactly. Dry friction brakes a joint until it stops, and beyond that holds it where it can: a
//! joint sticks without chatter.

use super::body::Moved;
use super::constants::{Constant, Constants};

/// The longest step, s.
pub const STEP: f64 = 2.5e-3;
/// A step may be longer by this share.
const ROUNDING: f64 = 1e-6;
/// Samples over which the first velocity is taken.
const FIRST: usize = 4;
/// A change by warmth is one over 10 K.
const TEN: f64 = 10.0;
/// Warmth leaves at least this share of friction.
const LEAST_EASE: f64 = 0.05;

/// One joint along one piece of a log.
#[derive(Clone, Copy, Debug)]
pub struct Track<'l> {
    /// Rising times, s.
    pub t: &'l [f64],
    /// Seconds to add to them for the time since the joint was cold.
    pub clock: f64,
    /// Measured positions, rad: the first one is where the simulation begins.
    pub q: &'l [f64],
    /// Set-points, rad.
    pub goal: &'l [f64],
    /// Whether the drive is switched on; always where it is not there.
    pub on: Option<&'l [bool]>,
    /// Voltage of the drive, V, where it is logged; not a number where a sample has none.
    pub volts: Option<&'l [f64]>,
    /// Temperature, °C, where it is logged.
    pub temperature: Option<&'l [f64]>,
}

impl Track<'_> {
    /// The torque at full duty as a share of that at the given supply.
    fn fullness(&self, k: usize, c: &Constants) -> f64 {
        let supply = c.of(Constant::Supply);
        let volts = self.volts.map(|volts| volts[k]).filter(|volts| supply > 0.0 && volts.is_finite());
        volts.map_or(1.0, |volts| volts / supply)
    }

    /// Coulomb and viscous friction as a share of that when cold.
    fn ease(&self, k: usize, c: &Constants) -> f64 {
        let (change, time) = (c.of(Constant::Warmth), c.of(Constant::WarmthTime));
        let by_temperature = |temperature: &[f64]| (temperature[k] - c.of(Constant::Cold)) / TEN;
        let warm = match time > 0.0 {
            true => Some(-(-(self.clock + self.t[k]) / time).exp_m1()),
            false => self.temperature.map(by_temperature),
        };
        let warm = warm.filter(|warm| change != 0.0 && warm.is_finite());
        warm.map_or(1.0, |warm| (1.0 + change * warm).max(LEAST_EASE))
    }
}

/// The positions of the simulated joint at the times of a track, rad. What it moves is one entry, or one a
/// sample.
#[must_use]
pub fn simulate(track: &Track<'_>, moved: &[Moved], constants: &Constants) -> Vec<f64> {
    let goal = limited(track, constants.of(Constant::SpeedLimit));
    let track = &Track { goal: &goal, ..*track };
    let mut joint = Joint::at_start(track);
    let mut out = Vec::with_capacity(track.t.len());
    out.push(joint.q);
    for k in 1..track.t.len() {
        let (from, to) = (track.t[k - 1], track.t[k]);
        let steps = ((to - from) / STEP - ROUNDING).ceil().max(1.0);
        let h = (to - from) / steps;
        let here = Here {
            moved: moved.get(k - 1).unwrap_or(&moved[0]),
            fullness: track.fullness(k - 1, constants),
            ease: track.ease(k - 1, constants),
        };
        for s in 0..steps as usize {
            joint.step(track, &here, constants, from + h * s as f64, h);
        }
        out.push(joint.q);
    }
    out
}

/// The set-points as a drive has them that lets its goal move no faster than a limit, rad/s.
fn limited(track: &Track<'_>, limit: f64) -> Vec<f64> {
    let mut own = track.goal[0];
    let mut out = vec![own];
    for k in 1..track.t.len() {
        let (from, passed) = (track.goal[k - 1], track.t[k] - track.t[k - 1]);
        let slope = (track.goal[k] - from) / passed;
        let way = (from - own).signum();
        // It reaches the set-point within the interval, or at its end is still behind it.
        let reached = if from == own { 0.0 } else { (from - own).abs() / (limit - way * slope) };
        own = if (0.0..passed).contains(&reached) {
            own + way * limit.min(f64::MAX) * reached + slope.clamp(-limit, limit) * (passed - reached)
        } else {
            own + way * limit * passed
        };
        out.push(own);
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

/// What holds from one sample to the next.
struct Here<'m> {
    moved: &'m Moved,
    fullness: f64,
    ease: f64,
}

/// Where a joint and its drive are.
struct Joint {
    q: f64,
    v: f64,
    integral: f64,
    cursor: usize,
}

/// What drives a motor through a step, and what brakes it.
struct Drive {
    inertia: f64,
    force: f64,
    /// Torque for each rad/s.
    brake: f64,
    dry: f64,
}

impl Drive {
    /// The velocity after a step. What is proportional to it is solved exactly for a force that is constant
    /// over the step.
    fn after(&self, v: f64, h: f64) -> f64 {
        let rate = h * self.brake / self.inertia;
        let (kept, push) = match rate > 1e-9 {
            true => ((-rate).exp(), -(-rate).exp_m1() / self.brake),
            false => (1.0, h / self.inertia),
        };
        let way = if v == 0.0 { self.force.signum() } else { v.signum() };
        let next = kept * v + push * (self.force - way * self.dry);
        if next * way >= 0.0 {
            return next;
        }
        // It stops within the step, and in what is left of it goes where the force exceeds friction.
        next / (next - v) * push * self.force.signum() * (self.force.abs() - self.dry).max(0.0)
    }
}

impl Joint {
    fn at_start(track: &Track<'_>) -> Joint {
        let last = FIRST.min(track.t.len() - 1);
        let passed = track.t[last] - track.t[0];
        let v = if passed > 0.0 { (track.q[last] - track.q[0]) / passed } else { 0.0 };
        Joint { q: track.q[0], v, integral: 0.0, cursor: 0 }
    }

    fn step(&mut self, track: &Track<'_>, here: &Here<'_>, c: &Constants, time: f64, h: f64) {
        let of = |constant| c.of(constant);
        let goal = goal_at(track, &mut self.cursor, time - of(Constant::Delay));
        let is_on = track.on.is_none_or(|on| on[self.cursor]);
        let rest = here.moved.rest(self.q + of(Constant::Zero));
        let (motor, back_emf) = match is_on {
            true => (of(Constant::Torque) * here.fullness * self.duty(c, goal, h), of(Constant::BackEmf)),
            false => (0.0, 0.0),
        };
        let drive = Drive {
            inertia: here.moved.inertia + of(Constant::Armature),
            force: motor - rest,
            brake: back_emf + here.ease * of(Constant::Viscous),
            dry: here.ease * of(Constant::Coulomb)
                + of(Constant::Load) * 0.5 * (motor - back_emf * self.v + rest).abs()
                + of(Constant::Stribeck) * (-(self.v / of(Constant::StribeckVelocity)).abs()).exp(),
        };
        self.v = drive.after(self.v, h);
        self.q += h * self.v;
    }

    fn duty(&mut self, c: &Constants, goal: f64, h: f64) -> f64 {
        let of = |constant| c.of(constant);
        let error = goal - self.q;
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
