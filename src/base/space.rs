//! World space and render space.
//!
//! A scene is moved to its middle and scaled to a size of about one, in double precision, before anything becomes
//! f32: so a georeferenced scene loses no digits, and one of astronomic size overflows nothing.

use glam::{DAffine3, DMat3, DVec3};

/// The map from world to render space: `render = (world - center) * scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSpace {
    /// World point that becomes the origin.
    pub center: DVec3,
    /// Render units per world unit (metre), finite and more than 0.
    pub scale: f64,
}

impl Default for RenderSpace {
    fn default() -> Self {
        RenderSpace::IDENTITY
    }
}

impl RenderSpace {
    /// Render space is world space.
    pub const IDENTITY: RenderSpace = RenderSpace { center: DVec3::ZERO, scale: 1.0 };

    /// A world point in render space.
    #[inline]
    pub fn point(&self, world: DVec3) -> DVec3 {
        (world - self.center) * self.scale
    }

    /// A render point in world space.
    #[inline]
    pub fn world_point(&self, render: DVec3) -> DVec3 {
        render / self.scale + self.center
    }

    /// A world displacement in render space.
    #[inline]
    pub fn vector(&self, world: DVec3) -> DVec3 {
        world * self.scale
    }

    /// A world length in render units.
    #[inline]
    pub fn length(&self, world: f64) -> f64 {
        world * self.scale
    }

    /// A render length in world units.
    #[inline]
    pub fn world_length(&self, render: f64) -> f64 {
        render / self.scale
    }

    /// A radiant intensity (W/sr) in render units: irradiance falls with the square of a distance that is now
    /// `scale` times as long, and radiance and irradiance must stay what they are.
    #[inline]
    pub fn intensity(&self, world: f64) -> f64 {
        world * self.scale * self.scale
    }

    /// From world to render space.
    pub fn to_render(&self) -> DAffine3 {
        let linear = DMat3::from_diagonal(DVec3::splat(self.scale));
        DAffine3 { matrix3: linear, translation: -self.center * self.scale }
    }

    /// From render to world space.
    pub fn to_world(&self) -> DAffine3 {
        DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(1.0 / self.scale)), translation: self.center }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_invert_and_keep_irradiance() {
        let s = RenderSpace { center: DVec3::new(4e6, -2.0, 7e5), scale: 0.01 };
        let w = DVec3::new(4e6 + 3.0, 5.0, 7e5 - 1.0);
        // Roundings of coordinates of 4e6 in f64.
        assert!((s.world_point(s.point(w)) - w).length() < 1e-8);
        assert!((s.to_render().transform_point3(w) - s.point(w)).length() < 1e-8);
        assert!((s.to_world().transform_point3(s.point(w)) - w).length() < 1e-8);
        let d = s.vector(DVec3::X * 2.0).length();
        assert!((s.intensity(8.0) / (d * d) - 2.0).abs() < 1e-12);
        assert_eq!(s.world_length(s.length(3.0)), 3.0);
    }
}
