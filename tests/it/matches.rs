//! The short form of the table of matches (`cargo bench --bench matches`): our own transcriptions of scenes that others
//! rendered, small, and the figures that the table is made of.

#[path = "../../benches/matches/flip.rs"]
mod flip;
#[path = "../../benches/matches/means.rs"]
mod means;
#[path = "../../benches/matches/picture.rs"]
mod picture;
#[path = "../../benches/matches/psnr.rs"]
mod psnr;
#[path = "../../benches/matches/shot.rs"]
mod shot;
#[path = "../../benches/matches/tiles.rs"]
mod tiles;

use picture::{Encoding, Pixels};
use shot::Wish;
use skylit::base::pixel_rect::PixelRect;
use skylit::color::srgb_to_linear;
use std::path::{Path, PathBuf};
use tiles::{Allowed, scores};

/// The shared data; None, and a word, where it is absent.
///
/// # Panics
/// Where it is absent and `SKYLIT_REQUIRE_DATA=1`.
fn data() -> Option<PathBuf> {
    let home = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dir = std::env::var_os("SKYLIT_DATA").map_or_else(|| home.join("../shared/data"), PathBuf::from);
    if dir.is_dir() {
        return Some(dir);
    }
    let required = std::env::var_os("SKYLIT_REQUIRE_DATA").is_some_and(|v| v == "1");
    assert!(!required, "SKYLIT_REQUIRE_DATA=1, but {} is no folder", dir.display());
    println!("skipped: no SKYLIT_DATA");
    None
}

/// Means over blocks of `n` x `n` pixels; what does not fill a block is left out.
fn reduced(p: &Pixels, n: usize) -> Pixels {
    let (width, height) = (p.width / n, p.height / n);
    let mut data = vec![[0.0; 3]; width * height];
    for (i, v) in p.data.iter().enumerate() {
        let (x, y) = (i % p.width / n, i / p.width / n);
        if x < width && y < height {
            (0..3).for_each(|c| data[y * width + x][c] += v[c] / (n * n) as f32);
        }
    }
    Pixels { width, height, data }
}

/// Renders a scene of ours at a fraction of its size, through the box that the reference is averaged with.
fn small(scene: &str, wish: Wish) -> (Pixels, Vec<[f32; 3]>, PixelRect) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes").join(scene);
    let desc = skylit::formats::load(&path).unwrap();
    let film = shot::render_desc(desc, &Wish { filter: Some("box"), threads: 2, ..wish }).unwrap();
    (shot::pixels(&film), shot::variances(&film), film.window())
}

/// Tiles of 64 or 128 pixels a side of the reference. What a whole picture may be off by: 1 % of a tile, for edges that the
/// references' wider filters carry over into the next tile and for textures of 8-bit values; beside that, noise: six
/// standard errors (3.3 are to be expected of 200 values).
fn assert_tiles(name: &str, ours: &Pixels, variances: &[[f32; 3]], reference: &Pixels, absolute: f64) {
    assert_eq!([ours.width, ours.height], [reference.width, reference.height], "{name}");
    let allowed = Allowed { relative: 0.01, absolute, correlation: 1.0 };
    let s = scores(ours, reference, Some(variances), &allowed);
    assert!(s.count >= 20 && s.worst.abs() < 6.0 && s.rms < 1.3, "{name}: {s:?}");
}

#[test]
fn cornell_box_agrees_with_tungsten() {
    let Some(data) = data() else { return };
    let reference = Pixels::read(&data.join("scenes/bitterli/cornell-box/pbrt/TungstenRender.exr")).unwrap();
    let wish = Wish { size: Some([128, 128]), spp: Some(32), ..Wish::default() };
    let (ours, variances, _) = small("cornell-box.toml", wish);
    assert_tiles("Cornell box", &ours, &variances, &reduced(&reference, 8), 1e-4);
}

#[test]
fn plates_and_lamps_agree_with_tungsten() {
    let Some(data) = data() else { return };
    let reference = Pixels::read(&data.join("scenes/bitterli/veach-mis/pbrt/TungstenRender.exr")).unwrap();
    let wish = Wish { size: Some([320, 180]), spp: Some(16), ..Wish::default() };
    let (ours, variances, _) = small("veach-mis.toml", wish);
    assert_tiles("plates", &ours, &variances, &reduced(&reference, 4), 1e-4);
}

/// By 8-bit values, decoded again; below the lamp, which is clipped there. What two paints make of a spectrum is not in
/// three channels, so only light that met one paint is asked for.
#[test]
fn direct_light_in_the_cornell_box_agrees_with_mitsuba() {
    let Some(data) = data() else { return };
    let bytes = Pixels::read(&data.join("scenes/mitsuba/reference/integrator_depth_2.jpg")).unwrap();
    let decoded = bytes.data.iter().map(|p| p.map(|v| srgb_to_linear(v / 255.0))).collect();
    let linear = Pixels { data: decoded, ..bytes };
    let wish = Wish {
        size: Some([125, 125]),
        spp: Some(32),
        max_depth: Some(1),
        crop: Some([0.0, 1.0, 0.256, 1.0]),
        sampler: Some("owen-sobol"),
        ..Wish::default()
    };
    let (ours, variances, window) = small("mitsuba-cbox.toml", wish);
    // One step of 255 where it is dark.
    assert_tiles("direct light", &ours, &variances, &reduced(&linear, 4).cropped(window).unwrap(), 3e-4);
}

/// The pair that nv-flip's own test holds, with the mean it expects to 1e-4, and the PSNR that scikit-image gives.
#[test]
fn figures_of_a_known_pair() {
    let Some(data) = data() else { return };
    let read = |name: &str| Pixels::read(&data.join("images/flip").join(name)).unwrap();
    let (reference, test) = (read("tree-ref.png"), read("tree-test.png"));
    let flip = flip::mean(&test, &reference);
    assert!((flip - 0.133285).abs() < 1e-4, "FLIP {flip}");
    let psnr = psnr::psnr(&test, &reference);
    assert!((psnr - 22.2841).abs() < 1e-4, "PSNR {psnr}");
    assert_eq!(psnr::psnr(&test, &test), f64::INFINITY);
    assert_eq!(flip::mean(&test, &test), 0.0);
}

#[test]
fn means_and_tiles_see_what_they_should() {
    let flat = |v: f32| Pixels { width: 32, height: 32, data: vec![[v, v, v]; 1024] };
    let (one, more) = (flat(1.0), flat(1.01));
    assert!((means::relative_difference(&more, &one) - 0.01).abs() < 1e-6, "f32 values");
    assert_eq!(means::relative_difference(&flat(0.0), &flat(0.0)), 0.0);
    let allowed = Allowed { relative: 0.001, absolute: 0.0, correlation: 1.0 };
    let s = scores(&more, &one, None, &allowed);
    assert!(s.count == 4 && (s.worst - 10.0).abs() < 1e-3 && (s.rms - 10.0).abs() < 1e-3, "{s:?}");
    // Our own noise, of 0.16 a pixel, is 0.01 a tile.
    let s = scores(&more, &one, Some(&vec![[0.0256; 3]; 1024]), &Allowed { relative: 0.0, ..allowed });
    assert!((s.worst - 1.0).abs() < 1e-3, "{s:?}");
    assert_eq!(reduced(&one, 16).data, vec![[1.0; 3]; 4]);
    // Ambient light of 0.7 gives 178 in the course's pictures.
    assert_eq!([Encoding::Course, Encoding::Srgb].map(|e| e.encode(0.7)), [178.0, 218.0]);
    assert_eq!([Encoding::Gamma22, Encoding::Linear].map(|e| e.encode(2.0)), [255.0, 2.0]);
}
