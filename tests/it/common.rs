//! Scenes written as text, rendered in memory.

use skylit::base::intersectable::{KernelMode, KernelOptions};
use skylit::base::registry::{self, Node, Params, Value};
use skylit::color::Rgb;
use skylit::integrators;
use skylit::render::settings::RenderSettings;
use skylit::render::{Rendered, Renderer, Silent};
use skylit::sampler::Sampler;
use skylit::scene::build::{BuildOptions, build};
use skylit::scene::{Scene, desc::SceneDesc};

/// Loads a scene written as TOML.
pub fn describe(toml: &str) -> SceneDesc {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, toml).unwrap();
    skylit::formats::load(&path).unwrap_or_else(|e| panic!("{e}\n{toml}"))
}

/// Builds a scene written as TOML, on a named kernel.
pub fn scene_on(backend: &str, toml: &str) -> Scene {
    build_on(backend, describe(toml))
}

/// Builds a description on a named kernel.
pub fn build_on(backend: &str, desc: SceneDesc) -> Scene {
    let kernel = KernelOptions { mode: KernelMode::Robust, ..KernelOptions::default() };
    build(desc, &BuildOptions { backend: backend.into(), kernel }).unwrap()
}

/// As [`scene_on`] with the default kernel.
pub fn scene(toml: &str) -> Scene {
    scene_on("auto", toml)
}

/// An integrator by name, with number parameters.
pub fn integrator(kind: &str, params: &[(&str, f64)]) -> std::sync::Arc<dyn integrators::Integrator> {
    let mut p = Params::new();
    for (name, value) in params {
        let value = match *name {
            "light_sampling" | "mis" | "each_light" => Value::Bool(*value != 0.0),
            _ => Value::Number(*value),
        };
        p = p.with(name, value);
    }
    let node = Node { kind: kind.into(), params: p, ..Node::default() };
    registry::build("integrator", integrators::REGISTRY, &node).unwrap()
}

/// Renders the scene's own film with the given integrator.
pub fn render(scene: &Scene, integrator: std::sync::Arc<dyn integrators::Integrator>, spp: u32) -> Rendered {
    let settings = RenderSettings { spp, threads: 2, ..settings(scene) };
    Renderer { integrator, settings }.render(scene, &Silent).unwrap()
}

/// As [`render`], with a ray for every sample: which pixels are known to see nothing depends on how boxes are nested.
pub fn render_rays(
    scene: &Scene,
    integrator: std::sync::Arc<dyn integrators::Integrator>,
    spp: u32,
) -> Rendered {
    let settings =
        RenderSettings { spp, threads: 2, skip_background: false, outlines: Some(1), ..settings(scene) };
    Renderer { integrator, settings }.render(scene, &Silent).unwrap()
}

/// Settings for the film that the scene's camera fills: with moments, and pixels that are independent of each other, so
/// that tests know how sure a mean is.
pub fn settings(scene: &Scene) -> RenderSettings {
    RenderSettings {
        moments: true,
        sampler: Sampler::OwenSobol,
        ..RenderSettings::new([scene.film.width, scene.film.height])
    }
}

/// Mean radiance over the whole film and its standard error, from the pixels' half-buffers.
#[derive(Debug)]
pub struct Mean {
    /// Mean luminance.
    pub value: f64,
    /// Standard error of it.
    pub error: f64,
}

/// The mean of a film's luminance with its standard error. Pixels are independent of each other, and each brings one
/// degree of freedom: hundreds of them, where tiles would bring one or two.
pub fn mean(rendered: &Rendered) -> Mean {
    let film = &rendered.film;
    let variances = film.variance(0).expect("both halves of some pixel have samples");
    let (mut sum, mut variance, n) = (0.0, 0.0, film.window().area() as f64);
    for (i, (x, y)) in film.window().pixels().enumerate() {
        sum += f64::from(film.mean(x, y).luminance());
        // Channels may go together; no luminance spreads more than if they all do.
        let spread = Rgb::from([0, 1, 2].map(|c| variances[c][i].sqrt()));
        variance += f64::from(spread.luminance()).powi(2);
    }
    Mean { value: sum / n, error: variance.sqrt() / n }
}

/// Asserts that a mean equals an expected value within `sigmas` standard errors plus a systematic part.
pub fn assert_mean(what: &str, m: &Mean, expected: f64, sigmas: f64, systematic: f64) {
    let allowed = sigmas * m.error + systematic;
    assert!(
        (m.value - expected).abs() <= allowed,
        "{what}: {} +- {}, expected {expected} (allowed difference {allowed})",
        m.value,
        m.error
    );
}

/// A folder of the shared data; None, said on the way, where that is absent.
pub fn shared(folder: &str) -> Option<std::path::PathBuf> {
    let data = std::env::var_os("SKYLIT_DATA").map_or_else(
        || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        std::path::PathBuf::from,
    );
    if data.is_dir() {
        return Some(data.join(folder));
    }
    assert!(
        std::env::var_os("SKYLIT_REQUIRE_DATA").is_none_or(|v| v != "1"),
        "{} is no folder",
        data.display()
    );
    println!("skipped: no SKYLIT_DATA");
    None
}
