//! One joint's servo in logs: what is known of it, what is fitted, where the search begins.

use super::body::{Body, Moved, bodies};
use super::constants::{Constant, Constants};
use super::fit::{Errors, Fitted, Free, errors, fit, objective};
use super::simulate::{Track, simulate};
use dyngen::arm::Servo;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use powerball_logs::log::ServoLog;
use powerball_logs::regression::RigidArm;
use powerball_logs::signal::resample::{linear_at, median_step};
use std::ops::Range;

/// A shorter piece says nothing, s and samples.
const SHORTEST: (f64, usize) = (0.5, 20);
/// Blocks that count as independent, s.
const BLOCK: f64 = 1.0;
/// A joint that moves this far while it is switched off shows its friction without the motor, rad.
const FALLS: f64 = 0.05;
/// Starts that are refined, the steps of each, and the steps of the best one.
const REFINED: usize = 4;
/// Samples over which a speed is taken.
const APART: usize = 5;
const FIRST_STEPS: usize = 15;
const LAST_STEPS: usize = 60;

/// What is fitted, in the order of the fit's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// A constant of the servo or its friction.
    Constant(Constant),
    /// An inertial parameter, by its number.
    Inertial(usize),
    /// A mass at the end of the arm, kg.
    Payload,
}

/// A joint in logs, with what is known of it.
#[derive(Clone, Debug)]
pub struct Problem<'l> {
    /// The joint, from 0.
    pub joint: usize,
    tracks: Vec<Track<'l>>,
    bodies: Vec<Body>,
    /// The log of each track.
    pub log: Vec<usize>,
    /// Whether a payload that is fitted is in each track.
    loaded: Vec<bool>,
    /// What is known, and what the rest is taken for.
    pub constants: Constants,
    /// Values of the inertial parameters.
    pub inertial: Vec<f64>,
    /// What a mass of 1 kg at the end of the arm adds to them.
    pub payload: Vec<f64>,
    /// What is fitted.
    pub roles: Vec<Role>,
}

/// What is known of a joint before any log is read.
#[derive(Clone, Debug)]
pub struct Known<'a> {
    /// The arm file's `[joint.servo]`.
    pub servo: Servo,
    /// Values of the minimal inertial set, where they are known.
    pub values: Option<&'a [f64]>,
    /// What a mass of 1 kg at the end of the arm adds to them.
    pub payload: &'a [f64],
}

impl Known<'_> {
    /// Whether something says how large torques are.
    #[must_use]
    pub fn is_absolute(&self) -> bool {
        self.values.is_some() || self.servo.stall_torque().is_some()
    }
}

/// The tracks and bodies of a joint in logs, with the log of each.
fn tracks<'l>(arm: &RigidArm, logs: &'l [ServoLog], joint: usize) -> (Vec<Track<'l>>, Vec<Body>, Vec<usize>) {
    let (mut tracks, mut all, mut of) = (Vec::new(), Vec::new(), Vec::new());
    for (k, log) in logs.iter().enumerate() {
        let long =
            |p: &&Range<usize>| p.len() >= SHORTEST.1 && log.t[p.end - 1] - log.t[p.start] >= SHORTEST.0;
        let pieces: Vec<Range<usize>> = log.pieces.iter().filter(long).cloned().collect();
        all.extend(bodies(arm, log, joint, &pieces));
        for own in pieces {
            let on = log.enabled.as_ref().map(|on| &on[joint][own.clone()]);
            let part = |signals: &'l Vec<Vec<f64>>| &signals[joint][own.clone()];
            tracks.push(Track {
                t: &log.t[own.clone()],
                clock: log.clock,
                q: part(&log.q),
                goal: part(&log.goal),
                on,
                volts: log.volts.as_ref().map(part),
                temperature: log.temperature.as_ref().map(part),
            });
            of.push(k);
        }
    }
    (tracks, all, of)
}

/// A problem with the values at which a fit begins, and their scales.
type Start<'l> = (Problem<'l>, Vec<f64>, Vec<Free>);

fn is_inertial(role: &Role) -> bool {
    matches!(role, Role::Inertial(_))
}

/// 1 at `c`, of `count`.
fn unit(count: usize, c: usize) -> Vec<f64> {
    (0..count).map(|k| f64::from(k == c)).collect()
}

impl<'l> Problem<'l> {
    /// A joint in logs to fit; `None` where no piece of them is long enough.
    #[must_use]
    pub fn new(arm: &RigidArm, logs: &'l [ServoLog], joint: usize, known: &Known<'_>) -> Option<Problem<'l>> {
        let (tracks, bodies, log) = tracks(arm, logs, joint);
        if tracks.is_empty() {
            return None;
        }
        let constants = given(&known.servo);
        let inertial = known.values.map_or(vec![0.0; arm.names().len()], <[f64]>::to_vec);
        let payload = known.payload.to_vec();
        let loaded = vec![true; tracks.len()];
        let roles = Vec::new();
        let mut problem = Problem { joint, tracks, bodies, log, loaded, constants, inertial, payload, roles };
        problem.roles = problem.free(known);
        Some(problem)
    }

    /// The problem of this joint in other logs, with what was found: nothing is fitted there.
    #[must_use]
    pub fn in_logs<'o>(&self, arm: &RigidArm, logs: &'o [ServoLog], joint: usize) -> Problem<'o> {
        let (tracks, bodies, log) = tracks(arm, logs, joint);
        let (inertial, payload) = (self.inertial.clone(), self.payload.clone());
        let (loaded, constants, roles) = (vec![true; tracks.len()], self.constants, Vec::new());
        Problem { joint, tracks, bodies, log, loaded, constants, inertial, payload, roles }
    }

    /// The part of it that is one log.
    #[must_use]
    pub fn of_log(&self, log: usize) -> Problem<'l> {
        let own: Vec<usize> = (0..self.log.len()).filter(|k| self.log[*k] == log).collect();
        Problem {
            tracks: own.iter().map(|k| self.tracks[*k]).collect(),
            bodies: own.iter().map(|k| self.bodies[*k].clone()).collect(),
            log: vec![log; own.len()],
            loaded: own.iter().map(|k| self.loaded[*k]).collect(),
            ..self.clone()
        }
    }

    /// The problem, with the tracks of others in addition.
    #[must_use]
    pub fn and<'o>(mut self, others: impl IntoIterator<Item = &'o Problem<'l>>) -> Problem<'l>
    where
        'l: 'o,
    {
        for other in others {
            self.tracks.extend_from_slice(&other.tracks);
            self.bodies.extend_from_slice(&other.bodies);
            self.log.extend_from_slice(&other.log);
            self.loaded.extend_from_slice(&other.loaded);
        }
        self
    }

    /// The problem, without the payload that may be fitted.
    #[must_use]
    pub fn unloaded(mut self) -> Problem<'l> {
        self.loaded.fill(false);
        self
    }

    /// The problem, with other things to fit.
    #[must_use]
    pub fn asking(&self, roles: Vec<Role>) -> Problem<'l> {
        Problem { roles, ..self.clone() }
    }

    /// The most torque that 1 kg at the end of the arm takes of this joint at rest, N·m.
    #[must_use]
    pub fn payload_torque(&self) -> f64 {
        let largest = |m: &Moved| m.harmonics.iter().skip(1).fold(0.0f64, |a, x| a.max(x.abs()));
        self.bodies.iter().flat_map(|body| body.with(&self.payload)).map(|m| largest(&m)).fold(0.0, f64::max)
    }

    /// What is fitted: what is neither known nor hidden behind something else.
    fn free(&self, known: &Known<'_>) -> Vec<Role> {
        let (servo, mut roles) = (&known.servo, Vec::new());
        let mut fit = |constant: Constant, fits: bool| roles.extend(fits.then_some(Role::Constant(constant)));
        fit(Constant::Torque, known.values.is_some() && servo.stall_torque().is_none());
        fit(Constant::BackEmf, servo.back_emf().is_none() && self.falls());
        fit(Constant::Armature, known.values.is_some() && servo.armature.is_none());
        fit(Constant::Zero, known.values.is_some());
        for constant in [Constant::Coulomb, Constant::Viscous, Constant::Load] {
            fit(constant, true);
        }
        fit(Constant::Gain, servo.gain.is_none());
        fit(Constant::Delay, servo.delay.is_none());
        fit(Constant::SpeedLimit, servo.speed_limit.is_none());
        if known.values.is_none() {
            roles.extend(self.visible().into_iter().map(Role::Inertial));
        }
        roles
    }

    /// Whether the joint moves while it is switched off.
    fn falls(&self) -> bool {
        let falls = |track: &Track<'_>| {
            let off = |k: &usize| track.on.is_some_and(|on| !on[*k]);
            let mut range = (f64::INFINITY, f64::NEG_INFINITY);
            for k in (0..track.q.len()).filter(off) {
                range = (range.0.min(track.q[k]), range.1.max(track.q[k]));
            }
            range.1 - range.0 > FALLS
        };
        self.tracks.iter().any(falls)
    }

    /// Inertial parameters that the joint's own torque shows, the strongest ones first.
    fn visible(&self) -> Vec<usize> {
        /// A joint's positions do not distinguish more than these.
        const MOST: usize = 5;
        let mut powers = vec![0.0; self.inertial.len()];
        for (track, body) in self.tracks.iter().zip(&self.bodies) {
            powers.iter_mut().zip(body.powers(track.q)).for_each(|(sum, power)| *sum += power);
        }
        let strongest = powers.iter().fold(0.0f64, |m, x| m.max(*x));
        let mut shown: Vec<usize> = (0..powers.len()).filter(|c| powers[*c] > 1e-4 * strongest).collect();
        shown.sort_by(|a, b| powers[*b].total_cmp(&powers[*a]));
        shown.truncate(MOST);
        shown.sort_unstable();
        shown
    }

    /// Fits what is free and keeps it; gives the fit with the scales that it was done in.
    pub fn solve(&mut self) -> (Fitted, Vec<Free>) {
        let mut starts: Vec<(Fitted, Vec<Free>)> = self
            .starts()
            .into_iter()
            .map(|(values, free)| {
                let errors = errors(self, &values);
                (Fitted { objective: objective(&errors), values, errors }, free)
            })
            .collect();
        starts.sort_by(|a, b| a.0.objective.total_cmp(&b.0.objective));
        let refined = starts.into_iter().take(REFINED);
        let refined = refined.map(|(start, free)| (fit(self, &start.values, &free, FIRST_STEPS), free));
        let best = refined.min_by(|a, b| a.0.objective.total_cmp(&b.0.objective));
        // There always is a start.
        let (best, free) = best.unwrap_or_else(|| (fit(self, &[], &[], 0), Vec::new()));
        let fitted = fit(self, &best.values, &free, LAST_STEPS);
        (self.constants, self.inertial, _) = self.at(&fitted.values);
        (fitted, free)
    }

    /// The fit without a limit that the logs do not show: a limit is one more constant, which must gain more
    /// than chance does by Schwarz's criterion (Annals of Statistics 6, 1978). Tried are a goal without a
    /// limit of its speed, and a torque at full duty of which the logs use less.
    pub fn without_limits(self, fitted: Fitted, free: Vec<Free>) -> (Problem<'l>, Fitted, Vec<Free>) {
        let blocks = self.blocks() as f64;
        let most = |of: &Fitted| of.objective * blocks.powf(1.0 / blocks);
        let mut own = (self, fitted, free);
        for without in [Problem::without_speed_limit, Problem::with_more_torque] {
            let Some((mut problem, values, free)) = without(&own.0, &own.1, &own.2) else { continue };
            let refitted = fit(&problem, &values, &free, FIRST_STEPS);
            if refitted.objective <= most(&own.1) {
                (problem.constants, problem.inertial, _) = problem.at(&refitted.values);
                own = (problem, refitted, free);
            }
        }
        own
    }

    /// With a goal that moves as fast as it is logged.
    fn without_speed_limit(&self, fitted: &Fitted, free: &[Free]) -> Option<Start<'l>> {
        let at = self.roles.iter().position(|role| *role == Role::Constant(Constant::SpeedLimit))?;
        let (mut without, mut values, mut free) = (self.clone(), fitted.values.clone(), free.to_vec());
        without.roles.remove(at);
        without.constants.set(Constant::SpeedLimit, f64::INFINITY);
        values.remove(at);
        free.remove(at);
        Some((without, values, free))
    }

    /// With more torque at full duty, and all else as it is: the gain is smaller by as much, and where
    /// torques are shares of that torque, they all are.
    fn with_more_torque(&self, fitted: &Fitted, free: &[Free]) -> Option<Start<'l>> {
        /// Times as much.
        const MORE: f64 = 3.0;
        let is_free = |constant| self.roles.contains(&Role::Constant(constant));
        let in_shares = self.roles.iter().any(is_inertial) && !is_free(Constant::Torque);
        if !is_free(Constant::Gain) || !(is_free(Constant::Torque) || in_shares) {
            return None;
        }
        let factor = |role: &Role| match role {
            Role::Constant(Constant::Torque) => MORE,
            Role::Constant(Constant::Gain) => 1.0 / MORE,
            Role::Constant(own) if in_shares && own.is_torque() => 1.0 / MORE,
            Role::Inertial(_) if in_shares => 1.0 / MORE,
            _ => 1.0,
        };
        let factors: Vec<f64> = self.roles.iter().map(factor).collect();
        let values = fitted.values.iter().zip(&factors).map(|(value, factor)| value * factor).collect();
        let scaled =
            |(own, factor): (&Free, &f64)| Free { scale: own.scale * factor, least: own.least * factor };
        Some((self.clone(), values, free.iter().zip(&factors).map(scaled).collect()))
    }

    /// Where the search begins: scales from how fast the joint moves and the torque of its bodies, on a grid
    /// of gain, delay and torque, or of inertia where nothing says how large torques are.
    fn starts(&self) -> Vec<(Vec<f64>, Vec<Free>)> {
        let fastest = self.fastest();
        let heaviest = self.heaviest(fastest);
        let kp = self.constants.of(Constant::Kp);
        let is_free = |c| self.roles.contains(&Role::Constant(c));
        let pick = |c, many: &[f64]| if is_free(c) { many.to_vec() } else { vec![self.constants.of(c)] };
        let torques: Vec<f64> = pick(Constant::Torque, &[1.5, 4.0, 10.0, 40.0, 160.0].map(|x| x * heaviest));
        let inertias: &[f64] = if self.roles.iter().any(is_inertial) { &[0.01, 0.03, 0.1] } else { &[0.03] };
        let mut starts = Vec::new();
        for delay in pick(Constant::Delay, &[0.01, 0.03, 0.06]) {
            let held = self.held(delay, fastest);
            for torque in &torques {
                for gain in pick(Constant::Gain, &[1.0, 3.0, 8.0].map(|x| x / kp)) {
                    for inertia in inertias {
                        starts.push(self.start([*torque, gain, delay, *inertia], fastest, &held));
                    }
                }
            }
        }
        starts
    }

    /// Inertial parameters by how far from its goal the joint is held, in units of torque·gain: what a slow
    /// joint shows without any simulation. Empty where none is fitted.
    fn held(&self, delay: f64, fastest: f64) -> Vec<f64> {
        /// Slower than this share of the fastest.
        const SLOW: f64 = 0.1;
        /// Keeps what the joint does not show near zero.
        const RIDGE: f64 = 1e-6;
        let count = self.inertial.len();
        if !self.roles.iter().any(is_inertial) {
            return Vec::new();
        }
        let size = count + 2;
        let (mut normal, mut right) = (Mat::<f64>::zeros(size, size), Mat::<f64>::zeros(size, 1));
        for (track, body) in self.tracks.iter().zip(&self.bodies) {
            let units: Vec<Vec<Moved>> = (0..count).map(|c| body.with(&unit(count, c))).collect();
            for k in APART..track.q.len().saturating_sub(APART) {
                let passed = track.t[k + APART] - track.t[k - APART];
                let v = (track.q[k + APART] - track.q[k - APART]) / passed;
                if v.abs() > SLOW * fastest || track.on.is_some_and(|on| !on[k]) {
                    continue;
                }
                let rest = units.iter().map(|m| m.get(k).unwrap_or(&m[0]).rest(track.q[k]));
                let row: Vec<f64> = rest.chain([v, v.signum()]).collect();
                let error = linear_at(track.t, track.goal, track.t[k] - delay) - track.q[k];
                for i in 0..size {
                    right[(i, 0)] += row[i] * self.constants.of(Constant::Kp) * error;
                    (0..size).for_each(|j| normal[(i, j)] += row[i] * row[j]);
                }
            }
        }
        let most = (0..size).map(|i| normal[(i, i)]).fold(f64::MIN_POSITIVE, f64::max);
        (0..size).for_each(|i| normal[(i, i)] += RIDGE * most);
        let solved = normal.llt(Side::Lower).map(|factor| factor.solve(&right));
        solved.map_or(vec![0.0; count], |of| (0..count).map(|c| of[(c, 0)]).collect())
    }

    /// At a torque, a gain, a delay, and an inertia in units of what the motor's drag stops within a second.
    fn start(
        &self,
        [torque, gain, delay, inertia]: [f64; 4],
        fastest: f64,
        held: &[f64],
    ) -> (Vec<f64>, Vec<Free>) {
        // With no load a motor turns a little faster than it is seen to.
        let drag = torque / (1.2 * fastest);
        let inertia = inertia * drag;
        let held: Vec<f64> = held.iter().map(|own| gain * torque * own).collect();
        let inertial = self.first_inertial(inertia, torque, &held);
        let one = |role: &Role| -> (f64, Free) {
            let (value, scale, least) = match role {
                Role::Inertial(c) => (inertial[*c].0, inertial[*c].1, f64::NEG_INFINITY),
                Role::Payload => (0.0, 0.1, f64::NEG_INFINITY),
                Role::Constant(constant) => match constant {
                    Constant::Torque => (torque, torque, 0.05 * torque),
                    Constant::BackEmf => (0.9 * drag, 0.3 * drag, 0.0),
                    Constant::Viscous => (if self.falls() { 0.05 } else { 0.9 } * drag, 0.1 * drag, 0.0),
                    Constant::Armature => (inertia, inertia, 0.0),
                    Constant::Zero => (0.0, 0.05, f64::NEG_INFINITY),
                    Constant::Coulomb | Constant::Stribeck => (0.02 * torque, 0.02 * torque, 0.0),
                    Constant::Load => (0.2, 0.2, 0.0),
                    Constant::Gain => (gain, gain, 0.02 * gain),
                    Constant::Delay => (delay, 0.02, 0.0),
                    Constant::SpeedLimit => (1.1 * fastest, fastest, 0.1 * fastest),
                    other => (self.constants.of(*other), 1.0, 0.0),
                },
            };
            (value, Free { scale, least })
        };
        self.roles.iter().map(one).unzip()
    }

    /// A first value and a scale for each inertial parameter: the strongest one against accelerations makes
    /// up the joint's inertia, the others are as the held joint shows them.
    fn first_inertial(&self, inertia: f64, torque: f64, held: &[f64]) -> Vec<(f64, f64)> {
        let count = self.inertial.len();
        let of_unit = |c: usize| -> (f64, f64) {
            let moved = self.bodies.first().map(|body| body.with(&unit(count, c))).unwrap_or_default();
            let rest = |m: &Moved| m.harmonics.iter().fold(0.0f64, |a, x| a.max(x.abs()));
            (
                moved.iter().fold(0.0, |a, m| a + m.inertia / moved.len() as f64),
                moved.iter().map(rest).fold(0.0, f64::max),
            )
        };
        let units: Vec<(f64, f64)> = (0..count).map(of_unit).collect();
        let free = |c: &usize| self.roles.contains(&Role::Inertial(*c));
        let strongest = (0..count).filter(free).max_by(|a, b| units[*a].0.total_cmp(&units[*b].0));
        (0..count)
            .map(|c| {
                let (own, rest) = units[c];
                let scale = if rest > 0.0 { 0.2 * torque / rest } else { inertia / own.abs().max(1e-12) };
                if Some(c) == strongest && own > 0.0 {
                    return (inertia / own, inertia / own);
                }
                (held.get(c).copied().filter(|_| free(&c)).unwrap_or(0.0), scale)
            })
            .collect()
    }

    /// About how fast the joint moves at most, rad/s.
    fn fastest(&self) -> f64 {
        let speed = |track: &Track<'_>| -> Vec<f64> {
            let at = |k: usize| (track.q[k + APART] - track.q[k]).abs() / (track.t[k + APART] - track.t[k]);
            (0..track.q.len().saturating_sub(APART)).map(at).collect()
        };
        let mut speeds: Vec<f64> = self.tracks.iter().flat_map(speed).collect();
        speeds.sort_by(f64::total_cmp);
        speeds.get(speeds.len() * 99 / 100).copied().unwrap_or(1.0).max(0.1)
    }

    /// About the most torque that known bodies ask for, N·m.
    fn heaviest(&self, fastest: f64) -> f64 {
        let most = |(track, body): (&Track<'_>, &Body)| {
            let moved = body.with(&self.inertial);
            let of = |(k, q): (usize, &f64)| {
                let own = moved.get(k).unwrap_or(&moved[0]);
                own.rest(*q).abs() + own.inertia * fastest / 0.1
            };
            track.q.iter().enumerate().map(of).fold(0.0, f64::max)
        };
        self.tracks.iter().zip(&self.bodies).map(most).fold(1e-6, f64::max)
    }

    /// Constants, inertial parameters and payload at values of what is fitted.
    #[must_use]
    pub fn at(&self, values: &[f64]) -> (Constants, Vec<f64>, f64) {
        let (mut constants, mut inertial, mut mass) = (self.constants, self.inertial.clone(), 0.0);
        for (role, value) in self.roles.iter().zip(values) {
            match role {
                Role::Constant(constant) => constants.set(*constant, *value),
                Role::Inertial(c) => inertial[*c] = *value,
                Role::Payload => mass = *value,
            }
        }
        (constants, inertial, mass)
    }

    /// Samples that count as one.
    #[must_use]
    pub fn block(&self) -> usize {
        let step = self.tracks.first().and_then(|track| median_step(track.t)).unwrap_or(BLOCK);
        (BLOCK / step).ceil() as usize
    }

    /// How many blocks of its samples count as independent.
    #[must_use]
    pub fn blocks(&self) -> usize {
        let block = self.block();
        self.tracks.iter().map(|track| track.t.len().div_ceil(block)).sum()
    }

    /// Errors of the goal that comes later by `delay`, by track, rad: what anybody knows without a model. A
    /// drive that is switched off has no goal.
    #[must_use]
    pub fn goal_errors(&self, delay: f64) -> Vec<Vec<f64>> {
        let of = |track: &Track<'_>| -> Vec<f64> {
            let is_on = |k: &usize| track.on.is_none_or(|on| on[*k]);
            let error = |k: usize| linear_at(track.t, track.goal, track.t[k] - delay) - track.q[k];
            (0..track.t.len()).filter(is_on).map(error).collect()
        };
        self.tracks.iter().map(of).collect()
    }

    /// Times, measured positions and goal of each track.
    #[must_use]
    pub fn tracks(&self) -> &[Track<'l>] {
        &self.tracks
    }
}

impl Errors for Problem<'_> {
    fn stretches(&self) -> usize {
        self.tracks.len()
    }

    fn of(&self, stretch: usize, values: &[f64]) -> Vec<f64> {
        let (constants, mut inertial, mass) = self.at(values);
        let mass = if self.loaded[stretch] { mass } else { 0.0 };
        inertial.iter_mut().zip(&self.payload).for_each(|(own, unit)| *own += mass * unit);
        let track = &self.tracks[stretch];
        let simulated = simulate(track, &self.bodies[stretch].with(&inertial), &constants);
        simulated.iter().zip(track.q).map(|(s, q)| s - q).collect()
    }
}

/// What the arm file gives; the rest is ideal.
fn given(servo: &Servo) -> Constants {
    let mut constants = Constants::ideal();
    for (constant, value) in [
        (Constant::Torque, servo.stall_torque()),
        (Constant::BackEmf, servo.back_emf()),
        (Constant::Armature, servo.armature),
        (Constant::Gain, servo.gain),
        (Constant::DeadZone, servo.dead_zone),
        (Constant::Delay, servo.delay),
        (Constant::SpeedLimit, servo.speed_limit),
        (Constant::Kp, servo.kp),
        (Constant::Ki, servo.ki),
        (Constant::Kd, servo.kd),
        (Constant::PwmLimit, servo.pwm_limit),
    ] {
        value.into_iter().for_each(|value| constants.set(constant, value));
    }
    constants
}
