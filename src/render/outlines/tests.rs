use super::*;
use crate::scene::build::{BuildOptions, build};

/// A film of 96 x 64 pixels, of which the ball spans 26.
fn scene(objects: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let head = "[film]\nsize = [96, 64]\n[camera]\ntype = \"perspective\"\neye = [0, 0, 6]\nlook_at = [0, 0, 0]\n\
                fov_deg = 45.0\n[sky]\ntype = \"gradient\"\n";
    std::fs::write(&path, format!("{head}{objects}")).unwrap();
    let options = BuildOptions { backend: "brute".into(), ..BuildOptions::default() };
    build(crate::formats::load(&path).unwrap(), &options).unwrap()
}

const BALL: &str = "[[objects]]\nshape = { type = \"sphere\" }\n";
const RECT: PixelRect = PixelRect::of_size(96, 64);

#[test]
fn the_rim_of_a_ball_is_found_and_nothing_else() {
    let outlines = Outlines::of(&scene(BALL), RECT, 8).unwrap();
    // Half of the picture's height is 6 tan 22.5 degrees wide; the ball is seen as wide as the cone that touches it.
    let radius = 32.0 / 22.5f64.to_radians().tan() / 35f64.sqrt();
    for (x, y) in RECT.pixels() {
        let corner = |dx: u32, dy: u32| (f64::from(x + dx) - 48.0).hypot(f64::from(y + dy) - 32.0) - radius;
        let far = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
        // The rounding of rays and of the radius moves the rim by much less than a hundredth of a pixel.
        if far.iter().all(|d| d.abs() > 0.01) {
            let through = far.iter().any(|d| *d < 0.0) && far.iter().any(|d| *d > 0.0);
            assert_eq!(outlines.contains(x, y), through, "{x} {y} {far:?}");
        }
    }
    // A circle crosses 8 r lines of the lattice, each into another pixel.
    assert!((outlines.count() as f64 - 8.0 * radius).abs() < 12.0, "{}", outlines.count());
    assert_eq!(outlines.rays, 6 * 4 * 17 * 17);
}

#[test]
fn one_object_before_another_has_an_outline_too() {
    let wall = "[[objects]]\nshape = { type = \"quad\", corner = [-50, -50, -2], edge_a = [100, 0, 0], edge_b = [0, 100, 0] }\n";
    let [alone, before] = [BALL.to_owned(), format!("{BALL}{wall}")]
        .map(|objects| Outlines::of(&scene(&objects), RECT, 8).unwrap());
    assert!(RECT.pixels().all(|(x, y)| alone.contains(x, y) == before.contains(x, y)));
    assert!(Outlines::of(&scene(wall), RECT, 8).is_none(), "a wall all over has none");
}

#[test]
fn the_more_outlines_the_fewer_samples_each() {
    let times = |most: u32, spheres: usize| {
        let ball = |i: usize| {
            let (x, y) = (i % 8, i / 8 % 6);
            let at = [x as f64 * 0.8 - 2.8, y as f64 * 0.8 - 2.0];
            format!(
                "[[objects]]\nshape = {{ type = \"sphere\", center = [{}, {}, 0], radius = 0.2 }}\n",
                at[0], at[1]
            )
        };
        let objects: String = (0..spheres).map(ball).collect();
        Outlines::of(&scene(&objects), RECT, most).map_or(1, |o| o.times())
    };
    assert_eq!(times(1, 1), 1);
    assert_eq!(times(6, 1), 4);
    assert_eq!(times(64, 1), 64);
    let crowd = times(64, 48);
    assert!((2..8).contains(&crowd), "{crowd}");
}
