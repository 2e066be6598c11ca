use super::*;
use crate::base::registry::build;
use crate::base::skybox::{ChartPoint, Skybox};
use crate::color::Rgb;
use crate::image::read::read_planes;
use crate::skyboxes::REGISTRY;
use crate::testing::data_dir;
use glam::{DVec3, Vec3};

/// A PNG of one colour a face: its number in red, its size in the others.
fn write_png(path: &Path, w: u32, h: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) {
    image::RgbImage::from_fn(w, h, |x, y| image::Rgb(pixel(x, y))).save(path).unwrap();
}

fn folder(names: &[&str]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (i, name) in names.iter().enumerate() {
        write_png(&dir.path().join(name), 4, 4, |_, _| [10 * i as u8, 0, 0]);
    }
    dir
}

/// Which of `names` (by number) became which face.
fn order(names: &[&str]) -> [usize; 6] {
    let dir = folder(names);
    let faces = SkyFiles::find(dir.path()).and_then(|files| files.faces(Some(Encoding::Linear)));
    let faces = faces.unwrap_or_else(|e| panic!("{names:?}: {e}"));
    faces.map(|f| (f.texel(0, 0).r * 25.5).round() as usize)
}

fn message(path: &Path) -> String {
    let built = load_sky(path, None).and_then(|node| build("sky", REGISTRY, &node));
    built.err().map(|e| e.to_string()).expect("is refused")
}

#[test]
fn faces_are_known_by_any_usual_name() {
    let names: [[&str; 6]; 8] = [
        [
            "A_2_Left+X.png",
            "A_3_Right-X.png",
            "A_4_Up+Y.png",
            "A_5_Down-Y.png",
            "A_0_Front+Z.png",
            "A_1_Back-Z.png",
        ],
        ["px.png", "nx.png", "py.png", "ny.png", "pz.png", "nz.png"],
        ["posx.png", "negx.png", "posy.png", "negy.png", "posz.png", "negz.png"],
        ["sky_PosX.PNG", "sky_NegX.PNG", "sky_PosY.PNG", "sky_NegY.PNG", "sky_PosZ.PNG", "sky_NegZ.PNG"],
        ["x_pos.png", "x_neg.png", "y_pos.png", "y_neg.png", "z_pos.png", "z_neg.png"],
        ["right.png", "left.png", "top.png", "bottom.png", "front.png", "back.png"],
        [
            "stormright.png",
            "stormleft.png",
            "stormup.png",
            "stormdown.png",
            "stormfront.png",
            "stormback.png",
        ],
        ["a_rt.png", "a_lf.png", "a_up.png", "a_dn.png", "a_ft.png", "a_bk.png"],
    ];
    for n in names {
        assert_eq!(order(&n), [0, 1, 2, 3, 4, 5], "{n:?}");
    }
    // Without a word in the names their order says +Z -Z +X -X +Y -Y.
    assert_eq!(order(&["1.png", "2.png", "3.png", "4.png", "5.png", "6.png"]), [2, 3, 4, 5, 0, 1]);
    // Other pictures in the folder do not matter where all six are named.
    assert_eq!(order(&["px.png", "nx.png", "py.png", "ny.png", "pz.png", "nz.png", "preview.png"])[5], 5);
}

#[test]
fn what_is_no_sky_is_explained() {
    assert!(message(folder(&[]).path()).contains("no picture"));
    let dir = folder(&["px.png"]);
    assert!(message(dir.path()).contains("is 4x4") && message(dir.path()).contains("equirectangular (2:1)"));
    let five = message(folder(&["px.png", "nx.png", "py.png", "pz.png", "nz.png"]).path());
    assert!(five.contains("-Y of the six faces is missing") && five.contains("py.png"), "{five}");
    let two = message(folder(&["a.png", "b.png"]).path());
    assert!(two.contains("2 pictures"), "{two}");
    let dir = folder(&["px.png", "nx.png", "py.png", "ny.png", "pz.png", "nz.png"]);
    write_png(&dir.path().join("py.png"), 8, 8, |_, _| [0; 3]);
    let text = message(dir.path());
    assert!(text.contains("py.png") && text.contains("is 8x8, but px.png is 4x4"), "{text}");
    write_png(&dir.path().join("py.png"), 4, 5, |_, _| [0; 3]);
    assert!(message(dir.path()).contains("is 4x5; a cube face must be square"));
    std::fs::write(dir.path().join("py.png"), b"nothing").unwrap();
    assert!(message(dir.path()).contains("py.png"));
    let missing = load_sky(&dir.path().join("nowhere"), None).err().unwrap();
    assert_eq!(missing.exit_code(), 3);
    assert!(missing.to_string().contains("nowhere"));
    let wide = dir.path().join("wide.png");
    write_png(&wide, 8, 4, |_, _| [9; 3]);
    assert_eq!(load_sky(&wide, None).unwrap().kind, "sphere");
    assert!(SkyFiles::find(&wide).unwrap().faces(None).unwrap_err().to_string().contains("\"sphere\""));
}

/// A picture that unfolds a cube whose colours are the directions themselves; `None` is left black.
fn unfolded(w: u32, h: u32, size: u32, at: impl Fn(f64, f64) -> Option<DVec3>) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    write_png(&dir.path().join("sky.png"), w, h, |x, y| {
        let (u, v) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let d = at(u / f64::from(size), v / f64::from(size));
        d.map_or([0; 3], |d| {
            (d.normalize() * 127.0 + DVec3::splat(128.0)).to_array().map(|c| c.round() as u8)
        })
    });
    dir
}

#[test]
fn crosses_and_strips_fold_up() {
    let n = 32;
    // What stands in row 1 of a cross, from -X by way of +Z and +X to -Z; t up, both of [-1, 1].
    let around = |column: usize, s: f64, t: f64| match column {
        0 => DVec3::new(-1.0, t, s),
        1 => DVec3::new(s, t, 1.0),
        2 => DVec3::new(1.0, t, -s),
        _ => DVec3::new(-s, t, -1.0),
    };
    let cross = |x: f64, y: f64, tall: bool| {
        let (column, row) = (x as usize, y as usize);
        let (s, t) = (2.0 * x.fract() - 1.0, 1.0 - 2.0 * y.fract());
        match (column, row) {
            (_, 1) => Some(around(column, s, t)),
            (1, 0) => Some(DVec3::new(s, 1.0, -t)),
            (1, 2) => Some(DVec3::new(s, -1.0, t)),
            // Below -Y the picture goes on: z = -1, and y rises downwards.
            (1, 3) if tall => Some(DVec3::new(s, -t, -1.0)),
            _ => None,
        }
    };
    let strip = |i: usize, s: f64, t: f64| match i {
        0 => around(2, s, t),
        1 => around(0, s, t),
        2 => DVec3::new(s, 1.0, -t),
        3 => DVec3::new(s, -1.0, t),
        4 => around(1, s, t),
        _ => around(3, s, t),
    };
    let part = |v: f64| 2.0 * v.fract() - 1.0;
    let skies = [
        unfolded(4 * n, 3 * n, n, |x, y| cross(x, y, false)),
        unfolded(3 * n, 4 * n, n, |x, y| cross(x, y, true)),
        unfolded(6 * n, n, n, |x, y| Some(strip(x as usize, part(x), -part(y)))),
        unfolded(n, 6 * n, n, |x, y| Some(strip(y as usize, part(x), -part(y)))),
    ];
    for (i, dir) in skies.iter().enumerate() {
        let node = load_sky(dir.path(), Some(Encoding::Linear)).unwrap();
        assert_eq!(node.kind, "cube");
        let sky = build("sky", REGISTRY, &node).unwrap();
        let mut rng = crate::testing::TestRng::new(i as u64);
        for _ in 0..2000 {
            let d = rng.direction();
            let c = sky.radiance(d);
            let got = (Vec3::new(c.r, c.g, c.b) * 255.0 - 128.0) / 127.0;
            // Eight bits, and texels of 1 / 16 (at corners filled in by half of one).
            assert!((got - d).length() < 0.05, "layout {i}: {got} for {d}");
        }
    }
}

fn sky_of(path: &Path, encoding: Encoding) -> std::sync::Arc<dyn Skybox> {
    build("sky", REGISTRY, &load_sky(path, Some(encoding)).unwrap()).unwrap()
}

/// OpenEXR's chart: lettered axes in each of the six directions. On its middle line +X, +Z, -X and -Z follow at
/// columns 1/4, 1/2, 3/4 and 1, so that it is turned by a quarter against ours, but of the same hand: from each
/// horizontal axis a dark line runs some 22 degrees towards the positive one of the other two, and one upwards.
#[test]
fn the_orientation_chart_is_the_right_way_round() {
    let Some(data) = data_dir() else { return };
    let sky = sky_of(&data.join("env/exr/OrientationLatLong.exr"), Encoding::Srgb);
    // Their +X is at our column 1/4, which looks along -z; their +Z at the middle, which looks along +x.
    let ours = |d: DVec3| DVec3::new(d.z, d.y, -d.x);
    let darkness = |from: DVec3, to: DVec3, degrees: f64| {
        // The darkest of a few neighbours: lines are two texels wide.
        let across = from.cross(to);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let shift = |k: i32| ours((from * cos + to * sin + across * 0.004 * f64::from(k)).normalize());
        (-2..=2).map(|k| sky.radiance(shift(k).as_vec3()).luminance()).fold(f32::MAX, f32::min)
    };
    for axis in [DVec3::X, DVec3::Z] {
        let other = DVec3::ONE - DVec3::Y - axis;
        for from in [axis, -axis] {
            for degrees in [6.0, 12.0, 18.0] {
                let (along, up) = (darkness(from, other, degrees), darkness(from, DVec3::Y, degrees));
                assert!(along < 0.3 && up < 0.3, "{from}: {along} {up} at {degrees}");
                // No line on the other side; the thin letters there are light blue or absent.
                let back = darkness(from, -other, degrees);
                assert!(back > 0.3, "{from}: {back} at -{degrees}");
            }
        }
    }
}

/// The camera of the shared pictures: eye (5, 0, 0), looking along -x, 60 degrees high, y up; a pixel's centre is at
/// half-integers, its x runs along forward x up = -z.
fn seed_ray(x: f64, y: f64) -> DVec3 {
    let scale = 30f64.to_radians().tan() / 135.0;
    DVec3::new(-1.0, (135.0 - y) * scale, (240.0 - x) * scale).normalize()
}

/// Both pictures show a unit sphere 5 away: outside it, only the sky.
fn is_background(x: usize, y: usize) -> bool {
    (x as f64 + 0.5 - 240.0).hypot(y as f64 + 0.5 - 135.0) > 60.0
}

#[test]
fn the_pictures_of_the_original_program_show_this_sky() {
    let Some(data) = data_dir() else { return };
    let sky = sky_of(&data.join("scenes/seed/testscenes/skyboxes/above-sunset"), Encoding::Linear);
    for name in ["skyboxtest", "enviornmentmaptest"] {
        let picture = read_planes(&data.join(format!("images/seed-float/{name}.exr"))).unwrap();
        let planes = ["R", "G", "B"].map(|n| &picture.plane(n).unwrap().data);
        let (mut sum, mut count, mut worst) = (0.0, 0u32, 0f32);
        for (x, y) in (0..270).step_by(3).flat_map(|y| (0..480).step_by(3).map(move |x| (x, y))) {
            if !is_background(x, y) {
                continue;
            }
            let mut mean = Rgb::BLACK;
            for k in 0..64 {
                let (a, b) = (f64::from(k % 8) + 0.5, f64::from(k / 8) + 0.5);
                mean +=
                    sky.radiance(seed_ray(x as f64 + a / 8.0, y as f64 + b / 8.0).as_vec3()) * (1.0 / 64.0);
            }
            let i = y * 480 + x;
            let diff = mean - Rgb::new(planes[0][i], planes[1][i], planes[2][i]);
            sum += f64::from(diff.map(f32::abs).max_component());
            worst = worst.max(diff.map(f32::abs).max_component());
            count += 1;
        }
        // A pixel covers some 25 texels; theirs is the mean of 64 or 1024 random points of them without filtering,
        // ours of 64 regular ones: stars and edges differ by a few hundredths, the mean by half a thousandth.
        assert!(sum / f64::from(count) < 1e-3 && worst < 0.06, "{name}: {sum} over {count}, {worst}");
    }
}

#[test]
fn the_original_program_found_the_same_irradiance() {
    let Some(data) = data_dir() else { return };
    let sky = sky_of(&data.join("scenes/seed/testscenes/skyboxes/above-sunset"), Encoding::Linear);
    let grid = sky.grid();
    let cells = sky.cell_integrals(grid);
    let n = grid.width as usize;
    let irradiance = |normal: DVec3| {
        let at = |i: usize| (i as f64 + 0.5) / n as f64;
        let cell = |(i, flux): (usize, &f64)| {
            let c = ChartPoint { chart: (i / (n * n)) as u32, u: at(i % n), v: at(i / n % n) };
            flux * sky.direction(c).dot(normal).max(0.0)
        };
        cells.iter().enumerate().map(cell).sum::<f64>()
    };
    let picture = read_planes(&data.join("images/seed-float/enviornmentmaptest.exr")).unwrap();
    let planes = ["R", "G", "B"].map(|n| &picture.plane(n).unwrap().data);
    let mut ratios = Vec::new();
    for (x, y) in [(240, 135), (240, 100), (240, 170), (205, 135), (275, 135), (215, 110), (265, 160)] {
        // Where the middle of the block meets the unit sphere.
        let d = seed_ray(x as f64, y as f64);
        let b = 5.0 * d.x;
        let t = -b - (b * b - 24.0).sqrt();
        let normal = DVec3::new(5.0, 0.0, 0.0) + d * t;
        let mut seen = 0.0;
        for (px, py) in (y - 4..y + 4).flat_map(|py| (x - 4..x + 4).map(move |px| (px, py))) {
            let i = py * 480 + px;
            // The scene's albedo is (0.7, 0.7, 1).
            let l = Rgb::new(planes[0][i] / 0.7, planes[1][i] / 0.7, planes[2][i]);
            seen += f64::from(l.luminance()) / 64.0;
        }
        ratios.push(seen / irradiance(normal));
    }
    // It leaves the 1 / pi out of its diffuse shading, so that the ratio is 1: or any one number, the same everywhere.
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    for r in &ratios {
        // 64 pixels of 1024 samples each, from correlated random numbers.
        assert!((r / mean - 1.0).abs() < 0.02, "{ratios:?}");
    }
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
}
