//! All paths do the same, but for how often they round.

use super::{Available, Job, LANES, Lanes, Simd, enter};
use crate::math::simd::Level;
use crate::testing::TestRng;

/// Every operation on three vectors, one result after another.
struct Everything([Lanes; 3]);

impl Job for Everything {
    type Output = (Vec<Lanes>, Vec<Lanes>, Vec<u32>);

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let [a, b, c] = [S::load(&self.0[0]), S::load(&self.0[1]), S::load(&self.0[2])];
        let smaller = S::le_bits(a, b);
        let exact = vec![
            S::store(S::add(a, b)),
            S::store(S::sub(a, b)),
            S::store(S::mul(a, b)),
            S::store(S::div(a, b)),
            S::store(S::min(a, b)),
            S::store(S::max(a, b)),
            S::store(S::splat(1.5)),
            S::store(S::select(smaller, a, b)),
            S::store(S::and(smaller, a)),
            S::store(S::or(S::and(smaller, a), S::and(smaller, c))),
            S::store(S::xor(b, S::splat(-0.0))),
        ];
        let fused = vec![
            S::store(S::mul_add(a, b, c)),
            S::store(S::mul_sub(a, b, c)),
            S::store(S::neg_mul_add(a, b, c)),
        ];
        let mut words = vec![S::le(a, b), S::bits(a), S::bits(smaller), S::least(a).to_bits()];
        for set in 0..256u32 {
            let packed = S::compress(a, set).0;
            words.extend(packed[..set.count_ones() as usize].iter().map(|x| x.to_bits()));
        }
        S::prefetch(&self.0);
        (exact, fused, words)
    }
}

#[test]
fn paths_agree() {
    let mut rng = TestRng::new(1);
    for round in 0..200 {
        let mut random = || Lanes(std::array::from_fn(|_| rng.f32() * 4.0 - 2.0));
        let (mut a, b, c) = (random(), random(), random());
        if round % 4 == 0 {
            a.0[round % LANES] = f32::INFINITY;
        }
        let run = |level| enter(Available::new(Some(level)).expect("available"), Everything([a, b, c]));
        let (exact, fused, words) = run(Level::Portable);
        for level in Level::available() {
            let got = run(level);
            let bits = |v: &[Lanes]| v.iter().flat_map(|l| l.0.map(f32::to_bits)).collect::<Vec<_>>();
            assert_eq!(bits(&got.0), bits(&exact), "{level:?}");
            assert_eq!(got.2, words, "{level:?}");
            for (x, y) in got.1.iter().flat_map(|l| l.0).zip(fused.iter().flat_map(|l| l.0)) {
                // Rounded once or twice: within the rounding of a product of size 4.
                assert!(x == y || (x - y).abs() <= 4.0 * f32::EPSILON, "{level:?}: {x} {y}");
            }
        }
    }
}

#[test]
fn nothing_compares_with_nan() {
    struct Nan;
    impl Job for Nan {
        type Output = (u32, Lanes, Lanes);
        #[inline(always)]
        fn run<S: Simd>(self) -> (u32, Lanes, Lanes) {
            let (nan, one) = (S::splat(f32::NAN), S::splat(1.0));
            let le = S::le(nan, one) | S::le(one, nan) | S::le(nan, nan);
            (le, S::store(S::min(nan, one)), S::store(S::max(nan, one)))
        }
    }
    for level in Level::available() {
        let (le, min, max) = enter(Available::new(Some(level)).expect("available"), Nan);
        assert_eq!((le, min, max), (0, Lanes([1.0; LANES]), Lanes([1.0; LANES])), "{level:?}");
    }
}
