//! L4: how far a picture is from another, by many measures, and whether the difference is more than noise.
//!
//! [`open::open`] brings two files into one space, [`metrics`] holds the measures, one file each, [`comparison::compare`]
//! takes all figures of a pair, and [`causes`] names the usual slips. [`present`] writes tables.

pub mod causes;
pub mod comparison;
pub mod flip;
pub mod folders;
pub mod html;
pub mod invalid;
mod lanes;
pub mod limits;
pub mod metrics;
pub mod open;
pub mod pair;
pub mod present;
pub mod regions;
pub mod ssim;
pub mod statistics;
#[cfg(test)]
mod tests;
