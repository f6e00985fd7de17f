//! Contact detection: external torque that is larger than the error of the model can be.

use super::number;
use crate::friction::TanhFriction;
use nalgebra::{RealField, SVector};

/// Cycles in a row above the level: one alone can be a sensor's.
const CYCLES: u8 = 2;

/// Detects contact with the arm: an external torque of the momentum observer above a level that goes with the
/// motion (dynamic thresholds: Haddadin, De Luca, Albu-Schäffer, *Robot collisions: a survey*, T-RO 33, 2017,
/// §V).
///
/// level = `noise` + `friction`·|f(q̇)| + `sticking`·(γ1 + γ3)·(1 − (f(q̇)/f_C)²) + `rigid`·|τ_rigid|, by
/// joint: friction is known to within a share of it, and a joint that rests may be held by all of its dry
/// friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactDetector<T, const N: usize> {
    /// Output of the observer at rest and without contact, N·m, by joint.
    pub noise: SVector<T, N>,
    /// Share of the friction that is not known.
    pub friction: T,
    /// Share of the dry friction that is not known where the joint rests.
    pub sticking: T,
    /// Share of the rigid arm's torque that is not known.
    pub rigid: T,
    laws: [TanhFriction<T>; N],
    above: [u8; N],
}

/// A contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<T> {
    /// The joint, from 0, whose external torque is most above its level.
    pub joint: usize,
    /// External torque of this joint, N·m.
    pub torque: T,
    /// The last joint, from 0, that is above its level: the contact is on its link or beyond it.
    pub link: usize,
}

impl<T: RealField + Copy, const N: usize> ContactDetector<T, N> {
    /// A detector for the model's friction `laws` and the observer's output without contact `noise`, N·m, by
    /// joint. It tolerates an error of a tenth of the friction, of all dry friction at rest and of 2 % of the
    /// rigid torque.
    #[must_use]
    pub fn new(laws: [TanhFriction<T>; N], noise: SVector<T, N>) -> Self {
        let [friction, sticking, rigid] = [0.1, 1.0, 0.02].map(number);
        ContactDetector { noise, friction, sticking, rigid, laws, above: [0; N] }
    }

    /// The level of a joint, N·m.
    fn level(&self, joint: usize, velocity: T, rigid: T) -> T {
        let law = &self.laws[joint];
        let dry = law.gamma1.abs() + law.gamma3.abs();
        let torque = law.torque(velocity);
        let saturated = if dry > T::zero() { (torque / dry).abs().min(T::one()) } else { T::one() };
        self.noise[joint]
            + self.friction * torque.abs()
            + self.sticking * dry * (T::one() - saturated * saturated)
            + self.rigid * rigid.abs()
    }

    /// Called once a cycle with the external torques of the observer, the velocities, and the torques of the
    /// rigid arm. `None` without contact; NaN does not count as contact.
    pub fn update(
        &mut self,
        external: &SVector<T, N>,
        velocity: &SVector<T, N>,
        rigid: &SVector<T, N>,
    ) -> Option<Contact<T>> {
        let mut most = None::<(T, usize)>;
        let mut link = 0;
        for joint in 0..N {
            let ratio = external[joint].abs() / self.level(joint, velocity[joint], rigid[joint]);
            let is_above = ratio > T::one();
            self.above[joint] = if is_above { self.above[joint].saturating_add(1) } else { 0 };
            if self.above[joint] >= CYCLES {
                link = joint;
                if most.is_none_or(|(largest, _)| ratio > largest) {
                    most = Some((ratio, joint));
                }
            }
        }
        most.map(|(_, joint)| Contact { joint, torque: external[joint], link })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn detector() -> ContactDetector<f64, 3> {
        let law = TanhFriction::new([2.0, 100.0, 1.0, 20.0, 0.5]);
        ContactDetector::new([law; 3], Vector3::new(0.2, 0.2, 0.1))
    }

    /// Computed by hand: at 1 rad/s f = 3.5, so that 0.2 + 0.35 + 0.02·10 = 0.75 N·m is the level of joint 1.
    #[test]
    fn the_level_goes_with_the_motion() {
        let (fast, rigid) = (Vector3::repeat(1.0), Vector3::repeat(10.0));
        for (torque, seen) in [(0.74, false), (0.76, true), (-0.76, true)] {
            let mut detector = detector();
            let external = Vector3::new(torque, 0.0, 0.0);
            assert_eq!(detector.update(&external, &fast, &rigid), None, "one cycle alone");
            let contact = detector.update(&external, &fast, &rigid);
            assert_eq!(contact, seen.then_some(Contact { joint: 0, torque, link: 0 }), "{torque}");
        }
        // At rest 0.2 + 3.
        let mut slow = detector();
        let external = Vector3::new(3.15, 0.0, 0.0);
        assert!((0..5).all(|_| slow.update(&external, &Vector3::zeros(), &Vector3::zeros()).is_none()));
    }

    #[test]
    fn a_contact_is_on_the_last_link_that_feels_it_and_numbers_that_are_none_are_none() {
        let (rest, mut detector) = (Vector3::zeros(), detector());
        let external = Vector3::new(5.0, -9.0, 0.05);
        detector.update(&external, &rest, &rest);
        let contact = detector.update(&external, &rest, &rest).unwrap();
        assert_eq!((contact.joint, contact.link, contact.torque), (1, 1, -9.0));
        assert_eq!(detector.update(&Vector3::repeat(f64::NAN), &rest, &rest), None);
        assert_eq!(detector.update(&external, &rest, &rest), None, "counting begins anew");
    }
}
