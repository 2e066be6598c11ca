//! Geometry in the space of its group: bounds, tests, the surface at a hit, sampling.

use crate::base::hit::Hit;
use crate::base::lanes::{LANES, LocalRays, Surfaces};
use crate::base::mesh::TriangleMesh;
use crate::error::Result;
use crate::math::aabb::{Aabb, DAabb};
use glam::{DAffine3, DVec3, Vec2, Vec3};
use std::sync::Arc;

/// A ray in the space of a shape's group, in double precision, so that the transform into it loses nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalRay {
    /// Origin.
    pub o: DVec3,
    /// Direction, not normalised: t means the same as in render space.
    pub d: DVec3,
    /// Smallest t that counts.
    pub tnear: f64,
    /// Largest t that counts.
    pub tfar: f64,
}

/// The surface at a refined hit, in the space of the shape's group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Distance in lengths of the ray's direction.
    pub t: f64,
    /// The point, on the primitive to the precision of `error`.
    pub p: DVec3,
    /// How far `p` may lie from the primitive as a kernel tests it, per axis, in absolute terms: the rounding
    /// of the shape's own data and of an f32 test of this primitive.
    pub error: DVec3,
    /// Geometric normal, outward, any length.
    pub ng: DVec3,
    /// Shading normal on the side of `ng`, any length; equals `ng` where the shape is flat.
    pub ns: DVec3,
    /// Texture coordinates; (0, 0) where none were asked for.
    pub uv: Vec2,
    /// Derivatives of the point along u and v; zero where none were asked for.
    pub dpdu: DVec3,
    /// See `dpdu`.
    pub dpdv: DVec3,
    /// From `p` to the smooth surface that `ns` pretends, for rays that leave (Hanika, "Hacking the shadow
    /// terminator", Ray Tracing Gems II, ch. 4); zero where the shape is flat.
    pub lift: DVec3,
}

/// What the materials of a scene read at a vertex; what nobody reads is not computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Needs {
    /// Texture coordinates.
    pub uv: bool,
    /// Tangents `dpdu`, `dpdv`.
    pub tangents: bool,
}

impl Needs {
    /// Everything.
    pub const ALL: Needs = Needs { uv: true, tangents: true };

    /// What either needs.
    pub fn or(self, o: Needs) -> Needs {
        Needs { uv: self.uv || o.uv, tangents: self.tangents || o.tangents }
    }
}

/// A point sampled on a primitive, seen from a reference point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSample {
    /// The point.
    pub p: Vec3,
    /// Unit geometric normal, outward.
    pub ng: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Unit direction from the reference point.
    pub wi: Vec3,
    /// Distance from the reference point.
    pub dist: f32,
    /// Density per solid angle at the reference point.
    pub pdf: f32,
}

/// Object geometry of one or many primitives. All of a shape is in the space of its group; where it was placed
/// there by a transform, [`Shape::transformed`] has baked it in.
pub trait Shape: Send + Sync {
    /// Encloses everything.
    fn bounds(&self) -> Aabb;

    /// The number of primitives; hits name one.
    fn primitive_count(&self) -> u32;

    /// Encloses a primitive; rounded outwards.
    fn primitive_bounds(&self, prim: u32) -> Aabb;

    /// The triangles, for kernels that test triangles themselves. A shape that has none is tested by
    /// [`Shape::intersect`].
    fn triangles(&self) -> Option<&TriangleMesh> {
        None
    }

    /// The smallest t in `[tnear, tfar]` at which the ray meets the primitive, in double precision.
    fn intersect(&self, ray: &LocalRay, prim: u32) -> Option<f64>;

    /// The surface where the ray meets the primitive, which a kernel says it does. Must not depend on the
    /// kernel's own t: fixed operations in a fixed order from the ray and the primitive alone. `hint` is that t,
    /// for choosing between several crossings only.
    fn refine(&self, ray: &LocalRay, prim: u32, hint: f32, needs: Needs) -> Surface;

    /// As [`Shape::refine`], bit for bit, of at most [`LANES`] hits, one a lane; `out` is set in as many lanes.
    fn refine_batch(&self, rays: &LocalRays, hits: &[Hit], needs: Needs, out: &mut Surfaces) {
        for (lane, hit) in hits.iter().enumerate().take(LANES) {
            out.set(lane, &self.refine(&rays.get(lane), hit.prim, hit.t, needs));
        }
    }

    /// Which of its object's materials a primitive has.
    fn material_slot(&self, _prim: u32) -> usize {
        0
    }

    /// Area of a primitive.
    fn primitive_area(&self, prim: u32) -> f64;

    /// A point on a primitive as seen from `from`, by solid angle where a stable formula exists, else by area;
    /// the density is per solid angle either way. None if nothing of it can be seen from there.
    fn sample_primitive(&self, prim: u32, from: Vec3, u: [f32; 2]) -> Option<ShapeSample>;

    /// The density per solid angle with which [`Shape::sample_primitive`] from `from` takes the direction `wi`,
    /// which meets the primitive at `p` with the unit normal `ng`.
    fn pdf_primitive(&self, prim: u32, from: Vec3, wi: Vec3, p: Vec3, ng: Vec3) -> f32;

    /// The same geometry after `by`, every primitive under its old number, for lights that stand in placed groups.
    /// Errors where the result cannot be represented.
    fn transformed(&self, by: &DAffine3) -> Result<Arc<dyn Shape>>;

    /// Bytes held.
    fn memory(&self) -> u64;

    /// For people: "mesh, 871414 triangles".
    fn describe(&self) -> String;
}

/// Primitives left out when a shape was placed: they can be hit by no ray, and no kernel ever sees them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    /// With an index past the last vertex.
    pub out_of_range: u64,
    /// With a corner that is not a finite number, or lies beyond [`crate::base::ray::MAX_COORDINATE`].
    pub not_finite: u64,
    /// Without area in single precision.
    pub degenerate: u64,
}

impl Dropped {
    /// All together.
    pub fn total(&self) -> u64 {
        self.out_of_range + self.not_finite + self.degenerate
    }
}

impl std::fmt::Display for Dropped {
    /// "2 primitives with coordinates that are not finite, 1 without area".
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let parts = [
            (self.out_of_range, "with indices past the last vertex"),
            (self.not_finite, "with coordinates that are not finite or too large"),
            (self.degenerate, "without area"),
        ];
        let mut noun = if self.total() == 1 { " primitive" } else { " primitives" };
        for (i, (n, what)) in parts.into_iter().filter(|p| p.0 > 0).enumerate() {
            write!(f, "{}{n}{noun} {what}", if i > 0 { ", " } else { "" })?;
            noun = "";
        }
        if self.total() == 0 { f.write_str("no primitives: it has none") } else { Ok(()) }
    }
}

impl std::ops::Add for Dropped {
    type Output = Dropped;

    fn add(self, o: Dropped) -> Dropped {
        Dropped {
            out_of_range: self.out_of_range + o.out_of_range,
            not_finite: self.not_finite + o.not_finite,
            degenerate: self.degenerate + o.degenerate,
        }
    }
}

/// A shape in the space of its group, ready for kernels.
#[derive(Clone)]
pub struct Placed {
    /// The shape; it may have no primitive at all, if all were dropped.
    pub shape: Arc<dyn Shape>,
    /// What was left out.
    pub dropped: Dropped,
}

/// A shape in double precision and in its object's own space, as a file or a scene describes it.
pub trait ShapeSource: Send + Sync {
    /// Encloses everything that can be placed; empty if there is nothing.
    fn bounds(&self) -> DAabb;

    /// For each direction the largest p . d of any point of the shape: where a plane that moves in against `d` first
    /// touches it. No more than what [`ShapeSource::bounds`] says, which the default goes by; minus infinity if there
    /// is nothing. Frames a shape more closely than its bounds can.
    fn support(&self, directions: &[DVec3]) -> Vec<f64> {
        let corners = self.bounds();
        if corners.is_empty() {
            return vec![f64::NEG_INFINITY; directions.len()];
        }
        let corners = corners.corners();
        directions.iter().map(|d| corners.iter().fold(f64::NEG_INFINITY, |a, c| a.max(c.dot(*d)))).collect()
    }

    /// The shape after the affine map `to_group`, which includes recentring and scale: the one step from double to
    /// single precision, and the one place where it is decided which primitives are valid. Consumes the source so
    /// that large arrays can be moved where nobody else holds them. Errors where the map cannot be inverted.
    fn place(self: Arc<Self>, to_group: &DAffine3) -> Result<Placed>;

    /// For people: "mesh, 871414 triangles".
    fn describe(&self) -> String;
}
