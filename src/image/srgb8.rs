//! Linear values to sRGB bytes: exactly rounded, in a few table look-ups instead of a power.

use crate::color::srgb_to_linear;
use std::sync::LazyLock;

/// The least exponent and mantissa bits in the table: 2^-13; all values below encode to byte 0.
const FIRST: u32 = 114 << 23;

/// Table cells are runs of floats that share exponent and seven mantissa bits: narrower than the steps between
/// bytes, so that a cell holds at most one step.
const SHIFT: u32 = 16;

struct Table {
    /// Byte at the start of each cell, from 2^-13 up to 1.
    start: Vec<u8>,
    /// Least value that encodes to each byte; none is beyond the last.
    least: [f32; 257],
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let mut least = [0f32; 257];
    for (byte, least) in least.iter_mut().enumerate().skip(1).take(255) {
        *least = least_value(byte as u8);
    }
    least[256] = f32::INFINITY;
    let cells = (1f32.to_bits() - FIRST) >> SHIFT;
    let start = (0..=cells)
        .map(|cell| {
            let value = f32::from_bits(FIRST + (cell << SHIFT));
            (least[..256].partition_point(|&l| l <= value) - 1) as u8
        })
        .collect();
    Table { start, least }
});

/// IEC 61966-2-1 in double precision, times 255 and rounded.
fn encode_exactly(v: f32) -> u8 {
    let v = f64::from(v).clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

fn least_value(byte: u8) -> f32 {
    let mut v = srgb_to_linear((f32::from(byte) - 0.5) / 255.0);
    while encode_exactly(v) >= byte {
        v = v.next_down();
    }
    while encode_exactly(v) < byte {
        v = v.next_up();
    }
    v
}

/// The byte nearest to the sRGB encoding of a linear value, which is clamped to [0, 1]; NaN counts as 0.
pub(super) fn encode(v: f32) -> u8 {
    let table = &*TABLE;
    // `max` and `min` answer with the number where the other is NaN.
    let v = v.max(f32::from_bits(FIRST)).min(1.0);
    let cell = (v.to_bits() - FIRST) >> SHIFT;
    let byte = table.start[cell as usize];
    byte + u8::from(v >= table.least[usize::from(byte) + 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_equals_the_curve() {
        // Every 37th float from far below the first step to beyond 1, and the two sides of every step.
        let all = (0x3000_0000..1.2f32.to_bits()).step_by(37).map(f32::from_bits);
        let edges = (1..=255u8).flat_map(|b| [least_value(b), least_value(b).next_down()]);
        for v in all.chain(edges).chain([0.0, -1.0, 1.0, 7.0, f32::INFINITY, f32::NEG_INFINITY]) {
            assert_eq!(encode(v), encode_exactly(v), "{v:e}");
        }
        assert_eq!(encode(f32::NAN), 0);
    }

    #[test]
    fn bytes_come_back() {
        for byte in 0..=255u8 {
            assert_eq!(encode(srgb_to_linear(f32::from(byte) / 255.0)), byte);
        }
    }
}
