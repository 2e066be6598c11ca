//! From points on the film to rays.

use crate::base::ray::RayBatch;

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
