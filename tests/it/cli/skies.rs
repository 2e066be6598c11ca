//! Skies and lights at the edge of sense, by every way to sample them.

use super::folder::Folder;
use skylit::image::picture::{Picture, SampleKind};
use skylit::image::read::read_planes;
use skylit::image::write::{WriteOptions, write_picture};

const WAYS: [&str; 4] = ["compensated", "product", "table", "cosine"];

fn write_sky(f: &Folder, name: &str, [width, height]: [usize; 2], texel: impl Fn(usize) -> f32) {
    let mut picture = Picture::new(width, height);
    for channel in ["R", "G", "B"] {
        picture.push(channel, SampleKind::Float, (0..width * height).map(&texel).collect());
    }
    write_picture(&f.path().join(name), &picture, &WriteOptions::default()).unwrap();
}

fn scene(sky: &str, more: &str) -> String {
    format!(
        "[film]\nsize = [24, 18]\n[camera]\ntype = \"perspective\"\neye = [0, 0, 6]\nlook_at = [0, 0, 0]\n[sky]\n{sky}\n\
         [materials.clay]\ntype = \"diffuse\"\nalbedo = 0.5\n[materials.glass]\ntype = \"dielectric\"\n\
         [materials.lamp]\ntype = \"emissive\"\nradiance = 5\n{more}"
    )
}

const BALL: &str = "[[objects]]\nshape = { type = \"sphere\", radius = 1 }\nmaterial = \"clay\"\n";

/// Renders it, and returns standard error and the mean of all pixels, which are finite and not negative.
fn render(f: &Folder, flags: &str) -> (String, f64) {
    let run = f.run(&format!("render s.toml -o a.exr --full-float --spp 64 {flags}")).succeeds();
    let picture = read_planes(&f.path().join("a.exr")).unwrap();
    let red = &picture.plane("R").unwrap().data;
    assert!(red.iter().all(|v| v.is_finite() && *v >= 0.0), "{flags}");
    (run.stderr, red.iter().map(|v| f64::from(*v)).sum::<f64>() / red.len() as f64)
}

#[test]
fn skies_of_any_texels_are_rendered_by_every_way() {
    let f = Folder::new();
    write_sky(&f, "black.exr", [16, 8], |_| 0.0);
    write_sky(&f, "one.exr", [64, 32], |i| if i == 64 * 8 + 20 { 1e8 } else { 0.0 });
    write_sky(&f, "texel.exr", [1, 1], |_| 2.0);
    let bad = |i: usize| match i % 8 {
        0 => f32::NAN,
        1 => -3.0,
        2 => f32::NEG_INFINITY,
        _ => 1.0,
    };
    write_sky(&f, "bad.exr", [16, 8], bad);
    for way in WAYS {
        let sky = |name: &str| format!("type = \"sphere\"\npath = \"{name}.exr\"");
        let mean = |name: &str| {
            f.write("s.toml", scene(&sky(name), BALL));
            render(&f, &format!("--sky-sampling {way}"))
        };
        assert_eq!(mean("black").1, 0.0, "{way}");
        // The lit texel is behind the camera or beside the picture: only the ball shows its light.
        let lit = mean("one").1;
        assert!(lit > 0.0 || way == "cosine", "{way}: {lit}");
        // Radiance 2 from everywhere: the ball of albedo 1/2 shows 1 plus what it shows itself, which is nothing.
        let texel = mean("texel").1;
        assert!(1.0 < texel && texel < 2.0, "{way}: {texel}");
        let (told, value) = mean("bad");
        // 48 texels of three channels.
        assert!(told.contains("144 of 384 values were negative or not finite"), "{told}");
        assert!(value > 0.0 && value < 1.0, "{way}: {value}");
    }
}

#[test]
fn nothing_but_sky_traces_hardly_a_ray() {
    let f = Folder::new();
    f.write("s.toml", scene("type = \"midday\"", ""));
    let (_, sky) = render(&f, "--dealing even --stats s.json");
    let stats = f.json("s.json");
    let count = |a: &str, b: &str| stats[a][b].as_u64().unwrap();
    // Pixels of more than three degrees: some of them, at the horizon, are sampled.
    let (traced, spared) = (count("rays", "total"), count("skipped", "samples"));
    assert_eq!(traced + spared, 24 * 18 * 64);
    assert!(spared > 2 * traced, "{spared} {traced}");
    let (_, sampled) = render(&f, "--sky-pixels sample");
    // A thousandth, and the noise of 27,648 samples of a smooth sky.
    assert!((sky / sampled - 1.0).abs() < 2e-3, "{sky} {sampled}");
}

#[test]
fn a_lamp_inside_of_glass_is_found_by_rays_alone_and_stays_finite() {
    let f = Folder::new();
    let glass = "[[objects]]\nshape = { type = \"sphere\", radius = 1 }\nmaterial = \"glass\"\n\
                 [[objects]]\nshape = { type = \"sphere\", radius = 0.3 }\nmaterial = \"lamp\"\n";
    let near = scene("type = \"gradient\"", glass).replace("[sky]", "fov_deg = 8\n[sky]");
    f.write("s.toml", near);
    render(&f, "");
    let picture = read_planes(&f.path().join("a.exr")).unwrap();
    let middle = picture.plane("R").unwrap().data[9 * 24 + 12];
    // Radiance over the square of the index is carried on, through a surface of reflectance 0.04; some more comes by
    // reflections within the glass.
    let through = 5.0 / (1.5 * 1.5) * 0.96;
    assert!((through..1.1 * through).contains(&middle), "{middle} {through}");
}
