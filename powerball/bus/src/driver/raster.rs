//! The raster of the cycles: SYNC, the slot for set-points after it, and whether the caller polls in time.

use super::notes::Counters;
use super::profile::Reactions;
use crate::canopen::Micros;
use crate::canopen::sync::{SyncProducer, Tick};

/// The cycles in time.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    period: Micros,
    sync: SyncProducer,
    synced_at: Micros,
    /// The set-points of this cycle have not left yet.
    open: bool,
    /// Late SYNCs until enough in a row were in time, and how many were.
    late: u8,
    good: u16,
}

impl Raster {
    pub(super) const fn new(period: Micros) -> Raster {
        Raster { period, sync: SyncProducer::new(period), synced_at: 0, open: false, late: 0, good: 0 }
    }

    /// The first SYNC is due at `now`.
    pub(super) fn start(&mut self, now: Micros) {
        (self.late, self.good) = (0, 0);
        self.sync.start(now);
    }

    /// No SYNC leaves any more, and no set-points of the last cycle.
    pub(super) fn stop(&mut self) {
        self.sync.stop();
        self.open = false;
    }

    pub(super) const fn is_running(&self) -> bool {
        self.sync.is_running()
    }

    /// When the next SYNC is due.
    pub(super) const fn next(&self) -> Option<Micros> {
        self.sync.next()
    }

    /// When the last SYNC left.
    pub(super) const fn synced_at(&self) -> Micros {
        self.synced_at
    }

    /// When the set-points of this cycle leave, `after` the SYNC was due, where they have not left yet.
    pub(super) fn slot(&self, after: Micros) -> Option<Micros> {
        self.open.then(|| self.sync.scheduled() + after)
    }

    /// The slot is over; whether it was open.
    pub(super) fn close(&mut self) -> bool {
        core::mem::take(&mut self.open)
    }

    /// The SYNC that is due at `now`, if any.
    pub(super) fn poll(&mut self, now: Micros) -> Option<Tick> {
        self.sync.poll(now)
    }

    /// The SYNC has left at `now`; the next slot is open.
    pub(super) fn sent(&mut self, now: Micros) {
        (self.synced_at, self.open) = (now, true);
    }

    /// Counts a SYNC that is late or in time; whether too many were late for an arm that may move (`live`).
    pub(super) fn is_too_late(
        &mut self,
        tick: Tick,
        live: bool,
        reactions: &Reactions,
        counters: &mut Counters,
    ) -> bool {
        counters.skipped += tick.skipped;
        counters.worst_late = counters.worst_late.max(tick.late);
        let late = tick.skipped > 0 || tick.late as f64 > reactions.late_fraction * self.period as f64;
        if !late {
            self.good = self.good.saturating_add(1);
            if self.good >= reactions.forgiving_cycles {
                self.late = 0;
            }
            return false;
        }
        counters.late += 1;
        (self.late, self.good) = (self.late.saturating_add(1), 0);
        let too_late = self.late >= reactions.late_limit || tick.skipped >= reactions.skipped_limit;
        if live && too_late {
            self.late = 0;
        }
        live && too_late
    }
}
