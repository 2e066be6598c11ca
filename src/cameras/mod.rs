//! Cameras: one file a kind, each with its registry row.

mod equirectangular;
mod frame_bounds;
pub mod perspective;

pub use frame_bounds::{UpAxis, View, frame, frame_bounds};

use crate::base::camera::CameraSource;
use crate::base::registry::Row;

/// Every kind of camera.
pub static REGISTRY: &[Row<dyn CameraSource>] = &[perspective::ROW, equirectangular::ROW];

#[cfg(test)]
mod tests;
