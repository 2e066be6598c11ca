//! Arrays of eight in plain Rust; the compiler makes NEON of it on aarch64.

use super::{LANES, Lanes, Simd};

#[derive(Clone, Copy)]
pub struct Portable;

#[inline(always)]
fn zip(a: Lanes, b: Lanes, f: impl Fn(f32, f32) -> f32) -> Lanes {
    let mut out = a;
    for i in 0..LANES {
        out.0[i] = f(a.0[i], b.0[i]);
    }
    out
}

impl Simd for Portable {
    type V = Lanes;

    #[inline(always)]
    fn load(from: &Lanes) -> Lanes {
        *from
    }
    #[inline(always)]
    fn store(v: Lanes) -> Lanes {
        v
    }
    #[inline(always)]
    fn splat(x: f32) -> Lanes {
        Lanes([x; LANES])
    }
    #[inline(always)]
    fn add(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
        Self::add(Self::mul(a, b), c)
    }
    #[inline(always)]
    fn mul_sub(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
        Self::sub(Self::mul(a, b), c)
    }
    #[inline(always)]
    fn neg_mul_add(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
        Self::sub(c, Self::mul(a, b))
    }
    #[inline(always)]
    fn min(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn le(a: Lanes, b: Lanes) -> u32 {
        let mut bits = 0;
        for i in 0..LANES {
            bits |= u32::from(a.0[i] <= b.0[i]) << i;
        }
        bits
    }
    #[inline(always)]
    fn le_bits(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| f32::from_bits(if a <= b { u32::MAX } else { 0 }))
    }
    #[inline(always)]
    fn and(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| f32::from_bits(a.to_bits() & b.to_bits()))
    }
    #[inline(always)]
    fn or(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| f32::from_bits(a.to_bits() | b.to_bits()))
    }
    #[inline(always)]
    fn xor(a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| f32::from_bits(a.to_bits() ^ b.to_bits()))
    }
    #[inline(always)]
    fn select(bits: Lanes, a: Lanes, b: Lanes) -> Lanes {
        let mut out = b;
        for i in 0..LANES {
            out.0[i] = if bits.0[i].to_bits() != 0 { a.0[i] } else { b.0[i] };
        }
        out
    }
    #[inline(always)]
    fn bits(a: Lanes) -> u32 {
        let mut bits = 0;
        for i in 0..LANES {
            bits |= (a.0[i].to_bits() >> 31) << i;
        }
        bits
    }
    #[inline(always)]
    fn least(a: Lanes) -> f32 {
        a.0.iter().fold(f32::INFINITY, |least, &x| if x < least { x } else { least })
    }
    #[inline(always)]
    fn compress(a: Lanes, set: u32) -> Lanes {
        let order = &super::COMPRESSED[set as usize % (1 << LANES)];
        let mut out = a;
        for (to, &from) in out.0.iter_mut().zip(order) {
            *to = a.0[from as usize % LANES];
        }
        out
    }
    #[inline(always)]
    fn prefetch<T>(_: &T) {}
}
