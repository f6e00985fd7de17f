//! The angles of an arm, decided once: the sums of joints' angles whose sine and cosine functions use, and
//! how each is made of the coordinates.
//!
//! A joint's angle is its ratio times the coordinate that it moves with and a constant. Functions take the
//! angles of the joints that move on their own, of those that follow them, and sums across parallel axes,
//! where only sums matter. Quarter turns are in no angle: they swap sine and cosine and change signs.

use super::chain;
use crate::arm::{Arm, JointKind};
use crate::exact::angle::Angle;
use crate::exact::rational::{self, Rational, to_f64};
use crate::graph::{Builder, Expr, Input, JointSum};
use crate::lagrangian::followers::quarter_turned;
use num_traits::{Signed, Zero};
use std::collections::BTreeSet;

/// The angles of an arm.
#[derive(Clone, Debug)]
pub struct Angles {
    /// The angle of each joint of the chain.
    joints: Vec<JointAngle>,
    taken: Vec<JointSum>,
}

/// A joint's angle, of which sine and cosine are taken: ratio·q + offset.
#[derive(Clone, Debug)]
pub struct JointAngle {
    /// Index of q among the coordinates.
    pub coordinate: usize,
    /// Ratio of a joint that follows another one; `None` if q is the joint's own.
    pub ratio: Option<f64>,
    /// Theta where it is not a multiple of pi/2, and the offset of a joint that follows another one, rad.
    pub offset: f64,
    /// The quarter turns of theta, which are not in the angle.
    quarters: u8,
    /// The angle as a multiple of another angle; `None` if it follows a prismatic joint.
    multiple: Option<Multiple>,
}

/// An angle as factor · a joint's angle + phase.
#[derive(Clone, Debug)]
struct Multiple {
    /// A joint that moves on its own.
    joint: usize,
    factor: Rational,
    phase: Angle,
}

/// A sum of the chain's angles by what functions take: ± another sum + quarter turns.
#[derive(Clone, Copy, Debug)]
struct Folded {
    /// None where all is constant.
    sum: Option<JointSum>,
    negative: bool,
    quarters: u8,
}

impl Angles {
    /// The angles of an arm.
    pub fn new(arm: &Arm) -> Self {
        let joints = (0..arm.links()).map(|joint| JointAngle::new(arm, joint)).collect();
        let own: Vec<JointSum> = arm.coordinates().into_iter().map(JointSum::joint).collect();
        let followers = (0..arm.links()).filter(|i| arm.joints[*i].mimic.is_some()).map(JointSum::joint);
        let mut angles = Angles { joints, taken: own };
        for sum in followers.chain(across_parallel_axes(arm)) {
            if let Some(sum) = angles.folded(sum).sum
                && !angles.taken.contains(&sum)
            {
                angles.taken.push(sum);
            }
        }
        angles
    }

    /// Every sum whose sine and cosine functions may take: the joints that move on their own, in the order of
    /// the coordinates and whether they turn or slide, then the others.
    pub fn taken(&self) -> &[JointSum] {
        &self.taken
    }

    /// The angle of a joint of the chain.
    pub fn joint(&self, joint: usize) -> &JointAngle {
        &self.joints[joint]
    }

    /// The constant that is added to the coordinates of a sum, rad.
    pub fn offset(&self, sum: JointSum) -> f64 {
        sum.value(|joint| self.joints[joint].offset)
    }

    /// The coordinates that a sum depends on.
    pub fn coordinates(&self, sum: JointSum) -> BTreeSet<usize> {
        sum.joints().map(|(joint, _)| self.joints[joint].coordinate).collect()
    }

    /// A sum for values of the coordinates, rad.
    pub fn value(&self, sum: JointSum, q: impl Fn(usize) -> f64) -> f64 {
        sum.value(|joint| {
            let JointAngle { coordinate, ratio, offset, .. } = self.joints[joint];
            ratio.unwrap_or(1.0) * q(coordinate) + offset
        })
    }

    /// How much faster than its coordinate an angle changes at most; at least 1.
    pub fn fastest(&self) -> f64 {
        self.joints.iter().filter_map(|joint| joint.ratio).fold(1.0, |most, ratio| most.max(ratio.abs()))
    }

    /// Sine and cosine of Σ ±(q + theta) over joints of the chain (`true`: minus), each as if it moved on its
    /// own.
    pub fn of_chain(&self, b: &Builder, joints: &[(usize, bool)]) -> (Expr, Expr) {
        let (sum, negative) = JointSum::of(joints.iter().copied());
        let turns = |(joint, negative): &(usize, bool)| match (self.joints[*joint].quarters, negative) {
            (turns, false) => turns,
            (turns, true) => 4 - turns,
        };
        let quarters = joints.iter().map(turns).sum::<u8>() % 4;
        Folded { sum: Some(sum), negative, quarters }.sin_cos(b)
    }

    /// Sine and cosine of a sum of the chain's angles by those that functions take.
    pub fn of_coordinates(&self, b: &Builder, sum: JointSum) -> (Expr, Expr) {
        self.folded(sum).sin_cos(b)
    }

    /// A sum of the chain's angles as a sum of independent joints, if it is one except for quarter turns:
    /// with ratios of one, as in a parallelogram. Any other sum is not changed.
    fn folded(&self, sum: JointSum) -> Folded {
        let itself = Folded { sum: Some(sum), negative: false, quarters: 0 };
        self.as_own_joints(sum).unwrap_or(itself)
    }

    fn as_own_joints(&self, sum: JointSum) -> Option<Folded> {
        let mut factors = vec![Rational::zero(); self.joints.len()];
        let mut phases: Vec<(Angle, Rational)> = Vec::new();
        for (joint, negative) in sum.joints() {
            let sign = rational::integer(if negative { -1 } else { 1 });
            let Multiple { joint, factor, phase } = self.joints[joint].multiple.as_ref()?;
            factors[*joint] += &sign * factor;
            phases.push((phase.clone(), sign));
        }
        let quarters = Angle::sum(&phases).quarter_turns()?;
        let terms: Vec<(usize, bool)> = (factors.iter().enumerate())
            .filter(|(_, x)| !x.is_zero())
            .map(|(joint, x)| x.abs().is_one().then(|| (joint, x.is_negative())))
            .collect::<Option<_>>()?;
        if terms.is_empty() {
            return Some(Folded { sum: None, negative: false, quarters });
        }
        let (sum, negative) = JointSum::of(terms);
        Some(Folded { sum: Some(sum), negative, quarters })
    }
}

impl JointAngle {
    fn new(arm: &Arm, joint: usize) -> Self {
        let drive = &arm.drives()[joint];
        let of = &arm.joints[joint];
        let mimic = of.mimic.as_ref();
        let slides = mimic.is_some() && arm.joints[drive.joint].kind == JointKind::Prismatic;
        JointAngle {
            coordinate: drive.coordinate,
            ratio: mimic.map(|mimic| to_f64(&mimic.ratio)),
            offset: of.theta_in_angle().radians() + to_f64(&drive.offset),
            quarters: of.theta.quarter_turns().unwrap_or(0),
            multiple: (!slides).then(|| Multiple {
                joint: drive.joint,
                factor: drive.ratio.clone(),
                phase: arm.phase(joint),
            }),
        }
    }
}

impl Folded {
    fn sin_cos(self, b: &Builder) -> (Expr, Expr) {
        let Folded { sum, negative, quarters } = self;
        let of = |sum| (b.input(Input::Sin(sum)), b.input(Input::Cos(sum)));
        let (s, c) = sum.map_or((Expr::ZERO, Expr::ONE), of);
        quarter_turned(b, quarters, (if negative { -s } else { s }, c))
    }
}

/// The sums of a stage's angles from its first joint to each later one, about the chain's z.
fn across_parallel_axes(arm: &Arm) -> Vec<JointSum> {
    let reversed = chain::reversed(arm);
    let mut sums = Vec::new();
    for stage in chain::stages(arm) {
        for end in stage.clone().skip(1) {
            sums.push(JointSum::of((stage.start..=end).map(|i| (i, reversed[i]))).0);
        }
    }
    sums
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Two turning joints and one that follows the first, about parallel axes.
    fn angles(mimic: &str) -> Angles {
        let joint = |more: &str| format!("{{ kind = \"revolute\", a = 1, alpha = 0, d = 0{more} }},");
        let joints =
            [", theta = \"pi/2\"", ", theta = 0.3", &format!(", theta = 0, mimic = {{ joint = 1{mimic} }}")];
        let text = format!(
            "name = \"a\"\nconvention = \"modified\"\ngravity = [0, 0, -9.81]\njoint = [\n{}\n]",
            joints.map(joint).join("\n")
        );
        Angles::new(&Arm::parse(&text, "arm.toml").unwrap())
    }

    fn names(angles: &Angles) -> Vec<String> {
        angles.taken().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_joint_that_turns_as_much_as_another_has_no_angle_of_its_own() {
        assert_eq!(names(&angles(", ratio = -1")), ["1", "2", "1p2"]);
        assert_eq!(names(&angles(", ratio = 2")), ["1", "2", "3", "1p2", "1p2p3"]);
        assert_eq!(names(&angles(", ratio = -1, offset = 0.1")), ["1", "2", "3", "1p2", "1p2p3"]);
    }

    #[test]
    fn an_angle_is_made_of_coordinates_and_constants() {
        let angles = angles(", ratio = 2, offset = 0.1");
        let all = JointSum::of([(0, false), (1, true), (2, false)]).0;
        assert_eq!(angles.coordinates(all), BTreeSet::from([0, 1]));
        // Of theta, what is not a quarter turn.
        assert_eq!([0, 1, 2].map(|joint| angles.joint(joint).offset), [0.0, 0.3, 0.1]);
        assert_eq!(angles.offset(all), -0.3 + 0.1);
        assert_eq!(angles.value(all, |q| [1.0, 10.0][q]), 1.0 - 10.3 + 2.1);
        assert_eq!(angles.fastest(), 2.0);
    }
}
