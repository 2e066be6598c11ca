//! Single rays: into Embree, and what it found back into paths.

use super::level::{Level, Levels, PORTAL_ID, SHAPE_BIT};
use crate::accel::tame::{Tame, extent};
use crate::base::ray::RayBatch;
use crate::base::shape::LocalRay;
use embree_sys::*;
use std::ptr;

/// What callbacks can reach during a query, by the pointer in its `EmQuery`.
pub(super) struct Query<'a> {
    entry: Entry<'a>,
    source: Source<'a>,
}

/// The rays of a query, in the space of its level. Embree carries their number in `id`.
enum Source<'a> {
    /// One ray, and its key.
    One(&'a LocalRay, u32),
    /// Those of a batch from this one on, in render space.
    Batch(&'a RayBatch, usize),
}

impl<'a> Query<'a> {
    /// For the rays of a batch from `first` on, through the root.
    pub(super) fn batch(levels: &'a Levels, rays: &'a RayBatch, first: usize) -> Self {
        Query { entry: Entry::root(levels), source: Source::Batch(rays, first) }
    }

    /// The pointer for [`EmQuery`]. It is read only, and only while the query runs.
    pub(super) fn user(&self) -> *mut std::ffi::c_void {
        ptr::from_ref(self).cast_mut().cast()
    }

    /// Ray `id` in the space of the level, shortened to what is left of it.
    #[inline]
    pub(super) fn ray(&self, id: u32, tnear: f32, tfar: f32) -> LocalRay {
        let (tnear, tfar) = (f64::from(tnear), f64::from(tfar));
        match self.source {
            Source::One(ray, _) => LocalRay { tnear, tfar, ..*ray },
            Source::Batch(rays, first) => {
                LocalRay { tnear, tfar, ..LocalRay::from_ray(&rays.get(first + id as usize)) }
            }
        }
    }

    /// As [`Query::ray`], in the space of an instance (or of the level itself), with the path of its first leaf.
    #[inline]
    pub(super) fn ray_in(&self, inst: u32, id: u32, tnear: f32, tfar: f32) -> (LocalRay, u64) {
        let ray = self.ray(id, tnear, tfar);
        if inst == INVALID_ID {
            return (ray, self.entry.first_path);
        }
        let level = self.entry.level();
        let instance = &level.instances[(inst - level.first_instance) as usize];
        let first_path = self.entry.first_path + instance.first_path;
        (ray.transformed(&level.transforms[instance.transform as usize]), first_path)
    }

    /// The key of ray `id`.
    pub(super) fn key(&self, id: u32) -> u32 {
        match self.source {
            Source::One(_, key) => key,
            Source::Batch(rays, first) => rays.key[first + id as usize],
        }
    }

    /// The way into the level behind a portal.
    pub(super) fn below(&self, level: u32, first_path: u64) -> Entry<'a> {
        Entry { levels: self.entry.levels, level, first_path: self.entry.first_path + first_path }
    }
}

/// A level, reached along a path.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    levels: &'a Levels,
    level: u32,
    /// Path of the level's first leaf, from the root.
    first_path: u64,
}

/// A hit with its distance in double precision and a path that counts from the level asked.
pub(super) struct Found {
    pub(super) t: f64,
    pub(super) prim: u32,
    pub(super) path: u64,
}

impl<'a> Entry<'a> {
    pub(super) fn root(levels: &'a Levels) -> Self {
        Entry { levels, level: 0, first_path: 0 }
    }

    #[inline]
    fn level(&self) -> &'a Level {
        &self.levels.levels[self.level as usize]
    }

    /// The closest hit of a ray in the space of the level.
    pub(super) fn closest(&self, ray: &LocalRay, key: u32) -> Option<Found> {
        let tame = self.tame(ray)?;
        let query = Query { entry: *self, source: Source::One(&tame.ray, key) };
        let mut rayhit = RTCRayHit { ray: embree_ray(&tame), hit: no_hit() };
        // SAFETY: the scene is committed (levels are, when they are built), and `tame` lets no ray through that
        // Embree would refuse. The query and the ray outlive the call.
        unsafe {
            em_intersect1(self.level().scene.raw(), &mut EmQuery::new(false, query.user()), &mut rayhit)
        };
        let hit = &rayhit.hit;
        if hit.geomID == INVALID_ID {
            return None;
        }
        // Only user geometry has written a path, but any bits may be read.
        let path =
            self.level().path(self.levels, hit.geomID, hit.instID[0], [hit.u.to_bits(), hit.v.to_bits()]);
        let t = tame.restored(f64::from(rayhit.ray.tfar));
        t.is_finite().then_some(Found { t, prim: hit.primID, path })
    }

    /// Whether a ray in the space of the level meets anything.
    pub(super) fn any(&self, ray: &LocalRay, key: u32) -> bool {
        let Some(tame) = self.tame(ray) else { return false };
        let query = Query { entry: *self, source: Source::One(&tame.ray, key) };
        let mut shadow = embree_ray(&tame);
        // SAFETY: as in `closest`.
        unsafe {
            em_occluded1(self.level().scene.raw(), &mut EmQuery::new(false, query.user()), &mut shadow)
        };
        shadow.tfar == f32::NEG_INFINITY
    }

    fn tame(&self, ray: &LocalRay) -> Option<Tame> {
        // Rays of render space are f32 already, and gain nothing from starting nearer.
        let level = self.level();
        Tame::new(
            ray,
            &level.bounds,
            if self.level == 0 { level.reach } else { 16.0 * extent(&level.bounds) },
        )
    }
}

impl Level {
    /// The path, from this level, of what Embree says was hit.
    #[inline]
    pub(super) fn path(&self, levels: &Levels, geom: u32, inst: u32, words: [u32; 2]) -> u64 {
        if geom == PORTAL_ID {
            return u64::from(words[0]) | u64::from(words[1]) << 32;
        }
        let (group, first_path) = if inst == INVALID_ID {
            (self.group, 0)
        } else {
            let i = &self.instances[(inst - self.first_instance) as usize];
            (i.group as usize, i.first_path)
        };
        let leaf = if geom & SHAPE_BIT == 0 {
            levels.leaves[group].leaf_of[geom as usize]
        } else {
            geom & !SHAPE_BIT
        };
        first_path + u64::from(leaf)
    }
}

/// A ray that Embree accepts, as it takes it.
#[inline]
fn embree_ray(tame: &Tame) -> RTCRay {
    let (o, d) = (tame.ray.o.as_vec3(), tame.ray.d.as_vec3());
    RTCRay {
        org_x: o.x,
        org_y: o.y,
        org_z: o.z,
        tnear: tame.ray.tnear as f32,
        dir_x: d.x,
        dir_y: d.y,
        dir_z: d.z,
        time: 0.0,
        tfar: tame.ray.tfar as f32,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}

/// What Embree expects before a query.
fn no_hit() -> RTCHit {
    // SAFETY: a record of numbers alone, for which zero is a value.
    let mut hit: RTCHit = unsafe { std::mem::zeroed() };
    hit.geomID = INVALID_ID;
    hit.instID[0] = INVALID_ID;
    hit
}
