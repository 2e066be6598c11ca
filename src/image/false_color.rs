//! Colours for numbers.
//!
//! Viridis, magma and inferno: tables of 256 sRGB colours by N. Smith and S. van der Walt (released under CC0, 2015), whose
//! lightness grows evenly. Turbo: the polynomial of A. Mikhailov, "Turbo, An Improved Rainbow Colormap for Visualization"
//! (Google AI blog, 2019; Apache-2.0); it tells more apart, but its lightness rises and falls.
//! The polynomial is within 0.13 of the table that it stands for.

use crate::color::srgb_to_linear;
use crate::error::{Error, Result, unknown_name};
use std::fmt;
use std::str::FromStr;

const VIRIDIS: &[u8; 1536] = b"\
    44015444025645045745055946075a46085c460a5d460b5e470d60470e6147106347116447136548146748166848176948186a\
    481a6c481b6d481c6e481d6f481f70482071482173482374482475482576482677482878482979472a7a472c7a472d7b472e7c\
    472f7d46307e46327e46337f463480453581453781453882443983443a83443b84433d84433e85423f85424086424186414287\
    4144874045884046883f47883f48893e49893e4a893e4c8a3d4d8a3d4e8a3c4f8a3c508b3b518b3b528b3a538b3a548c39558c\
    39568c38588c38598c375a8c375b8d365c8d365d8d355e8d355f8d34608d34618d33628d33638d32648e32658e31668e31678e\
    31688e30698e306a8e2f6b8e2f6c8e2e6d8e2e6e8e2e6f8e2d708e2d718e2c718e2c728e2c738e2b748e2b758e2a768e2a778e\
    2a788e29798e297a8e297b8e287c8e287d8e277e8e277f8e27808e26818e26828e26828e25838e25848e25858e24868e24878e\
    23888e23898e238a8d228b8d228c8d228d8d218e8d218f8d21908d21918c20928c20928c20938c1f948c1f958b1f968b1f978b\
    1f988b1f998a1f9a8a1e9b8a1e9c891e9d891f9e891f9f881fa0881fa1881fa1871fa28720a38620a48621a58521a68522a785\
    22a88423a98324aa8325ab8225ac8226ad8127ad8128ae8029af7f2ab07f2cb17e2db27d2eb37c2fb47c31b57b32b67a34b679\
    35b77937b87838b9773aba763bbb753dbc743fbc7340bd7242be7144bf7046c06f48c16e4ac16d4cc26c4ec36b50c46a52c569\
    54c56856c66758c7655ac8645cc8635ec96260ca6063cb5f65cb5e67cc5c69cd5b6ccd5a6ece5870cf5773d05675d05477d153\
    7ad1517cd2507fd34e81d34d84d44b86d54989d5488bd6468ed64590d74393d74195d84098d83e9bd93c9dd93ba0da39a2da37\
    a5db36a8db34aadc32addc30b0dd2fb2dd2db5de2bb8de29bade28bddf26c0df25c2df23c5e021c8e020cae11fcde11dd0e11c\
    d2e21bd5e21ad8e219dae319dde318dfe318e2e418e5e419e7e419eae51aece51befe51cf1e51df4e61ef6e620f8e621fbe723\
    fde725";

const MAGMA: &[u8; 1536] = b"\
    00000401000501010601010802010902020b02020d03030f03031204041405041606051806051a07061c08071e0907200a0822\
    0b09240c09260d0a290e0b2b100b2d110c2f120d31130d34140e36150e38160f3b180f3d19103f1a10421c10441d11471e1149\
    20114b21114e22115024125325125527125829115a2a115c2c115f2d11612f116331116533106734106936106b38106c390f6e\
    3b0f703d0f713f0f72400f74420f75440f764510774710784910784a10794c117a4e117b4f127b51127c52137c54137d56147d\
    57157e59157e5a167e5c167f5d177f5f187f601880621980641a80651a80671b80681c816a1c816b1d816d1d816e1e81701f81\
    721f817320817521817621817822817922827b23827c23827e24828025828125818326818426818627818827818928818b2981\
    8c29818e2a81902a81912b81932b80942c80962c80982d80992d809b2e7f9c2e7f9e2f7fa02f7fa1307ea3307ea5317ea6317d\
    a8327daa337dab337cad347cae347bb0357bb2357bb3367ab5367ab73779b83779ba3878bc3978bd3977bf3a77c03a76c23b75\
    c43c75c53c74c73d73c83e73ca3e72cc3f71cd4071cf4070d0416fd2426fd3436ed5446dd6456cd8456cd9466bdb476adc4869\
    de4968df4a68e04c67e24d66e34e65e44f64e55064e75263e85362e95462ea5661eb5760ec5860ed5a5fee5b5eef5d5ef05f5e\
    f1605df2625df2645cf3655cf4675cf4695cf56b5cf66c5cf66e5cf7705cf7725cf8745cf8765cf9785df9795df97b5dfa7d5e\
    fa7f5efa815ffb835ffb8560fb8761fc8961fc8a62fc8c63fc8e64fc9065fd9266fd9467fd9668fd9869fd9a6afd9b6bfe9d6c\
    fe9f6dfea16efea36ffea571fea772fea973feaa74feac76feae77feb078feb27afeb47bfeb67cfeb77efeb97ffebb81febd82\
    febf84fec185fec287fec488fec68afec88cfeca8dfecc8ffecd90fecf92fed194fed395fed597fed799fed89afdda9cfddc9e\
    fddea0fde0a1fde2a3fde3a5fde5a7fde7a9fde9aafdebacfcecaefceeb0fcf0b2fcf2b4fcf4b6fcf6b8fcf7b9fcf9bbfcfbbd\
    fcfdbf";

const INFERNO: &[u8; 1536] = b"\
    00000401000501010601010802010a02020c02020e03021004031204031405041706041907051b08051d09061f0a07220b0724\
    0c08260d08290e092b10092d110a30120a32140b34150b37160b39180c3c190c3e1b0c411c0c431e0c451f0c48210c4a230c4c\
    240c4f260c51280b53290b552b0b572d0b592f0a5b310a5c320a5e340a5f3609613809623909633b09643d09653e0966400a67\
    420a68440a68450a69470b6a490b6a4a0c6b4c0c6b4d0d6c4f0d6c510e6c520e6d540f6d550f6d57106e59106e5a116e5c126e\
    5d126e5f136e61136e62146e64156e65156e67166e69166e6a176e6c186e6d186e6f196e71196e721a6e741a6e751b6e771c6d\
    781c6d7a1d6d7c1d6d7d1e6d7f1e6c801f6c82206c84206b85216b87216b88226a8a226a8c23698d23698f2469902568922568\
    9326679526679727669827669a28659b29649d29649f2a63a02a63a22b62a32c61a52c60a62d60a82e5fa92e5eab2f5ead305d\
    ae305cb0315bb1325ab3325ab43359b63458b73557b93556ba3655bc3754bd3853bf3952c03a51c13a50c33b4fc43c4ec63d4d\
    c73e4cc83f4bca404acb4149cc4248ce4347cf4446d04545d24644d34743d44842d54a41d74b3fd84c3ed94d3dda4e3cdb503b\
    dd513ade5238df5337e05536e15635e25734e35933e45a31e55c30e65d2fe75e2ee8602de9612bea632aeb6429eb6628ec6726\
    ed6925ee6a24ef6c23ef6e21f06f20f1711ff1731df2741cf3761bf37819f47918f57b17f57d15f67e14f68013f78212f78410\
    f8850ff8870ef8890cf98b0bf98c0af98e09fa9008fa9207fa9407fb9606fb9706fb9906fb9b06fb9d07fc9f07fca108fca309\
    fca50afca60cfca80dfcaa0ffcac11fcae12fcb014fcb216fcb418fbb61afbb81dfbba1ffbbc21fbbe23fac026fac228fac42a\
    fac62df9c72ff9c932f9cb35f8cd37f8cf3af7d13df7d340f6d543f6d746f5d949f5db4cf4dd4ff4df53f4e156f3e35af3e55d\
    f2e661f2e865f2ea69f1ec6df1ed71f1ef75f1f179f2f27df2f482f3f586f3f68af4f88ef5f992f6fa96f8fb9af9fc9dfafda1\
    fcffa4";

/// A scale of colours from low to high.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FalseColour {
    /// From violet over green to yellow.
    Viridis,
    /// A rainbow of even steps.
    Turbo,
    /// From black over magenta to nearly white.
    Magma,
    /// From black over red to nearly white.
    Inferno,
    /// From black to white.
    Grey,
}

/// What is not a number, in sRGB; no scale has it.
pub const NOT_A_NUMBER: [f32; 3] = [1.0, 0.0, 1.0];

impl FalseColour {
    /// All of them.
    pub const ALL: [FalseColour; 5] = [
        FalseColour::Viridis,
        FalseColour::Turbo,
        FalseColour::Magma,
        FalseColour::Inferno,
        FalseColour::Grey,
    ];

    /// As the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            FalseColour::Viridis => "viridis",
            FalseColour::Turbo => "turbo",
            FalseColour::Magma => "magma",
            FalseColour::Inferno => "inferno",
            FalseColour::Grey => "grey",
        }
    }

    /// The sRGB colour, still encoded, of a value from 0 to 1; values beyond are those of the ends.
    pub fn at(self, value: f32) -> [f32; 3] {
        if value.is_nan() {
            return NOT_A_NUMBER;
        }
        let v = value.clamp(0.0, 1.0);
        match self {
            FalseColour::Viridis => in_table(VIRIDIS, v),
            FalseColour::Magma => in_table(MAGMA, v),
            FalseColour::Inferno => in_table(INFERNO, v),
            FalseColour::Turbo => turbo(v),
            FalseColour::Grey => [v; 3],
        }
    }
}

impl fmt::Display for FalseColour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FalseColour {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let wanted = if name == "gray" { "grey" } else { name };
        let found = Self::ALL.into_iter().find(|c| c.name() == wanted);
        found.ok_or_else(|| Error::Usage(unknown_name("colour scale", name, Self::ALL.map(Self::name))))
    }
}

/// Between two entries in proportion.
fn in_table(table: &[u8; 1536], v: f32) -> [f32; 3] {
    let x = v * 255.0;
    let low = (x as usize).min(254);
    let t = x - low as f32;
    let digit = |at: usize| f32::from((table[at] as char).to_digit(16).unwrap_or(0) as u8);
    let entry = |i: usize, c: usize| digit(6 * i + 2 * c) * 16.0 + digit(6 * i + 2 * c + 1);
    [0, 1, 2].map(|c| (entry(low, c) * (1.0 - t) + entry(low + 1, c) * t) / 255.0)
}

fn turbo(x: f32) -> [f32; 3] {
    const RED: [f32; 6] = [0.135_721_4, 4.615_392_6, -42.660_324, 132.131_09, -152.942_4, 59.286_38];
    const GREEN: [f32; 6] = [0.091_402_61, 2.194_188_4, 4.842_966_6, -14.185_033, 4.277_298_5, 2.829_566];
    const BLUE: [f32; 6] = [0.106_673_3, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25];
    [RED, GREEN, BLUE].map(|p| p.iter().rev().fold(0.0, |sum, c| sum * x + c).clamp(0.0, 1.0))
}

/// Which values a scale goes over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The value of its low end.
    pub low: f32,
    /// The value of its high end; not that of the low end.
    pub high: f32,
    /// Equal steps are equal ratios. Both ends are positive then.
    pub log: bool,
}

impl Range {
    /// From the 1 % to the 99 % quantile of the finite values, of the positive ones where the scale is logarithmic; a
    /// little around it where all are one. Nothing where there are none.
    pub fn of(values: &[f32], log: bool) -> Option<Range> {
        let mut sorted: Vec<f32> =
            values.iter().copied().filter(|v| v.is_finite() && (!log || *v > 0.0)).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        // The nearest rank.
        let at = |share: f64| sorted[(share * last as f64).round() as usize];
        let (low, high) = (at(0.01), at(0.99));
        if low < high {
            return Some(Range { low, high, log });
        }
        let around = (low.abs() * 0.5).max(f32::MIN_POSITIVE);
        Some(Range { low: low - around, high: high + around, log })
    }

    /// From 0 at the low end to 1 at the high one.
    pub fn share(&self, value: f32) -> f32 {
        let at = |v: f32| if self.log { f64::from(v.max(f32::MIN_POSITIVE)).ln() } else { f64::from(v) };
        // A maximum would take NaN for the least.
        if value.is_nan() {
            return value;
        }
        ((at(value) - at(self.low)) / (at(self.high) - at(self.low))) as f32
    }
}

/// Linear colours, so that an sRGB picture of them shows the scale's.
pub fn paint(values: &[f32], scale: FalseColour, range: &Range) -> [Vec<f32>; 3] {
    let colours: Vec<[f32; 3]> =
        values.iter().map(|&v| scale.at(range.share(v)).map(srgb_to_linear)).collect();
    [0, 1, 2].map(|c| colours.iter().map(|colour| colour[c]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;

    #[test]
    fn lightness_grows_but_for_turbo() {
        for scale in FalseColour::ALL {
            // Neighbours in a table of bytes may be a rounding apart in the wrong direction; two steps on it is right.
            let luminance = |i: usize| {
                let [r, g, b] = scale.at(i as f32 / 100.0).map(srgb_to_linear);
                Rgb::new(r, g, b).luminance()
            };
            let grows = (0..100).all(|i| luminance(i) < luminance(i + 1));
            assert_eq!(grows, scale != FalseColour::Turbo, "{scale}");
        }
    }

    #[test]
    fn known_colours_of_each_scale() {
        let bytes = |scale: FalseColour, v: f32| scale.at(v).map(|c| (c * 255.0).round() as u8);
        // Of matplotlib 3 (`colormaps[name]`): first and last entries, and the 128th of 256.
        assert_eq!(bytes(FalseColour::Viridis, 0.0), [68, 1, 84]);
        assert_eq!(bytes(FalseColour::Viridis, 1.0), [253, 231, 37]);
        assert_eq!(bytes(FalseColour::Viridis, 128.0 / 255.0), [33, 145, 140]);
        assert_eq!(bytes(FalseColour::Magma, 1.0), [252, 253, 191]);
        assert_eq!(bytes(FalseColour::Magma, 128.0 / 255.0), [183, 55, 121]);
        assert_eq!(bytes(FalseColour::Inferno, 1.0), [252, 255, 164]);
        assert_eq!(bytes(FalseColour::Inferno, 128.0 / 255.0), [188, 55, 84]);
        // The polynomial by hand at 128 / 255; its author's table has (164, 252, 60) there.
        assert_eq!(bytes(FalseColour::Turbo, 128.0 / 255.0), [152, 250, 79]);
        assert_eq!(bytes(FalseColour::Grey, 0.2), [51; 3]);
    }

    #[test]
    fn ranges_leave_out_what_is_rare_or_not_finite() {
        let mut values: Vec<f32> = (0..=1000).map(|i| i as f32).collect();
        values.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        let range = Range::of(&values, false).expect("some");
        assert_eq!((range.low, range.high), (10.0, 990.0));
        assert_eq!((range.share(10.0), range.share(500.0), range.share(990.0)), (0.0, 0.5, 1.0));
        assert!(range.share(f32::INFINITY) > 1.0 && range.share(f32::NEG_INFINITY) < 0.0);
        assert_eq!(FalseColour::Grey.at(range.share(f32::NAN)), NOT_A_NUMBER);
        let log = Range { low: 0.01, high: 100.0, log: true };
        assert!((log.share(1.0) - 0.5).abs() < 1e-6 && log.share(-3.0) < 0.0 && log.share(0.0) < 0.0);
        let one = Range::of(&[3.0; 5], false).expect("some");
        assert_eq!(one.share(3.0), 0.5);
        assert_eq!(Range::of(&[f32::NAN, -1.0, 0.0], true), None);
    }

    #[test]
    fn names_of_both_spellings() {
        assert_eq!("gray".parse::<FalseColour>().expect("known"), FalseColour::Grey);
        let message = "viridi".parse::<FalseColour>().expect_err("unknown").to_string();
        assert!(message.contains("did you mean \"viridis\"?"), "{message}");
    }
}
