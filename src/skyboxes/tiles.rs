//! Texels of a sky in blocks of 4 x 4. Scattered rays look up texels all over a sky that is far larger than any cache:
//! what counts is how many lines of memory a lookup touches, and how many lookups are on their way at once. A bilinear
//! footprint of eight-bit texels lies inside one block, which is one line, nine times of sixteen; rows would cost two
//! lines always.

use crate::base::image_data::{ImageData, LINEAR8_TO_LINEAR, SRGB8_TO_LINEAR, Texels};
use crate::color::Rgb;
use crate::math::pages::Pages;
use bytemuck::{Pod, Zeroable};

/// Texels along the side of a block.
const SIDE: usize = 4;
/// Texels of a block.
const AREA: usize = SIDE * SIDE;

/// A block of eight-bit texels, row by row: a line of memory.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Block8([[u8; 4]; AREA]);

/// A block of float texels, row by row: three lines.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Block32([[f32; 3]; AREA]);

enum Blocks {
    Srgb8(Pages<Block8>),
    Linear8(Pages<Block8>),
    F32(Pages<Block32>),
}

/// Several charts of texels, all of one size.
pub(super) struct Tiles {
    blocks: Blocks,
    /// Texels in a row and in a column of blocks.
    strides: Strides,
}

/// Steps from texel to texel, in texels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strides {
    row_of_blocks: u32,
    chart: u32,
}

/// Where four neighbouring texels stand, and how they are to be mixed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Footprint {
    /// The upper left one.
    pub at: u32,
    /// From there to its right neighbour.
    pub right: u32,
    /// From there to the one below.
    pub down: u32,
    /// Weight of the right ones.
    pub fx: f32,
    /// Weight of the lower ones.
    pub fy: f32,
}

/// Lookups that are worked on at once: their footprints stay in the first-level cache.
pub(super) const CHUNK: usize = 128;

/// Up to [`CHUNK`] footprints as columns.
pub(super) struct Footprints {
    at: [u32; CHUNK],
    right: [u32; CHUNK],
    down: [u32; CHUNK],
    fx: [f32; CHUNK],
    fy: [f32; CHUNK],
}

impl Footprints {
    /// None yet.
    pub const NONE: Self = Footprints {
        at: [0; CHUNK],
        right: [0; CHUNK],
        down: [0; CHUNK],
        fx: [0.0; CHUNK],
        fy: [0.0; CHUNK],
    };

    /// Sets number `i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, f: Footprint) {
        self.at[i] = f.at;
        self.right[i] = f.right;
        self.down[i] = f.down;
        self.fx[i] = f.fx;
        self.fy[i] = f.fy;
    }

    #[inline(always)]
    fn get(&self, i: usize) -> Footprint {
        Footprint { at: self.at[i], right: self.right[i], down: self.down[i], fx: self.fx[i], fy: self.fy[i] }
    }
}

impl Strides {
    /// The texels x, x + 1 by y, y + 1 of a chart.
    #[inline(always)]
    pub fn footprint(self, chart: u32, x: u32, y: u32, [fx, fy]: [f32; 2]) -> Footprint {
        const LAST: u32 = SIDE as u32 - 1;
        let at = chart * self.chart
            + (y / SIDE as u32) * self.row_of_blocks
            + (x / SIDE as u32) * AREA as u32
            + (y & LAST) * SIDE as u32
            + (x & LAST);
        let right = if x & LAST == LAST { AREA as u32 - LAST } else { 1 };
        let down = if y & LAST == LAST { self.row_of_blocks - LAST * SIDE as u32 } else { SIDE as u32 };
        Footprint { at, right, down, fx, fy }
    }
}

/// How a stored texel is read.
trait Texel: Copy {
    fn rgb(self, curve: &[f32; 256]) -> Rgb;

    /// Something of it, so that it is loaded.
    fn bits(self) -> u32;
}

impl Texel for [u8; 4] {
    #[inline(always)]
    fn rgb(self, curve: &[f32; 256]) -> Rgb {
        Rgb::new(curve[self[0] as usize], curve[self[1] as usize], curve[self[2] as usize])
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from_ne_bytes(self)
    }
}

impl Texel for [f32; 3] {
    #[inline(always)]
    fn rgb(self, _: &[f32; 256]) -> Rgb {
        Rgb::from(self)
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self[0].to_bits()
    }
}

/// Calls `$f` with the texels in the order of the blocks and the curve that decodes them.
macro_rules! with_texels {
    ($tiles:expr, $f:expr) => {
        match &$tiles.blocks {
            Blocks::Srgb8(b) => $f(bytemuck::cast_slice::<_, [u8; 4]>(b.as_slice()), &SRGB8_TO_LINEAR),
            Blocks::Linear8(b) => $f(bytemuck::cast_slice::<_, [u8; 4]>(b.as_slice()), &LINEAR8_TO_LINEAR),
            Blocks::F32(b) => $f(bytemuck::cast_slice::<_, [f32; 3]>(b.as_slice()), &LINEAR8_TO_LINEAR),
        }
    };
}

impl Tiles {
    /// `charts` charts of `width` x `height` texels each; `source(chart, x, y)` says which texel of which of the
    /// pictures stands there. The pictures must be of one pixel format.
    ///
    /// # Panics
    /// If there are more than 2^32 texels (a cube map of 26,000 texels a side), or none.
    pub fn new(
        pictures: &[ImageData],
        charts: usize,
        [width, height]: [usize; 2],
        source: impl Fn(usize, usize, usize) -> (usize, usize) + Sync,
    ) -> Self {
        let (across, down) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let n = charts * down * across;
        assert!(n > 0 && n * AREA <= u32::MAX as usize, "{n} blocks of texels");
        // Blocks at the right and lower end are filled up with the last texel.
        let source = &source;
        let place = |block: usize| {
            let (row, x) = (block / across, SIDE * (block % across));
            let (chart, y) = (row / down, SIDE * (row % down));
            move |k: usize| source(chart, (x + k % SIDE).min(width - 1), (y + k / SIDE).min(height - 1))
        };
        let blocks = match &pictures[0].texels {
            Texels::Srgb8(_) => Blocks::Srgb8(Pages::from_fn(n, |b| Block8(block8(pictures, place(b))))),
            Texels::Linear8(_) => Blocks::Linear8(Pages::from_fn(n, |b| Block8(block8(pictures, place(b))))),
            Texels::F32(_) => Blocks::F32(Pages::from_fn(n, |b| {
                let place = place(b);
                Block32(std::array::from_fn(|k| {
                    let (picture, i) = place(k);
                    match &pictures[picture].texels {
                        Texels::F32(t) => t[i],
                        _ => [0.0; 3],
                    }
                }))
            })),
        };
        let row_of_blocks = (across * AREA) as u32;
        Tiles { blocks, strides: Strides { row_of_blocks, chart: row_of_blocks * down as u32 } }
    }

    /// For finding texels.
    #[inline(always)]
    pub fn strides(&self) -> Strides {
        self.strides
    }

    /// One texel.
    pub fn texel(&self, chart: usize, x: usize, y: usize) -> Rgb {
        let f = self.strides.footprint(chart as u32, x as u32, y as u32, [0.0; 2]);
        with_texels!(self, |t: &[_], curve| read(t, curve, f.at))
    }

    /// Appends the luminances of `range` in row `y`.
    pub fn luminances(&self, chart: usize, y: usize, range: std::ops::Range<usize>, out: &mut Vec<f32>) {
        let at = |x: usize| self.strides.footprint(chart as u32, x as u32, y as u32, [0.0; 2]).at;
        with_texels!(self, |t: &[_], curve| out.extend(range.map(|x| read(t, curve, at(x)).luminance())));
    }

    /// The bilinear mix of one footprint.
    #[inline(always)]
    pub fn mix(&self, f: Footprint) -> Rgb {
        with_texels!(self, |t: &[_], curve| mixed(t, curve, f))
    }

    /// The bilinear mixes of the first footprints, at most [`CHUNK`]. Nothing in the loop waits for the lookup before,
    /// so that many are on their way to memory at once.
    #[inline(always)]
    pub fn mix_all(&self, footprints: &Footprints, out: &mut [Rgb]) {
        with_texels!(self, |t: &[_], curve| mix_slice(t, curve, footprints, out));
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let bytes = match &self.blocks {
            Blocks::Srgb8(b) | Blocks::Linear8(b) => size_of_val(b.as_slice()),
            Blocks::F32(b) => size_of_val(b.as_slice()),
        };
        bytes as u64
    }
}

#[inline(always)]
fn block8(pictures: &[ImageData], place: impl Fn(usize) -> (usize, usize)) -> [[u8; 4]; AREA] {
    std::array::from_fn(|k| {
        let (picture, i) = place(k);
        match &pictures[picture].texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => t[i],
            Texels::F32(_) => [0; 4],
        }
    })
}

#[inline(always)]
fn read<T: Texel>(texels: &[T], curve: &[f32; 256], at: u32) -> Rgb {
    texels[at as usize].rgb(curve)
}

#[inline(always)]
fn mixed<T: Texel>(texels: &[T], curve: &[f32; 256], f: Footprint) -> Rgb {
    let at = |k: u32| read(texels, curve, f.at + k);
    mix([at(0), at(f.right), at(f.down), at(f.down + f.right)], f.fx, f.fy)
}

#[inline(always)]
fn mix_slice<T: Texel>(texels: &[T], curve: &[f32; 256], footprints: &Footprints, out: &mut [Rgb]) {
    let n = out.len().min(CHUNK);
    // So few instructions a lookup that a processor has dozens of them on their way; the mixing below finds what it needs
    // in a cache. First and last texel: they lie in all blocks that a footprint touches, but for one of sixteen.
    let touched = (0..n).fold(0, |all, i| {
        let first = footprints.at[i] as usize;
        let last = first + (footprints.right[i] + footprints.down[i]) as usize;
        all | texels[first].bits() | texels[last].bits()
    });
    std::hint::black_box(touched);
    for (i, out) in out[..n].iter_mut().enumerate() {
        *out = mixed(texels, curve, footprints.get(i));
    }
}

/// The mix of the upper left, upper right, lower left and lower right value.
#[inline(always)]
pub(super) fn mix(v: [Rgb; 4], fx: f32, fy: f32) -> Rgb {
    let (gx, gy) = (1.0 - fx, 1.0 - fy);
    v[0] * (gx * gy) + v[1] * (fx * gy) + v[2] * (gx * fy) + v[3] * (fx * fy)
}
