//! Paired timings: what is compared runs in turn in one process, so that ratios mean something on any machine.

use std::time::{Duration, Instant};

/// The shortest of many runs of each of several things, run in turn.
pub(crate) fn paired<const N: usize>(rounds: usize, mut things: [&mut dyn FnMut(); N]) -> [Duration; N] {
    let mut best = [Duration::MAX; N];
    for _ in 0..rounds {
        for (thing, best) in things.iter_mut().zip(&mut best) {
            let start = Instant::now();
            thing();
            *best = (*best).min(start.elapsed());
        }
    }
    best
}
