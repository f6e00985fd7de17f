//! Datasets of LeRobot, versions 2 and 3 (<https://huggingface.co/docs/lerobot/lerobot-dataset-v3>):
//! `meta/info.json` and Parquet files below `data/`, whose columns are lists of numbers such as
//! `observation.state`.
//!
//! A list of k numbers is k columns `name1` … `namek`; where the file lies in a dataset, the names that
//! `meta/info.json` gives its numbers take the place of their count: `observation.state.shoulder_pan`, also
//! where it calls them `shoulder_pan.pos` and so on.
//!
//! The time of each episode begins at zero, one episode a file in version 2 and many in version 3: episodes
//! are put behind each other, some seconds apart, so that they are pieces of one log.

use super::columnar;
use super::contents::{Finding, Format, INFO, LogError, dataset};
use super::table::RowSink;
use serde_json::Value;
use std::fs::File;
use std::path::{Path, PathBuf};

/// From the end of an episode to the next one, s: a gap at any rate of samples that a log may have.
const BETWEEN: f64 = 10.0;
/// Folders above a file in which a dataset's description is looked for: data/chunk-000/ is two below it.
const ABOVE: usize = 4;

/// Hands the rows of all its episodes over, numbered through its files.
pub(crate) fn read(
    path: &Path,
    file: &str,
    rows: &mut impl RowSink,
    notes: &mut Vec<Finding>,
) -> Result<(), LogError> {
    let error = |what: String| LogError::of_file(file, "LeRobot", what);
    let folder = dataset(path).ok_or_else(|| error(format!("has no {INFO}")))?;
    let text = std::fs::read(folder.join(INFO)).map_err(|e| error(format!("{INFO} cannot be read: {e}")))?;
    let info: Value = serde_json::from_slice(&text).map_err(|e| error(format!("{INFO} is not JSON: {e}")))?;
    let files = numbered(&folder.join("data")).map_err(|e| error(format!("data/ cannot be read: {e}")))?;
    if files.is_empty() {
        return Err(error(
            "has no Parquet file in data/chunk-…/: download them, or convert the dataset to Parquet".into(),
        ));
    }
    let mut reader = columnar::Rows::new(rows);
    for path in &files {
        let own = path.display().to_string();
        // Among others the pointers that Git leaves where large files were not fetched.
        if Format::of_file(path)? != Format::Parquet {
            return Err(LogError::of_file(
                &own,
                "LeRobot",
                "is not a Parquet file: fetch the data of the dataset (git lfs pull)",
            ));
        }
        let opened =
            File::open(path).map_err(|e| LogError::of_file(&own, "file", format!("cannot be read: {e}")))?;
        reader.read(opened, &own)?;
    }
    let episodes = reader.finish()?;
    let said = info["total_episodes"].as_u64();
    if let Some(said) = said.filter(|said| *said != episodes as u64) {
        let what = format!("{INFO} lists {said} episodes, but {episodes} are there: these were read");
        notes.push(Finding::of_file(file, "LeRobot", what));
    }
    let fps = info["fps"].as_f64().map_or(String::new(), |fps| format!(" at {fps} Hz"));
    let what = format!(
        "{episodes} episodes, each a piece of the log; their time stamps are those of even frames{fps} \
         unless the recorder gave its own"
    );
    notes.push(Finding::of_file(file, "LeRobot", what));
    Ok(())
}

/// The Parquet files two folders deep by the numbers in their names: chunk-2/ is before chunk-10/.
fn numbered(data: &Path) -> std::io::Result<Vec<PathBuf>> {
    let number = |path: &Path| -> u64 {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let digits = stem.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
        digits.parse().unwrap_or(0)
    };
    let mut files = Vec::new();
    for chunk in std::fs::read_dir(data)? {
        let chunk = chunk?.path();
        for entry in chunk.is_dir().then(|| std::fs::read_dir(&chunk)).transpose()?.into_iter().flatten() {
            let path = entry?.path();
            if path.extension().is_some_and(|ending| ending == "parquet") {
                files.push((number(&chunk), number(&path), path));
            }
        }
    }
    files.sort();
    Ok(files.into_iter().map(|(_, _, path)| path).collect())
}

/// A file whose episodes follow each other, or another one.
pub(super) struct Dataset {
    /// The place of the episodes' number and time among the columns.
    at: Option<(usize, usize)>,
    /// The number of the present one, and its last time.
    last: Option<(f64, f64)>,
    /// Shift that is added to times, s.
    shift: f64,
    /// How many there were.
    pub(super) episodes: usize,
}

impl Dataset {
    /// The names of the numbers in a file's columns, each with how many a list of it has, and how they follow
    /// each other.
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
            match listed.filter(|listed| listed.len() == width && all_differ(listed)) {
                Some(listed) => names.extend(listed.iter().map(|own| format!("{name}.{own}"))),
                None => names.extend((1..=width).map(|k| format!("{name}{k}"))),
            }
        }
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        let at = place("episode_index").zip(place("timestamp"));
        (names, Dataset { at, last: None, shift: 0.0, episodes: 0 })
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
            match self.last {
                Some((before, _)) if before == episode => {}
                Some((_, end)) => {
                    self.shift = end + BETWEEN - own;
                    self.episodes += 1;
                }
                None => self.episodes += 1,
            }
            self.last = Some((episode, own + self.shift));
            columns[time][k] = own + self.shift;
        }
    }
}

/// The description in a dataset of LeRobot's, where a file is part of one.
fn description(file: &Path) -> Option<Value> {
    let folders = file.ancestors().skip(1).take(ABOVE);
    let text = folders.map(|folder| folder.join(INFO)).find_map(|f| std::fs::read(f).ok())?;
    serde_json::from_slice(&text).ok()
}

/// Whether names are names: some datasets call two grippers the same.
fn all_differ(names: &[String]) -> bool {
    names.iter().enumerate().all(|(k, name)| !names[..k].contains(name))
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
