//! Variants of a render: `-L key=v1,v2` renders with each value in turn, several of them with every combination.

use crate::accel;
use crate::base::intersectable::{BuildQuality, KernelMode};
use crate::base::registry::{Node, ParamKind, Value, find};
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::Families;
use crate::integrators;
use crate::render::settings::RenderSettings;
use crate::scene::build::BuildOptions;
use crate::scene::desc::SceneDesc;
use std::collections::BTreeMap;
use std::str::FromStr;

/// A scene with all that decides how it is rendered.
#[derive(Clone)]
pub struct Subject {
    /// The scene.
    pub desc: SceneDesc,
    /// How it is sampled.
    pub settings: RenderSettings,
    /// How its kernel is built.
    pub options: BuildOptions,
}

/// A setting that can be varied.
pub struct Key {
    /// As the flag of `skylit render` is called.
    pub name: &'static str,
    /// One line for people.
    pub doc: &'static str,
    /// Whether it changes what a converged picture shows: then all variants have the same value, and so has the
    /// reference.
    pub changes_truth: bool,
    set: fn(&mut Subject, &str) -> Result<()>,
}

/// Every setting that can be varied, beside the parameters of the integrator.
pub static KEYS: &[Key] = &[
    Key::new("sampler", "point set", |s, v| {
        s.settings.sampler = v.parse()?;
        Ok(())
    }),
    Key::new("filter", "pixel filter", |s, v| {
        s.settings.filter = v.parse()?;
        Ok(())
    })
    .changing(),
    Key::new("integrator", "what is estimated", set_integrator).changing(),
    Key::new("max-depth", "longest path in surfaces", |s, v| set_parameter(s, "max_depth", v)).changing(),
    Key::new("sky-sampling", "how the sky is sampled", set_sky_sampling),
    Key::new("light-sampler", "how lights are chosen", set_light_sampler),
    Key::new("sky-pixels", "integrate or sample pixels that see no geometry", |s, v| {
        s.settings.skip_background = choose("sky pixels", v, &[("integrate", true), ("sample", false)])?;
        Ok(())
    }),
    Key::new("outlines", "samples of outlines for each of other pixels", |s, v| {
        let number = |_| Error::Usage(format!("outlines take a number of samples, not \"{v}\""));
        s.settings.outlines = Some(v.parse().map_err(number)?);
        s.settings.check()
    }),
    Key::new("dealing", "samples by need, or as many for each pixel", |s, v| {
        s.settings.dealing = v.parse()?;
        Ok(())
    }),
    Key::new("moments", "whether a render knows its own error", |s, v| {
        s.settings.moments = choose("moments", v, &[("true", true), ("false", false)])?;
        Ok(())
    }),
    Key::new("backend", "ray kernel", set_backend),
    Key::new("kernel-mode", "robust or fast", set_mode),
    Key::new("build", "speed of the kernel's build", set_quality),
];

impl Key {
    const fn new(name: &'static str, doc: &'static str, set: fn(&mut Subject, &str) -> Result<()>) -> Self {
        Key { name, doc, changes_truth: false, set }
    }

    const fn changing(mut self) -> Self {
        self.changes_truth = true;
        self
    }
}

fn set_mode(s: &mut Subject, value: &str) -> Result<()> {
    let known = [("robust", KernelMode::Robust), ("fast", KernelMode::Fast)];
    s.options.kernel.mode = choose("kernel mode", value, &known)?;
    Ok(())
}

fn set_quality(s: &mut Subject, value: &str) -> Result<()> {
    let known =
        [("fast", BuildQuality::Fast), ("balanced", BuildQuality::Balanced), ("best", BuildQuality::Best)];
    s.options.kernel.quality = choose("build", value, &known)?;
    Ok(())
}

fn choose<T: Copy>(what: &str, value: &str, known: &[(&str, T)]) -> Result<T> {
    let found = known.iter().find(|k| k.0 == value);
    found.map(|k| k.1).ok_or_else(|| Error::Usage(unknown_name(what, value, known.iter().map(|k| k.0))))
}

fn set_integrator(s: &mut Subject, name: &str) -> Result<()> {
    let node = Node { kind: name.to_owned(), ..Node::default() };
    find("integrator", integrators::REGISTRY, &node)?;
    if s.desc.render.integrator.as_ref().is_none_or(|n| n.kind != name) {
        s.desc.render.integrator = Some(node);
    }
    Ok(())
}

fn set_sky_sampling(s: &mut Subject, name: &str) -> Result<()> {
    let known = Families::registered().sky_sampling;
    if known.find(name).is_none() {
        return Err(Error::Usage(unknown_name(known.name, name, known.names())));
    }
    let sky = s.desc.sky.as_mut().ok_or_else(|| Error::Usage("the scene has no sky to be sampled".into()))?;
    sky.sampling = Some(name.to_owned());
    Ok(())
}

fn set_light_sampler(s: &mut Subject, name: &str) -> Result<()> {
    let known = Families::registered().light_samplers;
    if known.find(name).is_none() {
        return Err(Error::Usage(unknown_name(known.name, name, known.names())));
    }
    s.desc.render.light_sampler = Some(name.to_owned());
    Ok(())
}

fn set_backend(s: &mut Subject, name: &str) -> Result<()> {
    let known = || ["auto"].into_iter().chain(accel::KERNELS.iter().map(|k| k.name));
    if !known().any(|k| k == name) {
        return Err(Error::Usage(unknown_name("backend", name, known())));
    }
    s.options.backend = name.to_owned();
    Ok(())
}

/// The scene's integrator, or the default one.
fn integrator_of(s: &Subject) -> Node {
    let default = integrators::REGISTRY.first().map_or("", |r| r.kind);
    let named = || Node { kind: default.to_owned(), ..Node::default() };
    s.desc.render.integrator.clone().unwrap_or_else(named)
}

/// Sets a parameter of the integrator.
fn set_parameter(s: &mut Subject, name: &str, value: &str) -> Result<()> {
    let mut node = integrator_of(s);
    let row = find("integrator", integrators::REGISTRY, &node)?;
    let Some(spec) = row.params.iter().find(|p| p.name == name) else {
        let keys = KEYS.iter().map(|k| k.name).chain(row.params.iter().map(|p| p.name));
        return Err(Error::Usage(unknown_name("setting", name, keys)));
    };
    let wrong = |what: &str| Error::Usage(format!("{name} takes {what}, not \"{value}\""));
    let value = match spec.kind {
        ParamKind::Bool => Value::Bool(value.parse().map_err(|_| wrong("true or false"))?),
        ParamKind::Number { .. } | ParamKind::Integer { .. } => {
            Value::Number(value.parse().map_err(|_| wrong("a number"))?)
        }
        _ => Value::Text(value.to_owned()),
    };
    node.params.list.retain(|p| p.name != name);
    node.params = std::mem::take(&mut node.params).with(name, value);
    s.desc.render.integrator = Some(node);
    Ok(())
}

impl Subject {
    /// Sets a setting by its name.
    ///
    /// # Errors
    /// [`Error::Usage`] for names and values that nothing has.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        match KEYS.iter().find(|k| k.name == key) {
            Some(k) => (k.set)(self, value),
            None => set_parameter(self, key, value),
        }
    }

    /// The integrator, built.
    ///
    /// # Errors
    /// Parameters that it refuses.
    pub fn integrator(&self) -> Result<std::sync::Arc<dyn integrators::Integrator>> {
        crate::base::registry::build("integrator", integrators::REGISTRY, &integrator_of(self))
    }
}

/// `key=v1,v2`.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// The setting.
    pub key: String,
    /// At least one.
    pub values: Vec<String>,
}

impl FromStr for Sweep {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let parts = s.split_once('=').map(|(k, v)| (k.trim(), v.split(',').map(|v| v.trim().to_owned())));
        match parts {
            Some((key, values)) if !key.is_empty() => {
                let values: Vec<String> = values.collect();
                let unique: std::collections::BTreeSet<&String> = values.iter().collect();
                if values.iter().any(String::is_empty) || unique.len() < values.len() {
                    return Err("takes different values that are not empty".into());
                }
                Ok(Sweep { key: key.to_owned(), values })
            }
            _ => Err("takes KEY=VALUE,VALUE,... such as sampler=owen-sobol,independent".into()),
        }
    }
}

/// Those settings of all variants that change what a converged picture shows, for the reference.
///
/// # Errors
/// Variants that differ in one of them: their errors could not be compared.
pub fn truth_settings(variants: &[BTreeMap<String, String>]) -> Result<BTreeMap<String, String>> {
    let changes = |name: &str| {
        // A parameter of the integrator is called as in a scene, or as its flag.
        KEYS.iter().any(|k| k.changes_truth && k.name == name.replace('_', "-"))
    };
    let of = |v: &BTreeMap<String, String>| -> BTreeMap<String, String> {
        v.iter().filter(|(k, _)| changes(k)).map(|(k, v)| (k.clone(), v.clone())).collect()
    };
    let first = variants.first().map(of).unwrap_or_default();
    match variants.iter().all(|v| of(v) == first) {
        true => Ok(first),
        false => {
            let names: Vec<&str> = KEYS.iter().filter(|k| k.changes_truth).map(|k| k.name).collect();
            let message = format!("{} change what is rendered: -L takes one value of each", names.join(", "));
            Err(Error::Usage(message))
        }
    }
}

/// Most variants of one measurement.
const MOST: usize = 64;

/// Every combination of the values, the first key's changing slowest; a single one without a setting where nothing is
/// swept.
///
/// # Errors
/// A key that is given twice; more than 64 combinations.
pub fn combinations(sweeps: &[Sweep]) -> Result<Vec<BTreeMap<String, String>>> {
    let mut all = vec![BTreeMap::new()];
    for sweep in sweeps {
        if all.iter().any(|c: &BTreeMap<String, String>| c.contains_key(&sweep.key)) {
            return Err(Error::Usage(format!("-L {} is given twice", sweep.key)));
        }
        let with = |c: &BTreeMap<String, String>, v: &String| {
            let mut c = c.clone();
            c.insert(sweep.key.clone(), v.clone());
            c
        };
        all = all.iter().flat_map(|c| sweep.values.iter().map(move |v| with(c, v))).collect();
        if all.len() > MOST {
            return Err(Error::Usage(format!("more than {MOST} combinations of settings")));
        }
    }
    Ok(all)
}

/// How a combination is called.
pub fn label(settings: &BTreeMap<String, String>) -> String {
    let all: Vec<String> = settings.iter().map(|(k, v)| format!("{k}={v}")).collect();
    if all.is_empty() { "skylit".into() } else { all.join(" ") }
}
