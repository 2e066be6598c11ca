//! Where to part a set of primitives: by the surface area heuristic over bins of their centers (Wald, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies", 2007).

use super::refs::{Box4, Ref};
use glam::Vec4;
use rayon::prelude::*;

/// The most bins.
const MAX_BINS: usize = 32;
/// From this many primitives on a set is binned by all threads.
const PARALLEL: usize = 1 << 17;
/// Depth from which on sets are halved, so that no input makes a deep tree.
const MAX_SAH_DEPTH: usize = 48;

/// A run of primitives with what is known of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Set {
    pub(super) start: usize,
    pub(super) end: usize,
    pub(super) bounds: Box4,
    /// Of twice the centers.
    pub(super) centers: Box4,
    /// Splits above it.
    pub(super) depth: usize,
}

impl Set {
    /// All of `refs`, which stand at `start`.
    pub(super) fn new(refs: &[Ref], start: usize, depth: usize) -> Self {
        let empty = (Box4::EMPTY, Box4::EMPTY);
        let grow = |(mut bounds, mut centers): (Box4, Box4), r: &Ref| {
            bounds.grow(r.lo(), r.hi());
            centers.grow(r.center2(), r.center2());
            (bounds, centers)
        };
        let (bounds, centers) = if refs.len() >= PARALLEL {
            let part = |chunk: &[Ref]| chunk.iter().fold(empty, grow);
            let both = |a: (Box4, Box4), b: (Box4, Box4)| (a.0.union(b.0), a.1.union(b.1));
            refs.par_chunks(PARALLEL / 8).map(part).reduce(|| empty, both)
        } else {
            refs.iter().fold(empty, grow)
        };
        Set { start, end: start + refs.len(), bounds, centers, depth }
    }

    pub(super) fn len(&self) -> usize {
        self.end - self.start
    }
}

/// From centers to bins, along each axis.
#[derive(Clone, Copy)]
struct Binning {
    base: Vec4,
    scale: Vec4,
    bins: usize,
}

/// Added to a number from 0 to 2^22, it leaves that number, rounded, in the low bits.
const MAGIC: f32 = 8_388_608.0;

impl Binning {
    fn new(set: &Set, bins: usize) -> Self {
        let size = set.centers.hi - set.centers.lo;
        let scale = Vec4::splat((bins - 1) as f32) / size;
        // An axis without extent, or whose extent overflows, has one bin.
        let finite = |s: f32| if s.is_finite() { s } else { 0.0 };
        let scale = Vec4::new(finite(scale.x), finite(scale.y), finite(scale.z), 0.0);
        Binning { base: set.centers.lo, scale, bins }
    }

    #[inline(always)]
    fn of(&self, r: &Ref) -> [usize; 3] {
        let b = (r.center2() - self.base) * self.scale + Vec4::splat(MAGIC);
        [b.x, b.y, b.z].map(|b| b.to_bits() as usize % MAX_BINS)
    }
}

#[derive(Clone, Copy)]
pub(super) struct Bin {
    bounds: Box4,
    count: u32,
}

/// By axis.
pub(super) type Bins = [[Bin; MAX_BINS]; 3];

pub(super) const NO_BINS: Bins = [[Bin { bounds: Box4::EMPTY, count: 0 }; MAX_BINS]; 3];

fn filled(refs: &[Ref], binning: &Binning) -> Bins {
    let mut bins = NO_BINS;
    fill(refs, binning, &mut bins);
    bins
}

/// Fills the bins that are in use.
fn fill(refs: &[Ref], binning: &Binning, bins: &mut Bins) {
    for bins in bins.iter_mut() {
        bins[..binning.bins].fill(NO_BINS[0][0]);
    }
    for r in refs {
        let at = binning.of(r);
        for axis in 0..3 {
            let bin = &mut bins[axis][at[axis]];
            bin.bounds.grow(r.lo(), r.hi());
            bin.count += 1;
        }
    }
}

fn merge(mut a: Bins, b: Bins) -> Bins {
    for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        a.bounds = a.bounds.union(b.bounds);
        a.count += b.count;
    }
    a
}

/// The best plane between bins.
#[derive(Clone, Copy)]
struct Plane {
    axis: usize,
    /// The first bin on the right.
    bin: usize,
    cost: f32,
    bounds: [Box4; 2],
}

/// What a set costs, for its number of primitives: those that are tested together, a power of two, count as one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Units {
    shift: u32,
}

impl Units {
    pub(super) fn new(together: usize) -> Self {
        Units { shift: together.ilog2() }
    }

    #[inline(always)]
    fn of(self, n: u32) -> f32 {
        // No division: this is asked for every plane of every split.
        ((n + ((1 << self.shift) - 1)) >> self.shift) as f32
    }
}

fn best_plane(bins: &Bins, binning: &Binning, units: Units) -> Option<Plane> {
    let mut best: Option<Plane> = None;
    for (axis, bins) in bins.iter().enumerate() {
        if binning.scale[axis] == 0.0 {
            continue;
        }
        let mut right = [(Box4::EMPTY, 0u32); MAX_BINS];
        let (mut bounds, mut count) = (Box4::EMPTY, 0);
        for i in (1..binning.bins).rev() {
            bounds = bounds.union(bins[i].bounds);
            count += bins[i].count;
            right[i] = (bounds, count);
        }
        let (mut bounds, mut count) = (Box4::EMPTY, 0);
        for i in 1..binning.bins {
            bounds = bounds.union(bins[i - 1].bounds);
            count += bins[i - 1].count;
            let (r_bounds, r_count) = right[i];
            if count == 0 || r_count == 0 {
                continue;
            }
            let cost = bounds.half_area() * units.of(count) + r_bounds.half_area() * units.of(r_count);
            if best.is_none_or(|b| cost < b.cost) {
                best = Some(Plane { axis, bin: i, cost, bounds: [bounds, r_bounds] });
            }
        }
    }
    best.filter(|b| b.cost.is_finite())
}

/// Parts a set of at least two in two, neither of them empty, and moves its primitives accordingly. `refs` are all of the
/// build's, `room` is scratch.
pub(super) fn split(refs: &mut [Ref], set: &Set, bins: usize, units: Units, room: &mut Bins) -> [Set; 2] {
    let part = &mut refs[set.start..set.end];
    if set.depth < MAX_SAH_DEPTH {
        // Few primitives fill few bins.
        let bins = bins.min(MAX_BINS).min(4 + part.len() / 2);
        let binning = Binning::new(set, bins);
        if part.len() >= PARALLEL {
            *room = part.par_chunks(PARALLEL / 8).map(|c| filled(c, &binning)).reduce(|| NO_BINS, merge);
        } else {
            fill(part, &binning, room);
        }
        if let Some(plane) = best_plane(room, &binning, units) {
            return partition(part, set, &binning, &plane);
        }
    }
    // All centers in one place, or too deep: by number. Sorted along the longest axis, if that has any length.
    let middle = part.len() / 2;
    let size = set.centers.hi - set.centers.lo;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    if size[axis] > 0.0 {
        part.select_nth_unstable_by(middle, |a, b| a.center2()[axis].total_cmp(&b.center2()[axis]));
    }
    let (left, right) = part.split_at(middle);
    let depth = set.depth + 1;
    [Set::new(left, set.start, depth), Set::new(right, set.start + middle, depth)]
}

fn partition(part: &mut [Ref], set: &Set, binning: &Binning, plane: &Plane) -> [Set; 2] {
    let is_left = |r: &Ref| binning.of(r)[plane.axis] < plane.bin;
    let mut centers = [Box4::EMPTY; 2];
    let (mut i, mut j) = (0, part.len());
    loop {
        while i < j && is_left(&part[i]) {
            let c = part[i].center2();
            centers[0].grow(c, c);
            i += 1;
        }
        while i < j && !is_left(&part[j - 1]) {
            let c = part[j - 1].center2();
            centers[1].grow(c, c);
            j -= 1;
        }
        if i >= j {
            break;
        }
        part.swap(i, j - 1);
    }
    let (middle, depth) = (set.start + i, set.depth + 1);
    let [left, right] = plane.bounds;
    [
        Set { start: set.start, end: middle, bounds: left, centers: centers[0], depth },
        Set { start: middle, end: set.end, bounds: right, centers: centers[1], depth },
    ]
}
