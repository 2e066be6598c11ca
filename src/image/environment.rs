//! Skies from a cube's six faces to one equirectangular picture and back, with the flux through every texel kept: a new
//! texel has the mean radiance of what it covers, by exact solid angles. Texels are taken as even squares of light; what
//! is bright within one stays as bright in sum, wherever edges and poles are.

mod overlap;

use crate::base::image_data::{ImageData, Texels};
use overlap::Overlap;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Side faces with the longitudes of their middles: +X -X +Z -Z, by their numbers among the six.
const SIDES: [(usize, f64); 4] = [(0, 0.0), (1, PI), (4, FRAC_PI_2), (5, -FRAC_PI_2)];

/// Where the quarters of the upper and lower faces begin, and how (along, across) stand to x and z: signs and whether they
/// are swapped.
const QUARTERS: [Quarter; 4] = [
    Quarter { start: -PI, along_is_x: true, x: -1, z: -1 },
    Quarter { start: -FRAC_PI_2, along_is_x: false, x: 1, z: -1 },
    Quarter { start: 0.0, along_is_x: true, x: 1, z: 1 },
    Quarter { start: FRAC_PI_2, along_is_x: false, x: -1, z: 1 },
];

struct Quarter {
    start: f64,
    along_is_x: bool,
    x: i32,
    z: i32,
}

impl Quarter {
    /// Column and row (from the top of the picture) of the upper face's texel; the lower face's row is as far from its
    /// bottom.
    fn texel(&self, overlap: &Overlap, n: usize, [along, across]: [usize; 2]) -> [usize; 2] {
        let [x, z] = if self.along_is_x { [along, across] } else { [across, along] };
        let signed = |strip: usize, sign: i32| {
            let at = overlap.positive(strip);
            if sign > 0 { at } else { n - 1 - at }
        };
        // The upper face is (s, 1, -t): z grows downwards.
        [signed(x, self.x), signed(z, self.z)]
    }
}

/// Columns of texels that one task makes.
const BAND: usize = 64;

/// Sums of radiance times solid angle, and of solid angles.
type Sum = [f64; 4];

fn add(sum: &mut Sum, image: &ImageData, x: usize, y: usize, area: f64) {
    let t = image.texel(x, y);
    sum[0] += area * f64::from(t.r);
    sum[1] += area * f64::from(t.g);
    sum[2] += area * f64::from(t.b);
    sum[3] += area;
}

/// Means of sums. Parts of both signs may leave a rounding error below zero where there is no light.
fn means(sums: impl IntoIterator<Item = Sum>) -> Vec<[f32; 3]> {
    sums.into_iter().map(|[r, g, b, area]| [r, g, b].map(|c| (c / area).max(0.0) as f32)).collect()
}

/// Six faces of `n` texels a side, in the order +X -X +Y -Y +Z -Z (the conventions of `skyboxes::cube`), of an
/// equirectangular sky (those of `skyboxes::sphere`). The result does not depend on the number of threads.
pub fn cube_of(sky: &ImageData, n: usize) -> [ImageData; 6] {
    let overlap = Overlap::new(sky.width, sky.height, n);
    let below = |row: usize| sky.height - 1 - row;
    let bands: Vec<(usize, usize)> =
        (0..SIDES.len()).flat_map(|side| (0..n).step_by(BAND).map(move |x| (side, x))).collect();
    let sides: Vec<Vec<[f32; 3]>> = bands
        .into_par_iter()
        .map(|(side, first)| {
            let end = n.min(first + BAND);
            let at = |x: usize| if x == n { FRAC_PI_4 } else { (2.0 * x as f64 / n as f64 - 1.0).atan() };
            let mut sums = vec![Sum::default(); (end - first) * n];
            overlap.side(SIDES[side].1, [at(first), at(end)], |[x, strip], [column, row], area| {
                let x = x.clamp(first, end - 1) - first;
                let up = overlap.positive(strip);
                add(&mut sums[x * n + n - 1 - up], sky, column, row, area);
                add(&mut sums[x * n + up], sky, column, below(row), area);
            });
            means(sums)
        })
        .collect();
    let halves = overlap.halves();
    let quarter_sums: Vec<[Vec<Sum>; 2]> = QUARTERS
        .par_iter()
        .map(|quarter| {
            let mut sums = [(); 2].map(|()| vec![Sum::default(); halves * halves]);
            overlap.top(quarter.start, [0.0, FRAC_PI_2], |[x, y], [column, row], area| {
                add(&mut sums[0][y * halves + x], sky, column, row, area);
                add(&mut sums[1][y * halves + x], sky, column, below(row), area);
            });
            sums
        })
        .collect();
    let mut caps = [(); 2].map(|()| vec![Sum::default(); n * n]);
    for (quarter, sums) in QUARTERS.iter().zip(quarter_sums) {
        for (i, (upper, lower)) in sums[0].iter().zip(&sums[1]).enumerate() {
            let [x, y] = quarter.texel(&overlap, n, [i % halves, i / halves]);
            for (cap, y, sum) in [(0, y, upper), (1, n - 1 - y, lower)] {
                // Texels in the middle of an odd number are in two or four quarters.
                caps[cap][y * n + x].iter_mut().zip(sum).for_each(|(a, b)| *a += b);
            }
        }
    }
    let mut faces = [(); 6].map(|()| Vec::new());
    let [upper, lower] = caps;
    (faces[2], faces[3]) = (means(upper), means(lower));
    // Columns of a side come by growing longitude, which is from right to left.
    let columns: Vec<&[[f32; 3]]> = sides.iter().flat_map(|band| band.chunks_exact(n)).collect();
    for ((face, _), columns) in SIDES.into_iter().zip(columns.chunks_exact(n)) {
        faces[face] = (0..n).flat_map(|y| columns.iter().rev().map(move |column| column[y])).collect();
    }
    faces.map(|texels| ImageData { width: n, height: n, texels: Texels::F32(texels) })
}

/// An equirectangular sky of `height` texels down and twice as many across, of six square faces of one size. As
/// [`cube_of`].
pub fn equirectangular_of(faces: &[ImageData; 6], height: usize) -> ImageData {
    let (n, width) = (faces[0].width, 2 * height);
    let overlap = Overlap::new(width, height, n);
    let bands: Vec<usize> = (0..width).step_by(BAND).collect();
    let bands: Vec<Vec<[f32; 3]>> = bands
        .into_par_iter()
        .map(|first| {
            let end = width.min(first + BAND);
            let mut sums = vec![Sum::default(); (end - first) * height];
            let mut put = |texels: [(usize, usize, usize); 2], [column, row]: [usize; 2], area: f64| {
                // A meridian on the border may be rounded to either side; its strip is empty then.
                let column = column.clamp(first, end - 1) - first;
                for ((face, x, y), row) in texels.into_iter().zip([row, height - 1 - row]) {
                    add(&mut sums[column * height + row], &faces[face], x, y, area);
                }
            };
            let longitude = |column: usize| TAU * (column as f64 / width as f64 - 0.5);
            let (from, to) = (longitude(first), longitude(end));
            for (face, centre) in SIDES {
                // The face behind is in front of both ends.
                for centre in [centre, centre - TAU] {
                    let range = [(from - centre).max(-FRAC_PI_4), (to - centre).min(FRAC_PI_4)];
                    if range[0] < range[1] {
                        overlap.side(centre, range, |[x, strip], cell, area| {
                            let (x, up) = (n - 1 - x, overlap.positive(strip));
                            put([(face, x, n - 1 - up), (face, x, up)], cell, area);
                        });
                    }
                }
            }
            for quarter in &QUARTERS {
                let range = [(from - quarter.start).max(0.0), (to - quarter.start).min(FRAC_PI_2)];
                if range[0] < range[1] {
                    overlap.top(quarter.start, range, |strips, cell, area| {
                        let [x, y] = quarter.texel(&overlap, n, strips);
                        put([(2, x, y), (3, x, n - 1 - y)], cell, area);
                    });
                }
            }
            means(sums)
        })
        .collect();
    let columns: Vec<&[[f32; 3]]> = bands.iter().flat_map(|band| band.chunks_exact(height)).collect();
    let texels = (0..height).flat_map(|y| columns.iter().map(move |column| column[y])).collect();
    ImageData { width, height, texels: Texels::F32(texels) }
}

#[cfg(test)]
mod tests;
