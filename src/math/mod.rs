//! L0: geometry and exact arithmetic helpers.

pub mod aabb;
pub mod frame;
