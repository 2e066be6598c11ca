//! Several samples of a light at infinity for one surface point, and several scattered rays: what [`Block::connect`] and
//! [`PathTracer::extend`] do for each, along columns.

use super::depth::Block;
use super::guided::Rivals;
use super::path::{PathScratch, PathState, PathTracer};
use super::pending::Pending;
use super::strategy::MOST_SPLIT;
use super::surface::{Surface, key};
use super::{PathId, Workspace};
use crate::base::directions::{DirectionLanes, LANES};
use crate::base::lanes::{Columns, LANES as MANY};
use crate::base::light::LightLanes;
use crate::base::material::BsdfLanes;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::math::simd::{Kernel, dispatch};
use crate::sampler::{Dim, SHADOW_KEY, Slot};
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

/// The points of some samples from one on, as many as any surface takes.
#[inline]
pub(super) fn draw(first: &PathId, dim: Dim) -> [[f32; LANES]; 2] {
    const { assert!(MOST_SPLIT as usize <= LANES) };
    first.sampler.few_2d(first.index, dim)
}

/// Lanes of rays from one point beside those of rays from many.
fn widened(lanes: [f32; LANES]) -> [f32; MANY] {
    const { assert!(LANES <= MANY) };
    let mut out = [0.0; MANY];
    out[..LANES].copy_from_slice(&lanes);
    out
}

impl PathTracer {
    /// `n` directions in which a path goes on that ends where they lead, so that nothing is left to chance (see
    /// [`PathTracer::extend`]); each brings its share.
    pub(super) fn extend_several(
        &self,
        block: &Block,
        s: &Surface,
        (n, rivals): (u32, Rivals),
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let id = paths.points.get(s.number).id;
        let id = PathId { sampler: id.sampler.times(n), index: id.index.wrapping_mul(n), ..id };
        let u = draw(&id, Dim::at(block.depth, Slot::BsdfUv));
        let uc = match s.material.picks_lobe() {
            true => draw(&id, Dim::at(block.depth, Slot::LobeAndRoulette))[0],
            false => [0.0; LANES],
        };
        let together = s.material.samples_together().then(|| {
            let wo = Columns(s.wo.to_array().map(|c| [c; MANY]));
            s.material.sample_many(&s.prepared, &wo, &u.map(widened), &widened(uc), n as usize)
        });
        let sample = |k: usize| match &together {
            Some(lanes) => lanes.get(k),
            None => s.material.sample(&s.prepared, s.wo, [u[0][k], u[1][k]], uc[k]),
        };
        let before = paths.next.len();
        for k in 0..n as usize {
            let Some(b) = sample(k) else { continue };
            let beta = s.state.beta * b.weight * (1.0 / n as f32);
            let wi = s.v.frame.to_world(b.wi);
            if beta.is_black() || !s.v.is_consistent(wi) {
                continue;
            }
            let id = PathId { index: id.index.wrapping_add(k as u32), ..id };
            work.next.push(&s.v.spawn(wi, key(&id, block.depth + 1)));
            let pdf = if b.delta { f32::INFINITY } else { b.pdf };
            let eta2 = s.state.eta2 * s.look.transmission.map_or(1.0, |t| t.eta2(s.wo, b.wi));
            let (from, index) = (s.receiver, s.state.index);
            paths.next.push(PathState { beta, pdf, from, rivals, eta2, index });
        }
        work.avoided.absorbed += u64::from(n) - (paths.next.len() - before) as u64;
    }
}
