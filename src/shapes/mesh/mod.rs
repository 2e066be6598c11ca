//! Triangle meshes: from a file's data, in double precision, to single precision in the space of a group.

mod batch;
mod place;
mod refine;
mod sample;
mod shading;
mod shape;
mod smooth;

pub use shape::MeshShape;

use crate::base::mesh_data::MeshData;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row};
use crate::base::shape::{Placed, ShapeSource};
use crate::error::Result;
use crate::math::aabb::DAabb;
use glam::{DAffine3, DVec3};
use std::sync::{Arc, OnceLock};

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "mesh",
    doc: "a triangle mesh from a file",
    params: &[
        ParamSpec { name: "path", kind: ParamKind::Mesh, default: None, doc: "the mesh: OBJ or PLY" },
        ParamSpec {
            name: "normals",
            kind: ParamKind::Choice(&["file", "smooth", "flat"]),
            default: Some("file"),
            doc: "shading normals: the file's (flat where it has none), computed, or none",
        },
        ParamSpec {
            name: "missing_uv",
            kind: ParamKind::Choice(&["square", "barycentric"]),
            default: Some("square"),
            doc: "uv of each triangle if the file has none: (0,0) (1,0) (1,1) at its corners, or (0,0) (1,0) (0,1)",
        },
    ],
    build: |p| {
        let normals = match p.text_or("normals", "file")? {
            "smooth" => Normals::Smooth,
            "flat" => Normals::Flat,
            _ => Normals::File,
        };
        let missing_uv = match p.text_or("missing_uv", "square")? {
            "barycentric" => MissingUv::Barycentric,
            _ => MissingUv::Square,
        };
        Ok(Arc::new(MeshSource { missing_uv, ..MeshSource::new(p.mesh("path")?, normals) }))
    },
    samples,
};

/// Where shading normals come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Normals {
    /// As the mesh data has them; flat if it has none.
    #[default]
    File,
    /// Computed from the faces around each vertex.
    Smooth,
    /// None: the geometric normal.
    Flat,
}

/// What a triangle of a mesh without texture coordinates has instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum MissingUv {
    /// Half of a picture (pbrt's choice).
    #[default]
    Square,
    /// The weights of the second and third corner.
    Barycentric,
}

/// A mesh before it is placed.
pub struct MeshSource {
    data: Arc<MeshData>,
    normals: Normals,
    missing_uv: MissingUv,
    bounds: OnceLock<DAabb>,
}

impl MeshSource {
    /// A mesh with a choice of shading normals.
    pub fn new(data: Arc<MeshData>, normals: Normals) -> Self {
        MeshSource { data, normals, missing_uv: MissingUv::default(), bounds: OnceLock::new() }
    }
}

impl ShapeSource for MeshSource {
    fn bounds(&self) -> DAabb {
        *self.bounds.get_or_init(|| place::bounds(&self.data))
    }

    fn support(&self, directions: &[DVec3]) -> Vec<f64> {
        place::support(&self.data, directions)
    }

    fn place(self: Arc<Self>, to_group: &DAffine3) -> Result<Placed> {
        let (normals, missing_uv) = (self.normals, self.missing_uv);
        let data = match Arc::try_unwrap(self) {
            Ok(own) => own.data,
            Err(shared) => shared.data.clone(),
        };
        let placed = place::place(place::Parts::from_shared(data, normals)?, normals, to_group)?;
        let shape = Arc::new(placed.shape.with_missing_uv(missing_uv, to_group));
        Ok(Placed { shape, dropped: placed.dropped })
    }

    fn describe(&self) -> String {
        format!("mesh, {} triangles", self.data.indices.len())
    }
}

/// A tetrahedron with uvs, the same from doubles far away with smooth normals, and a coarse ball with its own.
fn samples() -> Vec<Params> {
    use crate::base::mesh_data::Positions;
    use crate::base::registry::Value;
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.1], [0.0, 1.5, 0.0], [0.2, 0.1, 1.0]];
    let tetrahedron = MeshData {
        positions: Positions::F32(corners.to_vec()),
        normals: Vec::new(),
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
        indices: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        material_ids: vec![0, 1, 0, 1],
        materials: Vec::new(),
        repairs: Default::default(),
    };
    let far = corners.map(|c| [f64::from(c[0]) + 4e6, f64::from(c[1]) - 5e5, f64::from(c[2])]);
    let far = MeshData { positions: Positions::F64(far.to_vec()), ..tetrahedron.clone() };
    let ball = octahedron_ball(3);
    let bare = MeshData { uvs: Vec::new(), ..tetrahedron.clone() };
    let given = |m: MeshData| Params::new().with("path", Value::Mesh(Arc::new(m)));
    vec![
        given(tetrahedron),
        given(far).with("normals", Value::Text("smooth".into())),
        given(ball.clone()),
        given(ball).with("normals", Value::Text("flat".into())),
        given(bare).with("missing_uv", Value::Text("barycentric".into())),
    ]
}

/// A unit ball by `levels` subdivisions of an octahedron (4^levels x 8 triangles), with exact normals.
fn octahedron_ball(levels: u32) -> MeshData {
    use crate::base::mesh_data::Positions;
    use glam::Vec3;
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut corners = Vec::new();
    for sign in 0..8u32 {
        let [a, b, c] = std::array::from_fn(|k| if sign >> k & 1 == 0 { axes[k] } else { -axes[k] });
        corners.push(if sign.count_ones() % 2 == 0 { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..levels {
        let split = |[a, b, c]: &[Vec3; 3]| {
            let (ab, bc, ca) = ((a + b).normalize(), (b + c).normalize(), (c + a).normalize());
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
        };
        corners = corners.iter().flat_map(split).collect();
    }
    let points: Vec<[f32; 3]> = corners.iter().flatten().map(|v| v.to_array()).collect();
    MeshData {
        normals: points.clone(),
        indices: (0..corners.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        positions: Positions::F32(points),
        uvs: Vec::new(),
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Default::default(),
    }
}

#[cfg(test)]
mod tests;
