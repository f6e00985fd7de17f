//! Which samples of a joint become rows: those in which it moves and its torque says something.

use super::Recording;
use super::inactive::dead;
use super::saturated::{saturated, saturation_notes};
use crate::logs::log::Log;
use crate::logs::signal::{Band, rest};

/// By band, joint and recording: the samples that are kept, counted in those of the band.
pub(super) type Kept = Vec<Vec<Vec<Vec<usize>>>>;

/// The samples that are kept, and what was left out for another reason than rest, in words.
pub(super) fn kept_samples(
    logs: &[Log],
    recordings: &[Recording],
    bands: &[Band],
    rest_velocity: &[f64],
    inactive: &[Option<String>],
) -> (Kept, Vec<String>) {
    let n = inactive.len();
    let mut left_out = Vec::new();
    let mut kept = keep_moving(recordings, bands, rest_velocity, n);
    for j in 0..n {
        let at_limit = saturated(logs, j);
        let count = |kept: &Kept| -> usize { kept[0][j].iter().map(Vec::len).sum() };
        let moving = count(&kept);
        leave_out(&at_limit, recordings, bands, kept.iter_mut().map(|kept| &mut kept[j]));
        // A torque that stays while its joint rests is none.
        if count(&kept) < moving {
            left_out.extend(saturation_notes(logs, j, &at_limit));
        }
        for (r, recording) in recordings.iter().enumerate() {
            let is_dead = dead(recording, j);
            if is_dead || inactive[j].is_some() {
                kept.iter_mut().for_each(|kept| kept[j][r].clear());
            }
            if is_dead && inactive[j].is_none() {
                left_out.push(format!(
                    "{}: the torque of joint {} never changes: the joint was left out of this log",
                    logs[recording.log].file,
                    j + 1
                ));
            }
        }
    }
    (kept, left_out)
}

/// By band, joint and recording: which of the band's kept samples are rows.
fn keep_moving(recordings: &[Recording], bands: &[Band], limit: &[f64], n: usize) -> Kept {
    let mut all = vec![vec![Vec::with_capacity(recordings.len()); n]; bands.len()];
    for j in 0..n {
        for r in recordings {
            let moving = rest::moving(&r.velocity(j).collect::<Vec<_>>(), r.rate, limit[j]);
            for (of_band, band) in all.iter_mut().zip(bands) {
                // A joint that never moves has the limit 0 and is never below it.
                let kept = if limit[j] < 1e-5 { Vec::new() } else { band.kept(r.len()) };
                of_band[j].push((0..kept.len()).filter(|k| moving[kept[*k]]).collect());
            }
        }
    }
    all
}

/// Leaves out a joint's samples in some spans of its logs, and those that the band's filter mixes with them.
fn leave_out<'k>(
    spans: &[Vec<[f64; 2]>],
    recordings: &[Recording],
    bands: &[Band],
    kept: impl Iterator<Item = &'k mut Vec<Vec<usize>>>,
) {
    for (kept, band) in kept.zip(bands) {
        for (kept, recording) in kept.iter_mut().zip(recordings) {
            let spans = &spans[recording.log];
            if spans.is_empty() {
                continue;
            }
            let (samples, guard) = (band.kept(recording.len()), 1.0 / band.cutoff);
            let outside = |k: &usize| {
                let t = recording.start + samples[*k] as f64 / recording.rate;
                spans.iter().all(|[from, to]| t < from - guard || t > to + guard)
            };
            kept.retain(outside);
        }
    }
}
