//! The colour spaces of FLIP: linear Rec. 709 to YCxCz, where filters work, and on to Hunt-adjusted CIELAB, where
//! distances are taken (Andersson et al. 2020, sections 4.1 and 4.3). Matrices and white point are those of the
//! reference implementation, multiplied out in f64.

use super::power::{cube_root, power};

type Matrix = [[f64; 3]; 3];

/// Linear Rec. 709 to XYZ, D65.
const TO_XYZ: Matrix = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
/// XYZ to linear Rec. 709.
const FROM_XYZ: Matrix = [
    [3.241_003_275, -1.537_398_934, -0.498_615_861],
    [-0.969_224_334, 1.875_930_071, 0.041_554_224],
    [0.055_639_423, -0.204_011_202, 1.057_148_933],
];
/// The white point, and what the reference implementation multiplies by instead of dividing by it.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
const PER_WHITE: [f64; 3] = [1.052_156_925, 1.0, 0.918_357_670];

/// `m * v + offset`, in f32.
#[derive(Debug, Clone, Copy)]
struct Affine {
    m: [[f32; 3]; 3],
    offset: [f32; 3],
}

impl Affine {
    fn new(m: Matrix, offset: [f64; 3]) -> Self {
        Affine { m: m.map(|row| row.map(|v| v as f32)), offset: offset.map(|v| v as f32) }
    }

    #[inline(always)]
    fn apply(&self, v: [f32; 3]) -> [f32; 3] {
        let [a, b, c] = &self.m;
        let dot = |row: &[f32; 3], offset: f32| row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + offset;
        [dot(a, self.offset[0]), dot(b, self.offset[1]), dot(c, self.offset[2])]
    }
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn diagonal(d: [f64; 3]) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { d[i] } else { 0.0 }))
}

/// The conversions, and the constants of the distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Colours {
    to_ycxcz: Affine,
    from_ycxcz: Affine,
    /// To XYZ relative to white.
    to_xyz: Affine,
    /// A distance (to the power of 0.7) from which on errors are nearly the largest: 0.4 of that from green to blue.
    knee: f32,
    /// What a distance below the knee is multiplied by, to reach 0.95 there.
    below: f32,
    /// The same above, to reach 1 for green against blue.
    above: f32,
}

/// Exponent of the distance of colours, Andersson et al. 2020, section 4.3.
const DISTANCE_EXPONENT: f32 = 0.7;
/// Part of the largest distance that is mapped to [`KNEE_ERROR`].
const KNEE: f64 = 0.4;
const KNEE_ERROR: f32 = 0.95;

impl Colours {
    pub fn new() -> Self {
        let to_xyz = times(&diagonal(PER_WHITE), &TO_XYZ);
        let opponent: Matrix = [[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]];
        // Y' = (Y + 16) / 116, X' = Y' + Cx / 500, Z' = Y' - Cz / 200.
        let back: Matrix =
            [[1.0 / 116.0, 1.0 / 500.0, 0.0], [1.0 / 116.0, 0.0, 0.0], [1.0 / 116.0, 0.0, -1.0 / 200.0]];
        let from_white = times(&FROM_XYZ, &diagonal(WHITE));
        let black = from_white.map(|row| row.iter().sum::<f64>() * 16.0 / 116.0);
        let mut all = Colours {
            to_ycxcz: Affine::new(times(&opponent, &to_xyz), [-16.0, 0.0, 0.0]),
            from_ycxcz: Affine::new(times(&from_white, &back), black),
            to_xyz: Affine::new(to_xyz, [0.0; 3]),
            knee: 0.0,
            below: 0.0,
            above: 0.0,
        };
        let largest = all.distance(all.hunt([0.0, 1.0, 0.0]), all.hunt([0.0, 0.0, 1.0]));
        let knee = KNEE * f64::from(largest);
        all.knee = knee as f32;
        all.below = (f64::from(KNEE_ERROR) / knee) as f32;
        all.above = ((1.0 - f64::from(KNEE_ERROR)) / (f64::from(largest) - knee)) as f32;
        all
    }

    /// YCxCz of linear Rec. 709.
    #[inline(always)]
    pub fn ycxcz(&self, linear: [f32; 3]) -> [f32; 3] {
        self.to_ycxcz.apply(linear)
    }

    /// Hunt-adjusted CIELAB of YCxCz, as far as that is a colour of the display.
    #[inline(always)]
    pub fn seen(&self, ycxcz: [f32; 3]) -> [f32; 3] {
        // `map` would be a call, for the plainest instructions.
        let [r, g, b] = self.from_ycxcz.apply(ycxcz);
        self.hunt([unit(r), unit(g), unit(b)])
    }

    /// Hunt-adjusted CIELAB of linear Rec. 709 in [0, 1].
    #[inline(always)]
    fn hunt(&self, linear: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.to_xyz.apply(linear);
        let [x, y, z] = [lightness(x), lightness(y), lightness(z)];
        let l = 116.0 * y - 16.0;
        let adjusted = 0.01 * l;
        [l, adjusted * (500.0 * (x - y)), adjusted * (200.0 * (y - z))]
    }

    /// HyAB distance to the power of 0.7.
    #[inline(always)]
    fn distance(&self, a: [f32; 3], b: [f32; 3]) -> f32 {
        let [l, u, v] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        power(l.abs() + (u * u + v * v).sqrt(), DISTANCE_EXPONENT)
    }

    /// Error in [0, 1] of a colour that is seen instead of another.
    #[inline(always)]
    pub fn error(&self, a: [f32; 3], b: [f32; 3]) -> f32 {
        let d = self.distance(a, b);
        if d < self.knee { d * self.below } else { KNEE_ERROR + (d - self.knee) * self.above }
    }
}

/// Within [0, 1]; 0 where it is NaN.
#[inline(always)]
pub(super) fn unit(v: f32) -> f32 {
    let v = if v > 0.0 { v } else { 0.0 };
    if v < 1.0 { v } else { 1.0 }
}

/// The curve of CIELAB: cube root, and a line near black (ISO/CIE 11664-4).
#[inline(always)]
fn lightness(t: f32) -> f32 {
    const EDGE: f32 = 216.0 / 24_389.0;
    let line = (841.0 / 108.0) * t + 4.0 / 29.0;
    // The root is asked within its range alone, whichever of the two counts.
    let root = cube_root(if t > EDGE { t } else { EDGE });
    if t > EDGE { root } else { line }
}

/// Linear light of an sRGB-encoded value in [0, 1] (IEC 61966-2-1).
#[inline(always)]
pub(super) fn decode(v: f32) -> f32 {
    let curve = power((v + 0.055) * (1.0 / 1.055), 2.4);
    if v <= 0.04045 { v * (1.0 / 12.92) } else { curve }
}

/// The error where features differ, too: the error of colours to the power of one minus the square root of that difference
/// (Andersson et al. 2020, section 4.4). `feature` is in units of Y, whose range is 116.
#[inline(always)]
pub(super) fn amplified(colour: f32, feature: f32) -> f32 {
    const UNIT: f32 = std::f32::consts::FRAC_1_SQRT_2 / 116.0;
    power(colour, 1.0 - (feature * UNIT).sqrt())
}
