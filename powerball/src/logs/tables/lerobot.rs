//! A Parquet file of a LeRobot dataset, whose columns are lists of numbers: `observation.state`.
//!
//! A list of k numbers is k columns `name1` … `namek`; where the file lies in a dataset of LeRobot's, the names that
//! `meta/info.json` gives its numbers take the place of their count: `observation.state.shoulder_pan`, also where it
//! calls them `shoulder_pan.pos` and so on.
//!
//! Such a file holds many episodes, and the time of each begins at zero: episodes are put behind each other, a second
//! apart, so that they are pieces of one log.

use serde_json::Value;
use std::path::Path;

/// From the end of an episode to the next one, s.
const BETWEEN: f64 = 1.0;
/// Folders above a file in which a dataset's description is looked for: data/chunk-000/ is two below it.
const ABOVE: usize = 4;

/// A file whose episodes follow each other, or another one.
pub(super) struct Dataset {
    /// Their number's and their time's place among the columns.
    at: Option<(usize, usize)>,
    /// The number of the present one, and its last time.
    last: Option<(f64, f64)>,
    /// What is added to times, s.
    shift: f64,
}

impl Dataset {
    /// The names of the numbers in a file's columns, each with how many a list of it has, and how they follow each other.
    pub(super) fn of<'n>(
        file: &Path,
        columns: impl Iterator<Item = (&'n str, Option<usize>)> + Clone,
    ) -> (Vec<String>, Dataset) {
        let lists = columns.clone().any(|(_, width)| width.is_some());
        let info = if lists { description(file) } else { None };
        let mut names = Vec::new();
        for (name, width) in columns {
            let Some(width) = width else {
                names.push(name.to_string());
                continue;
            };
            let listed = info.as_ref().and_then(|info| listed(&info["features"][name]["names"]));
            match listed.filter(|listed| listed.len() == width) {
                Some(listed) => names.extend(listed.iter().map(|own| format!("{name}.{own}"))),
                None => names.extend((1..=width).map(|k| format!("{name}{k}"))),
            }
        }
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        let at = place("episode_index").zip(place("timestamp"));
        (names, Dataset { at, last: None, shift: 0.0 })
    }

    /// Puts the times of the next rows behind those of the rows before.
    pub(super) fn follow(&mut self, columns: &mut [Vec<f64>]) {
        let Some((episode, time)) = self.at else { return };
        let rows = columns.get(episode).map_or(0, Vec::len);
        for k in 0..rows {
            let (episode, own) = (columns[episode][k], columns[time][k]);
            if episode.is_nan() || own.is_nan() {
                continue;
            }
            if let Some((_, end)) = self.last.filter(|(before, _)| *before != episode) {
                self.shift = end + BETWEEN - own;
            }
            self.last = Some((episode, own + self.shift));
            columns[time][k] = own + self.shift;
        }
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
