//! A path followed with a torque model: as torque offset of drives that interpolate positions, or by a
//! control law in current mode.

mod path;
mod tolerance;
mod track;

use super::torque_loop::{Asked, TorqueLoop};
use super::{Envelope, MotionLog, RecordError, Recorder};
use nalgebra::{SMatrix, SVector};
pub use path::{Parts, Path};
use path::{REST, between};
use powerball_bus::driver::{TorqueGuard, Tracking};
use powerball_bus::transport::{Bus, Master};
use powerball_controller::dynamics::{ArmModel, Reference, State};
use powerball_controller::laws::{
    ComputedTorque, ContactDetector, JointImpedance, MomentumObserver, largest_pole,
};
use tolerance::Tolerance;
pub use track::{Followed, Sample, TorqueParts, Touched, Track, TrackingError, common_delay};

/// Share of the joints' velocities and accelerations on the way to where a path begins.
const APPROACH: f64 = 0.25;
/// From a measurement at a SYNC to the middle of the cycle in which its torque acts, cycles.
const AHEAD: f64 = 1.5;
/// By this many cycles a set-point is ahead of the middle of the cycle in which the virtual drives are there:
/// their cubic spline is two periods late, and a set-point waits for its SYNC. How late the LWA 4P's drives
/// are is not known.
const LATE: f64 = 1.5;
/// Momentum observer, rad/s.
pub const OBSERVER: f64 = 30.0;

/// How a path is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law<const N: usize> {
    /// The drives follow interpolated positions; the model's torque is their offset.
    Feedforward,
    /// Computed torque in current mode.
    Torque(ComputedTorque<f64, N>),
    /// Joint impedance in current mode.
    Impedance(JointImpedance<f64, N>),
}

impl<const N: usize> Law<N> {
    /// The name in `powerball follow --with`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Law::Feedforward => "feedforward",
            Law::Torque(_) => "torque",
            Law::Impedance(_) => "impedance",
        }
    }

    /// K and D of the closed loop about a pose with this inertia, N·m/rad and N·m·s/rad; none where the
    /// drives close it.
    pub fn stiffness_and_damping(&self, inertia: &SMatrix<f64, N, N>) -> Option<[SMatrix<f64, N, N>; 2]> {
        match self {
            Law::Feedforward => None,
            Law::Torque(law) => Some(law.stiffness_and_damping(inertia)),
            Law::Impedance(law) => Some(law.stiffness_and_damping()),
        }
    }

    /// Whether the sampled loop is stable at every one of `poses`; its largest pole.
    ///
    /// # Errors
    /// The pose at which it is not, in words.
    pub fn judge(
        &self,
        arm: &impl ArmModel<f64, N>,
        poses: impl IntoIterator<Item = SVector<f64, N>>,
        period: f64,
    ) -> Result<f64, String> {
        let mut largest = 0.0f64;
        for q in poses {
            let inertia = arm.mass_matrix(&q);
            if inertia.cholesky().is_none() {
                return Err(format!(
                    "the model's mass matrix is not positive definite at ({}) rad, so it is not that of an \
                        arm: `powerball consistent` finds the nearest values that an arm can have",
                    listed(&q)
                ));
            }
            let Some([stiffness, damping]) = self.stiffness_and_damping(&inertia) else { continue };
            let pole = largest_pole(&inertia, &stiffness, &damping, period);
            if !pole.is_stable() {
                return Err(format!(
                    "these gains are not stable at {:.0} Hz: the largest pole of the sampled loop is {:.4} \
                        at ({}) rad, and must be below 1. Take a lower bandwidth, or damping above 0",
                    1.0 / period,
                    pole.0,
                    listed(&q)
                ));
            }
            largest = largest.max(pole.0);
        }
        Ok(largest)
    }
}

fn listed<const N: usize>(q: &SVector<f64, N>) -> String {
    q.iter().map(|q| format!("{q:.2}")).collect::<Vec<_>>().join(", ")
}

/// The input of one run.
#[derive(Debug)]
pub struct Run<'a, M, const N: usize> {
    /// The path.
    pub path: &'a Path<N>,
    /// The rigid arm: its inertia shapes the gains, its torque is fed forward where `parts` are.
    pub arm: &'a M,
    /// The torques that the model predicts for the path; `None` for feedback alone.
    pub parts: Option<&'a Parts<N>>,
    /// The torques that the best known model predicts for it: they give the tolerance of the path in current
    /// mode.
    pub best: &'a Parts<N>,
    /// How far, rad, a push may take a joint off the path next to that.
    pub give: f64,
    /// The best model, for the driver's guard in current mode; without one the guard looks at all but
    /// torques.
    pub guard: Option<TorqueGuard<N>>,
    /// How it is followed.
    pub law: Law<N>,
    /// Stops the arm where something touches it, in current mode.
    pub contact: Option<ContactDetector<f64, N>>,
    /// The caller's word that a mode which was never seen on the arm itself may be tried.
    pub accept_unverified: bool,
}

/// Who gets every sample.
type Each<'a, const N: usize> = dyn FnMut(&Sample<N>, &Reference<f64, N>) + 'a;

/// Gravity and Coriolis forces left out: what feedback alone knows of an arm.
struct InertiaAlone<'a, M>(&'a M);

impl<M: ArmModel<f64, N>, const N: usize> ArmModel<f64, N> for InertiaAlone<'_, M> {
    fn mass_matrix(&self, q: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        self.0.mass_matrix(q)
    }
    fn coriolis_times_velocity(&self, _: &SVector<f64, N>, _: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::zeros()
    }
    fn coriolis_transpose_times_velocity(&self, _: &SVector<f64, N>, _: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::zeros()
    }
    fn gravity(&self, _: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::zeros()
    }
}

impl<M: ArmModel<f64, N>, const N: usize> Run<'_, M, N> {
    /// Goes to where the path begins, follows it, and stops the arm: brakes closed. `each` gets every sample
    /// of the path and where the arm shall be then, `log` a line for every cycle from the beginning of the
    /// path on.
    ///
    /// # Errors
    /// Where driver, arm or bus refuse, or the arm is stopped.
    pub fn follow<B: Bus>(
        &self,
        master: Master<B, N>,
        envelope: Envelope<N>,
        log: Option<&mut MotionLog>,
        mut each: impl FnMut(&Sample<N>, &Reference<f64, N>),
    ) -> Result<(Master<B, N>, Track<N>, Envelope<N>), RecordError> {
        let mut recorder = Recorder::bring_up(master, envelope)?;
        let start: [f64; N] = self.path.start().into();
        recorder.way_to(&start, APPROACH, 1.0)?;
        recorder.release()?;
        recorder.go(&start, APPROACH, 1.0)?;
        if self.law == Law::Feedforward {
            let track = self.with_offsets(&mut recorder, log, &mut each)?;
            let (master, envelope) = recorder.finish_with_envelope()?;
            return Ok((master, track, envelope));
        }
        let (master, envelope) = recorder.finish_with_envelope()?;
        let mut arm = TorqueLoop::bring_up(master, self.accept_unverified)?;
        if let Some(guard) = self.guard {
            arm.guard(guard);
        }
        let track = self.by_torque(&mut arm, log, &mut each)?;
        Ok((arm.finish()?, track, envelope))
    }

    fn with_offsets<B: Bus>(
        &self,
        recorder: &mut Recorder<B, N>,
        mut log: Option<&mut MotionLog>,
        each: &mut Each<'_, N>,
    ) -> Result<Track<N>, RecordError> {
        let motion = self.path.motion();
        let last = motion.len().saturating_sub(1);
        let forward = |k: usize| -> [SVector<f64, N>; 3] {
            let Some(parts) = self.parts else { return [SVector::zeros(); 3] };
            // It comes and goes while the arm rests.
            let share = (k.min(last - k) as f64 / (0.5 * REST as f64)).min(1.0);
            let at = k as f64 - LATE;
            [&parts.rigid, &parts.friction, &parts.effects].map(|part| between(part, at) * share)
        };
        let torques: Vec<[f64; N]> = match self.parts {
            Some(_) => (0..motion.len()).map(|k| forward(k).iter().sum::<SVector<f64, N>>().into()).collect(),
            None => Vec::new(),
        };
        let mut samples = Vec::new();
        recorder.follow(motion, &torques, |k, master| {
            let Some(master) = master else { return Ok(()) };
            if let Some(log) = log.as_deref_mut() {
                let reference = self.path.at(k as f64).q;
                log.take(master.driver(), reference.as_slice(), None).map_err(RecordError::Write)?;
            }
            if !self.path.is_within(k) {
                return Ok(());
            }
            let joints = master.driver().joints();
            let [q, torque] = [
                SVector::from(joints.each_ref().map(|joint| joint.position)),
                SVector::from(joints.each_ref().map(|joint| joint.torque)),
            ];
            let forward = forward(k);
            let feedback = torque - forward.iter().sum::<SVector<f64, N>>();
            let t = (k - REST) as f64 * motion.period;
            let sample = Sample { t, q, forward, feedback, external: None };
            each(&sample, &self.path.at(k as f64));
            samples.push(sample);
            Ok(())
        })?;
        Ok(Track { samples, contact: None, carried_on: 0 })
    }

    fn by_torque<B: Bus>(
        &self,
        arm: &mut TorqueLoop<B, N>,
        log: Option<&mut MotionLog>,
        each: &mut Each<'_, N>,
    ) -> Result<Track<N>, RecordError> {
        let (path, period) = (self.path, self.path.motion().period);
        let tolerance = Tolerance::new(self.parts, self.best, arm.greatest_torque(), self.give);
        let mut observer = MomentumObserver::new(OBSERVER);
        let (mut samples, mut detector, mut contact) = (Vec::new(), self.contact, None);
        arm.run(log, |measured| {
            let k = usize::try_from(measured.cycle).unwrap_or(usize::MAX);
            if k >= path.reference.len() {
                return None;
            }
            let at = k as f64 + AHEAD;
            let (now, then) = (path.at(k as f64), path.at(at));
            // Carried on along the reference to when the torque acts, with the error that was measured.
            let state =
                State { q: then.q - (now.q - measured.state.q), dq: then.dq - (now.dq - measured.state.dq) };
            let forward = match self.parts {
                Some(p) => [&p.rigid, &p.friction, &p.effects].map(|part| between(part, at)),
                None => [SVector::zeros(); 3],
            };
            let torque = match self.parts {
                Some(_) => self.law_torque(self.arm, &state, &then) + forward[1] + forward[2],
                None => self.law_torque(
                    &InertiaAlone(self.arm),
                    &state,
                    &Reference { ddq: SVector::zeros(), ..then },
                ),
            };
            let losses = self.parts.map_or_else(SVector::zeros, |parts| parts.losses(k as f64 - 0.5));
            let external = observer.advance(self.arm, &measured.state, &(measured.acted - losses), period);
            // An extrapolated state is not a measurement.
            if let (Some(detector), Some(parts), false) = (&mut detector, self.parts, measured.is_carried_on)
            {
                let rigid = between(&parts.rigid, k as f64);
                if let Some(found) = detector.update(&external, &measured.state.dq, &rigid) {
                    let t = (k as f64 - REST as f64) * period;
                    contact = Some(Touched {
                        t,
                        joint: found.joint + 1,
                        torque: found.torque,
                        link: found.link + 1,
                    });
                    // No torque more: the driver stops the arm.
                    return None;
                }
            }
            if path.is_within(k) {
                let feedback = torque - forward.iter().sum::<SVector<f64, N>>();
                let t = (k - REST) as f64 * period;
                let sample = Sample { t, q: measured.state.q, forward, feedback, external: Some(external) };
                each(&sample, &now);
                samples.push(sample);
            }
            let stiffness = self.law.stiffness_and_damping(&self.arm.mass_matrix(&measured.state.q));
            let tracking = stiffness.map(|[stiffness, _]| Tracking {
                position: now.q.into(),
                tolerance: tolerance.at(k, &stiffness),
            });
            Some(Asked { torque, tracking })
        })?;
        Ok(Track { samples, contact, carried_on: arm.carried_on() })
    }

    fn law_torque(
        &self,
        arm: &impl ArmModel<f64, N>,
        state: &State<f64, N>,
        reference: &Reference<f64, N>,
    ) -> SVector<f64, N> {
        match &self.law {
            Law::Feedforward => SVector::zeros(),
            Law::Torque(law) => law.torque(arm, state, reference),
            Law::Impedance(law) => law.torque(arm, state, reference),
        }
    }
}

#[cfg(test)]
#[cfg(feature = "demo")]
mod interrupted;
#[cfg(test)]
#[cfg(feature = "demo")]
mod tests;
