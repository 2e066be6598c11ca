//! AVX2 with FMA. AVX-512 runs the same code, compiled for its masks and its 32 registers.
#![allow(unsafe_code, reason = "intrinsics")]

use super::{Available, Job, Lanes, Simd};
use std::arch::x86_64::*;

#[derive(Clone, Copy)]
pub(super) struct Avx2;

/// The body of an operation.
macro_rules! op {
    ($e:expr) => {
        // SAFETY: this type is only used below the functions that enter, which hold an `Available` of this level; `Lanes`
        // has the size and the alignment of a vector, and prefetching reads nothing.
        unsafe { $e }
    };
}

impl Simd for Avx2 {
    type V = __m256;

    #[inline(always)]
    fn load(from: &Lanes) -> __m256 {
        op!(_mm256_load_ps(from.0.as_ptr()))
    }
    #[inline(always)]
    fn store(v: __m256) -> Lanes {
        op!(std::mem::transmute::<__m256, Lanes>(v))
    }
    #[inline(always)]
    fn splat(x: f32) -> __m256 {
        op!(_mm256_set1_ps(x))
    }
    #[inline(always)]
    fn add(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_add_ps(a, b))
    }
    #[inline(always)]
    fn sub(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_sub_ps(a, b))
    }
    #[inline(always)]
    fn mul(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_mul_ps(a, b))
    }
    #[inline(always)]
    fn div(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_div_ps(a, b))
    }
    #[inline(always)]
    fn mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
        op!(_mm256_fmadd_ps(a, b, c))
    }
    #[inline(always)]
    fn mul_sub(a: __m256, b: __m256, c: __m256) -> __m256 {
        op!(_mm256_fmsub_ps(a, b, c))
    }
    #[inline(always)]
    fn neg_mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
        op!(_mm256_fnmadd_ps(a, b, c))
    }
    #[inline(always)]
    fn min(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_min_ps(a, b))
    }
    #[inline(always)]
    fn max(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_max_ps(a, b))
    }
    #[inline(always)]
    fn le(a: __m256, b: __m256) -> u32 {
        op!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32)
    }
    #[inline(always)]
    fn le_bits(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))
    }
    #[inline(always)]
    fn and(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_and_ps(a, b))
    }
    #[inline(always)]
    fn or(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_or_ps(a, b))
    }
    #[inline(always)]
    fn xor(a: __m256, b: __m256) -> __m256 {
        op!(_mm256_xor_ps(a, b))
    }
    #[inline(always)]
    fn select(bits: __m256, a: __m256, b: __m256) -> __m256 {
        op!(_mm256_blendv_ps(b, a, bits))
    }
    #[inline(always)]
    fn bits(a: __m256) -> u32 {
        op!(_mm256_movemask_ps(a) as u32)
    }
    #[inline(always)]
    fn least(a: __m256) -> f32 {
        op!({
            let a = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps::<1>(a));
            let a = _mm_min_ps(a, _mm_movehl_ps(a, a));
            _mm_cvtss_f32(_mm_min_ss(a, _mm_movehdup_ps(a)))
        })
    }
    #[inline(always)]
    fn compress(a: __m256, set: u32) -> Lanes {
        let order = u64::from_le_bytes(super::COMPRESSED[set as usize % 256]);
        Self::store(op!(_mm256_permutevar8x32_ps(a, _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order as i64)))))
    }
    #[inline(always)]
    fn prefetch<T>(it: &T) {
        for line in (0..size_of::<T>()).step_by(64) {
            op!(_mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(it).cast::<i8>().wrapping_add(line)))
        }
    }
}

/// Runs a job by AVX2.
#[inline(always)]
pub(super) fn enter<J: Job>(_: Available, job: J) -> J::Output {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn inner<J: Job>(job: J) -> J::Output {
        job.run::<Avx2>()
    }
    // SAFETY: the level was seen to be available with these features (`Level::is_available`).
    unsafe { inner(job) }
}

/// Runs a job by AVX2 code in AVX-512's encoding.
#[inline(always)]
pub(super) fn enter_avx512<J: Job>(_: Available, job: J) -> J::Output {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
    fn inner<J: Job>(job: J) -> J::Output {
        job.run::<Avx2>()
    }
    // SAFETY: as above.
    unsafe { inner(job) }
}
