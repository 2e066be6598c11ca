//! `skylit list`: every registered kind with its parameters, derived from the registry tables.

use super::print;
use crate::accel;
use crate::base::registry::ParamSpec;
use crate::compare::metrics;
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::{Families, Family, describe};
use crate::image::tonemap::ToneMap;
use crate::render::{aov, film_layers};
use clap::Args;
use std::fmt::Write;

/// Flags of `skylit list`.
#[derive(Args)]
pub struct ListArgs {
    /// One family alone, such as material or sky
    family: Option<String>,
}

/// Runs the verb.
pub fn run(args: &ListArgs) -> Result<()> {
    let families = families();
    let chosen: Vec<Family> = match &args.family {
        None => families,
        Some(name) => {
            let wanted = name.to_lowercase().replace([' ', '_'], "-");
            let known: Vec<&str> = families.iter().map(|f| f.name).collect();
            let message = unknown_name("family", name, known.iter().copied());
            let is_wanted = |f: &Family| {
                let name = f.name.replace(' ', "-");
                name == wanted || plural(&name) == wanted
            };
            let family = families.into_iter().find(is_wanted).ok_or(Error::Usage(message))?;
            vec![family]
        }
    };
    let sections: Vec<String> = chosen.iter().map(section).collect();
    print(sections.join("\n").as_bytes())
}

/// The families of scene files, and those that the command line alone names.
fn families() -> Vec<Family> {
    let aovs = aov::REGISTRY.iter().map(|r| (r.name, r.doc));
    let film_layers = film_layers::REGISTRY.iter().map(|f| (f.name, f.doc));
    let mut all = Families::registered().all();
    all.push(Family::of_names("aov", aovs.chain(film_layers)));
    all.push(Family::of_names("backend", accel::KERNELS.iter().map(|k| (k.name, k.doc))));
    all.push(Family::of_names("metric", metrics::REGISTRY.iter().map(|m| (m.name, m.doc))));
    all.push(Family::of_names("tonemap", ToneMap::ALL.map(|t| (t.name(), t.doc()))));
    all
}

/// Of the families' names: "skies", "materials".
fn plural(name: &str) -> String {
    match name.strip_suffix('y') {
        Some(stem) => format!("{stem}ies"),
        None => format!("{name}s"),
    }
}

fn section(family: &Family) -> String {
    let mut text = format!("{}:\n", plural(family.name));
    let width = family.names().map(str::len).max().unwrap_or(0);
    for kind in &family.kinds {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {:width$}  {}", kind.name, kind.doc);
        let inner = kind.params.iter().map(|p| p.name.len()).max().unwrap_or(0);
        for p in kind.params {
            let _ = writeln!(text, "      {:inner$}  {}", p.name, parameter(p));
        }
    }
    text
}

fn parameter(p: &ParamSpec) -> String {
    let default = p.default.map_or("must be given".to_owned(), |d| format!("default {d}"));
    format!("{} ({}; {default})", p.doc, describe(p.kind))
}
