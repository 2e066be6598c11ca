//! What every texture must satisfy.

use super::REGISTRY;
use crate::color::Rgb;
use crate::testing::rows::{built, check_rows};
use glam::Vec2;

#[test]
fn rows_are_sound_and_refuse_bad_parameters() {
    check_rows("texture", REGISTRY);
}

#[test]
fn values_are_finite_everywhere() {
    let coordinates = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-30, 0.999_999_94, 1.000_000_1, -3.7, 1e9, -1e9, 3e38];
    let broken = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for t in built("texture", REGISTRY) {
        for u in coordinates.into_iter().chain(broken) {
            for v in coordinates.into_iter().chain(broken) {
                for footprint in [0.0, 1e-6, 0.1, 1.0, 1e30, f32::INFINITY, f32::NAN] {
                    let c = t.it.eval(Vec2::new(u, v), footprint);
                    assert!(c.is_finite() && c.r >= 0.0 && c.g >= 0.0 && c.b >= 0.0, "{}: {c:?}", t.label);
                }
            }
        }
    }
}

#[test]
fn the_mean_is_the_integral_over_the_unit_square() {
    const N: usize = 800;
    for t in built("texture", REGISTRY) {
        let mut sum = [0f64; 3];
        for i in 0..N * N {
            let uv = Vec2::new((i % N) as f32 + 0.5, (i / N) as f32 + 0.5) / N as f32;
            let c = t.it.eval(uv, 0.0);
            sum.iter_mut().zip(c.to_array()).for_each(|(s, v)| *s += v as f64);
        }
        let integral = Rgb::from(sum.map(|s| (s / (N * N) as f64) as f32));
        let mean = t.it.mean();
        for (a, b) in integral.to_array().into_iter().zip(mean.to_array()) {
            // The midpoint rule on N strips misplaces each edge of a checker by at most half a strip.
            assert!((a - b).abs() <= 4e-3 * b.max(0.1), "{}: {integral:?} != {mean:?}", t.label);
        }
    }
}

#[test]
fn what_is_constant_says_its_value() {
    for t in built("texture", REGISTRY) {
        let Some(c) = t.it.constant() else { continue };
        assert_eq!(t.it.eval(Vec2::new(0.3, -7.0), 0.5), c, "{}", t.label);
        assert_eq!(t.it.mean(), c, "{}", t.label);
    }
}

#[test]
fn a_wide_footprint_sees_the_average_where_it_is_asked_for() {
    for t in built("texture", REGISTRY).into_iter().filter(|t| t.it.uses_footprint()) {
        let (a, b) = (t.it.eval(Vec2::new(0.1, 0.8), 1e6), t.it.eval(Vec2::new(0.7, 0.3), 1e6));
        assert_eq!(a, b, "{}: the last level is one texel", t.label);
    }
}
