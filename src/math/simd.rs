//! Run-time choice of instruction set for loops that the compiler vectorises by itself.
//!
//! A program built for the plain x86-64 baseline may use four f32 lanes only. [`dispatch`] runs a piece of
//! ordinary, safe Rust in a copy compiled for the best set this processor has (AVX-512, AVX2 or baseline; NEON
//! where that is the baseline). It is the same code on each path, and the compiler neither reorders
//! floating-point operations nor contracts a multiplication and an addition into one instruction (Rust never
//! does unless `mul_add` is written), so **the bits are the same on all paths**.
//!
//! `SKYLIT_SIMD=scalar` in the environment forces the baseline.

use std::sync::OnceLock;

use pulp::{Arch, Scalar, Simd, WithSimd};

/// Work to be compiled once for every instruction set.
///
/// Mark `run`, and what it calls in its inner loops, `#[inline(always)]`: only code inlined into the copy is
/// compiled for that copy's instructions. Closures are kernels too; stable Rust has no way to force the
/// inlining of a closure, so keep those small or let them call one `#[inline(always)]` function.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// Does the work.
    fn run(self) -> Self::Output;
}

impl<R, F: FnOnce() -> R> Kernel for F {
    type Output = R;

    #[inline(always)]
    fn run(self) -> R {
        self()
    }
}

struct Run<K>(K);

impl<K: Kernel> WithSimd for Run<K> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> K::Output {
        self.0.run()
    }
}

/// The instruction set in use, decided at the first call and kept.
fn arch() -> Option<Arch> {
    static ARCH: OnceLock<Option<Arch>> = OnceLock::new();
    *ARCH.get_or_init(|| match std::env::var_os("SKYLIT_SIMD") {
        Some(v) if v == "scalar" => None,
        _ => Some(Arch::new()),
    })
}

/// Runs `kernel` with the best instructions this processor has. Costs one load and one predictable branch.
#[inline(always)]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    match arch() {
        Some(arch) => arch.dispatch(Run(kernel)),
        None => Scalar::new().vectorize(Run(kernel)),
    }
}

/// Name of the instruction set [`dispatch`] uses, for records: "avx512", "avx2", "scalar" (the baseline of the
/// build) or, on other processors, what the library calls it.
pub fn name() -> String {
    match arch() {
        None => "scalar".into(),
        Some(arch) => {
            let text = format!("{arch:?}");
            match text.split('(').next().unwrap_or_default() {
                "V4" => "avx512".into(),
                "V3" => "avx2".into(),
                other => other.to_lowercase(),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Polynomial<'a>(&'a [f32], &'a mut [f32]);

    impl Kernel for Polynomial<'_> {
        type Output = ();

        #[inline(always)]
        fn run(self) {
            for (x, y) in self.0.iter().zip(self.1) {
                // A contracted multiply-add would change these bits.
                *y = (x * 1.1 + 0.3) * x + (x * x * 0.7 - 0.9).abs().sqrt() / (x + 3.1);
            }
        }
    }

    #[test]
    fn all_paths_give_the_same_bits() {
        let xs: Vec<f32> = (0..1003).map(|i| i as f32 * 0.37 - 80.0).collect();
        let (mut best, mut plain) = (vec![0.0; xs.len()], vec![0.0; xs.len()]);
        dispatch(Polynomial(&xs, &mut best));
        Polynomial(&xs, &mut plain).run();
        assert!(best.iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits()));
        let mut baseline = vec![0.0; xs.len()];
        Scalar::new().vectorize(Run(Polynomial(&xs, &mut baseline)));
        assert!(baseline.iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert_eq!(dispatch(|| 42), 42);
        assert!(!name().is_empty());
    }
}
