//! Rays against triangles and segments in double precision, apart from any kernel's and any shape's own code.

use glam::DVec3;

/// Where the line `o + t d` crosses a triangle, edges included; None if it passes by, or lies in the plane.
///
/// By the signs of the three volumes that the line spans with the edges (Plücker). Two triangles see a shared edge with
/// volumes that are exact negatives of each other, so no line slips between them.
#[inline]
pub fn crossing(o: DVec3, d: DVec3, corners: [DVec3; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|p| p - o);
    let volumes = [d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a))];
    let mixed = volumes.iter().any(|v| *v < 0.0) && volumes.iter().any(|v| *v > 0.0);
    if mixed || volumes == [0.0; 3] {
        return None;
    }
    let n = (b - a).cross(c - a);
    let t = a.dot(n) / d.dot(n);
    t.is_finite().then_some(t)
}

/// How far the ray `o + t d`, t >= 0, passes from the segment `a`, `b`.
pub fn distance_to_segment(o: DVec3, d: DVec3, a: DVec3, b: DVec3) -> f64 {
    let d = d.normalize();
    // The part of a vector across the ray; behind the origin nothing is taken off.
    let across = |w: DVec3| w - d * d.dot(w).max(0.0);
    let (w, e) = (a - o, b - a);
    // Closest approach of the two lines, then clamped: exact for what lies ahead of the origin.
    let flat = e - d * d.dot(e);
    let s = (-(w - d * d.dot(w)).dot(flat) / flat.length_squared()).clamp(0.0, 1.0);
    let s = if s.is_nan() { 0.0 } else { s };
    [0.0, s, 1.0].into_iter().map(|s| across(w + e * s).length()).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_and_distances_by_hand() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let down = |x: f64, y: f64| crossing(DVec3::new(x, y, 2.0), -DVec3::Z, corners);
        assert_eq!([down(0.2, 0.2), down(0.0, 0.0), down(0.5, 0.5)], [Some(2.0); 3]);
        assert_eq!([down(0.6, 0.6), down(-0.1, 0.5)], [None; 2]);
        assert_eq!(crossing(DVec3::new(0.2, 0.2, -2.0), -DVec3::Z, corners), Some(-2.0), "the whole line");
        assert_eq!(crossing(-DVec3::X, DVec3::X, corners), None, "within the plane");
        let [a, b] = [DVec3::new(3.0, -1.0, 0.5), DVec3::new(3.0, 1.0, 0.5)];
        assert_eq!(distance_to_segment(DVec3::ZERO, DVec3::X * 2.0, a, b), 0.5);
        // Behind the origin it is the origin's own distance.
        assert_eq!(distance_to_segment(DVec3::ZERO, -DVec3::X, a, b), (9.25f64).sqrt());
    }
}
