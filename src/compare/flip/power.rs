//! Powers of f32 whose bits depend on nothing but IEEE 754 additions, multiplications and divisions, and which the
//! compiler vectorises. The tests hold each to the error that it states.

/// Adding and subtracting this rounds a number of size below 2^22 to the nearest integer.
const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23

/// Binary logarithm of a positive normal number. Absolute error at most 1e-7 plus half an ulp of the result.
#[inline(always)]
fn log2(x: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let bits = x.to_bits();
    let exponent = (bits.wrapping_sub(SQRT_HALF) as i32) >> 23;
    // From sqrt(1/2) to sqrt(2).
    let m = f32::from_bits(bits.wrapping_sub((exponent << 23) as u32));
    // ln m = 2 atanh s; the first term left out of the series is below 2e-9.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let p = 0.961_796_7 + z * (0.577_078_04 + z * (0.412_198_57 + z * 0.320_598_9));
    exponent as f32 + s * (2.885_39 + z * p)
}

/// 2 to the power of t, for t in [-126, 127]. Relative error at most 2e-7.
#[inline(always)]
fn exp2(t: f32) -> f32 {
    let shifted = t + ROUND;
    let f = t - (shifted - ROUND);
    // Taylor in f ln 2, |f| <= 1/2: the first term left out is 6e-9.
    let p = 1.333_355_8e-3 + f * (1.540_353e-4 + f * 1.525_273_4e-5);
    let p = 0.240_226_5 + f * (0.055_504_11 + f * (9.618_129e-3 + f * p));
    let p = 1.0 + f * (std::f32::consts::LN_2 + f * p);
    // The low bits of the shifted number are the integer.
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// `x` to the power of `y`, for x from 0 to 1e6 and y in [0, 3]; 0 where x is not positive, whatever y. Relative error at
/// most 2e-6 where the result is above 1e-9; results below 1e-37 are about that.
#[inline(always)]
pub(super) fn power(x: f32, y: f32) -> f32 {
    let t = y * log2(x);
    let t = if t > -125.0 { t } else { -125.0 };
    let p = exp2(t);
    if x > 0.0 { p } else { 0.0 }
}

/// Cube root, for x in [0.008, 1.2]. Relative error at most 3e-7.
#[inline(always)]
pub(super) fn cube_root(x: f32) -> f32 {
    // x^(-1/3) from its bits: their third is 1/4 + 1/16 + 1/64 of them and a remainder that the constant covers, to 4 %.
    let bits = x.to_bits();
    let third = (bits >> 2) + (bits >> 4) + (bits >> 6);
    let r = f32::from_bits(FIRST_GUESS - third);
    // Series of (1 - h)^(-1/3), twice: h is below 0.125, then below 1.2e-4.
    let h = 1.0 - x * r * r * r;
    let r = r + r * h * (1.0 / 3.0 + h * (2.0 / 9.0 + h * (14.0 / 81.0)));
    let h = 1.0 - x * r * r * r;
    let r = r + r * h * (1.0 / 3.0);
    x * r * r
}

/// Found by trying: the largest error of the first guess over [0.008, 1.2] is least.
const FIRST_GUESS: u32 = 0x544f_8923;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_as_exact_as_stated() {
        let (from, to) = (0.008f32.to_bits(), 1.2f32.to_bits());
        for bits in (from..=to).step_by(17) {
            let x = f32::from_bits(bits);
            let exact = f64::from(x).cbrt();
            let error = (f64::from(cube_root(x)) - exact).abs() / exact;
            assert!(error < 3e-7, "{x}: {error:e}");
        }
    }

    #[test]
    fn powers_are_as_exact_as_stated() {
        for y in [0.0f32, 0.1, 0.5, 0.7, 1.0, 2.4] {
            for bits in (1e-12f32.to_bits()..=1e4f32.to_bits()).step_by(1009) {
                let x = f32::from_bits(bits);
                let exact = f64::from(x).powf(f64::from(y));
                let error = (f64::from(power(x, y)) - exact).abs() / exact;
                assert!(exact < 1e-9 || error < 2e-6, "{x}^{y}: {error:e}");
            }
        }
        assert_eq!([power(0.0, 0.7), power(0.0, 0.0), power(1.0, 0.7)], [0.0, 0.0, 1.0]);
    }
}
