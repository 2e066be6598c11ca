//! What the first samples of a pixel show.

use crate::color::Rgb;
use crate::render::fixed::VALUE_LIMIT;

/// What kind of pixel; neighbours of other kinds say little of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kind {
    /// Not sampled: bare sky that was integrated.
    #[default]
    Bare,
    /// As most.
    Plain,
    /// An outline runs through.
    Outline,
}

/// What the first samples of a pixel showed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Note {
    /// Mean luminance.
    pub(super) mean: f32,
    /// Variance of a sample, such that the mean of n has one n-th of it.
    pub(super) variance: f32,
    /// Part that met a surface.
    pub(super) alpha: f32,
    pub(super) kind: Kind,
}

impl Note {
    /// Of a pixel that needs no samples.
    pub fn bare(radiance: Rgb) -> Self {
        Note { mean: radiance.luminance(), ..Note::default() }
    }

    /// Of consecutive samples, a power of two of them from the first on. Points are stratified, so that the spread of single
    /// samples says too much: it is that of the means of groups, each of about the root of their number.
    pub fn of(li: &[Rgb], alpha: &[f32], kind: Kind) -> Self {
        let n = li.len().max(1);
        let group = 1usize << (n.ilog2() / 2);
        // As the film takes them: what is no number is left out, what is too large is cut.
        let luminance = |c: &Rgb| f64::from(c.luminance().min(VALUE_LIMIT));
        let mean_of = |g: &[Rgb]| {
            let (sum, n) =
                g.iter().filter(|c| c.is_finite()).fold((0.0, 0.0), |(s, n), c| (s + luminance(c), n + 1.0));
            (n > 0.0).then(|| sum / n)
        };
        let means = li.chunks(group).filter_map(mean_of);
        let (mut sum, mut squares, mut groups) = (0.0, 0.0, 0.0);
        for m in means {
            (sum, squares, groups) = (sum + m, squares + m * m, groups + 1.0);
        }
        let mean = sum / f64::max(groups, 1.0);
        let spread = (squares - sum * mean).max(0.0) / f64::max(groups - 1.0, 1.0);
        Note {
            mean: mean as f32,
            variance: (spread * group as f64) as f32,
            alpha: alpha.iter().sum::<f32>() / n as f32,
            kind,
        }
    }
}
