//! Many lookups at once: angles along columns, and texels that wait for memory together.

use super::Sphere;
use crate::base::directions::Directions;
use crate::base::image_data::Texels;
use crate::color::Rgb;
use crate::math::simd::Kernel;
use crate::skyboxes::texel::{self, Tap};

/// Lookups that are worked on at once: their taps stay in the first-level cache.
const CHUNK: usize = 128;

/// [`crate::base::skybox::Skybox::radiance`] of each direction, bit for bit.
pub(super) struct Lookups<'a> {
    pub sphere: &'a Sphere,
    pub d: Directions<'a>,
    pub out: &'a mut [Rgb],
}

impl Kernel for Lookups<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Lookups { sphere, d, out } = self;
        let image = &*sphere.image;
        let size = [image.width as f32, image.height as f32];
        let [mut x, mut y] = [[0; CHUNK]; 2];
        let [mut fx, mut fy] = [[0.0; CHUNK]; 2];
        for ((_, d), out) in d.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            let n = d.len().min(CHUNK);
            let (xs, ys, zs) = (&d.x[..n], &d.y[..n], &d.z[..n]);
            for i in 0..n {
                let t = super::tap(size, [xs[i], ys[i], zs[i]]);
                (x[i], y[i], fx[i], fy[i]) = (t.x, t.y, t.fx, t.fy);
            }
            touch(&image.texels, [image.width, image.height], &x[..n], &y[..n]);
            for (i, out) in out.iter_mut().take(n).enumerate() {
                *out = sphere.at(Tap { x: x[i], y: y[i], fx: fx[i], fy: fy[i] });
            }
        }
    }
}

/// Loads of each tap the first texel above and the last below: so few instructions that a processor has dozens of them on
/// their way. What needs them then finds them in a cache, but for some that lie across two of its lines.
#[inline(always)]
fn touch(texels: &Texels, size: [usize; 2], x: &[i32], y: &[i32]) {
    let [w, h] = size.map(|n| n as i32);
    let at = |x: i32, y: i32| y.clamp(0, h - 1) as usize * w as usize + x.clamp(0, w - 1) as usize;
    let ends = x.iter().zip(y).map(|(&x, &y)| [at(x, y), at(x + 1, y + 1)]);
    let touched = match texels {
        Texels::Srgb8(v) | Texels::Linear8(v) => ends.fold(0, |all, [a, b]| all | bits8(v[a]) | bits8(v[b])),
        Texels::F32(v) => ends.fold(0, |all, [a, b]| all | v[a][0].to_bits() | v[b][2].to_bits()),
    };
    std::hint::black_box(touched);
}

#[inline(always)]
fn bits8(texel: [u8; 4]) -> u32 {
    u32::from_ne_bytes(texel)
}

impl Sphere {
    /// The mix at a tap.
    #[inline(always)]
    pub(super) fn at(&self, tap: Tap) -> Rgb {
        let (w, h) = (self.image.width, self.image.height);
        if (tap.x as u32) < w as u32 - 1 && (tap.y as u32) < h as u32 - 1 {
            texel::bilinear(&self.image.texels, w, tap)
        } else {
            self.across_edges(tap)
        }
    }
}
