//! A shaded surface point: where it is, how well that is known, and how a path goes on from it.

use crate::base::geometry::Placement;
use crate::base::hit::Hit;
use crate::base::lanes::choose;
use crate::base::light::Receiver;
use crate::base::ray::Ray;
use crate::base::shape::{LocalRay, Surface};
use crate::math::bounds::UNDERFLOW;
use crate::math::frame::Frame;
use glam::{DMat3, DVec3, Vec2, Vec3};

/// Half of f32's epsilon: the largest relative error of one rounding.
const UNIT_ROUNDOFF: f64 = f32::EPSILON as f64 * 0.5;

/// A surface point in render space.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// The point.
    pub p: Vec3,
    /// Bound on the distance between `p` and the surface as any kernel tests it, per axis.
    pub error: Vec3,
    /// Unit geometric normal, outward.
    pub ng: Vec3,
    /// Shading frame; its z is the unit shading normal, on the side of `ng`.
    pub frame: Frame,
    /// Unit direction back along the ray.
    pub wo: Vec3,
    /// Texture coordinates; (0, 0) where no material asks for them.
    pub uv: Vec2,
    /// Width of the ray's footprint in uv units; 0 where nothing asks.
    pub footprint: f32,
    /// Distance travelled by the ray, in lengths of its direction.
    pub t: f32,
    /// See [`Surface::lift`].
    pub lift: Vec3,
    /// The instance path of the leaf.
    pub path: u64,
    /// Primitive within the leaf.
    pub prim: u32,
    /// The leaf's object in the scene's table.
    pub object: u32,
    /// Which of the object's materials.
    pub slot: u32,
}

/// What a vertex is, beside its surface.
#[derive(Debug, Clone, Copy)]
pub struct Origin {
    /// The kernel's hit.
    pub hit: Hit,
    /// The leaf's object.
    pub object: u32,
    /// Which of the object's materials.
    pub slot: u32,
    /// Width of the ray per unit of distance.
    pub spread: f32,
}

impl Vertex {
    /// From a surface in the space of its group, the group's placement, and the ray that met it.
    pub fn new(ray: &Ray, surface: &Surface, placement: Option<&Placement>, origin: Origin) -> Self {
        let Surface { p, error, ng, ns, lift, .. } = *surface;
        let body = Body { p, error, ng, ns, lift };
        let body = placement.map_or(body, |pl| placed(&body, pl));
        let d = ray.d.as_dvec3();
        let f = facing(d, &body);
        let [dpdu, dpdv] = match placement {
            None => [surface.dpdu, surface.dpdv],
            Some(pl) => [surface.dpdu, surface.dpdv].map(|v| pl.to_render.matrix3 * v),
        };
        let footprint = texture_footprint([dpdu, dpdv], origin.spread as f64 * surface.t * d.length());
        Vertex {
            p: f.p,
            error: f.error,
            ng: f.ng,
            frame: frame_along(f.ns, dpdu),
            wo: f.wo,
            uv: surface.uv,
            footprint,
            t: surface.t as f32,
            lift: f.lift,
            path: origin.hit.path,
            prim: origin.hit.prim,
            object: origin.object,
            slot: origin.slot,
        }
    }

    /// Where a ray in direction `w` starts: moved off the surface, to the side of `w`, by the bound on the error
    /// of `p` (Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th ed., 6.8.6), never by a global epsilon.
    #[inline]
    pub fn spawn_origin(&self, w: Vec3) -> Vec3 {
        start(w, self.ng, self.p, self.lift, self.error)
    }

    /// A ray that leaves in direction `w`, without end.
    #[inline]
    pub fn spawn(&self, w: Vec3, key: u32) -> Ray {
        Ray::new(self.spawn_origin(w), w, key)
    }

    /// A ray towards a point at `dist` along `w` from here, ending short of what stands there by a few roundings.
    #[inline]
    pub fn spawn_to(&self, w: Vec3, dist: f32, key: u32) -> Ray {
        let o = self.spawn_origin(w);
        if !dist.is_finite() {
            return Ray { o, d: w, tnear: 0.0, tfar: dist, key };
        }
        // Aimed anew from where it starts: along `w` it would run beside what was sampled by the step off this surface,
        // and meet a lamp that it grazes before its end.
        let to = self.p.as_dvec3() + w.as_dvec3() * f64::from(dist) - o.as_dvec3();
        let length = to.length();
        // At the lamp's own point there is no direction to it.
        if length == 0.0 || length.is_nan() {
            return Ray { o, d: w, tnear: 0.0, tfar: 0.0, key };
        }
        // A relative 1e-5 is 80 roundings: more than the error of any sampled point at that distance, and too
        // thin to hide a blocker.
        Ray { o, d: (to / length).as_vec3(), tnear: 0.0, tfar: (length * (1.0 - 1e-5)) as f32, key }
    }

    /// This point as a light sees it: the side on which `wo` lies.
    #[inline]
    pub fn receiver(&self) -> Receiver {
        let side = if self.wo.dot(self.ng) >= 0.0 { 1.0 } else { -1.0 };
        Receiver { p: self.p, ng: self.ng * side, ns: self.frame.n * side }
    }

    /// This point as a light sees it where light from both sides counts.
    #[inline]
    pub fn receiver_all_round(&self) -> Receiver {
        Receiver { p: self.p, ng: Vec3::ZERO, ns: Vec3::ZERO }
    }

    /// Whether `wi` lies on the same side of the shading normal as of the geometric one. Where the two disagree,
    /// light would leak through the surface: nothing is scattered there.
    #[inline]
    pub fn is_consistent(&self, wi: Vec3) -> bool {
        wi.dot(self.ng) * wi.dot(self.frame.n) > 0.0
    }
}

/// The ray in the space of a placed group, without loss.
pub fn local_ray(ray: &Ray, placement: Option<&Placement>) -> LocalRay {
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    let (o, d) = match placement {
        None => (o, d),
        Some(p) => (p.from_render.transform_point3(o), p.from_render.transform_vector3(d)),
    };
    LocalRay { o, d, tnear: ray.tnear as f64, tfar: ray.tfar as f64 }
}

/// The part of a [`Surface`] that every vertex is made from, in the space of its group or in render space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    pub p: DVec3,
    pub error: DVec3,
    pub ng: DVec3,
    pub ns: DVec3,
    pub lift: DVec3,
}

/// A [`Body`] as a ray sees it: the fields of [`Vertex`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Facing {
    pub p: Vec3,
    pub error: Vec3,
    pub ng: Vec3,
    pub ns: Vec3,
    pub wo: Vec3,
    pub lift: Vec3,
}

/// What a ray in direction `d` sees of a body in render space. Without a branch, for loops over many.
#[inline(always)]
pub(super) fn facing(d: DVec3, s: &Body) -> Facing {
    let ng = s.ng.normalize();
    let wo = -d / d.length();
    // Seen from a side on which the interpolated normal turns away (at silhouettes), no frame around it has the
    // viewer and the light on consistent sides: there the geometric normal stands in, and nothing turns black.
    let differs = (s.ns.x != s.ng.x) | (s.ns.y != s.ng.y) | (s.ns.z != s.ng.z);
    let smooth = differs & (s.ns.dot(wo) * ng.dot(wo) > 0.0);
    let ns = choose(smooth, s.ns.normalize(), ng);
    // The rounding of p itself to f32.
    let error = s.error + s.p.abs() * UNIT_ROUNDOFF;
    Facing {
        p: s.p.as_vec3(),
        error: round_up(error),
        ng: ng.as_vec3(),
        ns: ns.as_vec3(),
        wo: wo.as_vec3(),
        lift: s.lift.as_vec3(),
    }
}

/// Carries a surface through its placement. A kernel transforms rays in f32, so its idea of where the surface is
/// is off by four roundings (three products, their sum) of |M^-1| |p| + |t|: that is carried back by |M| and added.
#[inline(always)]
pub(super) fn placed(s: &Body, pl: &Placement) -> Body {
    let m = pl.to_render.matrix3;
    let p = pl.to_render.transform_point3(s.p);
    let back = abs(pl.from_render.matrix3) * p.abs() + pl.from_render.translation.abs();
    // Where coordinates are zero, what is left of those four operations is their underflow.
    let error = abs(m) * (s.error + back * (4.0 * UNIT_ROUNDOFF * 1.01) + DVec3::splat(4.0 * UNDERFLOW))
        // ... and where a kernel maps its hit forward again.
        + (abs(m) * s.p.abs() + pl.to_render.translation.abs()) * (4.0 * UNIT_ROUNDOFF * 1.01);
    // Normals go by the inverse transpose; a mirroring placement keeps outward outward this way.
    let normals = pl.from_render.matrix3.transpose();
    Body { p, error, ng: normals * s.ng, ns: normals * s.ns, lift: m * s.lift }
}

#[inline(always)]
fn abs(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

#[inline(always)]
fn round_up(v: DVec3) -> Vec3 {
    // One rounding up at most; 1 + 2 epsilon covers it.
    v.as_vec3() * (1.0 + 2.0 * f32::EPSILON)
}

/// See [`Vertex::spawn_origin`]. Without a branch, for loops over many.
#[inline(always)]
pub(super) fn start(w: Vec3, ng: Vec3, p: Vec3, lift: Vec3, error: Vec3) -> Vec3 {
    let outward = w.dot(ng) >= 0.0;
    let pick = |a: f32, b: f32| if outward { a } else { b };
    let n = Vec3::new(pick(ng.x, -ng.x), pick(ng.y, -ng.y), pick(ng.z, -ng.z));
    let distance = n.abs().dot(error);
    let lifted = p + lift;
    let base = Vec3::new(pick(lifted.x, p.x), pick(lifted.y, p.y), pick(lifted.z, p.z));
    let o = base + n * distance;
    // The sum was rounded, perhaps towards the surface: step once more, away from it.
    Vec3::new(step(o.x, n.x), step(o.y, n.y), step(o.z, n.z))
}

/// From `x` to a neighbour on the side of `n`, the next or the one after it. By arithmetic rather than by bits: nothing
/// here could be predicted.
#[inline(always)]
fn step(x: f32, n: f32) -> f32 {
    // |x| epsilon is one to two units in the last place; the smallest normal number steps off zero.
    let away = (x.abs() * f32::EPSILON + f32::MIN_POSITIVE).copysign(n);
    if n == 0.0 { x } else { x + away }
}

/// The shading frame: its x follows `dpdu` where that is known, so that stretched highlights do.
pub(super) fn frame_along(n: Vec3, dpdu: DVec3) -> Frame {
    let along = dpdu.try_normalize().and_then(|u| Frame::from_zx(n, u.as_vec3()));
    along.unwrap_or_else(|| Frame::from_z(n))
}

/// Width of a ray's footprint in uv units: its width in space over the longer tangent. Isotropic and without the
/// obliquity of the surface, so never wider than the truth.
pub(super) fn texture_footprint(tangents: [DVec3; 2], width: f64) -> f32 {
    let scale = tangents[0].length_squared().max(tangents[1].length_squared());
    if scale > 0.0 { (width / scale.sqrt()) as f32 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    fn vertex(dpdu: DVec3, placement: Option<&Placement>) -> Vertex {
        let (p, ng) = (DVec3::new(0.0, 0.0, 1.0), DVec3::Z);
        let zero = DVec3::ZERO;
        let surface = Surface {
            t: 4.0,
            p,
            error: zero,
            ng,
            ns: ng,
            uv: Vec2::ZERO,
            dpdu,
            dpdv: 0.5 * dpdu.length() * DVec3::Y,
            lift: zero,
        };
        let hit = Hit { path: 0, prim: 0, t: 4.0 };
        let origin = Origin { hit, object: 0, slot: 0, spread: 0.01 };
        Vertex::new(&Ray::new(Vec3::new(0.0, 0.0, 5.0), -Vec3::Z, 0), &surface, placement, origin)
    }

    #[test]
    fn frames_and_footprints_follow_the_placed_tangents() {
        // Turned by a quarter about z and scaled by 3: u points along y, and a unit of u is 6 wide.
        let m =
            DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2) * DAffine3::from_scale(DVec3::splat(3.0));
        let placement = Placement { to_render: m, from_render: m.inverse() };
        let v = vertex(2.0 * DVec3::X, Some(&placement));
        assert!((v.frame.s - Vec3::Y).length() < 1e-6 && v.frame.n == Vec3::Z, "{:?}", v.frame);
        // 0.01 radians at distance 4.
        assert!((v.footprint - 0.04 / 6.0).abs() < 1e-6, "{}", v.footprint);
        let v = vertex(2.0 * DVec3::X, None);
        assert!((v.frame.s - Vec3::X).length() < 1e-6, "{:?}", v.frame);
        assert!((v.footprint - 0.04 / 2.0).abs() < 1e-6, "{}", v.footprint);
    }

    #[test]
    fn without_tangents_any_frame_will_do() {
        for dpdu in [DVec3::ZERO, DVec3::Z, DVec3::NAN] {
            let v = vertex(dpdu, None);
            assert_eq!(v.frame.n, Vec3::Z);
            assert!((v.frame.s.cross(v.frame.t) - v.frame.n).length() < 1e-6);
        }
    }
}
