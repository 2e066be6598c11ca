//! What answers are possible for a ray: those that some careful kernel may give, and the oracle's own.

use super::crossing::{Crossing, Primitive};
use super::leaf_ray::{Descent, LeafRay};
use crate::base::geometry::{Geometry, Group};
use crate::base::hit::Hit;
use crate::base::ray::Ray;
use crate::math::aabb::{Aabb, DAabb};
use crate::math::bounds::gamma;
use glam::DVec3;

/// A place where the ray may meet something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Path of the leaf.
    pub path: u64,
    /// Primitive within it.
    pub prim: u32,
    /// Where.
    pub crossing: Crossing,
}

/// All that is known of what a ray may meet.
#[derive(Debug, Clone, Default)]
pub struct Possible {
    /// In order of path, primitive and t.
    pub candidates: Vec<Candidate>,
    /// Whether every primitive was looked at, and not only those that kernels have named.
    pub complete: bool,
}

impl Possible {
    /// From the primitives that kernels name; names of nothing are left out.
    pub fn of_named(geometry: &Geometry, ray: &Ray, named: impl IntoIterator<Item = Hit>) -> Self {
        let mut names: Vec<(u64, u32)> = named.into_iter().map(|h| (h.path, h.prim)).collect();
        names.sort_unstable();
        names.dedup();
        let mut possible = Possible::default();
        for (path, prim) in names {
            possible.add_named(geometry, ray, path, prim);
        }
        possible
    }

    fn add_named(&mut self, geometry: &Geometry, ray: &Ray, path: u64, prim: u32) {
        if let Some((primitive, local)) = find(geometry, ray, path, prim) {
            primitive.crossings(&local, |crossing| self.candidates.push(Candidate { path, prim, crossing }));
        }
    }

    /// From every primitive there is, leaf by leaf; leaves and groups whose boxes the ray surely misses are left out.
    /// None where that would take more than `tests` tests, which are counted down.
    pub fn of_all(geometry: &Geometry, ray: &Ray, tests: &mut u64) -> Option<Self> {
        let mut search = Search { geometry, key: ray.key, tests, candidates: Vec::new() };
        if ray.is_valid() {
            search.visit(geometry.root(), 0, &Descent::new(ray))?;
        }
        Some(Possible { candidates: search.candidates, complete: true })
    }

    /// What the oracle meets first.
    pub fn truth(&self) -> Option<&Candidate> {
        let met = self.candidates.iter().filter(|c| c.crossing.met);
        // The first of several at one distance, as in the oracle's loop.
        met.reduce(|a, b| if b.crossing.t < a.crossing.t { b } else { a })
    }

    /// The nearest that no careful kernel may miss, by the latest distance it may say.
    pub fn nearest_sure(&self) -> Option<&Candidate> {
        let end = |c: &Candidate| c.crossing.t + c.crossing.reach;
        let sure = self.candidates.iter().filter(|c| c.crossing.is_sure());
        sure.min_by(|a, b| end(a).total_cmp(&end(b)))
    }

    /// The candidate that a hit names, the nearest in distance if there are several.
    pub fn named_by(&self, hit: &Hit) -> Option<&Candidate> {
        let off = |c: &Candidate| (c.crossing.t - f64::from(hit.t)).abs() - c.crossing.reach;
        let same = self.candidates.iter().filter(|c| (c.path, c.prim) == (hit.path, hit.prim));
        same.min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// A primitive by its name, with the ray in its space; none where there is no such primitive, and for rays that no
/// kernel is to answer.
pub fn find<'a>(geometry: &'a Geometry, ray: &Ray, path: u64, prim: u32) -> Option<(Primitive<'a>, LeafRay)> {
    let (leaf, local) = Descent::new(ray).to_leaf(geometry, path).filter(|_| ray.is_valid())?;
    (prim < leaf.shape.primitive_count()).then_some((Primitive { leaf, path, prim, key: ray.key }, local))
}

struct Search<'a> {
    geometry: &'a Geometry,
    key: u32,
    tests: &'a mut u64,
    candidates: Vec<Candidate>,
}

impl Search<'_> {
    fn visit(&mut self, group: &Group, first_path: u64, at: &Descent) -> Option<()> {
        for (path, leaf) in (first_path..).zip(&group.leaves) {
            self.spend(1)?;
            if !may_meet(&at.local, &leaf.shape.bounds()) {
                continue;
            }
            let count = leaf.shape.primitive_count();
            self.spend(u64::from(count))?;
            for prim in 0..count {
                let primitive = Primitive { leaf, path, prim, key: self.key };
                let candidates = &mut self.candidates;
                primitive.crossings(&at.local, |crossing| {
                    candidates.push(Candidate { path, prim, crossing });
                });
            }
        }
        for child in &group.children {
            self.spend(1)?;
            let below = &self.geometry.groups[child.group];
            let down = at.into_child(child);
            if may_meet(&down.local, &below.bounds) {
                self.visit(below, first_path + child.first_path, &down)?;
            }
        }
        Some(())
    }

    fn spend(&mut self, n: u64) -> Option<()> {
        *self.tests = self.tests.checked_sub(n)?;
        Some(())
    }
}

/// Whether the ray's line comes within rounding of a box, ahead of it. In double precision, and widened by what the
/// placement may have moved the ray and by gamma(16) of how far the box reaches: more than any bound of a crossing.
fn may_meet(at: &LeafRay, b: &Aabb) -> bool {
    let b = DAabb::from(*b);
    let (o, d) = (at.ray.o, at.ray.d);
    let span = (b.min - o).abs().max((b.max - o).abs());
    let slowest = d.abs().max_element();
    let wide = at.origin_error
        + at.direction_error * (span.max_element() / slowest)
        + DVec3::splat(f64::from(gamma(16)) * span.max_element());
    let (lower, upper) = (b.min - wide - o, b.max + wide - o);
    let (mut near, mut far) = (-wide.max_element() / slowest, f64::INFINITY);
    for k in 0..3 {
        if d[k] == 0.0 {
            if lower[k] > 0.0 || upper[k] < 0.0 {
                return false;
            }
            continue;
        }
        let (a, c) = (lower[k] / d[k], upper[k] / d[k]);
        near = near.max(a.min(c));
        far = far.min(a.max(c));
    }
    near <= far
}
