//! Material libraries (MTL): of each material its diffuse colour `Kd` and picture `map_Kd`.
//!
//! Numbers are taken as linear reflectance in Rec. 709 primaries; the format says nothing of its colour space.

use crate::base::mesh_data::MeshMaterial;
use crate::formats::source;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The materials that the faces of a file use.
pub struct MaterialTable {
    /// In the order of `names`.
    pub materials: Vec<MeshMaterial>,
}

impl MaterialTable {
    /// Looks up `names` in the `libraries` that the OBJ file at `path` names. What cannot be read or found is logged
    /// as a warning, and its material has a name only. A library that is `given` stands for all of them.
    pub fn load(path: &Path, libraries: &[String], given: Option<&[u8]>, names: &[String]) -> Self {
        let folder = path.parent().unwrap_or(Path::new(""));
        let known: Vec<MeshMaterial> = match given {
            Some(bytes) => libraries.iter().take(1).flat_map(|_| parse(path, bytes)).collect(),
            None => {
                // Each file once, however often and by however many names it is asked for.
                let mut seen = HashSet::new();
                let mut files: Vec<PathBuf> =
                    libraries.iter().flat_map(|name| library_files(folder, name)).collect();
                files.retain(|file| seen.insert(file.canonicalize().unwrap_or_else(|_| file.clone())));
                files.iter().flat_map(|file| read_library(path, file)).collect()
            }
        };
        // By name, as both may be tens of thousands; of two alike the first counts.
        let mut by_name: HashMap<&str, &MeshMaterial> = HashMap::with_capacity(known.len());
        for material in &known {
            by_name.entry(&material.name).or_insert(material);
        }
        let find = |name: &str| by_name.get(name).copied();
        let missing: Vec<&str> =
            names.iter().map(String::as_str).filter(|n| !n.is_empty() && find(n).is_none()).collect();
        if let [first, ..] = missing[..] {
            let others =
                if missing.len() > 1 { format!(" and {} others", missing.len() - 1) } else { String::new() };
            log::warn!("{}: no library defines the material \"{first}\"{others}", path.display());
        }
        let look_up = |name: &String| {
            find(name).cloned().unwrap_or(MeshMaterial { name: name.clone(), ..MeshMaterial::default() })
        };
        MaterialTable { materials: names.iter().map(look_up).collect() }
    }
}

/// The files that a `mtllib` statement means: one whose name may hold blanks, or several.
fn library_files(folder: &Path, statement: &str) -> Vec<PathBuf> {
    let whole = resolve(folder, statement);
    if whole.is_file() {
        return vec![whole];
    }
    let parts: Vec<PathBuf> = statement.split_ascii_whitespace().map(|name| resolve(folder, name)).collect();
    if parts.iter().any(|p| p.is_file()) { parts } else { vec![whole] }
}

/// A path as a file of the folder says it, also in quotes or with the slashes of Windows.
fn resolve(folder: &Path, name: &str) -> PathBuf {
    let name = name.trim().trim_matches('"');
    let plain = folder.join(name);
    if name.contains('\\') && !plain.exists() { folder.join(name.replace('\\', "/")) } else { plain }
}

fn read_library(obj: &Path, file: &Path) -> Vec<MeshMaterial> {
    // Only a plain file: the name stands in a file that may come from anywhere, and a device may never end.
    let bytes = if file.is_file() {
        source::read(file).map_err(|e| e.to_string())
    } else {
        Err("there is no such file".to_string())
    };
    match bytes {
        Ok(bytes) => parse(file, &bytes),
        Err(reason) => {
            log::warn!("{}: material library {} left out: {reason}", obj.display(), file.display());
            Vec::new()
        }
    }
}

/// The materials of a library, by `tobj`, from a text of only those statements that we use and it can take.
fn parse(file: &Path, bytes: &[u8]) -> Vec<MeshMaterial> {
    let text = clean(file, &String::from_utf8_lossy(bytes));
    let materials = match tobj::load_mtl_buf(&mut text.as_bytes()) {
        Ok((materials, _)) => materials,
        Err(e) => {
            log::warn!("{}: material library left out: {e}", file.display());
            Vec::new()
        }
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    materials
        .into_iter()
        .map(|m| MeshMaterial {
            name: m.name,
            diffuse: m.diffuse.map(|c| c.map(|x| x as f32)),
            diffuse_map: m.diffuse_texture.map(|name| resolve(folder, &name)),
        })
        .collect()
}

fn clean(file: &Path, text: &str) -> String {
    let mut cleaned = String::new();
    let mut named = false;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match keyword {
            "newmtl" => {
                named = !rest.is_empty();
                if named {
                    cleaned += &format!("newmtl {rest}\n");
                }
            }
            "Kd" if named => match color(rest) {
                Some([r, g, b]) => cleaned += &format!("Kd {r} {g} {b}\n"),
                None => {
                    let place = format!("{}:{}", file.display(), number + 1);
                    log::warn!("{place}: \"{line}\" left out; Kd takes one or three numbers from 0 up");
                }
            },
            "map_Kd" if named => {
                let name = strip_options(rest);
                if !name.is_empty() {
                    cleaned += &format!("map_Kd {name}\n");
                }
            }
            _ => {}
        }
    }
    cleaned
}

/// `r g b`, or `r` for all three.
fn color(text: &str) -> Option<[f64; 3]> {
    let words = text.split_ascii_whitespace().take_while(|w| !w.starts_with('#'));
    let numbers: Vec<f64> =
        words.map(|w| w.parse().ok().filter(|x: &f64| x.is_finite() && *x >= 0.0)).collect::<Option<_>>()?;
    match numbers[..] {
        [all] => Some([all; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

/// The file name behind the options of a map, whose arguments are known by number and, where that varies, by being
/// numbers. A name may hold blanks.
fn strip_options(text: &str) -> &str {
    let mut rest = text.trim_start();
    while rest.starts_with('-') {
        let (option, behind) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        let (most, any) = match option {
            "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-type" | "-texres" | "-colorspace" => {
                (1, true)
            }
            "-bm" | "-boost" => (1, false),
            "-mm" => (2, false),
            "-o" | "-s" | "-t" => (3, false),
            // No option: a name that starts with a dash.
            _ => break,
        };
        rest = behind.trim_start();
        for _ in 0..most {
            let (word, behind) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            if !any && word.parse::<f64>().is_err() {
                break;
            }
            rest = behind.trim_start();
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_before_a_picture_are_passed_over() {
        for (text, want) in [
            ("wood.png", "wood.png"),
            ("my wood.png", "my wood.png"),
            ("-o 0.1 diffuse.jpg", "diffuse.jpg"),
            ("-s 1 2 3 -o 0.5 0.5 a b.png", "a b.png"),
            ("-clamp on -blendu off -mm 0.1 0.3 x.png", "x.png"),
            ("-texres 512 input.jpg", "input.jpg"),
            ("-type sphere -imfchan r 7.png", "7.png"),
            ("-leading-dash.png", "-leading-dash.png"),
            ("-s", ""),
        ] {
            assert_eq!(strip_options(text), want, "{text}");
        }
    }

    #[test]
    fn statements_that_would_upset_the_parser_are_left_out_or_mended() {
        let text = "Kd 1 1 1\nnewmtl a b\r\n\tKd 0.5\nillum x\nmap_Kd\nd\nnewmtl\nKd 1 0 0\nnewmtl c\nKd 1 2\nKd spectral x.rfl 1\n\
            Kd 0.1 0.2 0.3 # red\nmap_Kd tex\\pic.png\nnewmtl d\nKd nan 0 0";
        let materials = parse(Path::new("dir/lib.mtl"), text.as_bytes());
        let material = |name: &str, diffuse, map: Option<&str>| MeshMaterial {
            name: name.to_string(),
            diffuse,
            diffuse_map: map.map(PathBuf::from),
        };
        let want = [
            material("a b", Some([0.5; 3]), None),
            material("c", Some([0.1, 0.2, 0.3]), Some("dir/tex/pic.png")),
            material("d", None, None),
        ];
        assert_eq!(materials, want);
    }

    #[test]
    fn a_library_is_read_once_however_often_it_is_named() {
        let dir = tempfile::tempdir().unwrap();
        // Read a hundred thousand times, it would be 6 GB of materials.
        let library: String = (0..4000).map(|i| format!("newmtl m{i}\nKd 0.5\n")).collect();
        std::fs::write(dir.path().join("a.mtl"), library).unwrap();
        let names =
            [&["a.mtl".to_string(), "./a.mtl".to_string(), "a.mtl a.mtl".to_string()][..]; 33_333].concat();
        let wanted: Vec<String> = (0..4000).rev().map(|i| format!("m{i}")).collect();
        let table = MaterialTable::load(&dir.path().join("a.obj"), &names, None, &wanted);
        assert!(
            table
                .materials
                .iter()
                .zip(&wanted)
                .all(|(m, name)| m.name == *name && m.diffuse == Some([0.5; 3]))
        );
    }
}
