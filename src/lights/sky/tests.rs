mod charts;
mod product;

use super::*;
use crate::base::image_data::{ImageData, Texels};
use crate::base::registry::{Node, Params, Value, build};
use crate::base::skybox::integrate_cells;
use crate::sampling::mis;
use crate::skyboxes::REGISTRY;
use crate::testing::rows::{Built, built};
use crate::testing::{Bins, ChiSquare, TestRng, chi_square_counts, chi_square_sphere};
use crate::testing::{integrate_rect, integrate_sphere};
use charts::{Charts, chi_square_charts};
use std::f64::consts::TAU;

const METHODS: [SkySampling; 5] = [
    SkySampling::Product,
    SkySampling::Compensated,
    SkySampling::Table,
    SkySampling::Cosine,
    SkySampling::ProductCells,
];

fn anywhere() -> Receiver {
    Receiver { p: Vec3::ZERO, ng: Vec3::ZERO, ns: Vec3::ZERO }
}

fn facing(n: Vec3) -> Receiver {
    Receiver { p: Vec3::ZERO, ng: n, ns: n }
}

fn away(wi: Vec3) -> PathEnd<'static> {
    PathEnd { wi, vertex: None }
}

fn light(sky: &Arc<dyn Skybox>, sampling: SkySampling, rotate_y_deg: f64) -> SkyLight {
    SkyLight::new(sky.clone(), &SkyOptions { intensity: 1.5, rotate_y_deg, sampling }).unwrap()
}

fn sky(kind: &str, params: Params) -> Arc<dyn Skybox> {
    build("sky", REGISTRY, &Node { kind: kind.into(), params, ..Node::default() }).unwrap()
}

fn each_sky(mut f: impl FnMut(&str, &Arc<dyn Skybox>)) {
    for Built { label, it } in built::<dyn Skybox>("sky", REGISTRY) {
        f(&label, &it);
    }
}

fn picture(w: usize, h: usize, texel: impl Fn(usize) -> f32) -> Params {
    let texels = (0..w * h).map(|i| [texel(i); 3]).collect();
    let image = ImageData { width: w, height: h, texels: Texels::F32(texels) };
    Params::new().with("path", Value::image(image))
}

#[test]
fn samples_follow_their_density() {
    let mut tests = Vec::new();
    each_sky(|what, sky| {
        for sampling in METHODS {
            tests.push((format!("{what} {sampling:?}"), sky.clone(), sampling));
        }
    });
    for (i, (what, sky, sampling)) in tests.iter().enumerate() {
        let light = light(sky, *sampling, 37.0 * i as f64);
        let at = if i % 2 == 0 { anywhere() } else { facing(Vec3::new(0.6, 0.64, -0.48)) };
        if light.sample_li(&at, [0.5; 2]).is_none() && light.in_sight(&at) <= 0.0 {
            continue;
        }
        let how = ChiSquare {
            bins: Bins { axis: Vec3::Y, rows: 8, columns: 16, ..Bins::default() },
            samples: 20_000,
            tests: tests.len() as u32,
            seed: i as u64,
        };
        // Discs are too small for these bins: what is drawn from them goes to the last, as the density says.
        let in_disc = |w: Vec3| light.discs.iter().any(|d| d.contains(w));
        let sample = |rng: &mut TestRng| {
            light.sample_li(&at, rng.vec2().to_array()).map(|s| s.wi).filter(|w| !in_disc(*w))
        };
        let pdf = |w| if in_disc(w) { 0.0 } else { light.pdf_li(&at, &away(w)) };
        match light.map {
            MapSampler::Table { .. } | MapSampler::Product(_) => {
                let charts = Charts { sky: &**sky, light: &light, at: &at };
                chi_square_charts(what, &how, &charts, sample, pdf);
            }
            _ => chi_square_sphere(what, &how, sample, pdf),
        }
    }
}

#[test]
fn discs_are_sampled_uniformly() {
    let sky = sky("daylight", Params::new());
    for sampling in METHODS {
        let light = light(&sky, sampling, 20.0);
        let disc = &light.discs[0];
        let bins = Bins { axis: disc.frame.n, cap: 1.5 * f64::from(disc.m), rows: 6, columns: 12 };
        let how = ChiSquare { bins, samples: 50_000, tests: 3, ..ChiSquare::default() };
        let at = facing(Vec3::Y);
        chi_square_sphere(
            "disc",
            &how,
            |rng| light.sample_li(&at, rng.vec2().to_array()).map(|s| s.wi),
            |w| light.pdf_li(&at, &away(w)),
        );
    }
}

#[test]
fn densities_of_samples_are_those_of_their_directions() {
    each_sky(|what, sky| {
        for sampling in METHODS {
            let light = light(sky, sampling, 200.0);
            let mut rng = TestRng::new(3);
            for i in 0..3000 {
                let at = if i % 2 == 0 { anywhere() } else { facing(rng.direction()) };
                let Some(s) = light.sample_li(&at, rng.vec2().to_array()) else { continue };
                let pdf = light.pdf_li(&at, &away(s.wi));
                assert!((pdf - s.pdf).abs() <= 1e-5 * s.pdf, "{what} {sampling:?}: {pdf} {}", s.pdf);
                assert_eq!(light.arriving(&s), light.le(&away(s.wi)), "{what}");
                assert!(s.wi.dot(at.ng) >= 0.0 && s.dist == f32::INFINITY && !s.delta);
            }
        }
    });
}

/// The integral of the density over the sphere, without the discs: cell by cell of the sky's charts, within which it is
/// constant per u and v. The table itself is not asked.
fn map_integral(light: &SkyLight, sky: &dyn Skybox) -> f64 {
    let hidden = |w: Vec3| light.discs.iter().any(|d| d.contains(w));
    let grid = sky.grid();
    let (w, h) = (grid.width as usize, grid.height as usize);
    let mut sum = 0.0;
    for i in 0..grid.cells() {
        for k in 0..4 {
            let u = ((i % w) as f64 + 0.25 + 0.5 * f64::from(k % 2)) / w as f64;
            let v = ((i / w % h) as f64 + 0.25 + 0.5 * f64::from(k / 2)) / h as f64;
            let c = ChartPoint { chart: (i / (w * h)) as u32, u, v };
            let d = sky.direction(c).as_vec3();
            if !hidden(d) {
                let pdf = f64::from(light.pdf_li(&anywhere(), &away(d)));
                sum += pdf * sky.solid_angle_density(c) / (4.0 * w as f64 * h as f64);
            }
        }
    }
    sum
}

#[test]
fn densities_integrate_to_one() {
    each_sky(|what, sky| {
        for sampling in [SkySampling::Compensated, SkySampling::Table] {
            let light = light(sky, sampling, 0.0);
            if light.in_sight(&anywhere()) <= 0.0 {
                continue;
            }
            let discs: f64 = light.discs.iter().map(|d| d.share).sum();
            let got = map_integral(&light, &**sky) + discs;
            // f32 densities, each rounded by itself; where a disc hides the map, its cells are not counted.
            let hidden = if light.discs.is_empty() { 1e-6 } else { 2e-3 };
            assert!((got - 1.0).abs() < hidden, "{what} {sampling:?}: {got}");
        }
    });
}

/// Irradiance by one sample of the cosine lobe and one of the light, joined; its mean and standard error.
fn irradiance(light: &SkyLight, n: Vec3, samples: u32) -> (f64, f64) {
    let (at, frame) = (facing(n), Frame::from_z(n));
    let mut rng = TestRng::new(11);
    let (mut sum, mut sum2) = (0.0, 0.0);
    for _ in 0..samples {
        let w = frame.to_world(warp::cosine_hemisphere(rng.vec2())).normalize();
        let weight = mis::balance(warp::cosine_hemisphere_pdf(w.dot(n)), light.pdf_li(&at, &away(w)));
        let mut e = f64::from(light.le(&away(w)).luminance() * weight) * PI;
        if let Some(s) = light.sample_li(&at, rng.vec2().to_array()) {
            let cos = s.wi.dot(n).max(0.0);
            let weight = mis::balance(s.pdf, warp::cosine_hemisphere_pdf(cos));
            e += f64::from(light.arriving(&s).luminance() * cos * weight / s.pdf);
        }
        sum += e;
        sum2 += e * e;
    }
    let mean = sum / f64::from(samples);
    (mean, ((sum2 / f64::from(samples) - mean * mean).max(0.0) / f64::from(samples)).sqrt())
}

#[test]
fn irradiance_is_unbiased_whatever_the_method() {
    each_sky(|what, sky| {
        for (k, sampling) in METHODS.into_iter().enumerate() {
            let light = light(sky, sampling, 37.0);
            let normals = [[0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [-0.48, -0.6, 0.64], [0.8, -0.6, 0.0]];
            let n = Vec3::from(normals[k % normals.len()]);
            // From the sky alone, by quadrature within each of its cells: the receiver's horizon may cut the one that
            // holds all the light. Cells of small grids are cut up, for the horizon's sake too.
            let normal = light.turn.unwrap().to_sky(n.as_dvec3());
            let mut grid = sky.grid();
            let cut = 64u32.div_ceil(grid.width.min(grid.height));
            (grid.width, grid.height) = (grid.width * cut, grid.height * cut);
            let flux = |c: ChartPoint| {
                let d = sky.direction(c);
                f64::from(sky.radiance(d.as_vec3()).luminance())
                    * d.dot(normal).max(0.0)
                    * sky.solid_angle_density(c)
            };
            let mut want: f64 = integrate_cells(grid, flux).iter().sum();
            want *= 1.5;
            for d in &light.discs {
                let omega = TAU * f64::from(d.m);
                want += f64::from(d.radiance.luminance() * d.frame.n.dot(n).max(0.0)) * omega;
            }
            let (got, error) = irradiance(&light, n, 40_000);
            // Five standard errors, and a thousandth for quadrature and f32 densities. A spike that the method may
            // miss (the cosine lobe meets one texel in a thousand samples) has no standard error to speak of.
            let spike = matches!(sampling, SkySampling::Cosine) && error > 0.02 * want;
            let tolerance = 5.0 * error + 1e-3 * want + if spike { 0.5 * want } else { 0.0 };
            assert!((got - want).abs() <= tolerance, "{what} {sampling:?}: {got} for {want} ({error})");
        }
    });
}

#[test]
fn a_constant_sky_is_left_to_bsdf_sampling_and_is_a_furnace() {
    for value in [0.0, 0.7] {
        let sky = sky("constant", Params::new().with("radiance", Value::Number(value)));
        let light = SkyLight::new(sky, &SkyOptions::default()).unwrap();
        assert!(!light.is_sampled() && light.is_black() == (value == 0.0));
        assert_eq!(light.le_everywhere(), Some(Rgb::splat(value as f32)));
        let mut rng = TestRng::new(5);
        for _ in 0..100 {
            let n = rng.direction();
            let w = rng.direction();
            assert!(light.sample_li(&facing(n), rng.vec2().to_array()).is_none());
            assert_eq!(light.pdf_li(&facing(n), &away(w)), 0.0);
            assert_eq!(light.le(&away(w)), Rgb::splat(value as f32));
            // Every sample of the cosine lobe sees the same: no noise at all.
            let (e, error) = irradiance(&light, n, 10);
            assert!((e - PI * value).abs() < 1e-6 && error < 1e-6);
        }
    }
}

#[test]
fn a_sun_of_one_texel_is_never_lost() {
    let (w, h) = (4096, 2048);
    let sun = 700 * w + 1234;
    let sky = sky("sphere", picture(w, h, |i| if i == sun { 1e6 } else { 0.1 }));
    let toward = {
        let c = ChartPoint { chart: 0, u: 1234.5 / w as f64, v: 700.5 / h as f64 };
        sky.direction(c).as_vec3()
    };
    for sampling in [SkySampling::Product, SkySampling::Compensated, SkySampling::Table] {
        let light = light(&sky, sampling, 0.0);
        let mut rng = TestRng::new(1);
        let near = |w: Vec3| (w - toward).length() < 3.0 * std::f32::consts::PI / 2048.0;
        let hits = (0..1000)
            .filter(|_| light.sample_li(&anywhere(), rng.vec2().to_array()).is_some_and(|s| near(s.wi)))
            .count();
        // It is 1e6 x 2.1e-6 sr of 0.1 x 4 pi sr + that: 62 % by luminance.
        assert!(hits > 570, "{sampling:?}: {hits}");
        // Its own texel is a cell: the bilinear filter leaves little variance.
        let (e, error) = irradiance(&light, toward, 20_000);
        assert!(error < 0.01 * e, "{e} +- {error}");
    }
}

#[test]
fn flat_maps_get_coarse_tables_and_suns_fine_ones() {
    let cells = |params: Params| {
        let sky = sky("sphere", params);
        match light(&sky, SkySampling::Table, 0.0).map {
            MapSampler::Table { grid, .. } => grid.cells(),
            _ => 0,
        }
    };
    let smooth = cells(picture(512, 256, |i| 1.0 + 0.5 * (i as f32 / 131072.0)));
    let sunny = cells(picture(512, 256, |i| if i == 30000 { 1e5 } else { 0.1 }));
    assert!(smooth <= 512 && sunny == 512 * 256, "{smooth} {sunny}");
}

#[test]
fn rotation_turns_everything_together() {
    let sky = sky("daylight", Params::new().with("sun_elevation_deg", Value::Number(20.0)));
    let toward = |light: &SkyLight| light.discs[0].frame.n;
    let at_x = toward(&light(&sky, SkySampling::Table, 0.0));
    assert!(at_x.x > 0.9 && at_x.z.abs() < 1e-6);
    // By the right-hand rule about +y, a quarter turn brings +x to -z.
    let turned = light(&sky, SkySampling::Table, 90.0);
    assert!(toward(&turned).z < -0.9);
    let beside = |n: Vec3| (n + Vec3::new(0.0, 0.06, 0.0)).normalize();
    let still = light(&sky, SkySampling::Table, 0.0);
    let (a, b) = (still.le(&away(beside(at_x))), turned.le(&away(beside(toward(&turned)))));
    assert!((a - b).map(f32::abs).max_component() < 1e-3 * a.r);
    let (a, b) = [(&still, at_x), (&turned, toward(&turned))]
        .map(|(l, n)| l.pdf_li(&anywhere(), &away(beside(n))))
        .into();
    assert!((a - b).abs() < 1e-3 * a, "{a} {b}");
}

#[test]
fn a_receiver_that_sees_no_disc_asks_for_none() {
    let sky = sky("daylight", Params::new().with("sun_elevation_deg", Value::Number(60.0)));
    for sampling in METHODS {
        let light = light(&sky, sampling, 0.0);
        let at = facing(-light.discs[0].frame.n);
        let mut rng = TestRng::new(2);
        for _ in 0..500 {
            if let Some(s) = light.sample_li(&at, rng.vec2().to_array()) {
                assert!(!light.discs[0].contains(s.wi));
            }
        }
    }
}

#[test]
fn closed_forms_with_discs() {
    let sky = sky("gradient", Params::new());
    let light = light(&sky, SkySampling::Table, 45.0);
    let n = Vec3::new(0.0, 0.6, 0.8);
    let e = light.irradiance_closed_form(Vec3::ZERO, n).unwrap();
    let want = integrate_sphere(
        |w| f64::from(light.le(&away(w.as_vec3())).luminance()) * w.dot(n.as_dvec3()).max(0.0),
        1e-6,
    );
    assert!((f64::from(e.luminance()) - want).abs() < 1e-4);
    assert!(light.at_infinity() && light.power(&Extent { center: Vec3::ZERO, radius: 2.0 }) > 0.0);
}

/// A sun of 0.02 in radius, 3 texels across: cells eight times as large would hit it by a fiftieth of their samples.
#[test]
fn a_sun_in_a_picture_has_cells_of_its_size() {
    let (w, h) = (512, 256);
    let at = |i: usize| {
        let (u, v) = (((i % w) as f64 + 0.5) / w as f64, ((i / w) as f64 + 0.5) / h as f64);
        let (phi, theta) = ((u - 0.5) * TAU, (0.5 - v) * 0.5 * TAU);
        [theta.cos() * phi.cos(), theta.sin(), theta.cos() * phi.sin()]
    };
    let sun = at(64 * w + 170);
    let is_sun = |i: usize| at(i).iter().zip(&sun).map(|(a, b)| (a - b).powi(2)).sum::<f64>() < 0.0004;
    let sky = sky("sphere", picture(w, h, |i| if is_sun(i) { 800.0 } else { 1.0 }));
    match light(&sky, SkySampling::Compensated, 0.0).map {
        MapSampler::Table { grid, .. } => assert!(grid.width >= 256, "{} x {}", grid.width, grid.height),
        _ => panic!("no table"),
    }
}

#[test]
fn methods_have_names_and_options_their_ranges() {
    for (name, sampling) in SkySampling::NAMES {
        assert_eq!(name.parse::<SkySampling>().unwrap(), sampling);
    }
    let error = "tabel".parse::<SkySampling>().unwrap_err().to_string();
    assert!(error.contains("did you mean \"table\"?") && error.contains("compensated"), "{error}");
    let sky = sky("constant", Params::new());
    for (intensity, rotate_y_deg) in [(-1.0, 0.0), (f64::NAN, 0.0), (1e300, 0.0), (1.0, f64::INFINITY)] {
        let options = SkyOptions { intensity, rotate_y_deg, ..SkyOptions::default() };
        assert!(SkyLight::new(sky.clone(), &options).is_err());
    }
}

/// What is told of a whole batch or cone is what single directions tell.
#[test]
fn discs_are_where_batches_and_cones_say() {
    let sky = sky("daylight", Params::new());
    let light = light(&sky, SkySampling::Product, 70.0);
    let [disc] = &light.discs[..] else { panic!("one sun") };
    let own = disc.sin.asin();
    let tilted = |angle: f32| disc.frame.to_world(Vec3::new(angle.sin(), 0.0, angle.cos()));
    for (angle, cone) in [(0.0, 0.01), (0.3, 0.31), (0.3, 0.28), (1.5, 1.4), (3.1, 3.2)] {
        let axis = tilted(angle);
        assert_eq!(disc.meets(axis, cone), angle < cone + own, "{angle} {cone}");
        assert_eq!(light.is_smooth(axis, cone), angle > cone + own, "{angle} {cone}");
    }
    for near in [0.0, 0.5, 0.99, 1.01, 4.0] {
        let w: Vec<Vec3> = (0..37).map(|i| tilted(if i == 20 { near * own } else { 0.4 })).collect();
        let batch: DirectionBatch = w.iter().copied().collect();
        let mut got = vec![Rgb::BLACK; w.len()];
        light.le_escaped(batch.view(), &mut got);
        for (w, got) in w.iter().zip(got) {
            assert_eq!(got, light.le(&away(*w)));
        }
        assert_eq!(light.radiance(w[20]).luminance() > 1e3 * light.radiance(w[0]).luminance(), near < 1.0);
    }
}
