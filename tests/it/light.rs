//! Whole renders against closed forms and against themselves: energy, multiple importance sampling, determinism.

use crate::common::{assert_mean, integrator, mean, render, scene, settings};
use skylit::render::settings::RenderSettings;
use skylit::render::{Renderer, Silent};
use std::f64::consts::PI;

/// Six standard errors: a false alarm in 5e8 comparisons.
const SIGMAS: f64 = 6.0;

/// A camera that sees nothing but the sphere's middle.
fn ball(sky: &str, material: &str) -> String {
    format!(
        r#"
[film]
size = [32, 32]
[camera]
type = "perspective"
eye = [0, 0, 3]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_deg = 10
[sky]
{sky}
[materials.m]
{material}
[[objects]]
shape = {{ type = "sphere", center = [0, 0, 0], radius = 1.0 }}
material = "m"
"#
    )
}

#[test]
fn a_convex_body_under_a_constant_sky_shows_its_albedo() {
    let s = scene(&ball("type = \"constant\"\nradiance = [1, 1, 1]", "type = \"diffuse\"\nalbedo = 0.7"));
    for (kind, params) in [("path", &[("max_depth", 8.0)][..]), ("direct", &[])] {
        let r = render(&s, integrator(kind, params), 64);
        // Every path is 0.7 times 1, whatever its direction: what is left is the rounding of a few products.
        assert_mean(kind, &mean(&r), 0.7, 0.0, 2e-6);
    }
}

/// A floor in a plane of a coordinate 0 has no rounding of its own to be moved off by: products that underflow must not
/// make it shade itself. Small squares, so that they would.
#[test]
fn a_small_floor_at_zero_does_not_shade_itself() {
    for scale in [1.0, 1e-3, 1e-9] {
        for (eye, up, u, v) in [
            ([0.0, 2.0, 0.0], "0, 0, 1", "0, 0, 0.5", "0.5, 0, 0"),
            ([2.0, 0.0, 0.0], "0, 0, 1", "0, 0.5, 0", "0, 0, 0.5"),
            ([0.0, 0.0, -2.0], "0, 1, 0", "0, 0.5, 0", "0.5, 0, 0"),
        ] {
            // In a group, and beside another square that all sides turn away from, so that no recentring or scaling hides it.
            let s = scene(&format!(
                r#"
[film]
size = [8, 8]
[camera]
type = "perspective"
eye = {:?}
look_at = [0, 0, 0]
up = [{up}]
fov_deg = 4
[sky]
type = "constant"
[materials.m]
type = "diffuse"
albedo = 0.6
[groups.floor]
objects = [{{ shape = {{ type = "rectangle", edge_u = [{u}], edge_v = [{v}] }}, material = "m", transform = [{{ scale = {scale} }}] }}]
[[objects]]
group = "floor"
[[objects]]
shape = {{ type = "rectangle", center = [-5, -5, 5] }}
"#,
                eye.map(|x| x * scale)
            ));
            let m = mean(&render(&s, integrator("direct", &[]), 64));
            assert_mean(&format!("{eye:?} at {scale}"), &m, 0.6, 0.0, 2e-6);
        }
    }
}

/// Radiance grows with the height of the direction, so the irradiance of a slope is a short integral: of a constant
/// pi, of (n.w)+ (y)+ 2 pi / 3 where n is y, 2 / 3 where it is level, 0 where it is -y.
#[test]
fn slopes_under_a_gradient_sky_have_their_closed_form() {
    let [zenith, horizon, ground] = [2.0, 0.7, 0.1];
    let irradiance =
        |above: f64, below: f64| PI * horizon + (zenith - horizon) * above + (ground - horizon) * below;
    for (eye, up, u, v, expected) in [
        ("0, 2, 0", "0, 0, 1", "0, 0, 1", "1, 0, 0", irradiance(2.0 * PI / 3.0, 0.0)),
        ("0, -2, 0", "0, 0, 1", "0, 0, 1", "1, 0, 0", irradiance(0.0, 2.0 * PI / 3.0)),
        ("2, 0, 0", "0, 1, 0", "0, 1, 0", "0, 0, 1", irradiance(2.0 / 3.0, 2.0 / 3.0)),
    ] {
        let s = scene(&format!(
            r#"
[film]
size = [16, 16]
[camera]
type = "perspective"
eye = [{eye}]
look_at = [0, 0, 0]
up = [{up}]
fov_deg = 4
[sky]
type = "gradient"
zenith = {zenith}
horizon = {horizon}
ground = {ground}
[materials.m]
type = "diffuse"
albedo = 0.6
[[objects]]
shape = {{ type = "rectangle", edge_u = [{u}], edge_v = [{v}] }}
material = "m"
"#
        ));
        for light_sampling in [0.0, 1.0] {
            let m = mean(&render(&s, integrator("direct", &[("light_sampling", light_sampling)]), 256));
            assert!(m.error < 1e-3, "{eye}: {}", m.error);
            assert_mean(eye, &m, 0.6 / PI * expected, SIGMAS, 1e-5);
        }
    }
}

/// Of every material with no loss, under the same light from everywhere: it cannot be told from the sky.
#[test]
fn white_materials_vanish_in_a_furnace() {
    for (material, tolerance) in [
        ("type = \"diffuse\"\nalbedo = 1.0", 2e-6),
        ("type = \"mirror\"\nreflectance = 1.0", 2e-6),
        // Light between facets is added back by a table of finite size.
        ("type = \"metal\"\ncolor = 1.0\nroughness = 0.2", 0.01),
        ("type = \"metal\"\ncolor = 1.0\nroughness = 0.7", 0.01),
        ("type = \"metal\"\ncolor = 1.0\nroughness = 1.0", 0.01),
        ("type = \"emissive\"\nradiance = 0.4\nalbedo = 0.6", 2e-6),
    ] {
        let s = scene(&ball("type = \"constant\"", material));
        let m = mean(&render(&s, integrator("path", &[]), 64));
        assert_mean(material, &m, 1.0, SIGMAS, tolerance);
    }
}

/// A closed room that emits and scatters: every point shines with e / (1 - a), the sum of all its echoes.
#[test]
fn a_closed_glowing_room_shines_as_the_geometric_series_says() {
    let (e, a) = (0.5, 0.6);
    let s = scene(&format!(
        r#"
[film]
size = [16, 16]
[camera]
type = "perspective"
eye = [0.2, 0.1, 0.3]
look_at = [1, 0, 0]
up = [0, 1, 0]
fov_deg = 60
[materials.m]
type = "emissive"
radiance = {e}
albedo = {a}
two_sided = true
[[objects]]
shape = {{ type = "sphere", center = [0, 0, 0], radius = 1.0 }}
material = "m"
"#
    ));
    let r = render(&s, integrator("path", &[("max_depth", 200.0), ("roulette_depth", 8.0)]), 256);
    assert_mean("e / (1 - a)", &mean(&r), e / (1.0 - a), SIGMAS, 1e-5);
}

/// Light sampling and scattering alone must agree wherever both can find the light.
#[test]
fn multiple_importance_sampling_changes_no_mean() {
    let skies = ["type = \"gradient\"", "type = \"midday\"", "type = \"sunset\"", "type = \"night\""];
    let materials = [
        "type = \"diffuse\"\nalbedo = [0.7, 0.5, 0.3]",
        "type = \"metal\"\ncolor = [0.9, 0.8, 0.7]\nroughness = 0.5",
    ];
    for sky in skies {
        for material in materials {
            // The sun's disc is found by scattering once in 70,000 rays: compare without it.
            let sky = if sky.contains("midday") || sky.contains("sunset") {
                format!("{sky}\nsun = false")
            } else {
                sky.to_owned()
            };
            let s = scene(&ball(&sky, material));
            let on = mean(&render(&s, integrator("direct", &[]), 256));
            let off = mean(&render(&s, integrator("direct", &[("light_sampling", 0.0)]), 1024));
            let error = (on.error.powi(2) + off.error.powi(2)).sqrt();
            let allowed = SIGMAS * error + 1e-5 * off.value.abs();
            assert!(
                (on.value - off.value).abs() <= allowed,
                "{sky} on {material}: {} +- {} against {} +- {}",
                on.value,
                on.error,
                off.value,
                off.error
            );
        }
    }
}

/// Irradiance from a spherical lamp straight above is pi L (r / d)^2; the floor shows albedo / pi of it.
#[test]
fn a_spherical_lamp_lights_a_floor_by_the_inverse_square() {
    let s = scene(
        r#"
[film]
size = [8, 8]
[camera]
type = "perspective"
eye = [0, 0.5, 0]
look_at = [0, 0, 0]
up = [0, 0, 1]
fov_deg = 0.5
[materials.floor]
type = "diffuse"
albedo = 0.5
[materials.lamp]
type = "emissive"
radiance = 10.0
[[objects]]
shape = { type = "rectangle", center = [0, 0, 0], edge_u = [0, 0, 2], edge_v = [2, 0, 0] }
material = "floor"
[[objects]]
shape = { type = "sphere", center = [0, 3, 0], radius = 0.5 }
material = "lamp"
"#,
    );
    let expected = 0.5 * 10.0 * (0.5f64 / 3.0).powi(2);
    for kind in ["direct", "path"] {
        let m = mean(&render(&s, integrator(kind, &[]), 64));
        // The patch seen is 0.004 wide: cosines across it vary by 1e-6.
        assert_mean(kind, &m, expected, SIGMAS, 5e-5 * expected);
    }
}

/// A glowing mesh placed by three instances, squeezed, turned and mirrored, and the same three written out: light
/// samples find the same light, by each way of choosing between lamps.
#[test]
fn glowing_instances_shine_as_their_flattened_twins() {
    let head = |sampler: &str| {
        format!(
            r#"
[film]
size = [24, 24]
[camera]
type = "perspective"
eye = [0, 3, 0]
look_at = [0, 0, 0]
up = [0, 0, 1]
fov_deg = 40
[render]
light_sampler = "{sampler}"
[materials.floor]
type = "diffuse"
albedo = 0.6
[materials.lamp]
type = "emissive"
radiance = [5, 4, 2]
[[objects]]
shape = {{ type = "rectangle", edge_u = [0, 0, 4], edge_v = [4, 0, 0] }}
material = "floor"
"#
        )
    };
    let ball = r#"shape = { type = "displaced_sphere", triangles = 1000, seed = 3 }, material = "lamp""#;
    let places = [
        "{ scale = [0.2, 0.1, 0.3] }, { rotate_deg = 30, axis = [0, 0, 1] }, { translate = [0.6, 0.5, 0.2] }",
        "{ scale = [-0.2, 0.2, 0.2] }, { translate = [-0.7, 0.8, -0.5] }",
        "{ scale = 0.1 }, { rotate_deg = 70, axis = [1, 2, 0] }, { translate = [0, 0.2, 0.7] }",
    ];
    let instanced = |sampler| {
        let objects = places.map(|t| format!("[[objects]]\ngroup = \"lamp\"\ntransform = [{t}]\n"));
        format!("{}[groups.lamp]\nobjects = [{{ {ball} }}]\n{}", head(sampler), objects.concat())
    };
    let flat = places
        .map(|t| format!("[[objects]]\n{}\ntransform = [{t}]\n", ball.replace(", material", "\nmaterial")));
    let truth = scene(&format!("{}{}", head("power"), flat.concat()));
    assert_eq!(truth.report.groups, 1, "the twin has no instance");
    let truth = mean(&render(&truth, integrator("direct", &[]), 256));
    for sampler in ["tree", "power", "uniform"] {
        let s = scene(&instanced(sampler));
        assert_eq!((s.report.groups, s.lights.list.len()), (2, 3), "{sampler}");
        for light_sampling in [1.0, 0.0] {
            let m = mean(&render(&s, integrator("direct", &[("light_sampling", light_sampling)]), 256));
            let error = m.error.hypot(truth.error);
            let z = (m.value - truth.value).abs() / error;
            assert!(
                z < SIGMAS && error < 0.02 * truth.value,
                "{sampler}: {} {} {error}",
                m.value,
                truth.value
            );
        }
    }
}

#[test]
fn a_point_light_obeys_the_inverse_square() {
    let s = scene(
        r#"
[film]
size = [8, 8]
[camera]
type = "perspective"
eye = [0, 0.5, 0]
look_at = [0, 0, 0]
up = [0, 0, 1]
fov_deg = 0.5
[materials.floor]
type = "diffuse"
albedo = 0.5
[[objects]]
shape = { type = "rectangle", center = [0, 0, 0], edge_u = [0, 0, 2], edge_v = [2, 0, 0] }
material = "floor"
[[lights]]
type = "point"
position = [0, 2, 0]
intensity = [8, 8, 8]
"#,
    );
    let m = mean(&render(&s, integrator("path", &[]), 16));
    let expected = 0.5 / PI * 8.0 / 4.0;
    assert_mean("point light", &m, expected, SIGMAS, 5e-5 * expected);
}

const PARTS: &str = r#"
[film]
size = [48, 36]
[camera]
type = "perspective"
eye = [4, 3, 5]
look_at = [0, 0.5, 0]
up = [0, 1, 0]
fov_deg = 40
[sky]
type = "sunset"
[materials.clay]
type = "diffuse"
albedo = [0.7, 0.6, 0.5]
[materials.gold]
type = "metal"
color = [1.0, 0.8, 0.3]
roughness = 0.3
[[objects]]
shape = { type = "sphere", center = [0, 1, 0], radius = 1.0 }
material = "gold"
[[objects]]
shape = { type = "displaced_sphere", triangles = 2000, seed = 3 }
material = "clay"
transform = [{ scale = 0.8 }, { translate = [1.8, 0.8, 0.6] }]
[[objects]]
shape = { type = "box", min = [-3, -0.2, -3], max = [3, 0, 3] }
material = "clay"
"#;

#[test]
fn threads_change_no_bit() {
    let s = scene(PARTS);
    let films: Vec<_> = [1, 2, 7]
        .into_iter()
        .map(|threads| {
            let settings = RenderSettings { spp: 10, threads, seed: 9, ..settings(&s) };
            Renderer { integrator: integrator("path", &[]), settings }.render(&s, &Silent).unwrap().film
        })
        .collect();
    assert!(films[0] == films[1] && films[1] == films[2]);
}

#[test]
fn a_seed_changes_the_noise_and_nothing_else() {
    let s = scene(PARTS);
    let means: Vec<_> = [1, 2]
        .into_iter()
        .map(|seed| {
            let settings = RenderSettings { spp: 64, threads: 2, seed, ..settings(&s) };
            let r = Renderer { integrator: integrator("path", &[]), settings }.render(&s, &Silent).unwrap();
            (mean(&r), r.film)
        })
        .collect();
    assert!(means[0].1 != means[1].1);
    let error = (means[0].0.error.powi(2) + means[1].0.error.powi(2)).sqrt();
    assert!((means[0].0.value - means[1].0.value).abs() < SIGMAS * error);
}

/// Kernels say which primitive, shared code says where: the pictures are the same bits, as far as both kernels find
/// the same primitive on every ray. Rays through an edge shared by two triangles may be given to either.
#[cfg(feature = "embree")]
#[test]
fn kernels_give_the_same_picture() {
    let films: Vec<_> = ["embree", "brute"]
        .into_iter()
        .map(|backend| {
            let s = crate::common::scene_on(backend, PARTS);
            render(&s, integrator("path", &[("max_depth", 3.0)]), 4).film
        })
        .collect();
    let different =
        films[0].window().pixels().filter(|&(x, y)| films[0].mean(x, y) != films[1].mean(x, y)).count();
    // 768 pixels of 4 paths: some 10^4 rays, of which perhaps one in 10^4 meets an edge within f32's rounding.
    assert!(different <= 3, "{different} pixels differ");
}
