//! Memory of this process: what it takes, and what it may (`--max-memory`). Large things ask for room before they are
//! allocated, as a failed allocation ends a Rust program without a word.
//!
//! The limit is the process's, as its memory is: whoever embeds the crate sets it once for all scenes. It holds for what
//! grows with the input (files, meshes, pictures, tables of lights, kernels, films), each measured or bounded from above;
//! the few megabytes beside it are not asked for.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicU64, Ordering};

/// No limit.
const UNLIMITED: u64 = u64::MAX;

static LIMIT: AtomicU64 = AtomicU64::new(UNLIMITED);
/// Room that was granted and may not be in use yet.
static PROMISED: AtomicU64 = AtomicU64::new(0);

/// Sets the most bytes that this process may have in use.
pub fn set_limit(bytes: u64) {
    LIMIT.store(bytes, Ordering::Relaxed);
}

/// Whether there is a limit.
pub fn is_limited() -> bool {
    LIMIT.load(Ordering::Relaxed) != UNLIMITED
}

/// Room for bytes that are about to be written. While it is held they count as used, wherever others ask; once they
/// are written they count by themselves, and it is to be dropped: what is half written counts up to twice.
#[derive(Debug)]
#[must_use = "room that is given back at once is no room"]
pub struct Room(u64);

impl Drop for Room {
    fn drop(&mut self) {
        PROMISED.fetch_sub(self.0, Ordering::Relaxed);
    }
}

/// Room for `bytes` more; `what` is asked for only where there is none, and completes "... 5 MB do not fit".
///
/// # Errors
/// [`Error::Usage`] where the process would have more in use than its limit.
pub fn room(bytes: u64, what: impl FnOnce() -> String) -> Result<Room> {
    let limit = LIMIT.load(Ordering::Relaxed);
    if limit == UNLIMITED {
        return Ok(Room(0));
    }
    // Sums of what no machine has must not wrap.
    let bytes = bytes.min(1 << 56);
    let promised = PROMISED.fetch_add(bytes, Ordering::Relaxed);
    let room = Room(bytes);
    let used = in_use().unwrap_or(0) + promised;
    if used.saturating_add(bytes) <= limit {
        return Ok(room);
    }
    let [bytes, limit, used] = [bytes, limit, used].map(in_words);
    Err(Error::Usage(format!(
        "{}: {bytes} do not fit into --max-memory {limit}, of which {used} are used",
        what()
    )))
}

/// Whether `bytes` more than what is in use stay within the limit; for allocations made under a [`Room`] that is held for
/// all of them, so that promises do not count.
pub fn fits(bytes: u64) -> bool {
    let limit = LIMIT.load(Ordering::Relaxed);
    limit == UNLIMITED || in_use().unwrap_or(0).saturating_add(bytes) <= limit
}

/// Bytes of memory that this process has in use, as Linux tells it.
pub fn in_use() -> Option<u64> {
    status("VmRSS:")
}

/// The most bytes that it ever had in use.
pub fn peak() -> Option<u64> {
    status("VmHWM:")
}

fn status(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

/// `1.3 GB`, in powers of ten.
pub fn in_words(bytes: u64) -> String {
    match bytes as f64 {
        b if b < 1e6 => format!("{:.0} kB", b * 1e-3),
        b if b < 1e9 => format!("{:.0} MB", b * 1e-6),
        b => format!("{:.2} GB", b * 1e-9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_read_well() {
        assert_eq!(in_words(999), "1 kB");
        assert_eq!(in_words(1_320_000_000), "1.32 GB");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn what_is_in_use_is_known_and_no_more_than_the_peak() {
        let used = in_use().expect("told");
        // A test process is larger than a megabyte and smaller than the machine.
        assert!((1 << 20..1 << 40).contains(&used) && used <= peak().expect("told"));
    }

    #[test]
    fn without_a_limit_there_is_room_for_anything() {
        assert!(fits(u64::MAX));
    }
}
