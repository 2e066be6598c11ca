//! A placed triangle mesh.

use super::place::{Parts, place};
use super::refine::{TrianglePoint, intersect, locate, test_error};
use super::{Normals, sample};
use crate::base::mesh::TriangleMesh;
use crate::base::mesh_data::Positions;
use crate::base::shape::{LocalRay, Needs, Shape, ShapeSample, Surface};
use crate::error::Result;
use crate::math::aabb::Aabb;
use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use std::sync::Arc;

/// Valid triangles in the space of their group.
pub struct MeshShape {
    mesh: TriangleMesh,
    bounds: Aabb,
}

impl MeshShape {
    /// From a mesh that holds what [`TriangleMesh`] promises, and its bounds.
    pub(super) fn new(mesh: TriangleMesh, bounds: Aabb) -> Self {
        MeshShape { mesh, bounds }
    }

    #[inline]
    fn corners(&self, prim: u32) -> [DVec3; 3] {
        self.mesh.corners(prim).map(|v| v.as_dvec3())
    }

    #[inline]
    fn corner_uvs(&self, prim: u32) -> [DVec2; 3] {
        self.mesh.indices[prim as usize].map(|i| Vec2::from_array(self.mesh.uvs[i as usize]).as_dvec2())
    }

    #[inline]
    fn uv(&self, prim: u32, b: [f64; 3]) -> Vec2 {
        if self.mesh.uvs.is_empty() {
            // As if each triangle were half of a picture: pbrt's choice for meshes without uvs.
            return DVec2::new(b[1] + b[2], b[2]).as_vec2();
        }
        let [a, b_, c] = self.corner_uvs(prim);
        (a * b[0] + b_ * b[1] + c * b[2]).as_vec2()
    }
}

/// A shading normal on the side of the geometric one, and the lift to the surface it pretends.
struct Shading {
    ns: DVec3,
    lift: DVec3,
}

/// Interpolates the corners' normals `c`. The lift projects `p` onto the tangent planes of the corners and mixes the
/// results by the same weights (Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, ch. 4).
#[inline]
fn shading(c: [DVec3; 3], b: [f64; 3], v: &[DVec3; 3], p: DVec3, ng: DVec3) -> Shading {
    let ns = c[0] * b[0] + c[1] * b[1] + c[2] * b[2];
    // Normals that cancel each other say nothing.
    if ns.length_squared() <= 1e-12 {
        return Shading { ns: ng, lift: DVec3::ZERO };
    }
    let side = 1f64.copysign(ns.dot(ng));
    let above = |k: usize| c[k] * (b[k] * (c[k].dot(p - v[k]) * side).min(0.0) * -side);
    let lift = above(0) + above(1) + above(2);
    // A corner whose normal looks away from the face could push the point through it.
    let lift = if lift.dot(ng) >= 0.0 { lift } else { DVec3::ZERO };
    Shading { ns: ns * side, lift }
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
        Some(intersect(ray, self.corners(prim))?.t)
    }

    fn refine(&self, ray: &LocalRay, prim: u32, _hint: f32, needs: Needs) -> Surface {
        let v = self.corners(prim);
        let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
        let ng = e1.cross(e2);
        let TrianglePoint { b, t } = locate(ray, &v, ng, e1, e2);
        let p = v[0] + e1 * b[1] + e2 * b[2];
        let mut surface = Surface {
            t,
            p,
            error: test_error(&v, p, e1, e2, ng),
            ng,
            ns: ng,
            uv: Vec2::ZERO,
            dpdu: DVec3::ZERO,
            dpdv: DVec3::ZERO,
            lift: DVec3::ZERO,
        };
        if !self.mesh.normals.is_empty() {
            let corner = |i: u32| Vec3::from_array(self.mesh.normals[i as usize]).as_dvec3();
            let s = shading(self.mesh.indices[prim as usize].map(corner), b, &v, p, ng);
            (surface.ns, surface.lift) = (s.ns, s.lift);
        }
        if needs.uv || needs.tangents {
            surface.uv = self.uv(prim, b);
            let uv = if self.mesh.uvs.is_empty() { DEFAULT_UVS } else { self.corner_uvs(prim) };
            [surface.dpdu, surface.dpdv] = tangents(uv, e1, e2);
        }
        surface
    }

    fn material_slot(&self, prim: u32) -> usize {
        self.mesh.material_slots.get(prim as usize).map_or(0, |&s| s as usize)
    }

    fn primitive_area(&self, prim: u32) -> f64 {
        let [a, b, c] = self.corners(prim);
        0.5 * (b - a).cross(c - a).length()
    }

    fn sample_primitive(&self, prim: u32, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        let s = sample::sample(&self.corners(prim), from.as_dvec3(), u)?;
        Some(ShapeSample { uv: self.uv(prim, s.b), ..s.sample })
    }

    fn pdf_primitive(&self, prim: u32, from: Vec3, _wi: Vec3, p: Vec3, _ng: Vec3) -> f32 {
        sample::pdf(&self.corners(prim), from.as_dvec3(), p.as_dvec3())
    }

    fn transformed(&self, by: &DAffine3) -> Result<Arc<dyn Shape>> {
        let m = &self.mesh;
        let parts = Parts {
            positions: Positions::F32(m.positions().to_vec()),
            normals: m.normals.clone(),
            uvs: m.uvs.clone(),
            indices: m.indices.clone(),
            slots: m.material_slots.clone(),
        };
        Ok(place(parts, Normals::File, by)?.shape)
    }

    fn memory(&self) -> u64 {
        self.mesh.memory()
    }

    fn describe(&self) -> String {
        format!("mesh, {} triangles", self.mesh.indices.len())
    }
}

/// What [`MeshShape::uv`] gives a triangle without uvs.
const DEFAULT_UVS: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::ONE];
