//! Acceleration limits from torque limits, for arm files without them, such as imported ones.

use super::shape::poses;
use super::{Error, JointLimits, MassSource, Masses};
use dyngen::{Arm, Evaluator, Function, Model, SetKind};

/// Share of a joint's torque that may accelerate it; the rest is for gravity, friction and the other joints.
const SHARE: f64 = 0.5;

/// The arm with an acceleration limit for every joint that has a torque limit but none of acceleration: half
/// of its torque over the largest B_ii of poses within its positions; and a note about that. Without masses
/// the arm is not changed.
///
/// # Errors
/// The errors of [`Masses::parse`].
pub(super) fn proposed(arm: &Arm, masses: Option<&MassSource>) -> Result<(Arm, Option<String>), Error> {
    let missing: Vec<usize> = (0..arm.dof())
        .filter(|i| arm.joints[*i].acceleration.is_none() && arm.joints[*i].torque.is_some())
        .collect();
    let Some(MassSource::Values { text, file }) = masses.filter(|_| !missing.is_empty()) else {
        return Ok((arm.clone(), None));
    };
    let ranges: Option<Vec<[f64; 2]>> = arm.joints.iter().map(|joint| joint.position).collect();
    // Without them nothing is searched.
    let Some(ranges) = ranges else { return Ok((arm.clone(), None)) };
    let model = Model::derive(arm.clone())?;
    let masses = Masses::parse(text, file, &model)?;
    let largest = largest_inertias(&model, &masses, &ranges)?;
    let mut limited = arm.clone();
    let mut said = Vec::new();
    for i in missing {
        let allowed = SHARE * arm.joints[i].torque.unwrap_or_default() / largest[i];
        if allowed.is_finite() && allowed > 0.0 {
            // Three digits are what anybody would write into the file.
            let digits = 10f64.powf(2.0 - allowed.log10().floor());
            let rounded = (allowed * digits).floor() / digits;
            limited.joints[i].acceleration = Some(rounded);
            said.push(format!("joint {}: {rounded}", i + 1));
        }
    }
    let note = format!(
        "the arm file limits no acceleration of {} joints: half of the torque over the largest B_ii is \
         taken, rad/s² (m/s²): {}",
        said.len(),
        said.join(", ")
    );
    Ok((limited, (!said.is_empty()).then_some(note)))
}

/// The largest diagonal entries of B over poses within the ranges, kg·m² (kg).
fn largest_inertias(model: &Model, masses: &Masses, ranges: &[[f64; 2]]) -> Result<Vec<f64>, Error> {
    let n = model.arm().dof();
    let values = model.set_values(model.set(SetKind::Minimal)?, &masses.parameters);
    let matrix = Evaluator::new(model, Function::MassMatrix, SetKind::Minimal)?;
    let within = |position: &[f64; 2]| JointLimits {
        position: *position,
        velocity: 0.0,
        acceleration: 0.0,
        torque: None,
    };
    let limits: Vec<JointLimits> = ranges.iter().map(within).collect();
    let poses: Vec<f64> = poses(&limits).flatten().collect();
    let mut matrices = vec![0.0; poses.len() * n];
    matrix.evaluate(&poses, &[], &[], &values, &mut matrices);
    let largest = |i: usize| matrices.chunks(n * n).map(|b| b[i * n + i]).fold(0.0, f64::max);
    Ok((0..n).map(largest).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANAR: &str = r#"
name = "planar"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = 0, d = 0, theta = 0, position = [-2, 2], torque = 40 },
    { kind = "revolute", a = 0.5, alpha = 0, d = 0, theta = 0, position = [-1, 1], torque = 10, acceleration = 3 },
]
"#;

    /// B₁₁ = Izz1 + Izz2 + m2·a² + 2·a·mx2·cos q₂, largest where the arm is stretched.
    #[test]
    fn half_of_the_torque_accelerates_the_stretched_arm() {
        let arm = Arm::parse(PLANAR, "planar.toml").unwrap();
        let names = arm.kept_parameters();
        let value = |name: &str| match name {
            "Izz1" => 0.4,
            "Izz2" => 0.3,
            "m2" => 2.0,
            "mx2" => 0.5,
            _ => 0.0,
        };
        let entries: Vec<String> =
            names.iter().map(|p| format!("\"{p}\": {:?}", value(&p.to_string()))).collect();
        let source =
            MassSource::Values { text: format!("{{{}}}", entries.join(", ")), file: "v.json".into() };
        let (limited, note) = proposed(&arm, Some(&source)).unwrap();
        let expected = 0.5 * 40.0 / (0.4 + 0.3 + 2.0 * 0.25 + 2.0 * 0.5 * 0.5);
        let found = limited.joints[0].acceleration.unwrap();
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
        assert_eq!(limited.joints[1].acceleration, Some(3.0));
        assert!(note.unwrap().contains("of 1 joints"));
        assert_eq!(proposed(&arm, Some(&MassSource::Guess)).unwrap().0, arm);
    }
}
