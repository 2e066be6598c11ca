use super::*;
use crate::testing::TestRng;

fn sky(height: usize, mut value: impl FnMut(usize, usize) -> [f32; 3]) -> ImageData {
    let width = 2 * height;
    let texels = (0..width * height).map(|i| value(i % width, i / width)).collect();
    ImageData { width, height, texels: Texels::F32(texels) }
}

fn cube(n: usize, mut value: impl FnMut(usize, usize, usize) -> [f32; 3]) -> [ImageData; 6] {
    [0, 1, 2, 3, 4, 5].map(|face| ImageData {
        width: n,
        height: n,
        texels: Texels::F32((0..n * n).map(|i| value(face, i % n, i / n)).collect()),
    })
}

/// Solid angle of [0, s] x [0, t] on a face at distance 1.
fn corner(s: f64, t: f64) -> f64 {
    (s * t / (1.0 + s * s + t * t).sqrt()).atan()
}

/// Solid angles of texels, and real spherical harmonics up to l = 2 integrated over them.
fn moments(texels: impl Iterator<Item = ([f64; 3], f64, f64)>) -> [f64; 9] {
    let mut sums = [0.0; 9];
    for ([x, y, z], weight, value) in texels {
        // The nine up to constants (R. Ramamoorthi, P. Hanrahan, SIGGRAPH 2001, equation 3).
        let basis = [1.0, x, y, z, x * y, y * z, x * z, 3.0 * z * z - 1.0, x * x - y * y];
        sums.iter_mut().zip(basis).for_each(|(s, b)| *s += b * weight * value);
    }
    sums
}

/// Points within each texel, with shares of its solid angle; finer where texels are large.
fn points(count: usize) -> usize {
    (256 / count).clamp(1, 16)
}

fn sky_moments(sky: &ImageData) -> [f64; 9] {
    let (w, h, p) = (sky.width, sky.height, points(sky.height));
    moments((0..w * p * h * p).map(|i| {
        let (x, y) = (i % (w * p), i / (w * p));
        let edge = |y: usize| (PI * y as f64 / (h * p) as f64).cos();
        let weight = (edge(y) - edge(y + 1)) * TAU / (w * p) as f64;
        let latitude = PI * (0.5 - (y as f64 + 0.5) / (h * p) as f64);
        let longitude = TAU * ((x as f64 + 0.5) / (w * p) as f64 - 0.5);
        let (sin, cos) = longitude.sin_cos();
        let d = [latitude.cos() * cos, latitude.sin(), latitude.cos() * sin];
        (d, weight, f64::from(sky.texel(x / p, y / p).g))
    }))
}

fn cube_moments(faces: &[ImageData; 6]) -> [f64; 9] {
    let n = faces[0].width;
    let p = points(n);
    let m = n * p;
    moments((0..6 * m * m).map(|i| {
        let (face, x, y) = (i / (m * m), i % m, i / m % m);
        let edge = |i: usize| 2.0 * i as f64 / m as f64 - 1.0;
        let [s0, s1, t0, t1] = [edge(x), edge(x + 1), -edge(y + 1), -edge(y)];
        let weight = corner(s1, t1) - corner(s0, t1) - corner(s1, t0) + corner(s0, t0);
        let (s, t) = (0.5 * (s0 + s1), 0.5 * (t0 + t1));
        // OpenGL 4.6, table 8.19.
        let d = match face {
            0 => [1.0, t, -s],
            1 => [-1.0, t, s],
            2 => [s, 1.0, -t],
            3 => [s, -1.0, t],
            4 => [s, t, 1.0],
            _ => [-s, t, -1.0],
        };
        let length = (1.0 + s * s + t * t).sqrt();
        (d.map(|c| c / length), weight, f64::from(faces[face].texel(x / p, y / p).g))
    }))
}

const SIZES: [(usize, usize); 9] =
    [(1, 1), (2, 1), (1, 2), (3, 3), (8, 5), (7, 8), (64, 32), (31, 100), (128, 9)];

#[test]
fn shared_solid_angles_fill_texels_and_cells() {
    for (h, n) in SIZES {
        // Widths that four does not divide, too.
        for w in [2 * h, 2 * h + 1] {
            let overlap = Overlap::new(w, h, n);
            let mut cells = vec![0.0; w * h];
            let mut total = 0.0;
            let mut put = |[column, row]: [usize; 2], area: f64| {
                cells[row * w + column] += area;
                cells[(h - 1 - row) * w + column] += area;
                total += 2.0 * area;
            };
            for (_, centre) in SIDES {
                overlap.side(centre, [-FRAC_PI_4, FRAC_PI_4], |_, cell, area| put(cell, area));
            }
            for quarter in &QUARTERS {
                overlap.top(quarter.start, [0.0, FRAC_PI_2], |_, cell, area| put(cell, area));
            }
            assert!((total - 2.0 * TAU).abs() < 1e-11, "{w} {h} {n}: {total}");
            for (i, area) in cells.iter().enumerate() {
                let edge = |y: usize| (PI * y as f64 / h as f64).cos();
                let exact = (edge(i / w) - edge(i / w + 1)) * TAU / w as f64;
                assert!((area - exact).abs() < 1e-12, "{w} {h} {n}, cell {i}: {area} {exact}");
            }
        }
    }
}

#[test]
fn no_shared_solid_angle_is_negative_and_each_is_where_both_are() {
    for (h, n) in SIZES {
        let w = 2 * h;
        let overlap = Overlap::new(w, h, n);
        let mut shared = std::collections::HashMap::new();
        for (face, centre) in SIDES {
            overlap.side(centre, [-FRAC_PI_4, FRAC_PI_4], |[x, strip], cell, area| {
                *shared.entry((face, [x, strip], cell)).or_insert(0.0) += area;
            });
        }
        for (i, quarter) in QUARTERS.iter().enumerate() {
            overlap.top(quarter.start, [0.0, FRAC_PI_2], |strips, cell, area| {
                *shared.entry((10 + i, strips, cell)).or_insert(0.0) += area;
            });
        }
        // Parts of up to 1, rounded a few times.
        assert!(shared.values().all(|area| *area > -1e-13), "{h} {n}");
        // By points: no pair that a point lies in is missing.
        let mut rng = TestRng::new(3);
        for _ in 0..2000 {
            let (l, z) = ((rng.f32() as f64 - 0.5) * TAU, rng.f32() as f64);
            let r = (1.0 - z * z).sqrt();
            let d = [r * l.cos(), z, r * l.sin()];
            let cell = [((l / TAU + 0.5) * w as f64) as usize, ((z.acos() / PI) * h as f64) as usize];
            let near = |v: f64| ((v + 1.0) * 0.5 * n as f64) as usize;
            let key = if d[1] > d[0].abs().max(d[2].abs()) {
                let quarter = (((l + PI) / FRAC_PI_2) as usize).min(3);
                let [x, z] = [(d[0] / d[1]).abs(), (d[2] / d[1]).abs()];
                let [a, b] = if QUARTERS[quarter].along_is_x { [x, z] } else { [z, x] };
                let strip = |v: f64| ((v * n as f64 + (n % 2) as f64) / 2.0) as usize;
                (10 + quarter, [strip(a), strip(b)], cell)
            } else {
                let (face, across, major) = match (d[0].abs() > d[2].abs(), d[0] > 0.0, d[2] > 0.0) {
                    (true, true, _) => (0, d[2], d[0]),
                    (true, false, _) => (1, -d[2], -d[0]),
                    (_, _, true) => (4, -d[0], d[2]),
                    (_, _, false) => (5, d[0], -d[2]),
                };
                let strip = ((d[1] / major * n as f64 + (n % 2) as f64) / 2.0) as usize;
                (face, [near(across / major), strip], cell)
            };
            assert!(shared.get(&key).is_some_and(|area| *area > 0.0), "{h} {n}: {key:?}");
        }
    }
}

#[test]
fn one_value_everywhere_stays_to_rounding() {
    for (h, n) in SIZES {
        let faces = cube_of(&sky(h, |_, _| [0.1, 1.0, 3e4]), n);
        for face in &faces {
            let Texels::F32(texels) = &face.texels else { panic!("floats") };
            assert!(texels.iter().all(|t| same(*t, [0.1, 1.0, 3e4])), "{h} {n}: {texels:?}");
        }
        let back = equirectangular_of(&cube(n, |_, _, _| [0.1, 1.0, 3e4]), h);
        let Texels::F32(texels) = &back.texels else { panic!("floats") };
        assert!(texels.iter().all(|t| same(*t, [0.1, 1.0, 3e4])), "{h} {n}");
    }
}

/// Within one rounding of a float.
fn same(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= b * 1.2e-7)
}

#[test]
fn random_skies_keep_their_flux_and_nine_harmonics() {
    let mut rng = TestRng::new(8);
    for (h, n) in [(64, 40), (100, 33), (33, 128)] {
        let source = sky(h, |_, _| [rng.f32(), rng.f32() * 3.0, 1.0]);
        let (was, is) = (sky_moments(&source), cube_moments(&cube_of(&source, n)));
        close(&was, &is, 1e-3, &format!("to cube {h} {n}"));
        let source = cube(n, |_, _, _| [rng.f32(), rng.f32() * 3.0, 1.0]);
        let (was, is) = (cube_moments(&source), sky_moments(&equirectangular_of(&source, h)));
        close(&was, &is, 1e-3, &format!("to sphere {h} {n}"));
    }
}

/// Fluxes alike to rounding of floats, the other moments to a share of the flux.
#[track_caller]
fn close(was: &[f64; 9], is: &[f64; 9], tolerance: f64, what: &str) {
    assert!((was[0] - is[0]).abs() <= 1e-6 * was[0], "{what}: {was:?} {is:?}");
    for (a, b) in was.iter().zip(is) {
        assert!((a - b).abs() <= tolerance * was[0], "{what}: {was:?} {is:?}");
    }
}

#[test]
fn a_sun_of_one_texel_keeps_its_flux_wherever_it_is() {
    for (h, n) in [(64, 48), (33, 16), (16, 65)] {
        // New texels are at most so wide, so that the centre of a sun may move by half of it; gradients of the nine are
        // at most 3.
        let width = (PI / h as f64).max(2.0 / n as f64);
        let tolerance = 1e-3 + 3.0 * 0.71 * width;
        let w = 2 * h;
        // Poles, the seam, corners and edges of the cube, and somewhere.
        let places = [(0, 0), (w - 1, h - 1), (w / 2, 0), (0, h / 2), (w - 1, h / 2), (w / 8, h / 2), (5, 7)];
        let edge = (h as f64 * (0.5 - (0.5f64).sqrt().atan() / PI)) as usize;
        for (x, y) in places.into_iter().chain([(w / 8, edge), (w / 4, h / 4)]) {
            let source = sky(h, |i, j| [0.0, if (i, j) == (x, y) { 1e5 } else { 0.0 }, 0.0]);
            let (was, is) = (sky_moments(&source), cube_moments(&cube_of(&source, n)));
            close(&was, &is, tolerance, &format!("{h} {n}, sun at {x} {y}"));
        }
        for face in 0..6 {
            for (x, y) in [(0, 0), (n - 1, 0), (n - 1, n - 1), (n / 2, 0), (n / 2, n / 2), (3, 5)] {
                let source = cube(n, |f, i, j| [0.0, if (f, i, j) == (face, x, y) { 1e5 } else { 0.0 }, 0.0]);
                let (was, is) = (cube_moments(&source), sky_moments(&equirectangular_of(&source, h)));
                close(&was, &is, tolerance, &format!("{h} {n}, sun at {face} {x} {y}"));
            }
        }
    }
}

#[test]
fn a_smooth_sky_comes_back() {
    let h = 128;
    let value = |x: usize, y: usize| {
        let (latitude, longitude) =
            (PI * (0.5 - (y as f64 + 0.5) / h as f64), TAU * ((x as f64 + 0.5) / (2 * h) as f64 - 0.5));
        let v = 1.0 + 0.5 * latitude.sin() + 0.3 * latitude.cos() * (longitude + 1.0).cos();
        [v as f32; 3]
    };
    let source = sky(h, value);
    let back = equirectangular_of(&cube_of(&source, h), h);
    let mut worst = 0f32;
    for y in 0..h {
        for x in 0..2 * h {
            worst = worst.max((back.texel(x, y).g - source.texel(x, y).g).abs());
        }
    }
    // Means of means of texels of 1.4 degrees, whose slope is at most 0.6 a radian: half a texel of it.
    assert!(worst < 0.6 * 0.5 * 0.025, "{worst}");
    println!("a smooth sky comes back within {worst}");
}

#[test]
fn threads_change_nothing() {
    let mut rng = TestRng::new(2);
    let source = sky(70, |_, _| [rng.f32(), rng.f32(), rng.f32()]);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let faces = cube_of(&source, 90);
            let back = equirectangular_of(&faces, 70);
            (faces, back)
        })
    };
    assert_eq!(on(1), on(3));
}
