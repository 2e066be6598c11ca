//! Surface points several at a time: the same bits as [`Vertex::new`] gives one by one, in vector code.

use crate::base::geometry::Placement;
use crate::base::hit::{Hit, HitBatch};
use crate::base::lanes::{Columns, LANES, LocalRays, Surfaces};
use crate::base::ray::RayBatch;
use crate::base::shape::{Needs, Shape};
use crate::base::vertex::{Body, Vertex, facing, frame_along, placed, start, texture_footprint};
use crate::math::frame::Frame;
use crate::math::simd::{Kernel, dispatch};
use glam::{Vec2, Vec3};

/// Some surface points, and what they are made from. Kept from call to call; only what was found last can be read.
#[derive(Default)]
pub struct Vertices {
    given: Given,
    rays: LocalRays,
    hits: [Hit; LANES],
    surfaces: Surfaces,
    points: Points,
    rest: [Rest; LANES],
}

/// Rays as they were given.
#[derive(Default)]
struct Given {
    o: Columns<f32>,
    d: Columns<f32>,
    tnear: [f32; LANES],
    tfar: [f32; LANES],
}

/// The part of each vertex that every scene needs.
#[derive(Default)]
struct Points {
    p: Columns<f32>,
    error: Columns<f32>,
    ng: Columns<f32>,
    s: Columns<f32>,
    t: Columns<f32>,
    ns: Columns<f32>,
    wo: Columns<f32>,
    lift: Columns<f32>,
    distance: [f32; LANES],
}

/// The other part.
#[derive(Clone, Copy, Default)]
struct Rest {
    uv: Vec2,
    footprint: f32,
    path: u64,
    prim: u32,
    object: u32,
    slot: u32,
}

/// What all hits of a call have in common.
pub struct Met<'a> {
    /// The shape.
    pub shape: &'a dyn Shape,
    /// Of the shape's group, if it is not the root.
    pub placement: Option<&'a Placement>,
    /// The leaf's object.
    pub object: u32,
    /// Whether the object has more than one material.
    pub many_slots: bool,
    /// Width of the rays per unit of distance.
    pub spread: f32,
    /// What the materials of the scene read.
    pub needs: Needs,
}

impl Vertices {
    /// The points of some hits, at most [`LANES`], given by their numbers.
    pub fn find(&mut self, rays: &RayBatch, hits: &HitBatch, which: &[u32], met: &Met) {
        let n = which.len().min(LANES);
        self.gather(rays, hits, &which[..n]);
        let Vertices { given, rays, surfaces, points, .. } = self;
        dispatch(Localise { given, placement: met.placement, rays });
        met.shape.refine_batch(rays, &self.hits[..n], met.needs, surfaces);
        dispatch(Face { d: &given.d, placement: met.placement, surfaces, points });
        for (rest, hit) in self.rest.iter_mut().zip(&self.hits[..n]) {
            let slot = if met.many_slots { met.shape.material_slot(hit.prim) as u32 } else { 0 };
            *rest = Rest { path: hit.path, prim: hit.prim, object: met.object, slot, ..Rest::default() };
        }
        if met.needs != Needs::default() {
            self.textured(n, met);
        }
    }

    /// Rays and hits into their lanes.
    #[inline(always)]
    fn gather(&mut self, rays: &RayBatch, hits: &HitBatch, which: &[u32]) {
        // Slices of one length, so that a number is checked once and not for every column.
        let len = rays.len();
        let [ox, oy, oz] = [&rays.ox[..len], &rays.oy[..len], &rays.oz[..len]];
        let [dx, dy, dz] = [&rays.dx[..len], &rays.dy[..len], &rays.dz[..len]];
        let (tnear, tfar) = (&rays.tnear[..len], &rays.tfar[..len]);
        let (t, prim, path) = (&hits.t[..len], &hits.prim[..len], &hits.path[..len]);
        let given = &mut self.given;
        for (lane, &i) in which.iter().take(LANES).enumerate() {
            let i = i as usize;
            given.o.set(lane, Vec3::new(ox[i], oy[i], oz[i]));
            given.d.set(lane, Vec3::new(dx[i], dy[i], dz[i]));
            (given.tnear[lane], given.tfar[lane]) = (tnear[i], tfar[i]);
            self.hits[lane] = Hit { t: t[i], prim: prim[i], path: path[i] };
        }
    }

    /// What only textures and stretched highlights need.
    fn textured(&mut self, n: usize, met: &Met) {
        let s = &self.surfaces;
        for lane in 0..n {
            let tangents = [s.dpdu[lane], s.dpdv[lane]];
            let [dpdu, dpdv] = match met.placement {
                None => tangents,
                Some(pl) => tangents.map(|v| pl.to_render.matrix3 * v),
            };
            let length = self.given.d.get(lane).as_dvec3().length();
            let width = f64::from(met.spread) * s.t[lane] * length;
            self.rest[lane].uv = s.uv[lane];
            self.rest[lane].footprint = texture_footprint([dpdu, dpdv], width);
            self.points.set_frame(lane, &frame_along(self.points.ns.get(lane), dpdu));
        }
    }

    /// Sets a point that was worked out elsewhere.
    pub fn set(&mut self, lane: usize, v: &Vertex) {
        let points = &mut self.points;
        points.p.set(lane, v.p);
        points.error.set(lane, v.error);
        points.ng.set(lane, v.ng);
        points.set_frame(lane, &v.frame);
        points.wo.set(lane, v.wo);
        points.lift.set(lane, v.lift);
        points.distance[lane] = v.t;
        let Vertex { uv, footprint, path, prim, object, slot, .. } = *v;
        self.rest[lane] = Rest { uv, footprint, path, prim, object, slot };
    }

    /// The object and the slot of its material, if they are the same for the first `n`, at least one.
    pub fn look(&self, n: usize) -> Option<(u32, u32)> {
        let look = |rest: &Rest| (rest.object, rest.slot);
        let first = look(&self.rest[0]);
        self.rest[1..n].iter().all(|rest| look(rest) == first).then_some(first)
    }

    /// Local directions to the viewers.
    pub fn local_viewers(&self, out: &mut Columns<f32>) {
        dispatch(Viewers { points: &self.points, out });
    }

    /// Rays that leave in local directions.
    pub fn leave(&self, local: &Columns<f32>, out: &mut Leaving) {
        dispatch(Leave { points: &self.points, local, out });
    }

    /// The point in a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Vertex {
        let (points, rest) = (&self.points, &self.rest[lane]);
        Vertex {
            p: points.p.get(lane),
            error: points.error.get(lane),
            ng: points.ng.get(lane),
            frame: points.frame(lane),
            wo: points.wo.get(lane),
            uv: rest.uv,
            footprint: rest.footprint,
            t: points.distance[lane],
            lift: points.lift.get(lane),
            path: rest.path,
            prim: rest.prim,
            object: rest.object,
            slot: rest.slot,
        }
    }
}

/// Rays that leave surface points.
#[derive(Default)]
pub struct Leaving {
    /// See [`Vertex::spawn_origin`].
    pub o: Columns<f32>,
    /// Their directions.
    pub d: Columns<f32>,
    /// More than 0 if [`Vertex::is_consistent`].
    pub consistent: [f32; LANES],
}

impl Points {
    #[inline(always)]
    fn frame(&self, lane: usize) -> Frame {
        Frame { s: self.s.get(lane), t: self.t.get(lane), n: self.ns.get(lane) }
    }

    #[inline(always)]
    fn set_frame(&mut self, lane: usize, f: &Frame) {
        self.s.set(lane, f.s);
        self.t.set(lane, f.t);
        self.ns.set(lane, f.n);
    }
}

/// [`super::vertex::local_ray`] of all lanes.
struct Localise<'a> {
    given: &'a Given,
    placement: Option<&'a Placement>,
    rays: &'a mut LocalRays,
}

impl Kernel for Localise<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        localise(self.given, self.placement, self.rays);
    }
}

// Functions of their own: the compiler knows of arguments, but not of a struct's fields, that they do not overlap.
#[inline(always)]
fn localise(given: &Given, placement: Option<&Placement>, rays: &mut LocalRays) {
    for l in 0..LANES {
        rays.o.set(l, given.o.get(l).as_dvec3());
        rays.d.set(l, given.d.get(l).as_dvec3());
        rays.tnear[l] = f64::from(given.tnear[l]);
        rays.tfar[l] = f64::from(given.tfar[l]);
    }
    let Some(p) = placement else { return };
    for l in 0..LANES {
        rays.o.set(l, p.from_render.transform_point3(rays.o.get(l)));
        rays.d.set(l, p.from_render.transform_vector3(rays.d.get(l)));
    }
}

/// [`Vertex::new`] of all lanes, without what only textures need.
struct Face<'a> {
    d: &'a Columns<f32>,
    placement: Option<&'a Placement>,
    surfaces: &'a mut Surfaces,
    points: &'a mut Points,
}

impl Kernel for Face<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        if let Some(placement) = self.placement {
            place(placement, self.surfaces);
        }
        face(self.d, self.surfaces, self.points);
    }
}

#[inline(always)]
fn place(placement: &Placement, s: &mut Surfaces) {
    for l in 0..LANES {
        let b = placed(&body(s, l), placement);
        s.p.set(l, b.p);
        s.error.set(l, b.error);
        s.ng.set(l, b.ng);
        s.ns.set(l, b.ns);
        s.lift.set(l, b.lift);
    }
}

#[inline(always)]
fn face(d: &Columns<f32>, s: &Surfaces, out: &mut Points) {
    for l in 0..LANES {
        let f = facing(d.get(l).as_dvec3(), &body(s, l));
        out.p.set(l, f.p);
        out.error.set(l, f.error);
        out.ng.set(l, f.ng);
        out.wo.set(l, f.wo);
        out.lift.set(l, f.lift);
        out.ns.set(l, f.ns);
        out.distance[l] = s.t[l] as f32;
    }
    for l in 0..LANES {
        out.set_frame(l, &Frame::from_z(out.ns.get(l)));
    }
}

#[inline(always)]
fn body(s: &Surfaces, lane: usize) -> Body {
    Body {
        p: s.p.get(lane),
        error: s.error.get(lane),
        ng: s.ng.get(lane),
        ns: s.ns.get(lane),
        lift: s.lift.get(lane),
    }
}

struct Viewers<'a> {
    points: &'a Points,
    out: &'a mut Columns<f32>,
}

impl Kernel for Viewers<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Viewers { points, out } = self;
        for l in 0..LANES {
            out.set(l, points.frame(l).to_local(points.wo.get(l)));
        }
    }
}

struct Leave<'a> {
    points: &'a Points,
    local: &'a Columns<f32>,
    out: &'a mut Leaving,
}

impl Kernel for Leave<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        leave(self.points, self.local, self.out);
    }
}

#[inline(always)]
fn leave(points: &Points, local: &Columns<f32>, out: &mut Leaving) {
    for l in 0..LANES {
        let (frame, ng) = (points.frame(l), points.ng.get(l));
        let w = frame.to_world(local.get(l));
        out.d.set(l, w);
        out.consistent[l] = w.dot(ng) * w.dot(frame.n);
        out.o.set(l, start(w, ng, points.p.get(l), points.lift.get(l), points.error.get(l)));
    }
}
