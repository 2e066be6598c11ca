//! Classic ray tracing and closed forms against arithmetic by hand and against each other.

use crate::common::{assert_mean, build_on, integrator, mean, render, scene, scene_on};
use skylit::color::Rgb;

/// A small camera straight above a wide floor, which it sees nearly from one direction.
fn floor(material: &str, rest: &str) -> String {
    format!(
        "[film]\nsize = [9, 9]\n[camera]\ntype = \"perspective\"\neye = [0, 4, 0]\nup = [0, 0, 1]\nfov_deg = 0.01\n\
         [materials.m]\n{material}\n[[objects]]\nmaterial = \"m\"\n\
         shape = {{ type = \"quad\", corner = [-100, 0, -100], edge_a = [0, 0, 200], edge_b = [200, 0, 0] }}\n{rest}"
    )
}

const CLASSIC: &str = "type = \"blinn-phong\"\nunits = \"classic\"\ntwo_sided = false\ndiffuse = [0.5, 0.25, 0]\n\
                       specular = 0.4\nshininess = 10\nambient = [0.01, 0.02, 0.03]";

fn center(scene: &skylit::scene::Scene, kind: &str, params: &[(&str, f64)], spp: u32) -> Rgb {
    render(scene, integrator(kind, params), spp).film.mean(4, 4)
}

fn close(got: Rgb, want: Rgb, relative: f32) {
    let error = (got - want).to_array().into_iter().fold(0f32, |a, e| a.max(e.abs()));
    // The film's step is far below f32's roundings of these few products.
    assert!(error <= relative * want.max_component(), "{got:?}, by hand {want:?}");
}

#[test]
fn a_highlight_is_what_the_formula_says() {
    let light = "[[lights]]\ntype = \"point\"\nposition = [3, 4, 0]\nintensity = [2, 3, 4]\nattenuation = [1, 0.5, 0.25]";
    let scene = scene(&floor(CLASSIC, light));
    let got = center(&scene, "whitted", &[], 1);
    // l = (3, 4) / 5, n and w are up, so n.h = cos of half the angle between: ((1 + 0.8) / 2)^(1/2); d = 5.
    let c = Rgb::new(2.0, 3.0, 4.0) / (1.0 + 2.5 + 6.25);
    let highlight = 0.4 * 0.9f32.sqrt().powi(10);
    let want = Rgb::new(0.01, 0.02, 0.03) + c * (Rgb::new(0.5, 0.25, 0.0) * 0.8 + Rgb::splat(highlight));
    // A view that is 1e-4 off straight, and the power's rounding.
    close(got, want, 1e-4);
}

#[test]
fn what_stands_nearer_than_a_light_blocks_it_and_what_stands_beyond_does_not() {
    let light = "[[lights]]\ntype = \"point\"\nposition = [3, 4, 0]\nintensity = 10\n";
    let ball = |x: f64, y: f64| {
        format!(
            "[[objects]]\nmaterial = \"m\"\nshape = {{ type = \"sphere\", radius = 0.2, center = [{x}, {y}, 0] }}\n"
        )
    };
    let open = center(&scene(&floor(CLASSIC, light)), "whitted", &[], 1);
    let beyond = center(&scene(&floor(CLASSIC, &(light.to_owned() + &ball(6.0, 8.0)))), "whitted", &[], 1);
    assert_eq!(open, beyond);
    let before = center(&scene(&floor(CLASSIC, &(light.to_owned() + &ball(1.5, 2.0)))), "whitted", &[], 1);
    close(before, Rgb::new(0.01, 0.02, 0.03), 1e-5);
}

#[test]
fn mirrors_are_followed_to_the_depth_and_show_the_sky_as_it_is() {
    // Two floors face each other with the camera between: each chain adds the ambient term times 0.4 a mirror.
    let ceiling = "[[objects]]\nmaterial = \"m\"\n\
                   shape = { type = \"quad\", corner = [-100, 9, -100], edge_a = [200, 0, 0], edge_b = [0, 0, 200] }";
    let twice = scene(&floor(CLASSIC, ceiling));
    for depth in [1, 2, 3, 10] {
        let got = center(&twice, "whitted", &[("max_depth", f64::from(depth))], 1);
        let sum: f32 = (0..depth).map(|i| 0.4f32.powi(i)).sum();
        close(got, Rgb::new(0.01, 0.02, 0.03) * sum, 1e-5);
    }
    // The sky's light may be scaled, its picture in a mirror is not.
    let sky = "[sky]\ntype = \"constant\"\nradiance = 2";
    let lit = scene(&floor("type = \"blinn-phong\"\ndiffuse = 0\nspecular = 1\nshininess = 1e6", sky));
    for scale in [0.0, 0.5] {
        // The highlight of a million's exponent brings 1e-5 of the sky's light at most.
        close(center(&lit, "whitted", &[("sky_light", scale)], 64), Rgb::splat(2.0), 1e-4);
    }
    let mirror = scene(&floor("type = \"mirror\"\nreflectance = 0.5", sky));
    close(center(&mirror, "whitted", &[], 1), Rgb::splat(1.0), 1e-5);
}

#[test]
fn the_sky_lights_by_the_integral_without_pi() {
    // kd int n.l dl + ks int (n.h)^s dl with the viewer above: h is at half of l's angle, so the second integral is
    // 2 pi int_0^1 ((1 + c) / 2)^(s / 2) dc = 2 pi (1 - 2^-(k + 1)) 2 / (k + 1) with k = s / 2.
    let sky = "[sky]\ntype = \"constant\"\nradiance = 1";
    let rendered = |sky_light| {
        let material = "type = \"blinn-phong\"\nunits = \"classic\"\ntwo_sided = false\ndiffuse = 0.5\nspecular = 0.4\nshininess = 10";
        render(
            &scene(&floor(material, sky)),
            integrator("whitted", &[("max_depth", 1.0), ("sky_light", sky_light)]),
            1024,
        )
    };
    let k = 5.0f64;
    let highlight = 0.4 * 2.0 * std::f64::consts::PI * (1.0 - (-(k + 1.0)).exp2()) * 2.0 / (k + 1.0);
    let whole = 0.5 * std::f64::consts::PI + highlight;
    // Six standard errors: a false alarm in 5e8 comparisons.
    assert_mean("sky", &mean(&rendered(1.0)), whole, 6.0, 1e-4);
    assert_mean("scaled sky", &mean(&rendered(0.31)), 0.31 * whole, 6.0, 1e-4);
}

#[test]
fn closed_forms_are_what_sampling_converges_to() {
    let lamp = "[materials.lamp]\ntype = \"emissive\"\nradiance = [5, 4, 3]\n\
                [[objects]]\nshape = { type = \"quad\", corner = [0.5, 1, -1], edge_a = [2, 0, 0], edge_b = [0, 0.5, 2] }\n\
                material = \"lamp\"\n[[lights]]\ntype = \"point\"\nposition = [-3, 4, 0]\nintensity = 10\n\
                [[lights]]\ntype = \"directional\"\ndirection = [1, -2, 0]\nirradiance = 0.5\n";
    for material in
        ["type = \"diffuse\"\nalbedo = [0.5, 0.6, 0.7]", "type = \"phong\"\ndiffuse = 0.7\nspecular = 0"]
    {
        for backend in ["auto", "brute"] {
            let scene = scene_on(backend, &floor(material, lamp));
            let sampled = mean(&render(&scene, integrator("direct", &[]), 256));
            let exact = mean(&render(&scene, integrator("analytic", &[]), 4));
            // Six standard errors; closed forms have none of their own.
            assert_mean("direct", &sampled, exact.value, 6.0, 1e-4 * exact.value);
            assert!(exact.value > 0.1 && exact.error < 1e-4 * exact.value, "{} {}", exact.value, exact.error);
        }
    }
}

#[test]
fn lamps_and_physical_materials_take_part() {
    // The same direct light as the path tracer's first depth, by one ray to every lamp.
    let toml = floor(
        "type = \"metal\"\nroughness = 0.6",
        "[sky]\ntype = \"midday\"\n[materials.lamp]\ntype = \"emissive\"\nradiance = 8\n\
         [[objects]]\nmaterial = \"lamp\"\nshape = { type = \"sphere\", center = [2, 2, 0], radius = 0.5 }",
    );
    let scene = scene(&toml);
    let classic = mean(&render(&scene, integrator("whitted", &[("max_depth", 1.0)]), 1024));
    let direct = mean(&render(&scene, integrator("direct", &[]), 1024));
    assert_mean("whitted", &classic, direct.value, 6.0, 6.0 * direct.error);
}

#[test]
fn a_lamp_that_is_grazed_lights_all_the_same() {
    // A wall that leans a little, close below the lamp's plane: shadow rays start beside the wall and must not meet the
    // lamp before their end.
    let toml = "[film]\nsize = [9, 9]\n[camera]\ntype = \"perspective\"\neye = [300, 540, 280]\nlook_at = [556, 545, 280]\n\
                fov_deg = 0.2\n[materials.m]\ntype = \"diffuse\"\nalbedo = 0.5\n[materials.lamp]\ntype = \"emissive\"\nradiance = 5e4\n\
                [[objects]]\nmaterial = \"m\"\nshape = { type = \"quad\", corner = [552.8, 0, 0], edge_a = [3.2, 548.8, 0], \
                edge_b = [0, 0, 559.2] }\n[[objects]]\nmaterial = \"lamp\"\nshape = { type = \"quad\", corner = [213, 548.8, 227], \
                edge_a = [130, 0, 0], edge_b = [0, 0, 105] }\n";
    let scene = scene(toml);
    let exact = mean(&render(&scene, integrator("analytic", &[]), 4));
    let sampled = mean(&render(&scene, integrator("direct", &[]), 256));
    assert!(exact.value > 0.01, "the wall is seen, and lit: {}", exact.value);
    assert_mean("direct", &sampled, exact.value, 6.0, 1e-3 * exact.value);
}

/// v of a mesh counts from the top row, and so do pictures on spheres: the pole that points up shows the top row.
#[test]
fn pictures_of_the_seed_hang_from_their_top_row() {
    let dir = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_fn(1, 2, |_, y| image::Rgb([if y == 0 { 255 } else { 51 }; 3]));
    picture.save(dir.path().join("rows.png")).unwrap();
    let shown = |shape: &str| {
        // Lit from where it is looked at, by a light of 1 along the normal.
        let text = format!(
            "size 9 9\ncamera 0 4 0 0 0 0 0 0 1 1\ndirectional 0 1 0 1 1 1\ntexture rows.png\n{shape}\n"
        );
        let path = dir.path().join("a.scene");
        std::fs::write(&path, text).unwrap();
        let scene = build_on("auto", skylit::formats::load(&path).unwrap());
        center(&scene, "whitted", &[], 1).r
    };
    let triangle = |at: &str| format!("{at}\ntri 0 1 2\nmesh m");
    // The centre of the picture is near the first corner, where v is 0; near the third, where it is 1.
    let near_first = triangle("vertex -0.1 0 -0.1\nvertex -0.1 0 9\nvertex 9 0 -0.1");
    let near_third = triangle("vertex -0.1 0 9\nvertex 9 0 -0.1\nvertex -0.1 0 -0.1");
    // The ball is seen beside its pole; the middle pixel is 0.008 wide there, and its light falls off by 0.2 of that.
    let tolerance = 1e-3;
    for (shape, want) in [(near_first.as_str(), 1.0), (&near_third, 0.2), ("sph 0.2 0 0 1", 0.96f32.sqrt())] {
        let got = shown(shape);
        assert!((got - want).abs() < tolerance, "{shape}: {got}, not {want}");
    }
}
