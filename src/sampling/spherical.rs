//! Directions to triangles and rectangles, uniform over the solid angle they fill as seen from a point. In f64: the
//! formulas cancel for small solid angles, and what is left of f64 then still suffices.

use glam::{DVec3, Vec2, Vec3};

use crate::math::trig::sin_cos_2pi_f64;

/// Below this solid angle (steradians) both constructors give `None`: sampling by area is then as good to one part in
/// a million (a target of angle a varies by a^2), and cheaper.
pub const SMALLEST_SOLID_ANGLE: f64 = 1e-8;

/// A triangle as seen from a point. Arvo, "Stratified Sampling of Spherical Triangles", 1995, in the form that Peters
/// found ("BRDF Importance Sampling for Polygonal Lights", 2021, section 4): no angle of the triangle is computed, and
/// nothing is divided by a small one.
#[derive(Debug, Clone, Copy)]
pub struct SphericalTriangle {
    /// Unit vectors to the vertices.
    corners: [DVec3; 3],
    /// |det(a, b, c)|, a.c + b.c, 1 + a.b.
    g: [f64; 3],
    solid_angle: f64,
}

/// 2 atan2(|det|, 1 + ab + bc + ca) and its parts: Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle",
/// 1983. The determinant is taken of differences, which are exact for near corners.
fn solid_angle_parts(a: DVec3, b: DVec3, c: DVec3) -> ([f64; 3], f64) {
    let g = [a.dot((b - a).cross(c - a)).abs(), (a + b).dot(c), 1.0 + a.dot(b)];
    (g, 2.0 * g[0].atan2(g[1] + g[2]))
}

impl SphericalTriangle {
    /// The triangle with vertices `v` as seen from `p`. `None` if it fills less than [`SMALLEST_SOLID_ANGLE`], or if
    /// `p` is a vertex, or anything is not finite.
    pub fn new(p: Vec3, v: [Vec3; 3]) -> Option<Self> {
        let p = p.as_dvec3();
        let [a, b, c] = v.map(|v| (v.as_dvec3() - p).try_normalize());
        let corners = [a?, b?, c?];
        let (g, solid_angle) = solid_angle_parts(corners[0], corners[1], corners[2]);
        // NaN compares false.
        (solid_angle >= SMALLEST_SOLID_ANGLE).then_some(SphericalTriangle { corners, g, solid_angle })
    }

    /// Steradians, in [SMALLEST_SOLID_ANGLE, 2 pi].
    pub fn solid_angle(&self) -> f32 {
        self.solid_angle as f32
    }

    /// Density of [`SphericalTriangle::sample`] per solid angle, inside the triangle.
    pub fn pdf(&self) -> f32 {
        (1.0 / self.solid_angle) as f32
    }

    /// A unit direction from the point to the triangle.
    pub fn sample(&self, u: Vec2) -> Vec3 {
        let [a, b, c] = self.corners;
        // c2 on the arc from a to c, so that (a, b, c2) has the share u.x of the area. With r on the bisector of a and
        // c2, tan(area / 2) = det(a, b, r) / ((a + b) . r): linear in r.
        let half = sin_cos_2pi_f64(0.5 * f64::from(u.x) * self.solid_angle / std::f64::consts::TAU);
        let r = a * (self.g[0] * half.cos - self.g[1] * half.sin) + c * (self.g[2] * half.sin);
        let c2 = r * (2.0 * a.dot(r) / r.length_squared()) - a;
        // On the arc from b to c2 the area grows with 1 - cos of the angle at the centre.
        let h = f64::from(u.y) * 0.5 * (b - c2).length_squared();
        let side = (c2 - b * b.dot(c2)).normalize_or_zero();
        (b * (1.0 - h) + side * (h * (2.0 - h)).max(0.0).sqrt()).as_vec3()
    }

    /// The point of the square that [`SphericalTriangle::sample`] maps to the unit direction `w` inside the triangle.
    pub fn invert(&self, w: Vec3) -> Vec2 {
        let [a, b, c] = self.corners;
        let w = w.as_dvec3();
        let on_arc = b.cross(w).cross(c.cross(a));
        let c2 = on_arc.normalize_or_zero() * on_arc.dot(a + c).signum();
        let v = (b - w).length_squared() / (b - c2).length_squared();
        let u = if c2 == DVec3::ZERO { 0.0 } else { solid_angle_parts(a, b, c2).1 / self.solid_angle };
        Vec2::new(u as f32, if v.is_finite() { v as f32 } else { 0.0 }).clamp(Vec2::ZERO, Vec2::ONE)
    }
}

/// A rectangle as seen from a point. Urena, Fajardo, King, "An Area-Preserving Parametrization for Spherical
/// Rectangles", 2013.
#[derive(Debug, Clone, Copy)]
pub struct SphericalRectangle {
    /// Unit vectors along the edges and away from the point, in whose terms all else is given.
    axes: [DVec3; 3],
    /// The rectangle is [x0, x1] x [y0, y1] at height z, which is positive here.
    x: [f64; 2],
    y: [f64; 2],
    z: f64,
    solid_angle: f64,
}

/// A rectangle, with what does not depend on where it is seen from.
#[derive(Debug, Clone, Copy)]
pub struct Rectangle {
    corner: DVec3,
    /// Along the edges, and across both.
    axes: [DVec3; 3],
    lengths: [f64; 2],
}

impl Rectangle {
    /// From a corner and the two edges from it, which must be perpendicular. None where they span nothing.
    pub fn new(corner: DVec3, edges: [DVec3; 2]) -> Option<Self> {
        let (x, y) = (edges[0].try_normalize()?, edges[1].try_normalize()?);
        let normal = x.cross(y).try_normalize()?;
        Some(Rectangle { corner, axes: [x, y, normal], lengths: edges.map(DVec3::length) })
    }

    /// A corner.
    pub fn corner(&self) -> DVec3 {
        self.corner
    }

    /// The edges from it.
    pub fn edges(&self) -> [DVec3; 2] {
        [self.axes[0] * self.lengths[0], self.axes[1] * self.lengths[1]]
    }

    /// Their lengths.
    pub fn lengths(&self) -> [f64; 2] {
        self.lengths
    }

    /// Unit vector along the first edge times the second.
    pub fn normal(&self) -> DVec3 {
        self.axes[2]
    }
}

/// A complex number whose argument is the signed solid angle of the plane at height z > 0 between the lines through its
/// foot and x, from y0 to y1. Between the foot and (x, y) that is atan(x y / (z r)), so one of four such angles; sums
/// of angles are products, and one arc tangent at the end gives the same as four.
fn strip(x: f64, [y0, y1]: [f64; 2], z: f64) -> [f64; 2] {
    let corner = |y: f64| [z * (x * x + y * y + z * z).sqrt(), x * y];
    times(corner(y1), conjugate(corner(y0)))
}

fn times([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    [a * c - b * d, a * d + b * c]
}

fn conjugate([re, im]: [f64; 2]) -> [f64; 2] {
    [re, -im]
}

fn argument([re, im]: [f64; 2]) -> f64 {
    im.atan2(re)
}

/// Solid angle of [x0, x1] x [y0, y1] at height z > 0.
fn rectangle_solid_angle(x: [f64; 2], y: [f64; 2], z: f64) -> f64 {
    let angle = argument(times(strip(x[1], y, z), conjugate(strip(x[0], y, z))));
    // More than pi comes out negative; what is hardly negative is the rounding of nothing.
    if angle < -SMALLEST_SOLID_ANGLE { angle + std::f64::consts::TAU } else { angle }
}

impl SphericalRectangle {
    /// The rectangle as seen from `p`. `None` if it fills less than [`SMALLEST_SOLID_ANGLE`], or if `p` lies in its
    /// plane, or anything is not finite.
    pub fn new(p: DVec3, rectangle: &Rectangle) -> Option<Self> {
        let Rectangle { corner, axes: [x_axis, y_axis, normal], lengths } = *rectangle;
        let d = corner - p;
        let z_axis = normal * d.dot(normal).signum();
        let (x0, y0, z) = (d.dot(x_axis), d.dot(y_axis), d.dot(z_axis));
        let (x, y) = ([x0, x0 + lengths[0]], [y0, y0 + lengths[1]]);
        let solid_angle = rectangle_solid_angle(x, y, z);
        let usable = z > 0.0 && solid_angle >= SMALLEST_SOLID_ANGLE;
        usable.then_some(SphericalRectangle { axes: [x_axis, y_axis, z_axis], x, y, z, solid_angle })
    }

    /// Steradians, in [SMALLEST_SOLID_ANGLE, 2 pi].
    pub fn solid_angle(&self) -> f32 {
        self.solid_angle as f32
    }

    /// Density of [`SphericalRectangle::sample`] per solid angle, inside the rectangle.
    pub fn pdf(&self) -> f32 {
        (1.0 / self.solid_angle) as f32
    }

    /// Sine of the elevation, out of the plane through the line at distance `d` from the point, of its point `y`.
    fn sine(y: f64, d: f64) -> f64 {
        y / (d * d + y * y).sqrt()
    }

    /// A unit direction from the point to the rectangle.
    pub fn sample(&self, u: Vec2) -> Vec3 {
        self.sample_point(u).normalize().as_vec3()
    }

    /// As [`SphericalRectangle::sample`], as far as the rectangle.
    pub fn sample_point(&self, u: Vec2) -> DVec3 {
        let x = self.edge_at(f64::from(u.x) * self.solid_angle);
        let d = (x * x + self.z * self.z).sqrt();
        // On a line of constant x the area grows with the sine of the elevation.
        let (h0, h1) = (Self::sine(self.y[0], d), Self::sine(self.y[1], d));
        let h = h0 + f64::from(u.y) * (h1 - h0);
        let y = h * d / ((1.0 - h) * (1.0 + h)).max(1e-300).sqrt();
        let y = y.clamp(self.y[0], self.y[1]);
        self.axes[0] * x + self.axes[1] * y + self.axes[2] * self.z
    }

    /// The x up to which the rectangle fills `area` steradians.
    fn edge_at(&self, area: f64) -> f64 {
        let [x0, x1] = self.x;
        let z = self.z;
        // The strip from 0 to x fills T(x) = asin(b1 s) - asin(b0 s), with b = y / sqrt(y^2 + z^2) and
        // s = x / sqrt(x^2 + z^2). T is linear in the number that asks, so s is found from
        // sin^2 T = s^2 (b0^2 + b1^2 - 2 b0 b1 cos T), which follows from the cosine of that difference.
        let t = argument(strip(x0, self.y, z)) + area;
        let half = sin_cos_2pi_f64(0.5 * t / std::f64::consts::TAU);
        let [b0, b1] = self.y.map(|y| y / (y * y + z * z).sqrt());
        let spread = (b1 - b0) * (b1 - b0) + 4.0 * b0 * b1 * half.sin * half.sin;
        let s = 2.0 * half.sin * half.cos / spread.max(1e-300).sqrt();
        (z * s / ((1.0 - s) * (1.0 + s)).max(1e-300).sqrt()).clamp(x0, x1)
    }

    /// The point of the square that [`SphericalRectangle::sample`] maps to the unit direction `w` towards the rectangle.
    pub fn invert(&self, w: Vec3) -> Vec2 {
        let w = w.as_dvec3();
        let scale = self.z / w.dot(self.axes[2]);
        let (x, y) = (w.dot(self.axes[0]) * scale, w.dot(self.axes[1]) * scale);
        let d = (x * x + self.z * self.z).sqrt();
        let (h0, h1) = (Self::sine(self.y[0], d), Self::sine(self.y[1], d));
        let u = rectangle_solid_angle([self.x[0], x], self.y, self.z) / self.solid_angle;
        let v = (Self::sine(y, d) - h0) / (h1 - h0);
        Vec2::new(u as f32, v as f32).clamp(Vec2::ZERO, Vec2::ONE)
    }
}

#[cfg(test)]
mod tests;
