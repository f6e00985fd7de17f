//! The limits of a motion, checked as a whole before the arm moves: the driver's own guard sample by sample,
//! the torque that the joints have, the floor, and the arm's links among each other.

use super::RecordError;
use dyngen::{Arm, Model};
use powerball_bus::driver::{Profile, TorqueGuard, check_path};
use powerball_identification::excite::{
    CLEARANCE, Constraints, Error, FloorAt, Limits, Load, Masses, RADIUS, Shape, surroundings,
};
use powerball_identification::mounting::Mounting;
use powerball_logs::motion::Motion;
use std::fmt;

/// Says why the arm must not go along a motion.
type Barred = Box<dyn Fn(&Motion) -> Option<String>>;

/// A motion that was checked as a whole and passed. The check takes a millisecond per thousand samples, so it
/// is done before the arm has torque: a cycle does not have this time.
#[derive(Clone, Debug)]
pub struct Cleared(Motion);

impl Cleared {
    /// The motion that passed.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        &self.0
    }
}

/// The limits of the motions of an arm of `N` joints.
pub struct Envelope<const N: usize> {
    /// Why the arm must not go along a motion, in addition to the limits of its joints.
    barred: Barred,
    torque: Option<TorqueGuard<N>>,
}

impl<const N: usize> fmt::Debug for Envelope<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Envelope").field("torque", &self.torque).finish_non_exhaustive()
    }
}

impl<const N: usize> Envelope<N> {
    /// An envelope with the check `barred` of a motion and without a check of torques, for arms whose
    /// surroundings are known otherwise.
    pub fn new(barred: impl Fn(&Motion) -> Option<String> + 'static) -> Envelope<N> {
        Envelope { barred: Box::new(barred), torque: None }
    }

    /// An arm in a mounting: its links as capsules, the floor (as [`surroundings`] has it where none is
    /// given) and the torques of `masses`, which are guessed from the capsules where they are not given.
    ///
    /// The torque model stays in memory until the program ends, as a driver may guard its set-points with it.
    ///
    /// # Errors
    /// Where the arm file lacks limits or the arm's model is not to be had.
    pub fn of(
        arm: &Arm,
        mounting: &Mounting,
        floor: Option<FloorAt>,
        masses: Option<&Masses>,
    ) -> Result<Envelope<N>, Error> {
        if arm.dof() != N {
            return Err(Error::Setting(format!(
                "the arm file has {} joints, the arm on the bus {N}",
                arm.dof()
            )));
        }
        let limits = Limits::of(arm, 0.0)?;
        let shape = Shape::new(arm, &limits.0, RADIUS);
        let model = Model::derive(mounting.of(arm).map_err(Error::Setting)?)?;
        let guessed;
        let masses = match masses {
            Some(masses) => masses,
            None => {
                guessed = Masses::guess(&model, &shape, &limits.0)?;
                &guessed
            }
        };
        let load = Load::new(&model, masses, &limits.0)?;
        let (space, _) = surroundings(arm, mounting, &shape, floor, CLEARANCE, &limits);
        let guard = load.clone();
        let torque = move |q: &[f64; N], dq: &[f64; N], ddq: &[f64; N]| {
            <[f64; N]>::try_from(guard.torques(q, dq, ddq)).unwrap_or([f64::NAN; N])
        };
        let constraints = Constraints { space: Some(space), load: Some(load), ..Constraints::of(limits) };
        Ok(Envelope {
            barred: Box::new(move |motion| constraints.broken(&as_sent(motion))),
            torque: Some(TorqueGuard::new(Box::leak(Box::new(torque)))),
        })
    }

    /// The model for the driver's guard of set-points, where there is one.
    pub fn torque_guard(&self) -> Option<TorqueGuard<N>> {
        self.torque
    }

    /// Lets a motion through, or says why the arm must not go along it.
    ///
    /// # Errors
    /// Those of [`check`](Self::check), and [`RecordError::Motion`] where it is not a motion of this arm at
    /// its rate.
    pub fn clear(&self, profile: &Profile<N>, motion: Motion) -> Result<Cleared, RecordError> {
        let period = profile.period_seconds();
        if motion.dof() != N || motion.is_empty() {
            return Err(RecordError::Motion(format!(
                "the motion has {} joints and {} samples; the arm has {N} joints",
                motion.dof(),
                motion.len()
            )));
        }
        if (motion.period - period).abs() > 1e-6 {
            return Err(RecordError::Motion(format!(
                "the motion has a sample every {:.3} ms, the arm's SYNC comes every {:.3} ms: sample it at \
                {} Hz",
                1e3 * motion.period,
                1e3 * period,
                (1.0 / period).round()
            )));
        }
        self.check(profile, &motion)?;
        Ok(Cleared(motion))
    }

    /// Whether the arm may go along a motion, from rest at its first sample to rest at its last.
    ///
    /// # Errors
    /// [`RecordError::Motion`] where the driver would not take it, [`RecordError::Barred`] where it takes too
    /// much torque, or something would be touched.
    pub fn check(&self, profile: &Profile<N>, motion: &Motion) -> Result<(), RecordError> {
        let rows = motion.samples().filter_map(|[q, ..]| <[f64; N]>::try_from(q).ok());
        check_path(profile, rows).map_err(|(k, why)| {
            let end = if k >= motion.len() { ", where it must end at rest" } else { "" };
            let time = k as f64 * motion.period;
            RecordError::Motion(format!("sample {k}, at {time:.3} s{end}: {why}"))
        })?;
        (self.barred)(motion).map_or(Ok(()), |why| Err(RecordError::Barred(why)))
    }
}

/// The motion as the drives get it: positions, and the velocities and accelerations of their differences,
/// whatever stands next to them in its file.
fn as_sent(motion: &Motion) -> Motion {
    let (n, period) = (motion.dof(), motion.period);
    let q = |k: usize, j: usize| motion.q[k * n + j];
    let mut sent = Motion::new(n, period);
    for k in 0..motion.len() {
        let (before, earlier) = (k.saturating_sub(1), k.saturating_sub(2));
        sent.push((0..n).map(|j| {
            let [now, last] = [q(k, j) - q(before, j), q(before, j) - q(earlier, j)];
            [q(k, j), now / period, (now - last) / (period * period)]
        }));
    }
    sent
}

/// The masses for the check of set-points and motions of the built-in arm if no better ones are known: the
/// bodies of the CAD model, and Table 2's friction. The additional friction of a cold arm, and its payload,
/// must fit into a fifth of its torque.
#[cfg(feature = "demo")]
#[must_use]
pub fn built_in_masses() -> Masses {
    Masses {
        parameters: powerball_virtual_arm::lwa4p::links().iter().flat_map(|body| body.parameters()).collect(),
        friction: Some(powerball_controller::friction::TABLE_2.to_vec()),
        reserve: 0.2,
        origin: "the CAD model's masses and Table 2's friction".to_string(),
    }
}

#[cfg(test)]
#[cfg(feature = "demo")]
mod tests {
    use super::*;
    use crate::procedure::way;
    use powerball_bus::driver::lwa4p::LWA4P;
    use powerball_virtual_arm::lwa4p;

    fn envelope(floor: Option<f64>, friction: f64) -> Envelope<6> {
        let parameters = lwa4p::links().iter().flat_map(|body| body.parameters()).collect();
        let friction = Some(vec![[0.0, 1.0, 0.0, 1.0, friction]; 6]);
        let masses = Masses { parameters, friction, reserve: 0.0, origin: String::new() };
        Envelope::of(&lwa4p::arm().unwrap(), &Mounting::Filed, Some(FloorAt(floor)), Some(&masses)).unwrap()
    }

    fn to(pose: [f64; 6]) -> Motion {
        way(&LWA4P, &[0.0; 6], &pose, 0.9, 1.0)
    }

    /// Each barrier alone: the arm itself, the floor, the torque, the joints' limits.
    #[test]
    fn each_barrier_is_reported_before_the_arm_moves() {
        let open = envelope(None, 0.0);
        let refused = |envelope: &Envelope<6>, motion: &Motion| match envelope.check(&LWA4P, motion) {
            Err(e) => e.to_string(),
            Ok(()) => panic!("it was let through"),
        };
        let bow = to([0.0, 1.7, 0.0, 0.0, 0.0, 0.0]);
        assert!(open.check(&LWA4P, &bow).is_ok());
        assert!(refused(&envelope(Some(-0.05), 0.0), &bow).contains("floor"));
        // 1.1 rad/s at 60 N·m·s/rad, and the arm's weight: more than joint 2 has, in its limits of velocity.
        let rise = way(&LWA4P, &[0.0, 1.7, 0.0, 0.0, 0.0, 0.0], &[0.0; 6], 0.9, 1.0);
        assert!(open.check(&LWA4P, &rise).is_ok());
        assert!(refused(&envelope(None, 60.0), &rise).contains("joint 2 needs"));
        let folded = to([0.0, 0.0, 2.7, 0.0, 0.0, 0.0]);
        assert!(refused(&open, &folded).contains("link"), "{}", refused(&open, &folded));
        let far = way(&LWA4P, &[0.0; 6], &[0.0, 2.0, 0.0, 0.0, 0.0, 0.0], 0.9, 1.0);
        assert!(matches!(open.check(&LWA4P, &far), Err(RecordError::Motion(_))));
    }

    /// What a trajectory's file holds in addition to its positions does not matter: the drives get the
    /// positions.
    #[test]
    fn velocities_of_a_file_are_not_believed() {
        let mut motion = way(&LWA4P, &[0.0, 1.7, 0.0, 0.0, 0.0, 0.0], &[0.0; 6], 0.9, 1.0);
        motion.dq.iter_mut().chain(&mut motion.ddq).for_each(|x| *x = 0.0);
        let text = envelope(None, 60.0).check(&LWA4P, &motion).unwrap_err().to_string();
        assert!(text.contains("joint 2 needs"), "{text}");
    }
}
