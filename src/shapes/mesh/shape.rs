//! A placed triangle mesh.

use super::MissingUv;
use super::batch::refine_batch;
use super::place::transformed;
use super::refine::{Triangle, TrianglePoint, intersect, test_error};
use super::sample;
use super::shading::shading;
use crate::base::hit::Hit;
use crate::base::lanes::{LocalRays, Surfaces};
use crate::base::mesh::TriangleMesh;
use crate::base::shape::{LocalRay, Needs, Shape, ShapeSample, Surface};
use crate::error::Result;
use crate::math::aabb::Aabb;
use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use std::sync::Arc;

/// Valid triangles in the space of their group.
pub struct MeshShape {
    mesh: TriangleMesh,
    bounds: Aabb,
    missing_uv: MissingUv,
    /// Whether placing exchanged the last two corners of each triangle.
    mirrored: bool,
}

impl MeshShape {
    /// From a mesh that holds what [`TriangleMesh`] promises, and its bounds.
    pub(super) fn new(mesh: TriangleMesh, bounds: Aabb) -> Self {
        MeshShape { mesh, bounds, missing_uv: MissingUv::default(), mirrored: false }
    }

    /// With another choice of uv where there are none, for a mesh in source order before it was placed by `by`.
    pub(super) fn with_missing_uv(self, missing_uv: MissingUv, by: &DAffine3) -> Self {
        MeshShape { missing_uv, mirrored: by.matrix3.determinant() < 0.0, ..self }
    }

    #[inline]
    fn corners(&self, prim: u32) -> [DVec3; 3] {
        self.mesh.corners(prim).map(|v| v.as_dvec3())
    }

    #[inline]
    fn corner_uvs(&self, prim: u32) -> [DVec2; 3] {
        if self.mesh.uvs.is_empty() {
            return match (self.missing_uv, self.mirrored) {
                (MissingUv::Square, _) => [DVec2::ZERO, DVec2::X, DVec2::ONE],
                (MissingUv::Barycentric, false) => [DVec2::ZERO, DVec2::X, DVec2::Y],
                (MissingUv::Barycentric, true) => [DVec2::ZERO, DVec2::Y, DVec2::X],
            };
        }
        self.mesh.indices[prim as usize].map(|i| Vec2::from_array(self.mesh.uvs[i as usize]).as_dvec2())
    }

    #[inline]
    fn uv(&self, prim: u32, b1: f64, b2: f64) -> Vec2 {
        let [p, q, r] = self.corner_uvs(prim);
        (p + (q - p) * b1 + (r - p) * b2).as_vec2()
    }

    /// Texture coordinates, and the derivatives of the point along them.
    fn texture(&self, prim: u32, [b1, b2]: [f64; 2]) -> (Vec2, [DVec3; 2]) {
        let triangle = Triangle::new(self.mesh.corners(prim));
        (self.uv(prim, b1, b2), tangents(self.corner_uvs(prim), triangle.e1, triangle.e2))
    }
}

/// Derivatives of the point along u and v; zero where the uvs have no area.
fn tangents(uv: [DVec2; 3], e1: DVec3, e2: DVec3) -> [DVec3; 2] {
    let (a, b) = (uv[1] - uv[0], uv[2] - uv[0]);
    let inv = 1.0 / a.perp_dot(b);
    if !inv.is_finite() {
        return [DVec3::ZERO; 2];
    }
    [(e1 * b.y - e2 * a.y) * inv, (e2 * a.x - e1 * b.x) * inv]
}

impl Shape for MeshShape {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn primitive_count(&self) -> u32 {
        self.mesh.indices.len() as u32
    }

    fn primitive_bounds(&self, prim: u32) -> Aabb {
        Aabb::from_points(self.mesh.corners(prim))
    }

    fn triangles(&self) -> Option<&TriangleMesh> {
        Some(&self.mesh)
    }

    fn intersect(&self, ray: &LocalRay, prim: u32) -> Option<f64> {
        intersect(ray, self.corners(prim))
    }

    fn refine(&self, ray: &LocalRay, prim: u32, _hint: f32, needs: Needs) -> Surface {
        let corners = self.mesh.corners(prim);
        let triangle = Triangle::new(corners);
        let TrianglePoint { b1, b2, t } = triangle.locate(ray);
        let (p, ng) = (triangle.at(b1, b2), triangle.n);
        let p32 = p.as_vec3();
        let mut surface = Surface {
            t,
            p,
            error: test_error(corners, p32, ng),
            ng,
            ns: ng,
            uv: Vec2::ZERO,
            dpdu: DVec3::ZERO,
            dpdv: DVec3::ZERO,
            lift: DVec3::ZERO,
        };
        if !self.mesh.normals.is_empty() {
            let s = shading(self.mesh.corner_normals(prim), [b1, b2], corners, p32, ng);
            (surface.ns, surface.lift) = (s.ns, s.lift);
        }
        if needs.uv || needs.tangents {
            (surface.uv, [surface.dpdu, surface.dpdv]) = self.texture(prim, [b1, b2]);
        }
        surface
    }

    fn refine_batch(&self, rays: &LocalRays, hits: &[Hit], needs: Needs, out: &mut Surfaces) {
        let weights = refine_batch(&self.mesh, rays, hits, out);
        if needs.uv || needs.tangents {
            for (lane, hit) in hits.iter().enumerate() {
                let b = [weights.b1[lane], weights.b2[lane]];
                let (uv, [dpdu, dpdv]) = self.texture(hit.prim, b);
                (out.uv[lane], out.dpdu[lane], out.dpdv[lane]) = (uv, dpdu, dpdv);
            }
        }
        for (lane, hit) in hits.iter().enumerate().filter(|(lane, _)| weights.is_odd(*lane)) {
            out.set(lane, &self.refine(&rays.get(lane), hit.prim, hit.t, needs));
        }
    }

    fn material_slot(&self, prim: u32) -> usize {
        self.mesh.material_slots.get(prim as usize).map_or(0, |&s| s as usize)
    }

    fn primitive_area(&self, prim: u32) -> f64 {
        0.5 * Triangle::new(self.mesh.corners(prim)).n.length()
    }

    fn sample_primitive(&self, prim: u32, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        let s = sample::sample(self.mesh.corners(prim), from, u)?;
        Some(ShapeSample { uv: self.uv(prim, s.b[0], s.b[1]), ..s.sample })
    }

    fn pdf_primitive(&self, prim: u32, from: Vec3, _wi: Vec3, p: Vec3, _ng: Vec3) -> f32 {
        sample::pdf(self.mesh.corners(prim), from, p)
    }

    fn transformed(&self, by: &DAffine3) -> Result<Arc<dyn Shape>> {
        let mirrored = self.mirrored != (by.matrix3.determinant() < 0.0);
        Ok(Arc::new(MeshShape { missing_uv: self.missing_uv, mirrored, ..transformed(&self.mesh, by)? }))
    }

    fn memory(&self) -> u64 {
        self.mesh.memory()
    }

    fn describe(&self) -> String {
        format!("mesh, {} triangles", self.mesh.indices.len())
    }
}
