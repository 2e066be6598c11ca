//! What only this kernel has: flattening and portals, memory.

use super::*;
use crate::accel::brute::Brute;
use crate::accel::tests::world::{Balls, World, bumpy_sphere, leaf, nested_world, one_group};
use crate::base::mesh::TriangleMesh;
use crate::testing::TestRng;
use glam::{DAffine3, DVec3, Vec3};

/// With no budget every nested group is a portal, with a small one some are: the answers are the same.
#[test]
fn portals_equal_instances() {
    let geometry = nested_world().geometry();
    let options = KernelOptions::default();
    let flat = Kernel::new(geometry.clone(), &options).expect("builds");
    let brute = Brute::new(geometry.clone());
    let mut rng = TestRng::new(1);
    for budget in [0, 5, 12] {
        let nested = Kernel::with_budget(geometry.clone(), &options, budget).expect("builds");
        assert!(nested.levels.levels.len() > 1, "portals lead to levels of their own");
        let mut batch = RayBatch::default();
        let mut differ = 0;
        for i in 0..1500 {
            let o = rng.direction() * 8.0;
            let ray = Ray::new(o, rng.cube().as_vec3() * 3.0 - o, i);
            batch.push(&ray);
            let (a, b) = (nested.intersect(&ray), flat.intersect(&ray));
            assert_eq!(a.is_some(), nested.occluded(&ray));
            if a.map(|h| (h.path, h.prim)) != b.map(|h| (h.path, h.prim)) {
                // The ray reaches the mesh in other roundings: an edge may be passed on the other side.
                differ += 1;
                continue;
            }
            // In directions of length about 8: the tolerance of the parity tests.
            assert!(a.zip(b).is_none_or(|(a, b)| (a.t - b.t).abs() < 1e-5), "{a:?} {b:?}");
        }
        assert!(differ < 6, "budget {budget}: {differ} of 1500");
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let mut hits = HitBatch::default();
            nested.intersect_batch(&batch, &mut hits, coherence);
            let same =
                |i: usize| hits.get(i).map(|h| h.path) == nested.intersect(&batch.get(i)).map(|h| h.path);
            let different = (0..batch.len()).filter(|&i| !same(i)).count();
            assert!(different < 6, "budget {budget}, {coherence:?}: {different}");
        }
        let hits = (0..200).filter(|&i| nested.intersect(&batch.get(i)).is_some());
        let wrong = hits.filter(|&i| brute.intersect(&batch.get(i)).is_none()).count();
        assert!(wrong <= 1, "{wrong}");
        nested.take_failure().expect("no failure");
    }
}

/// 64 levels, of which 20 double: a million copies in a grid. The budget holds, and rays find their way, also where
/// every level is a portal.
#[test]
fn sixty_four_levels_deep() {
    let mut world = World::default();
    let mut group = world.group(vec![leaf(bumpy_sphere(6))], &[]);
    for level in 0..63 {
        let doubling = level / 3;
        let step = 3.0 * f64::from(1 << (doubling / 2));
        let step = if doubling % 2 == 0 { DVec3::X * step } else { DVec3::Y * step };
        let placed = [(group, DAffine3::IDENTITY), (group, DAffine3::from_translation(step))];
        let doubles = level % 3 == 0 && doubling < 20;
        group = world.group(vec![], &placed[..if doubles { 2 } else { 1 }]);
    }
    let geometry = world.geometry();
    assert_eq!((geometry.depth(), geometry.root().paths), (64, 1 << 20));
    for budget in [plan::FLATTEN_BUDGET, 0] {
        let kernel =
            Kernel::with_budget(geometry.clone(), &KernelOptions::default(), budget).expect("builds");
        assert!(kernel.levels.levels.len() > 1);
        let mut paths = std::collections::HashSet::new();
        for (x, y) in [(0.0, 0.0), (3069.0, 0.0), (1500.0, 999.0), (3069.0, 3069.0)] {
            let hit =
                kernel.intersect(&Ray::new(Vec3::new(x, y, 0.0), Vec3::Z, 0)).expect("inside of a copy");
            // A pole of the sphere, in coordinates of 3,000: 2.4e-4 is one unit in the last place there.
            assert!((hit.t - 1.0).abs() < 2e-3, "{hit:?}");
            paths.insert(hit.path);
            assert!(
                !kernel.occluded(&Ray::new(Vec3::new(x + 1.5, y + 1.5, 0.0), Vec3::Z, 0)),
                "between copies"
            );
        }
        assert_eq!(paths.len(), 4);
        // 2^18 instances at less than 1 kB, and the tables.
        assert!(kernel.memory() < 300 << 20, "{}", kernel.memory());
        kernel.take_failure().expect("no failure");
    }
}

#[test]
fn memory_is_that_of_the_tree() {
    let mesh = bumpy_sphere(100);
    let triangles = mesh.0.indices.len() as u64;
    let kernel = Kernel::new(one_group(vec![leaf(mesh)]), &KernelOptions::default()).expect("builds");
    let each = kernel.memory() / triangles;
    // FACTS of the field: 66 bytes a triangle, with slack for a small mesh; the arrays (24 more) are not copied.
    assert!((30..200).contains(&each), "{each} bytes a triangle");
    assert!(kernel.describe().starts_with("embree ") && kernel.describe().ends_with(" robust"));
}

#[test]
fn groups_beyond_all_coordinates_are_refused() {
    let mut world = World::default();
    world.group(vec![leaf(Balls(vec![(DVec3::ZERO, 1e16)]))], &[]);
    assert!(Kernel::new(world.geometry(), &KernelOptions::default()).is_err());
}

/// Geometry, placements and rays of any magnitude: an assertion of Embree's would end the test process, and a loop
/// without end would hang it. What is found must be finite.
#[test]
fn any_magnitude_is_survived() {
    let mut rng = TestRng::new(9);
    let mut found = 0;
    for round in 0..300u32 {
        let tame = round.is_multiple_of(3);
        let mut power = |low: f64, high: f64| {
            let e = low + (high - low) * rng.f64();
            10f64.powf(if tame { e * 0.05 } else { e })
        };
        let size = power(-30.0, 14.0);
        let mut mesh = bumpy_sphere(5);
        let positions = mesh.0.positions().iter().map(|p| p.map(|x| (f64::from(x) * size) as f32)).collect();
        mesh.0 = TriangleMesh::new(positions, mesh.0.indices);
        let mut world = World::default();
        let ball = Balls(vec![(DVec3::X * size, size * power(-3.0, 0.0))]);
        let mut group = world.group(vec![leaf(mesh), leaf(ball)], &[]);
        for _ in 0..3 {
            let mut placed = || {
                let scale = DVec3::new(power(-20.0, 20.0), power(-20.0, 20.0), -power(-20.0, 20.0));
                let turn = DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), power(-3.0, 1.0));
                let by = DAffine3::from_translation(DVec3::new(power(-20.0, 14.0), 0.0, -power(-20.0, 14.0)));
                (group, by * turn * DAffine3::from_scale(scale))
            };
            let children = [placed(), placed()];
            group = world.group(vec![], &children);
        }
        let options = KernelOptions {
            mode: [KernelMode::Robust, KernelMode::Fast][round as usize % 2],
            ..Default::default()
        };
        // Groups larger than coordinates may be are refused.
        let Ok(kernel) = Kernel::with_budget(world.geometry(), &options, [0, 3, 1000][round as usize % 3])
        else {
            continue;
        };
        let mut batch = RayBatch::default();
        for i in 0..60 {
            let length = power(-18.0, 18.0) as f32;
            let (o, far) = (power(-20.0, 15.0) as f32, power(-20.0, 38.0) as f32);
            let o = rng_direction(i) * o;
            let d = (Vec3::splat(power(-20.0, 14.0) as f32) * rng_direction(i + 7) - o).normalize_or(Vec3::X)
                * length;
            batch.push(&Ray { o, d, tnear: far * 1e-3, tfar: far, key: i });
        }
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
            kernel.intersect_batch(&batch, &mut hits, coherence);
            kernel.occluded_batch(&batch, &mut blocked, coherence);
            for i in 0..batch.len() {
                let single = kernel.intersect(&batch.get(i));
                kernel.occluded(&batch.get(i));
                for hit in [single, hits.get(i)].into_iter().flatten() {
                    assert!(hit.t.is_finite() && hit.path < kernel.geometry.root().paths, "{hit:?}");
                    found += 1;
                }
            }
        }
        kernel.take_failure().expect("no failure");
    }
    assert!(found > 100, "some of it must be hit: {found}");
}

fn rng_direction(i: u32) -> Vec3 {
    TestRng::new(u64::from(i)).direction()
}
