//! What a scene does not need is not worked out, and changes no picture.

use crate::common::{integrator, render, render_rays, scene};
use skylit::base::light::Receiver;
use skylit::render::Rendered;

fn text(sky: &str, more: &str) -> String {
    format!(
        r#"
[film]
size = [24, 16]
[camera]
type = "perspective"
eye = [0, 1.2, 4]
look_at = [0, 0.4, 0]
fov_deg = 50
[sky]
{sky}
[materials.clay]
type = "diffuse"
albedo = 0.7
[materials.dark]
type = "emissive"
radiance = 0.0
albedo = 0.5
[[objects]]
shape = {{ type = "sphere", radius = 0.8 }}
material = "clay"
[[objects]]
shape = {{ type = "rectangle", center = [-1, 1.5, 0.5], edge_u = [0, 0, 1], edge_v = [1, 0, 0] }}
material = "dark"
{more}
"#
    )
}

const LAMP: &str = "[[lights]]\ntype = \"point\"\nposition = [0, 3, 1]\nintensity = ";

fn pixels(r: &Rendered) -> Vec<[u32; 3]> {
    let all = r.film.window().pixels();
    all.map(|(x, y)| r.film.mean(x, y).to_array().map(f32::to_bits)).collect()
}

#[test]
fn a_lamp_of_no_power_is_no_light() {
    let [without, with] =
        ["".to_owned(), format!("{LAMP}0.0")].map(|lamp| scene(&text("type = \"midday\"", &lamp)));
    assert_eq!([without.lights.list.len(), with.lights.list.len()], [1, 1]);
    assert!(!with.features.emitting_surfaces && !with.features.many_lights);
    let [a, b] = [without, with].map(|s| pixels(&render(&s, integrator("path", &[]), 16)));
    assert_eq!(a, b);
    let dark = scene(&text("type = \"constant\"\nradiance = 0", ""));
    assert!(dark.lights.list.is_empty());
    assert!(pixels(&render(&dark, integrator("path", &[]), 16)).iter().all(|p| *p == [0; 3]));
}

#[test]
fn a_sky_that_is_not_sampled_is_left_to_scattered_rays() {
    let s = scene(&text("type = \"constant\"", ""));
    assert!(!s.features.sampled_lights);
    for kind in ["direct", "path"] {
        for each in [0.0, 1.0] {
            let [with, without] = [1.0, 0.0].map(|sampling| {
                render_rays(&s, integrator(kind, &[("light_sampling", sampling), ("each_light", each)]), 8)
            });
            assert_eq!(pixels(&with), pixels(&without));
            let (rays, avoided) = (with.stats.rays, with.stats.avoided);
            assert_eq!(avoided.candidates, rays.scattered + rays.shadow + avoided.rays(), "{kind}");
            assert_eq!((avoided.points, avoided.dark_samples), (avoided.scattered_alone, 0), "{kind}");
        }
    }
    // Beside a lamp, the lamp is asked.
    let s = scene(&text("type = \"constant\"", &format!("{LAMP}2.0")));
    let at = Receiver { p: [0.0, 0.8, 0.0].into(), ng: [0.0, 1.0, 0.0].into(), ns: [0.0, 1.0, 0.0].into() };
    assert!(s.features.sampled_lights);
    assert_eq!([0, 1].map(|light| s.lights.sampler.pmf(&at, light)), [0.0, 1.0]);
}
