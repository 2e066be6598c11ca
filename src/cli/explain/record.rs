//! What is told of a sample, with names in place of numbers: as JSON, and (in `text`) for people.

use crate::base::hit::Hit;
use crate::base::ray::Ray;
use crate::color::Rgb;
use crate::crosscheck::replay::{name_of, write_ray};
use crate::integrators::story::{End, Fate, Leg, Lit, Met, Onward, Stop};
use crate::render::explain::{Answer, Explained};
use crate::scene::Scene;
use glam::{DVec3, Vec3};
use serde::Serialize;

/// The whole explanation. Points and directions are in render space unless they say otherwise; densities are per solid
/// angle; numbers that are not finite are null.
#[derive(Debug, Serialize)]
pub struct Record {
    pub pixel: [u32; 2],
    pub sample: u64,
    pub replicate: u32,
    pub index: u32,
    /// How many the pixel takes if all take as many, and whether what is sampled decides.
    pub samples: u64,
    pub samples_decided: bool,
    pub samples_for_one_of_another: u32,
    /// What stands for the samples of a pixel that needs none.
    pub spared: Option<[f32; 3]>,
    pub film: [f32; 2],
    pub radiance: [f32; 3],
    pub alpha: f32,
    pub decided: String,
    /// None from integrators that tell nothing but their rays.
    pub path: Option<PathRecord>,
    /// Every ray in order.
    pub rays: Vec<RayRecord>,
    pub replay: String,
    pub replay_ray: Option<String>,
}

#[derive(Debug, Serialize)]
pub struct PathRecord {
    pub legs: Vec<LegRecord>,
    /// The sum of all that is brought, in the order of the integrator.
    pub sum: [f32; 3],
    /// Whether that is the sample's radiance, and all steps are those of the integrator, to the bit.
    pub exact: bool,
}

#[derive(Debug, Serialize)]
pub struct LegRecord {
    pub number: usize,
    pub from: Option<usize>,
    pub depth: u32,
    pub ray: String,
    pub throughput: [f32; 3],
    /// None where no light sample competes.
    pub pdf: Option<f32>,
    /// "surface", "escaped", or "blocked" (of a last ray that asks no more).
    pub end: &'static str,
    pub surface: Option<SurfaceRecord>,
    pub emitted: Vec<MetRecord>,
}

#[derive(Debug, Serialize)]
pub struct SurfaceRecord {
    pub what: String,
    pub material: String,
    pub t: f32,
    pub point: [f32; 3],
    pub world_point: [f64; 3],
    pub normal: [f32; 3],
    pub shading_normal: [f32; 3],
    pub uv: [f32; 2],
    /// Whether paths that get here may go on.
    pub goes_on: bool,
    pub light_samples: Vec<LitRecord>,
    pub onward: Vec<OnwardRecord>,
}

#[derive(Debug, Serialize)]
pub struct MetRecord {
    pub light: String,
    pub radiance: [f32; 3],
    pub light_pdf: f32,
    pub weight: f32,
    pub brings: [f32; 3],
}

#[derive(Debug, Serialize)]
pub struct LitRecord {
    pub light: String,
    pub choice: f32,
    /// None if nothing can arrive from there.
    pub direction: Option<[f32; 3]>,
    pub distance: Option<f32>,
    pub delta: bool,
    pub light_pdf: Option<f32>,
    /// Of the choice and the direction.
    pub pdf: Option<f32>,
    /// None where the surface faces away or scatters nothing.
    pub f_cos: Option<[f32; 3]>,
    pub bsdf_pdf: Option<f32>,
    pub scattered_rays: f32,
    pub weight: Option<f32>,
    pub shadow_ray: Option<String>,
    /// "free", what is in the way, or why there is no ray.
    pub verdict: String,
    pub radiance: [f32; 3],
    pub brings: [f32; 3],
}

#[derive(Debug, Serialize)]
pub struct OnwardRecord {
    pub direction: Option<[f32; 3]>,
    pub weight: Option<[f32; 3]>,
    pub pdf: Option<f32>,
    pub delta: bool,
    /// The chance to survive, and the number that must be less.
    pub roulette: Option<[f32; 2]>,
    pub fate: &'static str,
    pub leg: Option<usize>,
}

#[derive(Debug, Serialize)]
pub struct RayRecord {
    pub ray: String,
    /// "closest" or "any".
    pub query: &'static str,
    pub answer: String,
}

impl Record {
    pub fn new(e: &Explained, scene: &Scene, replay: String, replay_ray: Option<String>) -> Self {
        let names = Names { scene };
        let path = e.story.as_ref().map(|story| PathRecord {
            legs: story.legs.iter().enumerate().map(|(i, leg)| names.leg(i, leg)).collect(),
            sum: story.radiance.to_array(),
            exact: story.faithful && bits(story.radiance) == bits(e.radiance),
        });
        Record {
            pixel: [e.id.x, e.id.y],
            sample: e.number,
            replicate: e.id.replicate,
            index: e.id.index,
            samples: e.count.evenly,
            samples_decided: e.count.decided,
            samples_for_one_of_another: e.count.times,
            spared: e.count.spared.map(Rgb::to_array),
            film: e.place,
            radiance: e.radiance.to_array(),
            alpha: e.alpha,
            decided: e.decided.clone(),
            path,
            rays: e.rays.iter().map(|(ray, answer)| names.ray(ray, answer)).collect(),
            replay,
            replay_ray,
        }
    }
}

fn bits(c: Rgb) -> [u32; 3] {
    c.to_array().map(f32::to_bits)
}

/// What things are called.
struct Names<'a> {
    scene: &'a Scene,
}

impl Names<'_> {
    fn hit(&self, hit: &Hit) -> String {
        name_of(self.scene, hit.path, hit.prim)
    }

    /// What is in the way of a ray.
    fn in_the_way(&self, ray: &Ray) -> String {
        match self.scene.kernel.intersect(ray) {
            Some(hit) => format!("blocked by {} at t {}", self.hit(&hit), hit.t),
            None => "blocked".into(),
        }
    }

    fn light(&self, light: Option<u32>) -> String {
        let lights = &self.scene.lights;
        let Some(number) = light else { return "background".into() };
        if let Some(kind) = lights.kinds.get(number as usize) {
            return kind.clone();
        }
        let path = lights.by_path.iter().find(|(_, n)| **n == number).map(|(path, _)| *path);
        match path {
            Some(path) => {
                let object = self.scene.geometry.resolve(path).leaf.object;
                let name = self.scene.objects.get(object as usize).map_or("?", |o| o.name.as_str());
                format!("lamp {name} (light {number})")
            }
            None => format!("light {number}"),
        }
    }

    fn ray(&self, ray: &Ray, answer: &Answer) -> RayRecord {
        let (query, answer) = match answer {
            Answer::Closest(Some(hit)) => ("closest", format!("t {} {}", hit.t, self.hit(hit))),
            Answer::Closest(None) => ("closest", "nothing".into()),
            Answer::Blocked(true) => ("any", self.in_the_way(ray)),
            Answer::Blocked(false) => ("any", "free".into()),
        };
        RayRecord { ray: write_ray(ray, true), query, answer }
    }

    fn leg(&self, number: usize, leg: &Leg) -> LegRecord {
        let (end, surface) = match &leg.end {
            End::Escape => ("escaped", None),
            End::Blocked => ("blocked", None),
            End::Surface(stop) => ("surface", Some(self.surface(stop))),
        };
        LegRecord {
            number,
            from: leg.from,
            depth: leg.depth,
            ray: write_ray(&leg.ray, true),
            throughput: leg.beta.to_array(),
            pdf: leg.pdf.is_finite().then_some(leg.pdf),
            end,
            surface,
            emitted: leg.met.iter().map(|met| self.met(met)).collect(),
        }
    }

    fn met(&self, met: &Met) -> MetRecord {
        MetRecord {
            light: self.light(met.light),
            radiance: met.le.to_array(),
            light_pdf: met.pdf,
            weight: met.weight,
            brings: met.value.to_array(),
        }
    }

    fn surface(&self, stop: &Stop) -> SurfaceRecord {
        let v = &stop.vertex;
        let object = self.scene.objects.get(v.object as usize);
        let world: DVec3 = self.scene.space.world_point(v.p.as_dvec3());
        SurfaceRecord {
            what: self.hit(&stop.hit),
            material: object.and_then(|o| o.looks.get(v.slot as usize)).cloned().unwrap_or_default(),
            t: v.t,
            point: v.p.to_array(),
            world_point: world.to_array(),
            normal: v.ng.to_array(),
            shading_normal: v.frame.n.to_array(),
            uv: v.uv.to_array(),
            goes_on: stop.goes_on,
            light_samples: stop.lit.iter().map(|lit| self.lit(lit)).collect(),
            onward: stop.onward.iter().map(onward).collect(),
        }
    }

    fn lit(&self, lit: &Lit) -> LitRecord {
        let verdict = match (&lit.sample, &lit.ray) {
            (None, _) => "nothing can arrive".into(),
            (_, None) => "no ray: nothing is scattered from there".into(),
            (_, Some(ray)) if lit.blocked => self.in_the_way(ray),
            (_, Some(_)) => "free".into(),
        };
        let weighed = lit.weighed;
        LitRecord {
            light: self.light(Some(lit.chosen.light)),
            choice: lit.chosen.pmf,
            direction: lit.sample.map(|s| s.wi.to_array()),
            distance: lit.sample.map(|s| s.dist).filter(|d| d.is_finite()),
            delta: lit.sample.is_some_and(|s| s.delta),
            light_pdf: lit.sample.map(|s| s.pdf),
            pdf: weighed.map(|w| w.pdf),
            f_cos: weighed.map(|w| w.f_cos.to_array()),
            bsdf_pdf: weighed.map(|w| w.bsdf_pdf),
            scattered_rays: lit.rivals,
            weight: weighed.map(|w| w.weight),
            shadow_ray: lit.ray.as_ref().map(|ray| write_ray(ray, true)),
            verdict,
            radiance: lit.li.to_array(),
            brings: lit.value.to_array(),
        }
    }
}

fn onward(on: &Onward) -> OnwardRecord {
    let (fate, leg) = match on.fate {
        Fate::Leg(leg) => ("goes on", Some(leg)),
        Fate::Absorbed => ("absorbed", None),
        Fate::Roulette => ("ended by roulette", None),
        Fate::LitAlone => ("not traced: light samples count all of it", None),
    };
    let s = on.scattered;
    OnwardRecord {
        direction: s.map(|s| Vec3::to_array(&s.wi)),
        weight: s.map(|s| s.weight.to_array()),
        pdf: s.map(|s| s.pdf),
        delta: s.is_some_and(|s| s.delta),
        roulette: on.roulette,
        fate,
        leg,
    }
}
