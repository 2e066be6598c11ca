//! Helpers shared by the unit tests.

use std::path::PathBuf;

/// The folder of shared test data, or `None` (with a note) where it is absent.
///
/// # Panics
/// Where it is absent and `SKYLIT_REQUIRE_DATA=1`, so that a machine that should have it cannot skip silently.
pub fn data_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("SKYLIT_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    if dir.is_dir() {
        return Some(dir);
    }
    let required = std::env::var("SKYLIT_REQUIRE_DATA").is_ok_and(|v| v == "1");
    assert!(!required, "SKYLIT_REQUIRE_DATA=1, but {} is not a folder", dir.display());
    println!("skipped: no SKYLIT_DATA");
    None
}
