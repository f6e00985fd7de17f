//! Two torques in one log whose transmission is known, and those of a measured arm.

use super::measured::measured;
use super::{JointTransmission, Transmission, transmission};
use crate::excite::{Fourier, Harmonics};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use powerball_logs::log::{Log, read_logs};
use powerball_logs::motion::Motion;
use powerball_virtual_arm::{Plant, Sensors, lwa4p};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::path::PathBuf;
use std::sync::LazyLock;

/// What stands between the torques, by joint: k, rotor, viscous, Coulomb, width, offset.
const TRUTH: [[f64; 6]; 6] = [
    [-0.01, 1.1, 11.0, 5.0, 0.01, 0.4],
    [-0.01, 1.3, 9.0, 10.0, 0.02, -0.3],
    [0.02, 1.2, 11.0, 3.5, 0.01, 0.0],
    [-0.01, 0.9, 6.0, 7.0, 0.02, 0.2],
    [12.0, 0.16, 3.6, 1.7, 0.01, 0.0],
    [-0.02, 0.28, 1.5, 0.9, 0.02, 0.1],
];

/// The virtual arm's logs of the link's side, with the paths: four to fit, two to judge on.
static LOGS: LazyLock<(Arm, Vec<(Motion, Log)>)> = LazyLock::new(|| {
    // On a wall, so that its first joint carries a load too.
    let plant = lwa4p::mounted([0.0, -9.81, 0.0]).unwrap();
    let inactive = Sensors { white: vec![0.0; 6], coloured: vec![0.0; 6], ..plant.sensors().clone() };
    let plant = Plant::new(plant.dynamics().clone(), plant.friction().to_vec(), inactive);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let log = |k: u64| {
        let mut draw = |scale: f64| (0..5).map(|_| scale * rng.random_range(-1.0..1.0)).collect();
        let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(0.25), b: draw(0.25) }).collect();
        let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods: 1, ramp: 1.0, joints };
        let motion = path.sample(plant.sensors().rate);
        let mut log = plant.record(&motion, 0.0, k).log(format!("log {k}"));
        for (sample, [_, dq, _]) in motion.samples().enumerate() {
            for (j, torque) in log.torque.iter_mut().enumerate() {
                torque[sample] -= plant.friction()[j].torque(dq[j]);
            }
        }
        (motion, log)
    };
    (lwa4p::arm().unwrap(), (0..6).map(log).collect())
});

/// What is reported about logs with the motors' torques of [`TRUTH`], with what `extra` gives of a joint
/// along a log on top, N·m at the link, and white noise of `noise` N·m on the link's torques.
fn result(extra: impl Fn(usize, &Motion, &Log) -> Option<Vec<f64>>, noise: f64) -> Vec<JointTransmission> {
    let (arm, logs) = &*LOGS;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let of_joint = |j: usize, motion: &Motion, log: &Log| -> Vec<f64> {
        let [k, rotor, viscous, coulomb, width, offset] = TRUTH[j];
        let extra = extra(j, motion, log).unwrap_or_else(|| vec![0.0; log.t.len()]);
        let samples = motion.samples().zip(&log.torque[j]).zip(extra);
        samples
            .map(|(([_, dq, ddq], load), extra)| {
                let friction = viscous * dq[j] + coulomb * (dq[j] / width).tanh();
                k * (load + rotor * ddq[j] + friction + offset + extra)
            })
            .collect()
    };
    let with_motor = |(motion, log): &(Motion, Log)| {
        let motor = (0..arm.dof()).map(|j| of_joint(j, motion, log)).collect();
        Log { motor: Some(motor), ..log.clone() }
    };
    let mut logs: Vec<Log> = logs.iter().map(with_motor).collect();
    for torque in logs.iter_mut().flat_map(|log| &mut log.torque).flatten() {
        let e: f64 = StandardNormal.sample(&mut rng);
        *torque += noise * e;
    }
    let (fit, validate) = logs.split_at(4);
    transmission(arm, fit, validate).unwrap()
}

fn known(joint: &JointTransmission) -> &Transmission {
    match joint {
        JointTransmission::Known(result) => result,
        JointTransmission::Unknown(unknown) => panic!("{}", unknown.why_not),
    }
}

/// The effects by joint and name.
fn effects(all: &[JointTransmission]) -> Vec<(usize, &'static str)> {
    let of = |joint: &JointTransmission| -> Vec<(usize, &'static str)> {
        let JointTransmission::Known(result) = joint else { return Vec::new() };
        result.effects.iter().map(|e| (result.joint.number(), e.effect)).collect()
    };
    all.iter().flat_map(of).collect()
}

#[test]
fn ratio_sign_friction_and_rotor_come_back() {
    let all = result(|_, _, _| None, 0.02);
    for (joint, [k, rotor, viscous, coulomb, _, offset]) in all.iter().zip(TRUTH).take(5) {
        let result = known(joint);
        let near = |found: f64, truth: f64, within: f64| (found - truth).abs() < within * truth.abs();
        assert!(near(result.ratio, k, 0.01), "{}", joint.sentence());
        assert!(near(result.viscous, viscous, 0.05), "{}", joint.sentence());
        assert!(near(result.coulomb, coulomb, 0.05), "{}", joint.sentence());
        assert!(near(result.rotor_inertia, rotor, 0.1), "{}", joint.sentence());
        assert!((result.offset - offset).abs() < 0.1, "{}", joint.sentence());
        assert!(result.std > 0.0 && (result.ratio - k).abs() < 4.0 * result.std, "{}", joint.sentence());
        assert!(result.left < 0.1 && result.left_with <= result.left, "{}", joint.sentence());
    }
    assert_eq!(effects(&all), []);
    // The last link's torque is that of its rotor alone, as a motor's would be.
    assert!(all[5].sentence().contains("tau6 without friction and inertia"), "{}", all[5].sentence());
}

/// The wrist carries little: of its link torque's square noise is a good part, and a plain fit would find a
/// smaller ratio.
#[test]
fn noise_of_the_link_torque_does_not_draw_the_ratio_to_zero() {
    let all = result(|_, _, _| None, 0.3);
    let result = known(&all[4]);
    assert!((result.ratio / TRUTH[4][0] - 1.0).abs() < 0.03, "{}", all[4].sentence());
}

#[test]
fn load_friction_is_named_on_its_joint_alone() {
    let load = |j: usize, motion: &Motion, log: &Log| {
        let samples = motion.samples().zip(&log.torque[1]);
        let rubs = samples.map(|([_, dq, _], torque)| 0.08 * torque.abs() * (dq[1] / TRUTH[1][4]).tanh());
        (j == 1).then(|| rubs.collect())
    };
    let all = result(load, 0.02);
    assert_eq!(effects(&all), [(2, "load_friction")]);
    let result = known(&all[1]);
    let effect = &result.effects[0];
    assert!((effect.parameters["coefficient"] / 0.08 - 1.0).abs() < 0.05, "{effect:?}");
    assert!(effect.gain.len() == 3 && effect.gain.iter().all(|gain| *gain > 0.5), "{effect:?}");
    assert!((result.coulomb / 10.0 - 1.0).abs() < 0.05 && result.left_with < 0.5 * result.left);
    let json = serde_json::to_value(&all).unwrap();
    assert_eq!(json[1]["joint"], 2);
    assert_eq!(json[1]["effects"][0]["effect"], "load_friction");
}

#[test]
fn presliding_and_a_delay_are_named_each_on_its_joint() {
    let late = 10;
    let extra = |j: usize, motion: &Motion, log: &Log| match j {
        // Joint 3: the motor's torque comes ten samples after the link's.
        2 => {
            let torque = &log.torque[2];
            Some((0..torque.len()).map(|k| torque[k.saturating_sub(late)] - torque[k]).collect())
        }
        // Joint 2: 4 N·m that wind up over 10 mrad.
        1 => {
            let mut wound = 0.0;
            let wind = |[_, dq, _]: [&[f64]; 3]| {
                let side = f64::signum(dq[1]);
                wound = side + (wound - side) * (-dq[1].abs() * motion.period / 0.01).exp();
                4.0 * wound
            };
            Some(motion.samples().map(wind).collect())
        }
        _ => None,
    };
    let all = result(extra, 0.02);
    let said: Vec<String> = all.iter().map(JointTransmission::sentence).collect();
    assert_eq!(effects(&all), [(2, "hysteresis"), (3, "time_delay")], "{said:#?}");
    let delay = known(&all[2]).effects[0].parameters["delay"];
    let truth = late as f64 * LOGS.1[0].0.period;
    assert!((delay / truth - 1.0).abs() < 0.1, "{delay} s, not {truth} s");
    let wound = &known(&all[1]).effects[0].parameters;
    assert!((0.006..0.016).contains(&wound["distance"]), "{wound:?}");
    assert!((wound["level"] / 4.0 - 1.0).abs() < 0.15, "{wound:?}");
}

#[test]
fn a_column_that_is_not_the_motor_is_refused_in_words() {
    let (arm, logs) = &*LOGS;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let logs: Vec<Log> = logs
        .iter()
        .map(|(_, log)| {
            // Joint 1: noise; 2: sound, with a hole; 3: its own velocity; 4: nothing; 5: no number; 6:
            // another one's.
            let mut motor = log.torque.clone();
            motor[0].iter_mut().for_each(|x| *x = rng.random_range(-1.0..1.0));
            motor[2] = log.q[2].windows(2).map(|q| q[1] - q[0]).chain([0.0]).collect();
            motor[3].fill(0.25);
            motor[4].fill(f64::NAN);
            motor[5].clone_from(&log.torque[3]);
            motor[1][100..120].fill(f64::NAN);
            Log { motor: Some(motor), ..log.clone() }
        })
        .collect();
    let all = transmission(arm, &logs[..4], &logs[4..]).unwrap();
    for (joint, words) in [
        (0, "motor1 does not follow tau1"),
        (2, "motor3 does not follow tau3"),
        (3, "motor4 never changes"),
        (4, "motor5 never changes"),
        (5, "motor6 does not follow tau6"),
    ] {
        assert!(all[joint].sentence().contains(words), "{}", all[joint].sentence());
    }
    assert!((known(&all[1]).ratio - 1.0).abs() < 0.001, "{}", all[1].sentence());
    let without: Vec<Log> = logs.iter().map(|log| Log { motor: None, ..log.clone() }).collect();
    assert_eq!(transmission(arm, &without, &[]), None);
}

/// Torque sensors and motors of a Rokae xMate on one path of 20 s in three parts.
#[test]
fn the_transmissions_of_a_rokae_are_found() {
    let Some(folder) = measured("rokae") else { return };
    let arm = Arm::read(&folder.join("arm.toml")).unwrap();
    let files: Vec<PathBuf> = (1..=3).map(|k| folder.join(format!("part_{k}.csv"))).collect();
    let (logs, _) = read_logs(&files, &arm).unwrap();
    let all = transmission(&arm, &logs[..2], &logs[2..]).unwrap();
    all.iter().for_each(|joint| println!("{}", joint.sentence()));
    let found = effects(&all);
    for sure in [(2, "load_friction"), (3, "hysteresis"), (5, "hysteresis")] {
        assert!(found.contains(&sure), "{found:?}");
    }
    // What other fits of these logs give: 110 139 115 111 77 87 46.
    for (joint, inverse) in all.iter().zip([110.0, 139.0, 115.0, 111.0, 77.0, 87.0, 46.0]) {
        let result = known(joint);
        assert!((1.0 / result.ratio / inverse - 1.0).abs() < 0.2, "{}", joint.sentence());
        assert!(result.left < 0.25 && result.left_with < 0.2, "{}", joint.sentence());
    }
    let load = known(&all[1]).effects.iter().find(|e| e.effect == "load_friction").unwrap();
    assert!((0.06..0.11).contains(&load.parameters["coefficient"]), "{load:?}");
}
