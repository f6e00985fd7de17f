//! Drawn arms on which a name was false once.

use super::case::{Case, Table};
use super::experiment::Bench;

/// The names that the first case of a seed gets.
fn names(table: Table, seed: u64) -> Vec<String> {
    let case = Case::all(table, Some(seed..seed + 1)).remove(0);
    let outcome = Bench::new().unwrap().run(&case).unwrap().unwrap();
    outcome.named.into_iter().map(|named| named.effect).collect()
}

/// A base model that is wrong on a new path, here for the zeros of the torque sensors, shows no payload
/// there.
#[test]
fn an_error_on_a_new_path_is_no_payload() {
    let names = names(Table::CleanDrawn, 513);
    assert!(names.is_empty(), "{names:?}");
}

/// Once what else is there is known, a stiffness that was found in addition to a sensor's zero is needed no
/// more.
#[test]
fn a_zero_is_no_spring() {
    let names = names(Table::Drawn, 515);
    assert!(
        names.iter().all(|name| name != "spring") && names.iter().any(|name| name == "hysteresis"),
        "{names:?}"
    );
}

/// Nor does a base model that lacks something: once its tilt and its warmth are known, the log to judge on
/// needs no body.
#[test]
fn what_lacks_an_effect_is_no_body_in_the_log_to_judge_on() {
    let names = names(Table::Drawn, 127);
    let there = |name: &str| names.iter().any(|other| other == name);
    assert!(there("base_tilt") && there("temperature") && !there("payload"), "{names:?}");
}
