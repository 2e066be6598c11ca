//! `skylit info`: what is in a scene or a mesh, what it needs, what it will cost.

use super::scene_args::SceneArgs;
use super::summary::count;
use super::{Setting, print};
use crate::base::mesh_data::MeshData;
use crate::base::registry::{Node, Value};
use crate::error::{Error, Result};
use crate::image::write::{check_file, write_file};
use crate::math::aabb::DAabb;
use crate::memory::in_words;
use crate::render::backdrop::pays;
use crate::render::film::BYTES_PER_PIXEL;
use crate::render::settings::RenderSettings;
use crate::scene::build::{BuildOptions, build};
use crate::scene::desc::{Content, SceneDesc};
use crate::scene::{Scene, features::Features};
use clap::Args;
use serde::Serialize;
use std::collections::HashSet;
use std::fmt::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// Flags of `skylit info`.
#[derive(Args)]
pub struct InfoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Write it as JSON, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A mesh as its file has it.
#[derive(Debug, Serialize)]
struct MeshInfo {
    vertices: usize,
    triangles: usize,
    normals: bool,
    uvs: bool,
    materials: usize,
    repairs: Option<String>,
}

/// A named thing and its kind.
#[derive(Debug, Serialize)]
struct Thing {
    name: String,
    kind: String,
}

/// Corners in world space, metres.
#[derive(Debug, Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

/// Bytes, before anything is rendered.
#[derive(Debug, Serialize)]
struct Cost {
    geometry: u64,
    kernel_estimate: u64,
    film_estimate: u64,
}

/// All that is told.
#[derive(Debug, Serialize)]
struct Info {
    input: String,
    size: [u32; 2],
    spp: Option<u32>,
    integrator: Option<String>,
    camera: Option<String>,
    sky: Option<String>,
    meshes: Vec<MeshInfo>,
    triangles: u64,
    procedurals: u64,
    groups: usize,
    placed_shapes: u64,
    dropped_primitives: u64,
    bounds: Option<Bounds>,
    materials: Vec<Thing>,
    lights: Vec<String>,
    emitting_shapes: usize,
    objects: Vec<String>,
    needs: Vec<&'static str>,
    /// How lights at infinity are found.
    sky_sampling: Vec<String>,
    /// What a render will leave out.
    skips: Vec<String>,
    memory: Cost,
}

/// What the in-house and Embree's tree hold, leaves with their triangles included, as measured on 3,000,000 triangles (62
/// and 69).
const KERNEL_BYTES_PER_PRIMITIVE: u64 = 70;
/// Objects that the text lists; JSON has them all.
const MAX_LISTED: usize = 50;

/// Runs the verb.
pub fn run(args: &InfoArgs, setting: &Setting) -> Result<()> {
    if let Some(path) = &args.json {
        check_file(path)?;
    }
    let desc = args.scene.load()?;
    let mut info = Info::of_description(&args.scene, &desc);
    // The kernel that needs no build: all else is as it will be rendered.
    let mut options = BuildOptions { backend: "brute".into(), ..BuildOptions::default() };
    options.kernel.threads = setting.threads;
    info.add_scene(&build(desc, &options)?);
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&info)
            .map_err(|e| Error::Internal(format!("cannot write the facts: {e}")))?;
        write_file(path, (text + "\n").as_bytes())?;
    }
    print(info.to_string().as_bytes())
}

impl Info {
    fn of_description(args: &SceneArgs, desc: &SceneDesc) -> Self {
        let kind = |node: &Option<Node>| node.as_ref().map(|n| n.kind.clone());
        Info {
            input: args.input.display().to_string(),
            size: desc.film.size,
            spp: desc.render.spp,
            integrator: kind(&desc.render.integrator),
            camera: kind(&desc.camera),
            sky: desc.sky.as_ref().map(|s| s.node.kind.clone()),
            meshes: meshes(desc).iter().map(|m| MeshInfo::of(m)).collect(),
            triangles: 0,
            procedurals: 0,
            groups: 0,
            placed_shapes: 0,
            dropped_primitives: 0,
            bounds: None,
            materials: desc
                .materials
                .iter()
                .map(|m| Thing { name: m.name.clone(), kind: m.value.kind.clone() })
                .collect(),
            lights: desc.lights.iter().map(|l| l.kind.clone()).collect(),
            emitting_shapes: 0,
            objects: Vec::new(),
            needs: Vec::new(),
            sky_sampling: Vec::new(),
            skips: Vec::new(),
            memory: Cost { geometry: 0, kernel_estimate: 0, film_estimate: 0 },
        }
    }

    fn add_scene(&mut self, scene: &Scene) {
        let report = &scene.report;
        self.triangles = report.triangles;
        self.procedurals = report.procedurals;
        self.groups = report.groups;
        self.placed_shapes = report.paths;
        self.dropped_primitives = report.dropped.total();
        let bounds = DAabb::from(scene.geometry.root().bounds).transformed(&scene.space.to_world());
        self.bounds = (!bounds.is_empty()).then(|| Bounds { min: bounds.min.into(), max: bounds.max.into() });
        self.emitting_shapes = scene.lights.by_path.len();
        self.objects = scene.objects.iter().map(|o| o.name.clone()).collect();
        self.needs = needs(&scene.features);
        self.skips = skips(scene, self.spp);
        let told = scene.lights.at_infinity.iter().map(|&l| scene.lights.list[l as usize].describe());
        self.sky_sampling = told.filter(|s| !s.is_empty()).collect();
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        self.memory = Cost {
            geometry: report.geometry_bytes,
            kernel_estimate: (report.triangles + report.procedurals) * KERNEL_BYTES_PER_PRIMITIVE,
            film_estimate: pixels * BYTES_PER_PIXEL,
        };
    }
}

fn needs(features: &Features) -> Vec<&'static str> {
    let all = [
        (features.emitting_surfaces, "area lights"),
        (features.many_lights, "a choice between lights"),
        (features.material_slots, "materials by face"),
    ];
    all.iter().filter(|n| n.0).map(|n| n.1).collect()
}

/// What is left out of this scene's renders with the usual settings; `spp` is what its file says.
fn skips(scene: &Scene, spp: Option<u32>) -> Vec<String> {
    let size = [scene.film.width, scene.film.height];
    let usual = RenderSettings::new(size);
    let coverage = pays(scene, usual.filter, usual.crop, spp.unwrap_or(usual.spp));
    let free = coverage.map_or(0.0, |c| c.free() as f64 / usual.crop.area() as f64);
    let (f, lights) = (&scene.features, &scene.lights);
    let mut out = Vec::new();
    if free > 0.0 {
        out.push(format!("samples of {:.1} % of the pixels, which no geometry projects into", 100.0 * free));
    }
    let all = [
        (!f.emitting_surfaces, "the surfaces that last rays meet, as none shines"),
        (lights.list.is_empty(), "shadow rays, as there is no light"),
        (
            !f.sampled_lights && !lights.list.is_empty(),
            "shadow rays, as scattered rays find all light as well",
        ),
        (!f.many_lights && !lights.list.is_empty(), "the choice of a light"),
        (!f.needs.uv, "texture coordinates and textures"),
        (!f.needs.tangents, "tangents"),
    ];
    out.extend(all.iter().filter(|n| n.0).map(|n| n.1.to_owned()));
    out
}

/// Every mesh of the scene, each once.
fn meshes(desc: &SceneDesc) -> Vec<Arc<MeshData>> {
    let objects = desc.objects.iter().chain(desc.groups.iter().flat_map(|g| &g.value));
    let mut seen = HashSet::new();
    let mut found = Vec::new();
    for object in objects {
        let Content::Shape(node) = &object.content else { continue };
        for p in &node.params.list {
            match &p.value {
                Value::Mesh(mesh) if seen.insert(Arc::as_ptr(mesh)) => found.push(mesh.clone()),
                _ => {}
            }
        }
    }
    found
}

impl MeshInfo {
    fn of(mesh: &MeshData) -> Self {
        MeshInfo {
            vertices: mesh.positions.len(),
            triangles: mesh.indices.len(),
            normals: !mesh.normals.is_empty(),
            uvs: !mesh.uvs.is_empty(),
            materials: mesh.materials.len(),
            repairs: mesh.repairs.describe(),
        }
    }
}

impl fmt::Display for MeshInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} vertices, {} triangles", count(self.vertices as u64), count(self.triangles as u64))?;
        let has = [(self.normals, "normals"), (self.uvs, "uvs")];
        has.iter().filter(|h| h.0).try_for_each(|h| write!(f, ", {}", h.1))?;
        if self.materials > 0 {
            write!(f, ", {} materials", self.materials)?;
        }
        self.repairs.as_ref().map_or(Ok(()), |r| write!(f, "; {r}"))
    }
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = |f: &mut fmt::Formatter<'_>, name: &str, text: &str| writeln!(f, "{name:10} {text}");
        let or_default = |v: &Option<String>, default: &str| v.clone().unwrap_or_else(|| default.to_owned());
        writeln!(f, "{}", self.input)?;
        let spp = self.spp.map_or(String::new(), |n| format!(", {n} samples a pixel"));
        let integrator = or_default(&self.integrator, "path");
        line(f, "picture", &format!("{} x {}{spp}, {integrator}", self.size[0], self.size[1]))?;
        line(f, "camera", &or_default(&self.camera, "frames the bounds"))?;
        line(f, "sky", &or_default(&self.sky, "none"))?;
        self.sky_sampling.iter().try_for_each(|s| line(f, "", s))?;
        for mesh in &self.meshes {
            line(f, "mesh", &mesh.to_string())?;
        }
        line(f, "shapes", &self.shapes())?;
        if let Some(b) = &self.bounds {
            line(f, "bounds", &format!("{} to {}", point(b.min), point(b.max)))?;
        }
        for m in &self.materials {
            line(f, "material", &format!("{} ({})", m.name, m.kind))?;
        }
        for light in &self.lights {
            line(f, "light", light)?;
        }
        if self.emitting_shapes > 0 {
            line(f, "light", &format!("{} emitting shapes", self.emitting_shapes))?;
        }
        for (i, name) in self.objects.iter().take(MAX_LISTED).enumerate() {
            line(f, "object", &format!("{} {name}", i + 1))?;
        }
        if self.objects.len() > MAX_LISTED {
            line(f, "", &format!("and {} more", self.objects.len() - MAX_LISTED))?;
        }
        if !self.needs.is_empty() {
            line(f, "needs", &self.needs.join(", "))?;
        }
        self.skips.iter().try_for_each(|s| line(f, "skips", s))?;
        let m = &self.memory;
        let [geometry, kernel, film] = [m.geometry, m.kernel_estimate, m.film_estimate].map(in_words);
        line(f, "memory", &format!("geometry {geometry}, kernel about {kernel}, film about {film}"))
    }
}

impl Info {
    fn shapes(&self) -> String {
        let mut text = format!("{} triangles", count(self.triangles));
        let extra = [
            (self.procedurals, "exact primitives"),
            (self.groups as u64 - 1, "groups"),
            (self.dropped_primitives, "primitives dropped (degenerate or not finite)"),
        ];
        for (n, what) in extra.into_iter().filter(|(n, _)| *n > 0) {
            // Writing to a string cannot fail.
            let _ = write!(text, ", {} {what}", count(n));
        }
        text + &format!(", {} placed", count(self.placed_shapes))
    }
}

fn point(p: [f64; 3]) -> String {
    format!("({:.6}, {:.6}, {:.6})", p[0], p[1], p[2])
}
