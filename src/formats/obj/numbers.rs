//! Decimal numbers, correctly rounded: the short ones that files are full of by one division, others by the library.

/// Powers of ten that a double holds exactly, up to what 19 digits can need.
const POWERS: [f64; 20] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19,
];

/// Integers up to this one are exact in a double.
const EXACT: u64 = 1 << 53;

/// Digits that an `u64` holds, whichever they are.
const MOST_DIGITS: usize = 19;

/// The number at the start of `text` and its length in bytes; `None` where there is none, or where it does not end at
/// a blank or at the end.
#[inline(always)]
pub fn number(text: &[u8]) -> Option<(f64, usize)> {
    match short_decimal(text) {
        None => any_number(text),
        found => found,
    }
}

/// Digits with at most one point and no exponent, that make an integer of at most 2^53: that and the power of ten are
/// exact, so their quotient is rounded but once (Clinger, "How to read floating point numbers accurately", 1990).
#[inline(always)]
fn short_decimal(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let start = usize::from(negative);
    let (mut whole, before) = digits(text, start, 0);
    let mut end = start + before;
    let mut behind = 0;
    if text.get(end) == Some(&b'.') {
        (whole, behind) = digits(text, end + 1, whole);
        end += 1 + behind;
    }
    // More digits may have overflowed.
    if !(1..=MOST_DIGITS).contains(&(before + behind)) || whole > EXACT || !is_gap(text, end) {
        return None;
    }
    let value = whole as f64 / POWERS[behind];
    Some((if negative { -value } else { value }, end))
}

/// Appends the digits from `at` on to `value`; returns also how many they are.
#[inline(always)]
fn digits(text: &[u8], at: usize, mut value: u64) -> (u64, usize) {
    let mut count = 0;
    while let Some(digit) = text.get(at + count).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
        count += 1;
    }
    (value, count)
}

#[cold]
fn any_number(text: &[u8]) -> Option<(f64, usize)> {
    let word = first_word(text);
    fast_float2::parse(word).ok().map(|value| (value, word.len()))
}

/// What stands before the first blank.
pub fn first_word(text: &[u8]) -> &[u8] {
    &text[..text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len())]
}

/// Whether a word ends at byte `at`.
#[inline(always)]
pub fn is_gap(text: &[u8], at: usize) -> bool {
    text.get(at).is_none_or(u8::is_ascii_whitespace)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    /// The standard library rounds correctly, so equality of bits is what is asked.
    fn check(text: &str) {
        let want: Option<f64> = text.parse().ok();
        let got = number(text.as_bytes());
        let bits = |x: f64| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
        assert_eq!(got.map(|(x, n)| (bits(x), n)), want.map(|x| (bits(x), text.len())), "{text:?}");
    }

    #[test]
    fn special_and_malformed_numbers_are_as_the_standard_library_has_them() {
        for text in [
            "0",
            "-0",
            "+0",
            "1.",
            ".5",
            "-.5",
            "+.5",
            "-5.",
            "00012.5000",
            "1e5",
            "1E-5",
            "1e+05",
            "-1.5e-007",
            "1e400",
            "1e-400",
            "4.9e-324",
            "nan",
            "NaN",
            "inf",
            "-inf",
            "Infinity",
            "+infinity",
            "9007199254740992",
            "9007199254740993",
            "9007199254740993.0",
            "18446744073709551615",
            "18446744073709551616",
            "9999999999999999999",
            "99999999999999999999",
            "0.0000000000000000001",
            "0.00000000000000000001",
            "1.7976931348623157e308",
            "2.2250738585072011e-308",
        ] {
            check(text);
        }
        for text in [
            "", "-", "+", ".", "-.", "1e", "1e+", "--1", "+-1", "1,5", "0x10", "1_0", "1.2.3", "1f", "1#",
            "1/2",
        ] {
            check(text);
            assert_eq!(number(text.as_bytes()), None, "{text:?}");
        }
        assert_eq!(number(b"1.5 2"), Some((1.5, 3)));
        assert_eq!(number(b"2.5e1\r"), Some((25.0, 5)));
    }

    #[test]
    fn short_decimals_are_rounded_as_the_standard_library_does() {
        let mut rng = TestRng::new(7);
        let mut integer = |below: u64| (rng.f64() * below as f64) as u64;
        // All lengths on both sides of the border between the two ways: integers about 2^53 have 16 digits.
        for _ in 0..200_000 {
            let count = 1 + integer(21) as usize;
            let digits: String = (0..count).map(|_| char::from(b'0' + integer(10) as u8)).collect();
            let point = integer(count as u64 + 2) as usize;
            let sign = ["", "-", "+"][integer(3) as usize];
            let text = match digits.get(..point) {
                Some(head) => format!("{sign}{head}.{}", &digits[point..]),
                None => format!("{sign}{digits}"),
            };
            check(&text);
        }
    }

    #[test]
    fn what_programs_print_reads_back() {
        let mut rng = TestRng::new(8);
        for _ in 0..50_000 {
            let x = (rng.f64() - 0.5) * 10f64.powi((rng.f64() * 24.0) as i32 - 12);
            for text in [
                format!("{x}"),
                format!("{}", x as f32),
                format!("{x:.6}"),
                format!("{x:e}"),
                format!("{x:.9}"),
            ] {
                check(&text);
            }
        }
    }
}
