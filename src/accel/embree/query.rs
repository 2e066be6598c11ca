//! Single rays: into Embree, and what it found back into paths.

use super::level::{Level, Levels, PORTAL_ID, SHAPE_BIT};
use super::plan::DIRECTION;
use crate::base::ray::RayBatch;
use crate::base::shape::LocalRay;
use crate::math::aabb::DAabb;
use embree_sys::*;
use glam::DVec3;
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
        let mut rayhit = RTCRayHit { ray: tame.embree(), hit: no_hit() };
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
        let mut shadow = tame.embree();
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

fn extent(b: &DAabb) -> f64 {
    b.min.abs().max(b.max.abs()).max_element()
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

/// A ray that Embree can be given: finite, not too far away, with a direction of sane length. `t` of the original is
/// `shift + t * scale`.
struct Tame {
    ray: LocalRay,
    shift: f64,
    scale: f64,
}

impl Tame {
    /// None for rays that are not valid, or cannot meet the bounds.
    #[inline]
    fn new(ray: &LocalRay, bounds: &DAabb, reach: f64) -> Option<Tame> {
        let (o, d) = (ray.o.abs(), ray.d.abs());
        let length = d.max_element();
        let sane = f64::from(*DIRECTION.start())..=f64::from(*DIRECTION.end());
        // `&` and comparisons that NaN fails: a maximum would lose one.
        let near = o.cmple(DVec3::splat(reach)).all() & d.cmple(DVec3::splat(*sane.end())).all();
        let segment = (ray.tnear >= 0.0) & (ray.tnear <= f64::from(f32::MAX)) & (ray.tfar >= ray.tnear);
        if !segment {
            return None;
        }
        if near && length >= *sane.start() {
            return Some(Tame { ray: *ray, shift: 0.0, scale: 1.0 });
        }
        Tame::moved(ray, bounds, length)
    }

    /// With a direction of length about 1, and from where the ray enters the bounds.
    #[cold]
    fn moved(ray: &LocalRay, bounds: &DAabb, length: f64) -> Option<Tame> {
        if !(ray.o.is_finite() && ray.d.is_finite() && length.is_normal()) {
            return None;
        }
        // A power of two, so that nothing is rounded.
        let scale = f64::from_bits((length.recip().to_bits() >> 52) << 52);
        let d = ray.d * scale;
        let (near, far) = (ray.tnear / scale, ray.tfar / scale);
        let [enter, leave] = crossing(bounds, ray.o, d)?;
        let shift = enter.max(0.0);
        let tnear = (near - shift).max(0.0);
        let tfar = (far - shift).min(leave - shift);
        let ray = LocalRay { o: ray.o + d * shift, d, tnear, tfar };
        let valid = tfar >= tnear && tnear <= f64::from(f32::MAX);
        valid.then_some(Tame { ray, shift: shift * scale, scale })
    }

    #[inline]
    fn restored(&self, t: f64) -> f64 {
        self.shift + t * self.scale
    }

    #[inline]
    fn embree(&self) -> RTCRay {
        let (o, d) = (self.ray.o.as_vec3(), self.ray.d.as_vec3());
        RTCRay {
            org_x: o.x,
            org_y: o.y,
            org_z: o.z,
            tnear: self.ray.tnear as f32,
            dir_x: d.x,
            dir_y: d.y,
            dir_z: d.z,
            time: 0.0,
            tfar: self.ray.tfar as f32,
            mask: u32::MAX,
            id: 0,
            flags: 0,
        }
    }
}

/// Where a line enters and leaves a box, grown by a thousandth for the rounding of far origins; none if it misses.
fn crossing(b: &DAabb, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
    let by = extent(b) * 1e-3;
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        let (low, high) = (b.min[k] - by - o[k], b.max[k] + by - o[k]);
        if d[k] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, c) = (low / d[k], high / d[k]);
        enter = enter.max(a.min(c));
        leave = leave.min(a.max(c));
    }
    (enter <= leave && leave >= 0.0).then_some([enter, leave])
}

/// What Embree expects before a query.
fn no_hit() -> RTCHit {
    // SAFETY: a record of numbers alone, for which zero is a value.
    let mut hit: RTCHit = unsafe { std::mem::zeroed() };
    hit.geomID = INVALID_ID;
    hit.instID[0] = INVALID_ID;
    hit
}
