use super::*;
use crate::testing::TestRng;
use std::io::Read;

#[track_caller]
fn round_trip(data: &[u8], cuts: &[usize]) -> usize {
    let packed = zlib(data, cuts);
    let mut out = Vec::new();
    flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut out).expect("inflates");
    assert!(out == data, "{} bytes differ after a round trip", data.len());
    packed.len()
}

#[test]
fn every_kind_of_data_comes_back() {
    let mut rng = TestRng::new(5);
    round_trip(&[], &[]);
    round_trip(&[7], &[0, 1, 9]);
    for n in [2, 3, 8, 9, 17, 1000, SEGMENT - 1, SEGMENT, SEGMENT + 1, 200_001] {
        round_trip(&vec![128; n], &[]);
        let noise: Vec<u8> = (0..n).map(|_| rng.bits() as u8).collect();
        // Noise is stored: a block header every segment, the frame, and one cut.
        assert!(round_trip(&noise, &[n / 2]) <= n + 5 * (n / SEGMENT + 3) + 8);
        let peaked: Vec<u8> = (0..n).map(|_| 128u8.wrapping_add((rng.f32().powi(4) * 40.0) as u8)).collect();
        round_trip(&peaked, &[n / 3, n / 2]);
    }
}

#[test]
fn runs_of_every_length_come_back() {
    let mut data = Vec::new();
    for n in 1..600 {
        data.extend(std::iter::repeat_n((n % 251) as u8, n));
    }
    assert!(round_trip(&data, &[]) < data.len() / 20);
}

#[test]
fn skewed_counts_keep_within_the_longest_code() {
    // Fibonacci weights make the deepest Huffman tree there is.
    let mut counts = [0u32; SYMBOLS];
    let (mut a, mut b) = (1u32, 1u32);
    for count in counts.iter_mut().take(40) {
        *count = a;
        (a, b) = (b, a + b);
    }
    for limit in [6, 7, 9, MAX_CODE_BITS] {
        let lengths = code_lengths(&counts, limit);
        let kraft: f64 = lengths.iter().filter(|&&l| l > 0).map(|&l| 0.5f64.powi(l.into())).sum();
        // A full code: sums of powers of two are exact.
        assert_eq!(kraft, 1.0);
        assert!(lengths.iter().all(|&l| usize::from(l) <= limit));
    }
    let mut data = Vec::new();
    (0..20u8).for_each(|i| data.extend((0..1usize << (i / 2)).flat_map(|_| [i, 255 - i])));
    round_trip(&data, &[]);
}

#[test]
fn entropy_is_nearly_reached() {
    // Geometric bytes, P(k) = 2^-(k+1), have an entropy of 2 bits, and a Huffman code reaches it exactly.
    let mut rng = TestRng::new(6);
    let data: Vec<u8> = (0..100_000).map(|_| (rng.bits() | 1 << 60).trailing_zeros() as u8).collect();
    let packed = round_trip(&data, &[]);
    // 1 % for tables, the longest-code limit and chance.
    assert!(packed * 4 < data.len() * 101 / 100 + 400, "{packed}");
}
