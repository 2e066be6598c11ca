//! Order statistics of many floats, on all threads.

use rayon::prelude::*;

/// Values that one thread counts at a time: many more than there are classes.
const CHUNK: usize = 1 << 18;
/// The upper half of a key tells this many classes apart.
const CLASSES: usize = 1 << 16;

/// Orders as [`f32::total_cmp`] does.
#[inline]
fn key(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

#[inline]
fn class(v: f32) -> usize {
    (key(v) >> 16) as usize
}

/// The value that has `rank` values before it in the order of [`f32::total_cmp`].
///
/// Values are counted by class (sign, exponent, seven bits of the fraction), and only those of one class are selected from.
///
/// # Panics
/// If there are not more than `rank` values.
pub fn nth(values: &[f32], rank: usize) -> f32 {
    assert!(rank < values.len(), "rank {rank} of {} values", values.len());
    let count = |part: &[f32]| {
        let mut counts = vec![0usize; CLASSES];
        part.iter().for_each(|v| counts[class(*v)] += 1);
        counts
    };
    let counts = values.par_chunks(CHUNK).map(count).reduce_with(|mut a, b| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    });
    let mut before = 0;
    let wanted = counts.into_iter().flatten().position(|n| {
        before += n;
        before > rank
    });
    let mut inside: Vec<f32> = values.par_iter().copied().filter(|v| Some(class(*v)) == wanted).collect();
    // Those of the class are the last of the ones counted.
    let rank = rank - (before - inside.len());
    *inside.select_nth_unstable_by(rank, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::hash::mix64;

    #[test]
    fn ranks_are_those_of_sorted_values() {
        let odd = [0.0, -0.0, f32::MIN_POSITIVE, 1e-40, -1e-40, f32::INFINITY, f32::NEG_INFINITY];
        let any = |i: u64| Some(f32::from_bits(mix64(i) as u32)).filter(|v| !v.is_nan());
        let near = |i: u64| Some(1.0 + (mix64(i) >> 50) as f32 * f32::EPSILON);
        let both = (0..300_000).flat_map(|i| [any(i), near(i)]).flatten();
        let mut values: Vec<f32> = both.chain(odd).chain([3.0; 1000]).collect();
        let ranks = [0, 1, 1000, values.len() / 2, values.len() * 3 / 4, values.len() - 1];
        let found = ranks.map(|r| nth(&values, r));
        values.sort_unstable_by(f32::total_cmp);
        assert_eq!(found.map(f32::to_bits), ranks.map(|r| values[r].to_bits()));
        assert_eq!(nth(&[7.5], 0), 7.5);
    }
}
