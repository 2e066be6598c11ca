//! What the kernel promises beyond what all kernels do: the oracle's answers, whatever the tree and the instructions.

use super::Kernel;
use crate::accel::brute::Brute;
use crate::accel::tests::world::{Balls, Mesh, World, bumpy_sphere, leaf, nested_world, one_group};
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::{BuildQuality, Intersectable, KernelOptions, QueryKind};
use crate::base::mesh::TriangleMesh;
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::math::simd::Level;
use crate::testing::TestRng;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

const QUALITIES: [BuildQuality; 3] = [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best];

fn kernel(geometry: &Arc<Geometry>, quality: BuildQuality, simd: Level) -> Kernel {
    let options = KernelOptions { quality, simd: Some(simd), ..KernelOptions::default() };
    let kernel = Kernel::new(geometry.clone(), &options).expect("builds");
    kernel.validate().expect("a sound tree");
    kernel
}

/// The bits of a hit.
fn bits(h: Option<Hit>) -> Option<(u32, u32, u64)> {
    h.map(|h| (h.t.to_bits(), h.prim, h.path))
}

/// Asserts that a kernel says what `expected` says, in every form of query.
fn assert_same(kernel: &Kernel, rays: &[Ray], expected: &[Option<Hit>]) {
    let mut batch = RayBatch::default();
    rays.iter().for_each(|r| batch.push(r));
    let name = kernel.describe();
    for (ray, hit) in rays.iter().zip(expected) {
        assert_eq!(bits(kernel.intersect(ray)), bits(*hit), "{name}: {ray:?}");
        assert_eq!(kernel.occluded(ray), hit.is_some(), "{name}: {ray:?}");
    }
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
        kernel.intersect_batch(&batch, &mut hits, coherence);
        kernel.occluded_batch(&batch, &mut blocked, coherence);
        for (i, (ray, hit)) in rays.iter().zip(expected).enumerate() {
            assert_eq!(bits(hits.get(i)), bits(*hit), "{name}, {coherence:?}: {ray:?}");
            assert_eq!(blocked[i], hit.is_some(), "{name}, {coherence:?}: {ray:?}");
        }
    }
}

/// Every level of instructions and every quality of build against the oracle, to the bit.
fn assert_oracle(geometry: &Arc<Geometry>, rays: &[Ray]) {
    let brute = Brute::new(geometry.clone());
    let expected: Vec<_> = rays.iter().map(|r| brute.intersect(r)).collect();
    for level in Level::available() {
        for quality in QUALITIES {
            assert_same(&kernel(geometry, quality, level), rays, &expected);
        }
    }
}

/// Rays of all sorts at a mesh of about unit size: random, along axes, exactly at vertices and at points of edges, leaving
/// surfaces, grazing them, in bundles, and with ends.
fn mixed_rays(mesh: &TriangleMesh, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = TestRng::new(seed);
    let count = mesh.indices.len() as u64;
    (0..n as u32)
        .map(|i| {
            let [a, b, c] = mesh.corners((rng.bits() % count) as u32);
            let o = (rng.cube() * 1.5).as_vec3();
            let on_edge = a + (b - a) * rng.f32();
            let d = match i % 7 {
                0 => rng.direction(),
                1 => [Vec3::X, Vec3::NEG_Y, Vec3::Z][i as usize / 7 % 3],
                2 => a - o,
                3 => on_edge - o,
                // Along an edge, within the triangle's plane.
                4 => b - a,
                _ => ((a + b + c) / 3.0 - o) + rng.direction() * 1e-3,
            };
            let ray = Ray::new(o, d, i);
            match i % 7 {
                // From a corner, and from a point of an edge.
                4 => Ray { o: a - (b - a) * 0.5, ..ray },
                5 => Ray { o: on_edge, d: rng.direction(), ..ray },
                6 => Ray { tnear: 0.3, tfar: 1.2, ..ray },
                _ => ray,
            }
        })
        .filter(Ray::is_valid)
        .collect()
}

#[test]
fn meshes_are_the_oracles_to_the_bit() {
    let mesh = bumpy_sphere(40);
    let rays = mixed_rays(&mesh.0, 1500, 1);
    assert_oracle(&one_group(vec![leaf(mesh)]), &rays);
}

/// Several meshes and shapes in one group, so that triangles name their owners.
#[test]
fn mixed_groups_are_the_oracles_to_the_bit() {
    let mesh = bumpy_sphere(12);
    let rays = mixed_rays(&mesh.0, 700, 2);
    let balls = (0..60).map(|i| {
        let f = f64::from(i);
        (DVec3::new((f * 1.7).sin(), (f * 2.3).cos(), (f * 0.9).sin()) * 1.3, 0.02 + 0.003 * f)
    });
    let balls = Balls(balls.collect());
    assert_oracle(&one_group(vec![leaf(mesh), leaf(balls), leaf(bumpy_sphere(9))]), &rays);
}

#[test]
fn nested_groups_are_the_oracles_to_the_bit() {
    let geometry = nested_world().geometry();
    let mut rng = TestRng::new(3);
    let rays: Vec<Ray> = (0..400)
        .map(|i| {
            let o = rng.direction() * 8.0;
            Ray::new(o, rng.cube().as_vec3() * 3.0 - o, i)
        })
        .collect();
    assert_oracle(&geometry, &rays);
}

/// Far origins are moved nearer for culling, long and short directions rescaled; the answer stays the oracle's.
#[test]
fn far_origins_and_odd_lengths_are_the_oracles_to_the_bit() {
    let mesh = bumpy_sphere(20);
    let mut rays = Vec::new();
    for (i, ray) in mixed_rays(&mesh.0, 400, 4).into_iter().enumerate() {
        let far = [1.0f32, 1e3, 1e6, 1e9][i % 4];
        let length = [1.0f32, 1e-12, 1e12, 1e-3][i / 4 % 4];
        let to = (ray.o + ray.d) * 0.5;
        let o = ray.o * far;
        rays.push(Ray::new(o, (to - o).normalize_or(Vec3::X) * length, ray.key));
    }
    assert_oracle(&one_group(vec![leaf(mesh)]), &rays);
}

/// Rays from one point in narrow bundles, as cameras make them: frustums must lose nothing.
#[test]
fn bundles_are_the_oracles_to_the_bit() {
    let mesh = bumpy_sphere(60);
    let geometry = one_group(vec![leaf(mesh)]);
    let mut rng = TestRng::new(5);
    for (eye, width) in [(4.0f32, 0.02f32), (1.5, 0.3), (0.2, 0.8), (300.0, 1e-4)] {
        let mut rays = Vec::new();
        for i in 0..12u32 {
            let o = rng.direction() * eye;
            let to = rng.direction() * 0.9;
            // Bundles along axes too, where signs of directions differ within one.
            let middle = if i % 3 == 0 { -o } else { (to - o).normalize() };
            for k in 0..50 {
                rays.push(Ray::new(o, middle + rng.direction() * width, i * 64 + k));
            }
        }
        let brute = Brute::new(geometry.clone());
        let expected: Vec<_> = rays.iter().map(|r| brute.intersect(r)).collect();
        for level in Level::available() {
            assert_same(&kernel(&geometry, BuildQuality::Balanced, level), &rays, &expected);
        }
    }
}

/// No ray leaves a closed mesh through a vertex or an edge.
#[test]
fn closed_meshes_have_no_leaks() {
    let mesh = bumpy_sphere(120);
    let mut rng = TestRng::new(6);
    let mut batch = RayBatch::default();
    for i in 0..200_000u32 {
        let [a, b, _] = mesh.0.corners((rng.bits() % mesh.0.indices.len() as u64) as u32);
        let o = (rng.cube() * 0.4).as_vec3();
        let to = if i % 2 == 0 { a } else { a + (b - a) * rng.f32() };
        batch.push(&Ray::new(o, to - o, i));
    }
    let geometry = one_group(vec![leaf(mesh)]);
    for level in Level::available() {
        let kernel = kernel(&geometry, BuildQuality::Balanced, level);
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
            kernel.intersect_batch(&batch, &mut hits, coherence);
            kernel.occluded_batch(&batch, &mut blocked, coherence);
            for (i, blocked) in blocked.iter().enumerate() {
                assert!(hits.get(i).is_some() && *blocked, "a leak: {:?}", batch.get(i));
            }
        }
    }
}

/// Trees of input without any order: all triangles equal, all centers equal, all in one plane, needles.
#[test]
fn degenerate_input_makes_sound_trees() {
    let copies = |n: usize, at: fn(usize) -> [[f32; 3]; 3]| {
        let positions = (0..n).flat_map(at).collect();
        let indices = (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh(TriangleMesh::new(positions, indices))
    };
    let equal = copies(50_000, |_| [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let centered = copies(30_000, |i| {
        let s = 1.0 + (i % 1000) as f32;
        [[-s, -s, 0.0], [s, -s, 0.0], [0.0, s, 0.5]]
    });
    // Growing by a power of two each: no plane halves them.
    let growing = copies(60, |i| {
        let s = (i as f32).exp2() * 1e-9;
        [[s, 0.0, 0.0], [s * 1.5, 0.0, 0.0], [s, s, 0.0]]
    });
    for mesh in [equal, centered, growing] {
        let geometry = one_group(vec![leaf(mesh)]);
        for quality in QUALITIES {
            let kernel = kernel(&geometry, quality, Level::Portable);
            let hit = kernel.intersect(&Ray::new(Vec3::new(0.1, 0.1, 5.0), Vec3::NEG_Z, 0));
            assert!(hit.is_none_or(|h| h.t.is_finite()));
        }
    }
}

/// Deeper than any scene file may nest.
#[test]
fn three_hundred_levels_need_no_recursion() {
    let mut world = World::default();
    let mut group = world.group(vec![leaf(bumpy_sphere(6))], &[]);
    for _ in 0..300 {
        let turned = DAffine3::from_axis_angle(DVec3::Y, 0.1) * DAffine3::from_translation(DVec3::X * 1e-3);
        group = world.group(vec![], &[(group, turned)]);
    }
    let geometry = world.geometry();
    let (brute, kernel) =
        (Brute::new(geometry.clone()), kernel(&geometry, BuildQuality::Balanced, Level::Portable));
    let mut rng = TestRng::new(7);
    for i in 0..50 {
        let o = rng.direction() * 3.0;
        let ray = Ray::new(o, rng.direction() * 0.4 - o, i);
        assert_eq!(bits(kernel.intersect(&ray)), bits(brute.intersect(&ray)));
    }
}

#[test]
fn visits_are_counted() {
    let geometry = one_group(vec![leaf(bumpy_sphere(40))]);
    let kernel = kernel(&geometry, BuildQuality::Balanced, Level::Portable);
    let hit = kernel.visits(&Ray::new(Vec3::ZERO, Vec3::X, 0), QueryKind::Closest).expect("counts");
    assert!(hit.nodes >= 2 && hit.leaves >= 1 && hit.primitives >= hit.leaves, "{hit:?}");
    let miss = kernel.visits(&Ray::new(Vec3::X * 3.0, Vec3::X, 0), QueryKind::Any).expect("counts");
    assert!(miss.nodes <= 1 && miss.leaves == 0, "{miss:?}");
}
