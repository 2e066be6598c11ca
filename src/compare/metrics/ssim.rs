//! Structural similarity.

use super::{Better, Input, Metric, Outcome, Skipped};
use crate::compare::pair::{Planes, Side};
use crate::compare::ssim::{Options, ssim};
use std::borrow::Cow;

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "ssim",
    title: "SSIM",
    doc: "Structural similarity (Wang et al. 2004) under a Gaussian of sigma 1.5: means, contrast and structure of small windows; 1 is \
          equal. Of colours it is that of what a display shows, the mean of red, green and blue. Noise lowers it most where the \
          picture is smooth.",
    better: Better::Higher,
    unit: "",
    eval: |input| {
        let seen = Seen::new(input);
        let options = Options::new(seen.range);
        let [w, h] = input.pair.size;
        let mut out = Outcome { note: seen.note, ..Outcome::default() };
        let mut map = vec![0.0; if input.maps { w * h } else { 0 }];
        let count = seen.planes[0].len() as f32;
        for (a, b) in seen.planes[0].iter().zip(seen.planes[1].iter()) {
            let small = || Skipped(format!("{w}x{h} pixels are less than its window of 11"));
            let found = ssim([w, h], a, b, &options, input.maps).ok_or_else(small)?;
            out.channels.push(found.mean);
            // An error: more is worse.
            map.iter_mut().zip(&found.map).for_each(|(m, v)| *m += (1.0 - v) / count);
        }
        out.value = out.channels.iter().sum::<f64>() / f64::from(count);
        out.map = input.maps.then_some(map);
        Ok(out)
    },
};

/// The planes that similarity is taken of: what is seen, or the values themselves.
pub(super) struct Seen<'a> {
    /// Reference and test.
    pub planes: [Cow<'a, Planes>; 2],
    /// The largest possible value less the smallest.
    pub range: f64,
    /// Words for it.
    pub note: String,
}

impl<'a> Seen<'a> {
    pub fn new(input: &Input<'a>) -> Self {
        let pair = input.pair;
        let sides = [Side::Reference, Side::Test];
        if pair.is_color && !input.options.keep_space {
            let range = input.options.peak.unwrap_or(1.0);
            let planes = sides.map(|s| Cow::Borrowed(pair.display_planes(s)));
            return Seen { planes, range, note: format!("on encoded values, range {range}") };
        }
        let (range, note) = input.peak();
        Seen { planes: sides.map(|s| Cow::Borrowed(pair.planes(s))), range, note }
    }
}
