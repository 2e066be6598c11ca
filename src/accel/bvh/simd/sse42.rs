//! SSE up to 4.2: two vectors of four.
#![allow(unsafe_code, reason = "intrinsics")]

use super::{Available, Job, Lanes, Simd};
use std::arch::x86_64::*;

#[derive(Clone, Copy)]
pub(super) struct Sse42;

/// The body of an operation.
macro_rules! op {
    ($e:expr) => {
        // SAFETY: this type is only used below the functions that enter, which hold an `Available` of this level; `Lanes`
        // has the size and the alignment of a vector, and prefetching reads nothing.
        unsafe { $e }
    };
}

impl Simd for Sse42 {
    type V = [__m128; 2];

    #[inline(always)]
    fn load(from: &Lanes) -> [__m128; 2] {
        op!([_mm_load_ps(from.0.as_ptr()), _mm_load_ps(from.0.as_ptr().add(4))])
    }
    #[inline(always)]
    fn store(v: [__m128; 2]) -> Lanes {
        op!(std::mem::transmute::<[__m128; 2], Lanes>(v))
    }
    #[inline(always)]
    fn splat(x: f32) -> [__m128; 2] {
        op!([_mm_set1_ps(x); 2])
    }
    #[inline(always)]
    fn add(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_add_ps(a[0], b[0]), _mm_add_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn sub(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_sub_ps(a[0], b[0]), _mm_sub_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn mul(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_mul_ps(a[0], b[0]), _mm_mul_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn div(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_div_ps(a[0], b[0]), _mm_div_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn mul_add(a: [__m128; 2], b: [__m128; 2], c: [__m128; 2]) -> [__m128; 2] {
        Self::add(Self::mul(a, b), c)
    }
    #[inline(always)]
    fn mul_sub(a: [__m128; 2], b: [__m128; 2], c: [__m128; 2]) -> [__m128; 2] {
        Self::sub(Self::mul(a, b), c)
    }
    #[inline(always)]
    fn neg_mul_add(a: [__m128; 2], b: [__m128; 2], c: [__m128; 2]) -> [__m128; 2] {
        Self::sub(c, Self::mul(a, b))
    }
    #[inline(always)]
    fn min(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_min_ps(a[0], b[0]), _mm_min_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn max(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_max_ps(a[0], b[0]), _mm_max_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn le(a: [__m128; 2], b: [__m128; 2]) -> u32 {
        op!((_mm_movemask_ps(_mm_cmple_ps(a[0], b[0])) | _mm_movemask_ps(_mm_cmple_ps(a[1], b[1])) << 4)
            as u32)
    }
    #[inline(always)]
    fn le_bits(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_cmple_ps(a[0], b[0]), _mm_cmple_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn and(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_and_ps(a[0], b[0]), _mm_and_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn or(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_or_ps(a[0], b[0]), _mm_or_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn xor(a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_xor_ps(a[0], b[0]), _mm_xor_ps(a[1], b[1])])
    }
    #[inline(always)]
    fn select(bits: [__m128; 2], a: [__m128; 2], b: [__m128; 2]) -> [__m128; 2] {
        op!([_mm_blendv_ps(b[0], a[0], bits[0]), _mm_blendv_ps(b[1], a[1], bits[1])])
    }
    #[inline(always)]
    fn bits(a: [__m128; 2]) -> u32 {
        op!((_mm_movemask_ps(a[0]) | _mm_movemask_ps(a[1]) << 4) as u32)
    }
    #[inline(always)]
    fn least(a: [__m128; 2]) -> f32 {
        op!({
            let a = _mm_min_ps(a[0], a[1]);
            let a = _mm_min_ps(a, _mm_movehl_ps(a, a));
            _mm_cvtss_f32(_mm_min_ss(a, _mm_movehdup_ps(a)))
        })
    }
    #[inline(always)]
    fn compress(a: [__m128; 2], set: u32) -> Lanes {
        let order = &super::COMPRESSED[set as usize % 256];
        let a = Self::store(a);
        let mut out = a;
        for (to, &from) in out.0.iter_mut().zip(order) {
            *to = a.0[from as usize % 8];
        }
        out
    }
    #[inline(always)]
    fn prefetch<T>(it: &T) {
        for line in (0..size_of::<T>()).step_by(64) {
            op!(_mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(it).cast::<i8>().wrapping_add(line)))
        }
    }
}

/// Runs a job by SSE4.2.
#[inline(always)]
pub(super) fn enter<J: Job>(_: Available, job: J) -> J::Output {
    #[target_feature(enable = "sse4.2,popcnt")]
    fn inner<J: Job>(job: J) -> J::Output {
        job.run::<Sse42>()
    }
    // SAFETY: the level was seen to be available with these features (`Level::is_available`).
    unsafe { inner(job) }
}
