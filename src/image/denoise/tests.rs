use super::*;

/// Numbers for tests: splitmix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    /// In (0, 1).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + 1e-17
    }

    fn gaussian(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Mean 1, variance `1 / n`: a mean of `n` exponentially distributed samples.
    fn gamma(&mut self, n: u32) -> f64 {
        (0..n).map(|_| -self.uniform().ln()).sum::<f64>() / f64::from(n)
    }
}

/// A picture whose truth is known.
struct Scene {
    width: usize,
    height: usize,
    truth: Vec<[f32; 3]>,
    features: Vec<Vec<f32>>,
}

/// Samples a half, by which noise is measured here.
const SAMPLES: u32 = 4;

impl Scene {
    /// A ball before a chequered floor and a sky: edges of albedo and of normals, smooth shading, and a shadow's
    /// edge that no feature shows. Features are albedo, normal and depth; the sky has none (NaN).
    fn ball(width: usize, height: usize) -> Self {
        let mut scene = Scene { width, height, truth: Vec::new(), features: vec![Vec::new(); 7] };
        for i in 0..width * height {
            let (x, y) = ((i % width) as f32 / height as f32, (i / width) as f32 / height as f32);
            let (dx, dy) = ((x - 0.7) / 0.3, (y - 0.5) / 0.3);
            let r2 = dx * dx + dy * dy;
            let (albedo, normal, depth, light) = if r2 < 1.0 {
                let z = (1.0 - r2).sqrt();
                let light = (0.5 * dx - 0.6 * dy + 0.62 * z).max(0.0);
                ([0.7, 0.3, 0.2], [dx, -dy, z], 3.0 - 0.3 * z, 2.0 * light + 0.1)
            } else if y > 0.45 {
                let depth = 1.0 / (y - 0.3);
                let odd = ((x - 0.7) * depth * 4.0).floor() as i32 + (depth * 4.0).floor() as i32;
                let albedo = if odd % 2 == 0 { [0.8; 3] } else { [0.2, 0.3, 0.5] };
                let shadow = x + 0.5 * y < 0.8;
                (albedo, [0.0, 1.0, 0.0], depth, if shadow { 0.3 } else { 1.2 + 0.3 * x })
            } else {
                let sky = 1.0 + y;
                scene.truth.push([0.4 * sky, 0.6 * sky, 1.5]);
                scene.features.iter_mut().for_each(|f| f.push(f32::NAN));
                continue;
            };
            scene.truth.push(albedo.map(|a| a * light));
            let values = albedo.into_iter().chain(normal).chain([depth]);
            scene.features.iter_mut().zip(values).for_each(|(f, v)| f.push(v));
        }
        scene
    }

    /// One colour, no features.
    fn plain(width: usize, height: usize, color: [f32; 3]) -> Self {
        Scene { width, height, truth: vec![color; width * height], features: Vec::new() }
    }

    /// Two halves with the noise of exponentially distributed samples, half of it common to the channels.
    fn noisy(&self, seed: u64) -> [Vec<[f32; 3]>; 2] {
        let mut random = Random(seed);
        [0, 1].map(|_| {
            let mut pixel = |c: &[f32; 3]| {
                let common = random.gamma(SAMPLES);
                c.map(|v| (f64::from(v) * (0.5 * common + 0.5 * random.gamma(SAMPLES))) as f32)
            };
            self.truth.iter().map(&mut pixel).collect()
        })
    }

    fn halves<'a>(&'a self, color: &'a [Vec<[f32; 3]>; 2]) -> Halves<'a> {
        Halves {
            width: self.width,
            height: self.height,
            color: [&color[0], &color[1]],
            features: self.features.iter().map(|f| [&f[..], &f[..]]).collect(),
        }
    }

    /// Mean of squared errors by the square of the truth, floored at 0.01.
    fn relative_error(&self, color: &[[f32; 3]]) -> f64 {
        let terms = color.as_flattened().iter().zip(self.truth.as_flattened()).map(|(&v, &t)| {
            let (v, t) = (f64::from(v), f64::from(t));
            (v - t) * (v - t) / (t * t + 0.01)
        });
        terms.sum::<f64>() / color.as_flattened().len() as f64
    }
}

fn mean(color: &[Vec<[f32; 3]>; 2]) -> Vec<[f32; 3]> {
    let pairs = color[0].iter().zip(&color[1]);
    pairs.map(|(a, b)| std::array::from_fn(|c| 0.5 * a[c] + 0.5 * b[c])).collect()
}

fn run(input: &Halves) -> Denoised {
    denoise(input).unwrap()
}

fn all_finite(out: &Denoised, pixels: usize) -> bool {
    let planes = [&out.color, &out.error];
    planes.iter().all(|p| p.len() == pixels && p.as_flattened().iter().all(|v| v.is_finite()))
        && out.error.as_flattened().iter().all(|&e| e >= 0.0)
}

/// With the features that show most edges, and 8 samples a pixel. Measured: factors of 29 to 36 with eight seeds.
/// 361 pixels of a window limit it to about 100; edges and the unknowns of a fit cost the rest.
#[test]
fn noise_falls_and_light_stays() {
    let scene = Scene::ball(128, 80);
    let color = scene.noisy(1);
    let input = scene.halves(&color);
    let out = run(&input);
    let (before, after) = (scene.relative_error(&mean(&color)), scene.relative_error(&out.color));
    assert!(after < before / 25.0, "{before} {after}");
    let bias = out.bias(&input);
    assert!((bias.ratio - 1.0).abs() < 0.01, "{bias:?}");
    let luminance = |c: &[f32; 3]| c.iter().zip(LUMINANCE).map(|(&v, w)| f64::from(v * w)).sum::<f64>();
    let total = |p: &[[f32; 3]]| p.iter().map(luminance).sum::<f64>();
    let truth = total(&out.color) / total(&scene.truth);
    assert!((truth - 1.0).abs() < 0.01, "{truth}");
}

/// Squares of the floor are as small as a patch and the noise is as large as their contrast, so that half of the
/// picture stays as it was: measured, a factor of 2.1.
#[test]
fn without_features_noise_falls_less() {
    let mut scene = Scene::ball(128, 80);
    let color = scene.noisy(1);
    let with = scene.relative_error(&run(&scene.halves(&color)).color);
    scene.features.clear();
    let out = run(&scene.halves(&color));
    let (before, after) = (scene.relative_error(&mean(&color)), scene.relative_error(&out.color));
    assert!(after < before / 1.8 && with < after / 10.0, "{before} {after} {with}");
}

/// On average over the picture. Most of the error is below the noise of its estimate, which errs to the safe side:
/// measured with these seeds, 1.15 to 2.12 times the real one, 1.68 in the mean.
#[test]
fn the_error_is_known() {
    let scene = Scene::ball(128, 80);
    let ratio = |seed| {
        let color = scene.noisy(seed);
        let out = run(&scene.halves(&color));
        let share = |of: &dyn Fn(usize, usize) -> f32| {
            let terms = (0..scene.truth.len()).flat_map(|i| (0..3).map(move |c| (i, c)));
            terms.map(|(i, c)| f64::from(of(i, c) / (scene.truth[i][c].powi(2) + 0.01))).sum::<f64>()
        };
        share(&|i, c| out.error[i][c]) / share(&|i, c| (out.color[i][c] - scene.truth[i][c]).powi(2))
    };
    let ratios: Vec<f64> = (1..9).map(ratio).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!((0.5..2.0).contains(&mean) && ratios.iter().all(|r| (0.5..3.0).contains(r)), "{ratios:?}");
}

#[test]
fn an_edge_that_only_a_feature_shows_stays_sharp() {
    let (width, height, edge) = (64, 48, 32);
    let step = |i: usize| if i % width < edge { 0.5 } else { 0.6 };
    let truth = (0..width * height).map(|i| [step(i); 3]).collect();
    let albedo = (0..width * height).map(|i| if i % width < edge { 0.2 } else { 0.8 }).collect();
    let mut scene = Scene { width, height, truth, features: vec![albedo] };
    let mut random = Random(5);
    // Noise of twice the step hides it from the eye, and from the weights.
    let color = [0, 1].map(|_| -> Vec<[f32; 3]> {
        scene.truth.iter().map(|c| c.map(|v| v + 0.2 * random.gaussian() as f32)).collect()
    });
    let height_of_step = |out: &Denoised| {
        let column = |x: usize| {
            (0..height).map(|y| f64::from(out.color[y * width + x][1])).sum::<f64>() / height as f64
        };
        column(edge) - column(edge - 1)
    };
    let sharp = height_of_step(&run(&scene.halves(&color)));
    scene.features.clear();
    let blurred = height_of_step(&run(&scene.halves(&color)));
    assert!((sharp - 0.1).abs() < 0.02 && blurred < 0.05, "{sharp} {blurred}");
}

/// Noise in features is taken out first. It is half the contrast of albedo here; measured relative errors are
/// 0.0016 without it, 0.0074 with it, and 0.026 without features.
#[test]
fn noisy_features_still_help() {
    let mut scene = Scene::ball(128, 80);
    let color = scene.noisy(1);
    let mut random = Random(9);
    let noisy: Vec<[Vec<f32>; 2]> = scene
        .features
        .iter()
        .map(|f| [0, 1].map(|_| f.iter().map(|v| v + 0.1 * random.gaussian() as f32).collect()))
        .collect();
    let mut input = scene.halves(&color);
    input.features = noisy.iter().map(|[a, b]| [&a[..], &b[..]]).collect();
    let noisy = scene.relative_error(&run(&input).color);
    scene.features.clear();
    let none = scene.relative_error(&run(&scene.halves(&color)).color);
    assert!(noisy < none / 2.5, "{noisy} {none}");
}

/// A sun of a few pixels beside a sky: neither loses to the other. Single pixels of the noisy sky reach 2.5; measured
/// after: 1.5.
#[test]
fn a_sun_does_not_bleed() {
    let mut scene = Scene::plain(64, 48, [1.0, 1.0, 1.0]);
    let inside = |i: usize| ((i % 64) as f32 - 30.3).hypot((i / 64) as f32 - 24.2);
    let sun: Vec<usize> = (0..scene.truth.len()).filter(|&i| inside(i) < 3.0).collect();
    for &i in &sun {
        // Its rim is covered in part.
        scene.truth[i] = [4000.0 * (3.0 - inside(i)).min(1.0); 3];
    }
    let color = scene.noisy(2);
    let input = scene.halves(&color);
    let out = run(&input);
    let sky: Vec<f32> =
        (0..scene.truth.len()).filter(|i| !sun.contains(i)).map(|i| out.color[i][1]).collect();
    let brightest = sky.iter().copied().fold(0.0, f32::max);
    let bias = out.bias(&input);
    let before = scene.relative_error(&mean(&color));
    assert!(brightest < 2.0, "{brightest}");
    assert!((bias.ratio - 1.0).abs() < 0.01, "{bias:?}");
    assert!(scene.relative_error(&out.color) < before / 4.0);
}

#[test]
fn a_firefly_is_left_and_harms_nobody() {
    let scene = Scene::plain(40, 40, [0.5, 0.4, 0.3]);
    let mut color = scene.noisy(3);
    let at = 20 * 40 + 20;
    let clean = run(&scene.halves(&color));
    color[0][at] = [1e8; 3];
    let input = scene.halves(&color);
    let kept = run(&input);
    assert_eq!((kept.outliers, kept.color[at]), (1, input.plain(at).unwrap()));
    assert!((kept.bias(&input).ratio - 1.0).abs() < 1e-6);
    assert!(kept.error[at][0] > 1e15);
    assert!(all_finite(&kept, 1600));
    for i in (0..1600).filter(|&i| i != at) {
        assert!((kept.color[i][1] / clean.color[i][1] - 1.0).abs() < 0.5, "{i} {:?}", kept.color[i]);
    }
}

/// Without noise nothing is gained, and so nothing is done.
#[test]
fn a_picture_without_noise_comes_back() {
    let ball = Scene::ball(50, 37);
    let black = Scene::plain(20, 20, [0.0; 3]);
    let bright = Scene::plain(20, 20, [1e-20, 1e-19, 1e-20]);
    for scene in [ball, black, bright] {
        let color = [scene.truth.clone(), scene.truth.clone()];
        let out = run(&scene.halves(&color));
        assert!(out.color == scene.truth);
        assert!(out.error.as_flattened().iter().all(|&e| e == 0.0));
    }
}

#[test]
fn threads_change_no_bit() {
    let scene = Scene::ball(70, 45);
    let color = scene.noisy(4);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&scene.halves(&color)))
    };
    assert!(with(1) == with(2));
}

/// Twice the light is twice the picture, to the bit for powers of two.
#[test]
fn exposure_does_not_matter() {
    let scene = Scene::ball(40, 30);
    let color = scene.noisy(6);
    let out = run(&scene.halves(&color));
    for exposure in [2f32.powi(-40), 2f32.powi(30)] {
        let scaled = color.each_ref().map(|half| half.iter().map(|c| c.map(|v| v * exposure)).collect());
        let scaled = run(&scene.halves(&scaled));
        assert!(scaled.color.iter().zip(&out.color).all(|(s, c)| *s == c.map(|v| v * exposure)));
    }
}

#[test]
fn broken_pixels_are_filled_and_poison_nobody() {
    let scene = Scene::ball(60, 40);
    let mut color = scene.noisy(7);
    let whole = scene.relative_error(&run(&scene.halves(&color)).color);
    let broken: Vec<usize> = (0..2400).filter(|i| i % 23 == 0).collect();
    for (n, &i) in broken.iter().enumerate() {
        let value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][n % 3];
        color[n % 2][i][n % 3] = value;
        if n % 5 == 0 {
            color[1 - n % 2][i] = [value; 3];
        }
    }
    let out = run(&scene.halves(&color));
    assert!(all_finite(&out, 2400));
    let after = scene.relative_error(&out.color);
    assert!(after < 1.5 * whole, "{whole} {after}");
}

#[test]
fn nothing_is_too_odd() {
    let numbers = [0.0, 1.0, -1.0, 1e-38, 3e38, -3e38, f32::NAN, f32::INFINITY, 1e8, 1e-10];
    for (width, height) in [(1, 1), (1, 37), (37, 1), (2, 2), (17, 16), (33, 5), (0, 0), (0, 5)] {
        let mut random = Random(8);
        let mut odd = || numbers[(random.uniform() * 10.0) as usize % 10];
        let n = width * height;
        let color = [0, 1].map(|_| -> Vec<[f32; 3]> { (0..n).map(|_| [odd(), odd(), odd()]).collect() });
        let features: Vec<[Vec<f32>; 2]> =
            (0..3).map(|_| [0, 1].map(|_| (0..n).map(|_| odd()).collect())).collect();
        for count in 0..=3 {
            let features = features[..count].iter().map(|[a, b]| [&a[..], &b[..]]).collect();
            let input = Halves { width, height, color: [&color[0], &color[1]], features };
            assert!(all_finite(&run(&input), n), "{width} x {height}");
        }
        let nothing = vec![[f32::NAN; 3]; n];
        let input = Halves { width, height, color: [&nothing, &nothing], features: Vec::new() };
        let out = run(&input);
        assert!(all_finite(&out, n) && out.color.iter().all(|&c| c == [0.0; 3]));
        assert_eq!(out.bias(&input), Bias { ratio: 1.0, difference: 0.0 });
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let scene = Scene::plain(4, 4, [1.0; 3]);
    let color = [scene.truth.clone(), scene.truth.clone()];
    let mut input = scene.halves(&color);
    let plane = [0.0; 16];
    input.features = vec![[&plane, &plane[..15]]];
    let error = denoise(&input).unwrap_err().to_string();
    assert_eq!(error, "feature 0: a plane of 15 values, for a picture of 16 pixels");
    input.features = vec![[&plane, &plane]; MAX_FEATURES + 1];
    assert_eq!(denoise(&input), Err(DenoiseError::TooManyFeatures(16)));
    input.width = 3;
    assert!(denoise(&input).is_err());
}
