//! L4: how a scene becomes a film.

pub mod film;
pub mod fixed;
