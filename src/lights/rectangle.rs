//! Lamps of two triangles that form a rectangle: sampled as one, so that well-spread sample points stay well spread over
//! the whole of it and nothing has to be chosen.

use crate::base::mesh::TriangleMesh;
use crate::base::shape::ShapeSample;
use crate::sampling::spherical::{Rectangle, SphericalRectangle};
use glam::{DVec3, Vec2, Vec3};

/// How far edges may be from perpendicular and opposite ones from parallel, relative to their length: some roundings of
/// placed corners. Points of the rectangle that are not on the triangles are as rare.
const TOLERANCE: f64 = 2e-6;

/// Below this ratio of area to squared distance, a long side apart, it is sampled by area, as triangles of a mesh are
/// (`shapes/mesh/sample.rs`): cosine and distance then vary over it by so little that solid angle gains nothing.
const FLAT: f64 = 1e-4;

/// The rectangle that both triangles of a mesh form.
pub(super) struct RectangleLamp {
    /// Its normal is on the side that both triangles call outer.
    frame: Rectangle,
    area: f64,
    two_sided: bool,
}

impl RectangleLamp {
    /// None unless there are two triangles, which turn the same way and have all of a rectangle in common.
    pub fn of(mesh: &TriangleMesh, two_sided: bool) -> Option<Self> {
        let [first, second] = mesh.indices[..] else { return None };
        let only = |of: [u32; 3], other: [u32; 3]| {
            let mut rest = (0..3).filter(move |&i| !other.contains(&of[i]));
            rest.next().filter(|_| rest.next().is_none())
        };
        let (at, opposite) = (only(first, second)?, only(second, first)?);
        let vertex = |i: u32| Vec3::from_array(mesh.positions()[i as usize]).as_dvec3();
        let [corner, a, b] = [0, 1, 2].map(|k| vertex(first[(at + k) % 3]));
        // Both triangles run along the edge they share, in opposite directions, if they turn the same way.
        let [far, back, forth] = [0, 1, 2].map(|k| second[(opposite + k) % 3]);
        if [back, forth] != [first[(at + 2) % 3], first[(at + 1) % 3]] {
            return None;
        }
        let edges = [a - corner, b - corner];
        let [x, y] = edges.map(DVec3::length);
        let open = (vertex(far) - a - edges[1]).length();
        let right = edges[0].dot(edges[1]).abs() <= TOLERANCE * x * y && open <= TOLERANCE * x.min(y);
        let frame = Rectangle::new(corner, edges)?;
        let lamp = RectangleLamp { frame, area: x * y, two_sided };
        right.then_some(lamp)
    }

    /// The rectangle as seen from a point; None where it is to be sampled by area.
    fn seen(&self, from: DVec3) -> Option<SphericalRectangle> {
        let d2 = (self.frame.corner() - from).length_squared();
        let [x, y] = self.frame.lengths();
        if self.area < FLAT * d2 && x.max(y) * x.max(y) < 0.01 * d2 {
            return None;
        }
        SphericalRectangle::new(from, &self.frame)
    }

    /// A point of it, uniform over the solid angle, or, where that is small, over the area. None where it is seen edge
    /// on, or from the side that does not shine.
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        let o = from.as_dvec3();
        let (corner, normal) = (self.frame.corner() - o, self.frame.normal());
        if !self.two_sided && corner.dot(normal) >= 0.0 {
            return None;
        }
        let (to, pdf) = match self.seen(o) {
            Some(seen) => (seen.sample_point(Vec2::from_array(u)), Some(seen.pdf())),
            None => {
                let [x, y] = self.frame.edges();
                (corner + x * f64::from(u[0]) + y * f64::from(u[1]), None)
            }
        };
        let (wi, dist) = to.normalize_and_length();
        let pdf = pdf.unwrap_or_else(|| self.area_pdf(to));
        (pdf > 0.0 && pdf.is_finite() && dist > 0.0).then(|| ShapeSample {
            p: (o + to).as_vec3(),
            ng: normal.as_vec3(),
            uv: Vec2::ZERO,
            wi: wi.as_vec3(),
            dist: dist as f32,
            pdf,
        })
    }

    /// The density per solid angle with which [`RectangleLamp::sample`] takes the direction from `from` to its point `p`.
    pub fn pdf(&self, from: Vec3, p: Vec3) -> f32 {
        let pdf = match self.seen(from.as_dvec3()) {
            Some(seen) => seen.pdf(),
            None => self.area_pdf(p.as_dvec3() - from.as_dvec3()),
        };
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// dist^2 / (cos area), with d = dist times the unit direction.
    fn area_pdf(&self, d: DVec3) -> f32 {
        (d.length_squared() * d.length() / (self.area * self.frame.normal().dot(d).abs())) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    fn mesh(corners: [[f32; 3]; 4], indices: [[u32; 3]; 2]) -> TriangleMesh {
        TriangleMesh::new(corners.to_vec(), indices.to_vec())
    }

    const LAMP: [[f32; 3]; 4] =
        [[343.0, 548.8, 227.0], [213.0, 548.8, 227.0], [213.0, 548.8, 332.0], [343.0, 548.8, 332.0]];

    #[test]
    fn rectangles_are_known_whatever_the_order_of_their_corners() {
        for indices in
            [[[0, 1, 2], [0, 2, 3]], [[1, 2, 0], [2, 3, 0]], [[0, 1, 3], [3, 1, 2]], [[2, 1, 0], [3, 2, 0]]]
        {
            let lamp = RectangleLamp::of(&mesh(LAMP, indices), true).unwrap_or_else(|| panic!("{indices:?}"));
            assert!((lamp.area - 130.0 * 105.0).abs() < 1e-6, "{indices:?}: {}", lamp.area);
            // The corners of the first triangle run counter-clockwise where it is seen from outside.
            let [a, b, c] = indices[0].map(|i| Vec3::from(LAMP[i as usize]).as_dvec3());
            assert!((b - a).cross(c - a).normalize().dot(lamp.frame.normal()) > 1.0 - 1e-12, "{indices:?}");
        }
        // Turned against each other; a fold; a kite; a parallelogram; a third corner of its own.
        assert!(RectangleLamp::of(&mesh(LAMP, [[0, 1, 2], [0, 3, 2]]), true).is_none());
        let changed = |i: usize, p: [f32; 3]| {
            let mut corners = LAMP;
            corners[i] = p;
            RectangleLamp::of(&mesh(corners, [[0, 1, 2], [0, 2, 3]]), true)
        };
        assert!(changed(3, [343.0, 549.8, 332.0]).is_none() && changed(3, [353.0, 548.8, 332.0]).is_none());
        let parallelogram = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.5, 1.0, 0.0], [0.5, 1.0, 0.0]];
        assert!(RectangleLamp::of(&mesh(parallelogram, [[0, 1, 2], [0, 2, 3]]), true).is_none());
        assert!(RectangleLamp::of(&mesh(LAMP, [[0, 1, 2], [1, 0, 2]]), true).is_none());
    }

    /// Samples weighted by their density measure the solid angle, which two spherical triangles give as well; from near
    /// and from where it is sampled by area.
    #[test]
    fn samples_cover_the_rectangle_with_their_density() {
        use crate::sampling::spherical::SphericalTriangle;
        let lamp = RectangleLamp::of(&mesh(LAMP, [[0, 1, 2], [0, 2, 3]]), true).expect("a rectangle");
        let v = LAMP.map(Vec3::from);
        for from in [[278.0, 0.0, 279.0], [260.0, 546.8, 260.0], [900.0, 540.0, 300.0], [2e4, -3e4, 100.0]] {
            let from = Vec3::from(from);
            let halves = [[v[0], v[1], v[2]], [v[0], v[2], v[3]]]
                .map(|t| SphericalTriangle::new(from, t).expect("seen"));
            let want = f64::from(halves[0].solid_angle()) + f64::from(halves[1].solid_angle());
            let mut rng = TestRng::new(7);
            let (mut sum, n) = (0.0, 4000);
            for _ in 0..n {
                let s = lamp.sample(from, rng.vec2().to_array()).expect("seen");
                // On the plane and within, to the rounding of a point; the density is that of the way back.
                let (x, z) = ((s.p.x - 278.0).abs(), (s.p.z - 279.5).abs());
                assert!((s.p.y - 548.8).abs() < 1e-3 && x < 65.001 && z < 52.501, "{from}: {}", s.p);
                assert!((lamp.pdf(from, s.p) / s.pdf - 1.0).abs() < 1e-4, "{from}");
                sum += 1.0 / f64::from(s.pdf);
            }
            // By solid angle all weigh the same; by area they vary as distance and cosine do, by 1e-2 from there.
            assert!((sum / f64::from(n) / want - 1.0).abs() < 1e-3, "{from}: {} {want}", sum / f64::from(n));
        }
    }
}
