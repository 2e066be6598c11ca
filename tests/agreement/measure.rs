//! For `run.py`: what this library says of pairs of pictures, as JSON.
//!
//!     cargo run --release --example measure -- ldr REF.png TEST.png | hdr REF.pfm TEST.pfm

use skylit::compare::{flip, ssim};

type Pixels = Vec<[f32; 3]>;

fn png(path: &str) -> ([usize; 2], Pixels) {
    let picture = image::open(path).expect("a picture").into_rgb8();
    let size = [picture.width() as usize, picture.height() as usize];
    (size, picture.pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect())
}

/// A colour PFM of little-endian floats: its rows go upwards.
fn pfm(path: &str) -> ([usize; 2], Pixels) {
    let bytes = std::fs::read(path).expect("a picture");
    let mut fields = bytes.split(|b| *b == b'\n');
    let mut line = || String::from_utf8_lossy(fields.next().expect("a header")).into_owned();
    let (magic, size, scale) = (line(), line(), line());
    assert_eq!((magic.as_str(), scale.starts_with('-')), ("PF", true), "{path}");
    let mut sides = size.split(' ').map(|n| n.parse::<usize>().expect("a number"));
    let size = [sides.next().expect("width"), sides.next().expect("height")];
    let data = &bytes[bytes.len() - size[0] * size[1] * 12..];
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let rows = data.chunks_exact(12 * size[0]).rev();
    let pixels = rows.flat_map(|r| r.chunks_exact(12));
    (size, pixels.map(|p| [float(p), float(&p[4..]), float(&p[8..])]).collect())
}

fn psnr(a: &Pixels, b: &Pixels) -> Option<f64> {
    let squares =
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    let mean = squares.sum::<f64>() / (3 * a.len()) as f64;
    (mean > 0.0).then(|| -10.0 * mean.log10())
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [kind, reference, test] = args.as_slice() else {
        panic!("ldr|hdr REF TEST");
    };
    let report = if kind == "hdr" {
        let ((size, a), (_, b)) = (pfm(reference), pfm(test));
        let found = flip::hdr(size, &a, &b, &flip::HdrOptions::default()).expect("two pictures of one size");
        serde_json::json!({ "hdr-flip": found.mean, "start": found.start, "stop": found.stop, "count": found.count })
    } else {
        let ((size, a), (_, b)) = (png(reference), png(test));
        let found = flip::ldr(size, &a, &b, flip::DEFAULT_PPD).expect("two pictures of one size");
        // Too small for the window: none.
        let similarity = ssim::ssim(size, &a, &b, &ssim::Options::default()).ok().map(|s| s.mean);
        serde_json::json!({ "flip": found.mean, "ssim": similarity, "psnr": psnr(&a, &b) })
    };
    println!("{report}");
}
