use super::allocate::{Need, Tile, needs, worth_doubling};
use super::estimate::{ErrorSum, floor_of, normal_deviate, pixel_errors};
use super::*;
use crate::color::Rgb;
use crate::render::film::{FilmSample, FilmTile};
use crate::testing::TestRng;

/// A film of 16 x 16 tiles whose pixels have the halves that `halves` says, of one sample each.
fn film(across: u32, mut halves: impl FnMut(u32, u32) -> [f32; 2]) -> Film {
    let mut film =
        Film::new(across * TILE_SIDE, TILE_SIDE, PixelRect::of_size(across * TILE_SIDE, TILE_SIDE));
    let rects: Vec<PixelRect> = film.tiles().collect();
    let mut tile = FilmTile::new(rects[0]);
    for rect in rects {
        tile.reset(rect);
        for (x, y) in rect.pixels() {
            for (replicate, v) in halves(x, y).into_iter().enumerate() {
                tile.add(x, y, replicate, FilmSample { radiance: Rgb::splat(v), alpha: 1.0 });
            }
        }
        film.add_tile(&tile);
    }
    film
}

#[test]
fn pixels_count_alike_however_many_samples_they_have() {
    let even = film(2, |x, y| if (x, y) == (3, 3) { [52.0, 48.0] } else { [1.0, 1.0] });
    let mut uneven = even.clone();
    // An outline of a lamp: the same halves, of 64 samples each.
    let mut tile = FilmTile::new(even.tiles().next().unwrap());
    for replicate in 0..2 {
        let v = if replicate == 0 { 52.0 } else { 48.0 };
        let sample = FilmSample { radiance: Rgb::splat(v), alpha: 1.0 };
        (0..63).for_each(|_| tile.add(3, 3, replicate, sample));
    }
    uneven.add_tile(&tile);
    // 511 pixels of 1, and one of 50.
    let floor = 0.01 * (561.0f64 / 512.0).powi(2);
    for f in [&even, &uneven] {
        assert!((floor_of(f) / floor - 1.0).abs() < 1e-6, "{} instead of {floor}", floor_of(f));
    }
}

fn tiles(n: usize, spp: u32) -> Vec<Tile> {
    (0..n).map(|i| Tile { place: [i, 0], area: 256.0, spp, rays: u64::from(spp) * 256 }).collect()
}

#[test]
fn quantiles_are_those_of_tables() {
    for (p, z) in [(0.5, 0.0), (0.05, 1.6449), (0.025, 1.96), (1e-6, 4.7534)] {
        assert!((normal_deviate(p) - z).abs() < 5e-4, "{p}");
    }
    // F(f, f) at 95 %: 2.978 for 10, 1.344 for 125.
    for (f, quantile) in [(10.0, 2.978), (125.0, 1.344)] {
        let sum = ErrorSum { sum: 1.0, squares: 3.0 / f, pixels: 1.0 };
        assert!((sum.bound(normal_deviate(0.05)) / quantile - 1.0).abs() < 0.01, "{f}");
    }
}

#[test]
fn the_estimate_is_that_of_the_squared_error() {
    let mut rng = TestRng::new(3);
    // The sum of twelve uniform numbers less 6 is normal enough: halves of 1 +- 0.05, so an error of 0.05 / sqrt 2.
    let mut normal = || (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
    let f = film(16, |_, _| [1.0 + 0.05 * normal(), 1.0 + 0.05 * normal()]);
    let floor = floor_of(&f);
    assert!((floor - 0.01).abs() < 1e-4);
    let errors = ErrorSum::of(f.window().tiles(16).flat_map(|rect| pixel_errors(&f, rect, floor)));
    // 4,096 degrees of freedom: 2.2 % are one standard deviation. About 1.07 is what the documentation says.
    let expected = 0.05f64.powi(2) / 2.0 / 1.01;
    assert!((1.0..1.17).contains(&(errors.mean() / expected)), "{}", errors.mean() / expected);
    assert!((errors.freedom() / 4096.0 - 1.0).abs() < 0.2, "{}", errors.freedom());
}

#[test]
fn one_bright_sample_is_neither_hidden_nor_trusted() {
    let f = film(4, |x, y| if (x, y) == (20, 3) { [1001.0, 1.0] } else { [1.0, 1.0] });
    let floor = floor_of(&f);
    let rects: Vec<PixelRect> = f.tiles().collect();
    let errors = ErrorSum::of(pixel_errors(&f, rects[1], floor));
    // The pixel is off by 500.
    assert!(errors.sum > 0.03 * 500.0f64.powi(2), "{}", errors.sum);
    assert!(errors.freedom() < 3.01 && errors.bound(1.96) > 10.0 * errors.mean());
    // Which tile had it says little: its neighbours are to get as many samples.
    let tiles = tiles(4, 16);
    let needs = needs(&f, &tiles, floor);
    assert!(needs[0].rate > 0.5 * needs[1].rate && needs[2].rate > 0.5 * needs[1].rate);
    assert_eq!(worth_doubling(&tiles, &needs, 1024).len(), 3);
}

#[test]
fn samples_go_where_a_ray_gains_most() {
    let need = |rate| Need { rate, ..Need::default() };
    let mut t = tiles(4, 16);
    // As good as the best, a quarter as good, more than that but at twice the rays, and nothing known to be wrong.
    let all = [need(8.0), need(2.0), need(3.0), need(0.0)];
    t[2].rays *= 2;
    assert_eq!(worth_doubling(&t, &all, 1024), [0]);
    // Twice the samples: a quarter of the gain.
    t[0].spp = 32;
    t[0].rays *= 2;
    assert_eq!(worth_doubling(&t, &all, 1024), [0, 1, 2]);
    assert_eq!(worth_doubling(&t, &all, 32), [1, 2]);
    // No error anywhere: all alike.
    assert_eq!(worth_doubling(&tiles(3, 16), &[need(0.0); 3], 1024), [0, 1, 2]);
}
