//! Memory for large tables that are read at random. With pages of 4 KB such a read misses the processor's address
//! cache almost always; so the system is asked for large pages where it has them.

use bytemuck::Pod;
use memmap2::MmapMut;
use rayon::prelude::*;
use std::marker::PhantomData;

/// From here on a large page can be had at all.
const LARGE: usize = 2 << 20;

/// A slice of plain data, as long as it was made.
pub struct Pages<T> {
    store: Store,
    kind: PhantomData<T>,
}

enum Store {
    /// Small tables, and systems that refuse.
    Heap(Vec<Line>),
    Mapped(MmapMut),
}

/// For the alignment that any table may want.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Line([u64; 8]);

impl<T: Pod + Send + Sync> Pages<T> {
    /// `n` values made by `value`, in parallel.
    ///
    /// # Panics
    /// If `T` is empty, or wants to be aligned to more than 64 bytes.
    pub fn from_fn(n: usize, value: impl Fn(usize) -> T + Sync) -> Self {
        assert!(size_of::<T>() > 0 && align_of::<T>() <= align_of::<Line>(), "a plain type of some size");
        let bytes = n * size_of::<T>();
        let mut pages = Pages { store: Store::new(bytes), kind: PhantomData };
        // A few pages a piece: the system clears each where it is first written, on the thread that does.
        let piece = (1 << 16) / size_of::<T>() + 1;
        pages.as_mut_slice(bytes).par_chunks_mut(piece).enumerate().for_each(|(p, values)| {
            values.iter_mut().enumerate().for_each(|(i, v)| *v = value(p * piece + i));
        });
        pages
    }

    /// So many values a part, one part after the other, each written by `fill` (given its number and zeros), in
    /// parallel.
    ///
    /// # Panics
    /// As [`Pages::from_fn`].
    pub fn from_parts(lengths: &[usize], fill: impl Fn(usize, &mut [T]) + Sync) -> Self {
        assert!(size_of::<T>() > 0 && align_of::<T>() <= align_of::<Line>(), "a plain type of some size");
        let bytes = lengths.iter().sum::<usize>() * size_of::<T>();
        let mut pages = Pages { store: Store::new(bytes), kind: PhantomData };
        let mut rest = pages.as_mut_slice(bytes);
        let mut parts = Vec::with_capacity(lengths.len());
        for (i, &n) in lengths.iter().enumerate() {
            let (part, after) = rest.split_at_mut(n);
            parts.push((i, part));
            rest = after;
        }
        parts.into_par_iter().for_each(|(i, part)| fill(i, part));
        pages
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        match &self.store {
            Store::Heap(lines) => size_of_val(&lines[..]) as u64,
            Store::Mapped(map) => map.len() as u64,
        }
    }

    fn as_mut_slice(&mut self, bytes: usize) -> &mut [T] {
        bytemuck::cast_slice_mut(match &mut self.store {
            Store::Heap(lines) => &mut bytemuck::cast_slice_mut(lines)[..bytes],
            Store::Mapped(map) => &mut map[..bytes],
        })
    }

    /// The values, and after them what the last page has room for: zeros.
    #[inline(always)]
    pub fn as_slice(&self) -> &[T] {
        let bytes: &[u8] = match &self.store {
            Store::Heap(lines) => bytemuck::cast_slice(lines),
            Store::Mapped(map) => map,
        };
        bytemuck::cast_slice(&bytes[..bytes.len() - bytes.len() % size_of::<T>()])
    }
}

impl Store {
    /// Zeros.
    fn new(bytes: usize) -> Self {
        let heap = || Store::Heap(vec![Line([0; 8]); bytes.div_ceil(size_of::<Line>())]);
        if bytes < LARGE {
            return heap();
        }
        match MmapMut::map_anon(bytes.next_multiple_of(LARGE)) {
            Ok(map) => {
                // Advice only: where it is not taken, pages are small and everything else is the same.
                #[cfg(target_os = "linux")]
                let _ = map.advise(memmap2::Advice::HugePage);
                Store::Mapped(map)
            }
            Err(_) => heap(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stand_where_they_were_put() {
        for n in [1, 1000, 400_001] {
            let pages = Pages::from_fn(n, |i| [i as f32, 0.5, -1.0]);
            let all: &[[f32; 3]] = pages.as_slice();
            let halves = Pages::from_parts(&[n / 2, n - n / 2], |part, to: &mut [[f32; 3]]| {
                to.iter_mut().enumerate().for_each(|(i, v)| *v = [(i + part * (n / 2)) as f32, 0.5, -1.0]);
            });
            assert_eq!(&halves.as_slice()[..n], &all[..n]);
            assert!(all.len() >= n && all[..n].iter().enumerate().all(|(i, v)| *v == [i as f32, 0.5, -1.0]));
        }
    }
}
