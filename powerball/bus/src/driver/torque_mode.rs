//! The guard of current mode: it detects a joint that does not move as its torque predicts, and measurements
//! that are impossible for a joint.
//!
//! In the other modes a drive holds its joint, and a wrong measurement is a visible error. In current mode
//! the caller's law holds it: a wrong measurement becomes a motion. So each joint is checked in every cycle:
//!
//! * a velocity that no joint can have is not used, and stops the arm when it stays;
//! * position and integrated velocity that drift apart: one of the two is wrong;
//! * the measured current against the commanded one;
//! * the torque that acted against what the model needs for the measured motion ([`TorqueGuard`]), where there is a model:
//!   a drive that does not act or acts the wrong way, a joint that is stuck, an encoder that stands still;
//! * where the caller says where the joint should be ([`Tracking`]), how far it is from there;
//! * its velocity, with a smaller margin than in the other modes.
//!
//! The limits are [`TorqueMode`](super::profile::TorqueMode).

use super::profile::JointProfile;
use super::torque::{ControlMode, TorqueGuard};
use super::watch::run;
use super::{Cause, Driver, Phase, Rejection, Transmit};
use crate::canopen::Micros;
use core::cmp::Ordering;
use powerball_controller::JointNumber;

/// Desired positions of the joints at the last SYNC, and their tolerance: by the gains of the law, the error
/// of the model, and friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking<const N: usize> {
    /// rad.
    pub position: [f64; N],
    /// rad.
    pub tolerance: [f64; N],
}

/// Cycles over which an acceleration is taken.
const WINDOW: usize = 4;
/// Below this part of the greatest velocity a joint may stick: all of its dry friction can hold it.
const SLOW: f64 = 0.05;

/// The guard's memory of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guarded {
    /// Positions and velocities of the last cycles with all data, newest first, and their SYNC.
    samples: [Sample; WINDOW + 1],
    /// How many of them there are, without a gap.
    count: usize,
    /// Position less integrated velocity, rad.
    slip: f64,
    /// Currents that acted from the last SYNCs on, newest first, A.
    acted: [f64; WINDOW + 2],
    /// The joint's own inertia by the model, kg·m²; nothing before it was requested.
    inertia: Option<f64>,
    /// Distance from where the joint should be, and the tolerance, rad, if the caller gave them in this
    /// cycle.
    off: Option<[f64; 2]>,
    /// Cycles in a row.
    implausible: u8,
    current: u8,
    torque: u8,
    tracking: u8,
}

/// How the torque of a joint fits its motion, N·m: what acted less what the model needs, and how much that may be.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Left {
    left: f64,
    tolerance: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    at: Micros,
    position: f64,
    velocity: f64,
}

/// Whether a magnitude is more than `limit`. What is not a number is.
fn beyond(value: f64, limit: f64) -> bool {
    value.abs().partial_cmp(&limit).is_none_or(Ordering::is_gt)
}

impl Guarded {
    /// How far the samples' time reaches, s.
    fn span(&self) -> f64 {
        let (newest, oldest) = (self.samples[0], self.samples[WINDOW]);
        newest.at.saturating_sub(oldest.at) as f64 * 1e-6
    }

    /// Takes the next sample and tolerates `limit` rad of slip; returns the slip if it is more.
    fn take(&mut self, sample: Sample, period: f64, profile: &JointProfile, limits: [f64; 2]) -> Option<f64> {
        let last = self.samples[0];
        let time = sample.at.saturating_sub(last.at) as f64 * 1e-6;
        let [margin, forgotten] = limits;
        // The same data twice.
        if self.count > 0 && sample.at == last.at {
            self.samples[0] = sample;
            return None;
        }
        if self.count == 0 || time > 10.0 * period {
            (self.count, self.slip) = (0, 0.0);
        } else {
            let integrated = 0.5 * (sample.velocity + last.velocity) * time;
            self.slip += sample.position - last.position - integrated - self.slip * time / forgotten;
        }
        // A gap makes the differences of the window those of another time.
        self.count = if time > 1.5 * period { 1 } else { (self.count + 1).min(WINDOW + 1) };
        self.samples.rotate_right(1);
        self.samples[0] = sample;
        let limit = margin + profile.velocity * period;
        beyond(self.slip, limit).then_some(self.slip)
    }
}

impl<const N: usize> Driver<N> {
    /// Currents (A) for the next SYNC as [`Driver::set`], with where the joints should be at the last one. A joint that is
    /// farther from there than it may be stops the arm.
    ///
    /// # Errors
    /// Those of [`Driver::set`].
    pub fn set_tracked(&mut self, currents: &[f64; N], tracking: &Tracking<N>) -> Result<(), Rejection> {
        self.set(currents)?;
        let cycle = self.counters.cycles;
        let joints = self.joints.iter_mut().zip(&tracking.position).zip(&tracking.tolerance);
        for ((joint, position), tolerance) in joints {
            let seen = joint.position_cycle == cycle;
            joint.guarded.off = seen.then_some([joint.position - position, *tolerance]);
        }
        Ok(())
    }

    /// Positions (rad) and velocities (rad/s) of the joints at the last SYNC. What has not come yet is carried on with the
    /// last velocity; the second array says for how many cycles.
    pub fn state(&self) -> ([[f64; N]; 2], [u64; N]) {
        let (now, period) = (self.counters.cycles, self.profile.period_seconds());
        let position = self.joints.each_ref().map(|joint| {
            joint.position + joint.velocity * period * now.saturating_sub(joint.position_cycle) as f64
        });
        let missed = self
            .joints
            .each_ref()
            .map(|joint| now.saturating_sub(joint.position_cycle.min(joint.velocity_cycle)));
        ([position, self.joints.each_ref().map(|joint| joint.velocity)], missed)
    }

    /// Clears the memory of the guard: the joints are released.
    pub(super) fn release_guard(&mut self) {
        self.joints.iter_mut().for_each(|joint| joint.guarded = Guarded::default());
    }

    fn is_guarded(&self) -> bool {
        self.phase == Phase::Running && self.control == ControlMode::Current
    }

    /// A velocity has come after `before`: one that no joint can have is replaced by that one.
    pub(super) fn gate_velocity(&mut self, j: usize, before: f64, cycles: u64, tx: &mut impl Transmit) {
        if !self.is_guarded() {
            return;
        }
        let limits = self.profile.reactions.torque_mode;
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get_mut(j)) else {
            return;
        };
        let velocity = joint.velocity;
        // A brake may stop a joint within a cycle. Nothing speeds it up like that.
        let step = limits.velocity_step * profile.velocity * cycles.clamp(1, 10) as f64;
        let possible = (before.min(0.0) - step..=before.max(0.0) + step).contains(&velocity);
        if run(&mut joint.guarded.implausible, !possible, limits.cycles) {
            self.trip(Cause::ImplausibleVelocity(self.node(j), JointNumber::from_index(j), velocity), tx);
        } else if !possible {
            joint.counters.implausible += 1;
            joint.velocity = before;
        }
    }

    /// Compares position and velocity of a joint when all its data has arrived.
    pub(super) fn guard_sample(&mut self, j: usize, tx: &mut impl Transmit) {
        if !self.is_guarded() {
            return;
        }
        let (limits, at, period) =
            (self.profile.reactions.torque_mode, self.synced_at, self.profile.period_seconds());
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get_mut(j)) else {
            return;
        };
        let sample = Sample { at, position: joint.position, velocity: joint.velocity };
        let slip = joint.guarded.take(sample, period, profile, [limits.slip_margin, limits.slip_time]);
        if let Some(slip) = slip {
            let cause = Cause::PositionAgainstVelocity(self.node(j), JointNumber::from_index(j), slip);
            self.trip(cause, tx);
        }
    }

    /// Once a cycle, in current mode: how the torque that acted fits the motion that was measured. Nothing where there is no
    /// model, or data was missing.
    pub(super) fn torque_left(&mut self) -> Option<[Left; N]> {
        if !self.is_guarded() {
            return None;
        }
        for joint in &mut self.joints {
            joint.guarded.acted.rotate_right(1);
            joint.guarded.acted[0] = joint.demand.last();
        }
        let guard = self.torque_guard.as_ref()?;
        if self.joints.iter().any(|joint| joint.missing_run > 0 || joint.guarded.count <= WINDOW) {
            return None;
        }
        let mean = |of: &dyn Fn(&Sample) -> f64| {
            self.joints.each_ref().map(|joint| {
                let s = &joint.guarded.samples;
                let inner: f64 = s[1..WINDOW].iter().map(of).sum();
                (inner + 0.5 * (of(&s[0]) + of(&s[WINDOW]))) / WINDOW as f64
            })
        };
        let (q, dq) = (mean(&|s| s.position), mean(&|s| s.velocity));
        let ddq = self.joints.each_ref().map(|joint| {
            let s = &joint.guarded.samples;
            (s[0].velocity - s[WINDOW].velocity) / joint.guarded.span().max(1e-6)
        });
        let need = guard.torque(&q, &dq, &ddq);
        let steady = guard.torque(&q, &dq, &[0.0; N]);
        let friction = guard.friction(&q, &dq);
        // One joint's a cycle: it changes with the pose alone.
        let turn = (self.counters.cycles % N.max(1) as u64) as usize;
        let inertia = guard.inertia(&q, turn);
        let slow = self.profile.joints.each_ref().map(|joint| SLOW * joint.velocity);
        let dry = guard.friction(&q, &slow);
        let (profile, limits) = (&self.profile, self.profile.reactions.torque_mode);
        if let Some(joint) = self.joints.get_mut(turn) {
            joint.guarded.inertia = Some(inertia);
        }
        Some(core::array::from_fn(|j| {
            let (Some(joint), Some(of)) = (self.joints.get(j), profile.joints.get(j)) else {
                return Left::default();
            };
            // From the oldest sample's SYNC to the newest one's.
            let current = joint.guarded.acted[2..].iter().sum::<f64>() / WINDOW as f64;
            let acted = current * joint.units.torque_constant();
            let loose = if dq[j].abs() < slow[j] {
                limits.sticking * dry[j].abs().max(friction[j].abs())
            } else {
                limits.friction_error * friction[j].abs()
            };
            let weight = (steady[j] - friction[j]).abs();
            let rigid = limits.rigid_error * weight + limits.inertial_error * (need[j] - steady[j]).abs();
            // A light joint with a strong drive is far away before a tenth of its torque is missing.
            let own = joint.guarded.inertia.map_or(f64::INFINITY, |inertia| inertia * of.acceleration);
            let least = (limits.torque_error * of.torque).min(limits.acceleration_error * own);
            let push = guard.margin() * of.torque;
            Left { left: acted - need[j], tolerance: least + push + rigid + loose }
        }))
    }

    /// Called once a cycle in current mode: finds the joint with the largest torque error, among those whose
    /// error was too large for too long.
    pub(super) fn torque_error(&mut self, left: &[Left; N]) -> Option<Cause> {
        let limit = self.profile.reactions.torque_mode.cycles;
        let mut worst: Option<(f64, usize)> = None;
        for (j, (joint, of)) in self.joints.iter_mut().zip(left).enumerate() {
            let share = of.left.abs() / of.tolerance;
            let long = run(&mut joint.guarded.torque, beyond(share, 1.0), limit);
            if long && worst.is_none_or(|(most, _)| beyond(share, most)) {
                worst = Some((share, j));
            }
        }
        let (_, j) = worst?;
        let Left { left, tolerance } = *left.get(j)?;
        Some(Cause::TorqueError(self.node(j), JointNumber::from_index(j), left, tolerance))
    }

    /// Called once a cycle in current mode: finds a joint that is off its path, or has another current than
    /// commanded.
    pub(super) fn not_obeying(&mut self, j: usize) -> Option<Cause> {
        let (limits, node, number) =
            (self.profile.reactions.torque_mode, self.node(j), JointNumber::from_index(j));
        let (profile, joint) = (self.profile.joints.get(j)?, self.joints.get_mut(j)?);
        if let Some([far, tolerance]) = joint.guarded.off.take()
            && run(&mut joint.guarded.tracking, beyond(far, tolerance), limits.cycles)
        {
            return Some(Cause::OffPath(node, number, far, tolerance));
        }
        let error = joint.demand.error(joint.current);
        let wrong = beyond(error, limits.current_error * profile.current);
        run(&mut joint.guarded.current, wrong, limits.cycles).then_some(Cause::CurrentError(
            node,
            number,
            joint.current,
            joint.current - error,
        ))
    }
}

impl<const N: usize> TorqueGuard<N> {
    /// A joint's own inertia, kg·m².
    fn inertia(&self, q: &[f64; N], j: usize) -> f64 {
        let rest = [0.0; N];
        let unit = core::array::from_fn(|i| f64::from(u8::from(i == j)));
        let of = |torque: [f64; N]| torque.get(j).copied().unwrap_or(f64::NAN);
        of(self.torque(q, &rest, &unit)) - of(self.torque(q, &rest, &rest))
    }

    /// Friction at a velocity: what of the torque without acceleration turns with it, N·m. Gravity and Coriolis forces do not.
    fn friction(&self, q: &[f64; N], dq: &[f64; N]) -> [f64; N] {
        let forth = self.torque(q, dq, &[0.0; N]);
        let back = self.torque(q, &dq.map(|v| -v), &[0.0; N]);
        core::array::from_fn(|j| 0.5 * (forth[j] - back[j]))
    }
}
