//! LDR-FLIP (Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", 2020).

use super::picture::Pixels;
use skylit::compare::flip::{DEFAULT_PPD, ldr};

/// Mean of the error map at 67 pixels per degree, of 8-bit values taken as sRGB.
pub fn mean(ours: &Pixels, reference: &Pixels) -> f64 {
    let planes = |p: &Pixels| -> [Vec<f32>; 3] {
        std::array::from_fn(|c| p.data.iter().map(|p| f32::from(p[c] as u8) / 255.0).collect())
    };
    let [reference, test] = [planes(reference), planes(ours)];
    let [reference, test] = [&reference, &test].map(|p| p.each_ref().map(|p| &p[..]));
    ldr([ours.width, ours.height], reference, test, DEFAULT_PPD).expect("pictures of one size").mean
}
