//! L4: measurements. [`rays`] asks how fast kernels answer rays, and whether they answer alike; [`error`] how fast a
//! render comes near the truth.

pub mod error;
pub mod rays;

/// Told how far a measurement is.
pub trait Progress {
    /// So many steps will come.
    fn begin(&self, _steps: u64) {}

    /// A step begins.
    fn step(&self, _what: &str) {}
}

/// No progress is shown.
pub struct Silent;

impl Progress for Silent {}
