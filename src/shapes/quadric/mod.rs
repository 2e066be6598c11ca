//! The primitive behind spheres and ellipsoids: the unit sphere under an affine map, solved in double precision.

mod area;
mod sample;
mod tangent;

use crate::base::ray::MAX_COORDINATE;
use crate::base::shape::{Dropped, LocalRay, Needs, Placed, Shape, ShapeSample, ShapeSource, Surface};
use crate::error::{Error, Result};
use crate::math::aabb::{Aabb, DAabb};
use crate::math::bounds::U64;
use crate::math::quadric::{project_to_unit_sphere, unit_sphere_roots};
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A quadric before it is placed.
pub struct QuadricSource {
    /// From the unit sphere to object space.
    to_object: DAffine3,
}

impl QuadricSource {
    /// An ellipsoid with its axes along x, y and z; the semi-axes are more than 0.
    pub fn new(center: DVec3, semi_axes: DVec3) -> Self {
        let matrix3 = DMat3::from_diagonal(semi_axes);
        QuadricSource { to_object: DAffine3 { matrix3, translation: center } }
    }
}

impl ShapeSource for QuadricSource {
    fn bounds(&self) -> DAabb {
        bounds(&self.to_object)
    }

    fn support(&self, directions: &[DVec3]) -> Vec<f64> {
        let m = &self.to_object;
        directions.iter().map(|d| m.translation.dot(*d) + (m.matrix3.transpose() * *d).length()).collect()
    }

    fn place(self: Arc<Self>, to_group: &DAffine3) -> Result<Placed> {
        let shape = Arc::new(Quadric::new(*to_group * self.to_object)?);
        Ok(Placed { shape, dropped: Dropped::default() })
    }

    fn describe(&self) -> String {
        describe(Ball::of(&self.to_object).is_some())
    }
}

/// The box around the image of the unit sphere: its half sides are the lengths of the map's rows.
fn bounds(m: &DAffine3) -> DAabb {
    let rows = m.matrix3.transpose();
    let half = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
    // A few roundings of both, outwards.
    let half = half * (1.0 + 8.0 * U64) + m.translation.abs() * (4.0 * U64);
    DAabb::new(m.translation - half, m.translation + half)
}

fn describe(ball: bool) -> String {
    if ball { "sphere".into() } else { "ellipsoid".into() }
}

/// A quadric that is a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ball {
    center: DVec3,
    radius: f64,
}

impl Ball {
    /// Whether the map keeps angles (up to rounding of its entries): then the image of the unit sphere is a sphere.
    fn of(m: &DAffine3) -> Option<Ball> {
        let gram = m.matrix3.transpose() * m.matrix3;
        let r2 = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
        let off = gram - DMat3::from_diagonal(DVec3::splat(r2));
        let largest = off.to_cols_array().into_iter().fold(0f64, |a, x| a.max(x.abs()));
        (largest <= 1e-12 * r2).then(|| Ball { center: m.translation, radius: r2.sqrt() })
    }
}

/// A sphere or ellipsoid in the space of its group; one primitive.
pub struct Quadric {
    /// From the unit sphere to the group.
    to_group: DAffine3,
    /// Inverse of its linear part.
    from_group: DMat3,
    ball: Option<Ball>,
    area: f64,
    bounds: Aabb,
}

impl Quadric {
    /// The image of the unit sphere under `to_group`. Errors if the map cannot be inverted, or the image lies too
    /// far away.
    fn new(to_group: DAffine3) -> Result<Self> {
        let from_group = to_group.matrix3.inverse();
        let det = to_group.matrix3.determinant();
        if !(det.abs() > 0.0 && det.is_finite() && from_group.is_finite()) {
            return Err(Error::Usage(
                "a sphere is placed by a transform that cannot be inverted; scales must be finite and not 0"
                    .into(),
            ));
        }
        let bounds = bounds(&to_group).to_f32();
        if !bounds.is_finite() || bounds.max_abs() > MAX_COORDINATE {
            return Err(Error::Usage(
                "a sphere lies too far from the origin of its group to be represented".into(),
            ));
        }
        let cofactor = from_group.transpose() * det;
        let ball = Ball::of(&to_group);
        let area = match ball {
            Some(b) => 2.0 * TAU * b.radius * b.radius,
            None => area::ellipsoid(&cofactor),
        };
        Ok(Quadric { to_group, from_group, ball, area, bounds })
    }

    /// A point of the group's space in that of the unit sphere.
    #[inline]
    fn to_unit(&self, p: DVec3) -> DVec3 {
        // The difference first: next to the surface it is nearly exact.
        self.from_group * (p - self.to_group.translation)
    }

    /// A vector along the outward normal at the image of `w` on the unit sphere.
    #[inline]
    fn normal(&self, w: DVec3) -> DVec3 {
        // M^-T w, written as a product from the left.
        DVec3::new(
            self.from_group.x_axis.dot(w),
            self.from_group.y_axis.dot(w),
            self.from_group.z_axis.dot(w),
        )
    }

    #[inline]
    fn roots(&self, ray: &LocalRay) -> Option<[f64; 2]> {
        unit_sphere_roots(self.to_unit(ray.o), self.from_group * ray.d)
    }
}

/// Texture coordinates of a point of the unit sphere: u runs once around +y, from -x over +z, +x and -z (to the
/// right for who looks at it from outside), v from 0 at -y to 1 at +y, by angle.
fn uv(w: DVec3) -> Vec2 {
    let u = (-w.z).atan2(w.x) / TAU + 0.5;
    // From both coordinates: an arc cosine alone loses the digits next to the poles.
    let v = w.x.hypot(w.z).atan2(-w.y) / PI;
    Vec2::new(u as f32, v as f32)
}

/// Derivatives of a point of the unit sphere along u and v.
fn tangents(w: DVec3) -> [DVec3; 2] {
    let s = w.x.hypot(w.z);
    let (cos, sin) = if s > 0.0 { (w.x / s, -w.z / s) } else { (1.0, 0.0) };
    [DVec3::new(w.z, 0.0, -w.x) * TAU, DVec3::new(-w.y * cos, s, w.y * sin) * PI]
}

impl Shape for Quadric {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn primitive_count(&self) -> u32 {
        1
    }

    fn primitive_bounds(&self, _prim: u32) -> Aabb {
        self.bounds
    }

    fn intersect(&self, ray: &LocalRay, _prim: u32) -> Option<f64> {
        let roots = self.roots(ray)?;
        roots.into_iter().find(|&t| t >= ray.tnear && t <= ray.tfar)
    }

    fn refine(&self, ray: &LocalRay, _prim: u32, hint: f32, needs: Needs) -> Surface {
        let (o, d) = (self.to_unit(ray.o), self.from_group * ray.d);
        let hint = f64::from(hint);
        let t = match unit_sphere_roots(o, d) {
            Some([near, far]) if (far - hint).abs() < (near - hint).abs() => far,
            Some([near, _]) => near,
            // A kernel that transforms rays in f32 may hit what the exact ray just passes by.
            None => -o.dot(d) / d.length_squared(),
        };
        let w = project_to_unit_sphere(o + d * t);
        let p = self.to_group.transform_point3(w);
        let mut surface = Surface {
            t,
            p,
            // Kernels test by the code above: its roundings, with room to spare.
            error: (p.abs() + self.to_group.translation.abs() + DVec3::splat((p - ray.o).length()))
                * (16.0 * U64),
            ng: self.normal(w),
            ns: self.normal(w),
            uv: Vec2::ZERO,
            dpdu: DVec3::ZERO,
            dpdv: DVec3::ZERO,
            lift: DVec3::ZERO,
        };
        if needs.uv || needs.tangents {
            surface.uv = uv(w);
            [surface.dpdu, surface.dpdv] = tangents(w).map(|t| self.to_group.matrix3 * t);
        }
        surface
    }

    fn primitive_area(&self, _prim: u32) -> f64 {
        self.area
    }

    fn sample_primitive(&self, _prim: u32, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        sample::sample(self, from.as_dvec3(), u)
    }

    fn pdf_primitive(&self, _prim: u32, from: Vec3, wi: Vec3, p: Vec3, ng: Vec3) -> f32 {
        sample::pdf(self, from.as_dvec3(), wi.as_dvec3(), p.as_dvec3(), ng.as_dvec3())
    }

    fn transformed(&self, by: &DAffine3) -> Result<Arc<dyn Shape>> {
        Ok(Arc::new(Quadric::new(*by * self.to_group)?))
    }

    fn memory(&self) -> u64 {
        size_of::<Self>() as u64
    }

    fn describe(&self) -> String {
        describe(self.ball.is_some())
    }
}
