//! What the two structural similarities share: the planes they are taken of, and the similarity at full resolution.

use super::{Input, Skipped};
use crate::compare::pair::{Planes, Side};
use crate::compare::ssim::{MsSsim, Options, Ssim, ms_ssim, ssim};

/// Similarity of each channel.
pub(super) struct Similarity<'a> {
    /// Reference and test: what is seen, or the values themselves.
    planes: [&'a Planes; 2],
    size: [usize; 2],
    options: Options,
    /// At full resolution; with maps where these are wanted.
    pub finest: Vec<Ssim>,
    /// Words for the planes.
    pub note: String,
}

impl<'a> Similarity<'a> {
    pub fn new(input: &Input<'a>) -> Result<Self, Skipped> {
        let pair = input.pair;
        let sides = [Side::Reference, Side::Test];
        let (planes, range, note) = if pair.is_color && !input.options.keep_space {
            let range = input.options.peak.unwrap_or(1.0);
            (sides.map(|s| pair.display_planes(s)), range, format!("on encoded values, range {range}"))
        } else {
            let (range, note) = input.peak();
            (sides.map(|s| pair.planes(s)), range, note)
        };
        let (size, options) = (pair.size, Options::new(range));
        let [w, h] = size;
        let small = || Skipped(format!("{w}x{h} pixels are less than its window of 11"));
        let channel =
            |(a, b): (&Vec<f32>, &Vec<f32>)| ssim(size, a, b, &options, input.maps).ok_or_else(small);
        let finest = planes[0].iter().zip(planes[1]).map(channel).collect::<Result<_, _>>()?;
        Ok(Similarity { planes, size, options, finest, note })
    }

    /// At several scales, by channel.
    pub fn scales(&self) -> Vec<MsSsim> {
        let channels = self.planes[0].iter().zip(self.planes[1]).zip(&self.finest);
        channels.filter_map(|((a, b), finest)| ms_ssim(self.size, [a, b], &self.options, finest)).collect()
    }
}
