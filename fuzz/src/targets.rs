//! Every reader of bytes from outside, and what each promises whatever the bytes are: a sound result, or an error with
//! a message that can be read. No target opens a file.

use skylit::base::image_data::{ImageData, Texels};
use skylit::base::mesh_data::MeshData;
use skylit::formats::{self, LoadOptions, NamedFiles, obj, ply, source};
use skylit::image::load;
use skylit::image::read::{decode_image, decode_planes};
use skylit::{Error, Result};
use std::path::Path;
use std::sync::LazyLock;

/// Names of all targets.
#[allow(dead_code, reason = "the fuzz crate names its targets itself")]
pub const TARGETS: [&str; 14] = [
    "obj", "mtl", "ply", "toml", "seed", "course", "png", "jpg", "hdr", "exr", "tiff", "pfm", "gzip", "zstd",
];

/// Longest message of an error, in bytes: it may quote what it found, but not a whole file.
const LONGEST_MESSAGE: usize = 4096;

/// Hands `data` to the reader of this name; whether it was accepted. Where a format is told by its first bytes, they
/// are put there, so that no change of them ends the search.
///
/// # Panics
/// Where a reader breaks its promise; an unknown name.
pub fn run(target: &str, data: &[u8]) -> bool {
    match target {
        "obj" => mesh(obj::parse_with_library(Path::new("a.obj"), data, b"")),
        "mtl" => mesh(obj::parse_with_library(Path::new("a.obj"), USES_LIBRARY, data)),
        "ply" => mesh(ply::parse(Path::new("a.ply"), data)),
        "toml" => scene("a.toml", data),
        "seed" => scene("a.scene", data),
        "course" => scene("a.test", data),
        "png" => picture(&begin(data, b"\x89PNG\r\n\x1a\n")),
        "jpg" => picture(&begin(data, b"\xff\xd8\xff")),
        "hdr" => picture(&begin(data, b"#?RADIANCE")),
        "exr" => {
            let data = begin(data, b"\x76\x2f\x31\x01");
            let planes = accepted(decode_planes(Path::new("a.exr"), &data));
            if let Some(planes) = &planes {
                let pixels = planes.width * planes.height;
                assert!(planes.planes.iter().all(|p| p.data.len() == pixels));
            }
            picture(&data) || planes.is_some()
        }
        "tiff" if data.first() == Some(&b'M') => picture(&begin(data, b"MM\0*")),
        "tiff" => picture(&begin(data, b"II*\0")),
        "pfm" => picture(&begin(data, b"P")),
        "gzip" => unpacked(&begin(data, b"\x1f\x8b")),
        "zstd" => unpacked(&begin(data, b"\x28\xb5\x2f\xfd")),
        _ => panic!("no target {target}"),
    }
}

/// Every material that a library of the corpus may name is used.
const USES_LIBRARY: &[u8] =
    b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n";

fn begin(data: &[u8], magic: &[u8]) -> Vec<u8> {
    [magic, data.get(magic.len()..).unwrap_or_default()].concat()
}

/// The result, or that it was refused in the way it must be.
fn accepted<T>(result: Result<T>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(e) => {
            let message = e.to_string();
            assert!(matches!(e, Error::Content { .. }), "an error of another kind: {message}");
            assert!(message.len() > 8 && message.len() < LONGEST_MESSAGE, "{} bytes", message.len());
            None
        }
    }
}

fn mesh(result: Result<MeshData>) -> bool {
    let Some(mesh) = accepted(result) else { return false };
    let vertices = mesh.positions.len();
    assert!(!mesh.indices.is_empty(), "a mesh without a triangle");
    assert!(mesh.indices.iter().flatten().all(|&i| (i as usize) < vertices), "an index out of range");
    assert!([0, vertices].contains(&mesh.normals.len()) && [0, vertices].contains(&mesh.uvs.len()));
    assert!([0, mesh.indices.len()].contains(&mesh.material_ids.len()));
    assert!(mesh.material_ids.iter().all(|&i| usize::from(i) < mesh.materials.len()));
    assert!(mesh.normals.iter().all(|n| n.iter().all(|c| c.is_finite()) && *n != [0.0; 3]));
    true
}

fn scene(name: &str, data: &[u8]) -> bool {
    static OPTIONS: LazyLock<LoadOptions> =
        LazyLock::new(|| LoadOptions { named_files: NamedFiles::LeftOut, ..LoadOptions::default() });
    accepted(formats::parse(Path::new(name), data.to_vec(), &OPTIONS)).is_some()
}

fn picture(data: &[u8]) -> bool {
    let loaded = accepted(load::decode(Path::new("a.picture"), data, &load::LoadOptions::default()));
    if let Some(loaded) = &loaded {
        let picture = &loaded.picture;
        assert!(!picture.planes.is_empty() && !loaded.layers.is_empty());
        assert!(picture.planes.iter().all(|p| p.data.len() == picture.width * picture.height));
    }
    let Some(image) = accepted(decode_image(Path::new("a.picture"), data, None)) else { return false };
    let ImageData { width, height, texels } = image;
    let count = match &texels {
        Texels::Srgb8(t) | Texels::Linear8(t) => t.len(),
        Texels::F32(t) => {
            assert!(t.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0), "a value is not repaired");
            t.len()
        }
    };
    assert!(count == width * height && count > 0, "{count} texels of {width} x {height}");
    true
}

fn unpacked(data: &[u8]) -> bool {
    accepted(source::unpacked(Path::new("a.packed"), data)).is_some()
}
