//! Scenes on which the test for bias is tested. Shared with `tests/it/statistics.rs`.

use crate::common::{integrator, scene, settings};
use skylit::compare::statistics::replicates::{Origin, Replicates};
use skylit::image::picture::SampleKind;
use skylit::render::aov;
use skylit::render::settings::RenderSettings;
use skylit::render::{Renderer, Silent};
use skylit::scene::Scene;

/// What is changed in one material.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bias {
    /// What its red, green and blue reflectance is multiplied by, less 1.
    pub by: [f64; 3],
}

/// A scene by name.
pub struct Case {
    pub name: &'static str,
    text: fn(&[f64; 3]) -> String,
    depth: f64,
    /// Reflectance of the material that may be changed.
    albedo: [f64; 3],
    /// Number of the object that has it, from 1.
    pub object: u32,
}

fn head(eye: &str, look_at: &str, fov: u32, sky: &str) -> String {
    format!(
        "[camera]\ntype = \"perspective\"\neye = {eye}\nlook_at = {look_at}\nfov_deg = {fov}\n\
         [sky]\n{sky}\n[materials.floor]\ntype = \"diffuse\"\nalbedo = [0.5, 0.5, 0.5]\n"
    )
}

fn object(shape: &str, material: &str) -> String {
    format!("[[objects]]\nshape = {{ {shape} }}\nmaterial = \"{material}\"\n")
}

const FLOOR: &str = "type = \"rectangle\", edge_u = [0, 0, 20], edge_v = [20, 0, 0]";

/// A ball and a box that throw hard shadows by parallel light, under a dim sky; bare sky above.
fn shadows(albedo: &[f64; 3]) -> String {
    head("[0, 2, 6]", "[0, 0.8, 0]", 40, "type = \"constant\"\nradiance = [0.1, 0.15, 0.25]")
        + &format!("[materials.clay]\ntype = \"diffuse\"\nalbedo = {albedo:?}\n")
        + &object(FLOOR, "floor")
        + &object("type = \"sphere\", center = [-0.8, 1, 0], radius = 1.0", "clay")
        + &object("type = \"box\", min = [0.7, 0, -0.5], max = [1.7, 1.4, 0.5]", "floor")
        + "[[lights]]\ntype = \"directional\"\ndirection = [-1, -1.4, -0.6]\nirradiance = [3, 2.9, 2.7]\n"
}

/// Smooth and rough metal under a low sun.
fn metal(albedo: &[f64; 3]) -> String {
    head("[0, 2, 6]", "[0, 0.8, 0]", 40, "type = \"sunset\"")
        + &format!("[materials.rough]\ntype = \"metal\"\ncolor = {albedo:?}\nroughness = 0.5\n")
        + "[materials.smooth]\ntype = \"metal\"\nmetal = \"gold\"\nroughness = 0.1\n"
        + &object(FLOOR, "floor")
        + &object("type = \"sphere\", center = [-1, 1, 0], radius = 1.0", "rough")
        + &object("type = \"sphere\", center = [1.1, 0.8, 0.3], radius = 0.8", "smooth")
}

/// A closed grey room with a lamp, light that is scattered several times.
fn room(albedo: &[f64; 3]) -> String {
    head("[0, 1, 1.9]", "[0, 1, 0]", 60, "type = \"constant\"\nradiance = 0")
        + "[materials.lamp]\ntype = \"emissive\"\nradiance = 20\ntwo_sided = true\n"
        + &format!("[materials.clay]\ntype = \"diffuse\"\nalbedo = {albedo:?}\n")
        + &object("type = \"box\", min = [-1, 0, -2], max = [1, 2, 2]", "floor")
        + &object("type = \"box\", min = [-0.8, 0, -1], max = [-0.1, 1.1, -0.3]", "clay")
        + &object(
            "type = \"rectangle\", center = [0, 1.95, 0], edge_u = [0.4, 0, 0], edge_v = [0, 0, 0.4]",
            "lamp",
        )
}

pub const CASES: [Case; 3] = [
    Case { name: "shadows", text: shadows, depth: 2.0, albedo: [0.6, 0.5, 0.4], object: 2 },
    Case { name: "metal", text: metal, depth: 3.0, albedo: [0.8, 0.7, 0.6], object: 2 },
    Case { name: "room", text: room, depth: 4.0, albedo: [0.5, 0.5, 0.5], object: 2 },
];

/// A case with its scene built.
pub struct Prepared {
    pub case: &'static Case,
    scene: Scene,
}

impl Prepared {
    pub fn new(case: &'static Case, size: [u32; 2], bias: Bias) -> Prepared {
        let albedo = [0, 1, 2].map(|c| case.albedo[c] * (1.0 + bias.by[c]));
        let text = format!("[film]\nsize = [{}, {}]\n", size[0], size[1]) + &(case.text)(&albedo);
        Prepared { case, scene: scene(&text) }
    }

    /// A render with its halves, and with the objects that pixels show.
    pub fn render(&self, spp: u32, seed: u64, threads: usize) -> Replicates {
        let aovs = aov::find(&["id"]).unwrap();
        let settings = RenderSettings { spp, seed, threads, aovs, ..settings(&self.scene) };
        let renderer =
            Renderer { integrator: integrator("path", &[("max_depth", self.case.depth)]), settings };
        let rendered = renderer.render(&self.scene, &Silent).unwrap();
        let mut picture = rendered.film.picture(SampleKind::Float);
        rendered.layers.push_planes(&mut picture);
        let objects = picture.plane("id.V").unwrap().data.iter().map(|v| *v as u32).collect();
        let origin = Origin { seed: Some(seed), spp: Some(u64::from(spp)), sampler: None };
        let mut replicates = Replicates::of_film(&rendered.film, origin);
        replicates.objects = Some(objects);
        replicates
    }
}
