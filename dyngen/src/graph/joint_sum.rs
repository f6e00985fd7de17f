//! Sums and differences of joint angles: across parallel axes only they matter.

use std::fmt;

/// A joint's angle, or a sum or difference of several joints' angles; the first joint has the sign plus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointSum {
    plus: u32,
    minus: u32,
}

impl JointSum {
    /// One joint's angle; joints count from 0.
    pub fn joint(joint: usize) -> JointSum {
        JointSum { plus: 1 << joint, minus: 0 }
    }

    /// A sum of joints, each with its sign (`true`: minus), and whether the sum is the negative of the
    /// requested one: the first joint's sign is plus.
    pub fn of(joints: impl IntoIterator<Item = (usize, bool)>) -> (JointSum, bool) {
        let mut sum = JointSum { plus: 0, minus: 0 };
        for (joint, negative) in joints {
            *(if negative { &mut sum.minus } else { &mut sum.plus }) |= 1 << joint;
        }
        let negative = sum.minus.trailing_zeros() < sum.plus.trailing_zeros();
        (if negative { JointSum { plus: sum.minus, minus: sum.plus } } else { sum }, negative)
    }

    /// The joints with their signs, `true` where the sign is minus.
    pub fn joints(self) -> impl Iterator<Item = (usize, bool)> {
        let mut left = self.plus | self.minus;
        std::iter::from_fn(move || {
            let i = (left != 0).then(|| left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some((i, (self.minus >> i) & 1 == 1))
        })
    }

    /// The sign of a joint in the sum; `None` where it does not occur.
    pub fn sign(self, joint: usize) -> Option<bool> {
        self.joints().find(|(i, _)| *i == joint).map(|(_, negative)| negative)
    }

    /// How many joints.
    pub fn count(self) -> usize {
        (self.plus | self.minus).count_ones() as usize
    }

    /// Whether it is one joint's angle.
    pub fn is_joint(self) -> bool {
        self.count() == 1
    }

    /// The sum in numbers.
    pub fn value(self, of_joint: impl Fn(usize) -> f64) -> f64 {
        self.joints()
            .fold(0.0, |sum, (i, negative)| if negative { sum - of_joint(i) } else { sum + of_joint(i) })
    }
}

impl fmt::Display for JointSum {
    /// The sum as part of a name: `2`, `2m3` for q2 − q3, `2p3` for q2 + q3.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, (joint, negative)) in self.joints().enumerate() {
            let sign = if k == 0 {
                ""
            } else if negative {
                "m"
            } else {
                "p"
            };
            write!(f, "{sign}{}", joint + 1)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_joint_has_the_sign_plus() {
        let (sum, negative) = JointSum::of([(1, true), (2, false)]);
        assert!(negative);
        assert_eq!(sum.to_string(), "2m3");
        assert_eq!(sum.joints().collect::<Vec<_>>(), [(1, false), (2, true)]);
        assert_eq!((sum.sign(2), sum.sign(3), sum.count()), (Some(true), None, 2));
        assert_eq!(sum.value(|i| [0.0, 5.0, 3.0][i]), 2.0);
        assert_eq!(JointSum::of([(3, false)]), (JointSum::joint(3), false));
    }
}
