//! One thing wrong with the columns of a sound log, and what is reported about it.

use super::{Conventions, GravityIs, Kind, PerJoint, Side, conventions};
use crate::excite::{Fourier, Harmonics};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::arm::Convention;
use dyngen::exact::angle::Angle;
use dyngen::exact::rational::integer;
use powerball_logs::log::Log;
use powerball_logs::regression::RigidArm;
use powerball_virtual_arm::lwa4p;
use rand::{RngExt, SeedableRng};
use std::sync::LazyLock;

/// The virtual arm and six logs of it; the last two are of another path than those that are fitted.
static SOUND: LazyLock<(RigidArm, Vec<Log>)> = LazyLock::new(|| {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let plant = lwa4p::plant().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let log = |k: u64| {
        let mut draw = |scale: f64| (0..5).map(|_| scale * rng.random_range(-1.0..1.0)).collect();
        let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(0.25), b: draw(0.25) }).collect();
        let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods: 1, ramp: 1.0, joints };
        plant.record(&path.sample(plant.sensors().rate), 0.0, k).log(format!("log {k}"))
    };
    (body, (0..6).map(log).collect())
});

/// What is reported about the logs after something was done to them.
fn result(spoil: impl Fn(&mut Log)) -> Conventions {
    let (body, logs) = &*SOUND;
    let logs: Vec<Log> = logs
        .iter()
        .map(|log| {
            let mut log = log.clone();
            spoil(&mut log);
            log
        })
        .collect();
    let (fit, validate) = logs.split_at(4);
    conventions(body, fit, validate)
}

fn scale(columns: &mut [Vec<f64>], by: f64) {
    columns.iter_mut().flatten().for_each(|x| *x *= by);
}

#[test]
fn sound_columns_are_reported_as_declared() {
    let result = result(|_| ());
    assert!(!result.differ(), "{}", result.evidence);
    assert_eq!(result.suggested_map, None);
    assert_eq!(result.torque.sign, Some(PerJoint::All(1)));
    assert_eq!(result.torque.unit.as_deref(), Some("N·m"));
    assert_eq!(result.torque.gravity, Some(GravityIs::Included));
    assert_eq!(result.torque.side, Some(Side::Motor));
    assert_eq!(result.torque.delay, Some(PerJoint::All(0.0)));
    assert_eq!(result.positions.sign, Some(vec![1; 6]));
    assert_eq!(result.positions.unit.as_deref(), Some("rad"));
    let json = serde_json::to_value(&result).unwrap();
    assert_eq!(json["torque"]["sign"], 1);
    assert_eq!(json["mend"], serde_json::Value::Null);
}

#[test]
fn reversed_signs_are_reported() {
    let all = result(|log| scale(&mut log.torque, -1.0));
    assert_eq!(all.torque.sign, Some(PerJoint::All(-1)), "{}", all.evidence);
    assert_eq!(all.suggested_map.as_deref(), Some("tau = { sign = -1 }"));
    let one = result(|log| scale(&mut log.torque[2..3], -1.0));
    assert_eq!(one.torque.sign, Some(PerJoint::Each(vec![1, 1, -1, 1, 1, 1])), "{}", one.evidence);
    assert_eq!(one.suggested_map.as_deref(), Some("tau = { sign = [1, 1, -1, 1, 1, 1] }"));
    let position = result(|log| scale(&mut log.q[1..2], -1.0));
    assert_eq!(position.positions.sign, Some(vec![1, -1, 1, 1, 1, 1]), "{}", position.evidence);
    assert_eq!(position.torque.sign, Some(PerJoint::All(1)));
    assert_eq!(position.suggested_map.as_deref(), Some("q = { sign = [1, -1, 1, 1, 1, 1] }"));
}

#[test]
fn other_units_are_reported() {
    let milli = result(|log| scale(&mut log.torque, 1000.0));
    assert_eq!(milli.torque.unit.as_deref(), Some("mN·m"), "{}", milli.evidence);
    assert_eq!(milli.suggested_map.as_deref(), Some("tau = { unit = \"mN·m\" }"));
    let degrees = result(|log| scale(&mut log.q, 1f64.to_degrees()));
    assert_eq!(degrees.positions.unit.as_deref(), Some("deg"), "{}", degrees.evidence);
    assert_eq!(degrees.suggested_map.as_deref(), Some("q = { unit = \"deg\" }"));
    let small = result(|log| scale(&mut log.torque, 0.01));
    assert_eq!(small.torque.unit.as_deref(), Some("N·m before the gear, or A"), "{}", small.evidence);
    assert_eq!(small.suggested_map, None);
    let ampere = result(|log| {
        let constants = [24.0, 24.0, 18.0, 12.0, 9.0, 9.0];
        log.torque.iter_mut().zip(constants).for_each(|(x, k)| x.iter_mut().for_each(|x| *x /= k));
    });
    assert_ne!(ampere.torque.unit.as_deref(), Some("N·m"), "{}", ampere.evidence);
    assert_eq!(ampere.suggested_map, None);
}

#[test]
fn exchanged_columns_are_reported() {
    let torques = result(|log| log.torque.swap(1, 2));
    let order = |list: &Option<Vec<powerball_controller::JointNumber>>| -> Vec<usize> {
        list.iter().flatten().map(|j| j.number()).collect()
    };
    assert_eq!(order(&torques.torque.order), [1, 3, 2, 4, 5, 6], "{}", torques.evidence);
    assert_eq!(torques.positions.order, None);
    assert_eq!(
        torques.suggested_map.as_deref(),
        Some("tau = { column = [\"tau1\", \"tau3\", \"tau2\", \"tau4\", \"tau5\", \"tau6\"] }")
    );
    let positions = result(|log| log.q.swap(3, 4));
    assert_eq!(order(&positions.positions.order), [1, 2, 3, 5, 4, 6], "{}", positions.evidence);
    assert_eq!(positions.torque.order, None);
}

/// The torque of the virtual arm's own numeric dynamics at rest is taken out.
#[test]
fn gravity_that_was_taken_out_is_reported() {
    let plant = lwa4p::plant().unwrap();
    let result = result(|log| {
        for k in 0..log.t.len() {
            let q: Vec<f64> = log.q.iter().map(|q| q[k]).collect();
            let gravity = plant.dynamics().gravity(&q);
            log.torque.iter_mut().zip(gravity).for_each(|(x, g)| x[k] -= g);
        }
    });
    assert_eq!(result.torque.gravity, Some(GravityIs::TakenOut), "{}", result.evidence);
    assert_eq!(result.torque.unit.as_deref(), Some("N·m"));
}

#[test]
fn late_torques_are_reported_with_their_delay() {
    for by in [0.03, 0.08, 0.15] {
        let result = result(|log| {
            let step = log.t[1] - log.t[0];
            let samples = (by / step).round() as usize;
            for x in &mut log.torque {
                let first = x[0];
                x.rotate_right(samples);
                x[..samples].fill(first);
            }
        });
        let Some(PerJoint::All(delay)) = result.torque.delay else { panic!("{}", result.evidence) };
        approx::assert_abs_diff_eq!(delay, by, epsilon = 0.006);
    }
}

/// Two recordings never measure the same noise.
#[test]
fn torques_that_repeat_bit_by_bit_were_commanded() {
    let (body, logs) = &*SOUND;
    let mut again = logs[1].clone();
    again.torque = logs[0].torque.clone();
    let result = conventions(body, &[logs[0].clone(), again], &[]);
    assert_eq!(result.torque.kind, Some(Kind::Commanded));
}

/// Too little data is reported, not guessed.
#[test]
fn logs_that_are_too_short_tell_nothing() {
    let (body, logs) = &*SOUND;
    let mut short = logs[0].clone();
    short.pieces = std::iter::once(0..40).collect();
    let result = conventions(body, &[short], &[]);
    assert_eq!(result.torque, super::TorqueColumns::default());
    assert!(!result.differ() && result.evidence.contains("not shown"));
}

/// What is reported where the logs are those of the sound arm and the file is not.
fn result_for_arm(spoil: impl Fn(&mut Arm)) -> Conventions {
    let (sound, logs) = &*SOUND;
    let mut arm = sound.arm().clone();
    spoil(&mut arm);
    let (fit, validate) = logs.split_at(4);
    conventions(&RigidArm::new(&arm).unwrap(), fit, validate)
}

#[test]
fn an_arm_file_of_the_other_convention_is_reported() {
    let result = result_for_arm(|arm| arm.convention = Convention::Modified);
    assert_eq!(result.arm_file.as_deref(), Some("convention = \"standard\""), "{}", result.evidence);
    // The columns are evaluated with the arm that they fit.
    assert_eq!(result.torque.gravity, Some(GravityIs::Included), "{}", result.evidence);
    assert_eq!((result.torque.sign.as_ref(), result.suggested_map.as_ref()), (Some(&PerJoint::All(1)), None));
    let first = result.verdict();
    assert!(
        first.starts_with("The arm file does not belong to this arm. With convention = \"standard\""),
        "{first}"
    );
}

#[test]
fn a_zero_that_is_a_quarter_turn_off_is_reported() {
    let quarter = Angle::PiMultiple(integer(1) / integer(2));
    let result = result_for_arm(|arm| {
        let theta = &mut arm.joints[1].theta;
        *theta = Angle::sum(&[(theta.clone(), integer(1)), (quarter.clone(), integer(1))]);
    });
    assert_eq!(result.arm_file.as_deref(), Some("theta = \"1/2*pi\" of joint 2"), "{}", result.evidence);
}

#[test]
fn gravity_from_another_side_is_reported() {
    let result = result_for_arm(|arm| arm.gravity.rotate_right(1));
    assert_eq!(result.arm_file.as_deref(), Some("gravity = [0, 0, -9.81]"), "{}", result.evidence);
}

#[test]
fn lengths_in_millimetres_are_reported() {
    let result = result_for_arm(|arm| {
        for joint in &mut arm.joints {
            joint.a = &joint.a * integer(1000);
            joint.d = &joint.d * integer(1000);
        }
    });
    assert!(result.arm_file.unwrap().contains("give a, b and d in metres"), "{}", result.evidence);
}

#[test]
fn gravity_in_another_unit_is_reported() {
    let result = result_for_arm(|arm| arm.gravity = arm.gravity.each_ref().map(|g| g * integer(1000)));
    assert!(result.arm_file.unwrap().contains("give it in m/s²"), "{}", result.evidence);
}

#[test]
fn joints_counted_from_the_tip_are_reported() {
    let result = result(|log| {
        log.q.reverse();
        log.torque.reverse();
    });
    let order: Vec<usize> = result.torque.order.iter().flatten().map(|j| j.number()).collect();
    assert_eq!(order, [6, 5, 4, 3, 2, 1], "{}", result.evidence);
    assert_eq!(result.positions.order, result.torque.order);
}

#[test]
fn where_much_is_left_it_is_said() {
    let (body, logs) = &*SOUND;
    // A torque that no arm has: another log's.
    let strange: Vec<Log> =
        (0..4).map(|k| Log { torque: logs[(k + 1) % 4].torque.clone(), ..logs[k].clone() }).collect();
    let result = conventions(body, &strange, &[]);
    assert!(result.is_unclear() && !result.differ(), "{}", result.evidence);
    let first = result.verdict();
    assert!(first.starts_with("What the columns are cannot be checked: one rigid arm"), "{first}");
}
