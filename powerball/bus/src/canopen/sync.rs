//! SYNC and heartbeats in time: when to send, what was late, who is silent. The caller gives the time; no
//! clock is read.

use super::Micros;
use core::num::NonZeroU64;

/// A SYNC that is to be sent now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// How long after its time, less than a period.
    pub late: Micros,
    /// SYNCs before it that were left out because their time had passed: never sent in a burst.
    pub skipped: u64,
}

/// The producer's schedule: a raster that a little lateness, up to 2 % of the period, does not shift. What is
/// later shifts it: a SYNC that followed too soon would make the drives go through their set-points too fast,
/// and leave too little time for their data.
#[derive(Clone, Copy, Debug)]
pub struct SyncProducer {
    period: NonZeroU64,
    next: Option<Micros>,
    scheduled: Micros,
}

impl SyncProducer {
    /// Stopped; `period` in µs, at least 1.
    pub const fn new(period: Micros) -> SyncProducer {
        let period = match NonZeroU64::new(period) {
            Some(period) => period,
            None => NonZeroU64::MIN,
        };
        SyncProducer { period, next: None, scheduled: 0 }
    }

    /// The first SYNC is due at `now`.
    pub fn start(&mut self, now: Micros) {
        self.next = Some(now);
    }

    /// Stops the SYNCs.
    pub fn stop(&mut self) {
        self.next = None;
    }

    /// Whether SYNCs are being sent.
    pub const fn is_running(&self) -> bool {
        self.next.is_some()
    }

    /// When the next one is due.
    pub const fn next(&self) -> Option<Micros> {
        self.next
    }

    /// When the last one was due.
    pub const fn scheduled(&self) -> Micros {
        self.scheduled
    }

    /// The SYNC that is due at `now`, if any.
    pub fn poll(&mut self, now: Micros) -> Option<Tick> {
        let due = self.next.filter(|&due| now >= due)?;
        let behind = now - due;
        let tick = Tick { late: behind % self.period, skipped: behind / self.period };
        self.scheduled = if tick.late > self.period.get() / 50 { now } else { now - tick.late };
        self.next = Some(self.scheduled + self.period.get());
        Some(tick)
    }
}

/// When to send one's own heartbeat.
#[derive(Clone, Copy, Debug)]
pub struct HeartbeatProducer {
    period: Micros,
    next: Micros,
}

impl HeartbeatProducer {
    /// The first one is due at once.
    pub const fn new(period: Micros) -> HeartbeatProducer {
        HeartbeatProducer { period, next: 0 }
    }

    /// When the next one is due.
    pub const fn next(&self) -> Micros {
        self.next
    }

    /// Whether one is due at `now`; it counts as sent then.
    pub fn poll(&mut self, now: Micros) -> bool {
        let due = now >= self.next;
        if due {
            self.next = now + self.period;
        }
        due
    }
}

/// Watches the heartbeat of another node.
#[derive(Clone, Copy, Debug)]
pub struct HeartbeatConsumer {
    timeout: Micros,
    last: Option<Micros>,
}

impl HeartbeatConsumer {
    /// A consumer that does not watch yet; later, silence longer than `timeout` counts as a loss.
    pub const fn new(timeout: Micros) -> HeartbeatConsumer {
        HeartbeatConsumer { timeout, last: None }
    }

    /// A heartbeat came, or watching begins.
    pub fn beat(&mut self, now: Micros) {
        self.last = Some(now);
    }

    /// No longer watching.
    pub fn stop(&mut self) {
        self.last = None;
    }

    /// Whether it is lost at `now`.
    pub fn is_lost(&self, now: Micros) -> bool {
        self.last.is_some_and(|last| now.saturating_sub(last) > self.timeout)
    }

    /// Whether it is being watched.
    pub const fn is_watching(&self) -> bool {
        self.last.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_little_lateness_does_not_shift_the_raster_and_more_does() {
        let mut sync = SyncProducer::new(5000);
        assert_eq!(sync.poll(0), None);
        sync.start(1000);
        assert_eq!(sync.poll(999), None);
        assert_eq!(sync.poll(1000), Some(Tick { late: 0, skipped: 0 }));
        assert_eq!(sync.poll(1000), None);
        assert_eq!(sync.poll(6100), Some(Tick { late: 100, skipped: 0 }));
        assert_eq!(sync.next(), Some(11_000));
        assert_eq!(sync.poll(13_000), Some(Tick { late: 2000, skipped: 0 }));
        assert_eq!(sync.next(), Some(18_000));
    }

    #[test]
    fn what_was_missed_is_not_sent_in_a_burst() {
        let mut sync = SyncProducer::new(5000);
        sync.start(0);
        sync.poll(0);
        assert_eq!(sync.poll(21_000), Some(Tick { late: 1000, skipped: 3 }));
        assert_eq!(sync.poll(25_999), None);
        assert_eq!(sync.poll(26_000), Some(Tick { late: 0, skipped: 0 }));
    }

    #[test]
    fn a_heartbeat_is_lost_after_its_timeout_only() {
        let mut consumer = HeartbeatConsumer::new(300);
        assert!(!consumer.is_lost(u64::MAX));
        consumer.beat(1000);
        assert!(!consumer.is_lost(1300));
        assert!(consumer.is_lost(1301));
    }
}
