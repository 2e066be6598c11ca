//! Shapes made in code, of any number of triangles up to 50 million: something to look at and to measure with that
//! needs no file. Each is a pure function of its parameters.

mod displaced_sphere;
mod knot;
mod noise;
mod terrain;

pub use displaced_sphere::ROW as DISPLACED_SPHERE;
pub use knot::ROW as KNOT;
pub use terrain::ROW as TERRAIN;

use super::mesh::{MeshSource, Normals};
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{ParamKind, ParamSpec, Params};
use crate::base::shape::{Placed, ShapeSource};
use crate::error::Result;
use crate::math::aabb::DAabb;
use crate::memory;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// The parameter that all have.
const TRIANGLES: ParamSpec = ParamSpec {
    name: "triangles",
    kind: ParamKind::Integer { min: 200, max: 50_000_000 },
    default: Some("200000"),
    doc: "about how many: met to a few percent, better for large numbers",
};

/// Bytes for each triangle: half a vertex with its normal in double and single precision, and three indices.
const BYTES_PER_TRIANGLE: u64 = 40;

/// The number of triangles, where there is room for them.
fn triangles(p: &Params) -> Result<u32> {
    let triangles = integer(p, &TRIANGLES, 2e5)?;
    let what = || format!("a mesh of {triangles} triangles");
    drop(memory::room(u64::from(triangles) * BYTES_PER_TRIANGLE, what)?);
    Ok(triangles)
}

/// The second one.
const SEED: ParamSpec = ParamSpec {
    name: "seed",
    kind: ParamKind::Integer { min: 0, max: u32::MAX as i64 },
    default: Some("1"),
    doc: "another number gives another one of its kind",
};

/// A parameter of kind integer; in range also where nobody has checked.
fn integer(p: &Params, spec: &ParamSpec, default: f64) -> Result<u32> {
    let ParamKind::Integer { min, max } = spec.kind else { unreachable!("declared as an integer") };
    let v = p.number_or(spec.name, default)?;
    if !(min as f64..=max as f64).contains(&v) {
        return Err(p.error(spec.name, format!("{v} is outside {min} to {max}")));
    }
    Ok(v as u32)
}

/// A mesh that is made when it is first asked for: reading or listing a scene costs nothing.
struct Generated {
    make: Box<dyn Fn() -> MeshData + Send + Sync>,
    mesh: OnceLock<Arc<MeshSource>>,
    what: &'static str,
}

impl Generated {
    fn source(
        what: &'static str,
        make: impl Fn() -> MeshData + Send + Sync + 'static,
    ) -> Arc<dyn ShapeSource> {
        Arc::new(Generated { make: Box::new(make), mesh: OnceLock::new(), what })
    }

    fn made(&self) -> Arc<MeshSource> {
        Arc::new(MeshSource::new(Arc::new((self.make)()), Normals::File))
    }
}

impl ShapeSource for Generated {
    fn bounds(&self) -> DAabb {
        self.mesh.get_or_init(|| self.made()).bounds()
    }

    fn support(&self, directions: &[DVec3]) -> Vec<f64> {
        self.mesh.get_or_init(|| self.made()).support(directions)
    }

    fn place(self: Arc<Self>, to_group: &DAffine3) -> Result<Placed> {
        let mesh = match Arc::try_unwrap(self) {
            Ok(mut own) => own.mesh.take().unwrap_or_else(|| own.made()),
            Err(shared) => shared.mesh.get_or_init(|| shared.made()).clone(),
        };
        mesh.place(to_group)
    }

    fn describe(&self) -> String {
        let count = self.mesh.get_or_init(|| self.made()).describe();
        format!("{}, {count}", self.what)
    }
}

/// A vertex of a patch.
struct GridVertex {
    p: DVec3,
    /// Outward, any length.
    n: DVec3,
}

/// Rectangular patches of `across` x `along` cells of two triangles each.
#[derive(Debug, Clone, Copy)]
struct Grid {
    patches: usize,
    across: usize,
    along: usize,
    /// Whether both directions close on themselves.
    closed: bool,
}

impl Grid {
    fn triangles(&self) -> usize {
        2 * self.patches * self.across * self.along
    }

    /// Vertices in each direction.
    fn vertices(&self) -> [usize; 2] {
        let more = usize::from(!self.closed);
        [self.across + more, self.along + more]
    }

    /// The mesh whose vertex (i, j) of a patch is `f(patch, i, j)`; the outer side is that from which i and j run
    /// counter-clockwise. Holds nothing but the arrays of the result.
    fn mesh(&self, f: impl Fn(usize, usize, usize) -> GridVertex + Sync) -> MeshData {
        let [w, h] = self.vertices();
        let mut positions = vec![[0f32; 3]; self.patches * w * h];
        let mut normals = vec![[0f32; 3]; positions.len()];
        positions.par_chunks_mut(w).zip(normals.par_chunks_mut(w)).enumerate().for_each(|(row, (ps, ns))| {
            for (i, (p, n)) in ps.iter_mut().zip(ns).enumerate() {
                let v = f(row / h, i, row % h);
                *p = v.p.as_vec3().to_array();
                *n = v.n.normalize_or_zero().as_vec3().to_array();
            }
        });
        let mut indices = vec![[0u32; 3]; self.triangles()];
        indices.par_chunks_mut(2 * self.across).enumerate().for_each(|(row, cells)| {
            let (patch, j) = (row / self.along, row % self.along);
            let at = |i: usize, j: usize| ((patch * h + j % h) * w + i % w) as u32;
            for (i, pair) in cells.chunks_exact_mut(2).enumerate() {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                // Diagonals that alternate give the surface no grain.
                if (i + j) % 2 == 0 {
                    pair.copy_from_slice(&[[a, b, c], [a, c, d]]);
                } else {
                    pair.copy_from_slice(&[[a, b, d], [b, c, d]]);
                }
            }
        });
        MeshData {
            positions: Positions::F32(positions),
            normals,
            uvs: Vec::new(),
            indices,
            material_ids: Vec::new(),
            materials: Vec::new(),
            repairs: Repairs::default(),
        }
    }
}

#[cfg(test)]
mod tests;
