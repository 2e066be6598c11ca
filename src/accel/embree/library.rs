//! Which Embree runs: its version, its file, and whether that was compiled with assertions.

use super::handles::Device;
use crate::error::Result;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The library that was loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    /// "3.13.5".
    pub version: String,
    /// Its file, where the system tells.
    pub path: Option<PathBuf>,
    /// Whether it was compiled with assertions; none where the file cannot be read, or Embree is a part of the program.
    pub assertions: Option<bool>,
}

/// Finds it out, once.
///
/// # Errors
/// [`crate::Error::Internal`] if Embree cannot start.
pub fn loaded() -> Result<Library> {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    if let Some(known) = LIBRARY.get() {
        return Ok(known.clone());
    }
    let version = Device::new(0, None)?.version();
    let path = mapped_file();
    let assertions = path.as_deref().and_then(calls_assert);
    Ok(LIBRARY.get_or_init(|| Library { version, path, assertions }).clone())
}

/// The file of the library among those that Linux says are mapped.
fn mapped_file() -> Option<PathBuf> {
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let files = maps.lines().filter_map(|l| l.find('/').map(|at| Path::new(&l[at..])));
    let is_embree = |p: &&Path| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("libembree"));
    files.into_iter().find(is_embree).map(Path::to_owned)
}

/// Larger files than any Embree are not read.
const MAX_BYTES: u64 = 1 << 30;

/// Whether the library asks the C library for the function that a failed `assert` calls. Every translation unit that
/// was compiled without NDEBUG needs it, and its name stands in the table of dynamic symbols, which no `strip`
/// removes; compiled with NDEBUG, nothing of Embree does.
fn calls_assert(path: &Path) -> Option<bool> {
    if std::fs::metadata(path).ok()?.len() > MAX_BYTES {
        return None;
    }
    let file = std::fs::read(path).ok()?;
    // Names of the table end with a zero; the one before it ends so too.
    let name = b"\0__assert_fail\0";
    Some(memchr::memmem::find(&file, name).is_some())
}
