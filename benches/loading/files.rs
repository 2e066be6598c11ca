//! The files that are loaded, written from a generated knot.

use skylit::base::mesh::TriangleMesh;
use skylit::base::mesh_data::{MeshData, Positions, Repairs};
use skylit::base::registry::{Node, Params, Value, build};
use skylit::base::shape::Shape;
use skylit::formats::ply;
use skylit::shapes;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A kind of file, and how many bytes of it a triangle takes, about.
pub struct Kind {
    /// For the table.
    pub name: &'static str,
    extension: &'static str,
    bytes: f64,
    write: fn(&Path, &TriangleMesh),
}

/// All kinds.
pub const KINDS: [Kind; 5] = [
    Kind { name: "obj, v vn", extension: "obj", bytes: 80.0, write: |p, m| write_obj(p, m, Form::Normals) },
    Kind { name: "obj, v", extension: "obj", bytes: 40.0, write: |p, m| write_obj(p, m, Form::Positions) },
    Kind { name: "obj, v vt vn", extension: "obj", bytes: 112.0, write: |p, m| write_obj(p, m, Form::Seams) },
    Kind { name: "ply, xyz n", extension: "ply", bytes: 25.0, write: |p, m| write_ply(p, m, true) },
    Kind { name: "ply, xyz", extension: "ply", bytes: 19.0, write: |p, m| write_ply(p, m, false) },
];

impl Kind {
    /// Writes a file of about so many bytes into `folder`.
    pub fn write(&self, folder: &Path, bytes: f64) -> PathBuf {
        let path = folder.join(format!("{}.{}", self.name.replace([' ', ','], "-"), self.extension));
        let shape = knot(bytes / self.bytes);
        (self.write)(&path, shape.triangles().expect("a knot is made of triangles"));
        path
    }
}

fn knot(triangles: f64) -> Arc<dyn Shape> {
    let params = Params::new().with("triangles", Value::Number(triangles.round()));
    let node = Node { kind: "knot".into(), params, ..Node::default() };
    let source = build("shape", shapes::REGISTRY, &node).expect("a knot");
    source.place(&glam::DAffine3::IDENTITY).expect("can be placed").shape
}

/// What stands in an OBJ file.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    /// Positions alone: `f 1 2 3`.
    Positions,
    /// As most programs write it: `f 1//1 2//2 3//3`.
    Normals,
    /// Numbers that differ, so that vertices must be found by all three: `f 1/9/1 2/8/2 3/7/3`.
    Seams,
}

/// Numbers as short as they read back in single precision: what programs print.
fn write_obj(path: &Path, mesh: &TriangleMesh, form: Form) {
    let mut out = BufWriter::with_capacity(1 << 20, File::create(path).expect("can be created"));
    let count = mesh.positions().len() as u32;
    let mut lines = || -> std::io::Result<()> {
        for [x, y, z] in mesh.positions() {
            writeln!(out, "v {x} {y} {z}")?;
        }
        if form == Form::Seams {
            for [x, y, _] in mesh.positions().iter().rev() {
                writeln!(out, "vt {x} {y}")?;
            }
        }
        if form != Form::Positions {
            for [x, y, z] in &mesh.normals {
                writeln!(out, "vn {x} {y} {z}")?;
            }
        }
        for triangle in &mesh.indices {
            let [a, b, c] = triangle.map(|i| i + 1);
            let uv = |i: u32| count + 1 - i;
            match form {
                Form::Positions => writeln!(out, "f {a} {b} {c}")?,
                Form::Normals => writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?,
                Form::Seams => {
                    writeln!(out, "f {a}/{}/{a} {b}/{}/{b} {c}/{}/{c}", uv(a), uv(b), uv(c))?;
                }
            }
        }
        out.flush()
    };
    lines().expect("can be written");
}

fn write_ply(path: &Path, mesh: &TriangleMesh, normals: bool) {
    let mesh = MeshData {
        positions: Positions::F32(mesh.positions().to_vec()),
        normals: if normals { mesh.normals.clone() } else { Vec::new() },
        uvs: Vec::new(),
        indices: mesh.indices.clone(),
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    ply::write_ply(path, &mesh).expect("can be written");
}
