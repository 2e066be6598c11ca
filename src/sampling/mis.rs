//! Weights that combine two sampling strategies (Veach, "Robust Monte Carlo Methods for Light Transport Simulation",
//! 1997, 9.2.2 and 9.2.4).

/// Balance heuristic: weight of a sample that strategy `a` drew with density `a`, where the other strategy would
/// have drawn it with density `b` (same measure, each times its number of samples). In [0, 1]; `a` infinite (a delta
/// lobe) weighs 1, `a` zero weighs 0; the weights of the two strategies sum to 1.
#[inline(always)]
pub fn balance(a: f32, b: f32) -> f32 {
    ratio(a, b, |r| r)
}

/// Power heuristic with exponent 2: as [`balance`], with squared densities, free of overflow.
#[inline(always)]
pub fn power(a: f32, b: f32) -> f32 {
    ratio(a, b, |r| r * r)
}

#[inline(always)]
fn ratio(a: f32, b: f32, shape: impl Fn(f32) -> f32) -> f32 {
    if a.is_nan() || a <= 0.0 {
        return 0.0;
    }
    if a == f32::INFINITY {
        return 1.0;
    }
    // b / a may be anything up to infinity: the weight then goes to 0 as it should.
    1.0 / (1.0 + shape(b / a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_stay_finite() {
        let densities = [1e-38f32, 1e-20, 0.3, 1.0, 7.0, 1e20, 3e38];
        for a in densities {
            for b in densities {
                for f in [balance, power] {
                    let sum = f(a, b) + f(b, a);
                    assert!((sum - 1.0).abs() < 2e-7, "{a} {b} {sum}");
                }
            }
            assert_eq!((power(a, 0.0), power(0.0, a)), (1.0, 0.0));
            assert_eq!((power(f32::INFINITY, a), power(a, f32::INFINITY)), (1.0, 0.0));
        }
        assert_eq!((power(0.0, 0.0), balance(0.0, 0.0)), (0.0, 0.0));
        assert_eq!(balance(1.0, 3.0), 0.25);
        assert_eq!(power(1.0, 3.0), 0.1);
    }
}
