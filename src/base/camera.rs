//! From points on the film to rays.

use crate::base::ray::RayBatch;
use crate::base::space::RenderSpace;
use crate::error::Result;
use std::sync::Arc;

/// A batch of film samples, as columns of one length.
#[derive(Debug, Clone, Copy)]
pub struct FilmSamples<'a> {
    /// Film position in pixels from the left; pixel i spans [i, i + 1).
    pub x: &'a [f32],
    /// Film position in pixels from the top.
    pub y: &'a [f32],
    /// Points of the unit square for the lens; empty if the camera has none.
    pub lens_u: &'a [f32],
    /// See `lens_u`.
    pub lens_v: &'a [f32],
}

/// A camera in render space.
pub trait Camera: Send + Sync {
    /// Fills origins, directions (of unit length) and extents of `rays`, resized to the batch; keys are not set.
    fn fill_rays(&self, samples: &FilmSamples, rays: &mut RayBatch);

    /// Whether lens points are read at all.
    fn has_lens(&self) -> bool {
        false
    }

    /// The width of a pixel's ray at distance 1 (radians, near enough), for texture footprints.
    fn pixel_spread(&self) -> f32;
}

/// The picture a camera fills.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FilmSize {
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
}

impl FilmSize {
    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }
}

/// A camera in world space, as a scene describes it.
pub trait CameraSource: Send + Sync {
    /// The camera in render space for a film. Errors where it cannot be represented there.
    fn place(&self, space: &RenderSpace, film: FilmSize) -> Result<Arc<dyn Camera>>;
}
