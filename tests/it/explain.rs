//! What is told of a sample is what the render takes: radiance bit for bit, every step's numbers, and their sum.

use crate::common::scene_on;
use crate::product::{LAMP, SUN, ground_and};
use skylit::base::pixel_rect::PixelRect;
use skylit::base::registry::{self, Node, Params, Value};
use skylit::color::Rgb;
use skylit::integrators::story::{End, Fate, Story};
use skylit::integrators::{self, CameraBatch, Integrator, PathResults, PilotPlan, Specialised, Workspace};
use skylit::render::dealing::Dealing;
use skylit::render::explain::{Asked, Explained, Explainer, Which};
use skylit::render::settings::RenderSettings;
use skylit::render::{Renderer, Silent};
use skylit::sampler::ray_key;
use skylit::scene::Scene;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Radiance by key of pixel and randomisation, and index.
type Seen = HashMap<(u32, u32), Rgb>;

/// Keeps what another integrator brings.
struct Keeping {
    inner: Arc<dyn Integrator>,
    seen: Arc<Mutex<Seen>>,
}

impl Integrator for Keeping {
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults) {
        self.inner.trace(scene, batch, work, out);
        let mut seen = self.seen.lock().unwrap();
        for ((key, index), li) in batch.ids.keys.iter().zip(&batch.ids.indices).zip(&out.li) {
            assert!(seen.insert((*key, *index), *li).is_none(), "taken twice");
        }
    }

    fn describe(&self) -> String {
        self.inner.describe()
    }

    fn shows_background(&self) -> bool {
        self.inner.shows_background()
    }

    fn gains_by_outlines(&self, scene: &Scene) -> bool {
        self.inner.gains_by_outlines(scene)
    }

    fn specialise(&self, scene: &Scene, plan: &PilotPlan) -> Option<Specialised> {
        let found = self.inner.specialise(scene, plan)?;
        let integrator = Arc::new(Keeping { inner: found.integrator, seen: self.seen.clone() });
        Some(Specialised { integrator, ..found })
    }
}

fn integrator(kind: &str, params: Params) -> Arc<dyn Integrator> {
    let node = Node { kind: kind.into(), params, ..Node::default() };
    registry::build("integrator", integrators::REGISTRY, &node).unwrap()
}

/// Renders, asks for every sample of every pixel, and holds them against each other; hands every one to `look`.
fn hold_all(scene: &mut Scene, renderer: Renderer, look: &mut dyn FnMut(&Explained)) {
    let seen = Arc::new(Mutex::new(Seen::new()));
    let keeping = Arc::new(Keeping { inner: renderer.integrator.clone(), seen: seen.clone() });
    let whole = Renderer { integrator: keeping, settings: renderer.settings.clone() };
    let film = whole.render(scene, &Silent).unwrap().film;
    let mut seen = std::mem::take(&mut *seen.lock().unwrap());
    let asked = Asked::instead_of_kernel(scene).unwrap();
    let explainer = Explainer::new(&renderer, scene, &asked).unwrap();
    for (x, y) in film.window().pixels() {
        let ask = |number| explainer.explain([x, y], Which::Number(number));
        let first = ask(0).unwrap();
        let n = first.count.evenly;
        let mut sum = [0.0f64; 3];
        let mut brightest = (0, f32::NEG_INFINITY);
        for number in 0..n {
            let e = ask(number).unwrap();
            look(&e);
            if let Some(spared) = e.count.spared {
                assert!(
                    (film.mean(x, y).luminance() - spared.luminance()).abs()
                        < 1e-6 * (1.0 + spared.luminance())
                );
            } else {
                let taken = seen.remove(&(ray_key(x, y, e.id.replicate), e.id.index));
                let taken = taken.unwrap_or_else(|| panic!("({x}, {y}) {number} is not taken"));
                assert_eq!(
                    taken.to_array().map(f32::to_bits),
                    e.radiance.to_array().map(f32::to_bits),
                    "({x}, {y}) {number}"
                );
            }
            if let Some(story) = &e.story {
                assert!(story.faithful, "({x}, {y}) {number}: {story:#?}");
                assert_eq!(story.radiance, e.radiance, "({x}, {y}) {number}: {story:#?}");
                assert!(adds_up(story), "{story:#?}");
            }
            for (sum, v) in sum.iter_mut().zip(e.radiance.to_array()) {
                *sum += f64::from(v) / n as f64;
            }
            if e.radiance.luminance() > brightest.1 {
                brightest = (number, e.radiance.luminance());
            }
        }
        assert_eq!(explainer.explain([x, y], Which::Brightest).unwrap().number, brightest.0);
        if first.count.spared.is_none() {
            for (mean, sum) in film.mean(x, y).to_array().into_iter().zip(sum) {
                // Each sample is rounded to 2^-24, and the mean to f32.
                assert!(
                    (f64::from(mean) - sum).abs() <= 6e-8 + 6e-8 * sum,
                    "({x}, {y}): {mean} against {sum}"
                );
            }
        }
        if !first.count.decided {
            assert!(ask(n).is_err());
        }
    }
    assert!(seen.is_empty(), "{} samples cannot be asked for", seen.len());
}

/// What is brought, in any order, is the radiance but for rounding.
fn adds_up(story: &Story) -> bool {
    let mut sum = [0.0f64; 3];
    let mut add = |value: Rgb| (0..3).for_each(|c| sum[c] += f64::from(value.to_array()[c]));
    for leg in &story.legs {
        leg.met.iter().for_each(|m| add(m.value));
        if let End::Surface(stop) = &leg.end {
            stop.lit.iter().for_each(|l| add(l.value));
        }
    }
    let radiance = story.radiance.to_array();
    (0..3).all(|c| (f64::from(radiance[c]) - sum[c]).abs() <= 1e-6 * (1.0 + sum[c].abs()))
}

/// Even dealing, a part of the film with the rim of the ball and some ground.
fn settings(scene: &Scene, spp: u32) -> RenderSettings {
    let size = [scene.film.width, scene.film.height];
    let crop = PixelRect::new(5, 9, 12, 16);
    RenderSettings { spp, crop, dealing: Dealing::Even, threads: 2, ..RenderSettings::new(size) }
}

/// Of what was told, so that all of it was met.
#[derive(Default, Debug)]
struct Met {
    escapes: usize,
    blocked: usize,
    free: usize,
    shadowed: usize,
    lamps: usize,
    roulette: usize,
    survived: usize,
    split: usize,
    alone: usize,
    dirac: usize,
    outlines: usize,
}

impl Met {
    fn look(&mut self, e: &Explained) {
        self.outlines += usize::from(e.count.times > 1);
        for leg in &e.story.as_ref().expect("told").legs {
            match &leg.end {
                End::Escape => self.escapes += 1,
                End::Blocked => self.blocked += 1,
                End::Surface(stop) => {
                    self.lamps += leg.met.len();
                    self.free += stop.lit.iter().filter(|l| l.ray.is_some() && !l.blocked).count();
                    self.shadowed += stop.lit.iter().filter(|l| l.blocked).count();
                    self.split += usize::from(stop.onward.len() > 1);
                    for on in &stop.onward {
                        self.dirac += usize::from(on.scattered.is_some_and(|s| s.delta));
                        self.roulette += usize::from(on.fate == Fate::Roulette);
                        self.survived +=
                            usize::from(on.roulette.is_some() && matches!(on.fate, Fate::Leg(_)));
                        self.alone += usize::from(on.fate == Fate::LitAlone);
                    }
                }
            }
        }
    }
}

#[test]
fn every_sample_told_is_the_one_that_is_rendered() {
    let materials = [
        "type = \"diffuse\"\nalbedo = [0.8, 0.7, 0.3]",
        "type = \"metal\"\nroughness = 0.3",
        "type = \"mirror\"",
        "type = \"dielectric\"",
    ];
    let skies = ["type = \"midday\"\nrotate_y_deg = 30", "type = \"constant\""];
    let mut met = Met::default();
    let ways = [
        ("auto", 5.0, false, true),
        ("both-4", 1.0, false, true),
        ("light-8", 1.0, false, true),
        ("bsdf", 3.0, true, true),
        ("both", 3.0, true, false),
    ];
    for (material, sky) in materials.iter().flat_map(|m| skies.iter().map(move |s| (m, s))) {
        for others in ["", LAMP, SUN] {
            let text = ground_and(sky, "product", material, others);
            for (strategy, depth, each, mis) in ways {
                let mut scene = scene_on("auto", &text);
                let params = Params::new()
                    .with("max_depth", Value::Number(depth))
                    .with("roulette_depth", Value::Number(2.0))
                    .with("strategy", Value::Text(strategy.into()))
                    .with("each_light", Value::Bool(each))
                    .with("mis", Value::Bool(mis));
                let settings = settings(&scene, 2);
                let renderer = Renderer { integrator: integrator("path", params), settings };
                hold_all(&mut scene, renderer, &mut |e| met.look(e));
            }
        }
    }
    let counts = [met.escapes, met.blocked, met.free, met.shadowed, met.lamps, met.roulette, met.survived];
    assert!(counts.into_iter().chain([met.split, met.alone, met.dirac]).all(|n| n > 0), "{met:?}");
}

/// Packets of a kernel that answers to 1e-7 are asked as in the render.
#[test]
fn kernels_answer_as_in_the_render() {
    let names = skylit::accel::KERNELS.iter().map(|k| k.name);
    for name in names {
        let text = ground_and("type = \"midday\"", "product", "type = \"dielectric\"", LAMP);
        let mut scene = scene_on(name, &text);
        let renderer =
            Renderer { integrator: integrator("path", Params::new()), settings: settings(&scene, 4) };
        hold_all(&mut scene, renderer, &mut |_| {});
    }
}

#[test]
fn numbers_are_those_of_two_randomisations_and_of_outlines() {
    let text = ground_and("type = \"constant\"", "product", "type = \"diffuse\"\nalbedo = 0.8", "");
    let mut outlined = 0;
    for (spp, moments) in [(1, false), (3, false), (3, true), (4, true)] {
        let mut scene = scene_on("auto", &text);
        let settings = RenderSettings { moments, outlines: Some(4), ..settings(&scene, spp) };
        let renderer = Renderer { integrator: integrator("direct", Params::new()), settings };
        hold_all(&mut scene, renderer, &mut |e| outlined += usize::from(e.count.times > 1));
    }
    assert!(outlined > 0);
}

#[test]
fn other_integrators_tell_their_rays() {
    for kind in ["ao", "whitted", "normals"] {
        let text = ground_and("type = \"constant\"", "product", "type = \"mirror\"", SUN);
        let mut scene = scene_on("auto", &text);
        let renderer =
            Renderer { integrator: integrator(kind, Params::new()), settings: settings(&scene, 2) };
        let mut rays = 0;
        hold_all(&mut scene, renderer, &mut |e| {
            assert!(e.story.is_none());
            rays += e.rays.len();
        });
        assert!(rays >= 49 * 2, "{kind}: {rays}");
    }
}
