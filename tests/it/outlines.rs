//! Pixels that outlines run through take more samples: the same picture, nearer to the truth.

use crate::common::{integrator, mean, scene, settings};
use skylit::render::settings::RenderSettings;
use skylit::render::{Rendered, Renderer, Silent};
use skylit::scene::Scene;

const TEXT: &str = r#"
[film]
size = [48, 32]
[camera]
type = "perspective"
eye = [0, 0, 6]
look_at = [0, 0, 0]
fov_deg = 45.0
[sky]
type = "midday"
[materials.clay]
type = "diffuse"
albedo = 0.7
[[objects]]
shape = { type = "sphere" }
material = "clay"
"#;

fn render(scene: &Scene, change: impl FnOnce(&mut RenderSettings)) -> Rendered {
    let mut settings = RenderSettings { filter: "box".parse().unwrap(), ..settings(scene) };
    change(&mut settings);
    let integrator = integrator("direct", &[]);
    Renderer { integrator, settings }.render(scene, &Silent).unwrap()
}

/// Pixels that the ball covers, by what was sampled.
fn covered(r: &Rendered) -> f64 {
    r.film.window().pixels().map(|(x, y)| f64::from(r.film.alpha(x, y))).sum()
}

#[test]
fn the_mean_is_that_of_a_fixed_number_of_samples() {
    let s = scene(TEXT);
    let want = mean(&render(&s, |s| (s.spp, s.outlines) = (512, Some(1))));
    let rendered = render(&s, |s| (s.spp, s.outlines) = (512, Some(8)));
    assert!(rendered.stats.outlines.pixels > 30 && rendered.stats.outlines.times == 8);
    let got = mean(&rendered);
    let sigma = want.error.hypot(got.error);
    assert!((got.value - want.value).abs() < 4.5 * sigma, "{got:?} {want:?}");
    assert!(sigma < 1e-3 * want.value, "{got:?} {want:?}");
}

#[test]
fn outlines_have_less_error_and_no_bias() {
    let s = scene(TEXT);
    // The cone that touches a ball of radius 1 from 6 has a tangent of 1 / sqrt(35); half the film's is that of 22.5 degrees.
    let radius = 16.0 / 22.5f64.to_radians().tan() / 35f64.sqrt();
    let truth = std::f64::consts::PI * radius * radius;
    let errors = |outlines: u32| -> Vec<f64> {
        let of = |seed: u64| {
            covered(&render(&s, |s| {
                (s.spp, s.outlines, s.seed, s.moments) = (4, Some(outlines), seed, false)
            })) - truth
        };
        (0..64).map(of).collect()
    };
    let [one, more] = [1, 4].map(errors);
    let square = |e: &[f64]| e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64;
    // As n^-1.5 it would be an eighth. The ratio of two means of 64 squares is uncertain by a quarter of itself (standard
    // error): a third is more than six of those away.
    assert!(square(&more) < square(&one) / 3.0, "{} {}", square(&one), square(&more));
    let bias = more.iter().sum::<f64>() / more.len() as f64;
    assert!(bias.abs() < 4.5 * (square(&more) / more.len() as f64).sqrt(), "{bias}");
}

#[test]
fn more_are_taken_where_samples_of_light_are_shared() {
    let s = scene(TEXT);
    let found = |kind: &str, params: &[(&str, f64)], outlines: Option<u32>| {
        let settings = RenderSettings { spp: 8, outlines, ..settings(&s) };
        let r = Renderer { integrator: integrator(kind, params), settings }.render(&s, &Silent).unwrap();
        r.stats.outlines.pixels > 0
    };
    assert!(
        found("direct", &[], None)
            && found("path", &[("max_depth", 1.0)], None)
            && found("normals", &[], None)
    );
    assert!(!found("path", &[], None) && !found("direct", &[("light_sampling", 0.0)], None));
    assert!(found("path", &[], Some(4)), "it was asked for");
}

#[test]
fn a_single_sample_and_a_lens_have_none() {
    let s = scene(TEXT);
    assert_eq!(render(&s, |s| s.spp = 1).stats.outlines.pixels, 0);
    let lens = scene(&TEXT.replace("fov_deg = 45.0", "fov_deg = 45.0\naperture = 0.2\nfocus_distance = 6.0"));
    assert_eq!(render(&lens, |s| s.spp = 4).stats.outlines.pixels, 0);
}
