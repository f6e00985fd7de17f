//! Poses in which gravity puts no torque on a joint, at any position of that joint, so that friction can be
//! measured alone.

use dyngen::arm::JointKind;
use dyngen::{Evaluator, Function, Model, SetKind};
use powerball_identification::mounting::Mounting;

/// The mountings that are tried, in this order: as the arm file says, and on either side.
const MOUNTINGS: [Mounting; 3] = [
    Mounting::Filed,
    Mounting::Turned { roll: 0.0, pitch: 90.0 },
    Mounting::Turned { roll: 90.0, pitch: 0.0 },
];

/// A pose in which a joint feels no gravity.
#[derive(Clone, Debug, PartialEq)]
pub struct GravityFree {
    /// How the base is mounted.
    pub mounting: Mounting,
    /// The joints, rad; the joint itself may be anywhere.
    pub pose: Vec<f64>,
    /// Remaining share of gravity: the sine of the angle between the joint axis and gravity (its cosine where
    /// the joint is prismatic).
    pub leftover: f64,
}

/// Leftover below which a pose counts as free of gravity.
pub const FREE: f64 = 1e-3;
/// Places of a joint that are tried in a sweep, and sweeps over all joints.
const PLACES: usize = 49;
const SWEEPS: i32 = 4;

/// The first mounting, and the pose nearest to zero, that keep gravity off a joint; `None` where no pose
/// within the limits does.
#[must_use]
pub fn find(model: &Model, joint: usize) -> Option<GravityFree> {
    MOUNTINGS.into_iter().map(|mounting| best(model, joint, mounting)).find(|found| found.leftover < FREE)
}

/// The best pose of a mounting.
#[must_use]
pub fn best(model: &Model, joint: usize, mounting: Mounting) -> GravityFree {
    let arm = model.arm();
    let n = arm.dof();
    let gravity = mounting.gravity(arm);
    let size = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    // The axes are proven with everything else; they depend on no parameter set.
    let jacobian = Evaluator::new(model, Function::Jacobian, SetKind::Minimal).ok();
    let prismatic = arm.joints[joint].kind == JointKind::Prismatic;
    let leftover = |q: &[f64]| {
        let Some(jacobian) = &jacobian else { return 1.0 };
        if size == 0.0 {
            return 0.0;
        }
        let mut out = vec![0.0; 6 * n];
        jacobian.evaluate(q, &[], &[], &[], &mut out);
        let rows = if prismatic { 0 } else { 3 };
        let along: f64 = (0..3).map(|i| out[(rows + i) * n + joint] * gravity[i] / size).sum();
        if prismatic { along.abs() } else { (1.0 - along * along).max(0.0).sqrt() }
    };
    let range = |i: usize| arm.joints[i].position.unwrap_or([-std::f64::consts::PI, std::f64::consts::PI]);
    let middle = |i: usize| 0.0f64.clamp(range(i)[0], range(i)[1]);
    let mut pose: Vec<f64> = (0..n).map(middle).collect();
    let mut least = leftover(&pose);
    // Quarter turns of several joints at once may be needed; of those that are as good the one nearest to
    // zero.
    let quarter = std::f64::consts::FRAC_PI_2;
    let mut starts = vec![pose.clone()];
    for i in 0..joint.min(6) {
        let [low, high] = range(i);
        let turned = |start: &Vec<f64>, by: f64| {
            let mut start = start.clone();
            start[i] = by.clamp(low, high);
            start
        };
        let more: Vec<Vec<f64>> =
            starts.iter().flat_map(|s| [turned(s, quarter), turned(s, -quarter)]).collect();
        starts.extend(more);
    }
    let moved = |q: &[f64]| q.iter().map(|x| x.abs()).sum::<f64>();
    starts.sort_by(|a, b| moved(a).total_cmp(&moved(b)));
    for start in starts {
        let value = leftover(&start);
        if value < least - 1e-9 {
            (least, pose) = (value, start);
        }
    }
    // Joints beyond this one do not turn its axis.
    for sweep in 0..SWEEPS {
        for i in (0..joint).rev() {
            let [low, high] = range(i);
            let half = 0.5 * (high - low) * (4.0 / PLACES as f64).powi(sweep);
            let centre = if sweep == 0 { 0.5 * (low + high) } else { pose[i] };
            let mut trial = pose.clone();
            let mut places: Vec<f64> = (0..PLACES)
                .map(|k| centre + half * (2.0 * k as f64 / (PLACES - 1) as f64 - 1.0))
                .map(|q| q.clamp(low, high))
                .collect();
            // Of poses that are as good the one nearest to zero.
            places.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            for q in places.into_iter().filter(|q| (low..=high).contains(q)) {
                trial[i] = q;
                let value = leftover(&trial);
                if value < least - 1e-9 {
                    (least, pose[i]) = (value, q);
                }
            }
        }
    }
    GravityFree { mounting, pose, leftover: least }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dyngen::{Arm, Samples};

    fn model() -> Model {
        let text = include_str!("../../../lwa4p.toml");
        Model::derive(Arm::parse(text, "lwa4p.toml").unwrap()).unwrap()
    }

    /// The paper's mountings: joints 1, 4, 5, 6 upright, 2 and 3 with the base on its side.
    #[test]
    fn the_mountings_of_the_paper_are_found() {
        let model = model();
        for joint in 0..6 {
            let found = find(&model, joint).unwrap();
            let upright = found.mounting == Mounting::Filed;
            assert_eq!(upright, ![1, 2].contains(&joint), "joint {}: {found:?}", joint + 1);
        }
    }

    /// Against the arm's gravity torques themselves, at many places of the joint and whatever hangs on it.
    #[test]
    fn no_gravity_is_left_on_the_joint() {
        let text = include_str!("../../../lwa4p.toml");
        for joint in 0..6 {
            let found = find(&model(), joint).unwrap();
            let g = found.mounting.gravity(model().arm());
            let turned = text.replacen(
                "gravity = [0.0, 0.0, -9.81]",
                &format!("gravity = [{:?}, {:?}, {:?}]", g[0], g[1], g[2]),
                1,
            );
            let turned = Model::derive(Arm::parse(&turned, "turned.toml").unwrap()).unwrap();
            let gravity = Evaluator::new(&turned, Function::Gravity, SetKind::Minimal).unwrap();
            let count = turned.set(SetKind::Minimal).unwrap().parameters.len();
            let parameters: Vec<f64> = (0..count).map(|k| 1.0 + 0.1 * k as f64).collect();
            for place in [-1.0, -0.3, 0.4, 1.1] {
                let mut q = found.pose.clone();
                q[joint] = place;
                let mut torque = vec![0.0; 6];
                gravity.run(&Samples { q: &q, parameters: &parameters, ..Samples::default() }, &mut torque);
                assert!(torque[joint].abs() < 0.05, "joint {}: {torque:?}", joint + 1);
            }
        }
    }
}
