//! Scenes on which a target error is held against the truth. Shared with `benches/coverage`.

use crate::common::{integrator, scene, settings};
use skylit::render::adaptive::{Part, Target};
use skylit::render::film::Film;
use skylit::render::settings::RenderSettings;
use skylit::render::{Rendered, Renderer, Silent};
use skylit::scene::Scene;

/// A scene with what is asked of it.
pub struct Case {
    pub name: &'static str,
    scene: fn() -> String,
    kind: &'static str,
    params: &'static [(&'static str, f64)],
    /// Of the same picture, with less noise where there is a way.
    reference_params: &'static [(&'static str, f64)],
    /// Relative error of the picture.
    pub target: f64,
    pub side: u32,
    /// Samples a pixel of the reference.
    pub reference_spp: u32,
}

fn head(eye: &str, look_at: &str, fov: u32, sky: &str) -> String {
    format!(
        "[camera]\ntype = \"perspective\"\neye = {eye}\nlook_at = {look_at}\nfov_deg = {fov}\n\
         [sky]\n{sky}\n[materials.clay]\ntype = \"diffuse\"\nalbedo = [0.6, 0.5, 0.4]\n"
    )
}

fn object(shape: &str, material: &str) -> String {
    format!("[[objects]]\nshape = {{ {shape} }}\nmaterial = \"{material}\"\n")
}

const FLOOR: &str = "type = \"rectangle\", edge_u = [0, 0, 20], edge_v = [20, 0, 0]";

/// Soft shadows under a sky with a sun.
fn sunset() -> String {
    head("[0, 2, 6]", "[0, 0.6, 0]", 35, "type = \"sunset\"")
        + &object(FLOOR, "clay")
        + &object("type = \"sphere\", center = [0, 1, 0], radius = 1.0", "clay")
}

/// Nothing but edges: a checkered plain to the horizon, lit evenly.
fn edges() -> String {
    head("[0, 1, 0]", "[5, 0.7, 1]", 50, "type = \"constant\"")
        + "[materials.checker]\ntype = \"diffuse\"\nalbedo = { type = \"checker\", a = 0.9, b = 0.05, uv_scale = 60 }\n"
        + &object("type = \"rectangle\", edge_u = [0, 0, 60], edge_v = [60, 0, 0]", "checker")
}

/// A closed room with a lamp and light that is scattered several times; dark corners.
fn room() -> String {
    head("[0, 1, 1.9]", "[0, 1, 0]", 60, "type = \"constant\"\nradiance = 0")
        + "[materials.lamp]\ntype = \"emissive\"\nradiance = 20\ntwo_sided = true\n"
        + "[materials.red]\ntype = \"diffuse\"\nalbedo = [0.6, 0.05, 0.05]\n"
        + &object("type = \"box\", min = [-1, 0, -2], max = [1, 2, 2]", "clay")
        + &object(
            "type = \"rectangle\", center = [0, 1.95, 0], edge_u = [0.4, 0, 0], edge_v = [0, 0, 0.4]",
            "lamp",
        )
        + &object("type = \"box\", min = [-0.8, 0, -1], max = [-0.1, 1.1, -0.3]", "red")
}

/// A small lamp just above a floor, turned away from the camera: of all camera rays 1 in 10,000 scatters into it (the
/// lamp's area is so much of what the camera sees of the floor). A picture without its light has an error of 9.2 %. The
/// first look is at 40,000 paths, of which 1 in 45 renders has none that found it.
fn needle() -> String {
    head("[0, 1.5, 0]", "[0, 0, 0.001]", 60, "type = \"constant\"")
        + "[materials.lamp]\ntype = \"emissive\"\nradiance = 500\n"
        + &object(FLOOR, "clay")
        + &object(
            "type = \"rectangle\", center = [0.1, 0.08, 0.2], edge_u = [0.0173, 0, 0], edge_v = [0, 0, 0.0173]",
            "lamp",
        )
}

/// A glass ball that throws the light of a lamp on the floor: bright paths that only chance finds.
fn caustic() -> String {
    head("[0, 2.5, 4]", "[0, 0.4, 0]", 30, "type = \"constant\"\nradiance = 0.2")
        + "[materials.lamp]\ntype = \"emissive\"\nradiance = 60\n"
        + "[materials.glass]\ntype = \"dielectric\"\n"
        + &object(FLOOR, "clay")
        + &object("type = \"sphere\", center = [0, 0.7, 0], radius = 0.5", "glass")
        + &object("type = \"sphere\", center = [-1.5, 3, 1], radius = 0.2", "lamp")
}

pub const CASES: [Case; 5] = [
    Case {
        name: "sunset",
        scene: sunset,
        kind: "path",
        params: &[("max_depth", 3.0)],
        reference_params: &[("max_depth", 3.0)],
        target: 0.02,
        side: 32,
        reference_spp: 1 << 14,
    },
    Case {
        name: "edges",
        scene: edges,
        kind: "path",
        params: &[("max_depth", 2.0)],
        reference_params: &[("max_depth", 2.0)],
        target: 0.03,
        side: 32,
        reference_spp: 1 << 15,
    },
    Case {
        name: "room",
        scene: room,
        kind: "path",
        params: &[("max_depth", 4.0)],
        reference_params: &[("max_depth", 4.0)],
        target: 0.12,
        side: 16,
        reference_spp: 1 << 15,
    },
    Case {
        name: "needle",
        scene: needle,
        kind: "path",
        params: &[("max_depth", 2.0), ("light_sampling", 0.0)],
        reference_params: &[("max_depth", 2.0)],
        target: 0.07,
        side: 25,
        reference_spp: 1 << 14,
    },
    Case {
        name: "caustic",
        scene: caustic,
        kind: "path",
        params: &[("max_depth", 5.0)],
        reference_params: &[("max_depth", 5.0)],
        target: 0.15,
        side: 16,
        reference_spp: 1 << 17,
    },
];

/// A case with its scene built and its truth known.
pub struct Prepared {
    pub case: &'static Case,
    pub scene: Scene,
    /// Mean radiance by pixel and channel.
    truth: Vec<[f64; 3]>,
    /// What is added to its square.
    floor: f64,
    /// Relative squared error of the reference itself.
    pub reference_error: f64,
}

impl Prepared {
    /// Its reference has the case's samples over `divisor`.
    pub fn new(case: &'static Case, threads: usize, divisor: u32) -> Prepared {
        Prepared::of_side(case, case.side, threads, divisor)
    }

    /// With other sides than the case's.
    pub fn of_side(case: &'static Case, side: u32, threads: usize, divisor: u32) -> Prepared {
        let text = format!("[film]\nsize = [{side}, {side}]\n") + &(case.scene)();
        let scene = scene(&text);
        let settings =
            RenderSettings { spp: case.reference_spp / divisor, seed: u64::MAX, threads, ..settings(&scene) };
        let renderer = Renderer { integrator: integrator(case.kind, case.reference_params), settings };
        let film = renderer.render(&scene, &Silent).unwrap().film;
        let pixels = || film.window().pixels();
        let truth = means(&film);
        let mean =
            pixels().map(|(x, y)| f64::from(film.mean(x, y).luminance())).sum::<f64>() / truth.len() as f64;
        let mut prepared = Prepared { case, scene, truth, floor: 0.01 * mean * mean, reference_error: 0.0 };
        let variances = film.variance(0).unwrap();
        prepared.reference_error =
            prepared.mean_of(|i, c| f64::from(variances[c][i]) / prepared.square(i, c));
        prepared
    }

    fn square(&self, pixel: usize, channel: usize) -> f64 {
        self.truth[pixel][channel].powi(2) + self.floor
    }

    fn mean_of(&self, value: impl Fn(usize, usize) -> f64) -> f64 {
        let all = (0..self.truth.len()).flat_map(|i| (0..3).map(move |c| (i, c)));
        all.map(|(i, c)| value(i, c)).sum::<f64>() / (3 * self.truth.len()) as f64
    }

    /// The relative error that is promised about, of a picture against the truth.
    pub fn error(&self, film: &Film) -> f64 {
        let picture = means(film);
        self.mean_of(|i, c| (picture[i][c] - self.truth[i][c]).powi(2) / self.square(i, c)).sqrt()
    }

    /// A render to the case's target with 95 % confidence.
    pub fn to_target(&self, seed: u64, threads: usize) -> Rendered {
        let target = Target { error: self.case.target, confidence: 0.95, part: Part::Picture };
        self.render(RenderSettings {
            spp: 1 << 17,
            target: Some(target),
            seed,
            threads,
            ..settings(&self.scene)
        })
    }

    /// A render as the case wants it.
    pub fn render(&self, settings: RenderSettings) -> Rendered {
        let renderer = Renderer { integrator: integrator(self.case.kind, self.case.params), settings };
        renderer.render(&self.scene, &Silent).unwrap()
    }

    /// The case's render with a fixed number of samples.
    pub fn evenly(&self, spp: u32, seed: u64, threads: usize) -> Rendered {
        self.render(RenderSettings { spp, seed, threads, ..settings(&self.scene) })
    }
}

fn means(film: &Film) -> Vec<[f64; 3]> {
    let mean = |(x, y)| film.mean(x, y);
    film.window().pixels().map(mean).map(|m| [m.r, m.g, m.b].map(f64::from)).collect()
}
