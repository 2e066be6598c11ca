//! What a path brings does not depend on the batch that it travels in: points that go on by columns, or wait for light
//! samples together, have the same bits as points by themselves.

use crate::common::scene_on;
use crate::product::{LAMP, SUN, ground_and};
use skylit::base::camera::FilmSamples;
use skylit::base::registry::{self, Node, Params, Value};
use skylit::color::Rgb;
use skylit::integrators::{
    self, Avoided, CameraBatch, Integrator, PathId, PathResults, RayCounts, Workspace,
};
use skylit::sampler::{Sampler, ray_key};
use skylit::scene::Scene;
use std::sync::Arc;

/// Too few for columns.
const BY_ITSELF: usize = 3;
/// As a render has them.
const MANY: usize = 2048;

const SAMPLES: u32 = 2;

#[derive(Debug, PartialEq, Default)]
struct Traced {
    li: Vec<Rgb>,
    alpha: Vec<f32>,
    avoided: Avoided,
    counts: RayCounts,
}

/// Some samples of every pixel, so many at once.
fn traced(scene: &Scene, integrator: &dyn Integrator, at_once: usize) -> Traced {
    let points = Sampler::OwenSobol.points(7, Some(SAMPLES));
    let pixels = (0..scene.film.height).flat_map(|y| (0..scene.film.width).map(move |x| (x, y)));
    let all: Vec<_> = pixels.flat_map(|p| (0..SAMPLES).map(move |i| (p, i))).collect();
    let (mut work, mut results, mut out) = (Workspace::default(), PathResults::default(), Traced::default());
    for some in all.chunks(at_once) {
        let mut batch = CameraBatch { times: 1, ..CameraBatch::default() };
        let offset = |i: u32| (i as f32 + 0.5) / SAMPLES as f32;
        let x: Vec<f32> = some.iter().map(|((x, _), i)| *x as f32 + offset(*i)).collect();
        let y: Vec<f32> = some.iter().map(|((_, y), i)| *y as f32 + offset((i + 2) % SAMPLES)).collect();
        batch.rays.resize(some.len());
        scene.camera.fill_rays(&FilmSamples { x: &x, y: &y, lens_u: &[], lens_v: &[] }, &mut batch.rays);
        for (k, &((x, y), index)) in some.iter().enumerate() {
            let id = PathId { sampler: points.pixel(x, y, 0), index, key: ray_key(x, y, 0) };
            batch.ids.extend(id, 1);
            batch.rays.key[k] = ray_key(id.key, index, 1);
        }
        integrator.trace(scene, &batch, &mut work, &mut results);
        out.li.extend_from_slice(&results.li);
        out.alpha.extend_from_slice(&results.alpha);
    }
    Traced { avoided: work.avoided, counts: work.counts, ..out }
}

fn path(strategy: &str, depth: f64, each_light: bool, mis: bool) -> Arc<dyn Integrator> {
    let params = Params::new()
        .with("max_depth", Value::Number(depth))
        .with("roulette_depth", Value::Number(2.0))
        .with("strategy", Value::Text(strategy.into()))
        .with("each_light", Value::Bool(each_light))
        .with("mis", Value::Bool(mis));
    let node = Node { kind: "path".into(), params, ..Node::default() };
    registry::build("integrator", integrators::REGISTRY, &node).unwrap()
}

#[test]
fn paths_are_the_same_alone_and_together() {
    let materials = [
        "type = \"diffuse\"\nalbedo = [0.8, 0.7, 0.3]",
        "type = \"ggx\"\nalpha = 0.15\nspecular = 0.6\ndiffuse = 0.3",
        "type = \"metal\"\nroughness = 0.3\nanisotropy = 0.5",
        "type = \"mirror\"",
        "type = \"dielectric\"\nroughness = 0.4",
        "type = \"dielectric\"",
    ];
    let skies = ["type = \"gradient\"", "type = \"midday\"\nrotate_y_deg = 30", "type = \"constant\""];
    for (material, sky) in materials.iter().flat_map(|m| skies.iter().map(move |s| (m, s))) {
        for (others, sampling) in [("", "product"), ("", "table"), (LAMP, "product"), (SUN, "product")] {
            let scene = scene_on("brute", &ground_and(sky, sampling, material, others));
            for strategy in ["bsdf", "both", "both-4", "light", "light-8"] {
                for (depth, each, mis) in [(1.0, false, true), (4.0, false, true), (3.0, true, false)] {
                    let integrator = path(strategy, depth, each, mis);
                    let [alone, together] =
                        [BY_ITSELF, MANY].map(|at_once| traced(&scene, &*integrator, at_once));
                    let same = alone == together;
                    assert!(same, "{material} {sky} {sampling} {others} {strategy} {depth} {each}");
                    assert!(alone.li.iter().any(|l| !l.is_black()), "{material} {sky}");
                }
            }
        }
    }
}
