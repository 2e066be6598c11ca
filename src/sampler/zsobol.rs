//! Owen-scrambled Sobol' pairs dealt along a curve through all pixels, so that their errors are blue noise: what one pixel
//! has too much its neighbours have too little, and the eye, a filter or a smaller copy of the picture sees less of it
//! (A. G. M. Ahmed and P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical
//! Ordering of Pixels", ACM TOG 39(6), 2020).
//!
//! One sequence serves the picture. With 2^k samples a pixel, the pixel that is number z on the Morton curve takes points
//! z 2^k to (z + 1) 2^k - 1, so that each pixel, each 2 x 2 pixels, each 4 x 4 has a (0,m,2)-net. The order is shuffled
//! along each dimension by a nested scramble, which keeps those nets, mixes pixels within them, and pairs dimensions at
//! random. Alone, a pixel's points are distributed as those of [`super::owen_sobol`]: its own error is the same.

use super::dims::Dim;
use super::hash::mix32;
use super::owen_sobol::Pair;

/// Where a pixel's points lie, with 2^`bits` of them: the number of its sequence, and the index of its first point there.
/// A sequence of 2^32 points serves 8192 x 8192 pixels of 64; further pixels take further sequences.
pub(super) fn place(pixel: [u32; 2], bits: u32) -> [u32; 2] {
    let z = (spread(pixel[1]) << 1) | spread(pixel[0]);
    let first = z << bits.min(31);
    // 62 bits at most stand above: of pixels of one picture, 32 tell apart.
    [(z >> (32 - bits.min(31))) as u32, first as u32]
}

/// The bits of a number at the even places.
const fn spread(v: u32) -> u64 {
    let v = v as u64;
    let v = (v | (v << 16)) & 0x0000_ffff_0000_ffff;
    let v = (v | (v << 8)) & 0x00ff_00ff_00ff_00ff;
    let v = (v | (v << 4)) & 0x0f0f_0f0f_0f0f_0f0f;
    let v = (v | (v << 2)) & 0x3333_3333_3333_3333;
    (v | (v << 1)) & 0x5555_5555_5555_5555
}

/// The sequence of a dimension.
#[inline(always)]
pub(super) fn pair(key: [u32; 2], dim: Dim) -> Pair {
    Pair::of_seeds(mix32(key[0] ^ dim.0.wrapping_mul(0x9e37_79b9)), 0x6a09_e667)
}

/// Where sample `index` of a pixel stands in the sequence. More samples than were announced go on with the points of the
/// pixels that follow: as good for the pixel, but no longer blue.
#[inline(always)]
pub(super) fn index(key: [u32; 2], index: u32) -> u32 {
    key[1].wrapping_add(index)
}

#[cfg(test)]
mod tests {
    use super::super::{PixelSampler, Sampler};
    use super::*;

    #[test]
    fn pixels_lie_along_the_morton_curve() {
        assert_eq!(place([0, 0], 3), [0, 0]);
        assert_eq!(place([1, 0], 3), [0, 8]);
        assert_eq!(place([0, 1], 3), [0, 16]);
        assert_eq!(place([3, 5], 0), [0, 0b100111]);
        // 2^26 pixels of 2^6 points fill a sequence.
        assert_eq!(place([8191, 8191], 6), [0, u32::MAX - 63]);
        assert_eq!(place([8192, 0], 6), [1, 0]);
        assert_eq!(place([0, 8192], 6), [2, 0]);
        assert_eq!(place([1, 0], 31), [0, 1 << 31]);
    }

    #[test]
    fn every_aligned_square_of_pixels_has_a_net() {
        let points = Sampler::ZSobol.points(5, Some(4));
        let dim = Dim::LENS;
        for side in [1u32, 2, 4, 8] {
            for [x0, y0] in [[0, 0], [16, 8], [1016, 640]] {
                let m = 2 + 2 * side.trailing_zeros();
                for split in 0..=m {
                    let mut seen = vec![0u8; 1 << m];
                    for (x, y) in (0..side * side).map(|i| (x0 + i % side, y0 + i / side)) {
                        let pixel: PixelSampler = points.pixel(x, y, 0);
                        for i in 0..4 {
                            let [u, v] = pixel.get_2d(i, dim);
                            let (nx, ny) = ((1u32 << split) as f32, (1u32 << (m - split)) as f32);
                            seen[(u * nx) as usize * (1 << (m - split)) + (v * ny) as usize] += 1;
                        }
                    }
                    assert!(seen.iter().all(|&s| s == 1), "side {side} split {split}");
                }
            }
        }
    }
}
