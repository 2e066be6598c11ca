use super::area::AreaLight;
use super::sampler::{FixedLightSampler, NAMES, by_name};
use crate::base::hit::Hit;
use crate::base::light::{Extent, Light, LightSampler, LightSource, PathEnd, Receiver};
use crate::base::material::{BsdfEval, BsdfSample, Emitter, Material, Prepared};
use crate::base::ray::Ray;
use crate::base::registry::{Node, Params, Row, Value};
use crate::base::shape::{Needs, Shape};
use crate::base::space::RenderSpace;
use crate::base::vertex::{Origin, Vertex, local_ray};
use crate::color::Rgb;
use crate::testing::rows::{Built, built, check_rows};
use crate::testing::{TestRng, integrate_sphere, outside};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// The crate's lights, and one from outside.
fn table() -> Vec<Row<dyn LightSource>> {
    outside::registry().lights
}

const EXTENT: Extent = Extent { center: Vec3::ZERO, radius: 2.0 };

/// A lamp, without reaching into another family.
struct Lamp {
    radiance: f32,
    two_sided: bool,
}

impl Material for Lamp {
    fn prepare(&self, _: &Vertex, _: &mut Prepared) {}

    fn eval(&self, _: &Prepared, _: Vec3, _: Vec3) -> BsdfEval {
        BsdfEval::default()
    }

    fn sample(&self, _: &Prepared, _: Vec3, _: [f32; 2], _: f32) -> Option<BsdfSample> {
        None
    }

    fn albedo(&self, _: &Prepared, _: Vec3) -> Rgb {
        Rgb::BLACK
    }

    fn emission(&self, _: Vec2, cos_o: f32) -> Rgb {
        if cos_o > 0.0 || self.two_sided { Rgb::splat(self.radiance) } else { Rgb::BLACK }
    }

    fn emitter(&self) -> Option<Emitter> {
        (self.radiance > 0.0).then_some(Emitter {
            mean: Rgb::splat(self.radiance),
            two_sided: self.two_sided,
            uniform: true,
        })
    }
}

/// A vertex where a ray meets a primitive; the tests know that it does.
fn vertex(shape: &dyn Shape, ray: &Ray, prim: u32, t: f32) -> Vertex {
    let surface = shape.refine(&local_ray(ray, None), prim, t, Needs::ALL);
    let hit = Hit { t, prim, path: 0 };
    let slot = shape.material_slot(prim) as u32;
    Vertex::new(ray, &surface, None, Origin { hit, object: 0, slot, spread: 0.0 })
}

fn receiver(p: DVec3, n: DVec3) -> Receiver {
    Receiver { p: p.as_vec3(), ng: n.as_vec3(), ns: n.as_vec3() }
}

#[test]
fn rows_are_sound() {
    check_rows("light", &table());
}

/// Irradiance at `p` on a surface with normal `n` by one sample of a delta light, or by many of another; and the
/// standard error of that.
fn by_samples(light: &dyn Light, p: DVec3, n: Vec3) -> (f32, f32) {
    let mut rng = TestRng::new(2);
    let one = |u: [f32; 2]| {
        light.sample_li(&receiver(p, DVec3::ZERO), u).map_or((true, 0.0), |s| {
            assert!(s.delta == light.is_delta() && (!s.delta || s.pdf == 1.0), "{s:?}");
            (s.delta, light.arriving(&s).luminance() * n.dot(s.wi).max(0.0) / s.pdf)
        })
    };
    if let (true, e) = one([0.5; 2]) {
        return (e, 0.0);
    }
    let all: Vec<f32> = (0..4096).map(|_| one(rng.vec2().to_array()).1).collect();
    let k = all.len() as f32;
    let mean = all.iter().sum::<f32>() / k;
    let variance = all.iter().map(|e| (e - mean).powi(2)).sum::<f32>() / k;
    (mean, (variance / k).sqrt())
}

#[test]
fn lights_have_their_closed_form_in_any_space() {
    let space = RenderSpace { center: DVec3::new(10.0, -3.0, 5.0), scale: 0.02 };
    let mut rng = TestRng::new(1);
    for Built { label, it } in built("light", &table()) {
        let world = it.place(&RenderSpace::IDENTITY).expect("places");
        let render = it.place(&space).expect("places");
        let mut known = 0;
        // Half of all receivers turn away from a lamp, and for some lamps nothing is known of those.
        for _ in 0..200 {
            let (p, n) = (rng.cube() * 3.0 + DVec3::splat(0.1), rng.direction());
            let Some(closed) = world.irradiance_closed_form(p.as_vec3(), n) else { continue };
            let closed = closed.luminance();
            known += 1;
            let (a, sigma) = by_samples(&*world, p, n);
            // Six standard errors; a few f32 roundings, more where the surface is seen edge on.
            assert!(
                (a - closed).abs() <= 6.0 * sigma + 1e-4 * closed + 1e-6,
                "{label}: {a} {closed} {sigma}"
            );
            // Irradiance does not know of units.
            let b = by_samples(&*render, space.point(p), n).0;
            // Coordinates of size 0.3 in f32 for distances from 0.002 on.
            assert!((a - b).abs() <= 1e-3 * a + 1e-5, "{label}: {a} {b}");
        }
        assert!(known > 50, "{label}: the closed form is known of {known} of 200 receivers");
        assert!(world.power(&EXTENT) > 0.0);
    }
}

/// A delta light is met by no path; any other at infinity by those that could have been sampled, with that density.
#[test]
fn ends_at_infinity_know_their_density_and_radiance() {
    let at = receiver(DVec3::ZERO, DVec3::ZERO);
    let mut rng = TestRng::new(4);
    for Built { label, it } in built("light", &table()) {
        let light = it.place(&RenderSpace::IDENTITY).expect("places");
        let end = |wi: Vec3| PathEnd { wi, vertex: None };
        for _ in 0..200 {
            let Some(s) = light.sample_li(&at, rng.vec2().to_array()) else { continue };
            let (le, pdf) = (light.le(&end(s.wi)), light.pdf_li(&at, &end(s.wi)));
            match s.delta {
                true => assert!(le.is_black() && pdf == 0.0, "{label}: {le:?} {pdf}"),
                // On its rim, the rounding of a direction decides.
                false => assert!(
                    (le, pdf) == (light.arriving(&s), s.pdf) || pdf == 0.0,
                    "{label}: {le:?} {pdf} {s:?}"
                ),
            }
        }
        let total = integrate_sphere(|wi| f64::from(light.pdf_li(&at, &end(wi.as_vec3()))), 1e-3);
        // The jump at a rim, to which the quadrature closes in until it has that tolerance.
        assert!((total - if light.at_infinity() { 1.0 } else { 0.0 }).abs() < 0.02, "{label}: {total}");
    }
}

fn area_light(node: Node, radiance: f32, two_sided: bool) -> (AreaLight, Arc<dyn Shape>) {
    let source = crate::base::registry::build("shape", &outside::registry().shapes, &node).expect("builds");
    let shape = source.place(&glam::DAffine3::IDENTITY).expect("places").shape;
    let lamp: Arc<dyn Material> = Arc::new(Lamp { radiance, two_sided });
    (AreaLight::new(shape.clone(), vec![lamp]).expect("emits"), shape)
}

fn node(kind: &str, params: Params) -> Node {
    Node { kind: kind.into(), params, ..Node::default() }
}

fn numbers(v: [f64; 3]) -> Value {
    Value::Numbers(v.to_vec())
}

/// Irradiance at the origin, facing `n`, by samples; and its standard error.
fn irradiance(light: &AreaLight, n: DVec3, samples: u32) -> (f64, f64) {
    let at = receiver(DVec3::ZERO, n);
    let mut rng = TestRng::new(7);
    let (mut sum, mut sum2) = (0.0, 0.0);
    for _ in 0..samples {
        let e = light.sample_li(&at, rng.vec2().to_array()).map_or(0.0, |s| {
            f64::from(light.arriving(&s).r) * n.dot(s.wi.as_dvec3()).max(0.0) / f64::from(s.pdf)
        });
        sum += e;
        sum2 += e * e;
    }
    let k = f64::from(samples);
    let mean = sum / k;
    (mean, ((sum2 / k - mean * mean).max(0.0) / k).sqrt())
}

#[test]
fn a_sphere_light_gives_its_closed_form() {
    // Irradiance from a uniform sphere wholly above the horizon: pi L (r / d)^2 cos.
    for (center, radius) in [([0.0, 3.0, 0.0], 1.0), ([1.0, 1.0, -0.5], 0.3), ([50.0, 80.0, 3.0], 0.01)] {
        let params = Params::new().with("center", numbers(center)).with("radius", Value::Number(radius));
        let (light, _) = area_light(node("sphere", params), 2.0, false);
        let c = DVec3::from_array(center);
        let expected = 2.0 * PI * radius * radius / c.length_squared() * c.normalize().y;
        let (e, sigma) = irradiance(&light, DVec3::Y, 20_000);
        // Five standard errors, and the f32 of li and pdf.
        assert!((e - expected).abs() < 5.0 * sigma + 1e-5 * expected, "{center:?}: {e} {expected} {sigma}");
    }
}

/// Lambert's formula: irradiance at the origin of a uniform polygon of radiance 1 above the horizon.
fn lambert(corners: &[DVec3], n: DVec3) -> f64 {
    let edges = (0..corners.len()).map(|i| {
        let (a, b) = (corners[i].normalize(), corners[(i + 1) % corners.len()].normalize());
        let cross = a.cross(b);
        0.5 * cross.length().atan2(a.dot(b)) * cross.normalize().dot(n)
    });
    edges.sum::<f64>().abs()
}

#[test]
fn a_rectangle_light_gives_lamberts_formula() {
    // Near and wide; far and small (sampled by area); seen aslant.
    for (c, u, v) in [
        ([0.2, 0.4, 0.1], [2.0, 0.0, 0.0], [0.0, 0.0, 1.5]),
        ([30.0, 400.0, 10.0], [0.2, 0.0, 0.1], [0.0, 0.1, 0.3]),
        ([1.0, 1.2, 0.0], [0.4, 0.5, 0.0], [0.0, 0.3, 1.0]),
    ] {
        let params =
            Params::new().with("center", numbers(c)).with("edge_u", numbers(u)).with("edge_v", numbers(v));
        let (light, _) = area_light(node("rectangle", params), 3.0, true);
        let [c, u, v] = [c, u, v].map(|x| DVec3::from_array(x) * 0.5);
        let corners = [-u - v, u - v, u + v, v - u].map(|x| c * 2.0 + x);
        let expected = 3.0 * lambert(&corners, DVec3::Y);
        let (e, sigma) = irradiance(&light, DVec3::Y, 20_000);
        assert!((e - expected).abs() < 5.0 * sigma + 1e-5 * expected, "{c}: {e} {expected} {sigma}");
        let power = 2.0 * PI * 3.0 * 4.0 * u.cross(v).length();
        // Corners at |c| rounded to f32, for sides of about |u|.
        let tolerance = 1e-6 * (1.0 + c.length() / u.length());
        assert!((f64::from(light.power(&EXTENT)) / power - 1.0).abs() < tolerance);
    }
}

#[test]
fn one_sided_lamps_are_dark_from_behind() {
    let up = node("rectangle", Params::new().with("center", numbers([0.0, 2.0, 0.0])));
    let (light, _) = area_light(up.clone(), 1.0, false);
    assert_eq!(irradiance(&light, DVec3::Y, 100).0, 0.0);
    let (light, _) = area_light(up, 1.0, true);
    assert!(irradiance(&light, DVec3::Y, 100).0 > 0.0);
}

/// A square lamp of side 2 at the height `h` above the origin, facing it: whole, or cut into n x n squares of two
/// triangles each.
fn square_lamp(h: f64, n: usize) -> AreaLight {
    use crate::base::mesh_data::{MeshData, Positions, Repairs};
    let at = |i: usize| -1.0 + 2.0 * i as f64 / n as f64;
    let row = n as u32 + 1;
    let data = MeshData {
        positions: Positions::F64((0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), h, at(j)])).collect()),
        normals: Vec::new(),
        uvs: Vec::new(),
        indices: (0..row * row)
            .filter(|v| v % row < row - 1 && v / row < row - 1)
            .flat_map(|v| [[v, v + 1, v + row + 1], [v, v + row + 1, v + row]])
            .collect(),
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    area_light(node("mesh", Params::new().with("path", Value::Mesh(Arc::new(data)))), 1.0, false).0
}

/// A thousand emissive triangles are nearly as quiet as the lamp that they are cut from, near and far.
#[test]
fn a_lamp_in_a_thousand_pieces_is_no_noisier() {
    for h in [0.05, 0.3, 1.0, 4.0, 30.0] {
        let [(a, sigma_a), (b, sigma_b)] = [1, 23].map(|n| irradiance(&square_lamp(h, n), DVec3::Y, 50_000));
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, z]| DVec3::new(x, h, z));
        let expected = lambert(&corners, DVec3::Y);
        println!(
            "height {h}: relative sigma of one sample {:.3} whole, {:.3} in 1,058 pieces",
            sigma_a / a * 50_000f64.sqrt(),
            sigma_b / b * 50_000f64.sqrt()
        );
        for (e, sigma) in [(a, sigma_a), (b, sigma_b)] {
            assert!((e - expected).abs() < 5.0 * sigma + 1e-5 * expected, "{h}: {e} {expected} {sigma}");
        }
        // Pieces are chosen by an estimate, where the whole is sampled by its solid angle: from a fortieth of its side
        // that costs a factor of 6 at most (3.5 as measured; by area alone it would be hundreds). Further away the choice
        // knows the cosines as well, and gains.
        let [whole, pieces] = [(a, sigma_a), (b, sigma_b)].map(|(e, s)| (s / e).powi(2) * 50_000.0);
        assert!(pieces < 0.01 + if h < 0.1 { 6.0 * whole } else { 1.1 * whole }, "{h}: {pieces} {whole}");
    }
}

/// Variance and time of one sample of direct light from many lamps over a floor, by each light sampler. Prints; the
/// time is no matter of passing.
#[test]
fn many_lamps_are_chosen_well() {
    for count in [1usize, 10, 1000] {
        let mut rng = TestRng::new(count as u64);
        let lights: Vec<Arc<dyn Light>> = (0..count)
            .map(|_| {
                let p = rng.cube() * DVec3::new(10.0, 1.0, 10.0) + DVec3::new(0.0, 2.0, 0.0);
                let params = Params::new()
                    .with("position", numbers(p.to_array()))
                    .with("intensity", Value::Number(0.2 + rng.f64()));
                let row = super::REGISTRY.iter().find(|r| r.kind == "point").expect("is there");
                (row.build)(&params).expect("builds").place(&RenderSpace::IDENTITY).expect("places")
            })
            .collect();
        let extent = Extent { center: Vec3::ZERO, radius: 15.0 };
        let mut noise = Vec::new();
        for (name, _) in NAMES {
            let sampler = by_name(name, &lights, &extent).expect("known");
            let (mut relative, points) = (0.0, 64);
            let start = std::time::Instant::now();
            for k in 0..points {
                let mut rng = TestRng::new(1000 + k);
                let p = rng.cube() * DVec3::new(10.0, 0.0, 10.0);
                let at = receiver(p, DVec3::Y);
                let one =
                    |l: &dyn Light| l.irradiance_closed_form(at.p, Vec3::Y).map_or(0.0, |e| f64::from(e.g));
                let truth: f64 = lights.iter().map(|l| one(&**l)).sum();
                let (mut sum, mut squares, n) = (0.0, 0.0, 2000);
                for _ in 0..n {
                    let e = sampler
                        .sample(&at, rng.f32())
                        .map_or(0.0, |c| one(&*lights[c.light as usize]) / f64::from(c.pmf));
                    sum += e / f64::from(n);
                    squares += e * e / f64::from(n);
                }
                let variance = (squares - sum * sum).max(0.0);
                let error = 6.0 * (variance / f64::from(n)).sqrt() + 1e-5 * truth;
                // Power alone rarely finds the lamp next to the point: its own error is an estimate, then.
                assert!(
                    *name != "tree" || (sum - truth).abs() < error,
                    "{count} {name}: {sum} {truth} {error}"
                );
                relative += variance / (truth * truth) / points as f64;
            }
            let ns = start.elapsed().as_nanos() as f64 / (points * 2000) as f64;
            println!("{count} lamps by {name}: variance {relative:.3} of the square, {ns:.0} ns a sample");
            noise.push(relative);
        }
        assert!(count == 1 || noise[0] < 0.5 * noise[1], "{count} lamps: {noise:?}");
    }
}

#[test]
fn a_hit_knows_the_density_it_could_have_been_sampled_with() {
    let mut rng = TestRng::new(3);
    for row in outside::registry().shapes {
        for params in (row.samples)() {
            let (light, shape) = area_light(node(row.kind, params), 1.5, true);
            let b = shape.bounds();
            for _ in 0..100 {
                let p = b.center().as_dvec3() + rng.direction().as_dvec3() * f64::from(b.size().length());
                let at = receiver(p, DVec3::ZERO);
                let Some(s) = light.sample_li(&at, rng.vec2().to_array()) else { continue };
                let ray = Ray::new(at.p, s.wi, 0);
                let local = local_ray(&ray, None);
                // All crossings near the sampled distance; one of them is the sampled primitive.
                let near = (0..shape.primitive_count()).filter_map(|prim| {
                    let t = shape.intersect(&local, prim)? as f32;
                    let v = vertex(&*shape, &ray, prim, t);
                    ((t - s.dist).abs() < 1e-4 * s.dist).then_some(v)
                });
                let end_pdf = near.map(|v| {
                    let end = PathEnd { wi: s.wi, vertex: Some(&v) };
                    assert_eq!(light.le(&end), Rgb::splat(1.5));
                    let cos = v.wo.dot(v.ng).abs();
                    (light.pdf_li(&at, &end) / s.pdf - 1.0).abs() * cos.max(1e-3)
                });
                // The direction was rounded to f32, which moves the point by 1e-7 of its distance; the rim of the
                // thin ellipsoid bends within 1e-3 of that, so its normal turns by some 1e-4. No crossing at all:
                // a sample on a rim, which rounding made a miss.
                let best = end_pdf.fold(f32::INFINITY, f32::min);
                assert!(best < 5e-4 || best == f32::INFINITY, "{}: {best}", row.kind);
            }
        }
    }
}

#[test]
fn light_samplers_choose_every_light_by_its_pmf() {
    let lights: Vec<Arc<dyn Light>> = built("light", &table())
        .into_iter()
        .map(|b| b.it.place(&RenderSpace::IDENTITY).expect("places"))
        .collect();
    let at = receiver(DVec3::new(0.3, -0.5, 0.2), DVec3::Y);
    for (name, _) in NAMES {
        let sampler = by_name(name, &lights, &EXTENT).expect("known");
        let pmfs: Vec<f32> = (0..lights.len() as u32).map(|l| sampler.pmf(&at, l)).collect();
        // By place, one that is far from here may be rare, but none that arrives is left out.
        let least = if *name == "tree" { 1e-4 } else { 0.01 };
        let arrives = |l: usize| *name != "tree" || lights[l].sample_li(&at, [0.5; 2]).is_some();
        assert!((pmfs.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{name}: {pmfs:?}");
        assert!(pmfs.iter().enumerate().all(|(l, p)| *p > least || !arrives(l)), "{name}: {pmfs:?}");
        let (mut counts, n) = (vec![0u32; lights.len()], 100_000);
        for i in 0..n {
            let c = sampler.sample(&at, (i as f32 + 0.5) / n as f32).expect("there are lights");
            assert_eq!(c.pmf, pmfs[c.light as usize]);
            counts[c.light as usize] += 1;
        }
        // Evenly spaced numbers: off by at most one at each end of an interval.
        for (c, p) in counts.iter().zip(&pmfs) {
            assert!((f64::from(*c) - f64::from(*p) * f64::from(n)).abs() < 2.5, "{counts:?} {pmfs:?}");
        }
    }
    let none = FixedLightSampler::power(&[], &EXTENT);
    assert!(none.sample(&at, 0.5).is_none() && none.pmf(&at, 0) == 0.0);
    let error = by_name("pwoer", &lights, &EXTENT).err().expect("unknown").to_string();
    assert!(error.contains("power"), "{error}");
}
