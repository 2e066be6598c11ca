//! Whole files: all the shared meshes, good, awkward and malformed, and pieces of them.

use super::*;
use crate::testing::{TestRng, data_dir};
use std::path::PathBuf;

/// Files below a folder whose name says that [`load_mesh`] takes them, in a fixed order.
fn mesh_files(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    let expand = |path: PathBuf| if path.is_dir() { mesh_files(&path) } else { vec![path] };
    entries.into_iter().flat_map(expand).filter(|p| is_mesh_path(p)).collect()
}

/// What every loader promises of a mesh.
fn assert_sound(mesh: &MeshData, name: &Path) {
    let vertices = mesh.positions.len();
    assert!(!mesh.indices.is_empty(), "{}: a mesh without a triangle", name.display());
    assert!(mesh.indices.iter().flatten().all(|&i| (i as usize) < vertices), "{}", name.display());
    assert!([0, vertices].contains(&mesh.normals.len()) && [0, vertices].contains(&mesh.uvs.len()));
    assert!([0, mesh.indices.len()].contains(&mesh.material_ids.len()));
    assert!(mesh.material_ids.iter().all(|&i| (i as usize) < mesh.materials.len()));
    assert!(mesh.normals.iter().all(|n| n.iter().all(|c| c.is_finite()) && *n != [0.0; 3]));
}

/// Triangle counts that the index of the shared data states, by path below the data folder.
fn stated_counts(readme: &str) -> Vec<(String, usize)> {
    let mut folder = "";
    let mut counts = Vec::new();
    for line in readme.lines() {
        if let Some(title) = line.strip_prefix("### ") {
            folder = title.trim().trim_end_matches('/');
        }
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let ["", name, _, _, _, facts, ..] = cells[..] {
            let triangles = facts.split([';', ' ']).zip(facts.split([';', ' ']).skip(1));
            let count = triangles
                .filter(|(_, unit)| unit.starts_with("tri"))
                .find_map(|(n, _)| n.replace(',', "").parse().ok());
            counts.extend(count.map(|n| (format!("{folder}/{name}"), n)));
        }
    }
    counts
}

/// Meshes of the index that are refused, for an index that points nowhere.
const REFUSED: [&str; 1] = ["meshes/awkward-obj/tinyobjloader/invalid-relative-texture-index.obj"];

#[test]
fn shared_meshes_have_the_triangles_they_should() {
    let Some(data) = data_dir() else { return };
    let readme = std::fs::read_to_string(data.join("README.md")).unwrap();
    let mut checked = 0;
    for (name, count) in stated_counts(&readme) {
        let path = data.join(&name);
        let known =
            ["meshes/obj", "meshes/ply", "meshes/awkward-obj", "scenes"].iter().any(|f| name.starts_with(f));
        if known && is_mesh_path(&path) && count > 0 && !REFUSED.contains(&name.as_str()) {
            let mesh = load_mesh(&path).unwrap();
            assert_eq!(mesh.indices.len(), count, "{name}");
            checked += 1;
        }
    }
    // The index names 96 of them; a change of its form must not empty this test.
    assert!(checked >= 90, "{checked}");
}

#[test]
fn one_mesh_in_three_encodings_reads_alike() {
    let Some(data) = data_dir() else { return };
    let load = |name: &str| load_mesh(&data.join("meshes/ply/happly").join(name)).unwrap();
    let mesh = load("platonic_shelf.ply");
    assert_eq!(load("platonic_shelf_ascii.ply"), mesh);
    assert_eq!(load("platonic_shelf_big_endian.ply"), mesh);
}

#[test]
fn every_shared_mesh_loads_or_says_why_not_whole_and_cut() {
    let Some(data) = data_dir() else { return };
    let mut rng = TestRng::new(1);
    let dir = tempfile::tempdir().unwrap();
    let check = |path: &Path, name: &Path| match load_mesh(path) {
        Ok(mesh) => assert_sound(&mesh, name),
        Err(e) => assert_eq!(e.exit_code(), 2, "{}: {e}", name.display()),
    };
    for folder in ["obj", "ply", "awkward-obj", "malformed"] {
        for path in mesh_files(&data.join("meshes").join(folder)) {
            check(&path, &path);
            let bytes = std::fs::read(&path).unwrap();
            for _ in 0..20 {
                let cut = dir.path().join(path.file_name().unwrap());
                std::fs::write(&cut, &bytes[..(rng.f64() * bytes.len() as f64) as usize]).unwrap();
                check(&cut, &path);
            }
        }
    }
}

#[test]
fn an_unknown_kind_names_those_that_are_known() {
    for name in ["a.plyy", "a.stl.gz", "a", "a.gz"] {
        let e = load_mesh(Path::new(name)).unwrap_err();
        assert_eq!(e.exit_code(), 2);
        assert!(e.to_string().contains("known: obj, ply (each also packed as .gz or .zst)"), "{e}");
    }
    assert_eq!(load_mesh(Path::new("absent.PLY.zst")).unwrap_err().exit_code(), 3);
}

#[test]
fn packed_meshes_load_as_plain_ones() {
    let dir = tempfile::tempdir().unwrap();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let plain = dir.path().join("a.OBJ");
    std::fs::write(&plain, text).unwrap();
    let packed = dir.path().join("a.obj.ZST");
    let level = ruzstd::encoding::CompressionLevel::Fastest;
    std::fs::write(&packed, ruzstd::encoding::compress_to_vec(text.as_bytes(), level)).unwrap();
    assert_eq!(load_mesh(&packed).unwrap(), load_mesh(&plain).unwrap());
}

#[test]
fn packed_headers_are_held_against_what_is_unpacked() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.ply.zst");
    for format in ["ascii", "binary_little_endian"] {
        // Room for 4e9 vertices would be 48 GB.
        let text = format!(
            "ply\nformat {format} 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
        );
        let level = ruzstd::encoding::CompressionLevel::Fastest;
        std::fs::write(&path, ruzstd::encoding::compress_to_vec(text.as_bytes(), level)).unwrap();
        let e = load_mesh(&path).unwrap_err();
        assert!(e.exit_code() == 2 && e.to_string().contains("promises 4000000000 records"), "{e}");
    }
}
