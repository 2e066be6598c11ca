//! Formats that hold what a display shows: PNG, JPEG, and TIFF of whole numbers.

use super::{WriteOptions, colour_planes};
use crate::color::{Rgb, Transfer};
use crate::image::picture::Picture;
use crate::image::srgb8;
use crate::image::tonemap::Look;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use tiff::encoder::{TiffEncoder, TiffValue, colortype};
use tiff::tags::ExtraSamples;

/// JPEG quality: no visible loss, about a sixth of the PNG.
const JPEG_QUALITY: u8 = 92;

/// Whole numbers of a display's picture.
trait Sample: Copy + Send + Sync + Default {
    /// The largest.
    const MOST: f32;

    /// From a value of 0 to 1; NaN counts as 0.
    fn rounded(v: f32) -> Self;

    /// The nearest to the sRGB encoding of a linear value.
    fn srgb(v: f32) -> Self;
}

impl Sample for u8 {
    const MOST: f32 = 255.0;

    fn rounded(v: f32) -> Self {
        // A cast from NaN gives 0.
        (v * Self::MOST).round() as u8
    }

    fn srgb(v: f32) -> Self {
        srgb8::encode(v)
    }
}

impl Sample for u16 {
    const MOST: f32 = 65535.0;

    fn rounded(v: f32) -> Self {
        (v * Self::MOST).round() as u16
    }

    /// In double precision: the curve's rounding in single precision is a few thousandths of a step.
    fn srgb(v: f32) -> Self {
        let v = f64::from(v).clamp(0.0, 1.0);
        let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (encoded * 65535.0).round() as u16
    }
}

/// The number nearest to the encoding of a linear value; NaN counts as 0.
fn encoder<S: Sample>(transfer: Transfer) -> impl Fn(f32) -> S {
    move |v| match transfer {
        Transfer::Srgb => S::srgb(v),
        Transfer::Gamma(gamma) => S::rounded(v.clamp(0.0, 1.0).powf(1.0 / gamma)),
    }
}

/// What a picture of 8 bits shows of a radiance.
pub fn display_bytes(look: &Look, radiance: Rgb) -> [u8; 3] {
    look.apply(radiance).to_array().map(encoder(look.transfer))
}

/// Rows of samples, `channels` (3 or 4) a pixel, and how many pixels had a value that is not a number.
fn samples<S: Sample>(picture: &Picture, look: &Look, channels: usize) -> io::Result<(Vec<S>, u64)> {
    let [r, g, b] = colour_planes(picture)?;
    let alpha = picture.plane("A").map(|p| &p.data).filter(|_| channels == 4);
    let scale = look.exposure.exp2();
    let encode = encoder(look.transfer);
    let mut samples = vec![S::default(); picture.width * picture.height * channels];
    let lost = AtomicU64::new(0);
    samples.par_chunks_mut(picture.width * channels).enumerate().for_each(|(y, row)| {
        let mut nan = 0;
        for (x, out) in row.chunks_exact_mut(channels).enumerate() {
            let at = y * picture.width + x;
            let a = alpha.map_or(1.0, |alpha| alpha[at].clamp(0.0, 1.0));
            // The format wants colour not multiplied by alpha.
            let factor = if a > 0.0 { scale / a } else { 0.0 };
            nan += u64::from((r[at] + g[at] + b[at]).is_nan());
            let shown = look.tonemap.apply(Rgb::new(r[at], g[at], b[at]) * factor);
            out[..3].copy_from_slice(&shown.to_array().map(&encode));
            if let Some(last) = out.get_mut(3) {
                *last = S::rounded(a);
            }
        }
        lost.fetch_add(nan, Ordering::Relaxed);
    });
    Ok((samples, lost.into_inner()))
}

fn channels(picture: &Picture, options: &WriteOptions) -> usize {
    if options.alpha && picture.plane("A").is_some() { 4 } else { 3 }
}

/// Writes a PNG of 8 or 16 bits; how many pixels were no numbers.
pub(super) fn write_png(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<u64> {
    let channels = channels(picture, options);
    let (bytes, lost) = match options.bits {
        Some(16) => {
            let (words, lost) = samples::<u16>(picture, &options.look, channels)?;
            (words.iter().flat_map(|v| v.to_be_bytes()).collect(), lost)
        }
        _ => samples::<u8>(picture, &options.look, channels)?,
    };
    let mut file = BufWriter::with_capacity(1 << 18, out);
    let mut encoder = png::Encoder::new(&mut file, picture.width as u32, picture.height as u32);
    encoder.set_color(if channels == 4 { png::ColorType::Rgba } else { png::ColorType::Rgb });
    let deep = options.bits == Some(16);
    encoder.set_depth(if deep { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
    encoder.set_compression(png::Compression::Fast);
    // Whoever asks for another curve wants the bytes that a program wrote which said nothing of its curve.
    if options.look.transfer == Transfer::Srgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    }
    for (key, value) in &picture.metadata {
        // International text takes any value; only the keyword is restricted, to 79 Latin letters.
        let keyword: String = key.chars().filter(|c| c.is_ascii_graphic() || *c == ' ').take(79).collect();
        encoder.add_itxt_chunk(keyword, value.clone()).map_err(io::Error::other)?;
    }
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(&bytes).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    file.flush()?;
    Ok(lost)
}

/// Writes a JPEG; how many pixels were no numbers.
pub(super) fn write_jpeg(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<u64> {
    let (bytes, lost) = samples::<u8>(picture, &options.look, 3)?;
    let (Ok(width), Ok(height)) = (u16::try_from(picture.width), u16::try_from(picture.height)) else {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "JPEG holds at most 65535 pixels a side"));
    };
    let mut file = BufWriter::with_capacity(1 << 18, out);
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY);
    encoder
        .encode(&bytes, width.into(), height.into(), image::ExtendedColorType::Rgb8)
        .map_err(io::Error::other)?;
    file.flush()?;
    Ok(lost)
}

/// Writes a TIFF of 8 or 16 bits; how many pixels were no numbers.
pub(super) fn write_tiff(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<u64> {
    let channels = channels(picture, options);
    let alpha = (channels == 4).then_some(ExtraSamples::UnassociatedAlpha);
    if options.bits == Some(16) {
        let (words, lost) = samples::<u16>(picture, &options.look, channels)?;
        put_tiff::<colortype::RGB16>(out, picture, alpha, &words).map(|()| lost)
    } else {
        let (bytes, lost) = samples::<u8>(picture, &options.look, channels)?;
        put_tiff::<colortype::RGB8>(out, picture, alpha, &bytes).map(|()| lost)
    }
}

/// A deflated TIFF of samples, with one more a pixel where `alpha` says what it is.
pub(super) fn put_tiff<C: colortype::ColorType>(
    out: &mut File,
    picture: &Picture,
    alpha: Option<ExtraSamples>,
    samples: &[C::Inner],
) -> io::Result<()>
where
    [C::Inner]: TiffValue,
{
    let mut file = BufWriter::with_capacity(1 << 18, out);
    let deflate = tiff::encoder::Compression::Deflate(tiff::encoder::DeflateLevel::Fast);
    let encoder = TiffEncoder::new(&mut file).map_err(io::Error::other)?;
    let mut encoder = encoder.with_compression(deflate);
    let put = |e| io::Error::other(format!("{e}"));
    let mut image = encoder.new_image::<C>(picture.width as u32, picture.height as u32).map_err(put)?;
    if let Some(alpha) = alpha {
        image.extra_samples(&[alpha]).map_err(put)?;
    }
    image.write_data(samples).map_err(put)?;
    file.flush()
}
