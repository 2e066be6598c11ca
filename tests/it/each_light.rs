//! Light from each lamp at every surface, against that from one of them.

use crate::common::{integrator, mean, render, scene};

/// Six standard errors: a false alarm in 5e8 comparisons.
const SIGMAS: f64 = 6.0;

/// A floor under lamps, a ball of light, a sun and a sky, and a mirror wall.
const MANY_LIGHTS: &str = r#"
[film]
size = [12, 12]
[camera]
type = "perspective"
eye = [0, 1.2, 4]
look_at = [0, 0.4, 0]
up = [0, 1, 0]
fov_deg = 50
[sky]
type = "gradient"
[materials.floor]
type = "metal"
color = [0.9, 0.8, 0.7]
roughness = 0.6
[materials.mirror]
type = "mirror"
[materials.lamp]
type = "emissive"
radiance = [3, 4, 5]
[[lights]]
type = "directional"
direction = [-0.3, -1, -0.2]
irradiance = 1
[[objects]]
shape = { type = "rectangle", edge_u = [6, 0, 0], edge_v = [0, 0, -6] }
material = "floor"
[[objects]]
shape = { type = "rectangle", center = [0, 1, -2], edge_u = [3, 0, 0], edge_v = [0, 2, 0] }
material = "mirror"
[[objects]]
shape = { type = "rectangle", center = [-1, 1.5, 0.5], edge_u = [0, 0, 1], edge_v = [1, 0, 0] }
material = "lamp"
[[objects]]
shape = { type = "sphere", radius = 0.3, center = [1, 0.8, 0] }
material = "lamp"
"#;

#[test]
fn asking_each_light_changes_no_mean_and_is_less_noisy() {
    let s = scene(MANY_LIGHTS);
    let of = |kind: &str, each: f64, mis: &[(&str, f64)], spp: u32| {
        let params = [&[("each_light", each)], mis].concat();
        mean(&render(&s, integrator(kind, &params), spp))
    };
    for (kind, more) in [("direct", &[][..]), ("path", &[]), ("path", &[("mis", 0.0)])] {
        let (each, one) = (of(kind, 1.0, more, 256), of(kind, 0.0, more, 1024));
        let error = (each.error.powi(2) + one.error.powi(2)).sqrt();
        let difference = (each.value - one.value).abs();
        assert!(difference <= SIGMAS * error + 1e-5 * one.value, "{kind} {more:?}: {each:?} against {one:?}");
    }
    // Of the same number of samples, those that need no choice spread less.
    let [each, one] = [1.0, 0.0].map(|each| of("direct", each, &[], 64));
    assert!(each.error < one.error, "{each:?} against {one:?}");
}
