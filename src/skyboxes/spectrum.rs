//! Sixteen wavelengths from 400 to 700 nm: enough for the colours of the sky, from deep blue to the red of a low sun,
//! that three coefficients get wrong.

use crate::color::Rgb;
use std::sync::LazyLock;

/// Number of wavelengths, 20 nm apart.
pub(super) const LANES: usize = 16;
/// A value by wavelength.
pub(super) type Spectrum = [f32; LANES];

fn wavelength(lane: usize) -> f64 {
    400.0 + 20.0 * lane as f64
}

/// The sun above the atmosphere, W m^-2 nm^-1 (ASTM G173-03, extraterrestrial).
const SUN: [f64; LANES] = [
    1.728, 1.689, 1.912, 2.020, 1.934, 1.917, 1.869, 1.851, 1.834, 1.815, 1.753, 1.682, 1.605, 1.556, 1.474,
    1.410,
];

/// Absorption cross-section of ozone at 233 K, 1e-25 m^2 (Gorshelev et al. and Serdyuchenko et al., Atmospheric
/// Measurement Techniques 7, 2014).
const OZONE: [f64; LANES] =
    [0.0153, 0.0552, 0.158, 0.367, 0.775, 1.48, 2.14, 3.09, 4.27, 4.40, 5.02, 3.74, 2.66, 1.85, 1.21, 0.746];
/// Molecules of ozone above a square metre: 300 Dobson units.
const OZONE_COLUMN: f64 = 8.06e22;

fn by_lane(f: impl Fn(usize) -> f64) -> Spectrum {
    std::array::from_fn(|i| f(i) as f32)
}

/// Optical depth of molecules at a wavelength in nanometres, vertically through the whole atmosphere (Hansen and
/// Travis, "Light Scattering in Planetary Atmospheres", 1974, equation 2.30).
fn molecules(nm: f64) -> f64 {
    let l2 = (1000.0 / nm).powi(2);
    0.008569 * l2 * l2 * (1.0 + 0.0113 * l2 + 0.00013 * l2 * l2)
}

/// Vertical optical depth of molecules.
pub(super) fn rayleigh_depth() -> Spectrum {
    by_lane(|i| molecules(wavelength(i)))
}

/// Vertical optical depth of haze: by the definition of turbidity at 550 nm, and with Angstrom's exponent of 1.3
/// elsewhere.
pub(super) fn haze_depth(turbidity: f64) -> Spectrum {
    by_lane(|i| (turbidity - 1.0) * molecules(550.0) * (wavelength(i) / 550.0).powf(-1.3))
}

/// Vertical optical depth of ozone.
pub(super) fn ozone_depth() -> Spectrum {
    by_lane(|i| OZONE[i] * 1e-25 * OZONE_COLUMN)
}

/// A reflectance of these colours: constant over the thirds of the spectrum, with ramps between.
pub(super) fn reflectance(c: Rgb) -> Spectrum {
    by_lane(|i| {
        let nm = wavelength(i);
        let ramp = |from: f64, to: f64| ((nm - from) / (to - from)).clamp(0.0, 1.0);
        let (green, red) = (ramp(470.0, 520.0), ramp(570.0, 620.0));
        f64::from(c.b) * (1.0 - green) + f64::from(c.g) * (green - red) + f64::from(c.r) * red
    })
}

/// Linear Rec. 709 of sunlight that reaches the eye with this transmittance or reflectance at each wavelength, in
/// units in which sunlight above the atmosphere has luminance 1. Saturated colours have negative channels.
pub(super) fn sunlit_rgb(s: &Spectrum) -> [f32; 3] {
    let mut rgb = [0.0; 3];
    for (value, weights) in s.iter().zip(&*WEIGHTS) {
        for (c, w) in rgb.iter_mut().zip(weights) {
            *c += value * w;
        }
    }
    rgb
}

/// Chromaticity of daylight of a correlated colour temperature of 4000 to 25000 K (CIE 15:2004, 3.1), as linear Rec. 709
/// of luminance 1.
fn daylight_rgb(kelvin: f64) -> [f64; 3] {
    let t = 1000.0 / kelvin;
    let [a, b, c, d] = if kelvin <= 7000.0 {
        [-4.6070, 2.9678, 0.09911, 0.244063]
    } else {
        [-2.0064, 1.9018, 0.24748, 0.237040]
    };
    let x = ((a * t + b) * t + c) * t + d;
    let y = (-3.0 * x + 2.870) * x - 0.275;
    let xyz = [x / y, 1.0, (1.0 - x - y) / y];
    XYZ_TO_RGB.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])
}

/// What each channel is multiplied by so that daylight of this temperature is white, as a camera set to it shows it. One
/// for 6504 K, the white of Rec. 709; luminances of that white are kept.
pub(super) fn white_balance(kelvin: f64) -> Rgb {
    let (white, wanted) = (daylight_rgb(6504.0), daylight_rgb(kelvin));
    Rgb::from(std::array::from_fn(|i| (white[i] / wanted[i]) as f32))
}

/// XYZ to linear Rec. 709 with white D65 (ITU-R BT.709-6; IEC 61966-2-1).
const XYZ_TO_RGB: [[f64; 3]; 3] =
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

static WEIGHTS: LazyLock<[[f32; 3]; LANES]> = LazyLock::new(|| {
    let xyz: [[f64; 3]; LANES] = std::array::from_fn(|i| observer(wavelength(i)).map(|c| c * SUN[i]));
    let y: f64 = xyz.iter().map(|c| c[1]).sum();
    xyz.map(|c| XYZ_TO_RGB.map(|row| ((row[0] * c[0] + row[1] * c[1] + row[2] * c[2]) / y) as f32))
});

/// The CIE 1931 observer, by the sums of lobes of Wyman, Sloan and Shirley, "Simple Analytic Approximations to the CIE
/// XYZ Color Matching Functions", JCGT 2(2), 2013.
fn observer(nm: f64) -> [f64; 3] {
    let lobe = |mean: f64, below: f64, above: f64| {
        let t = (nm - mean) / if nm < mean { below } else { above };
        (-0.5 * t * t).exp()
    };
    [
        1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
        0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
        1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
    ]
}

/// e^-x for x >= 0, relative error 4e-6 + 1e-7 x, about zero above 87: short enough to run on all wavelengths at once.
#[inline(always)]
pub(super) fn exp_minus(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23: adding it rounds to a whole number in the low bits.
    let t = (x * -std::f32::consts::LOG2_E).max(-126.0);
    let k = t + ROUND;
    let f = t - (k - ROUND);
    // Taylor's series of 2^f, |f| <= 1/2, to the fifth order.
    let p = 0.240_226_5 + f * (0.055_504_11 + f * (0.009_618_129 + f * 0.001_333_356));
    let p = 1.0 + f * (std::f32::consts::LN_2 + f * p);
    f32::from_bits(k.to_bits().wrapping_add(127) << 23) * p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sunlight_is_a_slightly_warm_white_of_unit_luminance() {
        let rgb = Rgb::from(sunlit_rgb(&[1.0; LANES]));
        assert!((rgb.luminance() - 1.0).abs() < 1e-3);
        // The sun above the atmosphere is at (0.322, 0.331): near D65, on its yellow side.
        assert!(rgb.r > rgb.g && rgb.g > rgb.b && rgb.r < 1.15 && rgb.b > 0.85, "{rgb:?}");
    }

    #[test]
    fn known_optical_depths() {
        // Hansen and Travis's formula at 550 nm; Chappuis band of 300 DU, about 0.04 at 600 nm.
        assert!((molecules(550.0) - 0.0973).abs() < 1e-4);
        assert!((ozone_depth()[10] - 0.0405).abs() < 1e-3);
        let haze = haze_depth(2.0);
        assert!(haze[0] > haze[15] && (f64::from(haze[7] + haze[8]) / 2.0 - 0.0973).abs() < 1e-3);
    }

    #[test]
    fn daylight_is_balanced_to_white() {
        // D65 is the white of the primaries: a thousandth, the digits of the matrix and of the locus.
        assert!(daylight_rgb(6504.0).iter().all(|c| (c - 1.0).abs() < 2e-3));
        assert_eq!(white_balance(6504.0), Rgb::splat(1.0));
        // A camera set to warmer light takes red from all it sees and gives blue.
        let warm = white_balance(5000.0);
        assert!(warm.r < 0.9 && warm.b > 1.15 && (warm.g - 1.0).abs() < 0.05, "{warm:?}");
        // Both branches of the locus meet: to four digits, as they are given.
        for (a, b) in daylight_rgb(7000.0).iter().zip(daylight_rgb(7000.1)) {
            assert!((a - b).abs() < 2e-3);
        }
    }

    #[test]
    fn exponential_is_accurate() {
        for i in 0..4000 {
            let x = i as f32 * 0.02;
            let want = f64::from(-x).exp();
            let error = (f64::from(exp_minus(x)) - want).abs() / want;
            assert!(error < 4e-6 + 1e-7 * f64::from(x), "{x}: {error}");
        }
        assert!(exp_minus(1e9) < 1.2e-38);
    }

    #[test]
    fn grey_reflects_alike_everywhere() {
        assert!(reflectance(Rgb::splat(0.3)).iter().all(|v| (v - 0.3).abs() < 1e-6));
    }
}
