//! A camera for a mesh alone.

use super::perspective;
use crate::base::camera::FilmSize;
use crate::base::registry::{Node, Params, Value};
use crate::math::aabb::DAabb;
use glam::DVec3;

/// Which axis of the world is upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// +y; azimuth 0 looks from +z.
    #[default]
    Y,
    /// +z; azimuth 0 looks from -y.
    Z,
}

/// From where to look at a thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Degrees about the upright axis from the front, counter-clockwise seen from above: towards +x.
    pub azimuth_deg: f64,
    /// Degrees above the horizon; clamped to what leaves the picture upright.
    pub elevation_deg: f64,
    /// Vertical angle of view, degrees, in (0, 180).
    pub fov_deg: f64,
    /// Upright.
    pub up: UpAxis,
}

impl Default for View {
    /// Three quarters from the front and a little above, with the angle of a 50 mm lens.
    fn default() -> Self {
        View { azimuth_deg: 30.0, elevation_deg: 15.0, fov_deg: 35.0, up: UpAxis::Y }
    }
}

impl View {
    /// Unit vector from the thing to the eye, and the upright one.
    fn directions(&self) -> [DVec3; 2] {
        let (az, el) = (self.azimuth_deg.to_radians(), self.elevation_deg.clamp(-89.99, 89.99).to_radians());
        let (side, front, height) = (az.sin() * el.cos(), az.cos() * el.cos(), el.sin());
        match self.up {
            UpAxis::Y => [DVec3::new(side, height, front), DVec3::Y],
            UpAxis::Z => [DVec3::new(side, -front, height), DVec3::Z],
        }
    }
}

/// Part of the frame, at each border, that is left free.
const MARGIN: f64 = 0.05;

/// A perspective camera that sees all eight corners of `bounds` (of the unit box, if they are empty) in the middle
/// of the film and as large as fits, but for a small margin.
pub fn frame_bounds(bounds: &DAabb, view: &View, film: FilmSize) -> Node {
    frame(bounds, &|_| Vec::new(), view, film)
}

/// As [`frame_bounds`], for the thing itself rather than its bounds: `support` gives for each direction the largest
/// p . d of its points (see [`crate::base::shape::ShapeSource::support`]). What is not a finite number is taken from
/// the bounds.
pub fn frame(bounds: &DAabb, support: &dyn Fn(&[DVec3]) -> Vec<f64>, view: &View, film: FilmSize) -> Node {
    let unit = DAabb::new(DVec3::splat(-0.5), DVec3::splat(0.5));
    let bounds = if bounds.is_finite() { bounds } else { &unit };
    let center = bounds.center();
    let [to_eye, up] = view.directions();
    let forward = -to_eye;
    let right = forward.cross(up).normalize();
    let upright = right.cross(forward);
    let tan = (0.5 * view.fov_deg).to_radians().tan() * (1.0 - 2.0 * MARGIN);
    let (tan_x, tan_y) = (tan * film.aspect(), tan);
    // The frustum's planes: right and left, top and bottom.
    let planes = [
        right - forward * tan_x,
        -right - forward * tan_x,
        upright - forward * tan_y,
        -upright - forward * tan_y,
    ];
    let exact = support(&planes);
    let corners = bounds.corners();
    let reach: [f64; 4] = std::array::from_fn(|k| {
        let by_bounds = corners.iter().fold(f64::NEG_INFINITY, |a, c| a.max((*c - center).dot(planes[k])));
        match exact.get(k) {
            Some(r) if r.is_finite() => (r - center.dot(planes[k])).min(by_bounds),
            _ => by_bounds,
        }
    });
    let across = fit(reach[0], reach[1], tan_x);
    let along = fit(reach[2], reach[3], tan_y);
    // A thing without extent is seen from one unit; any other from outside of the sphere around it.
    let radius = bounds.radius();
    let least = if radius > 0.0 { 1.02 * radius } else { 1.0 };
    let depth = across.depth.min(along.depth).min(-least);
    let middle = center + right * across.offset + upright * along.offset;
    let v = |p: DVec3| Value::Numbers(p.to_array().to_vec());
    let params = Params::new()
        .with("eye", v(middle + forward * depth))
        .with("look_at", v(middle))
        .with("up", v(up))
        .with("fov_deg", Value::Number(view.fov_deg));
    Node { kind: perspective::ROW.kind.to_owned(), params, ..Node::default() }
}

/// How far back, and how far to the side, the eye must stand for one axis of the film.
struct Fit {
    depth: f64,
    offset: f64,
}

/// The frustum's two planes of one axis, pushed against the points: the eye (s, f) must have |c_s - s| <=
/// tan (c_f - f) for each point (c_s, c_f). `high` and `low` are the largest c_s - tan c_f and -c_s - tan c_f.
fn fit(high: f64, low: f64, tan: f64) -> Fit {
    Fit { depth: (-low - high) / (2.0 * tan), offset: (high - low) * 0.5 }
}
