//! Writes all meshes of a scene, or a mesh file, as one binary PLY in world space: what other renderers are given.
//!
//!     cargo run --release --example mesh_to_ply -- SCENE|MESH OUT.ply

use skylit::base::mesh_data::{MeshData, Positions, Repairs};
use skylit::formats::{self, ply};
use skylit::scene::build::{BuildOptions, build};
use std::path::Path;

fn main() -> skylit::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = args.as_slice() else {
        eprintln!("usage: mesh_to_ply SCENE|MESH OUT.ply");
        std::process::exit(2);
    };
    let scene = build(formats::load(Path::new(input))?, &BuildOptions::default())?;
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    scene.geometry.for_each_path(&mut |_, leaf, placement| {
        let Some(mesh) = leaf.shape.triangles() else { return true };
        let first = positions.len() as u32;
        positions.extend(mesh.positions().iter().map(|p| {
            let p = glam::Vec3::from_array(*p).as_dvec3();
            let p = placement.map_or(p, |pl| pl.to_render.transform_point3(p));
            scene.space.world_point(p).as_vec3().to_array()
        }));
        indices.extend(mesh.indices.iter().map(|t| t.map(|i| i + first)));
        true
    });
    let mesh = MeshData {
        positions: Positions::F32(positions),
        normals: Vec::new(),
        uvs: Vec::new(),
        indices,
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    ply::write_ply(Path::new(output), &mesh)
}
