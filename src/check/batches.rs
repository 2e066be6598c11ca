//! Rays dealt out to threads in batches. What a batch does depends on its number alone, so counts do not depend on the
//! threads.

use rayon::prelude::*;

/// Rays of a batch at most: enough for a kernel's streams, few enough for the cache.
const LARGEST: u64 = 2048;
/// Batches that a run is cut into at least, so that few but slow rays keep all threads busy.
const FEWEST: u64 = 64;

/// A part of a run.
#[derive(Debug, Clone, Copy)]
pub struct Batch {
    /// Its number, from 0.
    pub number: u64,
    /// The number of its first ray in the run.
    pub first: u64,
    /// The number of its rays.
    pub count: u64,
}

/// Runs `of` for every batch of `rays` rays and merges what comes out, in any order; `B` is kept by each thread.
pub fn in_batches<B, T>(
    rays: u64,
    of: impl Fn(&mut B, Batch) -> T + Sync,
    merge: impl Fn(T, &T) -> T + Sync,
) -> T
where
    B: Default,
    T: Default + Send,
{
    let size = (rays / FEWEST).clamp(1, LARGEST);
    let one = |buffers: &mut B, number: u64| {
        let first = number * size;
        of(buffers, Batch { number, first, count: size.min(rays - first) })
    };
    let parts = (0..rays.div_ceil(size)).into_par_iter().map_init(B::default, one);
    parts.reduce(T::default, |a, b| merge(a, &b))
}
