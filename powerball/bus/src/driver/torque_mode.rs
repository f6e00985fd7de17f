//! The guard of current mode: it detects a joint that does not move as its torque predicts, and measurements
//! that are impossible for a joint.
//!
//! In the other modes a drive holds its joint, and a wrong measurement is a visible error. In current mode
//! the caller's law holds it: a wrong measurement becomes a motion. So each joint is checked in every cycle:
//!
//! * a velocity that no joint can have is not used, and stops the arm when it stays;
//! * position and integrated velocity that drift apart: one of the two is wrong;
//! * the measured current against the commanded one;
//! * the torque that acted against what the model needs for the measured motion ([`TorqueGuard`]), where
//!   there is a model: a drive that does not act or acts the wrong way, a joint that is stuck, an encoder
//!   that stands still;
//! * where the caller says where the joint should be ([`Tracking`]), how far it is from there;
//! * its velocity, with a smaller margin than in the other modes.
//!
//! The limits are [`TorqueMode`](super::profile::TorqueMode).

use super::arm::Arm;
use super::cause::Cause;
use super::presence::run;
use super::profile::JointProfile;
use super::torque::TorqueGuard;
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

/// The memory of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct Guarded {
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

/// How the torque of a joint fits its motion, N·m: what acted less what the model needs, and how much that
/// may be.
#[derive(Clone, Copy, Debug, Default)]
struct Left {
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

/// The guard of current mode of all joints, used while the arm follows currents. Each check returns a cause,
/// and stops nothing.
#[derive(Clone, Debug)]
pub(super) struct TorqueWatch<const N: usize> {
    joints: [Guarded; N],
}

impl<const N: usize> TorqueWatch<N> {
    /// Nothing is remembered: the joints are released.
    pub(super) fn new() -> Self {
        TorqueWatch { joints: [Guarded::default(); N] }
    }

    /// Where the joints should be at the last SYNC, for those whose positions have come.
    pub(super) fn track(&mut self, arm: &Arm<N>, tracking: &Tracking<N>) {
        let wanted = tracking.position.iter().zip(&tracking.tolerance);
        for ((guarded, joint), (position, tolerance)) in self.joints.iter_mut().zip(&arm.joints).zip(wanted) {
            let seen = joint.position_cycle == arm.counters.cycles;
            guarded.off = seen.then_some([joint.position - position, *tolerance]);
        }
    }

    /// Each velocity: one that no joint can have is replaced by the one before.
    pub(super) fn gate_velocity(&mut self, arm: &mut Arm<N>, j: usize) -> Option<Cause> {
        let limits = arm.profile.reactions.torque_mode;
        let (profile, joint) = (arm.profile.joints.get(j)?, arm.joints.get_mut(j)?);
        let (velocity, (before, cycles)) = (joint.velocity, joint.velocity_before);
        // A brake may stop a joint within a cycle. Nothing speeds it up like that.
        let step = limits.velocity_step * profile.velocity * cycles.clamp(1, 10) as f64;
        let possible = (before.min(0.0) - step..=before.max(0.0) + step).contains(&velocity);
        if run(&mut self.joints.get_mut(j)?.implausible, !possible, limits.cycles) {
            return Some(Cause::ImplausibleVelocity(profile.node, JointNumber::from_index(j), velocity));
        }
        if !possible {
            joint.reject_velocity();
        }
        None
    }

    /// Compares position and velocity of a joint when all its data of the cycle of the SYNC `at` has arrived.
    pub(super) fn slip(&mut self, arm: &Arm<N>, at: Micros, j: usize) -> Option<Cause> {
        let (limits, period) = (&arm.profile.reactions.torque_mode, arm.profile.period_seconds());
        let (profile, joint) = (arm.profile.joints.get(j)?, arm.joints.get(j)?);
        let sample = Sample { at, position: joint.position, velocity: joint.velocity };
        let limits = [limits.slip_margin, limits.slip_time];
        let slip = self.joints.get_mut(j)?.take(sample, period, profile, limits)?;
        Some(Cause::PositionAgainstVelocity(profile.node, JointNumber::from_index(j), slip))
    }

    /// Once a cycle: finds the joint with the largest torque error, among those whose error was too large for
    /// too long.
    pub(super) fn torque_error(&mut self, arm: &Arm<N>) -> Option<Cause> {
        let limit = arm.profile.reactions.torque_mode.cycles;
        let left = self.torque_left(arm)?;
        let mut worst: Option<(f64, usize)> = None;
        for (j, (guarded, of)) in self.joints.iter_mut().zip(&left).enumerate() {
            let share = of.left.abs() / of.tolerance;
            let long = run(&mut guarded.torque, beyond(share, 1.0), limit);
            if long && worst.is_none_or(|(most, _)| beyond(share, most)) {
                worst = Some((share, j));
            }
        }
        let (_, j) = worst?;
        let Left { left, tolerance } = *left.get(j)?;
        Some(Cause::TorqueError(arm.node(j), JointNumber::from_index(j), left, tolerance))
    }

    /// How the torque that acted fits the motion that was measured. Nothing where there is no model, or data
    /// was missing.
    fn torque_left(&mut self, arm: &Arm<N>) -> Option<[Left; N]> {
        for (guarded, joint) in self.joints.iter_mut().zip(&arm.joints) {
            guarded.acted.rotate_right(1);
            guarded.acted[0] = joint.demand.last();
        }
        let guard = arm.torque_guard.as_ref()?;
        let gap = arm.joints.iter().any(|joint| joint.presence.missing() > 0);
        if gap || self.joints.iter().any(|guarded| guarded.count <= WINDOW) {
            return None;
        }
        let mean = |of: &dyn Fn(&Sample) -> f64| {
            self.joints.each_ref().map(|guarded| {
                let s = &guarded.samples;
                let inner: f64 = s[1..WINDOW].iter().map(of).sum();
                (inner + 0.5 * (of(&s[0]) + of(&s[WINDOW]))) / WINDOW as f64
            })
        };
        let (q, dq) = (mean(&|s| s.position), mean(&|s| s.velocity));
        let ddq = self.joints.each_ref().map(|guarded| {
            let s = &guarded.samples;
            (s[0].velocity - s[WINDOW].velocity) / guarded.span().max(1e-6)
        });
        let need = guard.torque(&q, &dq, &ddq);
        let steady = guard.torque(&q, &dq, &[0.0; N]);
        let friction = guard.friction(&q, &dq);
        // One joint's a cycle: it changes with the pose alone.
        let turn = (arm.counters.cycles % N.max(1) as u64) as usize;
        let inertia = guard.inertia(&q, turn);
        let slow = arm.profile.joints.each_ref().map(|joint| SLOW * joint.velocity);
        let dry = guard.friction(&q, &slow);
        let limits = &arm.profile.reactions.torque_mode;
        if let Some(guarded) = self.joints.get_mut(turn) {
            guarded.inertia = Some(inertia);
        }
        Some(core::array::from_fn(|j| {
            let (Some(joint), Some(guarded), Some(of)) =
                (arm.joints.get(j), self.joints.get(j), arm.profile.joints.get(j))
            else {
                return Left::default();
            };
            // From the oldest sample's SYNC to the newest one's.
            let current = guarded.acted[2..].iter().sum::<f64>() / WINDOW as f64;
            let acted = current * joint.units.torque_constant();
            let loose = if dq[j].abs() < slow[j] {
                limits.sticking * dry[j].abs().max(friction[j].abs())
            } else {
                limits.friction_error * friction[j].abs()
            };
            let weight = (steady[j] - friction[j]).abs();
            let rigid = limits.rigid_error * weight + limits.inertial_error * (need[j] - steady[j]).abs();
            // A light joint with a strong drive is far away before a tenth of its torque is missing.
            let own = guarded.inertia.map_or(f64::INFINITY, |inertia| inertia * of.acceleration);
            let least = (limits.torque_error * of.torque).min(limits.acceleration_error * own);
            let push = guard.margin() * of.torque;
            Left { left: acted - need[j], tolerance: least + push + rigid + loose }
        }))
    }

    /// Once a cycle: whether a joint is off its path, or has another current than commanded.
    pub(super) fn not_obeying(&mut self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let (limits, number) = (&arm.profile.reactions.torque_mode, JointNumber::from_index(j));
        let (profile, joint) = (arm.profile.joints.get(j)?, arm.joints.get(j)?);
        let guarded = self.joints.get_mut(j)?;
        if let Some([far, tolerance]) = guarded.off.take()
            && run(&mut guarded.tracking, beyond(far, tolerance), limits.cycles)
        {
            return Some(Cause::OffPath(profile.node, number, far, tolerance));
        }
        let error = joint.demand.error(joint.current);
        let wrong = beyond(error, limits.current_error * profile.current);
        let commanded = joint.current - error;
        run(&mut guarded.current, wrong, limits.cycles).then_some(Cause::CurrentError(
            profile.node,
            number,
            joint.current,
            commanded,
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

    /// Friction at a velocity: what of the torque without acceleration turns with it, N·m. Gravity and
    /// Coriolis forces do not.
    fn friction(&self, q: &[f64; N], dq: &[f64; N]) -> [f64; N] {
        let forth = self.torque(q, dq, &[0.0; N]);
        let back = self.torque(q, &dq.map(|v| -v), &[0.0; N]);
        core::array::from_fn(|j| 0.5 * (forth[j] - back[j]))
    }
}
