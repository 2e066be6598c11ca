//! Sampling of primitives as seen from a point: samples against densities, and densities against 1.

use super::{for_each_placed, is_closed};
use crate::base::shape::{LocalRay, Needs, Shape};
use crate::math::aabb::DAabb;
use crate::math::frame::Frame;
use crate::sampling::warp;
use crate::testing::TestRng;
use glam::{DVec3, Vec3};

/// Viewers around a shape, near and far, and one inside of its bounds.
fn viewers(shape: &dyn Shape) -> Vec<Vec3> {
    let b = DAabb::from(shape.bounds());
    let (c, r) = (b.center(), 0.5 * b.size().length());
    let at = |d: DVec3, k: f64| (c + d.normalize() * (k * r)).as_vec3();
    vec![
        at(DVec3::new(1.0, 0.7, -0.4), 1.3),
        at(DVec3::new(-0.2, 1.0, 0.9), 12.0),
        at(DVec3::new(0.3, 0.1, 1.0), 0.05),
    ]
}

/// A cone about the primitive that holds all of it, with some room: axis and 1 - cos; all directions where it is
/// too wide.
fn cone(shape: &dyn Shape, prim: u32, from: Vec3) -> (Vec3, f32) {
    let b = DAabb::from(shape.primitive_bounds(prim));
    let (axis, distance) = (b.center() - from.as_dvec3()).normalize_and_length();
    let sin = 0.55 * b.size().length() / distance;
    let m = if sin < 0.99 { 1.0 - (1.0 - sin * sin).sqrt() } else { 2.0 };
    (axis.as_vec3(), m as f32)
}

const ROWS: usize = 6;
const COLUMNS: usize = 8;

/// Bins of equal solid angle.
fn bin(frame: &Frame, m: f32, w: Vec3) -> usize {
    let l = frame.to_local(w);
    let row = warp::one_minus_cos(l) / m * ROWS as f32;
    let column = (l.y.atan2(l.x) / std::f32::consts::TAU + 0.5) * COLUMNS as f32;
    (row as usize).min(ROWS - 1) * COLUMNS + (column as usize).min(COLUMNS - 1)
}

/// A sum with its variance.
#[derive(Clone, Copy, Default)]
struct Sum {
    value: f64,
    squares: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        self.value += x;
        self.squares += x * x;
    }
}

/// In each bin of directions the samples, weighted by 1 / pdf, must add up to the solid angle of what is seen of the
/// primitive there, which rays spread evenly over the bins measure. So both are tested, the density's value and its
/// agreement with the samples, whatever edges the primitive has.
#[test]
fn samples_weighted_by_their_density_measure_solid_angle() {
    const N: usize = 20_000;
    for_each_placed(|name, shape| {
        // Turns and recentring go by the same code; a sheared mirror is the hard one.
        if !(name.ends_with("recentred") || name.ends_with("sheared mirror")) {
            return;
        }
        let prim = shape.primitive_count() / 2;
        for (k, from) in viewers(shape).into_iter().enumerate() {
            let mut rng = TestRng::new(k as u64);
            let (axis, m) = cone(shape, prim, from);
            let frame = Frame::from_z(axis);
            let (mut by_samples, mut by_rays) =
                ([Sum::default(); ROWS * COLUMNS], [Sum::default(); ROWS * COLUMNS]);
            let mut largest = 0f64;
            for _ in 0..N {
                if let Some(s) = shape.sample_primitive(prim, from, rng.vec2().to_array()) {
                    let weight = 1.0 / (f64::from(s.pdf) * N as f64);
                    by_samples[bin(&frame, m, s.wi)].add(weight);
                    largest = largest.max(weight);
                }
                let w = frame.to_world(warp::uniform_cone(rng.vec2(), m));
                let ray = LocalRay { o: from.as_dvec3(), d: w.as_dvec3(), tnear: 0.0, tfar: f64::INFINITY };
                if shape.intersect(&ray, prim).is_some() {
                    by_rays[bin(&frame, m, w)].add(1.0 / (f64::from(warp::uniform_cone_pdf(m)) * N as f64));
                }
            }
            // One sample more or less on either side, so that nearly empty bins have some variance.
            let ray = 1.0 / (f64::from(warp::uniform_cone_pdf(m)) * N as f64);
            for (i, (a, b)) in by_samples.iter().zip(&by_rays).enumerate() {
                let sigma = (a.squares + b.squares + largest * largest + ray * ray).sqrt();
                assert!(
                    (a.value - b.value).abs() < 5.0 * sigma,
                    "{name} from {from}, bin {i}: {} {} +- {sigma}",
                    a.value,
                    b.value
                );
            }
        }
    });
}

#[test]
fn samples_lie_on_the_primitive_and_carry_their_density() {
    let mut rng = TestRng::new(11);
    for_each_placed(|name, shape| {
        for from in viewers(shape) {
            for _ in 0..50 {
                let prim = ((rng.f64() * f64::from(shape.primitive_count())) as u32)
                    .min(shape.primitive_count() - 1);
                let Some(s) = shape.sample_primitive(prim, from, rng.vec2().to_array()) else { continue };
                let (p, size) = (s.p.as_dvec3(), f64::from(shape.bounds().max_abs()));
                assert!((s.wi.length() - 1.0).abs() < 1e-6 && (s.ng.length() - 1.0).abs() < 1e-6, "{name}");
                let along = (from.as_dvec3() + s.wi.as_dvec3() * f64::from(s.dist) - p).length();
                // wi, dist and p are rounded to f32 each on their own.
                assert!(along < 4e-7 * (f64::from(s.dist) + size), "{name}: {along}");
                let ray = LocalRay {
                    o: p - s.ng.as_dvec3() * size,
                    d: s.ng.as_dvec3(),
                    tnear: 0.0,
                    tfar: 4.0 * size,
                };
                let at = shape.refine(&ray, prim, size as f32, Needs::ALL);
                assert!((at.p - p).length() < 1e-5 * size, "{name}: {} {p}", at.p);
                assert!(at.ng.normalize().dot(s.ng.as_dvec3()) > 1.0 - 1e-5, "{name}");
                assert!(
                    (at.uv - s.uv).length() < 1e-3 || (at.uv - s.uv).length() > 0.99,
                    "{name}: {} {}",
                    at.uv,
                    s.uv
                );
                let pdf = shape.pdf_primitive(prim, from, s.wi, s.p, s.ng);
                // The point was rounded to f32: where it is seen at grazing angles the density by area feels it.
                let cos = s.wi.dot(s.ng).abs().max(1e-4);
                assert!((pdf / s.pdf - 1.0).abs() < 1e-5 + 2e-6 / cos, "{name}: {pdf} {}", s.pdf);
            }
        }
    });
}

#[test]
fn what_is_sampled_from_outside_is_seen() {
    let mut rng = TestRng::new(12);
    for_each_placed(|name, shape| {
        // Quadrics take only the side that faces the viewer.
        if !is_closed(shape) || shape.primitive_count() > 1 {
            return;
        }
        for from in &viewers(shape)[..2] {
            for _ in 0..200 {
                let s = shape.sample_primitive(0, *from, rng.vec2().to_array()).expect("seen from outside");
                assert!(s.wi.dot(s.ng) < 1e-3, "{name}: {}", s.wi.dot(s.ng));
            }
        }
    });
}
