//! The log of an experiment beside those that were there before.

use crate::logs::log::Log;

/// The share of a new log, its end, that is held out.
pub const HELD_OUT: f64 = 0.35;
/// Between what is fitted and what is held out, s.
const GAP: f64 = 0.5;
/// From the end of the last log to the new one, where nobody knows better, s.
const PAUSE: f64 = 5.0;

/// Splits a new log into what may be fitted and what is held out, and puts it behind all others: on their
/// common clock where they have one, else by a clock of its own.
#[must_use]
pub fn split_off(mut new: Log, others: &[&Log]) -> (Log, Log) {
    let end = others.iter().filter_map(|log| log.t.last().map(|t| t + log.clock)).fold(0.0, f64::max);
    let behind = end + PAUSE - new.t.first().copied().unwrap_or(0.0);
    match others {
        [first, rest @ ..] if rest.iter().all(|log| log.clock == first.clock) => {
            new.clock = first.clock;
            new.t.iter_mut().for_each(|t| *t += behind - first.clock);
        }
        _ => new.clock = behind,
    }
    let (first, last) = (new.t.first().copied().unwrap_or(0.0), new.t.last().copied().unwrap_or(0.0));
    let at = last - HELD_OUT * (last - first);
    let mut held = new.clone();
    held.file = format!("{} (its end)", new.file);
    let (before, after) =
        (new.t.partition_point(|t| *t < at - 0.5 * GAP), new.t.partition_point(|t| *t < at + 0.5 * GAP));
    new.pieces = clipped(&new.pieces, 0, before);
    held.pieces = clipped(&held.pieces, after, held.t.len());
    (new, held)
}

fn clipped(pieces: &[std::ops::Range<usize>], from: usize, to: usize) -> Vec<std::ops::Range<usize>> {
    pieces.iter().map(|p| p.start.max(from)..p.end.min(to)).filter(|p| p.len() >= 2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_fitted_and_held_out_and_the_clock_runs_on() {
        let log = |file: &str, clock: f64| Log {
            file: file.into(),
            t: (0..1000).map(|k| 3.0 + 0.01 * f64::from(k)).collect(),
            q: vec![vec![0.0; 1000]],
            torque: vec![vec![0.0; 1000]],
            temperature: None,
            motor: None,
            pieces: vec![0..400, 420..1000],
            clock,
        };
        let old = [log("a", 0.0), log("b", 20.0)];
        let (fit, held) = split_off(log("new", 0.0), &[&old[0], &old[1]]);
        assert!(fit.pieces.last().unwrap().end < held.pieces[0].start, "{:?} {:?}", fit.pieces, held.pieces);
        let seconds = |pieces: &[std::ops::Range<usize>]| pieces.iter().map(|p| p.len()).sum::<usize>();
        assert!((300..=350).contains(&seconds(&held.pieces)) && seconds(&fit.pieces) > 550);
        assert_ne!(fit.file, held.file);
        assert!(fit.t[0] + fit.clock > 20.0 + 12.99 && fit.clock == held.clock);
        // Where the others have a common clock, the new log has it too.
        let (fit, held) = split_off(log("new", 0.0), &[&old[1], &old[1]]);
        assert!(fit.clock == 20.0 && held.clock == 20.0 && fit.t[0] + fit.clock > 20.0 + 12.99);
    }
}
