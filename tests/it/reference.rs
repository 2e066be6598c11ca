//! Pictures against Mitsuba 3's of the same scenes: `tests/reference/make.py` made them, means above, standard
//! errors below.

use crate::common::{build_on, integrator};
use skylit::base::image_data::Texels;
use skylit::render::settings::RenderSettings;
use skylit::render::{Renderer, Silent};
use skylit::sampling::filter::PixelFilter;
use std::path::Path;

/// Every pixel within Monte Carlo error, and the means of the whole pictures too.
fn compare(name: &str, systematic: f64) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    let desc = skylit::formats::load(&folder.join(format!("{name}.toml"))).unwrap();
    let picture = skylit::image::read::read_image(&folder.join(format!("{name}.exr")), None).unwrap();
    let Texels::F32(texels) = &picture.texels else { panic!("float pictures") };
    let (width, height) = (picture.width, picture.height / 2);
    let scene = build_on("auto", desc);
    let settings = RenderSettings {
        spp: 1024,
        filter: PixelFilter::Box,
        threads: 2,
        moments: true,
        ..RenderSettings::new([width as u32, height as u32])
    };
    let integrator = integrator("path", &[("max_depth", 6.0), ("roulette_depth", 100.0)]);
    let film = Renderer { integrator, settings }.render(&scene, &Silent).unwrap().film;
    // Own error from the half-buffers, pooled over 5x5 pixels, as single pixels have one degree of freedom.
    let variance = film.variance(2).unwrap();
    let (mut square, mut sums, mut variances) = (0.0, [0.0; 3], [0.0; 3]);
    for (i, (x, y)) in film.window().pixels().enumerate() {
        let ours = film.mean(x, y).to_array();
        for c in 0..3 {
            let theirs = f64::from(texels[i][c]);
            let error = f64::from(texels[width * height + i][c]);
            let own = f64::from(variance[c][i]);
            let d = f64::from(ours[c]) - theirs;
            let allowed = (error * error + own).max(1e-12) + (systematic * theirs).powi(2);
            square += d * d / allowed;
            sums[c] += d;
            variances[c] += allowed;
        }
    }
    // Reduced chi-square: 1 where the errors are what they are said to be. Pooled variances blur edges, where single
    // pixels then count for more: 1.5 allows for that. A wrong material or light gives tens to thousands.
    let reduced = square / (3 * width * height) as f64;
    assert!(reduced < 1.5, "{name}: reduced chi-square {reduced}");
    for c in 0..3 {
        // Five standard errors of the whole picture's sum, and the systematic part of it.
        let total: f64 = texels[..width * height].iter().map(|t| f64::from(t[c])).sum();
        let allowed = 5.0 * variances[c].sqrt() + systematic * total;
        assert!(
            sums[c].abs() < allowed,
            "{name}, channel {c}: off by {} of {total}, allowed {allowed}",
            sums[c]
        );
    }
}

/// Both programs see the same analytic sky through bilinear tables at different places: each is within 1e-3 of it.
#[test]
fn clay_under_a_sky_agrees_with_mitsuba() {
    compare("clay", 2e-3);
}

#[test]
fn lamps_and_a_mirror_agree_with_mitsuba() {
    compare("lamps", 5e-4);
}
