//! Logs made small: what a column is shows at a few samples a second, and in a few minutes.

use crate::logs::log::Log;
use crate::logs::signal::Butterworth;
use crate::logs::signal::resample::{cubic, linear, median_step};
use std::ops::Range;

/// What is slower than this share of the rate is kept.
const KEPT: f64 = 0.25;
/// Shorter stretches say nothing, s.
const SHORTEST: f64 = 1.0;
/// Of long logs stretches of this length are taken, s.
const STRETCH: f64 = 10.0;

/// The logs on even grids of about `rate` samples a second, at most `most` seconds of them in all, evenly
/// chosen; one piece a log. Every signal passes the same filter.
pub(super) fn decimate(logs: &[Log], most: f64, rate: f64) -> Vec<Log> {
    let length = |log: &Log, piece: &Range<usize>| log.t[piece.end - 1] - log.t[piece.start];
    let whole: f64 = logs.iter().flat_map(|log| log.pieces.iter().map(move |piece| length(log, piece))).sum();
    let mut out = Vec::new();
    // Every so many stretches one is taken.
    let every = (whole / most).ceil().max(1.0) as usize;
    let mut count = 0;
    for log in logs {
        for piece in log.pieces.iter().filter(|piece| length(log, piece) >= SHORTEST) {
            if every == 1 {
                out.extend(of_stretch(log, piece.clone(), rate));
                continue;
            }
            for stretch in stretches(log, piece) {
                if count % every == 0 {
                    out.extend(of_stretch(log, stretch, rate));
                }
                count += 1;
            }
        }
    }
    out
}

/// A piece in stretches of about [`STRETCH`] seconds.
fn stretches(log: &Log, piece: &Range<usize>) -> Vec<Range<usize>> {
    let (first, last) = (log.t[piece.start], log.t[piece.end - 1]);
    let count = ((last - first) / STRETCH).floor().max(1.0) as usize;
    let at = |k: usize| {
        let time = first + (last - first) * k as f64 / count as f64;
        if k == count { piece.end } else { piece.start + log.t[piece.clone()].partition_point(|t| *t < time) }
    };
    (0..count).map(|k| at(k)..at(k + 1)).collect()
}

fn of_stretch(log: &Log, piece: Range<usize>, wanted: f64) -> Option<Log> {
    let t = &log.t[piece.clone()];
    let step = median_step(t)?;
    let (start, rate) = (t[0], 1.0 / step);
    let count = ((t[t.len() - 1] - start) / step).floor() as usize + 1;
    // A clock that is a little slow does not count.
    let every = ((1.05 * rate / wanted).floor() as usize).max(1);
    let filter = if every > 1 { Butterworth::low_pass(4, KEPT * wanted, rate) } else { None };
    let small = |x: Vec<f64>| -> Vec<f64> {
        // A sensor that is dead must not come alive by the filter's rounding.
        let is_dead = x.windows(2).all(|pair| pair[0] == pair[1]);
        let filter = filter.as_ref().filter(|_| !is_dead);
        let x = filter.map_or_else(|| x.clone(), |f| f.zero_phase(&x));
        x.into_iter().step_by(every).collect()
    };
    let samples = count.div_ceil(every);
    Some(Log {
        motor: None,
        file: log.file.clone(),
        t: (0..samples).map(|k| start + (k * every) as f64 * step).collect(),
        q: log.q.iter().map(|q| small(cubic(t, &q[piece.clone()], start, step, count))).collect(),
        torque: log.torque.iter().map(|x| small(linear(t, &x[piece.clone()], start, step, count))).collect(),
        temperature: None,
        pieces: std::iter::once(0..samples).collect(),
        clock: log.clock,
    })
}
