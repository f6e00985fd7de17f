//! Columns of other names: `time`, `joint_1_pos`, `actual_q_0`. What they are by the words in their names, as
//! a column map.
//!
//! A quantity is a family of columns whose names differ by one number, which counts all joints from 1 or from
//! 0, or by the joints' names. Where every quantity has one family the log is read so, with a note; else all
//! that is possible is proposed.

use super::columns::{Asked, group};
use super::map::{ByJoint, ColumnMap};
use std::collections::BTreeMap;

/// Words that name a quantity; a name with those of two quantities names none.
const WORDS: [(&str, &[&str]); 5] = [
    ("dq", &["dq", "qd", "qdot", "vel", "velocity", "velocities", "speed"]),
    ("tau", &["tau", "torque", "torques", "trq", "effort", "efforts"]),
    ("i", &["i", "current", "currents", "curr"]),
    ("temp", &["temp", "temperature", "temperatures"]),
    ("q", &["q", "pos", "position", "positions", "angle", "angles"]),
];
/// Words of what was asked for, computed or summed up, and not measured as it is.
const OTHERS: &[&str] = &[
    "target",
    "goal",
    "cmd",
    "command",
    "commanded",
    "desired",
    "des",
    "ref",
    "reference",
    "setpoint",
    "error",
    "err",
    "std",
    "min",
    "max",
    "limit",
    "enable",
    "enabled",
    "acc",
    "acceleration",
    "ddq",
    "qdd",
    "ext",
    "external",
    "tcp",
    "cartesian",
    "x",
    "y",
    "z",
];
/// Words that the name of a time has, with its unit where they say one.
const TIMES: [(&str, Option<&str>); 14] = [
    ("t", None),
    ("time", None),
    ("timestamp", None),
    ("stamp", None),
    ("header", None),
    ("s", None),
    ("sec", None),
    ("seconds", None),
    ("ms", Some("ms")),
    ("milliseconds", Some("ms")),
    ("us", Some("us")),
    ("microseconds", Some("us")),
    ("ns", Some("ns")),
    ("nanoseconds", Some("ns")),
];
/// Words that say a unit of a quantity.
const UNITS: [(&str, &str, &str); 6] = [
    ("q", "deg", "deg"),
    ("q", "degrees", "deg"),
    ("dq", "deg", "deg/s"),
    ("dq", "degrees", "deg/s"),
    ("tau", "mnm", "mN·m"),
    ("i", "ma", "mA"),
];

/// What the names say where the usual ones are missing.
pub(super) enum Headers {
    /// Nothing: the usual names are there, or no others either.
    Plain,
    /// Each quantity once: the map with it, and how it is written.
    Clear(Box<ColumnMap>, String),
    /// Something of it, not all or not once.
    Unclear(String),
}

/// Reads the names of a table's columns.
pub(super) fn of(names: &[String], asked: Asked<'_>) -> Headers {
    let mut map = asked.map.clone();
    let (mut lines, mut clear) = (Vec::new(), true);
    if map.t.column.is_none() && !names.iter().any(|name| name == "t") {
        let times = times(names);
        clear &= times.len() == 1;
        if let [(name, unit)] = times.as_slice() {
            map.t.column = Some(ByJoint::All(name.to_string()));
            map.t.unit = map.t.unit.or(unit.map(|unit| ByJoint::All(unit.to_string())));
        }
        for (name, unit) in times {
            lines.push(format!("t.column = \"{name}\""));
            lines.extend(unit.map(|unit| format!("t.unit = \"{unit}\"")));
        }
    }
    let families = families(names, asked);
    for (key, _) in WORDS {
        let of_key: Vec<&Family> = families.iter().filter(|family| family.key == key).collect();
        if map.of(key).column.is_some() || of_key.is_empty() || group(names, key, asked).is_ok() {
            continue;
        }
        // What the fit does not need is taken where it is clear, and is no reason to ask.
        let needed = matches!(key, "q" | "tau");
        if let [one] = of_key.as_slice() {
            let mapped = map.of_mut(key);
            mapped.column = Some(ByJoint::Each(one.columns.clone()));
            mapped.unit = mapped.unit.take().or(one.unit.map(|unit| ByJoint::All(unit.to_string())));
        }
        clear &= of_key.len() == 1 || !needed;
        for family in of_key.iter().filter(|_| of_key.len() == 1 || needed) {
            let columns: Vec<String> = family.columns.iter().map(|name| format!("\"{name}\"")).collect();
            lines.push(format!("{key}.column = [{}]", columns.join(", ")));
            lines.extend(family.unit.map(|unit| format!("{key}.unit = \"{unit}\"")));
        }
    }
    if lines.is_empty() {
        return Headers::Plain;
    }
    let text = lines.iter().map(|line| format!("--map '{line}'")).collect::<Vec<_>>().join(" ");
    let with = Asked { map: &map, ..asked };
    let has = |key: &str| group(names, key, with).is_ok();
    match clear && has("q") && (has("tau") || has("i")) {
        true => Headers::Clear(Box::new(map), text),
        false => Headers::Unclear(text),
    }
}

/// The columns that may be the time, with the unit that their name says.
fn times(names: &[String]) -> Vec<(&str, Option<&'static str>)> {
    let unit = |name: &String| -> Option<Option<&'static str>> {
        let words = words(name);
        let known = |word: &String| TIMES.iter().find(|(own, _)| own == word).map(|(_, unit)| *unit);
        let units: Vec<Option<&str>> = words.iter().map(known).collect::<Option<_>>()?;
        let is_time = words.iter().any(|word| TIMES[..4].iter().any(|(own, _)| own == word));
        is_time.then(|| units.into_iter().flatten().next())
    };
    names.iter().filter_map(|name| Some((name.as_str(), unit(name)?))).collect()
}

/// Columns of one quantity, one a joint.
struct Family {
    key: &'static str,
    columns: Vec<String>,
    unit: Option<&'static str>,
}

/// All families that have a column for each joint and no other.
fn families(names: &[String], asked: Asked<'_>) -> Vec<Family> {
    let n = asked.arm.dof();
    // What is before and behind the number, and the columns by it.
    let mut found: BTreeMap<(&str, &str), BTreeMap<usize, &String>> = BTreeMap::new();
    for name in names {
        for (from, to) in numbers(name) {
            if let Ok(number) = name[from..to].parse() {
                found.entry((&name[..from], &name[to..])).or_default().insert(number, name);
            }
        }
        for (j, joint) in asked.arm.moving_joints().enumerate() {
            let own = joint.name.as_deref().filter(|own| !own.is_empty());
            if let Some(at) = own.and_then(|own| Some((name.find(own)?, own.len()))) {
                found.entry((&name[..at.0], &name[at.0 + at.1..])).or_default().insert(j + 1, name);
            }
        }
        if n == 1 {
            found.entry((name, "")).or_default().insert(1, name);
        }
    }
    let mut families: Vec<Family> = Vec::new();
    for ((before, behind), columns) in &found {
        let whole = columns.keys().copied().eq(1..=n) || columns.keys().copied().eq(0..n);
        let words = words(&format!("{before} {behind}"));
        if !whole || words.iter().any(|word| OTHERS.contains(&word.as_str())) {
            continue;
        }
        let is_of = |own: &&[&str]| words.iter().any(|word| own.contains(&word.as_str()));
        let keys: Vec<&'static str> =
            WORDS.iter().filter(|(_, own)| is_of(own)).map(|(key, _)| *key).collect();
        let [key] = keys[..] else { continue };
        let unit = UNITS.iter().find(|(of, word, _)| *of == key && words.iter().any(|own| own == word));
        let columns: Vec<String> = columns.values().map(|name| name.to_string()).collect();
        // A name with two numbers may be read both ways to the same columns.
        if !families.iter().any(|family| family.columns == columns) {
            families.push(Family { key, columns, unit: unit.map(|(_, _, unit)| *unit) });
        }
    }
    families
}

/// Where the numbers of a name stand.
fn numbers(name: &str) -> Vec<(usize, usize)> {
    let (mut found, mut from) = (Vec::new(), None);
    for (k, c) in name.char_indices().chain([(name.len(), ' ')]) {
        match (c.is_ascii_digit(), from) {
            (true, None) => from = Some(k),
            (false, Some(start)) => {
                found.push((start, k));
                from = None;
            }
            _ => {}
        }
    }
    found
}

/// The words of a name in small letters: what stands between other characters, numbers, and where a capital
/// letter begins.
fn words(name: &str) -> Vec<String> {
    let (mut words, mut small) = (vec![String::new()], false);
    for c in name.chars() {
        if !c.is_alphabetic() || (c.is_uppercase() && small) {
            words.push(String::new());
        }
        if let Some(last) = words.last_mut().filter(|_| c.is_alphabetic()) {
            last.extend(c.to_lowercase());
        }
        small = c.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}
