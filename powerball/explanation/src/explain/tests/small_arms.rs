//! Arms with few joints, which do not feel everything: one that moves in a plane, and one that stands upright
//! with level gravity.

use super::figures;
use crate::ExplainOptions;
use crate::explain::{Explained, explain_body};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use dyngen::arm::{JointKind, ParameterKind};
use nalgebra::{Matrix3, Vector3};
use powerball_controller::friction::TanhFriction;
use powerball_identification::excite::{Fourier, Harmonics};
use powerball_logs::chain::Chain;
use powerball_logs::log::{Log, common_clock};
use powerball_logs::regression::RigidArm;
use powerball_virtual_arm::{Body, Dynamics, Plant, PlantEffect as Effect, Sensors};
use rand::{RngExt, SeedableRng};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

const PAYLOAD: f64 = 0.2;
/// Length of the first link of the arm in a plane, m.
const CRANK: f64 = 0.4;
/// The first logs are fitted, the rest judges.
const FITTED: usize = 4;
const LOGS: usize = 6;

/// Two links in a vertical plane.
pub(super) fn planar() -> (Arm, Plant) {
    let arm = Arm::parse(include_str!("../../../../../tests/arms/planar2r.toml"), "planar2r.toml").unwrap();
    let bodies = vec![
        Body::even_box(4.0, [-0.2, 0.01, 0.0], [0.4, 0.08, 0.08], 4e-5),
        Body::even_box(2.0, [-0.15, 0.0, 0.02], [0.3, 0.06, 0.06], 4e-5),
    ];
    let plant = plant(&arm, bodies, &[4.0, 2.0], &[0.2, 0.06]);
    (arm, plant)
}

/// All axes upright.
fn scara() -> (Arm, Plant) {
    let arm = Arm::parse(include_str!("../../../../../tests/arms/scara.toml"), "scara.toml").unwrap();
    let bodies = vec![
        Body::even_box(6.0, [-0.15, 0.04, 0.0], [0.4, 0.1, 0.1], 0.0),
        Body::even_box(4.0, [-0.12, 0.02, 0.0], [0.3, 0.1, 0.1], 0.0),
        Body::even_box(1.5, [0.0, 0.0, -0.1], [0.05, 0.05, 0.3], 0.0),
        Body::even_box(0.6, [0.03, 0.01, 0.02], [0.1, 0.06, 0.04], 0.0),
    ];
    let plant = plant(&arm, bodies, &[3.0, 1.5, 2.0, 0.05], &[0.1, 0.05, 0.1, 0.003]);
    (arm, plant)
}

/// An arm with given friction and white noise by joint, N·m or N.
fn plant(arm: &Arm, bodies: Vec<Body>, levels: &[f64], white: &[f64]) -> Plant {
    let friction = |level: &f64| TanhFriction::new([0.7 * level, 60.0, 0.3 * level, 4.0, *level]);
    let sensors = Sensors {
        rate: 200.0,
        encoder_step: 0.0002f64.to_radians(),
        white: white.to_vec(),
        coloured: vec![0.0; white.len()],
        colour_time: 0.15,
    };
    let dynamics = Dynamics::new(Chain::new(arm), bodies).unwrap();
    Plant::new(dynamics, levels.iter().map(friction).collect(), sensors)
}

/// What is found in logs of an arm, those that are listed with an effect.
fn explained(arm: (Arm, Plant), effect: Effect, listed: &[usize]) -> Explained {
    explained_of(arm, &[(effect, listed)])
}

/// Like [`explained`], with several effects, each in logs of its own.
fn explained_of((arm, usual): (Arm, Plant), effects: &[(Effect, &[usize])]) -> Explained {
    explained_logs(&arm, recorded(&arm, &usual, effects))
}

/// The logs of an arm with several effects, each in logs of its own.
pub(super) fn recorded(arm: &Arm, usual: &Plant, effects: &[(Effect, &[usize])]) -> Vec<Log> {
    const SEED: u64 = 7;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    (0..LOGS)
        .map(|k| {
            let joints = (arm.joints.iter())
                .map(|joint| {
                    let way = if joint.kind == JointKind::Prismatic { 0.06 } else { 0.6 };
                    let mut draw =
                        || (0..5).map(|l| way * rng.random_range(-1.0..1.0) / f64::from(l + 1)).collect();
                    Harmonics { middle: 0.0, a: draw(), b: draw() }
                })
                .collect();
            let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints };
            let here = effects.iter().filter(|(_, listed)| listed.contains(&k));
            let plant = here.fold(usual.clone(), |plant, (effect, _)| plant.with(effect.clone()));
            plant.record(&path.sample(200.0), 0.0, SEED + k as u64).log(format!("log{k}"))
        })
        .collect()
}

fn explained_logs(arm: &Arm, logs: Vec<Log>) -> Explained {
    explained_with(arm, logs, &ExplainOptions::default())
}

/// What is found in such logs with some options.
pub(super) fn explained_with(arm: &Arm, mut logs: Vec<Log>, options: &ExplainOptions<'_>) -> Explained {
    common_clock(&mut logs);
    let (fit, validate) = logs.split_at(FITTED);
    let body = RigidArm::new(arm).unwrap();
    explain_body(&body, fit, validate, options).unwrap()
}

fn names(explained: &Explained) -> Vec<&str> {
    explained.effects.iter().map(|e| e.effect.as_str()).collect()
}

fn at_the_floor(explained: &Explained) {
    near_the_floor(explained, 1.15);
}

fn near_the_floor(explained: &Explained, times: f64) {
    for (after, floor) in explained.after.validate.rms.iter().zip(&explained.noise_floor) {
        assert!(*after < times * floor, "{:?} {:?}", explained.after.validate.rms, explained.noise_floor);
    }
}

/// The windows of what was found first, s.
fn spans(explained: &Explained) -> Vec<(f64, f64)> {
    let times = |name: &str| -> Vec<f64> {
        figures(&explained.effects[0])[name].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect()
    };
    times("start_time").into_iter().zip(times("end_time")).collect()
}

/// Checks one of them, whose ends lie on a grid of rows 0.05 s apart.
fn lasts(explained: &Explained, which: usize, truth: Range<f64>) {
    let (from, to) = spans(explained)[which];
    approx::assert_relative_eq!(from, truth.start, epsilon = 0.15);
    approx::assert_relative_eq!(to, truth.end, epsilon = 0.15);
}

#[test]
fn logs_say_whether_a_payload_is_held_in_them() {
    // Put on in the last fitted log, so that by the clock it stays; taken off before the others, or before
    // one of them.
    for listed in [&[3][..], &[3, 5], &[3, 4, 5], &[1], &[1, 4]] {
        let payload = Effect::Payload { mass: PAYLOAD, centre: [0.05, 0.02, 0.0], start: 0.0 };
        let explained = explained(planar(), payload, listed);
        assert_eq!(names(&explained), ["payload"], "{listed:?}");
        let found = &explained.effects[0];
        let mass = figures(found)["mass"].as_f64().unwrap();
        approx::assert_relative_eq!(mass, PAYLOAD, max_relative = 0.1);
        let logs: Vec<String> = listed.iter().map(|k| format!("log{k}")).collect();
        assert_eq!(found.logs, logs);
        at_the_floor(&explained);
    }
}

#[test]
fn a_push_is_found_by_what_the_arm_feels_of_it() {
    let push = Effect::ContactWrench { force: [1.5, 3.0, 20.0], start: 6.0, length: 4.0, every: 1e3 };
    let explained = explained(planar(), push, &[2]);
    assert_eq!(names(&explained), ["contact_wrench"]);
    let force: Vec<f64> = figures(&explained.effects[0])["force"][0]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f.as_f64().unwrap())
        .collect();
    // Across its plane the arm feels nothing.
    approx::assert_relative_eq!(force[0], 1.5, epsilon = 0.3);
    approx::assert_relative_eq!(force[1], 3.0, epsilon = 0.3);
    assert_eq!(force[2], 0.0);
    assert_eq!(spans(&explained).len(), 1);
    lasts(&explained, 0, 6.0..10.0);
    at_the_floor(&explained);
}

#[test]
fn the_same_push_is_seen_in_other_logs_and_another_one_is_not() {
    let push = |force, start| Effect::ContactWrench { force, start, length: 4.0, every: 1e3 };
    let (here, other) = (push([1.5, 3.0, 0.0], 6.0), push([-1.0, 1.0, 0.0], 12.0));
    let explained = explained_of(planar(), &[(here.clone(), &[2, 4]), (other, &[5])]);
    assert_eq!(names(&explained), ["contact_wrench"]);
    let found = &explained.effects[0];
    assert_eq!(found.logs, ["log2", "log4"]);
    assert_eq!(spans(&explained).len(), 2);
    assert_eq!(figures(found)["force"][0], figures(found)["force"][1]);
    lasts(&explained, 1, 6.0..10.0);
    // The other push stays in the errors.
    let (after, floor) = (&explained.after.validate.rms, &explained.noise_floor);
    assert!(after[0] > 1.15 * floor[0], "{after:?} {floor:?}");
    // What stays without it is at its ends: a torque that sets in at once takes some rows in the band.
    let alone = explained_of(planar(), &[(here, &[2, 4])]);
    let excess = |rms: &[f64]| rms[0].powi(2) - alone.noise_floor[0].powi(2);
    let (before, after) = (excess(&alone.before.validate.rms), excess(&alone.after.validate.rms));
    assert!(after < 0.1 * before, "{before} {after}");
}

/// What is wrong only as an arm sets off is how it sets off, and no hand; the same in the middle of a motion
/// is one.
#[test]
fn no_push_is_seen_where_an_arm_sets_off() {
    const REST: usize = 400;
    let named = |start| {
        let (arm, plant) = planar();
        let push = Effect::ContactWrench { force: [3.0, 6.0, 0.0], start, length: 0.4, every: 1e3 };
        let mut logs = recorded(&arm, &plant, &[(push, &[2])]);
        for log in &mut logs {
            let later = REST as f64 / 200.0;
            log.t = (0..REST).map(|k| k as f64 / 200.0).chain(log.t.iter().map(|t| t + later)).collect();
            for signal in log.q.iter_mut().chain(&mut log.torque) {
                let first = signal[0];
                signal.splice(0..0, vec![first; REST]);
            }
            log.pieces.last_mut().unwrap().end = log.t.len();
        }
        names(&explained_logs(&arm, logs)).join(" ")
    };
    assert_eq!(named(0.1), "");
    assert_eq!(named(6.1), "contact_wrench");
}

/// A force that grows slowly, turns as it does, and lets go at once is one push: it is found with its length
/// and its largest force, and little is left.
#[test]
fn a_push_of_another_shape_is_one_push_that_leaves_nothing() {
    const FORCE: f64 = 12.0;
    let (arm, plant) = planar();
    let body = RigidArm::new(&arm).unwrap();
    let mass = [body.last_link(ParameterKind::M)];
    let mut logs = recorded(&arm, &plant, &[]);
    let (from, to) = (6.0, 7.4);
    let pushed = &mut logs[2];
    for k in 0..pushed.t.len() {
        let x = (pushed.t[k] - from) / (to - from);
        if !(0.0..1.0).contains(&x) {
            continue;
        }
        let q = [pushed.q[0][k], pushed.q[1][k]];
        let force = [FORCE * x * (2.0 * x).cos(), FORCE * x * (2.0 * x).sin()];
        for (axis, force) in force.iter().enumerate() {
            let lever = body.gravity_columns(axis, &mass, &q).unwrap();
            (0..2).for_each(|j| pushed.torque[j][k] += force * lever[j]);
        }
    }
    let explained = explained_logs(&arm, logs);
    assert_eq!(names(&explained), ["contact_wrench"]);
    let [(begins, ends)] = spans(&explained)[..] else { panic!("{:?}", explained.effects) };
    // The force is small where it begins.
    approx::assert_relative_eq!(begins, from, epsilon = 0.4);
    approx::assert_relative_eq!(ends, to, epsilon = 0.15);
    let force: Vec<f64> = serde_json::from_value(figures(&explained.effects[0])["force"][0].clone()).unwrap();
    approx::assert_relative_eq!(force[0].hypot(force[1]), FORCE, max_relative = 0.15);
    let excess = |rms: &[f64], j: usize| rms[j].powi(2) - explained.noise_floor[j].powi(2);
    for j in 0..2 {
        let left = excess(&explained.after.fit.rms, j) / excess(&explained.before.fit.rms, j);
        assert!(left < 0.05, "{left} of joint {}'s squared error", j + 1);
    }
}

/// Two pushes with a pause of 0.7 s are two, each with its own force.
#[test]
fn pushes_close_to_each_other_are_distinguished() {
    let push = |force, start| Effect::ContactWrench { force, start, length: 1.0, every: 1e3 };
    let pushes = [push([2.0, 6.0, 0.0], 6.0), push([6.0, -2.0, 0.0], 7.7), push([3.0, 6.0, 0.0], 12.0)];
    let [a, b, c] = pushes.map(|push| (push, &[2usize][..]));
    let explained = explained_of(planar(), &[a, b, c]);
    assert_eq!(names(&explained), ["contact_wrench"]);
    let mut spans = spans(&explained);
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(spans.len(), 3, "{spans:?}");
    for ((from, to), start) in spans.into_iter().zip([6.0, 7.7, 12.0]) {
        assert!((from - start).abs() < 0.3 && (to - start - 1.0).abs() < 0.3, "{from} {to}");
    }
}

/// What is bolted to a link that is not the last is a body on that link. Where the link's joint stands still
/// in space its mass does not show, and is not given.
#[test]
fn a_body_on_another_link_is_found_there() {
    let (arm, usual) = planar();
    let (mass, centre) = (0.5, Vector3::new(-0.12, 0.06, 0.0));
    let mut bodies = usual.dynamics().bodies().to_vec();
    let body = Body::about_centre(mass, centre, Matrix3::identity() * 1e-4, 0.0);
    bodies[0].mass += body.mass;
    bodies[0].moment += body.moment;
    bodies[0].inertia += body.inertia;
    let loaded = plant(&arm, bodies, &[4.0, 2.0], &[0.2, 0.06]);
    // In a fitted log and one to judge on; in one of each kind only.
    for listed in [&[1usize, 4][..], &[2], &[5]] {
        let mut logs = recorded(&arm, &usual, &[]);
        let with = recorded(&arm, &loaded, &[]);
        for k in listed {
            logs[*k] = with[*k].clone();
        }
        let explained = explained_logs(&arm, logs);
        assert_eq!(names(&explained), ["payload"], "{listed:?}");
        let found = figures(&explained.effects[0]);
        assert_eq!(found["link"], 1);
        assert!(found.get("mass").is_none() && found.get("com").is_none(), "{found}");
        // The joint is at the frame's origin less the link's length along x.
        let truth = mass * (centre + Vector3::new(CRANK, 0.0, 0.0));
        for (axis, truth) in truth.iter().enumerate() {
            let moment = found["first_moment"][axis].as_f64().unwrap();
            assert!((moment - truth).abs() < 0.1 * 0.2, "{found} {truth}");
        }
        let logs: Vec<String> = listed.iter().map(|k| format!("log{k}")).collect();
        assert_eq!(explained.effects[0].logs, logs);
        // Learnt on validation logs it has no standard error.
        let std = explained.effects[0].relative_std.first().copied().flatten();
        assert_eq!(std.is_some(), *listed != [5]);
        let length = (0..3).map(|k| found["first_moment"][k].as_f64().unwrap().powi(2)).sum::<f64>().sqrt();
        assert!(std.is_none_or(|std| (length - truth.norm()).abs() < 1.96 * std * length), "{found} {std:?}");
        at_the_floor(&explained);
    }
}

/// The model takes what is held for a point. A bar of the same mass turns less easily: its mass is within the
/// interval, since the standard error contains what is taken of the inertia.
#[test]
fn the_error_of_a_mass_contains_what_is_taken_of_its_inertia() {
    let (arm, usual) = planar();
    let (mass, bar) = (0.3, Vector3::new(0.0, 0.0, 0.009));
    let held = Body::about_centre(mass, Vector3::new(0.05, 0.02, 0.0), Matrix3::from_diagonal(&bar), 0.0);
    let mut bodies = usual.dynamics().bodies().to_vec();
    bodies[1].mass += held.mass;
    bodies[1].moment += held.moment;
    bodies[1].inertia += held.inertia;
    let with = recorded(&arm, &plant(&arm, bodies, &[4.0, 2.0], &[0.2, 0.06]), &[]);
    let mut logs = recorded(&arm, &usual, &[]);
    [1, 4].iter().for_each(|k| logs[*k] = with[*k].clone());
    let explained = explained_logs(&arm, logs);
    assert_eq!(names(&explained), ["payload"]);
    let found = figures(&explained.effects[0])["mass"].as_f64().unwrap();
    let std = found * explained.effects[0].relative_std[0].unwrap();
    assert!((found - mass).abs() < 1.96 * std && std < 0.1 * mass, "{found} ± {std}");
}

/// On an axis that feels no weight a load that pulls during a whole log is one force from its beginning to
/// its end: no body held to the end could be meant.
#[test]
fn a_load_along_a_level_axis_lasts_for_its_whole_log() {
    const LOAD: f64 = 196.0;
    let text = "name = \"axis\"\nconvention = \"modified\"\ngravity = [0, 0, -9.81]\n[[joint]]\n\
                kind = \"prismatic\"\na = 0\nalpha = \"pi/2\"\nd = 0\ntheta = \"0\"\n";
    let arm = Arm::parse(text, "axis.toml").unwrap();
    let slide = plant(&arm, vec![Body::even_box(95.0, [0.0; 3], [0.3; 3], 0.0)], &[25.0], &[2.0]);
    let mut logs = recorded(&arm, &slide, &[]);
    logs[1].torque[0].iter_mut().for_each(|torque| *torque += LOAD);
    let explained = explained_logs(&arm, logs.clone());
    assert_eq!(names(&explained), ["contact_wrench"]);
    let [(from, to)] = spans(&explained)[..] else { panic!("{:?}", spans(&explained)) };
    let [first, last] = [logs[1].t[0], logs[1].t[logs[1].t.len() - 1]];
    assert!(from < first + 2.0 && to > last - 2.0, "{from} {to} of {first} {last}");
    let force: f64 = figures(&explained.effects[0])["force"][0]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f.as_f64().unwrap().powi(2))
        .sum::<f64>()
        .sqrt();
    approx::assert_relative_eq!(force, LOAD, max_relative = 0.01);
}

#[test]
fn a_payload_is_found_with_the_instant_at_which_it_was_taken_up() {
    const START: f64 = 7.3;
    let payload = Effect::Payload { mass: PAYLOAD, centre: [0.05, 0.02, 0.0], start: START };
    let explained = explained(planar(), payload, &[1]);
    assert_eq!(names(&explained), ["payload"]);
    let parameters = figures(&explained.effects[0]);
    approx::assert_relative_eq!(parameters["start_time"][0].as_f64().unwrap(), START, epsilon = 0.15);
    approx::assert_relative_eq!(parameters["mass"].as_f64().unwrap(), PAYLOAD, max_relative = 0.05);
    at_the_floor(&explained);
}

#[test]
fn every_log_says_by_itself_when_a_payload_is_taken_up() {
    let payload = |start| Effect::Payload { mass: PAYLOAD, centre: [0.05, 0.02, 0.0], start };
    // In a log to judge on only, and in one of each at other times.
    let cases: [&[(usize, f64)]; 2] = [&[(5, 7.3)], &[(1, 4.0), (4, 12.2)]];
    for truth in cases {
        let (arm, plant) = planar();
        let effects: Vec<(Effect, [usize; 1])> =
            truth.iter().map(|(log, start)| (payload(*start), [*log])).collect();
        let listed: Vec<(Effect, &[usize])> =
            effects.iter().map(|(e, l)| (e.clone(), l.as_slice())).collect();
        let explained = explained_of((arm, plant), &listed);
        assert_eq!(names(&explained), ["payload"], "{truth:?}");
        let parameters = figures(&explained.effects[0]);
        assert!(parameters.get("end_time").is_none());
        for (k, (log, start)) in truth.iter().enumerate() {
            assert_eq!(explained.effects[0].logs[k], format!("log{log}"));
            approx::assert_relative_eq!(parameters["start_time"][k].as_f64().unwrap(), start, epsilon = 0.15);
        }
        approx::assert_relative_eq!(parameters["mass"].as_f64().unwrap(), PAYLOAD, max_relative = 0.05);
        // The jerk with which it is taken up is not a law of the model.
        near_the_floor(&explained, 1.35);
    }
}

#[test]
fn a_payload_that_is_put_down_is_there_until_then() {
    const DOWN: f64 = 13.1;
    let payload = Effect::Payload { mass: PAYLOAD, centre: [0.05, 0.02, 0.0], start: 0.0 };
    for which in [1, 5] {
        let (arm, plant) = planar();
        let mut logs = recorded(&arm, &plant, &[]);
        let with = recorded(&arm, &plant, &[(payload.clone(), &[which])]).swap_remove(which);
        let held = with.t.iter().filter(|t| **t < DOWN).count();
        for (torque, with) in logs[which].torque.iter_mut().zip(&with.torque) {
            torque[..held].copy_from_slice(&with[..held]);
        }
        let explained = explained_logs(&arm, logs);
        assert_eq!(names(&explained), ["payload"], "log{which}");
        let parameters = figures(&explained.effects[0]);
        approx::assert_relative_eq!(parameters["end_time"][0].as_f64().unwrap(), DOWN, epsilon = 0.15);
        approx::assert_relative_eq!(parameters["mass"].as_f64().unwrap(), PAYLOAD, max_relative = 0.05);
        at_the_floor(&explained);
    }
}

#[test]
fn a_log_of_few_seconds_is_searched_as_well() {
    let (arm, plant) = planar();
    let payload = Effect::Payload { mass: PAYLOAD, centre: [0.05, 0.02, 0.0], start: 0.0 };
    let mut logs = recorded(&arm, &plant, &[(payload, &[1, 3])]);
    // Shorter than a payload that is put down again, of one step and of a few.
    for (which, samples) in [(2, 230), (3, 640), (5, 700)] {
        let log = &mut logs[which];
        log.t.truncate(samples);
        log.q.iter_mut().chain(&mut log.torque).for_each(|signal| signal.truncate(samples));
        log.pieces = std::iter::once(0..samples).collect();
    }
    let explained = explained_logs(&arm, logs);
    assert_eq!(names(&explained), ["payload"]);
    assert_eq!(explained.effects[0].logs[0], "log1");
}

#[test]
fn a_push_of_many_seconds_is_one_push() {
    let push = Effect::ContactWrench { force: [1.0, 2.0, 0.0], start: 4.0, length: 13.0, every: 1e3 };
    let explained = explained(planar(), push, &[2]);
    assert_eq!(names(&explained), ["contact_wrench"]);
    assert_eq!(spans(&explained).len(), 1);
    lasts(&explained, 0, 4.0..17.0);
    at_the_floor(&explained);
}

#[test]
fn a_tilted_base_shows_weight_that_level_gravity_hides() {
    let tilt = [0.01, -0.015];
    let explained = explained(scara(), Effect::BaseTilt { tilt }, &[0, 1, 2, 3, 4, 5]);
    // Not also a spring or a constant torque of the first joint.
    assert_eq!(names(&explained), ["base_tilt"]);
    for (k, tilt) in tilt.into_iter().enumerate() {
        approx::assert_relative_eq!(
            figures(&explained.effects[0])["tilt"][k].as_f64().unwrap(),
            tilt,
            epsilon = 1e-3
        );
    }
    at_the_floor(&explained);
}

/// Encoders on parallel axes have zeros that say the same of the last link, and so does a body that does not
/// lie where it is declared: none of them is counted twice, and the answer is all names that fit.
#[test]
fn the_zeros_of_parallel_encoders_do_not_outvote_a_body_that_lies_aside() {
    let text = include_str!("../../../../../tests/arms/planar2r.toml");
    let text = text.replace("rotor_ratio = 30", "rotor_ratio = 30\nzero = [\"my\"]");
    let arm = Arm::parse(&text, "planar2r.toml").unwrap();
    let bodies = vec![
        Body::even_box(4.0, [-0.2, 0.01, 0.0], [0.4, 0.08, 0.08], 4e-5),
        Body::even_box(2.0, [-0.15, 0.012, 0.02], [0.3, 0.06, 0.06], 4e-5),
    ];
    let plant = plant(&arm, bodies, &[4.0, 2.0], &[0.2, 0.06]);
    let explained = explained_logs(&arm, recorded(&arm, &plant, &[]));
    let [found] = explained.effects.as_slice() else { panic!("{:?}", names(&explained)) };
    assert_eq!(found.joints.len(), 1, "{found:?}");
    let as_well = found.rivals.iter().filter(|rival| rival.why_not.starts_with("fits as well"));
    let mut all: Vec<&str> = as_well.map(|rival| rival.effect.as_str()).collect();
    all.push(&found.effect);
    assert!(all.contains(&"broken_symmetry") && all.contains(&"encoder_offset"), "{found:?}");
    at_the_floor(&explained);
}

/// A force in the plane, N, half a wave from 3 to 4 s after the motion ended, or from 6 s to the end of the
/// log; friction of the two joints hides 4 and 2 N·m either way. Where brakes hold the arm and motors do not,
/// nothing touches it.
#[test]
fn a_touch_of_an_arm_that_stands_still_is_seen_and_a_brake_is_not() {
    const FORCE: f64 = 60.0;
    let (arm, plant) = planar();
    let body = RigidArm::new(&arm).unwrap();
    let mass = [body.last_link(ParameterKind::M)];
    let mut logs = recorded(&arm, &plant, &[]);
    let ended: Vec<f64> = logs.iter().map(|log| *log.t.last().unwrap()).collect();
    for (k, log) in logs.iter_mut().enumerate() {
        let q: Vec<f64> = log.q.iter().map(|q| *q.last().unwrap()).collect();
        // A unit force along the base axis that both joints feel most.
        let levers: Vec<Vec<f64>> =
            (0..3).map(|axis| body.gravity_columns(axis, &mass, &q).unwrap()).collect();
        let felt = |lever: &Vec<f64>| lever.iter().map(|l| l.abs()).fold(0.0, f64::max);
        let lever = levers.iter().max_by(|a, b| felt(a).total_cmp(&felt(b))).unwrap();
        let usual: Vec<f64> = log.torque.iter().map(|torque| *torque.last().unwrap()).collect();
        for sample in 1..=1600 {
            let time = f64::from(sample) / 200.0;
            let wave = if (3.0..4.0).contains(&time) { ((time - 3.0) * PI).sin() } else { 0.0 };
            let stays = if time > 6.0 { 1.0 } else { 0.0 };
            let force = FORCE * [0.0, wave, 0.0, 0.0, stays, wave][k];
            let braked = k == 2 && time > 5.0;
            log.t.push(ended[k] + time);
            for j in 0..2 {
                log.q[j].push(q[j]);
                let motor = if braked { 0.0 } else { usual[j] + force * lever[j] };
                log.torque[j].push(motor + 0.05 * f64::from(sample * (7 + j as u32)).sin());
            }
        }
        log.pieces.last_mut().unwrap().end = log.t.len();
    }
    let explained = explained_logs(&arm, logs);
    assert_eq!(names(&explained), ["contact_wrench"]);
    for (k, (result, ended)) in explained.logs.iter().zip(&ended).enumerate() {
        assert_eq!(result.like_the_others, ![1, 4, 5].contains(&k), "{}", result.sentence());
        let [from, to] = if k == 4 { [6.0, 8.0] } else { [3.0, 4.0] };
        for push in &result.differs {
            approx::assert_relative_eq!(push.start_time - ended, from, epsilon = 0.2);
            approx::assert_relative_eq!(push.end_time - ended, to, epsilon = 0.2);
        }
    }
    let force: Vec<f64> = serde_json::from_value(figures(&explained.effects[0])["force"][0].clone()).unwrap();
    let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
    approx::assert_relative_eq!(size, FORCE, max_relative = 0.1);
}

/// What is another in a single log, fitted or for validation, is reported for that log with its figure, and
/// nothing of the others.
#[test]
fn what_is_another_in_one_log_is_reported_for_that_log() {
    let (arm, plant) = planar();
    let usual = recorded(&arm, &plant, &[]);
    assert!(explained_logs(&arm, usual.clone()).logs.iter().all(|log| log.like_the_others));
    let late = 4;
    let delayed = |torque: &mut Vec<f64>| {
        let before = torque.clone();
        (late..before.len()).for_each(|k| torque[k] = before[k - late]);
    };
    let moved = |log: &mut Log, joint: usize, of: &dyn Fn(f64) -> f64| {
        let q = log.q[joint].clone();
        for (k, torque) in log.torque[joint].iter_mut().enumerate() {
            let around = k.saturating_sub(2)..(k + 2).min(q.len() - 1);
            *torque += of((q[around.end] - q[around.start]) * 200.0 / around.len() as f64);
        }
    };
    for (which, effect, value) in
        [(1, "asymmetry", 0.8), (4, "asymmetry", 0.8), (2, "time_delay", 0.02), (5, "temperature", 0.3)]
    {
        let mut logs = usual.clone();
        match effect {
            "asymmetry" => moved(&mut logs[which], 0, &|_| value),
            "time_delay" => logs[which].torque.iter_mut().for_each(delayed),
            // Three tenths more of the friction that joint 2 has.
            _ => moved(&mut logs[which], 1, &|v| {
                0.3 * 2.0 * (0.7 * (60.0 * v).tanh() + 0.3 * (4.0 * v).tanh() + v)
            }),
        }
        let explained = explained_logs(&arm, logs);
        for (k, log) in explained.logs.iter().enumerate() {
            assert_eq!(log.like_the_others, k != which, "{effect} in {which}: {}", log.sentence());
        }
        let found = &explained.logs[which].differs[0];
        assert_eq!(found.effect, effect, "{}", explained.logs[which].sentence());
        approx::assert_relative_eq!(found.value.unwrap(), value, max_relative = 0.15);
    }
}
