//! From points on the film to rays.

use crate::base::ray::RayBatch;
use crate::base::space::RenderSpace;
use crate::error::Result;
use glam::DVec3;
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

/// A camera whose rays all start in one point and meet its film as a plane: where on the film a point is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Where all rays start, in render space.
    pub eye: DVec3,
    /// Unit direction of sight.
    pub forward: DVec3,
    /// Change of the direction by a pixel to the right and down, where its part along `forward` is 1; at right angles to
    /// each other and to `forward`.
    pub steps: [DVec3; 2],
    /// Middle of the film, pixels.
    pub middle: [f64; 2],
}

impl Projection {
    /// Distance of a point from the plane through the eye, positive in front.
    #[inline]
    pub fn depth(&self, p: DVec3) -> f64 {
        (p - self.eye).dot(self.forward)
    }

    /// Where the line through a point in front of the camera meets the film, in pixels from its left top.
    #[inline]
    pub fn film(&self, p: DVec3) -> [f64; 2] {
        let v = p - self.eye;
        let depth = v.dot(self.forward);
        [0, 1].map(|a| self.middle[a] + v.dot(self.steps[a]) / (depth * self.steps[a].length_squared()))
    }
}

/// A camera in render space.
pub trait Camera: Send + Sync {
    /// Fills origins, directions (of unit length) and extents of `rays`, resized to the batch; keys are not set.
    fn fill_rays(&self, samples: &FilmSamples, rays: &mut RayBatch);

    /// Whether lens points are read at all.
    fn has_lens(&self) -> bool {
        false
    }

    /// Where points are seen; None if rays start in more than one point, or do not meet a plane.
    fn projection(&self) -> Option<Projection> {
        None
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
