//! Elementary functions whose bits depend on nothing but IEEE 754 additions, multiplications, divisions and square
//! roots, so that they are the same on every machine and instruction set, and which the compiler vectorises in a
//! loop under [`super::simd::dispatch`]. Angles are in turns: the reduction of u to an octant is then exact.
//!
//! Coefficients: minimax fits by the exchange algorithm of Remez, made for this file; each function states its
//! largest error against f64 libm, and the tests hold it to that.

use std::f32::consts::TAU;

/// Sine and cosine of 2 pi u.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinCos {
    /// Sine of 2 pi u.
    pub sin: f32,
    /// Cosine of 2 pi u.
    pub cos: f32,
}

/// Adding and subtracting this rounds a number of size below 2^22 to the nearest integer (ties to even).
const ROUND32: f32 = 12_582_912.0; // 1.5 * 2^23
/// The same in f64, for sizes below 2^51.
const ROUND64: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// Sine and cosine of 2 pi u, for |u| <= 2^20 (in turns). Absolute error at most 1.2e-7.
#[inline(always)]
pub fn sin_cos_2pi(u: f32) -> SinCos {
    let quarter = (4.0 * u + ROUND32) - ROUND32;
    // Exact: a multiple of ulp(u), of size at most 1/8.
    let t = u - 0.25 * quarter;
    let z = t * t;
    let s = t * (TAU + z * (-41.341_63 + z * (81.588_13 + z * -75.240_07)));
    let c = 1.0 + z * (-19.739_21 + z * (64.939_316 + z * (-85.442_85 + z * 59.220_41)));
    // The low bits of the rounded quarter, as the sum with the rounding constant holds them.
    let q = (4.0 * u + ROUND32).to_bits();
    let swap = q & 1 != 0;
    let (sin, cos) = (if swap { c } else { s }, if swap { s } else { c });
    let sin_sign = (q & 2) << 30;
    let cos_sign = ((q + 1) & 2) << 30;
    SinCos { sin: f32::from_bits(sin.to_bits() ^ sin_sign), cos: f32::from_bits(cos.to_bits() ^ cos_sign) }
}

/// Sine and cosine of 2 pi u in f64.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DSinCos {
    /// Sine of 2 pi u.
    pub sin: f64,
    /// Cosine of 2 pi u.
    pub cos: f64,
}

/// Sine and cosine of 2 pi u in f64, for |u| <= 2^49 (in turns). Absolute error at most 4e-16.
#[inline(always)]
pub fn sin_cos_2pi_f64(u: f64) -> DSinCos {
    let rounded = 4.0 * u + ROUND64;
    let x = std::f64::consts::TAU * (u - 0.25 * (rounded - ROUND64));
    let z = x * x;
    // Taylor: the first term left out is below (pi/4)^17 / 17! = 5e-17 and (pi/4)^18 / 18! = 2e-18.
    let s = 1.0 / 6_227_020_800.0 - z / 1_307_674_368_000.0;
    let s = -1.0 / 5_040.0 + z * (1.0 / 362_880.0 + z * (-1.0 / 39_916_800.0 + z * s));
    let s = x + x * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * s));
    let c = -1.0 / 87_178_291_200.0 + z / 20_922_789_888_000.0;
    let c = 1.0 / 40_320.0 + z * (-1.0 / 3_628_800.0 + z * (1.0 / 479_001_600.0 + z * c));
    let c = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * c)));
    let q = rounded.to_bits();
    let (sin, cos) = if q & 1 != 0 { (c, s) } else { (s, c) };
    let sin_sign = (q & 2) << 62;
    let cos_sign = ((q + 1) & 2) << 62;
    DSinCos { sin: f64::from_bits(sin.to_bits() ^ sin_sign), cos: f64::from_bits(cos.to_bits() ^ cos_sign) }
}

/// atan(t) / (2 pi) for t in [0, 1].
#[inline(always)]
fn atan_turns_unit(t: f32) -> f32 {
    let z = t * t;
    let p = -0.009_534_168 + z * (0.003_908_415_4 + z * -0.000_760_841_4);
    let p = 0.031_785_432 + z * (-0.022_328_523 + z * (0.015_824_416 + z * p));
    t * (0.159_154_93 + z * (-0.053_049_675 + z * p))
}

/// Angle of the point (x, y) in turns: atan2(y, x) / 2 pi, in [-1/2, 1/2]. Zero for the origin; the sign is that
/// of `y`, also where `y` is a negative zero. Absolute error at most 6e-8; NaN if either is NaN or both infinite.
#[inline(always)]
pub fn atan2_turns(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (lo, hi) = if ay > ax { (ax, ay) } else { (ay, ax) };
    let r = atan_turns_unit(if hi == 0.0 { lo } else { lo / hi });
    let r = if ay > ax { 0.25 - r } else { r };
    let r = if x < 0.0 { 0.5 - r } else { r };
    r.copysign(y)
}

/// Angle of the point (x, y) in turns in f64, as [`atan2_turns`], of finite numbers. Absolute error at most 2.5e-15.
#[inline(always)]
pub fn atan2_turns_f64(y: f64, x: f64) -> f64 {
    const TAN_EIGHTH_PI: f64 = std::f64::consts::SQRT_2 - 1.0;
    let (ax, ay) = (x.abs(), y.abs());
    let (lo, hi) = if ay > ax { (ax, ay) } else { (ay, ax) };
    // atan(t) = pi / 4 + atan((t - 1) / (t + 1)): one division either way.
    let far = lo > TAN_EIGHTH_PI * hi;
    let (top, bottom) = if far { (lo - hi, lo + hi) } else { (lo, hi) };
    let s = top / if bottom == 0.0 { 1.0 } else { bottom };
    let z = s * s;
    let p = 0.012_037_957_538_771_191 + z * (-0.009_349_372_378_028_565 + z * 0.004_879_778_625_579_652);
    let p =
        -0.022_736_382_443_862_48 + z * (0.017_682_726_488_105_87 + z * (-0.014_448_702_901_611_322 + z * p));
    let p =
        0.159_154_943_091_891_07 + z * (-0.053_051_647_693_269_03 + z * (0.031_830_987_989_143_61 + z * p));
    let r = if far { 0.125 } else { 0.0 } + s * p;
    let r = if ay > ax { 0.25 - r } else { r };
    let r = if x < 0.0 { 0.5 - r } else { r };
    r.copysign(y)
}

/// asin(x) / 2 pi, in [-1/4, 1/4]; `x` is clamped to [-1, 1]. Absolute error at most 5e-8.
#[inline(always)]
pub fn asin_turns(x: f32) -> f32 {
    let a = x.abs().min(1.0);
    // asin(a) = pi/2 - 2 asin(sqrt((1 - a) / 2)) keeps the polynomial's argument at most 1/2, and its digits near 1.
    let far = a > 0.5;
    let z = if far { 0.5 * (1.0 - a) } else { a * a };
    let t = if far { z.sqrt() } else { a };
    let p = 0.012_012_437 + z * (0.006_310_025_5 + z * 0.008_061_763);
    let r = t * (0.159_154_96 + z * (0.026_523_34 + z * p));
    (if far { 0.25 - 2.0 * r } else { r }).copysign(x)
}

/// acos(x) in radians, in [0, pi]; `x` is clamped to [-1, 1]. Absolute error at most 4e-7.
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    TAU * (0.25 - asin_turns(x))
}

/// Base-2 logarithm of a positive, finite, normal f64; relative error 1e-11 away from 1, absolute 1e-11 near it.
#[inline(always)]
fn log2_f64(x: f64) -> f64 {
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let bits = x.to_bits();
    // x = m 2^e with m in [sqrt(1/2), sqrt(2)). Unsigned, and to f64 by way of the bits of 2^52 + n, because AVX2 has
    // neither an arithmetic shift nor a conversion of 64-bit integers.
    let biased = bits.wrapping_add(ONE - SQRT_HALF) >> 52;
    let e = f64::from_bits(biased | 0x4330_0000_0000_0000) - (4_503_599_627_370_496.0 + 1023.0);
    let m = f64::from_bits(bits.wrapping_sub(biased << 52).wrapping_add(ONE));
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let p = 0.577_083_596_192_824 + z * (0.411_672_109_040_091 + z * 0.340_740_463_100_28);
    e + s * (2.885_390_081_790_147 + z * (0.961_796_673_275_648 + z * p))
}

/// 2^t in f64, relative error 5e-11; `t` is clamped to [-1000, 1000] and NaN goes to one of the ends.
#[inline(always)]
fn exp2_f64(t: f64) -> f64 {
    let t = if t > -1000.0 { t } else { -1000.0 };
    let t = if t < 1000.0 { t } else { 1000.0 };
    let k = t + ROUND64;
    let f = t - (k - ROUND64);
    let scale = f64::from_bits(k.to_bits().wrapping_add(1023) << 52);
    let p = 0.001_333_342_261_658 + f * (0.000_154_697_315_623_4 + f * 0.000_015_316_468_363);
    let p = 0.240_226_512_135_805 + f * (0.055_504_109_761_449 + f * (0.009_618_025_604_537 + f * p));
    scale * (0.999_999_999_959_551 + f * (0.693_147_180_535_013 + f * p))
}

/// e^x, correct to 0.51 units in the last place; infinite above 88.7, down to zero below -103.9; NaN stays NaN.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let r = exp2_f64(f64::from(x) * std::f64::consts::LOG2_E) as f32;
    if x.is_nan() { x } else { r }
}

/// Natural logarithm, correct to 0.51 units in the last place or to 1e-11, whichever is more; minus infinity at 0,
/// NaN below.
#[inline(always)]
pub fn log(x: f32) -> f32 {
    (log2_extended(x) * std::f64::consts::LN_2) as f32
}

/// `log2_f64` with the ends: 0, infinity, negative and NaN.
#[inline(always)]
fn log2_extended(x: f32) -> f64 {
    let r = log2_f64(f64::from(x));
    let r = if x == f32::INFINITY { f64::INFINITY } else { r };
    let r = if x == 0.0 { f64::NEG_INFINITY } else { r };
    if x >= 0.0 { r } else { f64::NAN }
}

/// x^y for x >= 0, correct to 0.51 units in the last place (0.6 for results next to the ends of f32); x^0 = 1, NaN for
/// x < 0 unless y = 0.
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    let t = log2_extended(x) * f64::from(y);
    let r = if t.is_nan() { f32::NAN } else { exp2_f64(t) as f32 };
    if y == 0.0 { 1.0 } else { r }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error of `got` in units in the last place of the f32 nearest to `want`.
    fn ulps(got: f32, want: f64) -> f64 {
        let near = want as f32;
        (f64::from(got) - want).abs() / f64::from(near.abs().next_up() - near.abs())
    }

    #[test]
    fn sin_cos_stay_within_their_stated_error() {
        let mut worst = 0f64;
        for i in -400_000..=400_000 {
            let u = i as f32 / 262_144.0 + 1e-7 * (i % 7) as f32;
            let SinCos { sin, cos } = sin_cos_2pi(u);
            let x = std::f64::consts::TAU * f64::from(u);
            worst = worst.max((f64::from(sin) - x.sin()).abs()).max((f64::from(cos) - x.cos()).abs());
        }
        assert!(worst < 1.2e-7, "{worst}");
        let mut worst = 0f64;
        for i in -300_000..=300_000 {
            let u = f64::from(i) / 190_000.0;
            // The reference's argument is rounded: reduce it to below a quarter turn, where that costs less than 1e-16.
            let (r, x) = (sin_cos_2pi_f64(u), std::f64::consts::TAU * (u - u.round()));
            worst = worst.max((r.sin - x.sin()).abs()).max((r.cos - x.cos()).abs());
        }
        assert!(worst < 6e-16, "{worst}");
        assert_eq!(sin_cos_2pi_f64(-0.75), DSinCos { sin: 1.0, cos: 0.0 });
        assert_eq!(sin_cos_2pi(0.25), SinCos { sin: 1.0, cos: 0.0 });
        assert_eq!(sin_cos_2pi(1e6 - 0.25).sin, -1.0);
        // Relative accuracy of the sine next to zero, down to the smallest numbers.
        for u in [1e-3f32, 1e-10, 1e-38] {
            assert!(ulps(sin_cos_2pi(u).sin, (std::f64::consts::TAU * f64::from(u)).sin()) < 2.0);
        }
    }

    #[test]
    fn inverses_stay_within_their_stated_error() {
        let (mut atan, mut fine, mut asin, mut cosine) = (0f64, 0f64, 0f64, 0f64);
        for i in 0..200_000 {
            let a = std::f64::consts::TAU * f64::from(i) / 200_000.0;
            let r = 10f64.powi(i % 21 - 10);
            let (y, x) = ((r * a.sin()) as f32, (r * a.cos()) as f32);
            let want = f64::from(y).atan2(f64::from(x)) / std::f64::consts::TAU;
            atan = atan.max((f64::from(atan2_turns(y, x)) - want).abs());
            fine = fine.max((atan2_turns_f64(f64::from(y), f64::from(x)) - want).abs());
            let s = (2.0 * f64::from(i) / 199_999.0 - 1.0) as f32;
            asin = asin.max((f64::from(asin_turns(s)) - f64::from(s).asin() / std::f64::consts::TAU).abs());
            cosine = cosine.max((f64::from(acos(s)) - f64::from(s).acos()).abs());
        }
        assert!(atan < 6e-8 && asin < 5e-8 && cosine < 4e-7, "{atan} {asin} {cosine}");
        assert!(fine < 2.5e-15, "{fine}");
        assert_eq!((atan2_turns_f64(0.0, 0.0), atan2_turns_f64(-2.0, 0.0)), (0.0, -0.25));
        assert_eq!((atan2_turns_f64(0.0, -1.0), atan2_turns_f64(-0.0, -1.0)), (0.5, -0.5));
        assert_eq!(atan2_turns(0.0, 0.0), 0.0);
        assert_eq!((atan2_turns(0.0, -1.0), atan2_turns(-0.0, -1.0)), (0.5, -0.5));
        assert_eq!((atan2_turns(1.0, 0.0), atan2_turns(-2.0, 0.0)), (0.25, -0.25));
        assert_eq!((asin_turns(1.5), asin_turns(-1.0)), (0.25, -0.25));
        assert!(atan2_turns(f32::NAN, 1.0).is_nan() && atan2_turns(1.0, f32::NAN).is_nan());
    }

    #[test]
    fn exp_log_pow_are_all_but_correctly_rounded() {
        for i in 0..300_000 {
            let t = i as f32 / 300_000.0;
            let x = -87.0 + 175.0 * t;
            assert!(ulps(exp(x), f64::from(x).exp()) < 0.51, "exp {x}");
            let v = exp(x);
            let want = f64::from(v).ln();
            assert!(ulps(log(v), want) < 0.51 || (f64::from(log(v)) - want).abs() < 1e-11, "log {v}");
            for y in [2.4f32, 1.0 / 2.4, -0.7] {
                let b = 1e-4 + 30.0 * t;
                assert!(ulps(pow(b, y), f64::from(b).powf(f64::from(y))) < 0.51, "pow {b} {y}");
            }
        }
    }

    #[test]
    fn exp_log_pow_at_the_ends() {
        assert_eq!(
            (exp(f32::NEG_INFINITY), exp(f32::INFINITY), exp(200.0)),
            (0.0, f32::INFINITY, f32::INFINITY)
        );
        assert_eq!(
            (exp(0.0), log(1.0), log(0.0), log(f32::INFINITY)),
            (1.0, 0.0, f32::NEG_INFINITY, f32::INFINITY)
        );
        assert!(exp(f32::NAN).is_nan() && log(f32::NAN).is_nan() && log(-1.0).is_nan());
        assert_eq!((pow(0.0, 2.0), pow(0.0, -1.0), pow(0.0, 0.0)), (0.0, f32::INFINITY, 1.0));
        assert_eq!((pow(f32::INFINITY, 0.5), pow(f32::INFINITY, -0.5)), (f32::INFINITY, 0.0));
        assert!(pow(-1.0, 2.0).is_nan() && pow(2.0, f32::NAN).is_nan() && pow(f32::NAN, 2.0).is_nan());
        // Subnormal arguments and results keep their meaning.
        assert_eq!(log(1e-42), (f64::from(1e-42f32)).ln() as f32);
        assert_eq!(exp(-100.0), (-100f64).exp() as f32);
    }
}
