//! Sums of doubles without rounding: whatever the order of the terms, the same bits.
//!
//! A small superaccumulator (Neal 2015, "Fast Exact Summation Using Small and Large Superaccumulators"): a fixed-point number
//! that is wide enough for every double, in digits of 32 bits that are held in 64, so that carries wait for two thousand
//! terms.

/// Bits of a digit.
const DIGIT: u32 = 32;
/// From 2^-1074, the least bit of the least double, to 2^1024 and some more for sums: 2,098 bits and 64.
const DIGITS: usize = 68;
/// A term adds less than 2^53 to a digit, so that one of 64 bits with a sign has room for 2^10 of them.
const TERMS_A_CARRY: u32 = 1 << 10;

/// An exact sum.
#[derive(Debug, Clone)]
pub struct ExactSum {
    /// Digit `i` counts in units of 2^(32 i - 1074).
    digits: [i64; DIGITS],
    /// Terms that may be added before the digits must carry.
    room: u32,
    /// NaN and infinities; 0 where there was none.
    special: f64,
}

impl Default for ExactSum {
    fn default() -> Self {
        ExactSum { digits: [0; DIGITS], room: TERMS_A_CARRY, special: 0.0 }
    }
}

impl ExactSum {
    /// Adds a term. Infinities and NaN count as in any sum.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        let exponent = (bits >> 52) as u32 & 0x7ff;
        let fraction = bits & ((1 << 52) - 1);
        if exponent == 0x7ff {
            self.special += term;
            return;
        }
        // Numbers below 2^-1022 have no leading 1, and the exponent of those just above.
        let (mantissa, shift) =
            if exponent == 0 { (fraction, 0) } else { (fraction | 1 << 52, exponent - 1) };
        let (digit, within) = ((shift / DIGIT) as usize, shift % DIGIT);
        // 53 bits moved by up to 31: three digits, of which the upper two go into one.
        let wide = u128::from(mantissa) << within;
        let low = (wide as u64 & 0xffff_ffff) as i64;
        let high = (wide >> DIGIT) as i64;
        let sign = 1 - 2 * (bits >> 63) as i64;
        self.digits[digit] += sign * low;
        self.digits[digit + 1] += sign * high;
        self.room -= 1;
        if self.room == 0 {
            self.carry();
        }
    }

    /// Adds all terms of another sum.
    pub fn merge(&mut self, mut other: ExactSum) {
        self.carry();
        other.carry();
        self.digits.iter_mut().zip(other.digits).for_each(|(mine, add)| *mine += add);
        self.special += other.special;
        self.carry();
    }

    /// Brings every digit but the last into 0..2^32.
    fn carry(&mut self) {
        let mut over = 0;
        for digit in &mut self.digits[..DIGITS - 1] {
            let value = *digit + over;
            *digit = value & 0xffff_ffff;
            over = value >> DIGIT;
        }
        self.digits[DIGITS - 1] += over;
        self.room = TERMS_A_CARRY;
    }

    /// The double nearest to the sum, but for a last bit where the sum lies near the middle of two.
    pub fn value(mut self) -> f64 {
        if self.special != 0.0 || self.special.is_nan() {
            return self.special;
        }
        self.carry();
        // All digits but the last are positive now; a negative sum is easier to read as its opposite.
        let negative = self.digits[DIGITS - 1] < 0;
        if negative {
            self.digits.iter_mut().for_each(|d| *d = -*d);
            self.carry();
        }
        let Some(top) = self.digits.iter().rposition(|&d| d != 0) else { return 0.0 };
        // Three digits hold at least 65 bits from the leading one on; the first of them is rounded with what lies below.
        let from = top.saturating_sub(2);
        let wide = self.digits[from..=top].iter().rev().fold(0u128, |sum, &d| (sum << DIGIT) | d as u128);
        let below = self.digits[..from].iter().any(|&d| d != 0);
        let value = scaled((wide << 1) | u128::from(below), (DIGIT as usize * from) as i32 - 1075);
        if negative { -value } else { value }
    }
}

/// `n` times two to the `exponent`, in two steps, as one factor may be beyond the range.
fn scaled(n: u128, exponent: i32) -> f64 {
    let half = exponent / 2;
    n as f64 * 2f64.powi(half) * 2f64.powi(exponent - half)
}

impl Extend<f64> for ExactSum {
    fn extend<T: IntoIterator<Item = f64>>(&mut self, terms: T) {
        terms.into_iter().for_each(|t| self.add(t));
    }
}

impl FromIterator<f64> for ExactSum {
    fn from_iter<T: IntoIterator<Item = f64>>(terms: T) -> Self {
        let mut sum = ExactSum::default();
        sum.extend(terms);
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::hash::mix64;

    fn sum(terms: &[f64]) -> f64 {
        terms.iter().copied().collect::<ExactSum>().value()
    }

    /// Doubles of every size.
    fn random(n: u64) -> Vec<f64> {
        let finite = |i| f64::from_bits(mix64(i) & !(1 << 62));
        (0..n).map(finite).collect()
    }

    #[test]
    fn one_term_comes_back_to_the_bit() {
        let ends = [0.0, 1.0, -1.0, 0.1, f64::MIN_POSITIVE, 5e-324, -5e-324, f64::MAX, f64::MIN, 1e-310];
        for v in ends.into_iter().chain(random(10_000)) {
            assert_eq!(sum(&[v]), v);
        }
    }

    #[test]
    fn nothing_is_lost_between_terms_of_any_size() {
        assert_eq!(sum(&[1e300, 1.0, -1e300]), 1.0);
        assert_eq!(sum(&[1e300, 5e-324, 1e-5, -1e300, -1e-5]), 5e-324);
        // One by one in doubles: 999,999.99984.
        assert_eq!(sum(&vec![0.1; 10_000_000]), 1e6);
        assert_eq!(sum(&[f64::MAX, f64::MAX, -f64::MAX]), f64::MAX);
        assert_eq!(sum(&[-1.0, 2f64.powi(-60), 1.0]), 2f64.powi(-60));
    }

    #[test]
    fn the_order_leaves_no_trace() {
        let mut terms = random(50_000);
        let expected = sum(&terms);
        terms.reverse();
        assert_eq!(sum(&terms), expected);
        terms.sort_by(f64::total_cmp);
        assert_eq!(sum(&terms), expected);
        let mut parts = ExactSum::default();
        for part in terms.chunks(777) {
            parts.merge(part.iter().copied().collect());
        }
        assert_eq!(parts.value(), expected);
        terms.extend(terms.clone().iter().map(|t| -t));
        assert_eq!(sum(&terms), 0.0);
    }

    #[test]
    fn sums_of_whole_numbers_are_exact() {
        let all: Vec<f64> = (0..200_000u64).map(|i| (mix64(i) >> 12) as f64).collect();
        let exact: u128 = all.iter().map(|&v| v as u128).sum();
        assert_eq!(sum(&all), exact as f64);
        let small: Vec<f64> = all.iter().map(|v| -v * 2f64.powi(-1060)).collect();
        assert_eq!(sum(&small), -(exact as f64) * 2f64.powi(-1060));
    }

    #[test]
    fn what_is_not_finite_is_said() {
        assert!(sum(&[1.0, f64::NAN]).is_nan());
        assert_eq!(sum(&[1.0, f64::INFINITY]), f64::INFINITY);
        assert!(sum(&[f64::NEG_INFINITY, f64::INFINITY]).is_nan());
    }
}
