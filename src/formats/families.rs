//! Every family of kinds with the type of what its rows build taken away: what scene files, lists and hints need.

use crate::base::registry::{ParamKind, ParamSpec, Row};
use crate::base::skybox::Skybox;
use crate::error::unknown_name;
use crate::integrators;
use crate::lights::{self, sky::SkySampling};
use crate::sampler::Sampler;
use crate::sampling::filter::PixelFilter;
use crate::scene::registry::Registry;
use crate::skyboxes::presets;

/// A registered kind: its name and what it takes.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// Name in scene files and on the command line.
    pub name: &'static str,
    /// One line: what it is.
    pub doc: &'static str,
    /// The parameters it takes.
    pub params: &'static [ParamSpec],
}

/// A family of kinds.
#[derive(Debug, Clone)]
pub struct Family {
    /// In the singular: "material".
    pub name: &'static str,
    /// In registry order.
    pub kinds: Vec<Kind>,
}

impl Family {
    /// The kinds of a registry table.
    pub fn of<T: ?Sized>(name: &'static str, table: &[Row<T>]) -> Self {
        let kinds = table.iter().map(|r| Kind { name: r.kind, doc: r.doc, params: r.params }).collect();
        Family { name, kinds }
    }

    /// Kinds without parameters, from their names and docs.
    pub fn of_names(
        name: &'static str,
        kinds: impl IntoIterator<Item = (&'static str, &'static str)>,
    ) -> Self {
        Family { name, kinds: kinds.into_iter().map(|(name, doc)| Kind { name, doc, params: &[] }).collect() }
    }

    /// The kind of this name.
    pub fn find(&self, kind: &str) -> Option<&Kind> {
        self.kinds.iter().find(|k| k.name == kind)
    }

    /// All names, in registry order.
    pub fn names(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.kinds.iter().map(|k| k.name)
    }

    /// `unknown material "glas"; did you mean ...`
    pub fn unknown(&self, name: &str) -> String {
        unknown_name(self.name, name, self.names())
    }
}

/// All families that scene files draw on. Kinds of the last four take no parameters.
#[derive(Debug, Clone)]
pub struct Families {
    /// Shapes.
    pub shapes: Family,
    /// Materials.
    pub materials: Family,
    /// Textures.
    pub textures: Family,
    /// Lights beside the sky.
    pub lights: Family,
    /// Skies.
    pub skies: Family,
    /// Cameras.
    pub cameras: Family,
    /// Integrators; the first is the default.
    pub integrators: Family,
    /// Point sets.
    pub samplers: Family,
    /// Pixel filters.
    pub filters: Family,
    /// Ways of choosing between lights; the first is the default.
    pub light_samplers: Family,
    /// Ways of sampling a sky.
    pub sky_sampling: Family,
}

impl Families {
    /// As registered in this build.
    pub fn registered() -> Self {
        Families::of(&Registry::default())
    }

    /// The kinds of these tables, and what is not open.
    pub fn of(registry: &Registry) -> Self {
        Families {
            shapes: Family::of("shape", &registry.shapes),
            materials: Family::of("material", &registry.materials),
            textures: Family::of("texture", &registry.textures),
            lights: Family::of("light", &registry.lights),
            skies: skies(&registry.skies),
            cameras: Family::of("camera", &registry.cameras),
            integrators: Family::of("integrator", integrators::REGISTRY),
            samplers: Family::of_names("sampler", Sampler::NAMES.map(|(name, s)| (name, s.doc()))),
            filters: Family::of_names("filter", PixelFilter::NAMES.map(|(name, f)| (name, f.doc()))),
            light_samplers: Family::of_names("light sampler", lights::sampler::NAMES.iter().copied()),
            sky_sampling: Family::of_names(
                "sky sampling",
                SkySampling::NAMES.map(|(name, s)| (name, s.doc())),
            ),
        }
    }

    /// All that have members, for lists.
    pub fn all(self) -> Vec<Family> {
        let mut all = vec![
            self.shapes,
            self.materials,
            self.textures,
            self.lights,
            self.skies,
            self.sky_sampling,
            self.cameras,
            self.integrators,
            self.samplers,
            self.filters,
            self.light_samplers,
        ];
        all.retain(|f| !f.kinds.is_empty());
        all
    }
}

/// Skies: the registered kinds, then the presets, each of which takes the parameters of the kind it is made of.
fn skies(table: &[Row<dyn Skybox>]) -> Family {
    let mut family = Family::of("sky", table);
    for (name, doc) in presets::names() {
        let kind = presets::preset(name).and_then(|node| family.find(&node.kind).copied());
        family.kinds.extend(kind.map(|k| Kind { name, doc, params: k.params }));
    }
    family
}

/// What a parameter takes, for people: "a number from 0 to 180".
pub fn describe(kind: ParamKind) -> String {
    match kind {
        ParamKind::Bool => "true or false".into(),
        ParamKind::Number { min, max } => range("a number", min, max),
        ParamKind::Integer { min, max } => range("a whole number", min as f64, max as f64),
        ParamKind::Vector => "three numbers".into(),
        ParamKind::Vector2 => "two numbers, or one for both".into(),
        ParamKind::Color => "a colour (three numbers, or one)".into(),
        ParamKind::Texture => "a colour, one number, or a texture such as { texture = \"clay.png\" }".into(),
        ParamKind::Choice(words) => format!("one of {}", words.join(", ")),
        ParamKind::Text => "text".into(),
        ParamKind::Image => "the path of a picture".into(),
        ParamKind::CubeFaces => "the path of a folder of six faces, of a cross or of a strip".into(),
        ParamKind::Mesh => "the path of a mesh".into(),
    }
}

/// Limits beyond what anyone writes down are none worth telling.
const BOUNDLESS: f64 = 1e9;
const TINY: f64 = 1e-9;

fn range(what: &str, min: f64, max: f64) -> String {
    let at_least = match min {
        min if min <= -BOUNDLESS => None,
        min if min > 0.0 && min < TINY => Some("more than 0".to_owned()),
        min => Some(format!("at least {min}")),
    };
    match (at_least, max < BOUNDLESS) {
        (Some(least), false) => format!("{what} of {least}"),
        (Some(_), true) => format!("{what} from {min} to {max}"),
        (None, true) => format!("{what} of at most {max}"),
        (None, false) => what.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_told_where_they_matter() {
        let number = |min, max| describe(ParamKind::Number { min, max });
        assert_eq!(number(0.0, 1.0), "a number from 0 to 1");
        assert_eq!(number(0.0, 1e12), "a number of at least 0");
        assert_eq!(number(1e-30, 1e30), "a number of more than 0");
        assert_eq!(number(-1e30, 3.0), "a number of at most 3");
        assert_eq!(number(f64::MIN, f64::MAX), "a number");
        assert_eq!(describe(ParamKind::Integer { min: 1, max: i64::MAX }), "a whole number of at least 1");
    }

    #[test]
    fn every_kind_is_documented_and_its_defaults_are_words() {
        for family in Families::registered().all() {
            for kind in &family.kinds {
                assert!(!kind.doc.is_empty(), "{} {}", family.name, kind.name);
                for p in kind.params {
                    assert!(!p.doc.is_empty() && p.default != Some(""), "{} {}", kind.name, p.name);
                }
            }
        }
    }
}
