//! A log from the tables of a file: which topic has what, whose clock counts, and how topics are joined in
//! time.

use super::columns::{self, Asked};
use super::map::{Clock, ColumnMap};
use super::read::{Finish, Samples};
use super::{Finding, LogError};
use crate::signal::resample::{cubic_at, median_step};
use crate::tables::Table;

/// Header stamps count where at least this share of them is there and rises.
const MOST_STAMPS: f64 = 0.95;
/// And where they span what the times of receipt span, within this share and this many seconds: a header that
/// always says when the program began is no clock.
const SPAN: f64 = 0.1;
const SPAN_SECONDS: f64 = 0.5;
/// A value of another topic counts between two of its samples that are at most this many of its steps apart.
const STEPS: f64 = 5.0;

/// How two streams of samples lie in time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Alignment {
    /// Seconds in which both have samples.
    pub overlap: f64,
    /// From a sample of the first to the nearest of the second: the median, s.
    pub median: f64,
    /// The largest, s, within the overlap.
    pub largest: f64,
}

/// How two streams of samples lie in time; none where one is empty. Both times rise, s.
#[must_use]
pub fn alignment(a: &[f64], b: &[f64]) -> Option<Alignment> {
    let (start, end) = (a.first()?.max(*b.first()?), a.last()?.min(*b.last()?));
    let nearest = |t: &f64| {
        let after = b.partition_point(|u| u < t);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter_map(|k| b.get(k));
        near.map(|u| (u - t).abs()).fold(f64::INFINITY, f64::min)
    };
    let mut distances: Vec<f64> = a.iter().filter(|t| (start..=end).contains(*t)).map(nearest).collect();
    distances.sort_by(f64::total_cmp);
    Some(Alignment {
        overlap: (end - start).max(0.0),
        median: distances.get(distances.len() / 2).copied().unwrap_or(f64::INFINITY),
        largest: distances.last().copied().unwrap_or(f64::INFINITY),
    })
}

/// The time of every sample of a table, s, what it is and, where it is not what one would expect, why.
pub(crate) fn clock(table: &Table, wanted: Clock) -> (&[f64], &'static str, Option<String>) {
    let (stamps, received) = (table.stamps.as_slice(), table.received.as_slice());
    let doubt = match wanted {
        Clock::Receipt => return (received, "receipt", None),
        Clock::Header => return (stamps, "header", None),
        Clock::Auto => implausible(stamps, received),
    };
    match doubt {
        None => (stamps, "header", None),
        Some(doubt) => (received, "receipt", Some(doubt)),
    }
}

/// Why the stamps of headers are no clock.
fn implausible(stamps: &[f64], received: &[f64]) -> Option<String> {
    let set: Vec<f64> = stamps.iter().copied().filter(|s| s.is_finite()).collect();
    // Publishers that share a topic may speak at the same instant.
    let rising = set.windows(2).filter(|w| w[1] >= w[0]).count() + 1;
    let enough = |count: usize| count as f64 >= MOST_STAMPS * stamps.len() as f64;
    // Headers that nobody fills are zero.
    if set.iter().all(|stamp| *stamp == 0.0) {
        return Some("messages carry no time stamp".into());
    }
    if !enough(set.len()) {
        return Some(format!("only {} of {} messages carry a time stamp", set.len(), stamps.len()));
    }
    if !enough(rising) {
        return Some(format!("{} of {} time stamps run back", set.len() - rising, stamps.len()));
    }
    let span = |t: &[f64]| t.last().unwrap_or(&0.0) - t.first().unwrap_or(&0.0);
    let (own, other) = (span(&set), span(received));
    // Where all were received at once, the file was made from another one.
    if other > 0.0 && (own - other).abs() > (SPAN * other).max(SPAN_SECONDS) {
        return Some(format!(
            "time stamps span {own:.3} s, and the messages were received within {other:.3} s"
        ));
    }
    None
}

/// The log in the tables of a file, whose columns become the log's.
pub(super) fn log<T>(
    mut tables: Vec<Table>,
    asked: Asked<'_>,
    findings: &mut Vec<Finding>,
    finish: Finish<T>,
) -> Result<T, LogError> {
    let (positions, torques) = choose(&tables, asked)?;
    let (mut table, map) = match std::ptr::eq(positions, torques) {
        true => {
            let at = tables.iter().position(|table| std::ptr::eq(table, positions)).unwrap_or(0);
            (tables.swap_remove(at), asked.map.clone())
        }
        false => (join(positions, torques, &tables, asked, findings)?, asked.map.without_columns()),
    };
    drop(tables);
    let timed = columns_have_time(&table, asked.map);
    let (time, called) = match timed {
        true => (None, "sample"),
        false => {
            let (_, name, doubt) = clock(&table, asked.map.clock);
            let text = doubt.map(|doubt| format!("{doubt}: the times of receipt count"));
            findings.extend(text.map(|text| Finding::of_file(asked.file, "t", text)));
            let own = if name == "header" { &mut table.stamps } else { &mut table.received };
            (Some(std::mem::take(own)), "message")
        }
    };
    (table.stamps, table.received) = (Vec::new(), Vec::new());
    let mut samples = Samples::new(Asked { map: &map, ..asked }, called, findings);
    samples.table(table, time)?;
    finish(samples, false)
}

/// Whether a table has its time among its columns.
fn columns_have_time(table: &Table, map: &ColumnMap) -> bool {
    let mapped =
        map.t.column.as_ref().and_then(|by| by.of(0)).is_some_and(|name| table.column(name).is_some());
    let own = columns::TIMES.iter().any(|name| table.column(name).is_some());
    let stamped = table.stamps.iter().any(|s| s.is_finite());
    mapped || (own && !stamped && map.clock == Clock::Auto) || table.received.is_empty()
}

/// The tables with the positions and with the torques.
fn choose<'a>(tables: &'a [Table], asked: Asked<'_>) -> Result<(&'a Table, &'a Table), LogError> {
    let shown = || {
        let one = |t: &Table| format!("{} ({}, {} samples)", t.name, t.kind, t.line.len());
        tables.iter().map(one).collect::<Vec<_>>().join(", ")
    };
    let error = |quantity: &str, message: String| Err(LogError::of_file(asked.file, quantity, message));
    if tables.iter().all(|t| t.columns.is_empty()) {
        return error("topics", format!("no topic holds joint states that can be read here: {}", shown()));
    }
    let has = |table: &Table, key: &str| columns::group(&table.names(), key, asked).is_ok();
    let torque = |t: &Table| asked.efforts().iter().any(|key| has(t, key));
    let said = |key: &str| asked.map.of(key).topic.as_ref().or(asked.map.topic.as_ref());
    let named = |topic: &String| match tables.iter().find(|t| t.name == *topic) {
        Some(table) => Ok(table),
        None => Err(LogError::of_file(
            asked.file,
            "topic",
            format!("{topic} is not there; there are: {}", shown()),
        )),
    };
    let positions = said("q").map(named).transpose()?;
    let torques = asked.efforts().iter().find_map(|key| said(key)).map(named).transpose()?;
    match (positions, torques) {
        (Some(q), Some(tau)) => return Ok((q, tau)),
        (Some(table), None) | (None, Some(table)) if has(table, "q") && torque(table) => {
            return Ok((table, table));
        }
        _ => {}
    }
    let only = |of: &dyn Fn(&Table) -> bool| -> Vec<&'a Table> { tables.iter().filter(|t| of(t)).collect() };
    let whole = only(&|t| has(t, "q") && torque(t));
    if positions.is_none() && torques.is_none() {
        match whole.as_slice() {
            [one] => return Ok((one, one)),
            [] => {}
            several => {
                // What ROS calls the states of an arm's joints.
                if let Some(one) = several.iter().find(|t| t.name == "/joint_states") {
                    return Ok((one, one));
                }
                let names: Vec<&str> = several.iter().map(|t| t.name.as_str()).collect();
                let message = format!(
                    "{} hold positions and torques of this arm: say which one counts with --map 'topic = \
                        \"{}\"'",
                    names.join(", "),
                    names[0]
                );
                return error("topic", message);
            }
        }
    }
    let q = positions.map_or_else(|| only(&|t| has(t, "q")), |q| vec![q]);
    let tau = torques.map_or_else(|| only(&torque), |tau| vec![tau]);
    if let ([q], [tau]) = (q.as_slice(), tau.as_slice()) {
        return Ok((q, tau));
    }
    // The fullest table says best what is missing.
    let fullest = q.into_iter().chain(tau).next().or_else(|| tables.iter().max_by_key(|t| t.columns.len()));
    match fullest {
        Some(table) => Ok((table, table)),
        None => error("topics", "there are none".into()),
    }
}

/// Positions brought to the times of the torques: they are the smoother ones, and what stands between two of
/// their samples is known best. Columns take their plain names, `q1` and so on.
fn join(
    positions: &Table,
    torques: &Table,
    tables: &[Table],
    asked: Asked<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Table, LogError> {
    // One clock for both: the header's where both have it.
    let wanted = match [positions, torques].map(|t| clock(t, asked.map.clock).1) {
        ["header", "header"] => Clock::Header,
        _ => Clock::Receipt,
    };
    let time = |table: &Table| -> (Vec<f64>, Vec<usize>) {
        let times = clock(table, wanted).0;
        // Rising ones, with their rows.
        let mut latest = f64::NEG_INFINITY;
        let rises = |(k, t): (usize, &f64)| {
            let rises = *t > latest;
            latest = latest.max(*t);
            rises.then_some((*t, k))
        };
        times.iter().enumerate().filter_map(rises).unzip()
    };
    let (base, rows) = time(torques);
    let mut joined = Table::new("", "joined");
    joined.line = rows.iter().map(|k| torques.line[*k]).collect();
    (joined.stamps, joined.received) = (base.clone(), base.clone());
    for (key, _) in asked.map.quantities().into_iter().filter(|(key, _)| *key != "t") {
        let at_home = if matches!(key, "q" | "dq") { positions } else { torques };
        let said =
            asked.map.of(key).topic.as_ref().and_then(|topic| tables.iter().find(|t| t.name == *topic));
        let table = said.unwrap_or(at_home);
        let Ok(group) = columns::group(&table.names(), key, asked) else { continue };
        let (times, own) = time(table);
        if !std::ptr::eq(table, torques) && key == "q" {
            findings.push(Finding::of_file(asked.file, "topics", text(positions, torques, &base, &times)));
        }
        for (j, column) in group.at.iter().enumerate() {
            let values: Vec<f64> = own.iter().map(|k| table.columns[*column].values[*k]).collect();
            let values = match std::ptr::eq(table, torques) {
                true => values,
                false => interpolate(&times, &values, &base),
            };
            let name = format!("{key}{}", j + 1);
            joined.columns.push(crate::tables::Column { name, values });
        }
    }
    if joined.columns.is_empty() || joined.line.is_empty() {
        return Err(LogError::of_file(
            asked.file,
            "topics",
            "nothing of this arm is left once topics are joined",
        ));
    }
    Ok(joined)
}

fn text(positions: &Table, torques: &Table, base: &[f64], times: &[f64]) -> String {
    let lies = alignment(base, times).map_or("have no sample in common".to_string(), |a| {
        format!(
            "overlap for {:.2} s; the nearest samples are {:.1} ms apart (median), {:.1} ms at most",
            a.overlap,
            1e3 * a.median,
            1e3 * a.largest
        )
    });
    format!(
        "torques of {} with positions of {}, interpolated to their times: they {lies}",
        torques.name, positions.name
    )
}

/// Values at other times, by cubic interpolation between samples that are near each other.
fn interpolate(times: &[f64], values: &[f64], at: &[f64]) -> Vec<f64> {
    let longest = STEPS * median_step(times).unwrap_or(f64::INFINITY);
    let one = |t: &f64| {
        let after = times.partition_point(|u| u < t);
        if times.get(after) == Some(t) {
            return values[after];
        }
        let Some(before) = after.checked_sub(1).filter(|_| after < times.len()) else { return f64::NAN };
        let step = times[after] - times[before];
        if step > longest {
            return f64::NAN;
        }
        cubic_at(times, values, before, *t)
    };
    at.iter().map(one).collect()
}
