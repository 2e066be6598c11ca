//! LDR-FLIP (Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", 2020), by its authors' own code.

use super::picture::Pixels;

/// Mean of the error map at 67 pixels per degree, of 8-bit values taken as sRGB.
pub fn mean(ours: &Pixels, reference: &Pixels) -> f64 {
    let image = |p: &Pixels| {
        let bytes: Vec<u8> = p.data.iter().flatten().map(|v| *v as u8).collect();
        nv_flip::FlipImageRgb8::with_data(p.width as u32, p.height as u32, &bytes)
    };
    let map = nv_flip::flip(image(reference), image(ours), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
    let map = map.to_vec();
    map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len().max(1) as f64
}
