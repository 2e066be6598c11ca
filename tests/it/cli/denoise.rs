//! `--denoise`.

use super::folder::Folder;
use skylit::image::picture::Picture;
use skylit::image::read::read_planes;

fn planes(f: &Folder, name: &str) -> Picture {
    read_planes(&f.path().join(name)).unwrap()
}

fn data<'a>(p: &'a Picture, name: &str) -> &'a [f32] {
    &p.plane(name).unwrap_or_else(|| panic!("no {name}")).data
}

fn mean_square(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / a.len() as f64
}

#[test]
fn the_layer_has_less_noise_and_the_picture_is_left_alone() {
    let f = Folder::new();
    let scene = std::fs::read_to_string(f.path().join("scene.toml")).unwrap();
    let ball = "[[objects]]\nshape = { type = \"sphere\", center = [0.4, 0.2, -1], radius = 1.3 }\nmaterial = \"clay\"\n";
    f.write("ball.toml", scene.replace("\"constant\"", "\"midday\"") + ball);
    // By light samples that leave something to do; what is left by products is below.
    let render = |flags: &str| {
        f.run(&format!("render ball.toml --size 192x144 --sky-sampling table {flags}")).succeeds()
    };
    render("--spp 512 --seed 9 -o truth.exr");
    render("--spp 8 --aov variance -o plain.exr");
    let run = render("--spp 8 --aov variance --denoise -o both.exr -o both.png --stats s.json");
    assert!(run.stderr.contains("denoise mean luminance x"), "{}", run.stderr);
    let (truth, plain, both) = (planes(&f, "truth.exr"), planes(&f, "plain.exr"), planes(&f, "both.exr"));
    // Layers that were not asked for are not written.
    assert!(both.plane("albedo.R").is_none() && both.plane("normal.X").is_none());
    for c in ["R", "G", "B"] {
        assert_eq!(data(&plain, c), data(&both, c), "the picture itself changed");
        let denoised = data(&both, &format!("denoised.{c}"));
        let [before, after] = [data(&both, c), denoised].map(|x| mean_square(x, data(&truth, c)));
        // Measured: a third to a tenth; what is left is the noise of outlines, which are as thin as a pixel.
        assert!(after < before / 2.0, "{c}: {before} {after}");
    }
    // By products, the noise of eight samples is mostly that of outlines (measured: 0.69 of it is left): still no worse.
    f.run("render ball.toml --size 192x144 --spp 8 --aov variance --denoise -o usual.exr").succeeds();
    let usual = planes(&f, "usual.exr");
    for c in ["R", "G", "B"] {
        let error = |name: &str| mean_square(data(&usual, name), data(&truth, c));
        let [before, after] = [c.to_owned(), format!("denoised.{c}")].map(|name| error(&name));
        assert!(after < before, "{c}: {before} {after}");
    }
    let report = &f.json("s.json")["denoised"];
    assert!((report["mean_ratio"].as_f64().unwrap() - 1.0).abs() < 0.01, "{report}");
    assert!(report["error_after"].as_f64() < report["error_before"].as_f64(), "{report}");
    // What a PNG shows is the layer.
    render("--spp 8 --aov variance -o plain.png");
    let bytes = |name: &str| std::fs::read(f.path().join(name)).unwrap();
    assert_ne!(bytes("plain.png"), bytes("both.png"));
    f.refuses("render ball.toml --spp 1 --denoise -o a.exr", 2, &["--denoise", "--spp 2"]);
}
