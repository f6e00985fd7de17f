//! Rows of Parquet whose columns may be lists of numbers, as those of LeRobot's datasets are: `observation.state`.
//!
//! A list of k numbers is k columns `name1` … `namek`; where the file lies in a dataset of LeRobot's, the names that
//! `meta/info.json` gives its numbers take the place of their count: `observation.state.shoulder_pan`, also where it
//! calls them `shoulder_pan.pos` and so on.
//!
//! Such a file holds many episodes, and the time of each begins at zero: episodes are put behind each other, a second
//! apart, so that they are pieces of one log.

use parquet::record::{Field, Row};
use serde_json::Value;
use std::path::Path;

/// From the end of an episode to the next one, s.
const BETWEEN: f64 = 1.0;
/// Folders above a file in which a dataset's description is looked for: data/chunk-000/ is two below it.
const ABOVE: usize = 4;

/// How rows become numbers.
pub(super) struct Flattened {
    names: Vec<String>,
    /// How many numbers each field is.
    widths: Vec<usize>,
    episodes: Option<Episodes>,
}

/// Where episodes follow each other in a file.
struct Episodes {
    /// Their number's and their time's place among the numbers.
    at: [usize; 2],
    /// The number of the present one, and its last time.
    last: Option<(f64, f64)>,
    /// What is added to times, s.
    shift: f64,
}

impl Flattened {
    /// By the first row of a file.
    pub(super) fn of(fields: &[String], first: &Row, file: &Path) -> Flattened {
        let widths: Vec<usize> = first.get_column_iter().map(|(_, field)| width(field)).collect();
        let lists: Vec<bool> = first.get_column_iter().map(|(_, field)| is_list(field)).collect();
        let info = if lists.contains(&true) { description(file) } else { None };
        let mut names = Vec::new();
        for ((name, list), width) in fields.iter().zip(lists).zip(&widths) {
            let listed = info.as_ref().and_then(|info| listed(&info["features"][name]["names"]));
            match listed.filter(|listed| list && listed.len() == *width) {
                Some(listed) => names.extend(listed.iter().map(|own| format!("{name}.{own}"))),
                None if list => names.extend((1..=*width).map(|k| format!("{name}{k}"))),
                None => names.push(name.clone()),
            }
        }
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        let episodes = place("episode_index").zip(place("timestamp"));
        let episodes = episodes.map(|(a, b)| Episodes { at: [a, b], last: None, shift: 0.0 });
        Flattened { names, widths, episodes }
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The numbers of the next row.
    pub(super) fn values(&mut self, row: &Row) -> Vec<Option<f64>> {
        let mut values = Vec::with_capacity(self.names.len());
        for ((_, field), width) in row.get_column_iter().zip(&self.widths) {
            match field {
                Field::ListInternal(list) => {
                    values.extend((0..*width).map(|k| list.elements().get(k).and_then(number)));
                }
                _ if *width == 1 => values.push(number(field)),
                // A list that is missing.
                _ => values.extend((0..*width).map(|_| None)),
            }
        }
        if let Some(episodes) = &mut self.episodes {
            episodes.follow(&mut values);
        }
        values
    }
}

impl Episodes {
    fn follow(&mut self, values: &mut [Option<f64>]) {
        let [episode, time] = self.at.map(|at| values.get(at).copied().flatten());
        let (Some(episode), Some(time)) = (episode, time) else { return };
        if let Some((_, end)) = self.last.filter(|(before, _)| *before != episode) {
            self.shift = end + BETWEEN - time;
        }
        self.last = Some((episode, time + self.shift));
        values[self.at[1]] = Some(time + self.shift);
    }
}

/// The number in a field, where it is one.
fn number(field: &Field) -> Option<f64> {
    match *field {
        Field::Double(x) => Some(x),
        Field::Float(x) => Some(f64::from(x)),
        Field::Int(x) => Some(f64::from(x)),
        Field::UInt(x) => Some(f64::from(x)),
        Field::Long(x) => Some(x as f64),
        Field::ULong(x) => Some(x as f64),
        Field::Short(x) => Some(f64::from(x)),
        Field::UShort(x) => Some(f64::from(x)),
        Field::Byte(x) => Some(f64::from(x)),
        Field::UByte(x) => Some(f64::from(x)),
        _ => None,
    }
}

fn is_list(field: &Field) -> bool {
    matches!(field, Field::ListInternal(_))
}

fn width(field: &Field) -> usize {
    match field {
        Field::ListInternal(list) => list.len(),
        _ => 1,
    }
}

/// What a dataset of LeRobot's says of itself, where a file is part of one.
fn description(file: &Path) -> Option<Value> {
    let folders = file.ancestors().skip(1).take(ABOVE);
    let text = folders.map(|folder| folder.join("meta/info.json")).find_map(|f| std::fs::read(f).ok())?;
    serde_json::from_slice(&text).ok()
}

/// Names of the numbers of a list: a list of them, or one within a group such as "motors".
fn listed(names: &Value) -> Option<Vec<String>> {
    let list = names.as_array().or_else(|| names.as_object()?.values().find_map(Value::as_array))?;
    let names: Vec<&str> = list.iter().map(Value::as_str).collect::<Option<_>>()?;
    // "shoulder_pan.pos", "elbow.pos": what all end with is the quantity, and the rest the joint.
    let quantity = names.first().and_then(|name| name.rsplit_once('.')).map(|(_, last)| format!(".{last}"));
    let joints: Option<Vec<&str>> =
        quantity.and_then(|end| names.iter().map(|name| name.strip_suffix(end.as_str())).collect());
    Some(joints.unwrap_or(names).into_iter().map(str::to_string).collect())
}
