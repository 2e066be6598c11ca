//! Rays, one by one and in batches.

use crate::base::directions::{DirectionLanes, Directions, LANES};
use crate::base::lanes::{Columns, LANES as MANY};
use glam::Vec3;

/// A segment `o + t d`, `tnear <= t <= tfar`; `d` need not be of unit length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction, finite and not zero; t is measured in its length.
    pub d: Vec3,
    /// Smallest t that counts, at least 0.
    pub tnear: f32,
    /// Largest t that counts; may be infinite.
    pub tfar: f32,
    /// Hash of (pixel, sample, depth). Stochastic decisions during traversal are made from it, so that they are
    /// the same in every kernel and in any order of visits.
    pub key: u32,
}

impl Ray {
    /// A ray from `o` along `d` without end.
    pub fn new(o: Vec3, d: Vec3, key: u32) -> Self {
        Ray { o, d, tnear: 0.0, tfar: f32::INFINITY, key }
    }

    /// Whether a kernel may be given this ray. Kernels skip others (as a miss); some, Embree with assertions
    /// among them, would abort the process on them.
    #[inline]
    pub fn is_valid(&self) -> bool {
        let (o, d) = (self.o.abs(), self.d.abs());
        // NaN fails every comparison, but is lost by a maximum: so compare first. The bounds keep t and its products
        // inside f32 for any scene that the builder accepts (it scales scenes to a size of about one).
        let finite = o.cmple(Vec3::splat(MAX_COORDINATE)).all() && d.cmple(Vec3::splat(1e18)).all();
        finite && d.max_element() >= 1e-18 && self.tnear >= 0.0 && self.tfar >= self.tnear
    }
}

/// The largest coordinate that a kernel is ever given; the scene builder scales larger scenes.
pub const MAX_COORDINATE: f32 = 1e15;

/// What a caller knows of the rays of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coherence {
    /// Neighbours in the batch start together and run nearly parallel (camera rays of a block).
    Coherent,
    /// Nothing is known.
    Incoherent,
}

/// Rays as a structure of arrays, all of one length.
#[derive(Debug, Clone, Default)]
pub struct RayBatch {
    /// Origins, x.
    pub ox: Vec<f32>,
    /// Origins, y.
    pub oy: Vec<f32>,
    /// Origins, z.
    pub oz: Vec<f32>,
    /// Directions, x.
    pub dx: Vec<f32>,
    /// Directions, y.
    pub dy: Vec<f32>,
    /// Directions, z.
    pub dz: Vec<f32>,
    /// See [`Ray::tnear`].
    pub tnear: Vec<f32>,
    /// See [`Ray::tfar`].
    pub tfar: Vec<f32>,
    /// See [`Ray::key`].
    pub key: Vec<u32>,
}

impl RayBatch {
    /// The number of rays.
    #[inline]
    pub fn len(&self) -> usize {
        self.ox.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.ox.is_empty()
    }

    /// Forgets all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.resize(0);
    }

    /// Makes room for `n` rays; new ones are not valid until they are set.
    pub fn resize(&mut self, n: usize) {
        for column in [
            &mut self.ox,
            &mut self.oy,
            &mut self.oz,
            &mut self.dx,
            &mut self.dy,
            &mut self.dz,
            &mut self.tnear,
            &mut self.tfar,
        ] {
            column.resize(n, 0.0);
        }
        self.key.resize(n, 0);
    }

    /// Appends a ray.
    #[inline]
    pub fn push(&mut self, r: &Ray) {
        self.ox.push(r.o.x);
        self.oy.push(r.o.y);
        self.oz.push(r.o.z);
        self.dx.push(r.d.x);
        self.dy.push(r.d.y);
        self.dz.push(r.d.z);
        self.tnear.push(r.tnear);
        self.tfar.push(r.tfar);
        self.key.push(r.key);
    }

    /// Appends rays without end from one origin in the first `n` of these directions, all with the same key.
    #[inline]
    pub fn push_several(&mut self, o: Vec3, d: &DirectionLanes, n: usize, key: u32) {
        append(&mut self.ox, &[o.x; LANES], n);
        append(&mut self.oy, &[o.y; LANES], n);
        append(&mut self.oz, &[o.z; LANES], n);
        append(&mut self.dx, &d.x, n);
        append(&mut self.dy, &d.y, n);
        append(&mut self.dz, &d.z, n);
        append(&mut self.tnear, &[0.0; LANES], n);
        append(&mut self.tfar, &[f32::INFINITY; LANES], n);
        append(&mut self.key, &[key; LANES], n);
    }

    /// Appends rays without end, the first `n` of these lanes.
    #[inline]
    pub fn push_lanes(&mut self, o: &Columns<f32>, d: &Columns<f32>, keys: &[u32; MANY], n: usize) {
        append(&mut self.ox, &o.0[0], n);
        append(&mut self.oy, &o.0[1], n);
        append(&mut self.oz, &o.0[2], n);
        append(&mut self.dx, &d.0[0], n);
        append(&mut self.dy, &d.0[1], n);
        append(&mut self.dz, &d.0[2], n);
        append(&mut self.tnear, &[0.0; MANY], n);
        append(&mut self.tfar, &[f32::INFINITY; MANY], n);
        append(&mut self.key, keys, n);
    }

    /// Ray `i`.
    #[inline]
    pub fn get(&self, i: usize) -> Ray {
        Ray {
            o: Vec3::new(self.ox[i], self.oy[i], self.oz[i]),
            d: Vec3::new(self.dx[i], self.dy[i], self.dz[i]),
            tnear: self.tnear[i],
            tfar: self.tfar[i],
            key: self.key[i],
        }
    }

    /// All directions.
    pub fn directions(&self) -> Directions<'_> {
        Directions { x: &self.dx, y: &self.dy, z: &self.dz }
    }

    /// Direction of ray `i`.
    #[inline]
    pub fn direction(&self, i: usize) -> Vec3 {
        Vec3::new(self.dx[i], self.dy[i], self.dz[i])
    }
}

/// Appends the first `n`: all of them, which is one instruction or two, less those that are too many.
#[inline(always)]
fn append<T: Copy, const N: usize>(column: &mut Vec<T>, lanes: &[T; N], n: usize) {
    let len = column.len() + n;
    column.extend_from_slice(lanes);
    column.truncate(len);
}
