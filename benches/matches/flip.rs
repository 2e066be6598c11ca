//! LDR-FLIP (Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", 2020).

use super::picture::Pixels;
use skylit::compare::flip::{DEFAULT_PPD, ldr};

/// Mean of the error map at 67 pixels per degree, of 8-bit values taken as sRGB.
pub fn mean(ours: &Pixels, reference: &Pixels) -> f64 {
    let image = |p: &Pixels| -> Vec<[f32; 3]> {
        p.data.iter().map(|p| p.map(|v| f32::from(v as u8) / 255.0)).collect()
    };
    let size = [ours.width, ours.height];
    ldr(size, &image(reference), &image(ours), DEFAULT_PPD).expect("pictures of one size").mean
}
