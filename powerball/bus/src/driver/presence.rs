//! Whether a node is there: its heartbeat, and its process data in each cycle, once.

use crate::canopen::Micros;
use crate::canopen::sync::HeartbeatConsumer;

/// Counts `wrong` cycles in a row: how many, this one included.
fn count(before: &mut u8, wrong: bool) -> u8 {
    *before = if wrong { before.saturating_add(1) } else { 0 };
    *before
}

/// Counts `wrong` cycles in a row; whether they are as many as `limit`.
pub(super) fn run(before: &mut u8, wrong: bool, limit: u8) -> bool {
    count(before, wrong) >= limit
}

/// What came of one node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Presence {
    heartbeat: HeartbeatConsumer,
    /// Transmit PDOs since the last SYNC, by bit.
    arrived: u8,
    /// Cycles in a row without all of them.
    missing: u8,
    /// One came twice in this cycle, and in how many cycles in a row.
    twice: bool,
    twice_run: u8,
}

impl Presence {
    /// A node that is not watched yet; later, its heartbeat may be silent for `timeout` µs.
    pub(super) const fn new(timeout: Micros) -> Presence {
        let heartbeat = HeartbeatConsumer::new(timeout);
        Presence { heartbeat, arrived: 0, missing: 0, twice: false, twice_run: 0 }
    }

    /// Cycles begin, and so does the watch on the heartbeat.
    pub(super) fn begin(&mut self, now: Micros) {
        self.heartbeat.beat(now);
        (self.arrived, self.missing) = (0, 0);
    }

    /// The heartbeat is no longer watched.
    pub(super) fn release(&mut self) {
        self.heartbeat.stop();
    }

    /// A heartbeat came.
    pub(super) fn beat(&mut self, now: Micros) {
        if self.heartbeat.is_watching() {
            self.heartbeat.beat(now);
        }
    }

    /// Whether the heartbeat is lost. Reported once; it is watched again after a restart.
    pub(super) fn is_lost(&mut self, now: Micros) -> bool {
        let lost = self.heartbeat.is_lost(now);
        if lost {
            self.heartbeat.stop();
        }
        lost
    }

    /// Transmit PDO `number` came; whether it had come already in this cycle.
    pub(super) fn arrive(&mut self, number: u8) -> bool {
        let bit = 1 << (number - 1);
        let again = self.arrived & bit != 0;
        self.twice |= again;
        self.arrived |= bit;
        again
    }

    /// Whether the PDOs `all`, by bit, have come in this cycle.
    pub(super) const fn is_whole(&self, all: u8) -> bool {
        self.arrived == all
    }

    /// Cycles in a row without all of the process data, up to the last SYNC.
    pub(super) const fn missing(&self) -> u8 {
        self.missing
    }

    /// A cycle ends: how many in a row, this one included, were without one of the PDOs `all`.
    pub(super) fn end_cycle(&mut self, all: u8) -> u8 {
        count(&mut self.missing, self.arrived != all)
    }

    /// A cycle ends: whether data came twice in `limit` cycles in a row, for the first time.
    pub(super) fn is_double(&mut self, limit: u8) -> bool {
        let twice = core::mem::take(&mut self.twice);
        count(&mut self.twice_run, twice) == limit
    }

    /// A SYNC leaves: the next cycle's data is awaited.
    pub(super) fn await_data(&mut self) {
        self.arrived = 0;
    }
}
