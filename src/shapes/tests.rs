//! Every row of the registry, by its own sample parameters, through the promises of [`Shape`].

mod batch;
mod sampling;

use super::REGISTRY;
use crate::base::shape::{LocalRay, Needs, Shape, ShapeSource};
use crate::math::aabb::{Aabb, DAabb};
use crate::testing::rows::{Built, built, check_rows};
use crate::testing::{TestRng, outside};
use glam::{DAffine3, DMat3, DQuat, DVec3};

fn point_in(rng: &mut TestRng, b: &DAabb) -> DVec3 {
    b.min + b.size() * (rng.cube() * 0.5 + DVec3::splat(0.5))
}

fn sources() -> Vec<Built<dyn ShapeSource>> {
    built("shape", &outside::registry().shapes)
}

/// Placements: where it is but recentred, turned and scaled, mirrored, sheared.
fn placements(bounds: &DAabb) -> Vec<(&'static str, DAffine3)> {
    let middle = DAffine3::from_translation(-bounds.center());
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.4, -0.7, 1.1)));
    let with = |m: DMat3, t: DVec3| DAffine3 { matrix3: m, translation: t } * middle;
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.3, 0.0), DVec3::new(-0.2, 0.7, 0.5), DVec3::new(0.1, 0.0, 2.0));
    vec![
        ("recentred", middle),
        ("rigid", with(turn * 0.37, DVec3::new(0.5, -0.25, 3.0))),
        ("mirrored", with(turn * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), DVec3::X)),
        ("sheared", with(turn * shear, DVec3::new(-2.0, 0.125, 0.0))),
        ("sheared mirror", with(-shear, DVec3::Y)),
    ]
}

fn for_each_placed(mut check: impl FnMut(&str, &dyn Shape)) {
    for Built { label: name, it: source } in sources() {
        for (how, to_group) in placements(&source.bounds()) {
            let placed = source.clone().place(&to_group).expect("samples can be placed");
            assert_eq!(placed.dropped.total(), 0, "{name}: samples are clean");
            let shape = placed.shape;
            let outer = source.bounds().transformed(&to_group);
            // The f64 box, rounded outwards, holds the f32 one up to the rounding of corners.
            let slack = outer.to_f32().max_abs() * 4.0 * f32::EPSILON;
            assert!(outer.to_f32().padded(slack).contains_box(&shape.bounds()), "{name} {how}");
            check(&format!("{name} {how}"), &*shape);
        }
    }
}

/// Rays that start anywhere around the shape and aim at some point of it, inside and outside.
pub(super) fn ray_at(s: &mut TestRng, b: &Aabb) -> LocalRay {
    let b = DAabb::from(*b);
    let radius = 0.5 * b.size().length();
    let target = point_in(s, &b);
    let o = b.center() + s.direction().as_dvec3() * radius * (0.2 + 4.0 * s.f64());
    // f32 rays, as kernels have them, and of any length.
    let o = o.as_vec3().as_dvec3();
    let d = ((target - o) * (0.1 + s.f64())).as_vec3().as_dvec3();
    LocalRay { o, d, tnear: 0.0, tfar: f64::INFINITY }
}

/// The closest hit by the loop over all primitives.
pub(super) fn closest(shape: &dyn Shape, ray: &LocalRay) -> Option<(u32, f64)> {
    let hits = (0..shape.primitive_count()).filter_map(|p| Some((p, shape.intersect(ray, p)?)));
    hits.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether it has no border, so that outside and inside mean something: every line crosses it an even number of times.
fn is_closed(shape: &dyn Shape) -> bool {
    let size = DAabb::from(shape.bounds()).size().length();
    let mut s = TestRng::new(8);
    (0..50).all(|_| {
        let mut ray = ray_at(&mut s, &shape.bounds());
        ray.o -= ray.d * (100.0 * size / ray.d.length());
        let crossings = (0..shape.primitive_count()).map(|prim| {
            let (mut ray, mut count) = (ray, 0);
            while let Some(t) = shape.intersect(&ray, prim) {
                count += 1;
                ray.tnear = t + 1e-9 * size / ray.d.length();
            }
            count
        });
        crossings.sum::<u32>() % 2 == 0
    })
}

#[test]
fn rows_are_sound() {
    check_rows("shape", &outside::registry().shapes);
}

#[test]
fn refine_agrees_with_intersect_and_lies_inside_the_bounds() {
    let mut s = TestRng::new(1);
    for_each_placed(|name, shape| {
        let mut hits = 0;
        for _ in 0..400 {
            let ray = ray_at(&mut s, &shape.bounds());
            let Some((prim, t)) = closest(shape, &ray) else { continue };
            hits += 1;
            let at = shape.refine(&ray, prim, t as f32, Needs::ALL);
            let size = (ray.o - at.p).length() + f64::from(shape.bounds().max_abs());
            // Both in f64 from the same f32 data; grazing crossings magnify roundings.
            assert!((at.t - t).abs() * ray.d.length() < 1e-9 * size, "{name}: {} {t}", at.t);
            assert!((ray.o + ray.d * at.t - at.p).length() < 1e-9 * size, "{name}");
            let bounds = DAabb::from(shape.primitive_bounds(prim));
            assert!(bounds.padded(1e-12 * size).contains(at.p), "{name}: {at:?} {bounds:?}");
            assert!(shape.bounds().contains_box(&shape.primitive_bounds(prim)), "{name}");
            assert!(at.ng.is_finite() && at.ng != DVec3::ZERO && at.ns.dot(at.ng) >= 0.0, "{name}");
            assert!(at.uv.is_finite() && at.dpdu.is_finite() && at.dpdv.is_finite(), "{name}");
            assert!(at.lift.is_finite() && at.lift.dot(at.ng) >= 0.0, "{name}");
            assert!(at.error.is_finite() && at.error.cmpge(DVec3::ZERO).all(), "{name}");
        }
        assert!(hits > 30, "{name}: rays aim at it, yet only {hits} hit");
    });
}

#[test]
fn outward_is_outward_under_every_placement() {
    // The first crossing from far outside meets the outer side.
    let mut s = TestRng::new(2);
    for_each_placed(|name, shape| {
        for _ in 0..if is_closed(shape) { 200 } else { 0 } {
            let mut ray = ray_at(&mut s, &shape.bounds());
            ray.o -= ray.d * (100.0 * DAabb::from(shape.bounds()).size().length() / ray.d.length());
            let Some((prim, t)) = closest(shape, &ray) else { continue };
            let at = shape.refine(&ray, prim, t as f32, Needs::default());
            assert!(at.ng.dot(ray.d) < 0.0, "{name}");
        }
    });
}

#[test]
fn placing_equals_transforming_rays() {
    let mut s = TestRng::new(3);
    for Built { label: name, it: source } in sources() {
        let center = DAffine3::from_translation(-source.bounds().center());
        let base = source.clone().place(&center).expect("places").shape;
        for (how, to_group) in placements(&source.bounds()) {
            let again = base.transformed(&(to_group * center.inverse())).expect("transforms");
            let back = center * to_group.inverse();
            for _ in 0..200 {
                let ray = ray_at(&mut s, &again.bounds());
                let Some((prim, t)) = closest(&*again, &ray) else { continue };
                let local =
                    LocalRay { o: back.transform_point3(ray.o), d: back.transform_vector3(ray.d), ..ray };
                // The corners were rounded to f32 after the transform: crossings near a rim may differ.
                let Some((_, other)) = closest(&*base, &local) else { continue };
                let size = (ray.d.length() * t).abs() + f64::from(again.bounds().max_abs());
                let at = again.refine(&ray, prim, t as f32, Needs::default());
                let cos = (at.ng.normalize().dot(ray.d.normalize())).abs();
                let tolerance = 1e-6 * size / cos.max(1e-3);
                if (other - t).abs() * ray.d.length() > tolerance {
                    // Another crossing altogether: allowed only where the ray grazes an edge of its own triangle.
                    assert!(cos < 0.05 || shape_edge(&*again, &ray, prim), "{name} {how}: {t} {other} {cos}");
                }
            }
        }
    }
}

/// Whether the ray passes so close to the border of its primitive that rounding decides.
fn shape_edge(shape: &dyn Shape, ray: &LocalRay, prim: u32) -> bool {
    let Some(mesh) = shape.triangles() else { return false };
    let v = mesh.corners(prim).map(|c| c.as_dvec3());
    let d = ray.d.normalize();
    let across = |p: DVec3| p - d * d.dot(p);
    (0..3).any(|k| {
        let (a, e) = (across(v[k] - ray.o), across(v[(k + 1) % 3] - v[k]));
        a.cross(e).length() / e.length() < 1e-5
    })
}

#[test]
fn areas_agree_with_cauchys_formula() {
    // The mean number of crossings of uniform lines with a surface is proportional to its area: for lines
    // through a ball of radius R, crossings per line = area / (2 pi R^2) (Cauchy-Crofton).
    for_each_placed(|name, shape| {
        let b = DAabb::from(shape.bounds());
        let radius = 0.5 * b.size().length();
        let mut s = TestRng::new(4);
        let (mut crossings, n) = (0u32, 4000);
        for _ in 0..n {
            let d = s.direction().as_dvec3();
            let x = d.any_orthonormal_vector();
            let (r, phi) = (radius * s.f64().sqrt(), std::f64::consts::TAU * s.f64());
            let o = b.center() + (x * phi.cos() + d.cross(x) * phi.sin()) * r - d * 3.0 * radius;
            let mut ray = LocalRay { o, d, tnear: 0.0, tfar: f64::INFINITY };
            for prim in 0..shape.primitive_count() {
                ray.tnear = 0.0;
                while let Some(t) = shape.intersect(&ray, prim) {
                    crossings += 1;
                    ray.tnear = t + 1e-9 * radius;
                }
            }
        }
        let area: f64 = (0..shape.primitive_count()).map(|p| shape.primitive_area(p)).sum();
        let expected = area / (2.0 * std::f64::consts::PI * radius * radius);
        // Crossings come in pairs: variance at most 2 per line times the expectation; five sigma.
        let sigma = (2.0 * expected / f64::from(n)).sqrt();
        let got = f64::from(crossings) / f64::from(n);
        assert!((got - expected).abs() < 5.0 * sigma, "{name}: {got} {expected}");
    });
}

#[test]
fn unit_sphere_from_far_away_is_hit_where_it_should_be() {
    let row = REGISTRY.iter().find(|r| r.kind == "sphere").expect("registered");
    let sphere =
        (row.build)(&Default::default()).expect("builds").place(&DAffine3::IDENTITY).expect("places");
    let mut s = TestRng::new(5);
    for _ in 0..20_000 {
        let o = (s.direction().as_dvec3() * 1e5).as_vec3().as_dvec3();
        // Around the rim, where the textbook quadratic in f32 is wrong for a third of rays.
        let side = o.cross(s.direction().as_dvec3()).normalize() * (0.9 + 0.2 * s.f64());
        let d = (side - o).as_vec3().normalize().as_dvec3();
        let miss = o.cross(d).length() / d.length();
        let ray = LocalRay { o, d, tnear: 0.0, tfar: f64::INFINITY };
        let hit = sphere.shape.intersect(&ray, 0);
        // f64 knows the distance of the line from the centre to 1e5 times its epsilon.
        if (miss - 1.0).abs() > 1e-10 {
            assert_eq!(hit.is_some(), miss < 1.0);
        }
        if let Some(t) = hit {
            let at = sphere.shape.refine(&ray, 0, t as f32, Needs::default());
            // Reprojected: a few f64 roundings; 1.6e-7 once it is rounded to f32.
            assert!((at.p.length() - 1.0).abs() < 1e-14);
            assert!((at.p.as_vec3().length() - 1.0).abs() < 1.6e-7);
        }
    }
}

#[test]
fn transforms_that_flatten_are_errors() {
    for Built { label: name, it: source } in sources() {
        for bad in [DVec3::new(1.0, 0.0, 1.0), DVec3::new(f64::NAN, 1.0, 1.0), DVec3::splat(f64::INFINITY)] {
            assert!(source.clone().place(&DAffine3::from_scale(bad)).is_err(), "{name} {bad}");
        }
        let shape = source.clone().place(&DAffine3::IDENTITY).expect("places").shape;
        assert!(shape.transformed(&DAffine3::from_scale(DVec3::ZERO)).is_err(), "{name}");
        assert!(!source.describe().is_empty() && shape.memory() > 0 && !shape.describe().is_empty());
    }
}

#[test]
fn support_touches_what_can_be_hit() {
    let mut rng = TestRng::new(9);
    for Built { label, it } in sources() {
        let directions: Vec<DVec3> = (0..4).map(|_| rng.direction().as_dvec3() * 3.0).collect();
        let support = it.support(&directions);
        let (bounds, center) = (it.bounds(), it.bounds().center());
        let shape = it.place(&DAffine3::from_translation(-center)).expect("places").shape;
        let size = bounds.size().length();
        for (d, s) in directions.iter().zip(support) {
            let by_bounds = bounds.corners().iter().map(|c| c.dot(*d)).fold(f64::NEG_INFINITY, f64::max);
            assert!(s <= by_bounds + 1e-9 * size, "{label}");
            // The furthest of many points hit comes close to it and never beyond.
            let mut furthest = f64::NEG_INFINITY;
            for _ in 0..300 {
                let ray = ray_at(&mut rng, &shape.bounds());
                if let Some((prim, t)) = closest(&*shape, &ray) {
                    let p = shape.refine(&ray, prim, t as f32, Needs::default()).p + center;
                    furthest = furthest.max(p.dot(*d));
                }
            }
            // f32 rounding of corners, three lengths of d.
            assert!(furthest < s + 1e-6 * size, "{label}: {furthest} {s}");
            assert!(furthest > s - 1.2 * size, "{label}: {furthest} {s}");
        }
    }
}
