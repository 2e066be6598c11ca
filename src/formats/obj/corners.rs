//! The corners of a face: `position`, `position/uv`, `position//normal` or `position/uv/normal`.

use super::numbers::is_gap;

/// Numbers of position, texture coordinate and normal: from 1, or negative and counted from the last so far; 0 where
/// absent.
pub type Corner = [i64; 3];

const FORMS: &str = "it must be position, position/uv, position//normal or position/uv/normal";

/// Digits that an `u32` holds, whichever they are.
const SHORT: usize = 9;

/// The corner at the start of `text` and its length, if it is of the usual kind: short numbers without sign that end
/// at a blank or at the end. Anything else is for [`parse_corner`].
#[inline(always)]
pub fn short_corner(text: &[u8]) -> Option<([u32; 3], usize)> {
    let (position, mut end) = digits(text, 0);
    let mut good = position != 0 && end <= SHORT;
    let mut corner = [position, 0, 0];
    for index in &mut corner[1..] {
        if text.get(end) != Some(&b'/') {
            break;
        }
        let (value, length) = digits(text, end + 1);
        // An empty one is absent; a zero is an error.
        good &= length <= SHORT && (value != 0 || length == 0);
        *index = value;
        end += 1 + length;
    }
    (good && is_gap(text, end)).then_some((corner, end))
}

/// The integer at `at`, if short, and its digits.
#[inline(always)]
fn digits(text: &[u8], at: usize) -> (u32, usize) {
    let mut value = 0u32;
    let mut count = 0;
    while let Some(digit) = text.get(at + count).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        value = value.wrapping_mul(10).wrapping_add(u32::from(digit));
        count += 1;
    }
    (value, count)
}

/// Reads a corner of any form.
pub fn parse_corner(word: &[u8]) -> Result<Corner, String> {
    let mut corner = [0; 3];
    let mut rest = Some(word);
    for index in &mut corner {
        let Some(text) = rest else { break };
        let end = text.iter().position(|&b| b == b'/');
        let number = &text[..end.unwrap_or(text.len())];
        rest = end.map(|end| &text[end + 1..]);
        if number.is_empty() {
            continue;
        }
        *index = match parse_integer(number) {
            Some(0) => return Err(no_corner(word, "indices count from 1")),
            Some(value) => value,
            None => return Err(no_corner(word, FORMS)),
        };
    }
    if rest.is_some() || corner[0] == 0 {
        return Err(no_corner(word, FORMS));
    }
    Ok(corner)
}

/// The message for a word with an index that counts back further than the `count` defined so far.
pub fn before_start(word: &[u8], count: i64) -> String {
    no_corner(word, &format!("it counts back over the start; so far there are {count}"))
}

fn no_corner(word: &[u8], why: &str) -> String {
    let shown = &word[..word.len().min(80)];
    format!("\"{}\" is no corner of a face: {why}", String::from_utf8_lossy(shown))
}

/// At most 18 digits, which an `i64` holds, with a sign or without.
fn parse_integer(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || digits.len() > 18 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits.iter().fold(0, |value, digit| value * 10 + i64::from(digit - b'0'));
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_every_form_are_read() {
        for (text, want) in [
            ("7", [7, 0, 0]),
            ("7/", [7, 0, 0]),
            ("7//", [7, 0, 0]),
            ("7/8", [7, 8, 0]),
            ("7/8/", [7, 8, 0]),
            ("7//9", [7, 0, 9]),
            ("+7/8/009", [7, 8, 9]),
            ("-1/-20/-30", [-1, -20, -30]),
            ("999999999/1", [999_999_999, 1, 0]),
            ("1234567890", [1_234_567_890, 0, 0]),
            ("999999999999999999", [999_999_999_999_999_999, 0, 0]),
        ] {
            assert_eq!(parse_corner(text.as_bytes()), Ok(want), "{text}");
            let plain = !text.contains(['+', '-']) && text.split('/').all(|n| n.len() <= SHORT);
            let short = plain.then(|| (want.map(|i| i as u32), text.len()));
            assert_eq!(short_corner(text.as_bytes()), short, "{text}");
            assert_eq!(short_corner(format!("{text}\r 1").as_bytes()), short, "{text}");
        }
    }

    #[test]
    fn what_is_no_corner_is_refused() {
        for text in [
            "", "/", "/1", "//1", "1/2/3/4", "1/2/3/", "1.5", "0", "1/0", "1//0", "1/x", "-", "--1", "1e3",
            "1#",
        ] {
            assert!(parse_corner(text.as_bytes()).is_err(), "{text}");
            assert_eq!(short_corner(text.as_bytes()), None, "{text}");
        }
        assert!(parse_corner(b"99999999999999999999999").is_err());
        assert_eq!(short_corner(b"4294967297"), None);
    }
}
