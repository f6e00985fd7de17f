//! What is reported and stops nothing: counts, and the last notes.

use super::cause::Cause;
use crate::canopen::Micros;

/// Counts of what went wrong and did no harm, or not yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// SYNCs sent.
    pub cycles: u64,
    /// SYNCs that were late.
    pub late: u64,
    /// The latest, µs.
    pub worst_late: Micros,
    /// SYNCs left out because their time had passed.
    pub skipped: u64,
    /// Slots left out because the next SYNC was due: the drives held their last set-points.
    pub dropped: u64,
    /// Cycles whose set-points were rejected.
    pub rejected: u64,
    /// Cycles without new set-points.
    pub starved: u64,
    /// Frames that could not be queued.
    pub queue_full: u64,
    /// Times that the controller became error passive.
    pub error_passive: u64,
    /// Times that received frames were lost in the controller or the adapter.
    pub overruns: u64,
    /// Received frames of unknown identifiers.
    pub unexpected: u64,
}

/// Something that was reported, and when. Repeats of the last one are counted, not kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Note {
    /// When first.
    pub at: Micros,
    /// The cause of the note.
    pub cause: Cause,
    /// How often in a row.
    pub times: u32,
}

const KEPT: usize = 16;

/// The last notes.
#[derive(Clone, Debug, Default)]
pub(super) struct Notes {
    notes: [Option<Note>; KEPT],
    /// Where the next one is kept.
    next: usize,
}

impl Notes {
    /// Oldest first.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Note> {
        let (newer, older) = self.notes.split_at(self.next % KEPT);
        older.iter().chain(newer).flatten()
    }

    /// Keeps a note, or counts it if it repeats the last one.
    pub(super) fn add(&mut self, at: Micros, cause: Cause) {
        let last = (self.next + KEPT - 1) % KEPT;
        if let Some(Some(note)) = self.notes.get_mut(last)
            && note.cause == cause
        {
            note.times = note.times.saturating_add(1);
        } else if let Some(place) = self.notes.get_mut(self.next) {
            *place = Some(Note { at, cause, times: 1 });
            self.next = (self.next + 1) % KEPT;
        }
    }
}
