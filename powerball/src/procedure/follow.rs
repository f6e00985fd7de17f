//! A path followed with a torque model: as torque offset of drives that interpolate positions, or by a control law in
//! current mode.

use super::torque_loop::TorqueLoop;
use super::{Cleared, Envelope, RecordError, Recorder};
use crate::bus::driver::Profile;
use crate::bus::transport::{Bus, Master};
use crate::controller::dynamics::{ArmModel, Reference, State};
use crate::controller::laws::{ComputedTorque, JointImpedance, MomentumObserver, largest_pole};
use crate::identification::motion::Motion;
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use std::collections::BTreeMap;

/// Cycles at rest before and after a path, in which what is fed forward comes and goes.
const REST: usize = 100;
/// Share of the joints' velocities and accelerations on the way to where a path begins.
const APPROACH: f64 = 0.25;
/// From a measurement at a SYNC to the middle of the cycle in which its torque acts, cycles.
const AHEAD: f64 = 1.5;
/// By so many cycles a set-point is ahead of the middle of the cycle in which the virtual drives are there: their cubic
/// spline is two periods late, and a set-point waits for its SYNC. How late the LWA 4P's drives are is not known.
const LATE: f64 = 1.5;
/// Momentum observer, rad/s.
const OBSERVER: f64 = 30.0;

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
    /// K and D of the closed loop about a pose with this inertia, N·m/rad and N·m·s/rad; none where the drives close it.
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
                    "the model's mass matrix is not positive definite at ({}) rad, so it is no arm's: `powerball consistent` \
                        finds the nearest values that an arm can have",
                    listed(&q)
                ));
            }
            let Some([stiffness, damping]) = self.stiffness_and_damping(&inertia) else { continue };
            let pole = largest_pole(&inertia, &stiffness, &damping, period);
            if !pole.is_stable() {
                return Err(format!(
                    "these gains are not stable at {:.0} Hz: the largest pole of the sampled loop is {:.4} at ({}) rad, and \
                        must be below 1. Take a lower bandwidth, or damping above 0",
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

/// What the model says of a path, a vector a sample, N·m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts<const N: usize> {
    /// The rigid arm.
    pub rigid: Vec<SVector<f64, N>>,
    /// Eq. 16.
    pub friction: Vec<SVector<f64, N>>,
    /// What goes beyond both.
    pub effects: Vec<SVector<f64, N>>,
}

impl<const N: usize> Parts<N> {
    /// Their sum at a time in samples.
    fn total(&self, at: f64) -> SVector<f64, N> {
        between(&self.rigid, at) + self.losses(at)
    }

    /// What is not the rigid arm's.
    fn losses(&self, at: f64) -> SVector<f64, N> {
        between(&self.friction, at) + between(&self.effects, at)
    }

    /// The joint that a sample asks for more torque than `limits` (N·m): sample, joint from 0, torque.
    #[must_use]
    pub fn beyond(&self, limits: &SVector<f64, N>) -> Option<(usize, usize, f64)> {
        (0..self.rigid.len()).find_map(|k| {
            let torque = self.total(k as f64);
            let wrong =
                |j: &usize| torque[*j].abs().partial_cmp(&limits[*j]).is_none_or(std::cmp::Ordering::is_gt);
            (0..N).find(wrong).map(|j| (k, j, torque[j]))
        })
    }
}

/// A series at a time in samples; its ends hold.
fn between<const N: usize>(series: &[SVector<f64, N>], at: f64) -> SVector<f64, N> {
    let last = series.len().saturating_sub(1);
    let at = at.clamp(0.0, last as f64);
    let (k, part) = (at as usize, at.fract());
    let sample = |k: usize| series.get(k.min(last)).copied().unwrap_or_else(SVector::zeros);
    sample(k) * (1.0 - part) + sample(k + 1) * part
}

/// A path with rest before and after it.
#[derive(Clone, Debug)]
pub struct Path<const N: usize> {
    motion: Cleared,
    /// q, q̇ and q̈, the latter by central differences of the positions.
    reference: Vec<Reference<f64, N>>,
}

impl<const N: usize> Path<N> {
    /// Looks at a path as [`Envelope::clear`] does.
    ///
    /// # Errors
    /// Where the arm must not go along it.
    pub fn clear(
        motion: &Motion,
        envelope: &Envelope<N>,
        profile: &Profile<N>,
    ) -> Result<Path<N>, RecordError> {
        // A motion of other joints or without samples is refused here.
        envelope.clear(profile, motion.clone())?;
        let (all, h) = (motion.len(), motion.period);
        let place = |k: usize| {
            let k = k.saturating_sub(REST).min(all - 1);
            SVector::<f64, N>::from_column_slice(&motion.q[k * N..(k + 1) * N])
        };
        let mut rested = Motion::new(N, h);
        let mut reference = Vec::with_capacity(all + 2 * REST);
        for k in 0..all + 2 * REST {
            let [before, now, after] = [place(k.saturating_sub(1)), place(k), place(k + 1)];
            let (dq, ddq) = ((after - before) / (2.0 * h), (after - now * 2.0 + before) / (h * h));
            reference.push(Reference { q: now, dq, ddq });
            rested.push((0..N).map(|j| [now[j], dq[j], ddq[j]]));
        }
        Ok(Path { motion: envelope.clear(profile, rested)?, reference })
    }

    /// The motion, rest included.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        self.motion.motion()
    }

    /// Where it begins.
    #[must_use]
    pub fn start(&self) -> SVector<f64, N> {
        self.reference.first().map_or_else(SVector::zeros, |r| r.q)
    }

    fn at(&self, at: f64) -> Reference<f64, N> {
        let of = |pick: fn(&Reference<f64, N>) -> SVector<f64, N>| {
            let (k, part) = (at.max(0.0) as usize, at.max(0.0).fract());
            let last = self.reference.len().saturating_sub(1);
            let sample = |k: usize| self.reference.get(k.min(last)).map_or_else(SVector::zeros, pick);
            sample(k) * (1.0 - part) + sample(k + 1) * part
        };
        Reference { q: of(|r| r.q), dq: of(|r| r.dq), ddq: of(|r| r.ddq) }
    }

    /// Whether a cycle belongs to the path itself.
    fn is_within(&self, k: usize) -> bool {
        (REST..self.reference.len().saturating_sub(REST)).contains(&k)
    }
}

/// One cycle of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const N: usize> {
    /// Since the path began, s.
    pub t: f64,
    /// Measured positions, rad.
    pub q: SVector<f64, N>,
    /// What was fed forward, by part, N·m: rigid arm, friction, effects.
    pub forward: [SVector<f64, N>; 3],
    /// What the feedback added, N·m: the drives' own in interpolated position mode.
    pub feedback: SVector<f64, N>,
    /// External torque by the momentum observer, N·m; nothing in interpolated position mode.
    pub external: Option<SVector<f64, N>>,
}

/// A path that was followed once.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<const N: usize> {
    /// Cycles of the path itself.
    pub samples: Vec<Sample<N>>,
}

/// By how much a track is off its path.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrackingError {
    /// By joint, rad.
    pub rms: Vec<f64>,
    /// By joint, rad.
    pub max: Vec<f64>,
}

impl<const N: usize> Track<N> {
    /// Position less reference, rad, a vector a sample, the reference taken `delay` s late.
    #[must_use]
    pub fn errors(&self, path: &Path<N>, delay: f64) -> Vec<SVector<f64, N>> {
        let period = path.motion().period;
        let at = |s: &Sample<N>| REST as f64 + (s.t - delay) / period;
        self.samples.iter().map(|s| s.q - path.at(at(s)).q).collect()
    }

    /// The same as figures by joint.
    #[must_use]
    pub fn error(&self, path: &Path<N>, delay: f64) -> TrackingError {
        let errors = self.errors(path, delay);
        let of = |j: usize| errors.iter().map(move |e| e[j]);
        let count = errors.len().max(1) as f64;
        TrackingError {
            rms: (0..N).map(|j| (of(j).map(|e| e * e).sum::<f64>() / count).sqrt()).collect(),
            max: (0..N).map(|j| of(j).fold(0.0, |m: f64, e| m.max(e.abs()))).collect(),
        }
    }
}

/// The delay, s, common to all joints and tracks, with which they follow a path best: drives that interpolate are late by
/// whole cycles, and that is no error.
#[must_use]
pub fn common_delay<const N: usize>(tracks: &[&Track<N>], path: &Path<N>) -> f64 {
    let period = path.motion().period;
    let misfit =
        |delay: f64| tracks.iter().flat_map(|t| t.errors(path, delay)).map(|e| e.norm_squared()).sum::<f64>();
    let tries = (0..=80).map(|k| 0.1 * f64::from(k) * period);
    tries.map(|d| (misfit(d), d)).fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a }).1
}

/// What one run needs.
#[derive(Debug)]
pub struct Run<'a, M, const N: usize> {
    /// The path.
    pub path: &'a Path<N>,
    /// The rigid arm: its inertia shapes the gains, its torque is fed forward where `parts` are.
    pub arm: &'a M,
    /// What the model says of the path; `None` for feedback alone.
    pub parts: Option<&'a Parts<N>>,
    /// How it is followed.
    pub law: Law<N>,
    /// The caller's word that a mode which was never seen on the arm itself may be tried.
    pub accept_unverified: bool,
}

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
    /// Goes to where the path begins, follows it, and stops the arm: brakes closed.
    ///
    /// # Errors
    /// Where driver, arm or bus refuse, or the arm is stopped.
    pub fn follow<B: Bus>(
        &self,
        master: Master<B, N>,
        envelope: Envelope<N>,
    ) -> Result<(Master<B, N>, Track<N>, Envelope<N>), RecordError> {
        let mut recorder = Recorder::bring_up(master, envelope)?;
        let start: [f64; N] = self.path.start().into();
        recorder.way_to(&start, APPROACH, 1.0)?;
        recorder.release()?;
        recorder.go(&start, APPROACH, 1.0)?;
        if self.law == Law::Feedforward {
            let track = self.with_offsets(&mut recorder)?;
            let (master, envelope) = recorder.finish_with_envelope()?;
            return Ok((master, track, envelope));
        }
        let (master, envelope) = recorder.finish_with_envelope()?;
        let mut arm = TorqueLoop::bring_up(master, self.accept_unverified)?;
        let track = self.by_torque(&mut arm)?;
        Ok((arm.finish()?, track, envelope))
    }

    fn with_offsets<B: Bus>(&self, recorder: &mut Recorder<B, N>) -> Result<Track<N>, RecordError> {
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
            let Some(master) = master.filter(|_| self.path.is_within(k)) else { return Ok(()) };
            let joints = master.driver().joints();
            let [q, torque] = [
                SVector::from(joints.each_ref().map(|joint| joint.position)),
                SVector::from(joints.each_ref().map(|joint| joint.torque)),
            ];
            let forward = forward(k);
            let feedback = torque - forward.iter().sum::<SVector<f64, N>>();
            let t = (k - REST) as f64 * motion.period;
            samples.push(Sample { t, q, forward, feedback, external: None });
            Ok(())
        })?;
        Ok(Track { samples })
    }

    fn by_torque<B: Bus>(&self, arm: &mut TorqueLoop<B, N>) -> Result<Track<N>, RecordError> {
        let (path, period) = (self.path, self.path.motion().period);
        let mut observer = MomentumObserver::new(OBSERVER);
        let mut samples = Vec::new();
        arm.run(|measured| {
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
            if path.is_within(k) {
                let feedback = torque - forward.iter().sum::<SVector<f64, N>>();
                let t = (k - REST) as f64 * period;
                samples.push(Sample { t, q: measured.state.q, forward, feedback, external: Some(external) });
            }
            Some(torque)
        })?;
        Ok(Track { samples })
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

/// What came of following a path with one or several models; the keys of the maps name them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Followed {
    /// The arm's name.
    pub arm: String,
    /// `feedforward`, `torque` or `impedance`.
    pub with: String,
    /// Root mean square by joint, rad.
    pub tracking_error: BTreeMap<String, Vec<f64>>,
    /// Greatest by joint, rad.
    pub largest_error: BTreeMap<String, Vec<f64>>,
    /// The delay, s, with which drives follow set-points, the same for all runs; 0 in current mode.
    pub delay: f64,
    /// Root mean square of the torque by joint, N·m, by what it is for.
    pub torque: BTreeMap<String, TorqueParts>,
    /// Bandwidth of the feedback, rad/s, and the largest pole of its sampled loop, where this program closes it.
    pub bandwidth: Option<f64>,
    /// See [`largest_pole`].
    pub largest_pole: Option<f64>,
    /// Cycles of the path in each run.
    pub cycles: usize,
}

/// Root mean squares by joint, N·m.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TorqueParts {
    /// Fed forward for the rigid arm.
    pub rigid: Vec<f64>,
    /// For Eq. 16.
    pub friction: Vec<f64>,
    /// For the effects.
    pub effects: Vec<f64>,
    /// What the feedback added.
    pub feedback: Vec<f64>,
    /// External torque that the observer sees, where it ran.
    pub external: Option<Vec<f64>>,
}

impl<const N: usize> Track<N> {
    /// The torques as figures.
    #[must_use]
    pub fn torques(&self) -> TorqueParts {
        let rms = |of: &dyn Fn(&Sample<N>) -> SVector<f64, N>| -> Vec<f64> {
            let sum = self.samples.iter().fold(SVector::<f64, N>::zeros(), |sum, s| {
                let x = of(s);
                sum + x.component_mul(&x)
            });
            let count = self.samples.len().max(1) as f64;
            sum.iter().map(|x| (x / count).sqrt()).collect()
        };
        let observed = self.samples.iter().any(|s| s.external.is_some());
        TorqueParts {
            rigid: rms(&|s| s.forward[0]),
            friction: rms(&|s| s.forward[1]),
            effects: rms(&|s| s.forward[2]),
            feedback: rms(&|s| s.feedback),
            external: observed.then(|| rms(&|s| s.external.unwrap_or_else(SVector::zeros))),
        }
    }
}

#[cfg(test)]
#[cfg(feature = "virtual-arm")]
mod tests {
    use super::*;
    use crate::bus::driver::lwa4p::LWA4P;
    use crate::bus::driver::{Cause, Driver};
    use crate::bus::transport::{ArmError, Interrupt, Memory};
    use crate::controller::friction::{TABLE_2, TanhFriction};
    use crate::identification::NumericArm;
    use crate::virtual_arm::slave::CurrentMode;
    use crate::virtual_arm::{PlantEffect, VirtualArm, lwa4p};
    use dyngen::{Model, SetKind};

    const SPRING: f64 = 6.0;

    type Arm = Master<Memory<VirtualArm>, 6>;

    fn master(profile: Profile<6>) -> Arm {
        let mode = CurrentMode { mode: 4, target: LWA4P.current.unwrap().setpoint };
        let mut setup = lwa4p::setup([0.0; 6], 1).unwrap().with_current_mode(mode);
        setup.modules.iter_mut().for_each(|module| module.commutated = true);
        setup.plant = setup.plant.with(PlantEffect::Spring { joint: 0, stiffness: SPRING, rest: -0.2 });
        Master::new(Driver::new(profile).unwrap(), Memory::new(VirtualArm::new(setup).unwrap(), 500_000))
    }

    fn numeric() -> NumericArm<6> {
        let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
        let all: Vec<f64> = lwa4p::links().iter().flat_map(|b| b.parameters()).collect();
        let values = model.set_values(model.set(SetKind::Minimal).unwrap(), &all);
        NumericArm::new(&model, &values, [0.0; 6]).unwrap().unwrap()
    }

    fn path(amplitude: f64) -> Path<6> {
        let mut motion = Motion::new(6, 0.005);
        for k in 0..=600 {
            let w = std::f64::consts::TAU * f64::from(k) / 600.0;
            motion
                .push((0..6).map(|j| [amplitude * (0.2 + 0.05 * f64::from(j)) * (1.0 - w.cos()), 0.0, 0.0]));
        }
        Path::clear(&motion, &Envelope::new(|_| None), &LWA4P).unwrap()
    }

    /// True parts of the path; `spring` tells whether the effect is known.
    fn parts(path: &Path<6>, arm: &NumericArm<6>, spring: bool) -> Parts<6> {
        let laws = TABLE_2.map(TanhFriction::new);
        let of = |f: &dyn Fn(&Reference<f64, 6>) -> SVector<f64, 6>| path.reference.iter().map(f).collect();
        let effect = |r: &Reference<f64, 6>| {
            // That of the virtual arm: stiffness around rest.
            let share = if spring { SPRING } else { 0.0 };
            SVector::from([share * (r.q[0] + 0.2), 0.0, 0.0, 0.0, 0.0, 0.0])
        };
        Parts {
            rigid: of(&|r| {
                arm.mass_matrix(&r.q) * r.ddq + arm.coriolis_times_velocity(&r.q, &r.dq) + arm.gravity(&r.q)
            }),
            friction: of(&|r| SVector::from_fn(|j, _| laws[j].torque(r.dq[j]))),
            effects: of(&effect),
        }
    }

    fn rests(master: &Arm) {
        let arm = master.bus().peer();
        for (j, node) in arm.nodes().iter().enumerate() {
            assert!(node.brake_closed() && !node.state().has_torque(), "joint {}", j + 1);
        }
    }

    #[test]
    fn a_known_effect_halves_the_error_and_the_observer_sees_an_unknown_one() {
        let (arm, path) = (numeric(), path(1.0));
        let law = Law::Torque(ComputedTorque::for_period(0.005));
        let drive = |parts: Option<Parts<6>>| {
            let run = Run { path: &path, arm: &arm, parts: parts.as_ref(), law, accept_unverified: true };
            let (master, track, _) = run.follow(master(LWA4P), Envelope::new(|_| None)).unwrap();
            rests(&master);
            assert_eq!(track.samples.len(), 601);
            track
        };
        let [alone, base, explained] =
            [None, Some(parts(&path, &arm, false)), Some(parts(&path, &arm, true))].map(drive);
        let rms = |track: &Track<6>| track.error(&path, 0.0).rms[0];
        assert!(rms(&base) < 0.5 * rms(&alone), "{} {}", rms(&base), rms(&alone));
        assert!(rms(&explained) < 0.5 * rms(&base), "{} {}", rms(&explained), rms(&base));
        // The spring pulls with up to 4 N·m; the observer lags by a thirtieth of a second.
        let seen = |track: &Track<6>| -> f64 {
            let off = |s: &Sample<6>| s.external.unwrap()[0] + SPRING * (s.q[0] + 0.2);
            (track.samples.iter().map(|s| off(s).powi(2)).sum::<f64>() / 601.0).sqrt()
        };
        assert!(seen(&base) < 0.6, "{}", seen(&base));
        let external = explained.torques().external.unwrap()[0];
        assert!(external < 0.6, "{external}");
    }

    #[test]
    fn torque_offsets_take_the_work_off_the_drives_own_feedback() {
        let (arm, path) = (numeric(), path(1.0));
        let drive = |parts: Option<Parts<6>>| {
            let law = Law::Feedforward;
            let run = Run { path: &path, arm: &arm, parts: parts.as_ref(), law, accept_unverified: false };
            let profile = LWA4P.with_torque_offset();
            let (master, track, _) = run.follow(master(profile), Envelope::new(|_| None)).unwrap();
            rests(&master);
            track
        };
        let [alone, explained] = [None, Some(parts(&path, &arm, true))].map(drive);
        let tracks = [&alone, &explained];
        let delay = common_delay(&tracks, &path);
        assert!((2.5..4.0).contains(&(delay / 0.005)), "{delay}");
        for track in tracks {
            assert!(track.error(&path, delay).rms.iter().all(|e| *e < 1e-4));
        }
        let left = |track: &Track<6>, j: usize| track.torques().feedback[j];
        for j in 0..4 {
            assert!(left(&explained, j) < 0.25 * left(&alone, j), "joint {}", j + 1);
        }
    }

    #[test]
    fn what_is_not_accepted_not_known_or_not_stable_is_refused_with_closed_brakes() {
        let refused = |profile: Profile<6>, accept: bool| {
            let failed = TorqueLoop::bring_up(master(profile), accept).map(|_| ()).unwrap_err();
            failed.to_string()
        };
        assert!(refused(LWA4P, false).contains("never verified"));
        let mut unknown = LWA4P;
        unknown.joints[2].units.rated_torque = 0.0;
        let text = refused(unknown, true);
        assert!(text.contains("joint 3") && text.contains("torque constant"), "{text}");
        let (arm, poses) = (numeric(), [SVector::zeros()]);
        let judge = |w: f64| Law::Torque(ComputedTorque::of_bandwidth(w)).judge(&arm, poses, 0.005);
        assert!(judge(20.0).unwrap() < 0.95);
        assert!(judge(150.0).unwrap_err().contains("not stable at 200 Hz"));
    }

    #[test]
    fn an_interrupt_stops_the_law_and_the_arm() {
        let (arm, path) = (numeric(), path(1.0));
        let interrupt = Interrupt::default();
        let mut cycles = 0;
        let mut held = TorqueLoop::bring_up(master(LWA4P).with_interrupt(interrupt.clone()), true).unwrap();
        let ended = held.run(|m| {
            cycles += 1;
            if cycles == 100 {
                interrupt.ask();
            }
            let reference = path.at(0.0);
            Some(ComputedTorque::for_period(0.005).torque(&arm, &m.state, &reference))
        });
        assert!(
            matches!(&ended, Err(RecordError::Arm(ArmError::Stopped(Cause::Interrupted, _)))),
            "{ended:?}"
        );
        assert!(cycles < 104);
    }
}
