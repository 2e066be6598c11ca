//! Product sampling and its strategies against the plain table: the same pictures, on average.

use crate::common::{mean, render, scene};
use skylit::base::registry::{self, Node, Params, Value};
use skylit::integrators::{self, Integrator};
use std::sync::Arc;

/// Standard errors: over the 94 comparisons below a false alarm in 1,500 runs.
const SIGMAS: f64 = 4.5;

/// A ball of a material on a square of clay, and sky above and beside it.
pub fn ground_and(sky: &str, sampling: &str, material: &str, more: &str) -> String {
    format!(
        r#"
[film]
size = [24, 24]
[camera]
type = "perspective"
eye = [0.4, 1.2, 4]
look_at = [0, 0.5, 0]
fov_deg = 35
[sky]
{sky}
sampling = "{sampling}"
[materials.m]
{material}
[materials.clay]
type = "diffuse"
albedo = 0.5
[[objects]]
shape = {{ type = "sphere", center = [0, 0.6, 0], radius = 0.6 }}
material = "m"
[[objects]]
shape = {{ type = "rectangle", edge_u = [0, 0, 9], edge_v = [9, 0, 0] }}
material = "clay"
{more}
"#
    )
}

pub const LAMP: &str = "[materials.lamp]\ntype = \"emissive\"\nradiance = 3\n[[objects]]\nshape = { type = \"sphere\", \
                    center = [1.2, 1.5, 0.5], radius = 0.3 }\nmaterial = \"lamp\"\n";
pub const SUN: &str = "[[lights]]\ntype = \"directional\"\ndirection = [-1, -1, -1]\nirradiance = 2\n";

/// Ten scenes: skies flat and with suns, even, glossy, clear and rough surfaces, other lights beside the sky.
fn scenes() -> Vec<(&'static str, &'static str, &'static str, bool)> {
    let (diffuse, metal) = ("type = \"diffuse\"\nalbedo = 0.8", "type = \"metal\"\nroughness = 0.3");
    vec![
        ("type = \"gradient\"", diffuse, "", true),
        ("type = \"midday\"", diffuse, "", false),
        ("type = \"dusk\"", diffuse, "", true),
        ("type = \"gradient\"\nrotate_y_deg = 30", metal, "", true),
        ("type = \"midday\"", metal, "", false),
        ("type = \"gradient\"", "type = \"ggx\"\nalpha = 0.15\nspecular = 0.6\ndiffuse = 0.3", "", true),
        ("type = \"gradient\"", "type = \"dielectric\"\nroughness = 0.4", "", false),
        ("type = \"gradient\"", "type = \"mirror\"", "", true),
        ("type = \"gradient\"", diffuse, LAMP, true),
        ("type = \"midday\"", diffuse, SUN, false),
    ]
}

fn path(depth: f64, strategy: &str, each_light: bool) -> Arc<dyn Integrator> {
    let params = Params::new()
        .with("max_depth", Value::Number(depth))
        .with("strategy", Value::Text(strategy.into()))
        .with("each_light", Value::Bool(each_light));
    let node = Node { kind: "path".into(), params, ..Node::default() };
    registry::build("integrator", integrators::REGISTRY, &node).unwrap()
}

#[test]
fn all_strategies_estimate_what_the_table_does() {
    for (sky, material, more, narrow_is_tame) in scenes() {
        let picture = |sampling: &str, strategy: &str, each: bool, depth: f64| {
            let s = scene(&ground_and(sky, sampling, material, more));
            mean(&render(&s, path(depth, strategy, each), 256))
        };
        for depth in [1.0, 3.0] {
            let want = picture("table", "auto", false, depth);
            // Light samples alone on narrow lobes, and scattered rays alone under suns, are right on average, but no mean of
            // so few samples has an honest error: they are tried where a pilot may choose them.
            let strategies: &[&str] = if narrow_is_tame {
                &["auto", "both", "both-4", "light", "light-8", "bsdf"]
            } else {
                &["auto", "both", "both-4"]
            };
            for strategy in strategies {
                let each = *strategy == "both" && !more.is_empty();
                let got = picture("product", strategy, each, depth);
                let sigma = (got.error.powi(2) + want.error.powi(2)).sqrt();
                assert!(
                    (got.value - want.value).abs() <= SIGMAS * sigma,
                    "{sky} {material} {strategy} depth {depth}: {got:?} for {want:?}"
                );
                // An answer that says nothing would pass anything.
                assert!(sigma < 0.03 * want.value, "{sky} {material} {strategy}: {got:?} {want:?}");
            }
        }
    }
}
