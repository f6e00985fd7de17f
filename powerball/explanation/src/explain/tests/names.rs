//! What the rule does on logs whose truth is known.

use super::figures;
use super::plant::{Noise, RATE, Truth, arm, record};
use crate::ExplainOptions;
use crate::Rule;
use crate::explain::special::repeats;
use crate::explain::{Explained, explain_body};
use chacha20::ChaCha8Rng;
use powerball_logs::regression::{Data, DataOptions, RigidArm};
use powerball_logs::signal::Band;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use std::ops::Range;

/// What other tests name, from the same logs.
const ELSEWHERE: [Truth; 5] =
    [Truth::LoadFriction, Truth::PayloadLater, Truth::MotorRipple, Truth::TimeDelay, Truth::BrokenSymmetry];

fn run(body: &RigidArm, truth: Truth, size: f64, noise: Noise, seed: u64) -> Explained {
    let logs = record(body.arm(), truth, size, noise, 7, 22.0, seed);
    let (fit, validate) = logs.split_at(5);
    explain_body(body, fit, validate, &ExplainOptions::default()).unwrap()
}

fn names(explained: &Explained) -> Vec<String> {
    explained
        .effects
        .iter()
        .map(|e| format!("{}@{:?} m{:.1} l{:.2}", e.effect, e.joints, e.margin, e.leftover))
        .collect()
}

#[test]
fn one_missing_effect_is_named_with_its_figures() {
    let body = RigidArm::new(&arm()).unwrap();
    let figure = |explained: &Explained, name: &str| figures(&explained.effects[0])[name].as_f64().unwrap();
    let load = run(&body, Truth::LoadFriction, 1.0, Noise::White, 3);
    assert_eq!(load.effects[0].effect, "load_friction");
    approx::assert_abs_diff_eq!(figure(&load, "coefficient"), 0.08, epsilon = 0.008);
    let payload = run(&body, Truth::PayloadLater, 1.0, Noise::White, 3);
    assert_eq!(payload.effects[0].effect, "payload");
    approx::assert_abs_diff_eq!(figure(&payload, "mass"), 0.5, epsilon = 0.05);
    assert_eq!(payload.effects[0].logs, ["log1.csv", "log3.csv"]);
    let ripple = run(&body, Truth::MotorRipple, 1.0, Noise::White, 3);
    assert_eq!(ripple.effects[0].effect, "position_ripple");
    approx::assert_abs_diff_eq!(
        figures(&ripple.effects[0])["orders"][0].as_f64().unwrap(),
        200.0,
        epsilon = 0.5
    );
    for explained in [load, payload, ripple] {
        let (before, after) = (&explained.before.validate.rms, &explained.after.validate.rms);
        assert!(before.iter().zip(after).any(|(b, a)| *a < 0.95 * b), "{before:?} {after:?}");
        for change in &explained.held_out_change {
            let (b, a) = (before[change.joint.index()], after[change.joint.index()]);
            approx::assert_relative_eq!(change.rms, a / b - 1.0, epsilon = 1e-9);
            assert!(change.interval[0] < change.rms && change.rms < change.interval[1]);
        }
        // What the joint gained is sure, and no joint surely lost.
        let surely =
            |wanted: fn([f64; 2]) -> bool| explained.held_out_change.iter().any(|c| wanted(c.interval));
        assert!(surely(|[_, high]| high < 0.0) && !surely(|[low, _]| low > 0.0));
    }
}

/// Teeth that pass faster than the band holds for most of the time. Without what passes more slowly it is not
/// a ripple of the joint: its law would raise the error there.
#[test]
fn ripple_above_the_band_is_named() {
    let body = RigidArm::new(&arm()).unwrap();
    let clean = record(body.arm(), Truth::Clean, 0.0, Noise::White, 7, 22.0, 11);
    let band = Band::new(DataOptions::default().cutoff, RATE);
    let explained = |size: f64, whole: bool| {
        let mut logs = clean.clone();
        for log in &mut logs {
            let ripple: Vec<f64> = log.q[2].iter().map(|q| size * (150.4 * q + 0.3).cos()).collect();
            let slow = if whole { vec![0.0; ripple.len()] } else { band.filtered(&ripple) };
            log.torque[2].iter_mut().zip(ripple.iter().zip(slow)).for_each(|(t, (r, s))| *t += r - s);
        }
        let (fit, validate) = logs.split_at(5);
        // Nothing is looked for within the band.
        let rule = Rule { most_steps: 0, ..Rule::default() };
        explain_body(&body, fit, validate, &ExplainOptions { rule, ..ExplainOptions::default() }).unwrap()
    };
    assert_eq!(names(&explained(0.5, false)), Vec::<String>::new());
    let explained = explained(0.2, true);
    let [ripple] = explained.effects.as_slice() else { panic!("{:?}", names(&explained)) };
    assert_eq!((ripple.effect.as_str(), ripple.joints[0].number()), ("position_ripple", 3));
    let figure = |key: &str| figures(ripple)[key][0].as_f64().unwrap();
    approx::assert_abs_diff_eq!(figure("orders"), 150.4, epsilon = 0.2);
    approx::assert_abs_diff_eq!(figure("amplitudes"), 0.2, epsilon = 0.03);
    // A controller adds it.
    let terms = &explained.model.additions.terms;
    let amplitude = terms.iter().map(|t| t.term.coefficient.powi(2)).sum::<f64>().sqrt();
    approx::assert_abs_diff_eq!(amplitude, 0.2, epsilon = 0.03);
}

#[test]
fn nothing_is_found_where_nothing_is_missing() {
    let body = RigidArm::new(&arm()).unwrap();
    for (noise, seed) in [(Noise::White, 11), (Noise::White, 12), (Noise::Coloured(0.3), 13)] {
        let explained = run(&body, Truth::Clean, 0.0, noise, seed);
        assert_eq!(names(&explained), Vec::<String>::new(), "{noise:?} {seed}");
        assert!(explained.false_positives.rate <= 0.01);
    }
}

/// In slow motion a tool that swings looks like a delay or like hysteresis, and fits far better than any
/// rival.
fn swings(seeds: Range<u64>) {
    let body = RigidArm::new(&arm()).unwrap();
    for seed in seeds {
        let explained = run(&body, Truth::Swing, 1.0, Noise::White, seed);
        assert_eq!(names(&explained), Vec::<String>::new(), "{seed}");
    }
}

#[test]
fn a_tool_that_swings_is_given_no_name() {
    swings(0..1);
}

#[test]
#[ignore = "at length: minutes; the one above guards it"]
fn a_tool_that_swings_is_given_no_name_at_length() {
    swings(1..3);
}

/// A repeat, even one that drifts, is known from another path; and there a spring is not named, whatever it
/// would gain.
#[test]
fn nothing_of_the_position_is_named_on_a_repeated_path() {
    let body = RigidArm::new(&arm()).unwrap();
    let logs = record(body.arm(), Truth::Spring, 1.0, Noise::White, 7, 22.0, 3);
    let data = |logs: &[powerball_logs::log::Log]| Data::new(&body, logs, &DataOptions::default()).unwrap();
    let mut drifted = logs[0].clone();
    drifted.q.iter_mut().flatten().for_each(|q| *q = 0.03 + 1.2 * *q);
    assert!(repeats(&Rule::default(), &data(&logs[..3]), &data(&[drifted])));
    assert!(!repeats(&Rule::default(), &data(&logs[..3]), &data(&logs[4..])));
    let repeated = explain_body(&body, &logs[..5], &logs[..2], &ExplainOptions::default()).unwrap();
    assert!(!names(&repeated).iter().any(|n| n.starts_with("spring")), "{:?}", names(&repeated));
    assert!(repeated.warnings.iter().any(|w| w.contains("run the same path")));
}

/// Effects on an arm whose laws are neither the candidates' formulas nor the virtual arm's.
fn are_named(truths: &[Truth]) {
    let body = RigidArm::new(&arm()).unwrap();
    let mut wrong = Vec::new();
    for &truth in truths {
        let explained = run(&body, truth, 1.0, Noise::White, 3);
        if explained.effects.first().is_none_or(|e| e.effect != truth.name()) {
            wrong.push(format!("{truth:?}: {:?}", names(&explained)));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}

/// A third of those that `one_missing_effect_is_named_with_its_figures` and the tests of models do not name.
#[test]
fn a_sample_of_effects_is_named() {
    let mut truths: Vec<Truth> = Truth::ALL.into_iter().filter(|truth| !ELSEWHERE.contains(truth)).collect();
    truths.shuffle(&mut ChaCha8Rng::seed_from_u64(17));
    truths.truncate(truths.len() / 3);
    are_named(&truths);
}

#[test]
#[ignore = "at length: minutes; the sample above guards it"]
fn every_effect_is_named_at_length() {
    are_named(&Truth::ALL);
}
