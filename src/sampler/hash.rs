//! Integer mixing.

/// A bijection of u32 in which each input bit flips each output bit with a probability near 1/2 (bias 0.11 %):
/// two rounds of xor-shift and multiplication with the constants of C. Wellons, "Prospecting for Hash Functions"
/// (2018, amended 2022; public domain).
#[inline(always)]
pub const fn mix32(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0x735a_2d97);
    x ^ (x >> 15)
}

/// A bijection of u64 of the same kind: the finaliser of SplitMix64 with D. Stafford's variant 13 of its constants,
/// after an addition, so that zero does not map to zero.
#[inline(always)]
pub const fn mix64(x: u64) -> u64 {
    let mut x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The key of a ray: from it are made all decisions during its traversal (alpha cut-out), so that they are the same
/// in every kernel and every order. `pixel` is any number for the pixel, such as y * width + x.
#[inline(always)]
pub const fn ray_key(pixel: u32, sample: u32, depth: u32) -> u32 {
    mix32(mix32(mix32(pixel.wrapping_add(0x9e37_79b9)) ^ sample).wrapping_add(depth))
}

/// Sets the keys of shadow rays apart from those of scattered rays: `ray_key(..) ^ SHADOW_KEY`.
pub const SHADOW_KEY: u32 = 0x9e37_79b9;

/// A uniform number in [0, 1) from a ray's key and what the decision is about (such as the primitive's id).
#[inline(always)]
pub fn uniform_from_key(key: u32, about: u32) -> f32 {
    super::to_unit_f32(mix32(key ^ mix32(about.wrapping_add(0x6a09_e667))))
}

/// Two numbers in [0, 1) of 24 bits, each with 28 more below, which are random and follow from both: what is left of an
/// f32 after choosing among many cells of a table is then still uniform. The same pair always gives the same numbers.
#[inline(always)]
pub fn extend_unit(u: [f32; 2]) -> [f64; 2] {
    let low = mix64((u64::from(u[0].to_bits()) << 32) | u64::from(u[1].to_bits()));
    let lows = [low as u32 >> 4, (low >> 32) as u32 >> 4];
    std::array::from_fn(|i| f64::from(u[i]) + f64::from(lows[i]) / (1u64 << 52) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extended_numbers_round_down_to_the_given_and_fill_the_gap() {
        let mut sum = [0.0; 2];
        let n = 4096;
        for i in 0..n {
            let u = [i as f32 / n as f32, (n - 1 - i) as f32 / n as f32];
            let v = extend_unit(u);
            for k in 0..2 {
                let rest = (v[k] - f64::from(u[k])) * f64::from(1 << 24);
                assert!((0.0..1.0).contains(&rest));
                sum[k] += rest / f64::from(n);
            }
        }
        // sigma = 1 / sqrt(12 * 4096) = 0.0045; five of those.
        assert!(sum.iter().all(|s| (s - 0.5).abs() < 0.0225), "{sum:?}");
        assert!(extend_unit([super::super::ONE_MINUS_EPSILON; 2])[0] < 1.0);
    }

    #[test]
    fn each_input_bit_flips_each_output_bit_half_the_time() {
        let trials = 20_000u32;
        for bit in 0..32 {
            let mut flips = [0u32; 32];
            for i in 0..trials {
                let x = mix64(u64::from(i)) as u32;
                let d = mix32(x) ^ mix32(x ^ (1 << bit));
                (0..32).for_each(|b| flips[b] += (d >> b) & 1);
            }
            // Standard deviation of the share is 0.0035; six of those, plus the function's own bias of up to 0.01.
            assert!(
                flips.iter().all(|&f| (f64::from(f) / f64::from(trials) - 0.5).abs() < 0.031),
                "{bit}: {flips:?}"
            );
        }
    }

    #[test]
    fn ray_keys_of_neighbours_are_distinct_and_uniform() {
        let mut keys: Vec<u32> = Vec::new();
        for pixel in 0..40 {
            for sample in 0..40 {
                keys.extend((0..10).map(|depth| ray_key(pixel, sample, depth)));
            }
        }
        let mean = keys.iter().map(|&k| f64::from(uniform_from_key(k, 7))).sum::<f64>() / keys.len() as f64;
        // sigma = 1 / sqrt(12 * 16000) = 0.0023; five of those.
        assert!((mean - 0.5).abs() < 0.0115, "{mean}");
        keys.sort_unstable();
        keys.dedup();
        // 16000^2 / 2^33 = 0.03 collisions expected.
        assert!(keys.len() >= 15_999, "{}", keys.len());
    }
}
