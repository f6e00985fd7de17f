//! Logs of a servo with one thing that the base lacks, by another formulation than the simulation that is
//! fitted: explicit steps of 20 µs, and a joint that rests while friction can hold it.

use super::tests::servos::{pendulum, point};
use super::*;

/// A servo; what is 0 is not there.
#[derive(Clone, Copy, Default)]
struct Plant {
    load: f64,
    /// The voltage swings by this share.
    sag: f64,
    /// Coulomb and viscous friction change by this share within `warm_in`, s, or else over 10 K.
    warmth: f64,
    warm_in: f64,
}

const MASS: f64 = 0.8;
const LENGTH: f64 = 0.12;
const SUPPLY: f64 = 12.0;

/// What is logged of it.
#[derive(Default)]
struct Logged {
    t: Vec<f64>,
    q: Vec<f64>,
    goal: Vec<f64>,
    volts: Vec<f64>,
    temperature: Vec<f64>,
}

impl Plant {
    /// Its log at 100 Hz, `clock` seconds after it was cold; at the end of it the drive is switched off.
    fn run(&self, seconds: f64, clock: f64, goal: impl Fn(f64) -> f64) -> Logged {
        let (h, torque, back_emf, rotor, gain, delay) = (2e-5, 6.0, 0.6, 0.02, 2.9, 0.02);
        let mut log = Logged::default();
        let (mut q, mut v) = (0.0f64, 0.0f64);
        // The drive has the goals that are logged, and goes from one to the next.
        let goal = |time: f64| {
            let (k, share) = ((100.0 * time).floor(), (100.0 * time).fract());
            (1.0 - share) * goal(0.01 * k) + share * goal(0.01 * (k + 1.0))
        };
        for n in 0..(seconds / h) as usize {
            let time = n as f64 * h;
            let share = 1.0 - self.sag * (0.5 - 0.5 * (2.3 * time).cos());
            let hot = 10.0 * (0.5 - 0.5 * (0.4 * time).cos());
            if n % 500 == 0 {
                log.t.push(time);
                log.q.push(q);
                log.goal.push(goal(0.01 * (n / 500) as f64));
                log.volts.push(SUPPLY * share);
                log.temperature.push(30.0 + hot);
            }
            let warm =
                if self.warm_in > 0.0 { -(-(clock + time) / self.warm_in).exp_m1() } else { hot / 10.0 };
            let ease = 1.0 + self.warmth * warm;
            let duty = (gain * (goal((time - delay).max(0.0)) - q)).clamp(-1.0, 1.0);
            let motor = if time - delay < 0.8 * seconds { torque * share * duty - back_emf * v } else { 0.0 };
            let weight = MASS * 9.81 * LENGTH * q.sin();
            let dry = ease * 0.12 + self.load * 0.5 * (motor + weight).abs();
            let drive = motor - weight - ease * 0.2 * v;
            if v.abs() < 1e-4 && drive.abs() <= dry {
                v = 0.0;
            } else {
                let way = if v.abs() < 1e-4 { drive.signum() } else { v.signum() };
                v += h * (drive - way * dry) / (rotor + MASS * LENGTH * LENGTH);
            }
            q += h * v;
        }
        log
    }

    /// Four logs, the last two for validation, named by what the first have.
    fn logs(&self, seconds: f64, arm: &dyngen::Arm, warm: bool) -> (Vec<ServoLog>, Vec<ServoLog>) {
        let one = |k: usize| {
            let w = 1.0 + 0.17 * k as f64;
            let clock = if k.is_multiple_of(2) { 0.0 } else { seconds };
            let steps = |t: f64| [0.3, 1.2, -0.9, 0.4, -1.3, 0.8][(1.7 * t) as usize % 6];
            let waves = |t: f64| 0.9 * (2.0 * w * t).sin() + 0.5 * (3.3 * w * t).sin();
            let own =
                self.run(seconds, clock, |t| if k.is_multiple_of(2) { w * steps(w * t) } else { waves(t) });
            let on: Vec<f64> = own.t.iter().map(|t| f64::from(*t < 0.8 * seconds)).collect();
            let mut columns = vec![
                ("t".to_string(), own.t.as_slice()),
                ("q1".to_string(), own.q.as_slice()),
                ("goal1".to_string(), own.goal.as_slice()),
                ("volts1".to_string(), own.volts.as_slice()),
                ("torque_enable1".to_string(), on.as_slice()),
            ];
            if warm {
                columns.push(("temp1".to_string(), own.temperature.as_slice()));
            }
            let log = ServoLog::from_columns(&format!("log_{k}"), arm, &columns).unwrap().0;
            ServoLog { clock, ..log }
        };
        let mut all: Vec<ServoLog> = (0..4).map(one).collect();
        let validate = all.split_off(2);
        (all, validate)
    }

    /// What is named of it.
    fn named(&self, seconds: f64, warm: bool) -> Vec<ServoEffect> {
        let arm = pendulum(LENGTH, &format!("kp = 16\nsupply = {SUPPLY}"));
        let servos = ServoArm::new(&arm, Some(&point(MASS))).unwrap();
        let (logs, validate) = self.logs(seconds, &arm, warm);
        let found = explain_servos(&servos, &logs, &validate, &Rule::default(), Progress::default()).unwrap();
        found.effects
    }
}

fn number(effect: &ServoEffect, key: &str) -> f64 {
    effect.parameters[key].as_f64().unwrap()
}

#[test]
fn nothing_is_named_of_a_servo_that_lacks_nothing() {
    let found = Plant::default().named(4.0, true);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn load_friction_is_named_alone() {
    let found = Plant { load: 0.3, ..Plant::default() }.named(4.0, true);
    assert!(matches!(found.as_slice(), [one] if one.effect == "load_friction"), "{found:?}");
    assert!((number(&found[0], "coefficient") - 0.3).abs() < 0.03, "{found:?}");
}

#[test]
fn a_supply_that_sags_is_named_by_its_logged_voltage() {
    let found = Plant { sag: 0.35, ..Plant::default() }.named(4.0, true);
    assert!(matches!(found.as_slice(), [one] if one.effect == "torque_constant"), "{found:?}");
    assert_eq!((found[0].parameters["law"].as_str(), number(&found[0], "supply")), (Some("supply"), SUPPLY));
}

#[test]
fn friction_that_falls_with_the_temperature_or_with_running_time_is_named() {
    let found = Plant { warmth: -0.5, ..Plant::default() }.named(8.0, true);
    assert!(matches!(found.as_slice(), [one] if one.effect == "temperature"), "{found:?}");
    assert!((number(&found[0], "change") + 0.5).abs() < 0.1, "{found:?}");
    let found = Plant { warmth: -0.6, warm_in: 20.0, ..Plant::default() }.named(16.0, false);
    assert!(matches!(found.as_slice(), [one] if one.effect == "temperature"), "{found:?}");
    assert!((number(&found[0], "change") + 0.6).abs() < 0.2, "{found:?}");
}
