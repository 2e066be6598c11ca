//! Scenes of a course on rendering (CSE 168 of the University of California, San Diego; `.test`): one command a line
//! and a stack of transforms, from classic ray tracing to path tracing with multiple importance sampling.
//!
//! Pictures hold linear values, unless `gamma` says otherwise. Shadow rays go to every light (`each_light`), as they do
//! there; `lightsamples` of an aliased picture are samples of the pixel's centre, the same estimate from as many rays.

use super::commands::looks::{Look, Looks};
use super::commands::soup::Soup;
use super::commands::stack::TransformStack;
use super::commands::statements::{Skipped, Statement, for_each};
use super::commands::{attenuation, camera, film_size, fit, light, node, numbers, object, output, radius};
use crate::base::registry::{Node, Value};
use crate::color::Transfer;
use crate::error::{Place, Result};
use crate::formats::native::GAMMAS;
use crate::formats::{Compat, LoadOptions, SceneFormat, SceneText};
use crate::scene::desc::{Loss, SceneDesc};
use glam::{DAffine3, DVec3};
use std::path::Path;
use std::sync::Arc;

/// The format.
pub const FORMAT: SceneFormat = SceneFormat {
    extension: "test",
    doc: "scenes of the course CSE 168",
    recognise: |text| fit(text, WORDS, super::seed::WORDS),
    parse,
};

/// Commands beside those of transforms, looks and triangles.
pub(super) const WORDS: &[&str] = &[
    "size",
    "output",
    "maxdepth",
    "spp",
    "camera",
    "sphere",
    "maxverts",
    "maxvertnorms",
    "directional",
    "point",
    "attenuation",
    "quadLight",
    "integrator",
    "lightsamples",
    "lightstratify",
    "nexteventestimation",
    "russianroulette",
    "importancesampling",
    "brdf",
    "roughness",
    "gamma",
];

fn parse(file: &SceneText, options: &LoadOptions) -> Result<SceneDesc> {
    let mut reader = Reader::new(file.path, file.bytes.len(), options.compat);
    for_each(file.path, file.text()?, |s| reader.statement(s))?;
    reader.finish()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Integrator {
    RayTracer,
    AnalyticDirect,
    Direct,
    PathTracer,
}

/// How light that comes straight from lamps is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NextEvent {
    /// By chance.
    Off,
    /// By samples of the lamps alone.
    On,
    /// By both, combined.
    Mis,
}

/// Reads one text from top to bottom.
struct Reader<'a> {
    path: &'a Path,
    bytes: usize,
    compat: Compat,
    scene: SceneDesc,
    stack: TransformStack,
    look: Look,
    looks: Looks,
    soup: Soup,
    attenuation: [f64; 3],
    /// What the triangles that wait in the soup have.
    pending: Option<(Look, DAffine3, Place)>,
    integrator: Integrator,
    max_depth: i64,
    spp: u32,
    light_samples: u32,
    quad_lights: u32,
    next_event: NextEvent,
    roulette: bool,
    sampling: &'static str,
    /// Width of GGX lobes, wherever `brdf ggx` holds.
    roughness: f64,
    skipped: Skipped,
    /// Spheres and meshes, before the materials that depend on the integrator are made.
    objects: Vec<(Node, Look, DAffine3)>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, bytes: usize, compat: Compat) -> Self {
        let mut scene = SceneDesc::default();
        scene.film.size = [640, 480];
        scene.film.transfer = Transfer::Gamma(1.0);
        Reader {
            path,
            bytes,
            compat,
            scene,
            stack: TransformStack::default(),
            look: Look::default(),
            looks: Looks::default(),
            soup: Soup::default(),
            attenuation: [1.0, 0.0, 0.0],
            pending: None,
            integrator: Integrator::RayTracer,
            max_depth: 5,
            spp: 1,
            light_samples: 1,
            quad_lights: 0,
            next_event: NextEvent::Off,
            roulette: false,
            sampling: "hemisphere",
            roughness: 1.0,
            skipped: Skipped::default(),
            objects: Vec::new(),
        }
    }

    fn statement(&mut self, s: &mut Statement) -> Result<()> {
        if matches!(s.word, "tri" | "trinormal") {
            self.prepare_triangle(s);
        }
        if self.soup.apply(s)? || self.stack.apply(s)? || self.look.apply(s)? {
            return Ok(());
        }
        match s.word {
            "size" => self.scene.film.size = film_size(s)?,
            "output" => output(s, &mut self.scene),
            "maxdepth" => self.max_depth = s.integer(-1, 4095)?,
            "spp" => self.spp = s.integer(1, i64::from(u32::MAX))? as u32,
            "camera" => self.scene.camera = Some(camera(s, |fov| fov)?),
            "sphere" => self.sphere(s)?,
            "maxverts" => {
                let count = s.integer(0, i64::from(u32::MAX))? as usize;
                self.soup.reserve(count, self.bytes);
            }
            "maxvertnorms" => drop(s.integer(0, i64::from(u32::MAX))?),
            "directional" | "point" => {
                self.scene.lights.push(light(s, self.stack.top(), self.attenuation)?);
            }
            "attenuation" => self.attenuation = attenuation(s)?,
            "quadLight" => self.quad_light(s)?,
            "gamma" => {
                let gamma = s.number()?;
                if !GAMMAS.contains(&gamma) {
                    let (least, most) = (GAMMAS.start(), GAMMAS.end());
                    return Err(
                        s.error(format!("`gamma` takes a number from {least} to {most}, not {gamma}"))
                    );
                }
                self.scene.film.transfer = Transfer::Gamma(gamma as f32);
            }
            _ => return self.setting(s),
        }
        Ok(())
    }

    /// How it is rendered.
    fn setting(&mut self, s: &mut Statement) -> Result<()> {
        match s.word {
            "integrator" => {
                self.integrator = match s.choice(&["raytracer", "analyticdirect", "direct", "pathtracer"])? {
                    "analyticdirect" => Integrator::AnalyticDirect,
                    "direct" => Integrator::Direct,
                    "pathtracer" => Integrator::PathTracer,
                    _ => Integrator::RayTracer,
                }
            }
            "lightsamples" => {
                self.light_samples = s.integer(1, 1 << 20)? as u32;
                self.lose(s, "samples of lights are samples of the pixel");
            }
            "lightstratify" => {
                if s.choice(&["on", "off"])? == "off" {
                    self.lose(s, "our points are stratified all the same");
                }
            }
            "nexteventestimation" => {
                self.next_event = match s.choice(&["on", "off", "mis"])? {
                    "on" => NextEvent::On,
                    "mis" => NextEvent::Mis,
                    _ => NextEvent::Off,
                }
            }
            "russianroulette" => self.roulette = s.choice(&["on", "off"])? == "on",
            "importancesampling" => self.sampling = s.choice(&["hemisphere", "cosine", "brdf"])?,
            "brdf" => {
                let ggx = s.choice(&["phong", "ggx"])? == "ggx";
                self.look.extra.ggx_alpha = ggx.then_some(self.roughness);
            }
            "roughness" => {
                let alpha = s.number()?;
                if !(0.0..=1.0).contains(&alpha) {
                    return Err(s.error(format!("`roughness` takes a number from 0 to 1, not {alpha}")));
                }
                self.roughness = alpha;
                if let Some(old) = &mut self.look.extra.ggx_alpha {
                    *old = alpha;
                }
            }
            _ => self.skipped.note(s),
        }
        Ok(())
    }

    fn lose(&mut self, s: &Statement, what: &str) {
        self.scene.losses.push(Loss { section: "render", place: s.place(), what: what.into() });
    }

    /// Triangles of one look and transform become one mesh.
    fn prepare_triangle(&mut self, s: &Statement) {
        let top = self.stack.top();
        if self.pending.as_ref().is_some_and(|(look, transform, _)| *look == self.look && *transform == top) {
            return;
        }
        self.flush();
        self.pending = Some((self.look.clone(), top, s.place()));
    }

    fn flush(&mut self) {
        let Some((look, transform, place)) = self.pending.take() else { return };
        for mesh in self.soup.take() {
            let shape = node("mesh", &place, vec![("path", Value::Mesh(Arc::new(mesh)))]);
            self.objects.push((shape, look.clone(), transform));
        }
    }

    fn sphere(&mut self, s: &mut Statement) -> Result<()> {
        self.flush();
        let place = s.place();
        let params = vec![("center", numbers(s.vector()?)), ("radius", Value::Number(radius(s)?))];
        self.objects.push((node("sphere", &place, params), self.look.clone(), self.stack.top()));
        Ok(())
    }

    /// A parallelogram that shines on the side from which its edges run clockwise.
    fn quad_light(&mut self, s: &mut Statement) -> Result<()> {
        let place = s.place();
        let [corner, ab, ac, color] = [s.vector()?, s.vector()?, s.vector()?, s.color()?];
        let [a, b] = [ab, ac].map(DVec3::from_array);
        if a.cross(b).length_squared() == 0.0 {
            return Err(s.error("the edges of a `quadLight` are parallel: it has no area"));
        }
        self.quad_lights += 1;
        let name = format!("light-{}", self.quad_lights);
        let value = node("emissive", &place, vec![("radiance", numbers(color))]);
        self.scene.materials.push(crate::scene::desc::Named {
            name: name.clone(),
            value,
            place: place.clone(),
        });
        let params = vec![("corner", numbers(corner)), ("edge_a", numbers(ac)), ("edge_b", numbers(ab))];
        self.scene.objects.push(object(node("quad", &place, params), &name, self.stack.top()));
        Ok(())
    }

    fn finish(mut self) -> Result<SceneDesc> {
        self.flush();
        let known = [&TransformStack::WORDS[..], &Look::WORDS, &Soup::WORDS, WORDS].concat();
        self.skipped.warn(&known);
        self.scene.losses.extend(self.skipped.losses());
        for (shape, look, transform) in std::mem::take(&mut self.objects) {
            let (at, classic, sampling) = (&shape.place, self.integrator, self.sampling);
            let compat = self.compat;
            let name =
                self.looks.name_of(&look, at, || Ok(material(&look, classic, sampling, compat, at)))?;
            self.scene.objects.push(object(shape, &name, transform));
        }
        self.scene.materials.append(&mut self.looks.materials);
        let place = Place { path: self.path.to_owned(), ..Place::default() };
        self.scene.render.integrator = Some(self.integrator_node(&place));
        let render = &mut self.scene.render;
        render.spp = Some(match self.integrator {
            Integrator::Direct => self.spp.saturating_mul(self.light_samples),
            _ => self.spp,
        });
        // One ray a pixel goes through its centre, however many samples of the light there are.
        render.filter = Some(if self.spp == 1 { "center" } else { "box" }.into());
        Ok(self.scene)
    }

    fn integrator_node(&self, place: &Place) -> Node {
        let unlimited = self.max_depth < 0;
        let number = |name, x: i64| (name, Value::Number(x as f64));
        match self.integrator {
            Integrator::RayTracer if self.compat == Compat::Physical => {
                node("path", place, vec![number("max_depth", self.max_depth.max(0) + 1)])
            }
            Integrator::RayTracer => {
                node("whitted", place, vec![number("max_depth", self.max_depth.max(0) + 1)])
            }
            Integrator::AnalyticDirect => node("analytic", place, Vec::new()),
            Integrator::Direct => node("direct", place, vec![("each_light", Value::Bool(true))]),
            Integrator::PathTracer => {
                // Where light is found by chance alone, the lamp's own surface is one of those counted.
                let found = i64::from(self.next_event == NextEvent::Off);
                let depth = if unlimited { 4096 } else { (self.max_depth - found).max(1) };
                let roulette = if self.roulette || unlimited { 2 } else { 4097 };
                let params = vec![
                    number("max_depth", depth),
                    number("roulette_depth", roulette),
                    ("light_sampling", Value::Bool(self.next_event != NextEvent::Off)),
                    ("each_light", Value::Bool(true)),
                    ("mis", Value::Bool(self.next_event != NextEvent::On)),
                ];
                node("path", place, params)
            }
        }
    }
}

fn material(look: &Look, how: Integrator, sampling: &'static str, compat: Compat, place: &Place) -> Node {
    let mut params = vec![("diffuse", numbers(look.diffuse)), ("specular", numbers(look.specular))];
    let classic = how == Integrator::RayTracer && compat == Compat::Exact;
    let [a, e] = [look.ambient, look.emission];
    if classic {
        // What is emitted lights nothing in a classic ray tracer: it is one more ambient term.
        params.push(("ambient", numbers([0, 1, 2].map(|i| a[i] + e[i]))));
    } else {
        params.push(("ambient", numbers(a)));
        params.push(("emission", numbers(e)));
    }
    let text = |name, word: &str| (name, Value::Text(word.into()));
    let kind = match look.extra.ggx_alpha {
        _ if how == Integrator::RayTracer => {
            params.push(("shininess", Value::Number(look.shininess)));
            params.push(text("units", if classic { "classic" } else { "radiometric" }));
            params.push(("two_sided", Value::Bool(!classic)));
            "blinn-phong"
        }
        Some(alpha) => {
            params.push(("alpha", Value::Number(alpha)));
            params.push(text("sampling", sampling));
            "ggx"
        }
        None => {
            params.push(("shininess", Value::Number(look.shininess)));
            params.push(text("sampling", sampling));
            "phong"
        }
    };
    node(kind, place, params)
}
