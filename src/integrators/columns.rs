//! Surface points of one plain material, where no light is sampled: what [`PathTracer::extend`] does for each, along
//! columns, and without a record of each.

use super::Workspace;
use super::depth::Block;
use super::path::{PathScratch, PathState, PathTracer};
use super::points::PointLanes;
use super::together::Alike;
use crate::base::lanes::{Columns, LANES};
use crate::base::light::Receiver;
use crate::base::material::Transmission;
use crate::base::vertices::Leaving;
use crate::color::Rgb;
use crate::math::simd::{Kernel, dispatch};
use crate::sampler::{Dim, Slot, ray_key};

impl Block<'_> {
    /// Whether points that are alike may go on by columns: nothing is asked of each but where its path goes on.
    pub(super) fn goes_by_columns(&self) -> bool {
        !self.samples_lights
    }
}

impl PathTracer {
    /// As [`PathTracer::scatter`]. `state` tells the path of a ray.
    pub(super) fn extend_many(
        &self,
        block: &Block,
        alike: &Alike,
        work: &mut Workspace,
        paths: &mut PathScratch,
        state: impl Fn(&[PathState], u32) -> PathState,
    ) {
        let Alike { vertices, plain, n, .. } = alike;
        let n = *n;
        let PathScratch { states, next, hits, points, .. } = paths;
        let points = points.lanes(alike.first, n);
        let roulette = block.depth >= self.roulette_depth && block.depth < self.max_depth;
        let mut lobes = [[0.0; LANES]; 2];
        if roulette || plain.look.picks_lobe {
            draw_lobes(&points, block.depth, &mut lobes);
        }
        let mut wo = Columns::default();
        vertices.local_viewers(&mut wo);
        let samples = plain.material.sample_many(&plain.prepared, &wo, &points.bsdf, &lobes[0], n);
        let mut leaving = Leaving::default();
        vertices.leave(&samples.wi, &mut leaving);
        let mut order = [0; LANES];
        let (mut kept, mut gambled) = (0, 0);
        for (lane, &i) in hits[alike.range()].iter().enumerate() {
            let before = state(states, i);
            let weight = samples.weight.get(lane);
            let weight = Rgb::from(weight.to_array());
            let mut beta = before.beta * weight;
            let goes_on = (leaving.consistent[lane] > 0.0) & !weight.is_black() & !beta.is_black();
            if !goes_on {
                continue;
            }
            let across = |t: Transmission| t.eta2(wo.get(lane), samples.wi.get(lane));
            let eta2 = before.eta2 * plain.look.transmission.map_or(1.0, across);
            if roulette {
                // See `PathTracer::extend`.
                let q = (beta * eta2).max_component().min(0.95);
                if lobes[1][lane] >= q {
                    gambled += 1;
                    continue;
                }
                beta = beta / q;
            }
            next.push(PathState {
                beta,
                eta2,
                pdf: f32::INFINITY,
                from: Receiver::NOWHERE,
                guided_pdf: 0.0,
                index: before.index,
            });
            order[kept] = lane;
            kept += 1;
        }
        let mut keys = [0; LANES];
        dispatch(Keys { points: &points, depth: block.depth + 1, out: &mut keys });
        if kept == n {
            work.next.push_lanes(&leaving.o, &leaving.d, &keys, n);
        } else {
            let (o, d) = (leaving.o.picked(&order), leaving.d.picked(&order));
            work.next.push_lanes(&o, &d, &order.map(|lane| keys[lane]), kept);
        }
        let (all, shadow_rays) = (n as u64, block.shadow_rays());
        work.avoided.points += all;
        work.avoided.candidates += all * (shadow_rays + 1);
        work.avoided.scattered_alone += all * shadow_rays;
        work.avoided.absorbed += (n - kept - gambled) as u64;
        work.avoided.roulette += gambled as u64;
    }
}

/// See [`Slot::LobeAndRoulette`].
fn draw_lobes(points: &PointLanes, depth: u32, out: &mut [[f32; LANES]; 2]) {
    for (lane, (sampler, &index)) in points.samplers.iter().zip(points.indices).enumerate() {
        [out[0][lane], out[1][lane]] = sampler.get_2d(index, Dim::at(depth, Slot::LobeAndRoulette));
    }
}

/// Keys of rays of a depth.
struct Keys<'a> {
    points: &'a PointLanes<'a>,
    depth: u32,
    out: &'a mut [u32; LANES],
}

impl Kernel for Keys<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for ((out, &key), &index) in self.out.iter_mut().zip(self.points.keys).zip(self.points.indices) {
            *out = ray_key(key, index, self.depth);
        }
    }
}
