//! A recursive filter over the pieces of one long signal at the same time.
//!
//! A sample waits for the one before it, so that one filter leaves most of a processor idle. What a filter was
//! fed long ago is of no matter to it: each piece begins as many samples early as it takes to forget the state
//! that it begins with. The result is that of the whole signal but for rounding.

use super::biquad::Biquad;
use crate::logs::batch::{self, Work};

/// Pieces worked on at once.
const LANES: usize = 8;

/// Samples after which sections have forgotten their state, in double precision.
pub(super) fn memory(sections: &[Biquad]) -> usize {
    // Complex poles have the radius √a₂. Sections in a row forget later than the slowest of them.
    let radius = sections.iter().map(|section| section.a[1].abs().sqrt()).fold(0.0, f64::max);
    let samples = 1.3 * f64::EPSILON.ln() / radius.ln();
    if samples.is_finite() && samples >= 0.0 { samples.ceil() as usize } else { usize::MAX / 2 }
}

/// Whether pieces take less time than the whole.
pub(super) fn worthwhile(samples: usize, memory: usize) -> bool {
    samples / 4 > memory
}

/// Filters forwards, then backwards; either way the filter starts settled on the first sample that it meets.
pub(super) fn there_and_back(sections: &[Biquad], memory: usize, samples: &[f64]) -> Vec<f64> {
    let [Some(first), Some(last)] = [samples.first(), samples.last()] else { return Vec::new() };
    let length = samples.len().div_ceil(LANES);
    // A constant before either end keeps the filter as it starts.
    let mut y = Vec::with_capacity(LANES * length + 2 * memory);
    y.resize(memory, *first);
    y.extend_from_slice(samples);
    let end = y.len();
    y.resize(LANES * length + 2 * memory, *last);
    for pair in sections.chunks(2) {
        pass(pair, &mut y, memory, length, |k| k);
    }
    let last = y[end - 1];
    y[end..].fill(last);
    let from = y.len() - 1;
    for pair in sections.chunks(2) {
        pass(pair, &mut y, memory, length, |k| from - k);
    }
    y.truncate(end);
    y.drain(..memory);
    y
}

/// One or two sections over all pieces; `at` is where the k-th sample in the direction of work stands.
fn pass(sections: &[Biquad], y: &mut [f64], memory: usize, length: usize, at: impl Fn(usize) -> usize) {
    match *sections {
        [a, b] => batch::run(Pass { sections: [a, b], y, memory, length, at }),
        [a, ..] => batch::run(Pass { sections: [a], y, memory, length, at }),
        [] => {}
    }
}

struct Pass<'a, F, const N: usize> {
    sections: [Biquad; N],
    y: &'a mut [f64],
    memory: usize,
    length: usize,
    at: F,
}

impl<F: Fn(usize) -> usize, const N: usize> Work for Pass<'_, F, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Pass { sections, y, memory, length, at } = self;
        let mut states = [[[0.0; LANES]; 2]; N];
        for lane in 0..LANES {
            let mut x = y[at(lane * length)];
            for (section, state) in sections.iter().zip(&mut states) {
                let settled = section.settled().map(|s| s * x);
                [state[0][lane], state[1][lane]] = settled;
                x = section.step(&mut settled.clone(), x);
            }
        }
        for k in 0..memory + length {
            let mut x: [f64; LANES] = std::array::from_fn(|lane| y[at(lane * length + k)]);
            for (section, [first, second]) in sections.iter().zip(&mut states) {
                for lane in 0..LANES {
                    let mut state = [first[lane], second[lane]];
                    x[lane] = section.step(&mut state, x[lane]);
                    [first[lane], second[lane]] = state;
                }
            }
            if k >= memory {
                for lane in 0..LANES {
                    y[at(lane * length + k)] = x[lane];
                }
            }
        }
    }
}
