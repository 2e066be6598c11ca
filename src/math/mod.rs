//! L0: geometry and exact arithmetic helpers.

pub mod aabb;
pub mod bounds;
pub mod exact_sum;
pub mod frame;
pub mod pages;
pub mod polygon;
pub mod quadric;
pub mod rank;
pub mod simd;
pub mod triangle;
pub mod trig;

pub use aabb::{Aabb, DAabb};
pub use frame::Frame;
