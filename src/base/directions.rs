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
