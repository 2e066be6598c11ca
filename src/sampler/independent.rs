//! Independent uniform points: a hash of (pixel, dimension, index).

use super::dims::Dim;
use super::hash::mix32;

/// Two 32-bit fractions.
#[inline(always)]
pub(super) fn point(key: [u32; 2], dim: Dim, index: u32) -> [u32; 2] {
    let d = mix32(key[0] ^ dim.0.wrapping_mul(0x9e37_79b9));
    let x = mix32(d ^ mix32(index.wrapping_add(key[1])));
    [x, mix32(x ^ key[1].wrapping_add(0x85eb_ca6b))]
}
