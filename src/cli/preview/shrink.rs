//! A picture at the size of a terminal: each dot is the mean radiance of the pixels that it stands for, as far as they are
//! known, shown as a written picture would be.

use crate::base::pixel_rect::PixelRect;
use crate::color::Rgb;
use crate::image::tonemap::Look;
use crate::image::write::display_bytes;

/// Bytes of red, green and blue; none where nothing is known yet.
pub type Dot = Option<[u8; 3]>;

/// Dots, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dots {
    /// Dots across.
    pub width: usize,
    /// Dots down.
    pub height: usize,
    /// As many.
    pub list: Vec<Dot>,
}

/// The pixels of a window of the film.
pub struct Pixels {
    window: PixelRect,
    /// Red, green and blue; NaN in what is not known.
    list: Vec<[f32; 3]>,
}

impl Pixels {
    /// Nothing is known.
    pub fn new(window: PixelRect) -> Self {
        Pixels { window, list: vec![[f32::NAN; 3]; window.area()] }
    }

    /// Those of a part are known.
    pub fn set(&mut self, rect: PixelRect, means: &[[f32; 4]]) {
        for ((x, y), [r, g, b, _]) in rect.pixels().zip(means) {
            self.list[self.window.index(x, y)] = [*r, *g, *b];
        }
    }

    /// In at most so many dots, whose width over height is `aspect`, without magnification.
    pub fn fit(&self, [columns, rows]: [usize; 2], aspect: f64) -> [usize; 2] {
        let [width, height] = [self.window.width(), self.window.height()].map(f64::from);
        // Dots across for each pixel, at most.
        let scale = f64::min(columns as f64 / width, rows as f64 / (height * aspect)).min(1.0);
        [width * scale, height * aspect * scale].map(|v| (v.round() as usize).max(1))
    }

    /// As so many dots.
    pub fn dots(&self, [width, height]: [usize; 2], look: &Look) -> Dots {
        let [across, down] = [self.window.width() as usize, self.window.height() as usize];
        let part = |i: usize, of: usize, n: usize| {
            let start = i * n / of;
            start..((i + 1) * n / of).max(start + 1)
        };
        let dot = |(row, column): (usize, usize)| {
            let (mut sum, mut known) = ([0.0f64; 3], 0.0f64);
            for y in part(row, height, down) {
                for pixel in &self.list[y * across..][part(column, width, across)] {
                    if pixel[0].is_nan() {
                        continue;
                    }
                    (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
                    known += 1.0;
                }
            }
            (known > 0.0).then(|| display_bytes(look, Rgb::from(sum.map(|v| (v / known) as f32))))
        };
        let places = (0..height).flat_map(|row| (0..width).map(move |column| (row, column)));
        Dots { width, height, list: places.map(dot).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_are_means_of_what_is_known() {
        let window = PixelRect::new(2, 3, 6, 7);
        let mut pixels = Pixels::new(window);
        assert_eq!(pixels.fit([2, 100], 1.0), [2, 2]);
        assert_eq!(pixels.fit([100, 100], 1.0), [4, 4]);
        assert_eq!(pixels.fit([100, 2], 0.5), [4, 2]);
        let look = Look::default();
        assert!(pixels.dots([2, 2], &look).list.iter().all(Option::is_none));
        // The left half: a row of black and one of white alike in each dot.
        let left = PixelRect::new(2, 3, 4, 7);
        let means: Vec<[f32; 4]> = left.pixels().map(|(_, y)| [(y % 2) as f32; 4]).collect();
        pixels.set(left, &means);
        // The sRGB encoding of a half is 188.
        let half = Some([188; 3]);
        assert_eq!(pixels.dots([2, 2], &look).list, [half, None, half, None]);
        let all = pixels.dots([4, 4], &look).list;
        assert_eq!((all[0], all[4], all[3]), (Some([255; 3]), Some([0; 3]), None));
    }
}
