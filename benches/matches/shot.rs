//! Renders a scene file in process, as `skylit render` does with the same settings.

use super::picture::Pixels;
use skylit::base::intersectable::KernelOptions;
use skylit::base::registry::{Node, Value, build as build_node};
use skylit::error::Result;
use skylit::integrators;
use skylit::render::film::Film;
use skylit::render::settings::{RenderSettings, crop_window};
use skylit::render::{Renderer, Silent};
use skylit::scene::build::{BuildOptions, build};
use skylit::scene::desc::SceneDesc;

/// What is asked for beside the scene; None leaves what the scene says.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wish<'a> {
    /// Name of the kernel; empty is `auto`.
    pub backend: &'a str,
    /// Film size, pixels.
    pub size: Option<[u32; 2]>,
    /// Samples a pixel.
    pub spp: Option<u32>,
    /// The integrator's `max_depth`.
    pub max_depth: Option<u32>,
    /// Name of the point set.
    pub sampler: Option<&'a str>,
    /// Name of the pixel filter.
    pub filter: Option<&'a str>,
    /// A part of the film (x0, x1, y0, y1 from 0 to 1).
    pub crop: Option<[f64; 4]>,
    /// Worker threads; 0 is one for each core.
    pub threads: usize,
}

/// Builds and renders.
///
/// # Errors
/// Those of building and rendering.
pub fn render_desc(mut desc: SceneDesc, wish: &Wish) -> Result<Film> {
    desc.film.size = wish.size.unwrap_or(desc.film.size);
    let settings = settings(&desc, wish)?;
    let integrator = build_node("integrator", integrators::REGISTRY, &integrator(&desc, wish.max_depth))?;
    let backend = if wish.backend.is_empty() { "auto" } else { wish.backend };
    let kernel = KernelOptions { threads: settings.threads, ..KernelOptions::default() };
    let scene = build(desc, &BuildOptions { backend: backend.into(), kernel })?;
    Ok(Renderer { integrator, settings }.render(&scene, &Silent)?.film)
}

fn settings(desc: &SceneDesc, wish: &Wish) -> Result<RenderSettings> {
    let usual = RenderSettings::new(desc.film.size);
    let given = &desc.render;
    let sampler = wish.sampler.or(given.sampler.as_deref()).map(str::parse).transpose()?;
    let filter = wish.filter.or(given.filter.as_deref()).map(str::parse).transpose()?;
    let crop = wish.crop.map(|w| crop_window(w, usual.size)).transpose()?;
    Ok(RenderSettings {
        crop: crop.unwrap_or(usual.crop),
        spp: wish.spp.or(given.spp).unwrap_or(usual.spp),
        seed: given.seed.unwrap_or(usual.seed),
        sampler: sampler.unwrap_or(usual.sampler),
        moments: true,
        filter: filter.unwrap_or(usual.filter),
        threads: if wish.threads == 0 { usual.threads } else { wish.threads },
        ..usual
    })
}

fn integrator(desc: &SceneDesc, max_depth: Option<u32>) -> Node {
    let first = integrators::REGISTRY.first().map_or("", |row| row.kind);
    let default = || Node { kind: first.into(), ..Node::default() };
    let mut node = desc.render.integrator.clone().unwrap_or_else(default);
    if let Some(depth) = max_depth {
        node.params.list.retain(|p| p.name != "max_depth");
        node.params = std::mem::take(&mut node.params).with("max_depth", Value::Number(f64::from(depth)));
    }
    node
}

/// The means of a film's pixels.
pub fn pixels(film: &Film) -> Pixels {
    let window = film.window();
    let data = window.pixels().map(|(x, y)| film.mean(x, y).to_array()).collect();
    Pixels { width: window.width() as usize, height: window.height() as usize, data }
}

/// Variance of each pixel's mean from the spread of its two replicates, unbiased but with one degree of freedom; zeros
/// where there is one sample alone.
pub fn variances(film: &Film) -> Vec<[f32; 3]> {
    match film.variance(0) {
        Some([r, g, b]) => r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect(),
        None => vec![[0.0; 3]; film.window().area()],
    }
}
