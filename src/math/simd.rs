//! Run-time choice of instruction set for loops that the compiler vectorises by itself.
//!
//! A program built for the plain x86-64 baseline may use four f32 lanes only. [`dispatch`] runs a piece of
//! ordinary, safe Rust in a copy compiled for the best set this processor has (AVX-512, AVX2 or baseline; NEON
//! where that is the baseline). It is the same code on each path, and the compiler neither reorders
//! floating-point operations nor contracts a multiplication and an addition into one instruction (Rust never
//! does unless `mul_add` is written), so **the bits are the same on all paths**.
//!
//! `SKYLIT_SIMD` in the environment forces a [`Level`] for the whole program: `portable`, `sse4.2`, `avx2`, `avx512`.

use crate::error::{Error, Result, unknown_name};
use std::sync::OnceLock;

use pulp::{Arch, Scalar, Simd, WithSimd};

/// Instruction sets that hand-written code exists for, from the least to the best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Plain Rust for whatever the program was compiled for.
    Portable,
    /// SSE up to 4.2, with POPCNT.
    Sse42,
    /// AVX2 with FMA and the bit operations of its time.
    Avx2,
    /// AVX-512 F, VL, DQ and BW.
    Avx512,
}

/// The variable that forces a level.
pub const VARIABLE: &str = "SKYLIT_SIMD";

impl Level {
    /// All of them.
    pub const ALL: [Level; 4] = [Level::Portable, Level::Sse42, Level::Avx2, Level::Avx512];

    /// Its name in [`VARIABLE`] and in records.
    pub fn name(self) -> &'static str {
        match self {
            Level::Portable => "portable",
            Level::Sse42 => "sse4.2",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
        }
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        let has = match self {
            Level::Portable => true,
            Level::Sse42 => is_x86_feature_detected!("sse4.2") && is_x86_feature_detected!("popcnt"),
            Level::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt")
                    && is_x86_feature_detected!("popcnt")
            }
            Level::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                    && Level::Avx2.is_available()
            }
        };
        #[cfg(not(target_arch = "x86_64"))]
        let has = self == Level::Portable;
        has
    }

    /// Those that this processor has, from the least to the best.
    pub fn available() -> Vec<Level> {
        Level::ALL.into_iter().filter(|l| l.is_available()).collect()
    }

    /// The level to use: what [`VARIABLE`] forces, else the best there is. Errors where it names no level, or one that
    /// this processor lacks.
    pub fn chosen() -> Result<Level> {
        let best = || Level::available().last().copied().unwrap_or(Level::Portable);
        std::env::var(VARIABLE).map_or_else(|_| Ok(best()), |v| Level::parse(&v))
    }

    fn parse(text: &str) -> Result<Level> {
        let names = Level::ALL.map(Level::name);
        let level = Level::ALL.into_iter().find(|l| l.name() == text);
        let level =
            level.ok_or_else(|| Error::Usage(unknown_name("instruction set in SKYLIT_SIMD", text, names)))?;
        if level.is_available() {
            return Ok(level);
        }
        let has: Vec<_> = Level::available().into_iter().map(Level::name).collect();
        Err(Error::Usage(format!("this processor has no {text} (SKYLIT_SIMD); it has {}", has.join(", "))))
    }
}

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
    *ARCH.get_or_init(|| match Level::chosen() {
        Ok(Level::Portable | Level::Sse42) => None,
        #[cfg(target_arch = "x86_64")]
        Ok(Level::Avx2) => pulp::x86::V3::try_new().map(Arch::V3),
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

    #[test]
    fn levels_are_read_or_refused_with_the_reason() {
        assert_eq!(Level::parse("portable").ok(), Some(Level::Portable));
        let unknown = Level::parse("avx3").unwrap_err().to_string();
        assert!(unknown.contains("avx3") && unknown.contains("avx2"), "{unknown}");
        for level in Level::ALL {
            assert_eq!(Level::parse(level.name()).is_ok(), level.is_available(), "{level:?}");
        }
        assert!(Level::available().contains(&Level::Portable));
    }
}
