//! The same rays through every kernel, mode, call form and instruction set.
//!
//! [`sets`] makes rays of five kinds once, or [`mod@file`] replays them. [`forms`] is the table of ways to ask for them,
//! [`kernels`] builds what is to be asked, and [`measure`] runs all rows over them in turn. [`agree`] compares the
//! answers, [`record`] is what is kept of it all, [`verdict`] compares two records, and [`present`] shows one.

pub mod agree;
pub mod file;
pub mod forms;
pub mod growth;
pub mod kernels;
pub mod measure;
pub mod peer;
pub mod present;
pub mod record;
pub mod sets;
#[cfg(test)]
mod tests;
pub mod verdict;
