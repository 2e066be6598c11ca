//! Rays made fit for kernels that work in single precision, without loss: from where they enter the bounds of what they
//! may meet, along directions of sane length.

use crate::base::geometry::Geometry;
use crate::base::ray::MAX_COORDINATE;
use crate::base::shape::LocalRay;
use crate::error::{Error, Result};
use crate::math::aabb::{Aabb, DAabb};
use glam::DVec3;

/// Rays whose direction has its largest component in this range are fit for single precision as they are; others are rescaled.
pub(super) const DIRECTION: std::ops::RangeInclusive<f32> = 1e-6..=1e6;

/// A ray that single precision can carry: finite, not too far away, with a direction of sane length. `t` of the original
/// is `shift + t * scale`.
pub(super) struct Tame {
    pub(super) ray: LocalRay,
    pub(super) shift: f64,
    pub(super) scale: f64,
}

impl Tame {
    /// None for rays that are not valid, or cannot meet the bounds. Rays that start further than `reach` from the origin
    /// start where they enter the bounds instead.
    #[inline]
    pub(super) fn new(ray: &LocalRay, bounds: &DAabb, reach: f64) -> Option<Tame> {
        let (o, d) = (ray.o.abs(), ray.d.abs());
        let length = d.max_element();
        let sane = f64::from(*DIRECTION.start())..=f64::from(*DIRECTION.end());
        // `&` and comparisons that NaN fails: a maximum would lose one.
        let near = o.cmple(DVec3::splat(reach)).all() & d.cmple(DVec3::splat(*sane.end())).all();
        let segment = (ray.tnear >= 0.0) & (ray.tnear <= f64::from(f32::MAX)) & (ray.tfar >= ray.tnear);
        if !segment {
            return None;
        }
        if near && length >= *sane.start() {
            return Some(Tame { ray: *ray, shift: 0.0, scale: 1.0 });
        }
        Tame::moved(ray, bounds, length)
    }

    /// With a direction of length about 1, and from where the ray enters the bounds.
    #[cold]
    fn moved(ray: &LocalRay, bounds: &DAabb, length: f64) -> Option<Tame> {
        if !(ray.o.is_finite() && ray.d.is_finite() && length.is_normal()) {
            return None;
        }
        // A power of two, so that nothing is rounded.
        let scale = f64::from_bits((length.recip().to_bits() >> 52) << 52);
        let d = ray.d * scale;
        let (near, far) = (ray.tnear / scale, ray.tfar / scale);
        let [enter, leave] = crossing(bounds, ray.o, d)?;
        let shift = enter.max(0.0);
        let tnear = (near - shift).max(0.0);
        let tfar = (far - shift).min(leave - shift);
        let ray = LocalRay { o: ray.o + d * shift, d, tnear, tfar };
        let valid = tfar >= tnear && tnear <= f64::from(f32::MAX);
        valid.then_some(Tame { ray, shift: shift * scale, scale })
    }

    /// The original's t.
    #[cfg(feature = "embree")]
    #[inline]
    pub(super) fn restored(&self, t: f64) -> f64 {
        self.shift + t * self.scale
    }
}

/// Where a line enters and leaves a box, grown by a thousandth for the rounding of far origins; none if it misses.
fn crossing(b: &DAabb, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
    let by = extent(b) * 1e-3;
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        let (low, high) = (b.min[k] - by - o[k], b.max[k] + by - o[k]);
        if d[k] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, c) = (low / d[k], high / d[k]);
        enter = enter.max(a.min(c));
        leave = leave.min(a.max(c));
    }
    (enter <= leave && leave >= 0.0).then_some([enter, leave])
}

/// How far from the origin of a scene with these bounds a ray may start to be traced as it is. Far outside of the
/// scene, a ray that starts at its bounds instead is more accurate, and nothing can overflow.
pub(super) fn reach(bounds: Aabb) -> f64 {
    let extent = bounds.min.abs().max(bounds.max.abs()).max_element();
    (16.0 * f64::from(extent)).clamp(1e6, 16.0 * f64::from(MAX_COORDINATE))
}

/// Largest absolute coordinate.
pub(super) fn extent(b: &DAabb) -> f64 {
    b.min.abs().max(b.max.abs()).max_element()
}

/// In double precision, and larger by a relative 1e-6 and more than f32 rounding of its corners.
pub(super) fn grown(b: Aabb) -> DAabb {
    if b.is_empty() {
        return DAabb::EMPTY;
    }
    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
    let by = (min.abs().max(max.abs()).max_element() * 1e-6).max(f64::from(f32::MIN_POSITIVE));
    DAabb { min: min - by, max: max + by }
}

/// Refuses groups with coordinates beyond [`MAX_COORDINATE`].
pub(super) fn check_extent(geometry: &Geometry) -> Result<()> {
    for group in &geometry.groups {
        let b = group.bounds;
        let size = b.min.abs().max(b.max.abs());
        if !b.is_empty() && !size.cmple(glam::Vec3::splat(MAX_COORDINATE)).all() {
            return Err(Error::Internal(format!(
                "a group reaches from {} to {}, beyond {MAX_COORDINATE:e}",
                b.min, b.max
            )));
        }
    }
    Ok(())
}
