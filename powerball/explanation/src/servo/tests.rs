//! On measured logs of a servo: another gain is named, another mass is found, and nothing where nothing differs.

use super::*;
use servos::{GAINS, LENGTHS, MASSES, Measured, PATHS, pendulum, point};

#[path = "../../../../tests/support/servos.rs"]
mod servos;

/// The logs of one repetition explain a load and gain, and these are judged: what is named in single logs.
fn in_single_logs(measured: &Measured, own: (usize, f64, u32), validate: &[ServoLog]) -> Vec<ServoEffect> {
    let ((name, mass), length, kp) = (MASSES[own.0], own.1, own.2);
    let servos = ServoArm::new(&pendulum(length, &format!("kp = {kp}")), Some(&point(mass))).unwrap();
    let logs = measured.logs((name, length, kp), 1);
    let found = explain_servos(&servos, &logs, validate, &Rule::default(), Progress::default()).unwrap();
    assert_eq!(found.before.validate.position_error.len(), 1);
    found.effects.into_iter().filter(|effect| !effect.logs.is_empty()).collect()
}

/// Whether a log of another gain, and no other, is named with a gain, and whether that is within a third of the right one.
fn names_the_gain(measured: &Measured, own: (usize, f64, u32), other: u32, path: &str) -> [bool; 2] {
    let of = (MASSES[own.0].0, own.1, own.2);
    let mut validate: Vec<ServoLog> =
        PATHS.iter().filter(|p| **p != path).map(|path| measured.log(of, path, 2)).collect();
    validate.push(measured.log((of.0, of.1, other), path, 2));
    let odd = validate[4].file.clone();
    let found = in_single_logs(measured, own, &validate);
    let right = f64::from(other) / f64::from(own.2);
    let gain = |e: &ServoEffect| e.parameters.get("gain").and_then(serde_json::Value::as_f64).unwrap_or(0.0);
    let is_named = matches!(found.as_slice(), [one] if one.effect == "torque_constant" && one.logs == [odd]);
    let is_right = is_named && (gain(&found[0]) / right).ln().abs() < 0.3;
    if !is_right {
        let said: Vec<_> = found.iter().map(|e| (e.effect, gain(e), e.logs.len())).collect();
        println!("{} kg at {} m, kp {} to {other} in {path}: {said:?}", of.0, of.1, of.2);
    }
    [is_named, is_right]
}

#[test]
fn another_gain_in_one_log_is_named_and_nothing_where_nothing_differs() {
    let Some(measured) = Measured::unpack() else { return };
    assert_eq!(names_the_gain(&measured, (0, 0.15, 16), 32, "sin_sin"), [true; 2]);
    let same = measured.logs((MASSES[0].0, 0.15, 16), 2);
    let found = in_single_logs(&measured, (0, 0.15, 16), &same);
    assert!(found.is_empty(), "{found:?}");
}

/// Every mass, length and gain of the logs.
fn all() -> Vec<(usize, f64, u32)> {
    let mut all = Vec::new();
    for mass in 0..MASSES.len() {
        LENGTHS.iter().for_each(|l| GAINS.iter().for_each(|kp| all.push((mass, *l, *kp))));
    }
    all
}

#[test]
#[ignore = "at_length: 132 explanations"]
fn how_often_gains_are_right() {
    let Some(measured) = Measured::unpack() else { return };
    let (mut named, mut right, mut count, mut same) = (0, 0, 0, 0);
    for own in all() {
        let others = GAINS.iter().filter(|kp| **kp != own.2).flat_map(|kp| PATHS.map(|path| (*kp, path)));
        for (kp, path) in others {
            let [is_named, is_right] = names_the_gain(&measured, own, kp, path);
            (named, right, count) = (named + usize::from(is_named), right + usize::from(is_right), count + 1);
        }
        let logs = measured.logs((MASSES[own.0].0, own.1, own.2), 2);
        same += usize::from(in_single_logs(&measured, own, &logs).is_empty());
    }
    println!("gain named in its log and in no other: {named} of {count}, within a third {right}");
    println!("nothing named where nothing differs: {same} of {}", all().len());
}

#[test]
#[ignore = "at_length: 60 explanations"]
fn how_often_masses_are_right() {
    let Some(measured) = Measured::unpack() else { return };
    let (mut near, mut held, mut wrong, mut count) = (0, 0, 0, 0);
    for own in all() {
        let other = MASSES[1 - own.0];
        let truth = other.1 - MASSES[own.0].1;
        for k in 0..PATHS.len() {
            let mut validate = measured.logs((MASSES[own.0].0, own.1, own.2), 2);
            let three = (0..3).map(|i| PATHS[(k + i) % PATHS.len()]);
            validate.extend(three.map(|path| measured.log((other.0, own.1, own.2), path, 2)));
            let odd: Vec<String> = validate[PATHS.len()..].iter().map(|log| log.file.clone()).collect();
            let found = in_single_logs(&measured, own, &validate);
            wrong += found.iter().flat_map(|e| &e.logs).filter(|log| !odd.contains(log)).count();
            let of = |e: &ServoEffect, key: &str, at: usize| match &e.parameters[key] {
                serde_json::Value::Array(both) => both[at].as_f64().unwrap_or(f64::NAN),
                one => one.as_f64().unwrap_or(f64::NAN),
            };
            count += 1;
            let said: Vec<_> = found.iter().map(|e| (e.effect, e.logs.len())).collect();
            if let Some(one) = found.iter().find(|e| e.effect == "payload") {
                let (value, std) = (of(one, "mass", 0), of(one, "mass_std", 0));
                near += usize::from((value / truth - 1.0).abs() < 0.1);
                let inside = of(one, "mass_interval", 0) <= truth && truth <= of(one, "mass_interval", 1);
                held += usize::from(inside);
                println!("{own:?} {k}: {value:.3} ± {std:.3} kg for {truth:.3}, {said:?}");
            } else {
                println!("{own:?} {k}: no mass for {truth:.3} kg, {said:?}");
            }
        }
    }
    println!("mass from three logs within 10 %: {near} of {count}; its interval holds it: {held}");
    println!("logs of the known mass that are named: {wrong} of {}", count * 10);
}
