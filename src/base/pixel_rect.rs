//! A rectangle of whole pixels.

/// Pixels with `x0 <= x < x1`, `y0 <= y < y1`; x to the right, y down, the frame's left top pixel at (0, 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct PixelRect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl PixelRect {
    /// From corner to (excluded) corner.
    pub const fn new(x0: u32, y0: u32, x1: u32, y1: u32) -> Self {
        PixelRect { x0, y0, x1, y1 }
    }

    /// The whole of a frame.
    pub const fn of_size(width: u32, height: u32) -> Self {
        PixelRect::new(0, 0, width, height)
    }

    /// In pixels; 0 where the corners are the wrong way round.
    pub const fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// In pixels; 0 where the corners are the wrong way round.
    pub const fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// In pixels.
    pub const fn area(&self) -> usize {
        self.width() as usize * self.height() as usize
    }

    /// Whether the pixel lies inside.
    #[inline]
    pub const fn contains(&self, x: u32, y: u32) -> bool {
        x >= self.x0 && x < self.x1 && y >= self.y0 && y < self.y1
    }

    /// The common part; of area 0 where there is none.
    pub fn intersection(&self, other: &PixelRect) -> PixelRect {
        PixelRect::new(
            self.x0.max(other.x0),
            self.y0.max(other.y0),
            self.x1.min(other.x1),
            self.y1.min(other.y1),
        )
    }

    /// Row-major index of a pixel that lies inside.
    #[inline]
    pub fn index(&self, x: u32, y: u32) -> usize {
        debug_assert!(self.contains(x, y), "({x}, {y}) outside {self:?}");
        (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize
    }

    /// The pixels, row by row.
    pub fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        (self.y0..self.y1).flat_map(move |y| (self.x0..self.x1).map(move |x| (x, y)))
    }

    /// Parts of at most `side` x `side` pixels that cover the rectangle, row by row from its left top.
    pub fn tiles(self, side: u32) -> impl Iterator<Item = PixelRect> {
        let step = side.max(1) as usize;
        (self.y0..self.y1).step_by(step).flat_map(move |y| {
            (self.x0..self.x1).step_by(step).map(move |x| {
                PixelRect::new(x, y, self.x1.min(x.saturating_add(side)), self.y1.min(y.saturating_add(side)))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_once() {
        let rect = PixelRect::new(3, 5, 40, 22);
        let mut seen = vec![0; rect.area()];
        for (x, y) in rect.tiles(16).flat_map(PixelRect::pixels) {
            seen[rect.index(x, y)] += 1;
        }
        assert!(seen.iter().all(|&n| n == 1));
        assert_eq!(rect.tiles(16).count(), 3 * 2);
    }

    #[test]
    fn rectangles_without_common_part_meet_in_none() {
        let (a, b) = (PixelRect::of_size(4, 4), PixelRect::new(4, 0, 8, 4));
        assert_eq!(a.intersection(&b).area(), 0);
        assert_eq!(a.intersection(&PixelRect::new(2, 3, 9, 9)), PixelRect::new(2, 3, 4, 4));
    }
}
