//! Scenes that name what they should not: themselves, devices, what is not there.

use skylit::formats::{load, load_mesh};
use std::fs;
use std::path::PathBuf;

/// Writes a file of a fresh folder, loads it, and returns the message of its error.
fn refused(name: &str, text: &str, code: u8) -> String {
    let dir = tempfile::tempdir().unwrap();
    let path: PathBuf = dir.path().join(name);
    fs::write(&path, text).unwrap();
    let e = load(&path).map(drop).unwrap_err();
    assert_eq!(e.exit_code(), code, "{name}: {e}");
    e.to_string()
}

fn toml(mesh: &str) -> String {
    format!("[[objects]]\nshape = {{ type = \"mesh\", path = \"{mesh}\" }}\n")
}

/// No format includes scenes: whoever names itself names what is no mesh and no picture.
#[test]
fn a_scene_that_names_itself_is_refused() {
    let message = refused("a.toml", &toml("a.toml"), 2);
    assert!(message.contains("unknown kind of mesh file \"toml\"; known: obj, ply"), "{message}");
    refused("a.toml", "[sky]\ntype = \"sphere\"\npath = \"a.toml\"\n", 2);
    refused("a.scene", "sph 0 0 0 1\nOBJ a.scene\n", 2);
    refused("a.scene", "sph 0 0 0 1\nskybox a.scene\n", 2);
    refused("a.scene", "texture a.scene\nsph 0 0 0 1\n", 2);
    // An OBJ file as its own library: no statement of it means anything there.
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.obj");
    fs::write(&path, "mtllib a.obj\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(load(&path).unwrap().objects.len(), 1);
}

#[test]
fn missing_files_are_named_with_the_place_that_names_them() {
    let message = refused("a.toml", &toml("gone.ply"), 3);
    assert!(message.contains("gone.ply") && message.contains("a.toml:2:"), "{message}");
    for text in ["OBJ gone.obj", "skybox gone", "texture gone.png\nsph 0 0 0 1"] {
        let message = refused("a.scene", &format!("size 4 4\n{text}\nsph 0 0 0 1"), 3);
        assert!(message.contains("gone") && message.contains("a.scene:"), "{message}");
    }
}

/// Reading them would never end, and fill all memory on the way.
#[test]
#[cfg(unix)]
fn devices_are_not_read() {
    let message = refused("a.toml", &toml("/dev/zero"), 3);
    assert!(message.contains("/dev/zero") && message.contains("a.toml:2:"), "{message}");
    refused("a.toml", "[sky]\ntype = \"sphere\"\npath = \"/dev/zero\"\n", 3);
    for command in ["OBJ /dev/zero", "skybox /dev/zero", "texture /dev/zero\nsph 0 0 0 1"] {
        refused("a.scene", &format!("size 4 4\n{command}\nsph 0 0 0 1"), 3);
    }
    assert_eq!(load("/dev/zero".as_ref()).map(drop).unwrap_err().exit_code(), 3);
    assert_eq!(load_mesh("/dev/zero".as_ref()).map(drop).unwrap_err().exit_code(), 3);
    // A library's picture costs a warning.
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.mtl"), "newmtl a\nmap_Kd /dev/zero\n").unwrap();
    let path = dir.path().join("a.obj");
    fs::write(&path, "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(load(&path).unwrap().objects.len(), 1);
}
