//! Several samples of a light at infinity for one surface point: what [`Block::connect`] does for each, along columns.

use super::Workspace;
use super::depth::Block;
use super::path::PathScratch;
use super::pending::Pending;
use super::surface::{Surface, key};
use crate::base::directions::{DirectionLanes, LANES};
use crate::base::light::LightLanes;
use crate::base::material::BsdfLanes;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::math::simd::{Kernel, dispatch};
use crate::sampler::SHADOW_KEY;
use crate::sampling::mis::power;

/// How many samples share the light of a surface point.
#[derive(Clone, Copy)]
pub(super) struct Counts {
    /// Light samples.
    pub lit: f32,
    /// Scattered rays that compete with each.
    pub scattered: f32,
}

/// Light samples in the surface's frame; zero where nothing is scattered.
struct Local<'a> {
    v: &'a Vertex,
    lanes: &'a LightLanes,
}

impl Kernel for Local<'_> {
    type Output = DirectionLanes;

    #[inline(always)]
    fn run(self) -> DirectionLanes {
        let Local { v, lanes } = self;
        let mut out = DirectionLanes::default();
        let (frame, ng) = (v.frame, v.ng);
        for k in 0..LANES {
            let wi = lanes.wi.get(k);
            let local = frame.to_local(wi);
            // See `Vertex::is_consistent`.
            let lit = (lanes.pdf[k] > 0.0) & (wi.dot(ng) * local.z > 0.0);
            out.x[k] = if lit { local.x } else { 0.0 };
            out.y[k] = if lit { local.y } else { 0.0 };
            out.z[k] = if lit { local.z } else { 0.0 };
        }
        out
    }
}

/// What the samples bring, in this order: a column for each channel.
struct Values<'a> {
    beta: Rgb,
    bsdf: &'a BsdfLanes,
    lanes: &'a LightLanes,
    local: &'a DirectionLanes,
    counts: Counts,
    alone: bool,
}

struct Brought {
    value: [[f32; LANES]; 3],
    /// Whether there is anything.
    any: [bool; LANES],
}

impl Kernel for Values<'_> {
    type Output = Brought;

    #[inline(always)]
    fn run(self) -> Brought {
        let Values { beta, bsdf, lanes, local, counts, alone } = self;
        let beta = beta.to_array();
        let mut out = Brought { value: [[0.0; LANES]; 3], any: [false; LANES] };
        for k in 0..LANES {
            let pdf = counts.lit * lanes.pdf[k];
            let weight = if alone { 1.0 } else { power(pdf, counts.scattered * bsdf.pdf[k]) };
            let factor = weight / pdf;
            let value = [0, 1, 2].map(|c| beta[c] * bsdf.f_cos[c][k]);
            let black = (value[0] == 0.0) & (value[1] == 0.0) & (value[2] == 0.0);
            out.any[k] = (local.z[k] != 0.0) & !black;
            for (column, value) in out.value.iter_mut().zip(value) {
                column[k] = value * factor;
            }
        }
        out
    }
}

impl Block<'_> {
    /// Shadow rays to samples of a light that is to be asked later.
    pub(super) fn connect_many(
        &self,
        s: &Surface,
        light: u32,
        lanes: &LightLanes,
        counts: Counts,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        if lanes.pdf.iter().all(|pdf| *pdf == 0.0) {
            return;
        }
        let local = dispatch(Local { v: &s.v, lanes });
        let bsdf = s.material.eval_many(&s.prepared, s.wo, &local);
        let alone = counts.scattered == 0.0 || !self.mis;
        let beta = s.state.beta;
        let brought = dispatch(Values { beta, bsdf: &bsdf, lanes, local: &local, counts, alone });
        let id = paths.points.get(s.number).id;
        let key = key(&id, self.depth) ^ SHADOW_KEY;
        // Rays start on the side that they leave to, which is one for most surfaces.
        for outward in [true, false] {
            let mut order = [0; LANES];
            let mut n = 0;
            for k in 0..LANES {
                let here = brought.any[k] && (lanes.wi.get(k).dot(s.v.ng) >= 0.0) == outward;
                order[n % LANES] = k;
                n += usize::from(here);
            }
            if n == 0 {
                continue;
            }
            let o = s.v.spawn_origin(if outward { s.v.ng } else { -s.v.ng });
            let wi = &lanes.wi;
            let d = DirectionLanes {
                x: order.map(|k| wi.x[k]),
                y: order.map(|k| wi.y[k]),
                z: order.map(|k| wi.z[k]),
            };
            work.shadow.push_several(o, &d, n, key);
            let [r, g, b] = &brought.value;
            paths.pending.extend(order[..n].iter().map(|&k| Pending {
                value: Rgb::new(r[k], g[k], b[k]),
                index: s.state.index,
                ask: Some(light),
            }));
        }
    }
}
