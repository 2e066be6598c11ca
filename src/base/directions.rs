//! Unit directions in batches.

use glam::Vec3;

/// Directions as a structure of arrays, all of one length, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Directions<'a> {
    /// x of each.
    pub x: &'a [f32],
    /// y of each.
    pub y: &'a [f32],
    /// z of each.
    pub z: &'a [f32],
}

impl<'a> Directions<'a> {
    /// How many there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Direction `i`.
    #[inline]
    pub fn get(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Pieces of at most `size` directions, with where each begins.
    pub fn chunks(self, size: usize) -> impl Iterator<Item = (usize, Directions<'a>)> {
        (0..self.len()).step_by(size).map(move |first| {
            let range = first..self.len().min(first + size);
            (first, Directions { x: &self.x[range.clone()], y: &self.y[range.clone()], z: &self.z[range] })
        })
    }
}

/// How many of a few are worked out together.
pub const LANES: usize = 8;

/// Eight directions as columns of fixed length: loops over them become vector code.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(32))]
pub struct DirectionLanes {
    /// x of each.
    pub x: [f32; LANES],
    /// y of each.
    pub y: [f32; LANES],
    /// z of each.
    pub z: [f32; LANES],
}

impl DirectionLanes {
    /// Direction `k`.
    #[inline(always)]
    pub fn get(&self, k: usize) -> Vec3 {
        Vec3::new(self.x[k], self.y[k], self.z[k])
    }

    /// Sets direction `k`.
    #[inline(always)]
    pub fn set(&mut self, k: usize, d: Vec3) {
        [self.x[k], self.y[k], self.z[k]] = d.to_array();
    }
}

/// Directions as a structure of arrays, owned; memory is kept when it is cleared.
#[derive(Debug, Clone, Default)]
pub struct DirectionBatch {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

impl DirectionBatch {
    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
    }

    /// Appends one.
    #[inline]
    pub fn push(&mut self, d: Vec3) {
        self.x.push(d.x);
        self.y.push(d.y);
        self.z.push(d.z);
    }

    /// Appends those of `all` that have these numbers.
    pub fn extend_picked(&mut self, all: Directions, numbers: &[u32]) {
        self.x.extend(numbers.iter().map(|&i| all.x[i as usize]));
        self.y.extend(numbers.iter().map(|&i| all.y[i as usize]));
        self.z.extend(numbers.iter().map(|&i| all.z[i as usize]));
    }

    /// All of them.
    #[inline]
    pub fn view(&self) -> Directions<'_> {
        Directions { x: &self.x, y: &self.y, z: &self.z }
    }
}

impl FromIterator<Vec3> for DirectionBatch {
    fn from_iter<I: IntoIterator<Item = Vec3>>(all: I) -> Self {
        let mut batch = DirectionBatch::default();
        all.into_iter().for_each(|d| batch.push(d));
        batch
    }
}
