//! Takes the noise out of a picture that was rendered in two independent halves. Nothing in it was learned, and
//! nothing is random.
//!
//! Around each pixel, colour is fitted as a linear function of features (albedo, normal, depth, ...) that have
//! little noise, and the fits are averaged: B. Bitterli, F. Rousselle, B. Moon et al., *Nonlinearly Weighted
//! First-order Regression for Denoising Monte Carlo Renderings*, EGSR 2016. Neighbours count by how alike they
//! look, given their noise: F. Rousselle, C. Knaus, M. Zwicker, *Adaptive Rendering with Non-Local Means
//! Filtering*, SIGGRAPH Asia 2012. Features are filtered first: F. Rousselle, M. Manzi, M. Zwicker, *Robust
//! Denoising using Feature and Color Information*, Pacific Graphics 2013. What differs from the papers is said
//! where it does.
//!
//! 1. `prepare`: which pixels are sound, the brightness and the noise around them.
//! 2. `features`: features on one scale, without noise.
//! 3. `weights`, `regress`: each half is fitted under weights from the other, for two bandwidths.
//! 4. `select`: either half is held against the other's result. That says how wrong a result is, and so which to
//!    take: a narrow fit, a wide one, or the input as it is.
//!
//! A result is smooth and near the truth, but not unbiased: [`Denoised::error`] and [`Denoised::bias`] say how far
//! off.

mod features;
mod plane;
mod prepare;
mod regress;
mod select;
#[cfg(test)]
mod tests;
mod weights;

/// Most channels of features: a fit of more would need more neighbours than a window has to offer.
pub const MAX_FEATURES: usize = 15;

/// Rec. 709 luminance weights (ITU-R BT.709-6, item 3.2).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// A picture as two independent halves. All planes have `width * height` values, row-major, the top row first.
#[derive(Debug, Clone)]
pub struct Halves<'a> {
    /// In pixels.
    pub width: usize,
    /// In pixels.
    pub height: usize,
    /// Mean linear radiance over the samples of each half, which should be about as many. What is not finite (a half
    /// without samples, say) is filled in from neighbours.
    pub color: [&'a [[f32; 3]]; 2],
    /// Channels that colour may depend on, at most [`MAX_FEATURES`], each as the means of both halves, or one plane
    /// given twice, which then counts as free of noise. Any unit will do. Values may be NaN or infinite where
    /// nothing was hit. Colour is fitted by linear functions of them: of depth the logarithm or the reciprocal
    /// serves better.
    pub features: Vec<[&'a [f32]; 2]>,
}

/// Why a picture cannot be denoised.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DenoiseError {
    /// A plane has another number of values than the picture has pixels.
    Size {
        /// `color` or `feature 3`, counted from 0.
        plane: String,
        /// Width times height.
        expected: usize,
        /// Values there are.
        found: usize,
    },
    /// There are more than [`MAX_FEATURES`].
    TooManyFeatures(usize),
}

impl std::fmt::Display for DenoiseError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            DenoiseError::Size { plane, expected, found } => {
                write!(f, "{plane}: a plane of {found} values, for a picture of {expected} pixels")
            }
            DenoiseError::TooManyFeatures(n) => {
                write!(f, "{n} channels of features; at most {MAX_FEATURES} are used")
            }
        }
    }
}

impl std::error::Error for DenoiseError {}

/// A denoised picture. Planes as in [`Halves`]; all values are finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Denoised {
    /// Linear radiance. Black where neither half nor any neighbour knows better.
    pub color: Vec<[f32; 3]>,
    /// Estimated squared error of `color`, by channel: bias squared and variance, in radiance squared, pooled over
    /// 17 x 17 pixels. Good for means over a picture (in tests 1.2 to 2.1 times too large); a single pixel's may be
    /// far off.
    pub error: Vec<[f32; 3]>,
    /// Pixels more than ten times brighter in one half than anything nearby in the other. They stay as they are, and so
    /// does the sum of light; in the filtering of others they take no part.
    pub outliers: usize,
    /// Pixels of which a half was not finite and that neighbours have filled in.
    pub filled: usize,
}

/// What denoising has done to the picture as a whole, over pixels with a finite half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bias {
    /// Mean luminance after over that before; 1 for a black picture.
    pub ratio: f64,
    /// Mean luminance after less that before: the mean signed difference.
    pub difference: f64,
}

impl Denoised {
    /// Compares with the picture this was made from.
    pub fn bias(&self, input: &Halves) -> Bias {
        let luminance =
            |c: [f32; 3]| c.iter().zip(LUMINANCE).map(|(&v, w)| f64::from(v) * f64::from(w)).sum::<f64>();
        let (mut before, mut after, mut n) = (0.0, 0.0, 0usize);
        for (i, &color) in self.color.iter().enumerate() {
            if let Some(plain) = input.plain(i) {
                before += luminance(plain);
                after += luminance(color);
                n += 1;
            }
        }
        let ratio = if before == 0.0 { 1.0 } else { after / before };
        Bias { ratio, difference: (after - before) / n.max(1) as f64 }
    }
}

impl Halves<'_> {
    /// The mean of the halves, or the one that is finite, or `None`.
    fn plain(&self, pixel: usize) -> Option<[f32; 3]> {
        let [a, b] = self.color.map(|half| half[pixel]);
        let finite = |c: [f32; 3]| c.iter().all(|v| v.is_finite());
        match (finite(a), finite(b)) {
            // Halved first: a sum of two may leave f32.
            (true, true) => Some(std::array::from_fn(|c| 0.5 * a[c] + 0.5 * b[c])),
            (true, false) => Some(a),
            (false, true) => Some(b),
            (false, false) => None,
        }
    }

    fn check(&self) -> Result<(), DenoiseError> {
        let expected = self.width * self.height;
        let size = |plane: String, found: usize| match found == expected {
            true => Ok(()),
            false => Err(DenoiseError::Size { plane, expected, found }),
        };
        for half in self.color {
            size("color".to_owned(), half.len())?;
        }
        for (i, halves) in self.features.iter().enumerate() {
            for half in halves {
                size(format!("feature {i}"), half.len())?;
            }
        }
        match self.features.len() {
            n if n > MAX_FEATURES => Err(DenoiseError::TooManyFeatures(n)),
            _ => Ok(()),
        }
    }
}

/// Denoises. The result has the same bits whatever the number of threads.
///
/// Scales with the input: twice the radiance gives twice the result. Without features, colour is fitted as a linear
/// function of the place in the picture. It takes about 35 microseconds a pixel on one core with seven features, 50
/// if these have noise; 220 bytes a pixel, 8 more for each feature, and 40 MB.
///
/// # Errors
/// If a plane is not of the picture's size, or there are too many features.
pub fn denoise(input: &Halves) -> Result<Denoised, DenoiseError> {
    input.check()?;
    if input.width == 0 || input.height == 0 {
        return Ok(Denoised { color: Vec::new(), error: Vec::new(), outliers: 0, filled: 0 });
    }
    let prepared = prepare::Prepared::new(input);
    let features = features::prepare(input);
    let predictions = regress::predictions(&prepared, &prepared.guide(), &features);
    Ok(select::select(input, &prepared, &predictions))
}
