//! Surface points of one plain material: what [`PathTracer::extend`] does for each, along columns. Where no light is sampled
//! there, the points have no records.

use super::Workspace;
use super::depth::Block;
use super::guided::Rivals;
use super::path::{PathScratch, PathState, PathTracer};
use super::points::PointLanes;
use super::strategy::Strategy;
use super::surface::{Look, Surface, survival};
use super::together::Alike;
use crate::base::lanes::{Columns, LANES};
use crate::base::light::Receiver;
use crate::base::material::Transmission;
use crate::base::vertices::Leaving;
use crate::color::Rgb;
use crate::math::simd::{Kernel, dispatch};
use crate::sampler::{Dim, Slot, points_2d, ray_key};

impl Block<'_> {
    /// The path that a ray of this depth belongs to.
    #[inline(always)]
    fn state(&self, states: &[PathState], ray: u32) -> PathState {
        if self.depth == 1 { PathState::from_camera(ray) } else { states[ray as usize] }
    }

    /// Whether points of an object's slot need no record: nothing is asked of each but where its path goes on.
    pub(super) fn goes_by_columns(&self, (object, slot): (u32, u32), look: &Look) -> bool {
        // Where there are other lights, these are sampled all the same.
        let left = || self.guided.is_some() && self.scene.lights.list.len() == 1;
        !self.samples_lights || look.is_delta || left() && self.strategies.of(object, slot) == Strategy::Bsdf
    }
}

impl PathTracer {
    /// As [`PathTracer::scatter`], of points that have no record.
    pub(super) fn scatter_many(
        &self,
        block: &Block,
        alike: &Alike,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let (all, shadow_rays) = (alike.n as u64, block.shadow_rays());
        work.avoided.points += all;
        work.avoided.candidates += all * (shadow_rays + 1);
        work.avoided.scattered_alone += all * shadow_rays;
        self.extend_many(block, alike, (&[], &[]), work, paths);
    }

    /// As [`PathTracer::extend`]. `surfaces` are the records of the points, if they have any.
    pub(super) fn extend_many(
        &self,
        block: &Block,
        alike: &Alike,
        (surfaces, rivals): (&[Surface], &[Rivals]),
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let Alike { vertices, plain, n, .. } = alike;
        let n = *n;
        let PathScratch { states, next, hits, points, .. } = paths;
        let points = points.lanes(alike.first, n);
        let roulette = self.gambles(block);
        let mut lobes = [[0.0; LANES]; 2];
        if roulette || plain.look.picks_lobe {
            let [x, y] = &mut lobes;
            points_2d(points.samplers, points.indices, Dim::at(block.depth, Slot::LobeAndRoulette), x, y);
        }
        let mut wo = Columns::default();
        vertices.local_viewers(&mut wo);
        let samples = plain.material.sample_many(&plain.prepared, &wo, &points.bsdf, &lobes[0], n);
        let mut leaving = Leaving::default();
        vertices.leave(&samples.wi, &mut leaving);
        let competes = block.samples_lights && !plain.look.is_delta;
        let mut order = [0; LANES];
        let (mut kept, mut gambled) = (0, 0);
        for (lane, &i) in hits[alike.range()].iter().enumerate() {
            let before = block.state(states, i);
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
                let q = survival(beta, eta2);
                if lobes[1][lane] >= q {
                    gambled += 1;
                    continue;
                }
                beta = beta / q;
            }
            next.push(PathState {
                beta,
                eta2,
                pdf: if competes & !samples.delta[lane] { samples.pdf[lane] } else { f32::INFINITY },
                // Without records light samples have no density anywhere.
                from: surfaces.get(lane).map_or(Receiver::NOWHERE, |s| s.receiver),
                rivals: rivals.get(lane).copied().unwrap_or_default(),
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
        work.avoided.absorbed += (n - kept - gambled) as u64;
        work.avoided.roulette += gambled as u64;
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
