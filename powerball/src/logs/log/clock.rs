//! One running time through several logs: what warms up knows no files.

use super::Log;

/// Sets [`Log::clock`] so that `t + clock` runs through all logs.
///
/// Where the spans of `t` do not overlap, `t` is a common clock already. Otherwise the logs were recorded in
/// the given order, one right after the other.
pub fn common_clock(logs: &mut [Log]) {
    let span = |log: &Log| (log.t.first().copied().unwrap_or(0.0), log.t.last().copied().unwrap_or(0.0));
    let mut spans: Vec<(f64, f64)> = logs.iter().map(span).collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let start = spans.first().map_or(0.0, |s| s.0);
    if spans.windows(2).all(|pair| pair[0].1 <= pair[1].0) {
        for log in logs {
            log.clock = -start;
        }
        return;
    }
    let mut end = 0.0;
    for log in logs {
        let (first, last) = span(log);
        log.clock = end - first;
        end += last - first;
    }
}
