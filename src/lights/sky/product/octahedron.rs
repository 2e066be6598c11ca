//! Directions rounded to about a thousand: squares on the faces of an octahedron, unfolded.

use glam::Vec3;

/// Squares along a side of the unfolded octahedron.
const SIDE: u32 = 32;
/// Number of squares.
pub(super) const COUNT: usize = (SIDE * SIDE) as usize;

/// The square that a unit direction lies in.
#[inline(always)]
pub(super) fn find(d: Vec3) -> usize {
    let p = d / (d.x.abs() + d.y.abs() + d.z.abs());
    let fold = |a: f32, b: f32| if p.z >= 0.0 { a } else { (1.0 - b.abs()).copysign(a) };
    let cell = |x: f32| ((x + 1.0) * (0.5 * SIDE as f32)) as u32;
    let (x, y) = (cell(fold(p.x, p.y)).min(SIDE - 1), cell(fold(p.y, p.x)).min(SIDE - 1));
    (y * SIDE + x) as usize
}

/// The direction at a point of the unfolded octahedron, in [0, `SIDE`].
fn direction(x: f32, y: f32) -> Vec3 {
    let (x, y) = (x * (2.0 / SIDE as f32) - 1.0, y * (2.0 / SIDE as f32) - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = |a: f32, b: f32| if z >= 0.0 { a } else { (1.0 - b.abs()).copysign(a) };
    Vec3::new(fold(x, y), fold(y, x), z).normalize()
}

/// The middle of a square, and the sine, at least, of the largest angle between it and a direction of the square.
pub(super) fn middle(square: usize) -> (Vec3, f32) {
    let (x, y) = ((square as u32 % SIDE) as f32, (square as u32 / SIDE) as f32);
    let middle = direction(x + 0.5, y + 0.5);
    let corner = |k: u32| direction(x + (k % 2) as f32, y + (k / 2) as f32);
    // Chords are longer than sines, and edges of a square as seen from the centre are nearly straight.
    let reach = (0..4).map(|k| (corner(k) - middle).length()).fold(0.0, f32::max);
    (middle, 1.02 * reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    #[test]
    fn squares_reach_as_far_as_they_say() {
        let mut rng = TestRng::new(3);
        let mut axes = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        axes.extend((0..100_000).map(|_| rng.direction()));
        for d in axes {
            let (middle, reach) = middle(find(d));
            assert!((d - middle).length() <= reach, "{d}");
            // Close to the 4 pi / 1024 of a square of average size.
            assert!(reach < 0.14, "{reach}");
        }
    }
}
