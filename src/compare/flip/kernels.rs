//! The weights of FLIP's filters: Andersson et al. 2020, sections 4.1 (contrast sensitivity) and 4.2 (edges and points),
//! in the separated form that the reference implementation has used since version 1.2.

use std::f64::consts::PI;

/// Amplitudes and widths of the contrast sensitivity functions, Andersson et al. 2020, table 1: of Y, of Cx, and the two
/// terms of Cz.
const SENSITIVITY: [[f64; 2]; 4] = [[1.0, 0.0047], [1.0, 0.0053], [34.1, 0.04], [13.5, 0.025]];

/// Width of the edge and point detectors, in degrees (Andersson et al. 2020, section 4.2).
const DETECTOR_WIDTH: f64 = 0.082;

/// What a filter may lose of its sum at both ends together where its weights vanish long before its radius: less than
/// the rounding of f32.
const NEGLIGIBLE: f64 = 1e-8;

/// Half of a symmetric filter, or of an antisymmetric one: the weight of the middle, then those outwards.
pub(super) type Half = Vec<f32>;

/// Every filter for one number of pixels per degree.
#[derive(Debug, Clone)]
pub(super) struct Kernels {
    /// Of Y and Cx.
    pub sensitivity: [Half; 2],
    /// Of Cz: the sum of two Gaussians is two passes in either direction.
    pub blue_yellow: [Half; 2],
    /// Gaussian of the detectors, its sum 1.
    pub gauss: Half,
    /// Its first derivative: antisymmetric, so the middle is 0; positive weights sum to 1.
    pub first: Half,
    /// Its second derivative: positive weights sum to 1, negative ones to -1.
    pub second: Half,
}

impl Kernels {
    /// For `ppd` pixels per degree of visual angle, which is positive.
    pub fn new(ppd: f64) -> Self {
        // 3 standard deviations of the widest Gaussian.
        let widest = SENSITIVITY.iter().map(|s| s[1]).fold(0.0, f64::max);
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
        let half = |[_, b]: [f64; 2]| -> Vec<f64> {
            (0..=radius).map(|k| (-(PI * k as f64 / ppd).powi(2) / b).exp()).collect()
        };
        let [y, cx, cz1, cz2] = SENSITIVITY.map(half);
        let amplitude = |[a, b]: [f64; 2]| (a * (PI / b).sqrt()).sqrt();
        let cz1: Vec<f64> = cz1.iter().map(|g| g * amplitude(SENSITIVITY[2])).collect();
        let cz2: Vec<f64> = cz2.iter().map(|g| g * amplitude(SENSITIVITY[3])).collect();
        let norm = sum(&cz1).hypot(sum(&cz2));
        let (gauss, first, second) = detectors(ppd);
        Kernels {
            sensitivity: [cut(&y, sum(&y)), cut(&cx, sum(&cx))],
            // Of one length: both are worked out together.
            blue_yellow: [divided(&cz1, norm), divided(&cz2, norm)],
            gauss,
            first,
            second,
        }
    }

    /// How far any of the filters reaches, in pixels.
    pub fn radius(&self) -> usize {
        let halves = self.sensitivity.iter().chain(&self.blue_yellow).chain([&self.gauss]);
        halves.map(|h| h.len() - 1).max().unwrap_or(0)
    }
}

/// Sum of a symmetric filter.
fn sum(half: &[f64]) -> f64 {
    half[0] + 2.0 * half[1..].iter().sum::<f64>()
}

/// The filter divided by `norm`, without the weights at the ends that sum to less than [`NEGLIGIBLE`].
fn cut(half: &[f64], norm: f64) -> Half {
    let mut lost = 0.0;
    let mut len = half.len();
    while len > 1 && lost + 2.0 * half[len - 1] / norm < NEGLIGIBLE {
        len -= 1;
        lost += 2.0 * half[len] / norm;
    }
    divided(&half[..len], norm)
}

fn divided(half: &[f64], norm: f64) -> Half {
    half.iter().map(|w| (w / norm) as f32).collect()
}

fn detectors(ppd: f64) -> (Half, Half, Half) {
    let deviation = 0.5 * DETECTOR_WIDTH * ppd;
    let radius = (3.0 * deviation).ceil() as usize;
    let x = |k: usize| k as f64 / deviation;
    let gauss: Vec<f64> = (0..=radius).map(|k| (-0.5 * x(k) * x(k)).exp()).collect();
    let first: Vec<f64> = gauss.iter().enumerate().map(|(k, g)| k as f64 * g).collect();
    let second: Vec<f64> = gauss.iter().enumerate().map(|(k, g)| (x(k) * x(k) - 1.0) * g).collect();
    let of = |sign: f64| sum(&second.iter().map(|w| (sign * w).max(0.0)).collect::<Vec<_>>());
    let (positive, negative) = (of(1.0), of(-1.0));
    let second = second.iter().map(|w| (w / if *w > 0.0 { positive } else { negative }) as f32).collect();
    (divided(&gauss, sum(&gauss)), divided(&first, first.iter().sum()), second)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(half: &[f32]) -> f64 {
        sum(&half.iter().map(|w| f64::from(*w)).collect::<Vec<_>>())
    }

    #[test]
    fn weights_sum_to_what_the_paper_says() {
        for ppd in [1.0, 7.3, 67.020_645, 200.0] {
            let k = Kernels::new(ppd);
            for half in [&k.sensitivity[0], &k.sensitivity[1], &k.gauss] {
                assert!((whole(half) - 1.0).abs() < 1e-6, "{ppd}: {}", whole(half));
            }
            let [a, b] = [whole(&k.blue_yellow[0]), whole(&k.blue_yellow[1])];
            assert!((a * a + b * b - 1.0).abs() < 1e-6, "{ppd}: {a} {b}");
            let side: f64 = k.first.iter().map(|w| f64::from(*w)).sum();
            assert!((side - 1.0).abs() < 1e-6);
            assert!(whole(&k.second).abs() < 1e-6);
            assert_eq!(k.first[0], 0.0);
        }
    }

    #[test]
    fn radii_at_the_usual_distance() {
        // ceil(3 sqrt(0.04 / 2) / pi * 67.02) = 10; ceil(3 * 0.041 * 67.02) = 9.
        let k = Kernels::new(67.020_645);
        assert_eq!((k.blue_yellow[0].len(), k.gauss.len(), k.radius()), (11, 10, 10));
        assert!(k.sensitivity[0].len() <= 8, "{}", k.sensitivity[0].len());
    }
}
