//! Logs of a servo with one thing that the base lacks, by another formulation than the simulation that is
//! fitted: explicit steps of 20 µs, and a joint that rests while friction can hold it.

use super::tests::servos::{karnopp, pendulum, point};
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
    /// A log at 100 Hz, `clock` seconds after it was cold; at the end of it the drive is switched off.
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
            v = karnopp(v, (drive, dry, rotor + MASS * LENGTH * LENGTH), h);
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
        self.explained(seconds, warm, |_| ()).effects
    }

    /// With other validation logs.
    fn explained(&self, seconds: f64, warm: bool, other: impl Fn(&mut ServoLog)) -> ExplainedServos {
        let servos = servos();
        let (logs, mut validate) = self.logs(seconds, servos.body.arm(), warm);
        validate.iter_mut().for_each(other);
        explain_servos(&servos, &logs, &validate, &Rule::default(), Progress::default()).unwrap()
    }
}

fn servos() -> ServoArm {
    let arm = pendulum(LENGTH, &format!("kp = 16\nsupply = {SUPPLY}"));
    ServoArm::new(&arm, Some(&point(MASS))).unwrap()
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

/// What follows a voltage is judged by logs with that voltage; without it nothing else is named in its place.
#[test]
fn what_follows_a_signal_needs_it_in_the_validation_logs() {
    let sags = Plant { sag: 0.35, ..Plant::default() };
    let found = sags.explained(4.0, true, |log| log.volts = None).effects;
    assert!(found.is_empty(), "{found:?}");
    let warm = Plant { warmth: -0.5, ..Plant::default() };
    let found = warm.explained(8.0, true, |log| log.temperature = None).effects;
    assert!(found.is_empty(), "{found:?}");
}

/// Friction by load of at least 0.5, where it is 0.3: better than none, and no size.
#[test]
fn what_ends_at_its_bound_is_not_named() {
    let servos = servos();
    let (logs, validate) = Plant { load: 0.3, ..Plant::default() }.logs(4.0, servos.body.arm(), true);
    let mut problem = Problem::new(&servos.body, &logs, 0, &servos.known(0)).unwrap();
    problem.roles.retain(|role| *role != Role::Constant(Constant::Load));
    let mut joint = Joint::solve(problem);
    for (least, names) in [(0.5, &[][..]), (0.0, &["load_friction"][..])] {
        let free = vec![(Constant::Load, least, &[0.6][..])];
        let one = candidates::Candidate { name: "load_friction", free, set: Vec::new() };
        let mut effects = Vec::new();
        candidates::name(&mut joint, &mut effects, vec![one], (&servos, &validate), &Rule::default());
        let found: Vec<&str> = effects.iter().map(|effect| effect.effect).collect();
        assert_eq!(found, names, "{effects:?}");
    }
}

/// A drive that is switched off has no goal to be compared with.
#[test]
fn a_drive_that_is_switched_off_is_not_judged() {
    let off = |log: &mut ServoLog| log.enabled = Some(vec![vec![false; log.t.len()]]);
    let found = Plant::default().explained(4.0, true, off);
    let [verdict] = &found.verdict[..] else { panic!("{:?}", found.verdict) };
    assert_eq!((verdict.state, verdict.left, found.goal_error.as_slice()), ("not judged", None, &[None][..]));
    assert!(found.unusable.is_empty(), "{:?}", found.unusable);
}

#[test]
fn a_rival_that_a_log_cannot_show_leaves_nothing_to_compare() {
    let size = |after| Some(Size { value: 1.0, std: 0.1, blocks: 6, before: 1.0, after });
    let why = |sizes: &[[Option<Size>; 2]], own: &[usize]| {
        let [rival] = &rivals(sizes, own, Change::Payload)[..] else { panic!("one other change") };
        (rival.effect.clone(), rival.why_not.clone())
    };
    let sizes = [[size(0.25), size(0.75)], [size(0.25), None]];
    let (effect, first) = why(&sizes, &[0]);
    assert_eq!(effect, "torque_constant");
    assert_eq!(first, "leaves 75 % of the squared error of these logs, not 25 %");
    assert_eq!(why(&sizes, &[0, 1]).1, "these logs cannot show it");
}
