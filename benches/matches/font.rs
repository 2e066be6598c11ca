//! Letters of 3x5 pixels, for names under small pictures.

/// Rows from the top, three bits each, the leftmost pixel the highest bit.
const GLYPHS: &[(char, [u8; 5])] = &[
    ('0', [7, 5, 5, 5, 7]),
    ('1', [2, 6, 2, 2, 7]),
    ('2', [7, 1, 7, 4, 7]),
    ('3', [7, 1, 3, 1, 7]),
    ('4', [5, 5, 7, 1, 1]),
    ('5', [7, 4, 7, 1, 7]),
    ('6', [7, 4, 7, 5, 7]),
    ('7', [7, 1, 2, 2, 2]),
    ('8', [7, 5, 7, 5, 7]),
    ('9', [7, 5, 7, 1, 7]),
    ('a', [2, 5, 7, 5, 5]),
    ('b', [6, 5, 6, 5, 6]),
    ('c', [3, 4, 4, 4, 3]),
    ('d', [6, 5, 5, 5, 6]),
    ('e', [7, 4, 6, 4, 7]),
    ('f', [7, 4, 6, 4, 4]),
    ('g', [3, 4, 5, 5, 3]),
    ('h', [5, 5, 7, 5, 5]),
    ('i', [7, 2, 2, 2, 7]),
    ('j', [1, 1, 1, 5, 2]),
    ('k', [5, 5, 6, 5, 5]),
    ('l', [4, 4, 4, 4, 7]),
    ('m', [5, 7, 7, 5, 5]),
    ('n', [6, 5, 5, 5, 5]),
    ('o', [2, 5, 5, 5, 2]),
    ('p', [6, 5, 6, 4, 4]),
    ('q', [2, 5, 5, 6, 3]),
    ('r', [6, 5, 6, 5, 5]),
    ('s', [3, 4, 2, 1, 6]),
    ('t', [7, 2, 2, 2, 2]),
    ('u', [5, 5, 5, 5, 7]),
    ('v', [5, 5, 5, 5, 2]),
    ('w', [5, 5, 7, 7, 5]),
    ('x', [5, 5, 2, 5, 5]),
    ('y', [5, 5, 2, 2, 2]),
    ('z', [7, 1, 2, 4, 7]),
    ('-', [0, 0, 7, 0, 0]),
    ('_', [0, 0, 0, 0, 7]),
    ('.', [0, 0, 0, 0, 2]),
    ('/', [1, 1, 2, 4, 4]),
    (' ', [0, 0, 0, 0, 0]),
];

/// Width and height of a letter with the space about it, pixels.
pub const CELL: [usize; 2] = [4, 7];

/// Calls `set` with the place of every pixel of a word whose left top corner is (0, 0).
pub fn draw(text: &str, mut set: impl FnMut(usize, usize)) {
    for (i, c) in text.chars().enumerate() {
        let known = GLYPHS.iter().find(|(g, _)| *g == c.to_ascii_lowercase());
        // A full box for what is not in the table.
        let rows = known.map_or([7; 5], |(_, rows)| *rows);
        for (y, row) in rows.into_iter().enumerate() {
            (0..3).filter(|x| row >> (2 - x) & 1 == 1).for_each(|x| set(i * CELL[0] + x, y + 1));
        }
    }
}
