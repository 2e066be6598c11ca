use super::*;
use crate::base::pixel_rect::PixelRect;
use crate::integrators::Integrator;
use crate::render::dealing::Dealing;
use crate::render::outlines::Outlines;
use crate::render::settings::RenderSettings;
use crate::render::{Renderer, Silent};
use crate::sampler::Sampler;
use crate::sampling::filter::PixelFilter;
use crate::scene::build::{BuildOptions, build};
use judge::{error, means};

const SIZE: [u32; 2] = [96, 72];

/// A ball on a floor below a sky with a sun: shadows, bounced light where paths go on, and a rim.
fn ball_on_floor() -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.toml");
    let text = "film = { size = [96, 72] }\nsky = { type = \"midday\" }\n\
        camera = { type = \"perspective\", eye = [0, -3.5, 2], look_at = [0, 0, 0.9], up = [0, 0, 1] }\n\
        [[objects]]\nshape = { type = \"sphere\", center = [0, 0, 1] }\n\
        [[objects]]\nshape = { type = \"quad\", corner = [-9, -9, 0], edge_a = [18, 0, 0], edge_b = [0, 18, 0] }\n";
    std::fs::write(&path, text).unwrap();
    let options = BuildOptions { backend: "brute".into(), ..BuildOptions::default() };
    build(crate::formats::load(&path).unwrap(), &options).unwrap()
}

const RENDERS: u64 = 12;

/// What renders with these strategies show at some pixels: their mean, and the variance of a sample, but for a factor.
fn shown(scene: &Scene, tracer: &PathTracer, pixels: &[[u32; 2]]) -> trial::Trial {
    let integrator: Arc<dyn Integrator> = Arc::new(tracer.clone());
    let settings = RenderSettings {
        spp: 32,
        dealing: Dealing::Even,
        outlines: Some(1),
        pilot: false,
        ..RenderSettings::new(SIZE)
    };
    let render = |seed: u64| -> Vec<f64> {
        let settings = RenderSettings { seed, ..settings.clone() };
        let film = Renderer { integrator: integrator.clone(), settings }.render(scene, &Silent).unwrap().film;
        pixels.iter().map(|&[x, y]| f64::from(film.mean(x, y).luminance())).collect()
    };
    let renders: Vec<Vec<f64>> = (100..100 + RENDERS).map(render).collect();
    let of_pixel = |i: usize| {
        let mean = renders.iter().map(|r| r[i]).sum::<f64>() / RENDERS as f64;
        let squares = renders.iter().map(|r| (r[i] - mean).powi(2)).sum::<f64>();
        trial::Shown { mean, variance: squares / (RENDERS - 1) as f64 }
    };
    trial::Trial { pixels: (0..pixels.len()).map(of_pixel).collect(), rays: RayCounts::default(), cost: 0.0 }
}

#[test]
fn trials_foretell_the_errors_of_renders() {
    let scene = ball_on_floor();
    let rect = PixelRect::of_size(SIZE[0], SIZE[1]);
    let outlines = Outlines::of(&scene, rect, 4).unwrap();
    let plan = PilotPlan {
        pixels: rect,
        spp: 1 << 16,
        seed: 1,
        kind: Sampler::default(),
        filter: PixelFilter::default(),
        is_outline: &|x, y| outlines.contains(x, y),
        outline_times: 1,
        by_need: true,
    };
    let mut seen = Seen::new(&scene);
    assert_eq!(seen.scout(&scene, &plan, SCOUTS) as usize, rect.area() - outlines.count());
    let usual = vec![Strategy::Both(1); seen.classes.len()];
    for (max_depth, number) in [(1, 0), (1, 1), (3, 0), (3, 1)] {
        let tracer = PathTracer { max_depth, auto_strategy: false, ..PathTracer::default() };
        let tracing =
            Tracing { tracer: &tracer, scene: &scene, plan: &plan, classes: &seen.of, usual: &usual };
        let pixels = &seen.classes[number].pixels;
        let strategies = [Strategy::Both(1), Strategy::Light(8), Strategy::Light(1)];
        let trials = strategies.map(|s| tracing.of_class(number, s, pixels));
        let means = means(&trials);
        let [both, others @ ..] = [0, 1, 2].map(|k| {
            let mut of_classes = usual.clone();
            of_classes[number] = strategies[k];
            let strategies = Strategies::by_class(&seen.of, &of_classes);
            let renders = shown(&scene, &PathTracer { strategies, ..tracer.clone() }, pixels);
            (error(&trials[k], &means), error(&renders, &means))
        });
        for (k, (other, strategy)) in (1..).zip(others.iter().zip(&strategies[1..])) {
            let (foretold, is) = (other.0 / both.0, other.1 / both.1);
            // Errors of groups of 8 are 1.1 to 1.9 times those of 32 samples, which are more even; what differs from strategy to
            // strategy is at most a fifth, but on the ball in direct light: there the noise of one sample of each falls that
            // fast (0.223 to 0.129), that of eight light samples hardly (0.032 to 0.030).
            let tolerance: f64 = if (max_depth, number, k) == (1, 0, 1) { 1.8 } else { 1.25 };
            let off = (foretold / is).ln().abs();
            assert!(off < tolerance.ln(), "depth {max_depth}, {strategy:?}: {foretold} for {is}");
        }
    }
}
