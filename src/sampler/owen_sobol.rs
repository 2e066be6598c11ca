//! Owen-scrambled Sobol' pairs, padded: every dimension pair is the same two-dimensional (0,2)-sequence in base 2,
//! under its own random order and its own scrambling, as proposed by B. Burley, "Practical Hash-based Owen
//! Scrambling", JCGT 9(4), 2020 (shuffled scrambled Sobol').
//!
//! Any 2^k successive points that start at a multiple of 2^k put exactly one point into each of the 2^k elementary
//! intervals of every shape; scrambling keeps that and makes the error of the mean fall as n^-1.5 on smooth
//! integrands (Owen, "Scrambled net variance for integrals of smooth functions", Annals of Statistics 25(4), 1997).
//! All points count, point 0 among them (Owen, "On dropping the first Sobol' point", 2020).

use super::dims::Dim;
use super::hash::mix32;

/// One dimension pair of one pixel: three 32-bit seeds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    order: u32,
    x: u32,
    y: u32,
}

/// A permutation of u32 in which each output bit depends on the same and the lower input bits alone, so that on
/// bit-reversed numbers it is a nested uniform scramble in the sense of Owen (1995). The form is that of Laine and
/// Karras ("Stratified Sampling for Stochastic Transparency", 2011, section 3), the constants are those N. Vegdahl
/// searched for ("Building a Better LK Hash", 2021).
#[inline(always)]
const fn scramble_from_low(mut v: u32, seed: u32) -> u32 {
    v ^= v.wrapping_mul(0x3d20_adea);
    v = v.wrapping_add(seed);
    v = v.wrapping_mul((seed >> 16) | 1);
    v ^= v.wrapping_mul(0x0552_6c56);
    v ^ v.wrapping_mul(0x53a2_2864)
}

/// The second Sobol' coordinate of index `i`, bits reversed. Its generator matrix is Pascal's triangle modulo 2, and
/// binom(j, k) is odd exactly if k's bits are among j's (Lucas), so output bit k is the parity of the input bits j
/// whose number contains k: a sum over supersets, in five butterfly steps.
#[inline(always)]
const fn pascal(i: u32) -> u32 {
    let i = i ^ ((i >> 1) & 0x5555_5555);
    let i = i ^ ((i >> 2) & 0x3333_3333);
    let i = i ^ ((i >> 4) & 0x0f0f_0f0f);
    let i = i ^ ((i >> 8) & 0x00ff_00ff);
    i ^ (i >> 16)
}

impl Pair {
    /// The pair of dimension `dim` of the pixel with this key.
    #[inline(always)]
    pub(super) fn new(key: [u32; 2], dim: Dim) -> Self {
        Self::of_seeds(mix32(key[0] ^ dim.0.wrapping_mul(0x9e37_79b9)), key[1])
    }

    /// The pair with this order, scrambled by a second seed.
    #[inline(always)]
    pub(super) fn of_seeds(order: u32, second: u32) -> Self {
        let x = mix32(order ^ second);
        Pair { order, x, y: mix32(x.wrapping_add(0x85eb_ca6b)) }
    }

    /// The index's place in the shuffled order. Shuffling by a nested scramble keeps every aligned block of 2^k
    /// indices an aligned block.
    #[inline(always)]
    fn place(&self, index: u32) -> u32 {
        scramble_from_low(index.reverse_bits(), self.order).reverse_bits()
    }

    /// First coordinate of point `index` as a 32-bit fraction.
    #[inline(always)]
    pub(super) fn first(&self, index: u32) -> u32 {
        // The first Sobol' coordinate is the index with its bits reversed; the scramble works on reversed numbers,
        // so two of the three reversals cancel.
        scramble_from_low(self.place(index), self.x).reverse_bits()
    }

    /// Point `index` as two 32-bit fractions.
    #[inline(always)]
    pub(super) fn point(&self, index: u32) -> [u32; 2] {
        let i = self.place(index);
        let x = scramble_from_low(i, self.x).reverse_bits();
        let y = scramble_from_low(pascal(i), self.y).reverse_bits();
        [x, y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Direction numbers of the second Sobol' dimension from their recurrence (primitive polynomial x + 1):
    /// v_j = v_{j-1} xor (v_{j-1} >> 1). Bratley and Fox, ACM TOMS algorithm 659, 1988.
    #[test]
    fn pascal_butterfly_is_the_second_sobol_dimension() {
        for i in (0..5000u32).chain([u32::MAX, 1 << 31, 0xdead_beef]) {
            let (mut v, mut want) = (1u32 << 31, 0);
            for j in 0..32 {
                if (i >> j) & 1 == 1 {
                    want ^= v;
                }
                v ^= v >> 1;
            }
            assert_eq!(pascal(i).reverse_bits(), want, "{i}");
        }
    }

    #[test]
    fn scramble_is_a_permutation_whose_bits_depend_on_lower_ones_only() {
        for seed in [0u32, 1, 0x1234_5678, u32::MAX] {
            let mut seen = vec![false; 1 << 12];
            for v in 0..1u32 << 12 {
                let out = scramble_from_low(v, seed);
                // Whatever stands above bit 12 may not change the low 12.
                assert_eq!(out & 0xfff, scramble_from_low(v | 0xabc0_0000, seed) & 0xfff);
                seen[(out & 0xfff) as usize] = true;
            }
            assert!(seen.iter().all(|&s| s));
        }
    }
}
