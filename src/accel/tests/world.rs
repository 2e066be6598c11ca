//! Small shapes, and groups of them, for the tests of kernels.

use crate::base::geometry::{Child, Geometry, Group, HitFilter, Leaf};
use crate::base::mesh::TriangleMesh;
use crate::base::shape::{LocalRay, Needs, Shape, ShapeSample, Surface};
use crate::error::Result;
use crate::math::aabb::{Aabb, DAabb};
use crate::math::quadric::unit_sphere_roots;
use crate::math::triangle::TriangleRay;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// What kernels never ask of a shape.
macro_rules! not_for_kernels {
    () => {
        fn refine(&self, _: &LocalRay, _: u32, _: f32, _: Needs) -> Surface {
            unreachable!("kernels do not refine")
        }
        fn primitive_area(&self, _: u32) -> f64 {
            unreachable!("kernels measure no areas")
        }
        fn sample_primitive(&self, _: u32, _: Vec3, _: [f32; 2]) -> Option<ShapeSample> {
            unreachable!("kernels sample nothing")
        }
        fn pdf_primitive(&self, _: u32, _: Vec3, _: Vec3, _: Vec3, _: Vec3) -> f32 {
            unreachable!("kernels sample nothing")
        }
        fn transformed(&self, _: &DAffine3) -> Result<Arc<dyn Shape>> {
            unreachable!("kernels move nothing")
        }
        fn memory(&self) -> u64 {
            0
        }
        fn describe(&self) -> String {
            "test shape".to_owned()
        }
    };
}

/// A mesh.
pub struct Mesh(pub TriangleMesh);

impl Shape for Mesh {
    fn bounds(&self) -> Aabb {
        let mut b = Aabb::EMPTY;
        self.0.positions().iter().for_each(|&p| b.extend(p.into()));
        b
    }

    fn primitive_count(&self) -> u32 {
        self.0.indices.len() as u32
    }

    fn primitive_bounds(&self, prim: u32) -> Aabb {
        let mut b = Aabb::EMPTY;
        self.0.corners(prim).into_iter().for_each(|p| b.extend(p));
        b
    }

    fn triangles(&self) -> Option<&TriangleMesh> {
        Some(&self.0)
    }

    fn intersect(&self, ray: &LocalRay, prim: u32) -> Option<f64> {
        let t = TriangleRay::new(ray.o, ray.d).distance(self.0.corners(prim).map(|p| p.as_dvec3()))?;
        (t >= ray.tnear && t <= ray.tfar).then_some(t)
    }

    not_for_kernels!();
}

/// Spheres by center and radius.
pub struct Balls(pub Vec<(DVec3, f64)>);

impl Shape for Balls {
    fn bounds(&self) -> Aabb {
        (0..self.primitive_count()).fold(Aabb::EMPTY, |b, i| b.union(self.primitive_bounds(i)))
    }

    fn primitive_count(&self) -> u32 {
        self.0.len() as u32
    }

    fn primitive_bounds(&self, prim: u32) -> Aabb {
        let (c, r) = self.0[prim as usize];
        DAabb { min: c - r, max: c + r }.to_f32()
    }

    fn intersect(&self, ray: &LocalRay, prim: u32) -> Option<f64> {
        let (c, r) = self.0[prim as usize];
        let roots = unit_sphere_roots((ray.o - c) / r, ray.d / r)?;
        roots.into_iter().find(|&t| t >= ray.tnear && t <= ray.tfar)
    }

    not_for_kernels!();
}

/// A shape whose test panics on one primitive.
pub struct Trap;

impl Shape for Trap {
    fn bounds(&self) -> Aabb {
        Aabb { min: -Vec3::ONE, max: Vec3::ONE }
    }

    fn primitive_count(&self) -> u32 {
        1
    }

    fn primitive_bounds(&self, _: u32) -> Aabb {
        self.bounds()
    }

    fn intersect(&self, _: &LocalRay, _: u32) -> Option<f64> {
        panic!("the trap is shut")
    }

    not_for_kernels!();
}

/// A closed, bumpy sphere about the origin of some 2 n^2 triangles, with radii from 0.9 to 1.1.
pub fn bumpy_sphere(n: u32) -> Mesh {
    let (rows, columns) = (n, n);
    let mut positions = Vec::new();
    let point = |i: u32, j: u32| {
        let (theta, phi) = (
            f64::from(i) / f64::from(rows) * std::f64::consts::PI,
            f64::from(j) / f64::from(columns) * std::f64::consts::TAU,
        );
        let (sin, cos) = if i == 0 || i == rows { (0.0, theta.cos()) } else { theta.sin_cos() };
        let r = 1.0 + 0.1 * (5.0 * phi).sin() * (4.0 * theta).sin() * sin;
        (DVec3::new(sin * phi.cos(), sin * phi.sin(), cos) * r).as_vec3().to_array()
    };
    for i in 0..=rows {
        positions.extend((0..columns).map(|j| point(i, j)));
    }
    // All vertices of a pole are the same point; the triangles between them have no area and are left out.
    let at = |i: u32, j: u32| i * columns + j % columns;
    let mut indices = Vec::new();
    for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        if i + 1 < rows {
            indices.push([a, b, c]);
        }
        if i > 0 {
            indices.push([a, c, d]);
        }
    }
    Mesh(TriangleMesh::new(positions, indices))
}

/// Makes a geometry group by group, children first.
#[derive(Default)]
pub struct World(pub Vec<Group>);

impl World {
    /// Appends a group and returns its number.
    pub fn group(&mut self, leaves: Vec<Leaf>, children: &[(usize, DAffine3)]) -> usize {
        let mut bounds = leaves.iter().fold(DAabb::EMPTY, |b, l| b.union(l.shape.bounds().into()));
        let mut paths = leaves.len() as u64;
        let children = children
            .iter()
            .map(|&(group, to_parent)| {
                let child = Child { group, to_parent, from_parent: to_parent.inverse(), first_path: paths };
                let below = &self.0[group];
                // Too many paths to count saturate; no test asks for such a one.
                paths = paths.saturating_add(below.paths);
                bounds = bounds.union(DAabb::from(below.bounds).transformed(&to_parent));
                child
            })
            .collect();
        self.0.push(Group { leaves, children, bounds: bounds.to_f32(), paths });
        self.0.len() - 1
    }

    /// The last group is the root.
    pub fn geometry(self) -> Arc<Geometry> {
        Arc::new(Geometry { groups: self.0 })
    }
}

/// A leaf without a filter.
pub fn leaf(shape: impl Shape + 'static) -> Leaf {
    Leaf { shape: Arc::new(shape), filter: None, object: 0 }
}

/// A leaf with one.
pub fn filtered(shape: impl Shape + 'static, filter: impl HitFilter + 'static) -> Leaf {
    Leaf { filter: Some(Arc::new(filter)), ..leaf(shape) }
}

/// A geometry of one group.
pub fn one_group(leaves: Vec<Leaf>) -> Arc<Geometry> {
    let mut world = World::default();
    world.group(leaves, &[]);
    world.geometry()
}

/// Four levels: meshes, balls; rotated, mirrored, sheared and unevenly scaled. Fits in a box of about [-4, 4]^3.
pub fn nested_world() -> World {
    let mut world = World::default();
    let shear = DAffine3::from_mat3_translation(
        glam::DMat3::from_cols(DVec3::X, DVec3::new(0.5, 1.0, 0.2), DVec3::new(-0.3, 0.1, 0.8)),
        DVec3::new(0.1, 1.3, -0.2),
    );
    let mirror = DAffine3::from_mat3_translation(
        glam::DMat3::from_diagonal(DVec3::new(-0.5, 0.6, 0.4)),
        DVec3::new(-1.1, 0.2, 0.4),
    );
    let turn = |angle: f64, x: f64, y: f64, z: f64| {
        DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), angle)
            * DAffine3::from_translation(DVec3::new(x, y, z))
    };
    let inner = world.group(
        vec![
            leaf(Balls(vec![(DVec3::new(0.2, 0.1, 0.0), 0.4), (DVec3::new(-0.5, 0.3, 0.2), 0.25)])),
            leaf(bumpy_sphere(12)),
        ],
        &[],
    );
    let third =
        world.group(vec![leaf(bumpy_sphere(9))], &[(inner, mirror), (inner, turn(0.7, 1.2, 0.0, 0.4))]);
    let second = world.group(
        vec![],
        &[(third, shear), (inner, turn(2.0, 0.3, -1.5, 0.0)), (third, mirror * turn(1.0, 0.0, 0.5, 2.0))],
    );
    let balls = Balls(vec![(DVec3::new(2.0, 2.0, -1.0), 0.7)]);
    world.group(
        vec![leaf(bumpy_sphere(8)), leaf(balls)],
        &[(second, turn(-0.4, 1.5, 0.5, 0.5)), (second, shear * mirror), (third, turn(3.0, -2.0, 1.0, -1.0))],
    );
    world
}

/// The same leaves at the same places with the same paths, all placed by the root.
pub fn flattened(geometry: &Geometry) -> Arc<Geometry> {
    let mut world = World::default();
    let mut placed = Vec::new();
    geometry.for_each_path(&mut |_, l, placement| {
        let group = world.group(vec![l.clone()], &[]);
        placed.push((group, placement.map_or(DAffine3::IDENTITY, |p| p.to_render)));
        true
    });
    world.group(vec![], &placed);
    world.geometry()
}
