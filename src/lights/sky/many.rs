//! Several samples for one receiver, worked out along columns.

use super::SkyLight;
use super::placed::{PlacedDisc, Turn};
use super::product::{Chosen, ProductTable};
use crate::base::directions::LANES;
use crate::base::light::{Guide, GuidedLight, LightLanes, Receiver};
use crate::base::skybox::ChartDirections;
use crate::math::simd::{Kernel, dispatch};
use crate::sampling::warp;
use glam::{DVec3, Vec2, Vec3};

impl SkyLight {
    /// See [`GuidedLight::sample_many`].
    pub(super) fn sample_product(
        &self,
        table: &ProductTable,
        at: &Receiver,
        guide: &Guide,
        u: &[[f32; LANES]; 2],
        n: usize,
    ) -> LightLanes {
        let chosen = table.choose(guide, u, n);
        if !chosen.any {
            return LightLanes::default();
        }
        let toward = self.sky.directions_and_densities(&chosen.at, n);
        let SkyLight { turn, discs, .. } = self;
        let mut out =
            dispatch(Place { chosen: &chosen, toward: &toward, turn, discs, table, guide, ng: at.ng });
        for k in (0..LANES).filter(|k| chosen.discs >> k & 1 == 1) {
            let disc = chosen.cell[k] as usize - table.cells();
            let wi = self.discs[disc].sample(Vec2::new(chosen.part[0][k] as f32, chosen.part[1][k] as f32));
            out.wi.set(k, wi);
            out.pdf[k] = self.pdf(at, guide, wi);
        }
        out
    }
}

/// Directions in world space, and their densities.
struct Place<'a> {
    chosen: &'a Chosen,
    toward: &'a ChartDirections,
    turn: &'a Option<Turn>,
    discs: &'a [PlacedDisc],
    table: &'a ProductTable,
    guide: &'a Guide,
    ng: Vec3,
}

impl Kernel for Place<'_> {
    type Output = LightLanes;

    #[inline(always)]
    fn run(self) -> LightLanes {
        let Place { chosen, toward, turn, discs, table, guide, ng } = self;
        let mut out = LightLanes::default();
        let mut toward = *toward;
        if let Some(turn) = turn {
            for k in 0..LANES {
                let d = turn.to_world(DVec3::new(toward.x[k], toward.y[k], toward.z[k]));
                [toward.x[k], toward.y[k], toward.z[k]] = [d.x, d.y, d.z];
            }
        }
        let mut of_discs = [0.0; LANES];
        for k in 0..LANES {
            out.wi.x[k] = toward.x[k] as f32;
            out.wi.y[k] = toward.y[k] as f32;
            out.wi.z[k] = toward.z[k] as f32;
        }
        for (i, disc) in discs.iter().enumerate() {
            let mut inside = [false; LANES];
            let mut any = false;
            for (k, inside) in inside.iter_mut().enumerate() {
                *inside = disc.contains(out.wi.get(k));
                any |= *inside;
            }
            if any {
                let density = table.disc_pmf(guide, i) * f64::from(warp::uniform_cone_pdf(disc.m));
                for k in 0..LANES {
                    of_discs[k] += if inside[k] { density } else { 0.0 };
                }
            }
        }
        for (k, of_discs) in of_discs.into_iter().enumerate() {
            let density = chosen.density[k];
            let map = if toward.density[k] > 0.0 { density / toward.density[k] } else { 0.0 };
            let pdf = (map + of_discs) as f32;
            // What was not taken has no density, though a disc may be there.
            let seen = (out.wi.get(k).dot(ng) >= 0.0) & (density > 0.0);
            out.pdf[k] = if seen { pdf } else { 0.0 };
        }
        out
    }
}
