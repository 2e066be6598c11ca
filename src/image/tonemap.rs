//! From radiance to what a display shows: exposure, then a tone operator.

use crate::color::{Rgb, Transfer, srgb_to_linear};
use crate::error::{Error, unknown_name};
use std::fmt;
use std::str::FromStr;

/// How radiance is brought into the range of a display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToneMap {
    /// Cut off at 1.
    #[default]
    None,
    /// Reinhard, Stark, Shirley, Ferwerda, "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002, eq. 4,
    /// on luminance, with [`REINHARD_WHITE`] as the least luminance that becomes white.
    Reinhard,
    /// Stephen Hill's fit of the ACES reference rendering and sRGB output transforms, with its 3x3 matrices (2015).
    /// It holds no exposure change of its own: 0.18 comes out as 0.11, as in ACES.
    AcesFit,
    /// Troy Sobotka's AgX (2019), with the sixth-order polynomial for its contrast curve by Benjamin Wrensch,
    /// "Minimal AgX Implementation" (2023): ten stops below 0.18 to 6.5 above, highlights fading to white.
    Agx,
}

/// The luminance that [`ToneMap::Reinhard`] makes white: three stops above 1.
pub const REINHARD_WHITE: f32 = 8.0;

impl ToneMap {
    /// All operators, in the order of listings.
    pub const ALL: [ToneMap; 4] = [ToneMap::None, ToneMap::Reinhard, ToneMap::AcesFit, ToneMap::Agx];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            ToneMap::None => "none",
            ToneMap::Reinhard => "reinhard",
            ToneMap::AcesFit => "aces-fit",
            ToneMap::Agx => "agx",
        }
    }

    /// One line for people.
    pub const fn doc(self) -> &'static str {
        match self {
            ToneMap::None => "cut off at 1",
            ToneMap::Reinhard => "Reinhard et al. 2002 on luminance; 8 becomes white",
            ToneMap::AcesFit => "Stephen Hill's fit of the ACES output transform",
            ToneMap::Agx => "Troy Sobotka's AgX: highlights fade to white",
        }
    }

    /// Radiance (negative values count as 0) to display-linear values in [0, 1], which the sRGB curve then encodes.
    pub fn apply(self, radiance: Rgb) -> Rgb {
        let c = radiance.map(|v| v.max(0.0));
        match self {
            ToneMap::None => c,
            ToneMap::Reinhard => reinhard(c),
            ToneMap::AcesFit => aces_fit(c),
            ToneMap::Agx => agx(c),
        }
        .map(|v| v.clamp(0.0, 1.0))
    }
}

impl fmt::Display for ToneMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for ToneMap {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        let found = ToneMap::ALL.into_iter().find(|t| t.name() == name);
        found.ok_or_else(|| Error::Usage(unknown_name("tone map", name, ToneMap::ALL.map(ToneMap::name))))
    }
}

/// How a picture is shown where the file cannot hold radiance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Look {
    /// In stops: radiance is multiplied by 2^exposure first.
    pub exposure: f32,
    /// Applied after the exposure.
    pub tonemap: ToneMap,
    /// From there to bytes.
    pub transfer: Transfer,
}

impl Look {
    /// Radiance to display-linear values in [0, 1].
    pub fn apply(&self, radiance: Rgb) -> Rgb {
        self.tonemap.apply(radiance * self.exposure.exp2())
    }
}

fn reinhard(c: Rgb) -> Rgb {
    let l = c.luminance();
    // (1 + L / white^2) / (1 + L) is the ratio of displayed to given luminance.
    c * ((1.0 + l / (REINHARD_WHITE * REINHARD_WHITE)) / (1.0 + l))
}

type Matrix = [[f32; 3]; 3];

fn transform(m: &Matrix, c: Rgb) -> Rgb {
    let row = |r: &[f32; 3]| r[0] * c.r + r[1] * c.g + r[2] * c.b;
    Rgb::new(row(&m[0]), row(&m[1]), row(&m[2]))
}

fn aces_fit(c: Rgb) -> Rgb {
    // sRGB to AP1 with the RRT's desaturation; and the way back with the ODT's.
    const INPUT: Matrix =
        [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
    const OUTPUT: Matrix =
        [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];
    // Beyond 10^6 the curve is flat to f32 precision, and its squares would overflow.
    let curve = |v: f32| {
        let v = v.min(1e6);
        ((v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081)).max(0.0)
    };
    transform(&OUTPUT, transform(&INPUT, c).map(curve))
}

fn agx(c: Rgb) -> Rgb {
    const INSET: Matrix = [
        [0.842_479_05, 0.078_433_6, 0.079_223_745],
        [0.042_328_242, 0.878_468_64, 0.079_166_13],
        [0.042_375_655, 0.078_433_6, 0.879_143],
    ];
    const OUTSET: Matrix = [
        [1.196_879, -0.098_020_88, -0.099_029_74],
        [-0.052_896_85, 1.151_903_1, -0.098_961_18],
        [-0.052_971_635, -0.098_043_45, 1.151_073_7],
    ];
    // log2(0.18) - 10 and log2(0.18) + 6.5.
    const FROM: f32 = -12.47393;
    const TO: f32 = 4.026069;
    let curve = |v: f32| {
        let x = ((v.max(f32::MIN_POSITIVE).log2() - FROM) / (TO - FROM)).clamp(0.0, 1.0);
        let p = ((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191;
        // The fit starts a little below 0; cut there, so that black is black.
        (p * x - 0.00232).max(0.0)
    };
    // The curve gives what the display is sent; undoing the sRGB curve here lets the writer's encoding restore it.
    transform(&OUTSET, transform(&INSET, c).map(curve)).map(|v| srgb_to_linear(v.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::linear_to_srgb;
    use crate::testing::TestRng;

    #[test]
    fn black_is_black_and_white_is_white() {
        // The least gray that is as good as white: the cut, the stated white, where the fit reaches 1 (it grows to
        // 1 / 0.983729 for bright light), and the top of AgX' range, where the polynomial is 0.9986.
        let cases = [
            (ToneMap::None, 1.0, 1.0),
            (ToneMap::Reinhard, REINHARD_WHITE, 1.0),
            (ToneMap::AcesFit, 30.0, 1.0),
        ];
        for (operator, white, value) in cases {
            assert_eq!(operator.apply(Rgb::BLACK), Rgb::BLACK, "{operator}");
            // Luminance weights and matrix rows sum to 1 within 1e-4.
            let got = operator.apply(Rgb::splat(white));
            assert!((got.r - value).abs() < 2e-3 && (got.b - value).abs() < 2e-3, "{operator}: {got:?}");
        }
        assert_eq!(ToneMap::Agx.apply(Rgb::BLACK), Rgb::BLACK);
        let top = linear_to_srgb(ToneMap::Agx.apply(Rgb::splat(0.18 * 6.5f32.exp2())).g);
        // 15.5 - 40.14 + 31.96 - 6.868 + 0.4298 + 0.1191 - 0.00232 = 0.99858.
        assert!((top - 0.99858).abs() < 1e-3, "{top}");
    }

    #[test]
    fn gray_stays_gray_and_grows() {
        for operator in ToneMap::ALL {
            let mut last = 0.0;
            for step in 0..4000 {
                let out = operator.apply(Rgb::splat((step as f32 / 100.0 - 20.0).exp2()));
                // Rows of the published matrices sum to 1 within 2e-4; AgX' log curve and the sRGB curve treble that.
                assert!((out.r - out.g).abs() < 1e-3 && (out.b - out.g).abs() < 1e-3, "{operator}: {out:?}");
                // Rounding of f32 polynomials whose terms reach 40: 40 * 2^-24, a little more after the matrices.
                assert!(out.g >= last - 2e-5, "{operator} falls at step {step}: {last} to {}", out.g);
                last = out.g;
            }
            assert!(last > 0.98, "{operator} does not reach white: {last}");
        }
    }

    #[test]
    fn any_input_gives_displayable_values() {
        let mut rng = TestRng::new(4);
        let mut value = || (rng.f32() - 0.1) * 2f32.powi((rng.f32() * 200.0) as i32 - 80);
        for _ in 0..20_000 {
            let c = Rgb::new(value(), value(), value());
            for operator in ToneMap::ALL {
                let out = Look { exposure: 1.5, tonemap: operator, ..Look::default() }.apply(c);
                assert!(
                    out.to_array().iter().all(|v| (0.0..=1.0).contains(v)),
                    "{operator}: {c:?} to {out:?}"
                );
            }
        }
    }

    #[test]
    fn middle_gray_of_each_operator() {
        let gray = |operator: ToneMap| operator.apply(Rgb::splat(0.18)).g;
        assert_eq!(gray(ToneMap::None), 0.18);
        // Eq. 4 by hand: 0.18 (1 + 0.18 / 64) / 1.18 = 0.15297.
        assert!((gray(ToneMap::Reinhard) - 0.15297).abs() < 1e-4);
        // The fit by hand: (0.18 * 0.2045786 - 0.0000905) / (0.18 * 0.6100222 + 0.238081) = 0.10556.
        assert!((gray(ToneMap::AcesFit) - 0.10556).abs() < 2e-4);
        // x = 10 / 16.5; the polynomial there is 0.49673, sent to the display as it is.
        assert!(
            (linear_to_srgb(gray(ToneMap::Agx)) - 0.49673).abs() < 1e-3,
            "{}",
            linear_to_srgb(gray(ToneMap::Agx))
        );
    }

    #[test]
    fn exposure_is_in_stops() {
        let look = Look { exposure: -2.0, ..Look::default() };
        assert_eq!(look.apply(Rgb::splat(2.0)), Rgb::splat(0.5));
    }

    #[test]
    fn names_come_back_and_unknown_ones_list_the_known() {
        for operator in ToneMap::ALL {
            assert_eq!(operator.name().parse::<ToneMap>().expect("known"), operator);
        }
        let message = "aces".parse::<ToneMap>().expect_err("unknown").to_string();
        assert!(message.contains("aces-fit") && message.contains("agx"), "{message}");
    }
}
