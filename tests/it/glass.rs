//! Glass in whole renders.

use crate::common::{assert_mean, integrator, mean, render, scene};

/// Six standard errors: a false alarm in 5e8 comparisons.
const SIGMAS: f64 = 6.0;

/// A ball under a sky of 1, all of it in the picture.
fn ball(material: &str) -> String {
    format!(
        r#"
[film]
size = [32, 32]
[camera]
type = "perspective"
eye = [0, 0, 3]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_deg = 45
[sky]
type = "constant"
[materials.m]
{material}
[[objects]]
shape = {{ type = "sphere" }}
material = "m"
"#
    )
}

/// Glass that absorbs nothing cannot be told from the sky around it, wherever it is looked through: radiance that grew on entering shrinks on leaving.
#[test]
fn a_glass_ball_vanishes_in_a_furnace_at_every_pixel() {
    for material in
        ["type = \"dielectric\"", "type = \"dielectric\"\neta = 2.4", "type = \"dielectric\"\neta = 0.75"]
    {
        let s = scene(&ball(material));
        // Without roulette: every path then brings the sky's 1 times eta^2 / eta^2.
        let params = [("max_depth", 1000.0), ("roulette_depth", 4097.0)];
        let r = render(&s, integrator("path", &params), 16);
        for (x, y) in r.film.window().pixels() {
            // Two roundings for each crossing, some ten of them, and the film's step.
            let v = r.film.mean(x, y).luminance();
            assert!((v - 1.0).abs() < 5e-6, "{material} at {x}, {y}: {v}");
        }
        // With it, the same on average.
        let m = mean(&render(&s, integrator("path", &[("max_depth", 1000.0), ("roulette_depth", 2.0)]), 64));
        assert_mean(material, &m, 1.0, SIGMAS, 5e-6);
    }
}

/// Light from behind a rough pane is sampled, and agrees with what scattered rays find.
#[test]
fn light_sampling_reaches_through_rough_glass() {
    let s = scene(
        r#"
[film]
size = [16, 16]
[camera]
type = "perspective"
eye = [0, 2, 0]
look_at = [0, 0, 0]
up = [0, 0, 1]
fov_deg = 20
[materials.pane]
type = "dielectric"
roughness = 0.6
[materials.lamp]
type = "emissive"
radiance = 10.0
[[objects]]
shape = { type = "rectangle", edge_u = [0, 0, 2], edge_v = [2, 0, 0] }
material = "pane"
[[objects]]
shape = { type = "sphere", center = [0.3, -2, 0], radius = 0.2 }
material = "lamp"
"#,
    );
    let on = mean(&render(&s, integrator("direct", &[]), 256));
    let off = mean(&render(&s, integrator("direct", &[("light_sampling", 0.0)]), 4096));
    assert!((on.value - off.value).abs() < SIGMAS * on.error.hypot(off.error) && on.value > 0.01);
    // Scattering finds the lamp with one ray in some hundred: with as many samples it would be noisier by far.
    assert!(on.error < 2.0 * off.error, "{} {}", on.error, off.error);
}
