//! The meaning of the columns of a log: signs, units, order, side of the gear, gravity, delay. It is
//! reported; nothing is modified.
//!
//! Every answer is judged against its alternatives: by the held-out error of one rigid arm with textbook
//! friction, fitted to one part of the logs and judged by the other, both ways round; and by quantities that
//! cannot be negative, the energy of motion and the power that friction takes. An alternative is reported as
//! different from what is declared only if it halves the squared errors both ways round, or has a physical
//! sign that is certain in both parts.
//!
//! | | |
//! |---|---|
//! | `result`, `answers` | the result with the correcting column map; its words |
//! | `asked`, `fit` | logs made small, and a way to read their columns; its rows, and its residual |
//! | `physics`, `properties` | energies; unit, sign, side, kind, gravity and delay of the torques |
//! | `arm_file` | one change of the reading; whether the arm file is this arm's |
//! | `search` | the best reading |

mod answers;
mod arm_file;
mod asked;
mod fit;
mod physics;
mod properties;
mod result;
mod search;

use answers::{Facts, answers, plain};
use asked::Asked;
use powerball_controller::JointNumber;
use powerball_logs::log::{Doubt, Log};
use powerball_logs::regression::{RigidArm, inactive_joints};
use properties::{Common, Size, Unit};
pub use result::{Answer, Conventions, GravityIs, Kind, PerJoint, PositionColumns, Side, TorqueColumns};
use search::{Found, gravity_is, search};

/// Checks the meaning of the columns of some logs of an arm. `validate` are logs of another path, if there
/// are any; without them the halves of each log judge each other.
///
/// The check changes nothing and does not fail: if the logs hold too little, this is reported.
#[must_use]
pub fn conventions(body: &RigidArm, logs: &[Log], validate: &[Log]) -> Conventions {
    let mut result = asked_of_arm(body, logs, validate);
    // Doubts from the signals themselves need no arm.
    let mut doubts: Vec<&Doubt> = Vec::new();
    for doubt in logs.iter().chain(validate).flat_map(|log| &log.doubts) {
        if !doubts.contains(&doubt) {
            doubts.push(doubt);
        }
    }
    for doubt in doubts {
        result.answers.insert(0, plain("signals", Some(false), doubt.sentence.clone()));
        result.evidence = [doubt.sentence.as_str(), &result.evidence].join(" ");
        let lines = doubt.map.iter().cloned().chain(result.suggested_map.take());
        result.suggested_map = Some(lines.collect::<Vec<_>>().join("\n")).filter(|map| !map.is_empty());
    }
    result
}

fn asked_of_arm(body: &RigidArm, logs: &[Log], validate: &[Log]) -> Conventions {
    let asked = Asked::new(body, logs, validate);
    let found = match search(&asked) {
        Ok(found) => found,
        Err(why) => return not_determined(&why.to_string()),
    };
    let all: Vec<&Log> = logs.iter().chain(validate).collect();
    let kind = properties::kind(&all);
    // The pose of a joint that does not move is any angle of the arm file, and an arm file that describes no
    // arm was reported.
    let moves = inactive_joints(body.arm(), logs).iter().all(Option::is_none);
    let better =
        if moves && body.filed().doubts().is_empty() { arm_file::better(&asked, &found) } else { None };
    let Some(better) = better else { return result(&asked, &found, kind) };
    // The columns are evaluated with the arm that they fit.
    let answer = answers::of_arm_file(&better);
    let of_other = RigidArm::new(&better.change.arm).ok().and_then(|body| {
        let asked = Asked::new(&body, logs, validate);
        let found = search(&asked).ok()?;
        Some(result(&asked, &found, kind))
    });
    let mut result = of_other.unwrap_or_default();
    result.arm_file = Some(better.change.line);
    result.evidence = [answer.sentence.as_str(), &result.evidence].join(" ");
    result.answers.retain(|other| other.question != answer.question);
    result.answers.insert(0, answer);
    result
}

fn not_determined(why: &str) -> Conventions {
    let sentence = format!("What the columns are is not shown by these logs: {why}.");
    let answer = Answer {
        question: "columns",
        as_said: None,
        as_it_is: Vec::new(),
        as_it_would_be: Vec::new(),
        sentence: sentence.clone(),
    };
    Conventions { evidence: sentence, answers: vec![answer], ..Conventions::default() }
}

fn result(asked: &Asked<'_>, found: &Found<'_>, kind: Option<Kind>) -> Conventions {
    let read = &found.read;
    let sign = properties::common(&found.judged, &found.energies);
    let size = Size::of(found);
    let good = found.is_good();
    // A model that does not fit has no weight, and a balanced arm has little that still shows.
    let gravity = match (size.is_weightless(), good) {
        (true, false) => None,
        (true, true) => search::little_gravity_is(asked, found),
        (false, _) => gravity_is(asked, found),
    };
    let scale = size.scale(gravity);
    let doubts = asked.body.filed().doubts();
    // Nothing is too light or too heavy for an arm of another size.
    let unit = if doubts.is_empty() { properties::unit(found, scale) } else { Unit::Unknown };
    let share = properties::least_share(&found.rows, &read.torques, &found.judged, &found.energies);
    let share = share.filter(|_| good && sign != Common::Unknown);
    let facts = Facts {
        sign,
        unit: &unit,
        size,
        scale,
        gravity,
        side: share.and_then(properties::side),
        friction_share: share,
        kind,
        delay_would_show: good
            && properties::would_show(&found.rows, &read.torques, found.ridge, &found.judged),
        good,
        doubts: &doubts,
        coupled: asked.body.motors().is_some(),
    };
    let answers = answers(found, &facts);
    let sentences: Vec<&str> = answers.iter().map(|a| a.sentence.as_str()).collect();
    Conventions {
        torque: torque_columns(found, &facts),
        positions: position_columns(found, good),
        evidence: sentences.join(" "),
        suggested_map: result::suggested_map(read, sign, &unit),
        arm_file: (!doubts.is_empty()).then(|| doubts.join("; ")),
        left: search::shares(&found.judged),
        answers,
    }
}

fn torque_columns(found: &Found<'_>, facts: &Facts<'_>) -> TorqueColumns {
    let read = &found.read.torques;
    let all: i8 = if facts.sign == Common::Reversed { -1 } else { 1 };
    let signs: Vec<i8> = read.gain.iter().map(|g| if *g < 0.0 { -all } else { all }).collect();
    let sign = match signs.iter().all(|s| *s == signs[0]) {
        true => PerJoint::All(signs[0]),
        false => PerJoint::Each(signs),
    };
    // A tenth of a millisecond is more than is known.
    let late = (1e4 * read.late.first().copied().unwrap_or(0.0)).round() / 1e4;
    let unit = match facts.unit {
        Unit::NewtonMetre | Unit::OfItsOwn(_) => Some("N·m"),
        Unit::Milli => Some("mN·m"),
        Unit::BeforeGear(_) => Some("N·m before the gear"),
        Unit::Ampere(Some(_)) => Some("A"),
        Unit::Ampere(None) => Some("A, counts or % of rated"),
        Unit::GearOrAmpere => Some("N·m before the gear, or A"),
        Unit::Unknown => None,
    };
    TorqueColumns {
        sign: (facts.sign != Common::Unknown).then_some(sign),
        unit: unit.map(str::to_string),
        side: facts.side,
        gravity: facts.gravity,
        kind: facts.kind,
        delay: (late != 0.0 || facts.delay_would_show).then_some(PerJoint::All(late)),
        order: order(&read.column),
        factor: read.is_scaled().then(|| read.gain.iter().map(|g| g.abs()).collect()),
    }
}

fn position_columns(found: &Found<'_>, good: bool) -> PositionColumns {
    let read = &found.read.positions;
    let result = good || !read.is_plain();
    let unit = if read.scale == 1.0 { "rad" } else { "deg" };
    PositionColumns {
        sign: result.then(|| read.sign.iter().map(|s| if *s < 0.0 { -1 } else { 1 }).collect()),
        unit: result.then(|| unit.to_string()),
        order: order(&read.column),
    }
}

/// The columns by joint, where some are not their joint's own.
fn order(columns: &[usize]) -> Option<Vec<JointNumber>> {
    let own = columns.iter().enumerate().all(|(joint, column)| joint == *column);
    (!own).then(|| columns.iter().map(|c| JointNumber::from_index(*c)).collect())
}

#[cfg(test)]
mod tests;
