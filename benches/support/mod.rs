//! Paired timings: what is compared runs in turn in one process, so that ratios mean something on any
//! machine.

#![allow(dead_code)]

pub(crate) mod by_hand;
pub(crate) mod with_dynibo;
pub(crate) mod with_nalgebra;

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

/// Prints a table, and writes it into its section of the page after `--write` on the command line.
pub(crate) fn publish(section: &str, table: &str) {
    println!("{table}");
    let mut arguments = std::env::args().skip_while(|argument| argument != "--write").skip(1);
    if let Some(page) = arguments.next() {
        let page = powerball_workspace::root().join(page);
        powerball_workspace::document::write_section(&page, section, table).unwrap();
    }
}
