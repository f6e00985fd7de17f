//! Names that are looked for again on fewer logs.

use super::small_arms::{explained_with, planar, recorded};
use crate::explain::Again;
use crate::explain::again::find_again;
use crate::{ExplainError, ExplainOptions, Rule};
use powerball_logs::log::Log;
use powerball_logs::regression::DataError;
use powerball_virtual_arm::PlantEffect as Effect;
use std::cell::Cell;

#[test]
fn what_is_in_all_logs_is_found_without_each_and_what_is_in_one_is_not_asked() {
    let (arm, plant) = planar();
    let payload = Effect::Payload { mass: 0.2, centre: [0.05, 0.02, 0.0], start: 0.0 };
    let friction = Effect::LoadFriction { joint: 0, coefficient: 0.3 };
    let logs = recorded(&arm, &plant, &[(friction, &[0, 1, 2, 3, 4, 5]), (payload, &[1])]);
    let options = ExplainOptions { leave_one_out: true, ..ExplainOptions::default() };
    let explained = explained_with(&arm, logs, &options);
    let again = |name: &str| explained.effects.iter().find(|e| e.effect == name).unwrap().again;
    assert_eq!(again("load_friction"), Some(Again { found: 4, of: 4 }));
    assert_eq!(again("payload"), None);
    assert!(explained.effects.iter().all(|effect| !effect.in_some_logs));
}

/// A name that one search of three gives is marked; a search that has no result is not counted.
#[test]
fn what_few_searches_give_is_marked() {
    let (arm, plant) = planar();
    let friction = Effect::LoadFriction { joint: 0, coefficient: 0.3 };
    let logs = recorded(&arm, &plant, &[(friction, &[0, 1, 2, 3, 4, 5])]);
    let options = ExplainOptions::default();
    let whole = explained_with(&arm, logs.clone(), &options);
    let number = Cell::new(0);
    let search = |others: &[Log], _: &ExplainOptions<'_>| {
        assert_eq!(others.len(), 3);
        let mut explained = whole.clone();
        match number.replace(number.get() + 1) {
            0 => return Err(ExplainError::Fit(DataError::TooShort)),
            1 => {}
            _ => explained.effects.clear(),
        }
        Ok(explained)
    };
    let mut explained = whole.clone();
    find_again(search, &logs[..4], &options, &mut explained).unwrap();
    assert_eq!(explained.effects[0].again, Some(Again { found: 1, of: 3 }));
    assert!(explained.effects[0].in_some_logs);
}

#[test]
fn a_name_is_in_some_logs_where_no_more_than_half_of_the_searches_give_it() {
    let rule = Rule::default();
    let is = |found, of| Again { found, of }.is_in_some(&rule);
    assert_eq!([is(0, 2), is(1, 2), is(2, 2)], [true, true, false]);
    assert_eq!([is(1, 3), is(2, 3), is(2, 4), is(3, 4)], [true, false, true, false]);
}
