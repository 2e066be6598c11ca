//! The corners of a face: `position`, `position/uv`, `position//normal` or `position/uv/normal`.

/// Indices from 1 of position, texture coordinate and normal; 0 where absent.
pub type Corner = [i64; 3];

/// Reads a corner. `counts` are the positions, texture coordinates and normals defined so far, from whose end
/// negative indices count.
pub fn parse_corner(word: &[u8], counts: [i64; 3]) -> Result<Corner, String> {
    let mut corner = [0; 3];
    let mut rest = Some(word);
    for (index, count) in corner.iter_mut().zip(counts) {
        let Some(text) = rest else { break };
        let end = text.iter().position(|&b| b == b'/');
        let number = &text[..end.unwrap_or(text.len())];
        rest = end.map(|end| &text[end + 1..]);
        if number.is_empty() {
            continue;
        }
        let bad =
            |why: &str| Err(format!("\"{}\" is no corner of a face: {why}", String::from_utf8_lossy(word)));
        *index = match parse_integer(number) {
            Some(0) => return bad("indices count from 1"),
            Some(value) if value > 0 => value,
            Some(value) if -value <= count => count + 1 + value,
            Some(_) => return bad(&format!("it counts back over the start; so far there are {count}")),
            None => return bad("it must be position, position/uv, position//normal or position/uv/normal"),
        };
    }
    if rest.is_some() || corner[0] == 0 {
        let text = String::from_utf8_lossy(word);
        return Err(format!(
            "\"{text}\" is no corner of a face: it must be position, position/uv, position//normal or position/uv/normal"
        ));
    }
    Ok(corner)
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
        let counts = [10, 20, 30];
        for (text, want) in [
            ("7", [7, 0, 0]),
            ("7/", [7, 0, 0]),
            ("7//", [7, 0, 0]),
            ("7/8", [7, 8, 0]),
            ("7/8/", [7, 8, 0]),
            ("7//9", [7, 0, 9]),
            ("+7/8/009", [7, 8, 9]),
            ("-1/-20/-30", [10, 1, 1]),
            ("999999999999999999", [999_999_999_999_999_999, 0, 0]),
        ] {
            assert_eq!(parse_corner(text.as_bytes(), counts), Ok(want), "{text}");
        }
    }

    #[test]
    fn what_is_no_corner_is_refused() {
        for text in
            ["", "/", "/1", "//1", "1/2/3/4", "1/2/3/", "1.5", "0", "1/0", "-11", "1/x", "-", "--1", "1e3"]
        {
            assert!(parse_corner(text.as_bytes(), [10, 20, 30]).is_err(), "{text}");
        }
        assert!(parse_corner(b"99999999999999999999999", [1; 3]).is_err());
    }
}
