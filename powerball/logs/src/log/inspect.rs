//! What is in a file and what it is taken to be, before anybody uses it.

use super::columns::meaning;
use super::map::{Clock, ColumnMap, time_unit};
use super::topics::{Alignment, alignment, clock};
use super::{Finding, Log, LogError, read_log_as};
use crate::signal::resample::median_step;
use crate::tables::{Column, Contents, Format, Table, read_contents};
use dyngen::Arm;
use serde::Serialize;
use std::path::Path;

/// A step longer than this many median steps is reported as a gap.
const GAP_STEPS: f64 = 5.0;
/// Angles beyond this, rad, are degrees.
const FAR: f64 = 4.0 * std::f64::consts::PI;

/// A file as `powerball log` shows it.
#[derive(Clone, Debug, Serialize)]
pub struct Inspected {
    /// The file's name.
    pub file: String,
    /// How it is stored.
    pub format: Format,
    /// The file's tables: one, or one a topic.
    pub tables: Vec<InspectedTable>,
    /// How the topics that hold numbers lie in time, two by two.
    pub alignment: Vec<Aligned>,
    /// The log of the arm that it is taken for, where an arm was given and it is one.
    pub taken_as: Option<TakenAs>,
    /// Why it is none.
    pub refused: Vec<String>,
    /// What is odd about it.
    #[serde(rename = "doubts")]
    pub warnings: Vec<String>,
    /// The log itself, for figures.
    #[serde(skip)]
    pub log: Option<Log>,
}

/// One table of a file.
#[derive(Clone, Debug, Serialize)]
pub struct InspectedTable {
    /// The table's topic; empty where the file has one table only.
    pub name: String,
    /// The type of its messages, or what its samples are.
    #[serde(rename = "type")]
    pub kind: String,
    /// How many there are.
    pub samples: usize,
    /// Which time counts: "header", "receipt" or the column's name; none where there is no time.
    pub clock: Option<String>,
    /// Why it is not the header's.
    pub clock_doubt: Option<String>,
    /// From its header's time stamp to the receipt of a message, median, s.
    pub delay: Option<f64>,
    /// First time, s.
    pub start: Option<f64>,
    /// From first to last, s.
    pub duration: Option<f64>,
    /// Samples a second, by the median step.
    pub rate: Option<f64>,
    /// Steps longer than five median steps.
    pub gaps: usize,
    /// The longest step, s.
    pub longest_step: Option<f64>,
    /// Steps that do not rise; of messages those that run back, as publishers that share a topic may speak at
    /// once.
    pub not_rising: usize,
    /// The names of its joints, or their numbers, in the order of its columns.
    pub joints: Vec<String>,
    /// The table's columns.
    pub columns: Vec<InspectedColumn>,
    /// The time of every sample, s, for figures; empty where there is no time.
    #[serde(skip)]
    pub times: Vec<f64>,
}

/// One column of a table.
#[derive(Clone, Debug, Serialize)]
pub struct InspectedColumn {
    /// The column's name.
    pub name: String,
    /// What it is taken to be: `t`, `q`, `dq`, `tau`, `i`, `temp`, `motor`; none where it is left aside.
    pub quantity: Option<&'static str>,
    /// Of which joint.
    pub joint: Option<String>,
    /// The column's unit: given by the map, or guessed from the numbers.
    pub unit: Option<String>,
    /// The smallest value.
    pub min: Option<f64>,
    /// The largest.
    pub max: Option<f64>,
    /// Samples without a number.
    pub missing: usize,
    /// What is taken for a quantity of a joint, sample by sample, for figures; empty of all else.
    #[serde(skip)]
    pub values: Vec<f64>,
}

/// Two topics in time.
#[derive(Clone, Debug, Serialize)]
pub struct Aligned {
    /// One topic.
    pub a: String,
    /// The other.
    pub b: String,
    /// How they lie.
    #[serde(flatten)]
    pub alignment: Alignment,
}

/// The log that a file is taken for.
#[derive(Clone, Debug, Serialize)]
pub struct TakenAs {
    /// The arm's name.
    pub arm: String,
    /// Usable samples.
    pub samples: usize,
    /// Pieces without a gap.
    pub pieces: usize,
    /// From first to last, s.
    pub duration: f64,
    /// The smallest and largest position by joint, rad or m.
    pub positions: Vec<[f64; 2]>,
    /// The smallest and largest torque by joint, N·m or N.
    pub torques: Vec<[f64; 2]>,
    /// Whether torques on the motors' side are there as well.
    pub motor: bool,
}

/// Looks into a file; with an arm also at what its log would be.
///
/// # Errors
/// Where the file cannot be read at all.
pub fn inspect(path: &Path, map: &ColumnMap, arm: Option<&Arm>) -> Result<Inspected, LogError> {
    let Contents { format, tables, notes } = read_contents(path)?;
    let alignment = aligned(&tables, map);
    let mut inspected = Inspected {
        file: path.display().to_string(),
        format,
        tables: tables.into_iter().map(|t| table(t, map)).collect(),
        alignment,
        taken_as: None,
        refused: Vec::new(),
        warnings: Vec::new(),
        log: None,
    };
    let Some(arm) = arm else {
        inspected.warnings = shown(&notes);
        return Ok(inspected);
    };
    let mut findings = Vec::new();
    match read_log_as(path, arm, map, &mut findings) {
        Ok(log) => {
            inspected.taken_as = Some(taken_as(&log, arm));
            inspected.log = Some(log);
        }
        Err(LogError(reasons)) => inspected.refused = shown(&reasons),
    }
    inspected.warnings = shown(&findings);
    Ok(inspected)
}

fn shown(findings: &[Finding]) -> Vec<String> {
    findings.iter().map(ToString::to_string).collect()
}

fn taken_as(log: &Log, arm: &Arm) -> TakenAs {
    let ranges = |signals: &[Vec<f64>]| signals.iter().map(|x| range(x).unwrap_or([f64::NAN; 2])).collect();
    TakenAs {
        arm: arm.name.clone(),
        samples: log.t.len(),
        pieces: log.pieces.len(),
        duration: log.t.last().unwrap_or(&0.0) - log.t.first().unwrap_or(&0.0),
        positions: ranges(&log.q),
        torques: ranges(&log.torque),
        motor: log.motor.is_some(),
    }
}

fn range(values: &[f64]) -> Option<[f64; 2]> {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    Some([finite().reduce(f64::min)?, finite().reduce(f64::max)?])
}

/// The time of a table, s, and what it is.
fn time<'a>(table: &'a Table, map: &ColumnMap) -> Option<(Vec<f64>, String, Option<String>)> {
    let column = |column: &&'a Column| meaning(&column.name, map).is_some_and(|(key, _)| key == "t");
    let stamped = table.stamps.iter().any(|s| s.is_finite());
    let own = table.columns.iter().find(column).filter(|_| table.received.is_empty() || !stamped);
    if let Some(own) = own.filter(|_| map.clock == Clock::Auto) {
        let factor = map.t.factor("t", 0, false);
        return Some((own.values.iter().map(|t| t * factor).collect(), own.name.clone(), None));
    }
    if table.received.is_empty() {
        return None;
    }
    let (time, name, doubt) = clock(table, map.clock);
    Some((time.to_vec(), name.to_string(), doubt))
}

fn table(table: Table, map: &ColumnMap) -> InspectedTable {
    let (t, clock, clock_doubt) = match time(&table, map) {
        Some((t, clock, doubt)) => (t, Some(clock), doubt),
        None => (Vec::new(), None, None),
    };
    let step = median_step(&t);
    let mut delays: Vec<f64> =
        table.stamps.iter().zip(&table.received).map(|(s, r)| r - s).filter(|d| d.is_finite()).collect();
    delays.sort_by(f64::total_cmp);
    let steps = || t.windows(2).map(|w| w[1] - w[0]);
    let mut joints: Vec<String> = Vec::new();
    let columns: Vec<InspectedColumn> = table.columns.into_iter().map(|c| column(c, map, step)).collect();
    for joint in columns.iter().filter_map(|c| c.joint.clone()) {
        if !joints.contains(&joint) {
            joints.push(joint);
        }
    }
    InspectedTable {
        name: table.name,
        kind: table.kind,
        samples: table.line.len(),
        clock,
        clock_doubt,
        delay: delays.get(delays.len() / 2).copied(),
        start: t.first().copied(),
        duration: t.last().zip(t.first()).map(|(last, first)| last - first),
        rate: step.map(|step| 1.0 / step),
        gaps: step.map_or(0, |step| steps().filter(|s| *s > GAP_STEPS * step).count()),
        longest_step: steps().reduce(f64::max),
        not_rising: steps().filter(|s| *s < 0.0 || (*s == 0.0 && table.received.is_empty())).count(),
        joints,
        columns,
        times: t,
    }
}

fn column(column: Column, map: &ColumnMap, step: Option<f64>) -> InspectedColumn {
    let means = meaning(&column.name, map);
    let range = range(&column.values);
    let quantity = means.as_ref().map(|(key, _)| *key);
    let said = quantity.and_then(|key| map.of(key).unit.as_ref()?.of(0).cloned());
    let joint = means.as_ref().is_some_and(|(_, joint)| joint.is_some());
    let guess = |key| guessed(key, range?, &column.values, step);
    InspectedColumn {
        name: column.name,
        quantity,
        joint: means.and_then(|(_, joint)| joint),
        unit: said.or_else(|| quantity.and_then(guess).map(str::to_string)),
        min: range.map(|[min, _]| min),
        max: range.map(|[_, max]| max),
        missing: column.values.iter().filter(|v| !v.is_finite()).count(),
        values: if joint { column.values } else { Vec::new() },
    }
}

/// The unit that numbers look like.
fn guessed(key: &str, [min, max]: [f64; 2], values: &[f64], step: Option<f64>) -> Option<&'static str> {
    let far = max.abs().max(min.abs()) > FAR;
    Some(match key {
        "t" => time_unit(median_step(values).or(step)?),
        "q" if far => "deg",
        "q" => "rad",
        "dq" if far => "deg/s",
        "dq" => "rad/s",
        "tau" => "N·m",
        "i" => "A",
        "temp" => "°C",
        _ => return None,
    })
}

fn aligned(tables: &[Table], map: &ColumnMap) -> Vec<Aligned> {
    let of_joints = |t: &&Table| t.columns.iter().any(|c| meaning(&c.name, map).is_some());
    let timed: Vec<(&str, Vec<f64>)> = tables
        .iter()
        .filter(of_joints)
        .filter_map(|t| Some((t.name.as_str(), rising(time(t, map)?.0))))
        .collect();
    let mut pairs = Vec::new();
    for (k, (a, ta)) in timed.iter().enumerate() {
        for (b, tb) in &timed[k + 1..] {
            let pair = |alignment| Aligned { a: a.to_string(), b: b.to_string(), alignment };
            pairs.extend(alignment(ta, tb).map(pair));
        }
    }
    pairs
}

fn rising(mut t: Vec<f64>) -> Vec<f64> {
    let mut latest = f64::NEG_INFINITY;
    t.retain(|t| {
        let rises = *t > latest;
        latest = latest.max(*t);
        rises
    });
    t
}
