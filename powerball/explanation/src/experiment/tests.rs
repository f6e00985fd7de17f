//! A hose that pulls nearly evenly over narrow paths: the logs cannot say whether it is a spring, and the
//! experiment can.

use super::{TRAJECTORY, design, learn, propose};
use crate::ExplainOptions;
use crate::explain::{Explained, explain_body};
use dyngen::{Model, SetKind};
use powerball_controller::JointNumber;
use powerball_identification::excite::{ExcitationSettings, Limits, optimise};
use powerball_logs::log::{Log, common_clock};
use powerball_logs::motion::Motion;
use powerball_logs::regression::RigidArm;
use powerball_virtual_arm::{Plant, PlantEffect as Effect, lwa4p};

/// Logs along paths that leave most of every joint's range unused, and what they say.
fn session(plant: &Plant, body: &RigidArm) -> (Vec<Log>, Vec<Log>, Explained) {
    let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
    let mut logs: Vec<Log> = (0..5)
        .map(|seed| {
            let settings = ExcitationSettings {
                margin: 0.8,
                harmonics: 5,
                evaluations: 60,
                seed,
                ..ExcitationSettings::default()
            };
            let path = optimise(&model, SetKind::Minimal, &settings).unwrap().paths.swap_remove(0);
            log(plant, &path.sample(200.0), seed)
        })
        .collect();
    common_clock(&mut logs);
    let held_out = logs.split_off(4);
    let explained = explain_body(body, &logs, &held_out, &ExplainOptions::default()).unwrap();
    (logs, held_out, explained)
}

fn log(plant: &Plant, motion: &Motion, seed: u64) -> Log {
    plant.record(motion, 0.0, seed).log(format!("log{seed}.csv"))
}

/// The other way round an experiment is run in `tests/demo_and_excite.rs`.
#[test]
fn an_experiment_is_designed_within_the_limits_and_decides_what_the_logs_left_open() {
    decides(Effect::Spring { joint: 0, stiffness: 0.4, rest: -2.0 }, "spring", "asymmetry");
}

#[test]
#[ignore = "at length: the one above guards it"]
fn an_experiment_decides_the_other_way_round_at_length() {
    decides(Effect::Asymmetry { joint: 0, share: 0.0, constant: 0.8 }, "asymmetry", "spring");
}

fn decides(effect: Effect, name: &str, other: &str) {
    let arm = lwa4p::arm().unwrap();
    let body = RigidArm::new(&arm).unwrap();
    let plant = lwa4p::plant().unwrap().with(effect);
    let (fit, held_out, mut explained) = session(&plant, &body);
    let open = explained.open.clone().expect("the narrow paths leave it open");
    let mut names = open.names();
    names.sort_unstable();
    assert_eq!(names, ["asymmetry", "spring"]);
    assert!(explained.experiment.is_none());

    let options = ExplainOptions::default();
    let designed = design(&body, &open, &options.data).unwrap();
    assert!(designed.evidence >= designed.usual, "{} {}", designed.evidence, designed.usual);
    assert!(designed.expected.iter().all(|d| d.is_finite()));
    // What only joint 1 feels shows on joint 1.
    assert!(designed.expected[0] > 10.0 * designed.expected[2], "{:?}", designed.expected);
    let motion = propose(&body, &mut explained, &options).unwrap();
    assert_eq!(motion, designed.motion, "the same question has the same answer");
    let limits = Limits::of(&arm, 0.0).unwrap();
    for [q, dq, ddq] in motion.samples() {
        for (i, limit) in limits.0.iter().enumerate() {
            assert!((limit.position[0]..limit.position[1]).contains(&q[i]));
            assert!(dq[i].abs() < limit.velocity && ddq[i].abs() < limit.acceleration);
        }
    }
    let next = serde_json::to_value(&explained.next_experiment).unwrap();
    assert_eq!(next["trajectory"], TRAJECTORY);
    assert_eq!(next["joints"], serde_json::json!([1]));

    let new = log(&plant, &motion, 99);
    let again = learn(&body, (&fit, &held_out), new, &explained, &options).unwrap();
    let experiment = serde_json::to_value(again.experiment.unwrap()).unwrap();
    assert_eq!(experiment["decided"], name, "{experiment}");
    assert_eq!(again.effects.len(), 1, "{:?}", again.unattributed);
    let first = JointNumber::from_index(0);
    assert_eq!((again.effects[0].effect.as_str(), again.effects[0].joints.as_slice()), (name, &[first][..]));
    let loser = again.effects[0].rivals.iter().find(|r| r.effect == other).unwrap();
    assert!(loser.why_not.contains("ruled out by the experiment"), "{}", loser.why_not);
}

#[test]
fn without_limits_there_is_advice_and_no_trajectory() {
    let plant = lwa4p::plant().unwrap().with(Effect::Asymmetry { joint: 0, share: 0.0, constant: 0.8 });
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let (_, _, mut explained) = session(&plant, &body);
    let mut arm = lwa4p::arm().unwrap();
    arm.joints[3].velocity = None;
    let body = RigidArm::new(&arm).unwrap();
    assert!(propose(&body, &mut explained, &ExplainOptions::default()).is_none());
    let next = serde_json::to_value(explained.next_experiment.unwrap()).unwrap();
    assert!(next["advice"].as_str().unwrap().contains("other positions"));
    assert!(next["no_trajectory"].as_str().unwrap().contains("joint 4: `velocity`"), "{next}");
}
