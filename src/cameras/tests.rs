use super::{REGISTRY, UpAxis, View, frame_bounds};
use crate::base::camera::{Camera, CameraSource, FilmSamples, FilmSize};
use crate::base::ray::RayBatch;
use crate::base::registry::{Params, Value, build};
use crate::base::space::RenderSpace;
use crate::math::aabb::DAabb;
use crate::testing::TestRng;
use crate::testing::rows::{Built, built, check_rows, node};
use glam::{DVec3, Vec3};
use std::sync::Arc;

const FILM: FilmSize = FilmSize { width: 320, height: 180 };

fn rays(camera: &dyn Camera, x: &[f32], y: &[f32], lens: &[f32]) -> RayBatch {
    let mut out = RayBatch::default();
    camera.fill_rays(&FilmSamples { x, y, lens_u: lens, lens_v: lens }, &mut out);
    out
}

fn vector(v: [f64; 3]) -> Value {
    Value::Numbers(v.to_vec())
}

fn camera(params: Params, space: &RenderSpace) -> Arc<dyn Camera> {
    build("camera", REGISTRY, &node("perspective", &params))
        .expect("builds")
        .place(space, FILM)
        .expect("places")
}

#[test]
fn rows_are_sound_and_rays_valid() {
    check_rows("camera", REGISTRY);
    let mut rng = TestRng::new(1);
    for Built { label, it } in built::<dyn CameraSource>("camera", REGISTRY) {
        let space = RenderSpace { center: DVec3::new(4e6, 0.0, 0.0), scale: 0.5 };
        let camera = it.place(&space, FILM).expect("places");
        // An odd number, so that vector loops have a rest.
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for _ in 0..1003 {
            x.push(rng.f32() * 320.0);
            y.push(rng.f32() * 180.0);
        }
        let lens: Vec<f32> =
            if camera.has_lens() { x.iter().map(|x| x / 320.0).collect() } else { Vec::new() };
        let batch = rays(&*camera, &x, &y, &lens);
        assert_eq!(batch.len(), 1003);
        for i in 0..batch.len() {
            let r = batch.get(i);
            assert!(r.is_valid() && r.tnear == 0.0 && r.tfar == f32::INFINITY, "{label}: {r:?}");
            assert!((r.d.length() - 1.0).abs() < 3e-7, "{label}: {}", r.d.length());
        }
        assert!(camera.pixel_spread() > 0.0);
    }
}

#[test]
fn an_equirectangular_picture_is_the_sphere_map_of_its_surroundings() {
    let camera = build("camera", REGISTRY, &node("equirectangular", &Params::new()))
        .expect("builds")
        .place(&RenderSpace::IDENTITY, FilmSize { width: 64, height: 32 })
        .expect("places");
    for (x, y, expected) in [
        (32.0, 16.0, Vec3::X),
        (48.0, 16.0, Vec3::Z),
        (16.0, 16.0, Vec3::NEG_Z),
        (0.0, 16.0, Vec3::NEG_X),
        (5.0, 0.0, Vec3::Y),
        (40.0, 32.0, Vec3::NEG_Y),
        (40.0, 8.0, Vec3::new(0.5, 0.5f32.sqrt(), 0.5)),
    ] {
        let d = rays(&*camera, &[x], &[y], &[]).get(0).d;
        // Two functions good to 1.2e-7 each, multiplied and rounded.
        assert!((d - expected).length() < 5e-7, "{x} {y}: {d}");
    }
}

#[test]
fn perspective_rays_run_where_they_should() {
    let params = Params::new()
        .with("eye", vector([5.0, 1.0, 0.0]))
        .with("look_at", vector([0.0, 1.0, 0.0]))
        .with("fov_deg", Value::Number(60.0));
    let camera = camera(params, &RenderSpace::IDENTITY);
    let tan = 30f32.to_radians().tan();
    // Looking along -x with y up, right is -z.
    for (x, y, expected) in [
        (160.0, 90.0, Vec3::new(-1.0, 0.0, 0.0)),
        (160.0, 0.0, Vec3::new(-1.0, tan, 0.0)),
        (160.0, 180.0, Vec3::new(-1.0, -tan, 0.0)),
        (320.0, 90.0, Vec3::new(-1.0, 0.0, -tan * 320.0 / 180.0)),
    ] {
        let r = rays(&*camera, &[x], &[y], &[]).get(0);
        assert_eq!(r.o, Vec3::new(5.0, 1.0, 0.0));
        // A few f32 roundings of values up to 1.
        assert!((r.d - expected.normalize()).length() < 5e-7, "{x} {y}: {}", r.d);
    }
    assert!((camera.pixel_spread() - 2.0 * tan / 180.0).abs() < 1e-8);
}

#[test]
fn a_lens_is_sharp_at_its_focus() {
    let space = RenderSpace { center: DVec3::new(1.0, 2.0, 3.0), scale: 4.0 };
    let params = Params::new()
        .with("eye", vector([0.0, 0.0, 6.0]))
        .with("aperture", Value::Number(0.25))
        .with("focus_distance", Value::Number(2.0));
    let lens = camera(params.clone(), &space);
    assert!(lens.has_lens());
    let grid: Vec<f32> = (0..64).map(|i| (i as f32 + 0.5) / 64.0).collect();
    let batch = rays(&*lens, &[200.0; 64], &[30.0; 64], &grid);
    let focus: Vec<Vec3> = (0..64)
        .map(|i| {
            let r = batch.get(i);
            // To the plane two units (eight in render space) before the eye.
            let z = (6.0 - 2.0 - 3.0) * 4.0;
            r.o + r.d * ((z - r.o.z) / r.d.z)
        })
        .collect();
    let eye = space.point(DVec3::new(0.0, 0.0, 6.0)).as_vec3();
    let mut widest = 0f32;
    for (i, p) in focus.iter().enumerate() {
        // Coordinates of up to 12 in f32.
        assert!((*p - focus[0]).length() < 1e-5, "{p} {}", focus[0]);
        widest = widest.max((batch.get(i).o - eye).length());
    }
    // The diagonal of the square goes to the disc's rim but for the half cell at its ends.
    assert!(widest <= 1.0 && widest > 0.95, "{widest}");
}

#[test]
fn cameras_without_direction_are_errors() {
    let eye = Params::new().with("eye", vector([1.0, 2.0, 3.0]));
    let bad = [
        (eye.clone().with("look_at", vector([1.0, 2.0, 3.0])), "look_at"),
        (eye.clone().with("up", vector([1.0, 2.0, 3.0])), "up"),
        (eye.clone().with("up", vector([0.0; 3])), "up"),
        (eye.clone().with("fov_deg", Value::Number(180.0)), "fov_deg"),
        (eye.clone().with("fov_deg", Value::Number(0.0)), "fov_deg"),
        (eye.clone().with("aperture", Value::Number(-1.0)), "aperture"),
    ];
    for (params, name) in bad {
        let error = build("camera", REGISTRY, &node("perspective", &params)).err().expect("is refused");
        assert!(error.to_string().contains(&format!("`{name}`")), "{error}");
    }
    let far = build("camera", REGISTRY, &node("perspective", &eye)).expect("builds");
    assert!(far.place(&RenderSpace { center: DVec3::splat(1e20), scale: 1.0 }, FILM).is_err());
}

#[test]
fn framed_bounds_fill_the_picture_but_for_the_margin() {
    let cube = DAabb::new(DVec3::new(-3.0, 0.5, 10.0), DVec3::new(1.0, 2.0, 11.0));
    for (up, az, el) in
        [(UpAxis::Y, 30.0, 15.0), (UpAxis::Z, -120.0, 60.0), (UpAxis::Y, 0.0, 90.0), (UpAxis::Z, 0.0, 0.0)]
    {
        for film in [FILM, FilmSize { width: 100, height: 400 }] {
            let view = View { azimuth_deg: az, elevation_deg: el, fov_deg: 35.0, up };
            let node = frame_bounds(&cube, &view, film);
            let source = build("camera", REGISTRY, &node).expect("builds");
            let camera = source.place(&RenderSpace::IDENTITY, film).expect("places");
            // The film's position of a corner, from the directions of three pixels.
            let (w, h) = (film.width as f32, film.height as f32);
            let r = rays(&*camera, &[w / 2.0, w, w / 2.0], &[h / 2.0, h / 2.0, 0.0], &[]);
            let [f, right, top] = [0, 1, 2].map(|i| r.get(i).d.as_dvec3());
            let (x, y) = (right / right.dot(f) - f, top / top.dot(f) - f);
            let mut most = DVec3::ZERO;
            for c in cube.corners() {
                let d = c - r.get(0).o.as_dvec3();
                let depth = d.dot(f);
                assert!(depth > 0.0);
                let on_film = DVec3::new(
                    d.dot(x) / (depth * x.length_squared()),
                    d.dot(y) / (depth * y.length_squared()),
                    0.0,
                );
                most = most.max(on_film.abs());
            }
            // Five percent of the frame free at the tighter pair of borders, to f32.
            assert!((most.max_element() - 0.9).abs() < 1e-4, "{view:?}: {most}");
        }
    }
    // Nothing, a point, a flat thing, a broken box: a camera all the same.
    for b in [
        DAabb::EMPTY,
        DAabb::new(DVec3::ONE, DVec3::ONE),
        DAabb::new(DVec3::ZERO, DVec3::new(1.0, 0.0, 0.0)),
        DAabb::new(DVec3::ZERO, DVec3::splat(f64::INFINITY)),
    ] {
        let node = frame_bounds(&b, &View::default(), FILM);
        assert!(build("camera", REGISTRY, &node).is_ok());
    }
}

#[test]
fn a_ball_is_framed_by_itself_and_not_by_its_box() {
    let b = DAabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
    let node = super::frame(&b, &|d| d.iter().map(|d| d.length()).collect(), &View::default(), FILM);
    let at = |name: &str| DVec3::from_array(node.params.vector(name).expect("given"));
    // In the middle, and its outline, at the sine of its distance, five percent from the borders above and below.
    assert!(at("look_at").length() < 1e-12);
    let tan = 0.9 * 17.5f64.to_radians().tan();
    assert!((1.0 / at("eye").length() - tan.atan().sin()).abs() < 1e-12);
}
