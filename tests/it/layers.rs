//! ARCHITECTURE.md, "Layers": who may import whom, where `unsafe` and the Embree bindings may stand, how long a file
//! may be. Tests are free to import what they like.

use crate::source::{heads, line_of, production_code, rust_files, words};
use std::path::{Path, PathBuf};

/// The top-level modules by layer. A new one is entered here once, with the layer that it is meant to have.
const L0: &[&str] = &["color", "error", "math", "memory", "sampler", "sampling"];
const L1: &[&str] = &["base"];
const L2: &[&str] = &["accel", "cameras", "lights", "materials", "shapes", "skyboxes", "textures"];
const SCENE: &str = "scene";
const INTEGRATORS: &str = "integrators";
const L4: &[&str] = &["bench", "check", "compare", "crosscheck", "formats", "image", "render", "report"];
const L5: &[&str] = &["cli", "main"];

/// Beside `src/accel/embree*` and `sys`: files that use SIMD intrinsics, each for a measured gain.
const UNSAFE_FILES: &[&str] = &["src/accel/bvh/simd/avx2.rs", "src/accel/bvh/simd/sse42.rs"];

/// No file is longer, so that each can be read in one sitting.
const MAX_LINES: usize = 450;

/// Whether module `from` may import module `to`.
fn may_import(from: &str, to: &str) -> bool {
    let in_any = |layers: &[&[&str]]| layers.iter().any(|l| l.contains(&to));
    if from == to {
        return true;
    }
    match from {
        _ if L0.contains(&from) => in_any(&[L0]),
        _ if L1.contains(&from) => in_any(&[L0]),
        _ if L2.contains(&from) => in_any(&[L0, L1]),
        // Its builder goes through the registries.
        SCENE => in_any(&[L0, L1, L2]),
        INTEGRATORS => in_any(&[L0, L1]) || to == SCENE,
        _ if L4.contains(&from) => !L5.contains(&to),
        _ => to != "main",
    }
}

fn is_known(module: &str) -> bool {
    [SCENE, INTEGRATORS].contains(&module) || [L0, L1, L2, L4, L5].iter().any(|l| l.contains(&module))
}

/// A source file: its place below `src` as a list of modules.
struct File {
    name: String,
    modules: Vec<String>,
    code: String,
}

impl File {
    fn new(root: &Path, path: &Path) -> File {
        let name = path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
        let modules = name.trim_start_matches("src/").trim_end_matches(".rs").trim_end_matches("/mod");
        let text = std::fs::read_to_string(path).expect("readable source");
        File { modules: modules.split('/').map(str::to_owned).collect(), code: production_code(&text), name }
    }

    /// Whether it is compiled for tests alone; [`File::problems`] sees to it that what declares such files says so.
    fn is_test(&self) -> bool {
        self.modules.iter().any(|m| m == "tests") || self.modules[0] == "testing"
    }

    /// Every breach of the rules, as `file:line: what`.
    fn problems(&self, exported: &[(String, String)]) -> Vec<String> {
        let top = self.modules[0].as_str();
        let mut all = Vec::new();
        let mut complain = |at: usize, what: String| {
            all.push(format!("{}:{}: {what}", self.name, line_of(&self.code, at)));
        };
        if top != "lib" && !is_known(top) {
            complain(0, format!("module `{top}` has no layer yet: enter it in tests/it/layers.rs"));
        }
        let list = words(&self.code);
        let embree = self.name.starts_with("src/accel/embree");
        for (i, word) in list.iter().enumerate() {
            let rest = &self.code[word.at + word.text.len()..];
            match word.text {
                "embree_sys" if !embree => {
                    complain(word.at, "`embree_sys` is for src/accel/embree* alone".into())
                }
                "unsafe" if !embree && !UNSAFE_FILES.contains(&self.name.as_str()) => {
                    complain(
                        word.at,
                        "`unsafe` outside sys, src/accel/embree* and the named SIMD files".into(),
                    );
                }
                "mod"
                    if rest.trim_start().starts_with("test") && top == "lib"
                        || rest.trim_start().starts_with("tests") =>
                {
                    complain(word.at, "a module of tests that is not under #[cfg(test)]".into());
                }
                "crate" if top != "lib" => {
                    for head in heads(rest) {
                        let to = exported.iter().find(|(name, _)| *name == head).map_or(&head, |(_, m)| m);
                        if !may_import(top, to) {
                            complain(word.at, format!("`{top}` may not import `{to}`"));
                        }
                    }
                }
                "super" if top != "lib" => {
                    let chain = list[..=i].iter().rev().take_while(|w| w.text == "super").count();
                    if chain >= self.modules.len() && rest.trim_start().starts_with("::") {
                        complain(word.at, "reaches out of its family by `super`: say `crate::`".into());
                    }
                }
                _ => {}
            }
        }
        all
    }
}

/// What the crate root re-exports: the name, and the module it comes from.
fn exported(lib: &str) -> Vec<(String, String)> {
    let mut all = Vec::new();
    for line in lib.split(';') {
        let Some((_, path)) = line.split_once("pub use ") else { continue };
        let Some((module, names)) = path.split_once("::") else { continue };
        let module = module.trim().to_owned();
        all.extend(words(names).into_iter().map(|w| (w.text.to_owned(), module.clone())));
    }
    all
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn every_module_keeps_to_its_layer() {
    let root = root();
    let lib = std::fs::read_to_string(root.join("src/lib.rs")).expect("src/lib.rs");
    let exported = exported(&production_code(&lib));
    assert!(exported.contains(&("Error".into(), "error".into())), "{exported:?}");
    let files: Vec<File> = rust_files(&root.join("src")).iter().map(|p| File::new(&root, p)).collect();
    assert!(files.len() > 20, "the source was found");
    let problems: Vec<String> =
        files.iter().filter(|f| !f.is_test()).flat_map(|f| f.problems(&exported)).collect();
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}

#[test]
fn files_can_be_read_in_one_sitting() {
    let root = root();
    let mut paths = vec![root.join("build.rs")];
    paths.extend(["src", "sys", "tests", "benches"].iter().flat_map(|d| rust_files(&root.join(d))));
    for path in paths {
        let lines = std::fs::read_to_string(&path).map_or(0, |t| t.lines().count());
        assert!(lines <= MAX_LINES, "{}: {lines} lines of at most {MAX_LINES}", path.display());
    }
}

#[test]
fn breaches_are_seen() {
    let problems = |name: &str, code: &str| {
        let modules = name.trim_end_matches(".rs").trim_end_matches("/mod").split('/').map(str::to_owned);
        let file =
            File { name: format!("src/{name}"), modules: modules.collect(), code: production_code(code) };
        file.problems(&[("Error".into(), "error".into()), ("Scene".into(), "scene".into())]).len()
    };
    let good = [
        ("math/frame.rs", "use crate::sampling::warp;"),
        ("base/ray.rs", "use crate::math::{aabb, frame}; use crate::Error;"),
        ("materials/metal.rs", "use crate::{base::ray, color::Rgb, materials::mirror}; use super::fresnel;"),
        ("integrators/path.rs", "use crate::scene::Scene; use crate::base;"),
        ("scene/build.rs", "use crate::materials::REGISTRY;"),
        ("render/mod.rs", "use crate::integrators; use crate::image;"),
        ("main.rs", "use crate::cli;"),
        ("accel/embree/mod.rs", "use embree_sys; unsafe { x() }"),
        ("accel/bvh/mod.rs", "use super::brute;"),
        ("lib.rs", "pub mod cli; #[cfg(test)] pub mod testing;"),
        ("base/mod.rs", "#[cfg(test)]\nmod tests;"),
    ];
    for (name, code) in good {
        assert_eq!(problems(name, code), 0, "{name}: {code}");
    }
    let bad = [
        ("math/frame.rs", "use crate::base::ray;"),
        ("base/ray.rs", "use crate::shapes::sphere;"),
        ("base/ray.rs", "fn f(x: crate::Scene) {}"),
        ("materials/metal.rs", "use crate::{base::ray, textures};"),
        ("accel/brute.rs", "use crate::shapes::REGISTRY;"),
        ("materials/metal.rs", "use super::super::textures;"),
        ("materials/mod.rs", "use super::textures;"),
        ("materials/metal.rs", "use crate::scene::Scene;"),
        ("integrators/path.rs", "use crate::materials;"),
        ("scene/build.rs", "use crate::render;"),
        ("render/mod.rs", "use crate::cli;"),
        ("shapes/mesh.rs", "use embree_sys::x;"),
        ("shapes/mesh.rs", "unsafe { x() }"),
        ("newcomer/mod.rs", ""),
        ("lib.rs", "pub mod testing;"),
        ("base/mod.rs", "mod tests;"),
    ];
    for (name, code) in bad {
        assert_eq!(problems(name, code), 1, "{name}: {code}");
    }
}
