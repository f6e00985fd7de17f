//! How far a joint is on its way to its operation.

use crate::bus::canopen::Micros;
use crate::bus::cia402::State;

/// How far a joint is on its way to "operation enabled".
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Progress {
    /// Its turn has not come.
    Waiting,
    /// Through the drive's states; in `state` until `deadline`.
    Walking { state: State, deadline: Micros },
    /// Enabled; the extended status was read `reads` times, next at `next`. From the second read on the brake
    /// is open.
    Commutating { reads: u8, next: Micros },
    /// Commutated just now: the supply recovers.
    Settling { until: Micros },
    /// Enabled and commutated, halted until all are.
    Done,
}
