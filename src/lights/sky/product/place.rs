//! Where cells lie in a plane, seen from within along an axis: circles about it are squares, as those of points are that
//! are mapped to a disc (Shirley and Chiu 1997), and areas are nearly the same as on the sphere.

use super::table::{FIRST_BACK, SECOND_BACK, SWAPPED};
use super::weigh::{Columns, larger};
use crate::math::Frame;
use crate::math::simd::{Kernel, dispatch};
use glam::Vec3;

/// Places are whole numbers, so that they can be sorted without a comparison; whatever of the plane is not before the
/// others begins with this one.
const BEFORE: u16 = 0x4000;
/// The plane's coordinates are no larger than the root of 2.
const SIDE: f32 = std::f32::consts::SQRT_2;

/// By cell.
#[derive(Default)]
pub(super) struct Places {
    /// Along the plane's first axis.
    pub x: Vec<u16>,
    /// Along the second.
    pub y: Vec<u16>,
    /// By what numbers run the plane's ways through the cell: [`SWAPPED`] if its first side runs along the plane's second
    /// axis, [`FIRST_BACK`] and [`SECOND_BACK`] if its sides run against the axes that they lie along.
    pub lie: Vec<u32>,
}

impl Places {
    /// Of cells as they are seen along an axis.
    pub fn new(cells: &Columns, axis: Vec3) -> Self {
        let n = cells.flux.len();
        let mut places = Places { x: vec![0; n], y: vec![0; n], lie: vec![0; n] };
        dispatch(Plane { cells, frame: Frame::from_z(axis), places: &mut places });
        places
    }

    /// Places a cell before all that are not.
    pub fn put_first(&mut self, cell: usize) {
        self.y[cell] /= u16::MAX / BEFORE + 1;
    }
}

struct Plane<'a> {
    cells: &'a Columns,
    frame: Frame,
    places: &'a mut Places,
}

#[inline(always)]
fn point(f: &Frame, d: [f32; 3]) -> [f32; 2] {
    let dot = |a: Vec3| a.x * d[0] + a.y * d[1] + a.z * d[2];
    let (x, y, z) = (dot(f.s), dot(f.t), dot(f.n));
    let scale = larger(1.0 - z, 0.0).sqrt() / larger(larger(x.abs(), y.abs()), 1e-6);
    [x * scale, y * scale]
}

/// A coordinate as a whole number.
#[inline(always)]
fn whole(x: f32) -> u16 {
    const STEPS: f32 = (u16::MAX - BEFORE) as f32;
    // In range but for what rounding adds.
    let part = (x + SIDE) * (0.5 / SIDE);
    let part = if part > 1.0 { 1.0 } else { larger(part, 0.0) };
    BEFORE + (part * STEPS) as i32 as u16
}

impl Kernel for Plane<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let c = self.cells;
        let n = self.places.x.len();
        let (x, y, z) = (&c.x[..n], &c.y[..n], &c.z[..n]);
        let [a, b] = &c.sides;
        let ([ax, ay, az], [bx, by, bz]) = (a.each_ref().map(|v| &v[..n]), b.each_ref().map(|v| &v[..n]));
        let (to_x, to_y, lie) = (&mut self.places.x[..n], &mut self.places.y[..n], &mut self.places.lie[..n]);
        let f = &self.frame;
        for i in 0..n {
            let at = point(f, [x[i], y[i], z[i]]);
            let a = point(f, [ax[i], ay[i], az[i]]);
            let b = point(f, [bx[i], by[i], bz[i]]);
            let (a, b) = ([a[0] - at[0], a[1] - at[1]], [b[0] - at[0], b[1] - at[1]]);
            let swapped = a[0].abs() + b[1].abs() < a[1].abs() + b[0].abs();
            let first = if swapped { a[1] } else { a[0] };
            let second = if swapped { b[0] } else { b[1] };
            lie[i] = if swapped { SWAPPED } else { 0 }
                | if first < 0.0 { FIRST_BACK } else { 0 }
                | if second < 0.0 { SECOND_BACK } else { 0 };
            to_x[i] = whole(at[0]);
            to_y[i] = whole(at[1]);
        }
    }
}
