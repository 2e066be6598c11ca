//! Columns of a fixed length, for what is worked out several at a time: loops over them become vector code.

use crate::base::shape::{LocalRay, Surface};
use glam::{DVec3, Vec2, Vec3};

/// How many are worked on together: one vector of f32 on processors that have the widest.
pub const LANES: usize = 16;

/// Vectors as three columns.
#[derive(Debug, Clone, Copy, Default)]
pub struct Columns<T>(pub [[T; LANES]; 3]);

impl Columns<f32> {
    /// The vector in a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Vec3 {
        Vec3::new(self.0[0][lane], self.0[1][lane], self.0[2][lane])
    }

    /// Sets the vector in a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: Vec3) {
        (self.0[0][lane], self.0[1][lane], self.0[2][lane]) = (v.x, v.y, v.z);
    }
}

impl<T: Copy> Columns<T> {
    /// Those in these lanes, in this order.
    #[inline]
    pub fn picked(&self, order: &[usize; LANES]) -> Self {
        Columns(self.0.each_ref().map(|column| order.map(|lane| column[lane])))
    }
}

impl Columns<f64> {
    /// The vector in a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> DVec3 {
        DVec3::new(self.0[0][lane], self.0[1][lane], self.0[2][lane])
    }

    /// Sets the vector in a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: DVec3) {
        (self.0[0][lane], self.0[1][lane], self.0[2][lane]) = (v.x, v.y, v.z);
    }
}

/// `a` if `first`, else `b`: both are at hand, and loops stay without a branch.
#[inline(always)]
pub fn choose(first: bool, a: DVec3, b: DVec3) -> DVec3 {
    let of = |a: f64, b: f64| if first { a } else { b };
    DVec3::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}

/// Rays in the space of a shape's group: see [`LocalRay`].
#[derive(Debug, Clone, Default)]
pub struct LocalRays {
    /// Origins.
    pub o: Columns<f64>,
    /// Directions.
    pub d: Columns<f64>,
    /// See [`LocalRay::tnear`].
    pub tnear: [f64; LANES],
    /// See [`LocalRay::tfar`].
    pub tfar: [f64; LANES],
}

impl LocalRays {
    /// Sets the ray in a lane.
    #[inline]
    pub fn set(&mut self, lane: usize, r: &LocalRay) {
        self.o.set(lane, r.o);
        self.d.set(lane, r.d);
        (self.tnear[lane], self.tfar[lane]) = (r.tnear, r.tfar);
    }

    /// The ray in a lane.
    #[inline]
    pub fn get(&self, lane: usize) -> LocalRay {
        LocalRay { o: self.o.get(lane), d: self.d.get(lane), tnear: self.tnear[lane], tfar: self.tfar[lane] }
    }
}

/// Surfaces at refined hits: see [`Surface`]. `uv`, `dpdu` and `dpdv` mean something only where they were asked for.
#[derive(Debug, Clone, Default)]
pub struct Surfaces {
    /// See [`Surface::t`].
    pub t: [f64; LANES],
    /// See [`Surface::p`].
    pub p: Columns<f64>,
    /// See [`Surface::error`].
    pub error: Columns<f64>,
    /// See [`Surface::ng`].
    pub ng: Columns<f64>,
    /// See [`Surface::ns`].
    pub ns: Columns<f64>,
    /// See [`Surface::lift`].
    pub lift: Columns<f64>,
    /// See [`Surface::uv`].
    pub uv: [Vec2; LANES],
    /// See [`Surface::dpdu`].
    pub dpdu: [DVec3; LANES],
    /// See [`Surface::dpdu`].
    pub dpdv: [DVec3; LANES],
}

impl Surfaces {
    /// The surface in a lane.
    pub fn get(&self, lane: usize) -> Surface {
        Surface {
            t: self.t[lane],
            p: self.p.get(lane),
            error: self.error.get(lane),
            ng: self.ng.get(lane),
            ns: self.ns.get(lane),
            uv: self.uv[lane],
            dpdu: self.dpdu[lane],
            dpdv: self.dpdv[lane],
            lift: self.lift.get(lane),
        }
    }

    /// Sets all of a lane.
    pub fn set(&mut self, lane: usize, s: &Surface) {
        self.t[lane] = s.t;
        self.p.set(lane, s.p);
        self.error.set(lane, s.error);
        self.ng.set(lane, s.ng);
        self.ns.set(lane, s.ns);
        self.lift.set(lane, s.lift);
        (self.uv[lane], self.dpdu[lane], self.dpdv[lane]) = (s.uv, s.dpdu, s.dpdv);
    }
}
