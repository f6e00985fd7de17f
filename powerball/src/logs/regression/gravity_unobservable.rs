//! What level gravity hides: parameters that no motion shows until gravity comes from another side.

use super::RigidArm;
use dyngen::SetKind;
use faer::{Mat, Side};

/// Poses at which it is seen whether a gravity from another side shows a parameter.
const HIDDEN_POSES: usize = 8;

/// See [`RigidArm::gravity_unobservable`].
pub(super) fn gravity_unobservable(body: &RigidArm) -> Option<Vec<Vec<f64>>> {
    let arm = body.arm();
    let kept: Vec<usize> = arm.kept_parameters().iter().map(|p| p.index()).collect();
    let mut shown = Mat::<f64>::zeros(body.names().len(), kept.len());
    for (row, sum) in body.model().sums(body.model().set(SetKind::Minimal).ok()?).iter().enumerate() {
        for (parameter, coefficient) in sum {
            let column = kept.iter().position(|k| *k == parameter.index())?;
            shown[(row, column)] = *coefficient;
        }
    }
    let moments: Vec<usize> = kept.iter().copied().filter(|k| k % 11 < 4).collect();
    let poses: Vec<f64> =
        (0..HIDDEN_POSES * body.dof()).map(|k| (1.0 + k as f64 * 2.399).sin() * 2.0).collect();
    let mut pulled = Mat::<f64>::zeros(3 * poses.len(), kept.len());
    for axis in 0..3 {
        let columns = body.gravity_columns(axis, &moments, &poses)?;
        for (row, values) in columns.chunks_exact(moments.len().max(1)).enumerate() {
            for (value, moment) in values.iter().zip(&moments) {
                let column = kept.iter().position(|k| k == moment)?;
                pulled[(axis * poses.len() + row, column)] = *value;
            }
        }
    }
    let (_, unseen) = split(&shown, shown.norm_l2())?;
    let (felt, _) = split(&(&pulled * &unseen), pulled.norm_l2())?;
    let directions = unseen * felt;
    let whole = |d: usize| {
        let mut all = vec![0.0; 11 * body.dof()];
        kept.iter().enumerate().for_each(|(row, k)| all[*k] = directions[(row, d)]);
        all
    };
    Some((0..directions.ncols()).map(whole).collect())
}

/// Orthonormal directions that a matrix does not map to zero, and those that it does, for a matrix made of
/// one of some norm.
fn split(matrix: &Mat<f64>, norm: f64) -> Option<(Mat<f64>, Mat<f64>)> {
    let found = (matrix.transpose() * matrix).self_adjoint_eigen(Side::Lower).ok()?;
    let (values, vectors) = (found.S().column_vector(), found.U());
    let pick = |seen: bool| {
        let chosen: Vec<usize> =
            (0..matrix.ncols()).filter(|k| (values[*k] > 1e-10 * norm * norm) == seen).collect();
        Mat::from_fn(matrix.ncols(), chosen.len(), |row, k| vectors[(row, chosen[k])])
    };
    Some((pick(true), pick(false)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dyngen::Arm;

    #[test]
    fn what_gravity_from_the_side_shows_is_known() {
        let gravity_unobservable = |text: &str, gravity: &str| {
            let text = text.replace("[0, 0, -9.81]", gravity).replace("[0.0, 0.0, -9.81]", gravity);
            RigidArm::new(&Arm::parse(&text, "arm.toml").unwrap()).unwrap().gravity_unobservable().len()
        };
        let ur5e = include_str!("../../../../tests/arms/ur5e.toml");
        // The weight of all that turns about the upright first axis: how far from it, and whereto. Hung on a
        // wall, it shows.
        assert_eq!(gravity_unobservable(ur5e, "[0, 0, -9.81]"), 2);
        assert_eq!(gravity_unobservable(ur5e, "[0, -9.81, 0]"), 0);
        assert_eq!(
            gravity_unobservable(include_str!("../../../../tests/arms/scara.toml"), "[0, 0, -9.81]"),
            2
        );
        let planar = include_str!("../../../../tests/arms/planar2r.toml");
        assert_eq!(gravity_unobservable(planar, "[0, -9.81, 0]"), 0);
        // The numbers of base parameters say the same.
        let count = |gravity: &str| {
            let arm = Arm::parse(&ur5e.replace("[0, 0, -9.81]", gravity), "arm.toml").unwrap();
            RigidArm::new(&arm).unwrap().names().len()
        };
        assert_eq!(count("[1, 2, -9]"), count("[0, 0, -9.81]") + 2);
    }
}
