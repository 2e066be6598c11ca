//! Pictures as few bytes: planes of bytes that are alike, deflated.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use half::f16;
use rayon::prelude::*;
use std::io::Write;

/// How a pixel is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Three whole numbers of 8 bits, of which 255 is 1.
    Bytes,
    /// Three 16-bit floats.
    Half,
    /// Three mantissas of nine bits and one exponent of five (the shared exponent format of OpenGL's
    /// EXT_texture_shared_exponent).
    Shared,
    /// Three 32-bit floats.
    Float,
}

impl Format {
    /// As the script knows it.
    pub fn name(self) -> &'static str {
        match self {
            Format::Bytes => "u8",
            Format::Half => "f16",
            Format::Shared => "rgb9e5",
            Format::Float => "f32",
        }
    }
}

/// A picture as the page holds it.
pub struct Packed {
    /// Of a pixel.
    pub format: Format,
    /// First bytes of all pixels, then second bytes and so on, as a zlib stream.
    pub bytes: Vec<u8>,
    /// Pixels that the format cannot hold: place and values.
    pub exceptions: Vec<(usize, [f32; 3])>,
    /// The largest difference of a channel from what the format makes of it, as a part of the pixel's largest channel; of pixels
    /// that are no exceptions.
    pub error: f32,
}

/// More pixels than that are not held one by one.
const MOST_EXCEPTIONS: usize = 4096;

/// Packs a picture: without loss where bytes or 16-bit floats do it, or where it is asked for.
pub fn pack(rgb: &[[f32; 3]], encoded: bool, lossless: bool) -> Packed {
    let all = |test: fn(f32) -> bool| rgb.par_iter().with_min_len(4096).all(|p| p.iter().all(|v| test(*v)));
    let is_byte = |v: f32| (0.0..=1.0).contains(&v) && (v * 255.0).round() / 255.0 == v;
    let exact = |format, bytes| Packed { format, bytes, exceptions: Vec::new(), error: 0.0 };
    if encoded && all(is_byte) {
        return exact(Format::Bytes, planes(rgb, |p| p.map(|v| (v * 255.0).round() as u8)));
    }
    let is_half = |v: f32| f16::from_f32(v).to_f32().to_bits() == v.to_bits();
    if lossless && all(is_half) {
        let halves = |p: [f32; 3]| {
            let [r, g, b] = p.map(|v| f16::from_f32(v).to_le_bytes());
            [r[0], r[1], g[0], g[1], b[0], b[1]]
        };
        return exact(Format::Half, planes(rgb, halves));
    }
    if !lossless {
        let exceptions: Vec<(usize, [f32; 3])> = rgb
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, p)| !Shared::holds(*p))
            .take(MOST_EXCEPTIONS + 1)
            .collect();
        if exceptions.len() <= MOST_EXCEPTIONS {
            let of_pixel = |p: &[f32; 3]| if Shared::holds(*p) { Shared::error(*p) } else { 0.0 };
            let error = rgb.par_iter().with_min_len(4096).map(of_pixel).reduce(|| 0.0, f32::max);
            let bytes = planes(rgb, |p| Shared::of(p).0.to_le_bytes());
            return Packed { format: Format::Shared, bytes, exceptions, error };
        }
    }
    let floats = |p: [f32; 3]| {
        let mut out = [0; 12];
        out.chunks_exact_mut(4).zip(p).for_each(|(o, v)| o.copy_from_slice(&v.to_le_bytes()));
        out
    };
    exact(Format::Float, planes(rgb, floats))
}

/// A map in 255 even steps from 0 to `high`, as a zlib stream.
pub fn pack_map(values: &[f32], high: f32) -> Vec<u8> {
    // A cast from NaN gives 0, and what is above the range its end.
    deflated(&values.iter().map(|v| (v / high * 255.0).round() as u8).collect::<Vec<_>>())
}

fn planes<const N: usize>(rgb: &[[f32; 3]], bytes: impl Fn([f32; 3]) -> [u8; N]) -> Vec<u8> {
    let mut out = vec![0; N * rgb.len()];
    for (i, p) in rgb.iter().enumerate() {
        bytes(*p).iter().enumerate().for_each(|(plane, b)| out[plane * rgb.len() + i] = *b);
    }
    deflated(&out)
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(5));
    // A vector takes all that it is given.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

/// Nine bits for each mantissa, without a hidden one, and five for the exponent, whose bias is 15.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shared(pub u32);

impl Shared {
    /// The largest value: 511 / 512 x 2^16.
    pub const LARGEST: f32 = 65408.0;

    /// Whether the format has a value near to each of these: no negative, none that is no number, none beyond its range.
    pub fn holds(rgb: [f32; 3]) -> bool {
        // NaN is in no range.
        rgb.iter().all(|v| (0.0..=Shared::LARGEST).contains(v))
    }

    /// The nearest; what the format does not hold is cut to its range.
    pub fn of(rgb: [f32; 3]) -> Shared {
        // No number is 0, too.
        let rgb = rgb.map(|v| if v > 0.0 { v.min(Shared::LARGEST) } else { 0.0 });
        let largest = rgb[0].max(rgb[1]).max(rgb[2]);
        let power = (largest.to_bits() >> 23) as i32 - 127;
        let mut exponent = power.max(-16) + 16;
        // A mantissa that rounds up to 512 takes the next exponent.
        if (largest / Shared::step(exponent)).round() >= 512.0 {
            exponent += 1;
        }
        let [r, g, b] = rgb.map(|v| (v / Shared::step(exponent)).round() as u32);
        Shared(r | g << 9 | b << 18 | (exponent as u32) << 27)
    }

    /// What one of the mantissa is worth.
    fn step(exponent: i32) -> f32 {
        2f32.powi(exponent - 24)
    }

    /// Back.
    pub fn to_rgb(self) -> [f32; 3] {
        let step = Shared::step((self.0 >> 27) as i32);
        [0, 9, 18].map(|shift| (self.0 >> shift & 511) as f32 * step)
    }

    /// See [`Packed::error`].
    fn error(rgb: [f32; 3]) -> f32 {
        let largest = rgb[0].max(rgb[1]).max(rgb[2]);
        // What is darker than the smallest exponent's range is as good as black.
        if largest < 2f32.powi(-16) {
            return 0.0;
        }
        let back = Shared::of(rgb).to_rgb();
        let apart = rgb.iter().zip(back).map(|(a, b)| (a - b).abs());
        apart.fold(0.0, f32::max) / largest
    }
}
