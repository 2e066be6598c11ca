//! The native scene format: TOML (the README's "Scene files" shows every section). Every error names file, line and
//! column, what stands there, and what could.

mod nodes;
mod objects;
#[cfg(test)]
mod tests;
mod transform;
mod tree;
mod values;
pub mod write;

use crate::base::registry::Node;
use crate::color::Transfer;
use crate::error::{Error, Result};
use crate::formats::families::{Families, Kind};
use crate::formats::files::Files;
use crate::formats::{Fit, LoadOptions, NamedFiles, SceneFormat, SceneText};
use crate::scene::desc::{Background, Named, ObjectDesc, RenderDesc, SceneDesc, SkyDesc};
use nodes::NodeTable;
use std::path::Path;
use tree::{Data, Source, Table, Tree};
use values::Section;

/// Longest text that is read: a scene names its large data, it does not hold it.
const MAX_BYTES: u64 = 1 << 28;
/// Longest side of a film in pixels.
pub const MAX_SIDE: u32 = 1 << 16;
/// Most pixels of a film.
pub const MAX_PIXELS: u64 = 1 << 28;

/// The native format.
pub const FORMAT: SceneFormat = SceneFormat {
    extension: "toml",
    doc: "skylit's own scenes",
    recognise: |head| {
        // A section, or a comment before the first one, which no other format begins with.
        let text = String::from_utf8_lossy(head);
        let first = text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with('#'));
        match first.is_some_and(|l| l.starts_with('[') || l.contains('=')) {
            true => Fit::Sure,
            false => Fit::Foreign,
        }
    },
    parse: load,
};

/// Reads a scene file's text and all the files it names.
///
/// # Errors
/// [`Error::Content`] with line and column for anything in the text that cannot be used; [`Error::File`] for files that
/// cannot be read.
fn load(file: &SceneText, options: &LoadOptions) -> Result<SceneDesc> {
    let length = file.bytes.len() as u64;
    if length > MAX_BYTES {
        let message = format!("{length} bytes of scene text; {MAX_BYTES} are the most that is read");
        return Err(Error::content(file.path, message));
    }
    parse(file.path, file.text()?, &options.families, options.named_files)
}

/// Reads the text of a scene file; `path` is for messages and for the paths in it, which are relative to its folder.
pub(crate) fn parse(path: &Path, text: &str, families: &Families, named: NamedFiles) -> Result<SceneDesc> {
    let source = Source::new(path, text);
    let root = source.parse()?;
    let mut files = Files::of(path, named);
    loop {
        let mut reader = Reader { source: &source, families, files: &mut files, scene: SceneDesc::default() };
        reader.read(&root)?;
        let scene = reader.scene;
        if !files.read_noted()? {
            return Ok(scene);
        }
    }
}

/// One round of reading.
struct Reader<'r, 'a> {
    source: &'r Source<'a>,
    families: &'r Families,
    files: &'r mut Files,
    scene: SceneDesc,
}

const SECTIONS: &[&str] = &["film", "camera", "render", "sky", "materials", "objects", "groups", "lights"];

impl Reader<'_, '_> {
    fn read(&mut self, root: &Table) -> Result<()> {
        let families = self.families;
        Section { source: self.source, table: root, name: "a scene" }.only(SECTIONS)?;
        if let Some(v) = root.get("film") {
            self.film(v)?;
        }
        if let Some(v) = root.get("camera") {
            self.scene.camera = Some(self.node(&families.cameras, v, &[])?);
        }
        if let Some(v) = root.get("render") {
            self.render(v)?;
        }
        if let Some(v) = root.get("sky") {
            self.scene.sky = Some(self.sky(v)?);
        }
        if let Some(v) = root.get("materials") {
            for e in &self.source.table("materials", v)?.entries {
                let value = self.node(&families.materials, &e.value, &[])?;
                let place = self.source.place(e.key_at);
                self.scene.materials.push(Named { name: e.key.clone(), value, place });
            }
        }
        let names = objects::Names::of(self.source, root)?;
        if let Some(v) = root.get("groups") {
            for e in &self.source.table("groups", v)?.entries {
                let section = Section::new(self.source, "a group", &e.value, &["objects"])?;
                let objects =
                    section.table.get("objects").map_or(Ok(Vec::new()), |v| self.objects(v, &names))?;
                let place = self.source.place(e.key_at);
                self.scene.groups.push(Named { name: e.key.clone(), value: objects, place });
            }
        }
        if let Some(v) = root.get("objects") {
            self.scene.objects = self.objects(v, &names)?;
        }
        if let Some(v) = root.get("lights") {
            for light in self.source.list("lights", v)? {
                let light = self.node(&families.lights, light, &[])?;
                self.scene.lights.push(light);
            }
        }
        Ok(())
    }

    fn objects(&mut self, v: &Tree, names: &objects::Names) -> Result<Vec<ObjectDesc>> {
        self.source.list("objects", v)?.iter().map(|o| self.object(o, names)).collect()
    }

    fn film(&mut self, v: &Tree) -> Result<()> {
        let section = Section::new(self.source, "[film]", v, &["size", "filter", "background", "transfer"])?;
        if let Some(size) = section.read("size", film_size)? {
            self.scene.film.size = size;
        }
        if let Some(transfer) = section.read("transfer", transfer)? {
            self.scene.film.transfer = transfer;
        }
        let filters = &self.families.filters;
        self.scene.render.filter = section.read("filter", |s, k, v| s.name_of(filters, k, v))?;
        if let Some(background) = section.read("background", background)? {
            self.scene.background = background;
        }
        Ok(())
    }

    fn render(&mut self, v: &Tree) -> Result<()> {
        const OTHERS: &[&str] = &["integrator", "spp", "sampler", "light_sampler", "seed"];
        let families = self.families;
        let table = self.source.table("render", v)?;
        let section = Section { source: self.source, table, name: "[render]" };
        let spp = section.read("spp", |s, k, v| s.integer(k, v, 1, i64::from(u32::MAX)))?;
        let seed = section.read("seed", |s, k, v| s.integer(k, v, 0, i64::MAX))?;
        let sampler = section.read("sampler", |s, k, v| s.name_of(&families.samplers, k, v))?;
        let light_samplers = &families.light_samplers;
        let light_sampler = section.read("light_sampler", |s, k, v| s.name_of(light_samplers, k, v))?;
        let integrator = self.integrator(table, v, OTHERS)?;
        let render = &mut self.scene.render;
        *render = RenderDesc {
            integrator,
            spp: spp.map(|n| n as u32),
            sampler,
            light_sampler,
            seed: seed.map(|n| n as u64),
            filter: render.filter.take(),
        };
        Ok(())
    }

    /// The integrator's own parameters stand in [render] too; without a name they are those of the first registered.
    fn integrator(&mut self, table: &Table, v: &Tree, others: &[&str]) -> Result<Option<Node>> {
        let family = &self.families.integrators;
        let own = table.entries.iter().any(|e| !others.contains(&e.key.as_str()));
        let kind: &Kind = match (table.get("integrator"), family.kinds.first()) {
            (Some(name), _) => {
                let word = self.source.text("integrator", name)?;
                family.find(word).ok_or_else(|| self.source.error(name.at, family.unknown(word)))?
            }
            (None, Some(first)) if own => first,
            _ => return Ok(None),
        };
        self.node_of(kind, NodeTable { table, at: v.at, others }).map(Some)
    }

    fn sky(&mut self, v: &Tree) -> Result<SkyDesc> {
        const OTHERS: &[&str] = &["intensity", "rotate_y_deg", "sampling"];
        let families = self.families;
        let node = self.node(&families.skies, v, OTHERS)?;
        let section = Section { source: self.source, table: self.source.table("sky", v)?, name: "[sky]" };
        let mut sky = SkyDesc::new(node);
        if let Some(x) = section.read("intensity", not_negative)? {
            sky.intensity = x;
        }
        if let Some(x) = section.read("rotate_y_deg", Source::number)? {
            sky.rotate_y_deg = x;
        }
        sky.sampling = section.read("sampling", |s, k, v| s.name_of(&families.sky_sampling, k, v))?;
        Ok(sky)
    }
}

impl Source<'_> {
    /// A name of a family whose kinds take no parameters.
    fn name_of(&self, family: &super::families::Family, key: &str, v: &Tree) -> Result<String> {
        let name = self.text(key, v)?;
        match family.find(name) {
            Some(kind) => Ok(kind.name.to_owned()),
            None => Err(self.error(v.at, family.unknown(name))),
        }
    }
}

fn not_negative(source: &Source, name: &str, v: &Tree) -> Result<f64> {
    match source.number(name, v)? {
        x if x >= 0.0 => Ok(x),
        x => Err(source.error(v.at, format!("`{name}` takes a number of at least 0, not {x}"))),
    }
}

fn film_size(source: &Source, name: &str, v: &Tree) -> Result<[u32; 2]> {
    let size = match source.list(name, v)? {
        [w, h] => [w, h].map(|x| source.integer(name, x, 1, i64::from(MAX_SIDE))),
        _ => return Err(source.error(v.at, format!("`{name}` takes width and height in pixels"))),
    };
    let [width, height] = size;
    let size = [width? as u32, height? as u32];
    check_film(size).map_err(|m| source.error(v.at, m))?;
    Ok(size)
}

/// Gammas that any program writes with.
pub const GAMMAS: std::ops::RangeInclusive<f64> = 0.1..=10.0;

fn transfer(source: &Source, name: &str, v: &Tree) -> Result<Transfer> {
    match &v.data {
        Data::Text(_) => match source.word(name, v, &["srgb", "linear"])? {
            "linear" => Ok(Transfer::Gamma(1.0)),
            _ => Ok(Transfer::Srgb),
        },
        _ => match source.number(name, v)? {
            gamma if GAMMAS.contains(&gamma) => Ok(Transfer::Gamma(gamma as f32)),
            gamma => {
                let range = format!("{} to {}", GAMMAS.start(), GAMMAS.end());
                Err(source
                    .error(v.at, format!("`{name}` takes srgb, linear or a gamma from {range}, not {gamma}")))
            }
        },
    }
}

/// Whether a film of this size can be made; else why not.
pub fn check_film(size: [u32; 2]) -> Result<(), String> {
    let [w, h] = size;
    if size.iter().any(|s| !(1..=MAX_SIDE).contains(s)) || u64::from(w) * u64::from(h) > MAX_PIXELS {
        return Err(format!(
            "a picture of {w} x {h} cannot be made: sides run from 1 to {MAX_SIDE}, and {MAX_PIXELS} pixels are the most"
        ));
    }
    Ok(())
}

fn background(source: &Source, name: &str, v: &Tree) -> Result<Background> {
    match &v.data {
        Data::Text(_) => match source.word(name, v, &["sky", "transparent"])? {
            "transparent" => Ok(Background::Transparent),
            _ => Ok(Background::Sky),
        },
        _ => {
            let color = source.vector(name, v)?;
            if color.iter().any(|c| *c < 0.0 || *c > f64::from(f32::MAX)) {
                return Err(source.error(v.at, format!("`{name}` takes numbers of at least 0")));
            }
            Ok(Background::Color(color.map(|c| c as f32)))
        }
    }
}
