//! The sample points of all surface points of one depth, made together: eight paths at a time where one by one each
//! would wait for itself.

use super::{PathId, PathIds};
use crate::base::lanes::LANES;
use crate::sampler::{Dim, PixelSampler, Slot, points_2d};

/// Points by surface point.
#[derive(Default)]
pub struct VertexPoints {
    ids: PathIds,
    light: [Vec<f32>; 2],
    bsdf: [Vec<f32>; 2],
}

/// What one surface point draws.
#[derive(Debug, Clone, Copy)]
pub struct VertexPoint {
    /// Whose it is.
    pub id: PathId,
    /// See [`Slot::LightUv`]; not set unless asked for.
    pub light: [f32; 2],
    /// See [`Slot::BsdfUv`].
    pub bsdf: [f32; 2],
}

/// What a few surface points draw to go on, as columns.
pub struct PointLanes<'a> {
    /// See [`PathId::sampler`].
    pub samplers: &'a [PixelSampler],
    /// See [`PathId::index`].
    pub indices: &'a [u32],
    /// See [`PathId::key`].
    pub keys: &'a [u32],
    /// See [`Slot::BsdfUv`].
    pub bsdf: [[f32; LANES]; 2],
}

impl VertexPoints {
    /// Draws for `paths` (indices into `ids`) at a depth.
    pub fn draw(
        &mut self,
        ids: &PathIds,
        paths: impl Iterator<Item = u32> + Clone,
        depth: u32,
        with_light: bool,
    ) {
        self.ids.clear();
        // Column by column, of a length that is known: nothing grows on the way.
        self.ids.samplers.extend(paths.clone().map(|i| ids.samplers[i as usize]));
        self.ids.indices.extend(paths.clone().map(|i| ids.indices[i as usize]));
        self.ids.keys.extend(paths.map(|i| ids.keys[i as usize]));
        fill(&self.ids, Dim::at(depth, Slot::BsdfUv), &mut self.bsdf);
        if with_light {
            fill(&self.ids, Dim::at(depth, Slot::LightUv), &mut self.light);
        }
    }

    /// Those of `n` paths, the `k`th on, for going on.
    #[inline]
    pub fn lanes(&self, k: usize, n: usize) -> PointLanes<'_> {
        let mut bsdf = [[0.0; LANES]; 2];
        for (to, from) in bsdf.iter_mut().zip(&self.bsdf) {
            to[..n].copy_from_slice(&from[k..k + n]);
        }
        let ids = &self.ids;
        PointLanes {
            samplers: &ids.samplers[k..k + n],
            indices: &ids.indices[k..k + n],
            keys: &ids.keys[k..k + n],
            bsdf,
        }
    }

    /// Those of the `k`th path.
    #[inline]
    pub fn get(&self, k: usize) -> VertexPoint {
        let at = |c: &[Vec<f32>; 2]| [0, 1].map(|a| c[a].get(k).copied().unwrap_or(0.0));
        VertexPoint { id: self.ids.get(k), light: at(&self.light), bsdf: at(&self.bsdf) }
    }
}

fn fill(ids: &PathIds, dim: Dim, [x, y]: &mut [Vec<f32>; 2]) {
    x.resize(ids.indices.len(), 0.0);
    y.resize(ids.indices.len(), 0.0);
    points_2d(&ids.samplers, &ids.indices, dim, x, y);
}
