//! How much memory a log may take, and how many columns a table: the size that a file states is compared with
//! both before the memory is allocated.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that a log may take in this process; 0 where none was set.
static ALLOWED: AtomicU64 = AtomicU64::new(0);
/// Bytes that a log may take where none was set and the system does not report what is free; a browser has at
/// most 4 GB in all.
const ELSEWHERE: u64 = if cfg!(target_pointer_width = "32") { 1_000_000_000 } else { 4_000_000_000 };
/// A table of more columns is not a log: an arm has some dozens, and a recording of a whole robot some
/// hundreds.
const MOST_COLUMNS: usize = 10_000;
/// Bytes of a number.
const NUMBER: u64 = 8;

/// Sets how many bytes of memory one log may take from now on in this process. Without it the limit is half
/// of what is free when a log is read.
pub fn allow_memory(bytes: u64) {
    ALLOWED.store(bytes, Ordering::Relaxed);
}

/// Free memory, bytes, if the system reports it: of the machine, and of the container if it has a limit.
fn free() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let machine = 1024 * line.trim().trim_end_matches(" kB").parse::<u64>().ok()?;
    Some(container().map_or(machine, |container| container.min(machine)))
}

/// Free memory below the limit of this process's container (cgroup v2), bytes; `None` without a limit.
fn container() -> Option<u64> {
    let bytes = |file: &str| {
        let text = std::fs::read_to_string(format!("/sys/fs/cgroup/{file}")).ok()?;
        text.trim().parse::<u64>().ok()
    };
    Some(bytes("memory.max")?.saturating_sub(bytes("memory.current")?))
}

/// The remaining memory for one log.
#[derive(Debug)]
pub(crate) struct Memory {
    allowed: u64,
    claimed: u64,
    /// Why the log is refused, where it is.
    #[cfg(any(feature = "topics", feature = "npz", feature = "mat", feature = "hdf5"))]
    refused: Option<String>,
}

impl Memory {
    /// The memory for a log that is read now.
    pub(crate) fn of_a_log() -> Memory {
        let said = Some(ALLOWED.load(Ordering::Relaxed)).filter(|bytes| *bytes > 0);
        let allowed = said.or_else(|| Some(free()? / 2)).unwrap_or(ELSEWHERE);
        Memory {
            allowed,
            claimed: 0,
            #[cfg(any(feature = "topics", feature = "npz", feature = "mat", feature = "hdf5"))]
            refused: None,
        }
    }

    /// Whether that number of bytes fits next to what was claimed before.
    ///
    /// # Errors
    /// How much is needed, how much there is and what to do.
    pub(crate) fn holds(&self, bytes: u64) -> Result<(), String> {
        let needed = self.claimed.saturating_add(bytes);
        match needed <= self.allowed {
            true => Ok(()),
            false => Err(format!(
                "it needs {} of memory, and a log may take {}: cut it, leave out columns that are not \
                    signals, or allow more with --memory",
                size(needed),
                size(self.allowed)
            )),
        }
    }

    /// Whether that number of rows of that many numbers fits.
    ///
    /// # Errors
    /// Those of [`Memory::holds`].
    pub(crate) fn holds_rows(&self, rows: usize, numbers: usize) -> Result<(), String> {
        self.holds((rows as u64).saturating_mul(numbers as u64).saturating_mul(NUMBER))
    }
}

/// Claims of a reader that allocates piece by piece, and reports at the end whether the memory was
/// sufficient.
#[cfg(any(feature = "topics", feature = "npz", feature = "mat", feature = "hdf5"))]
impl Memory {
    /// Takes a number of bytes of it; where they are not there, the log is refused.
    ///
    /// # Errors
    /// Those of [`Memory::holds`].
    pub(crate) fn claim(&mut self, bytes: u64) -> Result<(), String> {
        let held = self.holds(bytes);
        match &held {
            Ok(()) => self.claimed += bytes,
            Err(reason) => drop(self.refused.get_or_insert_with(|| reason.clone())),
        }
        held
    }

    /// Takes the bytes of a number of values.
    ///
    /// # Errors
    /// Those of [`Memory::holds`].
    pub(crate) fn claim_numbers(&mut self, count: usize) -> Result<(), String> {
        self.claim((count as u64).saturating_mul(NUMBER))
    }

    /// Whether something was refused.
    #[cfg(feature = "topics")]
    pub(crate) fn is_spent(&self) -> bool {
        self.refused.is_some()
    }

    /// The remaining memory, bytes.
    #[cfg(feature = "mat")]
    pub(crate) fn left(&self) -> u64 {
        self.allowed - self.claimed
    }

    /// Whether everything that was claimed was there.
    ///
    /// # Errors
    /// Why not.
    pub(crate) fn done(self) -> std::io::Result<()> {
        self.refused.map_or(Ok(()), |reason| Err(std::io::Error::other(reason)))
    }
}

/// Refuses a table of more columns than any log has.
///
/// # Errors
/// How many there are and what to do.
pub(crate) fn few_columns(count: usize) -> Result<(), String> {
    match count <= MOST_COLUMNS {
        true => Ok(()),
        false => Err(format!(
            "{count} columns: a log has at most {MOST_COLUMNS}, and that of an arm some dozens; write only \
                the columns of the arm"
        )),
    }
}

/// A number of bytes in readable units.
fn size(bytes: u64) -> String {
    let units = [(1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    let bytes = bytes as f64;
    let unit = units.into_iter().find(|(unit, _)| bytes >= *unit);
    unit.map_or(format!("{bytes} B"), |(unit, name)| format!("{:.1} {name}", bytes / unit))
}

#[cfg(all(test, any(feature = "topics", feature = "npz", feature = "mat", feature = "hdf5")))]
mod tests {
    use super::*;

    #[test]
    fn what_is_claimed_is_counted_together_and_a_refusal_stays() {
        let mut memory = Memory { allowed: 3_000_000_000, claimed: 0, refused: None };
        assert!(memory.claim(2_000_000_000).is_ok() && memory.holds(1_000_000_000).is_ok());
        let refused = memory.claim(1_500_000_000).unwrap_err();
        assert!(refused.contains("needs 3.5 GB") && refused.contains("may take 3.0 GB"), "{refused}");
        assert!(memory.claim(1).is_ok() && memory.claim_numbers(usize::MAX).is_err());
        assert_eq!(memory.done().unwrap_err().to_string(), refused);
    }

    #[test]
    fn half_of_what_is_free_is_allowed_where_nobody_says_more() {
        let allowed = Memory::of_a_log().allowed;
        assert!(allowed > 1_000_000 && free().is_none_or(|free| allowed < free), "{allowed}");
    }
}
