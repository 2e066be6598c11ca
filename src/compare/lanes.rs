//! Symmetric filters along rows and columns of planes, sixteen values at a time: loops of a fixed length over arrays, which
//! become vector code. What lies at equal distance on both sides is added before it is weighed.

use std::ops::{Add, Mul, Sub};

/// Values worked on together: one vector of f32 on processors that have the widest.
pub(super) const LANES: usize = 16;

/// Consecutive values of a row.
pub(super) type Lanes<T> = [T; LANES];

/// f32 or f64.
pub(super) trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}

impl Number for f32 {}
impl Number for f64 {}

/// The values from `at` on, which there must be.
#[inline(always)]
pub(super) fn load<T: Copy>(data: &[T], at: usize) -> Lanes<T> {
    *data[at..].first_chunk().expect("planes have room for whole vectors")
}

/// Writes values from `at` on, for which there must be room.
#[inline(always)]
pub(super) fn store<T: Copy>(data: &mut [T], at: usize, v: Lanes<T>) {
    *data[at..].first_chunk_mut().expect("planes have room for whole vectors") = v;
}

/// `a + b`.
#[inline(always)]
pub(super) fn add<T: Number>(mut a: Lanes<T>, b: Lanes<T>) -> Lanes<T> {
    for (a, b) in a.iter_mut().zip(b) {
        *a = *a + b;
    }
    a
}

/// `a - b`.
#[inline(always)]
pub(super) fn sub<T: Number>(mut a: Lanes<T>, b: Lanes<T>) -> Lanes<T> {
    for (a, b) in a.iter_mut().zip(b) {
        *a = *a - b;
    }
    a
}

/// `a * by`.
#[inline(always)]
pub(super) fn scale<T: Number>(mut a: Lanes<T>, by: T) -> Lanes<T> {
    for a in &mut a {
        *a = *a * by;
    }
    a
}

/// `a + b * by`.
#[inline(always)]
pub(super) fn plus<T: Number>(mut a: Lanes<T>, b: Lanes<T>, by: T) -> Lanes<T> {
    for (a, b) in a.iter_mut().zip(b) {
        *a = *a + b * by;
    }
    a
}

/// Filters of `data` around the lanes from `middle` on, by values that are `step` apart: 1 along a row, a row's length along
/// a column. Weights are those of the middle, then outwards, of equal lengths.
#[inline(always)]
pub(super) fn filtered<T: Number, const N: usize>(
    data: &[T],
    middle: usize,
    step: usize,
    weights: [&[T]; N],
) -> [Lanes<T>; N] {
    let n = weights[0].len();
    let weights = weights.map(|w| &w[..n]);
    let mut sums = [load(data, middle); N];
    for (s, w) in sums.iter_mut().zip(&weights) {
        *s = scale(*s, w[0]);
    }
    for k in 1..n {
        let pair = add(load(data, middle - k * step), load(data, middle + k * step));
        for (s, w) in sums.iter_mut().zip(&weights) {
            *s = plus(*s, pair, w[k]);
        }
    }
    sums
}
