//! Error against time: a scene is rendered at a ladder of sample counts, each several times with independent seeds, and
//! compared with a converged reference.
//!
//! [`sweep`] makes variants of the settings, [`reference`](mod@reference) the truth, [`run`] renders in turn, [`measure`]
//! compares, [`analyse`] draws conclusions from a [`record`], and [`present`] shows them. Records of other renderers
//! have the same form (benches/peers) and stand in the same tables and plots.

pub mod analyse;
pub mod measure;
pub mod peers;
pub mod present;
pub mod record;
pub mod reference;
pub mod run;
pub mod sweep;
#[cfg(test)]
mod tests;
