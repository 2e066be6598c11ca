//! Points on a quadric as seen from elsewhere.
//!
//! A sphere seen from outside is sampled uniformly in the cone of directions it fills (Shirley, Wang, Zimmerman,
//! "Monte Carlo Techniques for Direct Lighting Calculations", 1996), an ellipsoid nearly so (see [`super::tangent`]).
//! From inside, or so near that rounding hides that cone, a point w is taken uniformly from the unit sphere, or from the
//! cap of it that can be seen, which is where w . o >= 1 with o the viewer in the unit sphere's space. Its image under M has the density 1 / (C |N|) by area, with C the area of the cap and
//! N = det(M) M^-T w, whose length is the ratio of areas.

use super::tangent::TangentCone;
use super::{Ball, Quadric, uv};
use crate::base::shape::ShapeSample;
use crate::math::frame::Frame;
use crate::sampling::warp;
use glam::{DVec3, Vec2};
use std::f64::consts::TAU;

/// How a quadric is sampled from a point: a matter of that point alone, so that densities know it too.
enum Seen {
    /// A sphere from outside.
    Round(Cone),
    /// An ellipsoid from outside.
    Elliptic(TangentCone),
    /// An ellipsoid from very far: the even cone of its unit sphere, with this 1 - cos, carried over.
    Far(f64),
    /// By area, of the cap of the unit sphere with this 1 - cos.
    Cap(f64),
}

impl Seen {
    fn from(q: &Quadric, from: DVec3) -> Seen {
        let o = q.to_unit(from);
        let cone = match &q.ball {
            Some(b) => Cone::of(b, from).map(Seen::Round),
            None => TangentCone::new(&q.from_group, o).map(Seen::Elliptic),
        };
        cone.unwrap_or_else(|| match o.length() {
            r if r > FAR => Seen::Far(cone_m(1.0 / r)),
            _ => Seen::Cap(cap(o)),
        })
    }
}

/// Radii of the unit sphere. From here on |M d| is the same for all d to the ellipsoid, to within the aspect over this.
const FAR: f64 = 1e4;

/// 1 - cos of an angle with this sine, written so that no digit is lost for small angles.
fn cone_m(sin: f64) -> f64 {
    sin * sin / (1.0 + (1.0 - sin * sin).sqrt())
}

/// Density per solid angle of the direction `wi` (unit) whose map to the unit sphere's space is even in a cone of this
/// 1 - cos: a linear map A changes solid angles by |det A| / |A wi|^3.
fn far_pdf(q: &Quadric, m: f64, wi: DVec3) -> f64 {
    q.from_group.determinant().abs() / (TAU * m * (q.from_group * wi).length().powi(3))
}

/// See the module.
pub fn sample(q: &Quadric, from: DVec3, u: [f32; 2]) -> Option<ShapeSample> {
    let u = Vec2::from_array(u);
    let (w, pdf) = match Seen::from(q, from) {
        Seen::Round(cone) => (q.to_unit(cone.point(from, u)).normalize(), cone.pdf()),
        Seen::Elliptic(cone) => {
            let (d, pdf) = cone.sample(u);
            (near_crossing(q.to_unit(from), q.from_group * d), pdf)
        }
        Seen::Far(m) => {
            let o = q.to_unit(from);
            let d = around(-o.normalize(), m, u);
            (near_crossing(o, d), far_pdf(q, m, (q.to_group.matrix3 * d).normalize()))
        }
        Seen::Cap(m) => {
            let axis = q.to_unit(from).try_normalize().unwrap_or(DVec3::Z);
            let w = around(axis, m, u);
            let (wi, dist) = (q.to_group.transform_point3(w) - from).normalize_and_length();
            (w, area_pdf(q, m, dist * dist, wi, q.normal(w).normalize()))
        }
    };
    let p = q.to_group.transform_point3(w);
    let (wi, dist) = (p - from).normalize_and_length();
    let pdf = pdf as f32;
    (pdf > 0.0 && pdf.is_finite() && dist > 0.0).then(|| ShapeSample {
        p: p.as_vec3(),
        ng: q.normal(w).normalize().as_vec3(),
        uv: uv(w),
        wi: wi.as_vec3(),
        dist: dist as f32,
        pdf,
    })
}

/// Where the line from `o` along `d` enters the unit sphere; on its rim, where rounding carried it past.
fn near_crossing(o: DVec3, d: DVec3) -> DVec3 {
    let d = d.normalize();
    let half_chord = (1.0 - o.cross(d).length_squared()).max(0.0).sqrt();
    (o + d * (-o.dot(d) - half_chord)).normalize()
}

/// The density per solid angle with which [`sample`] takes the direction `wi` from `from` to `p` on the quadric,
/// where the unit normal is `ng`.
pub fn pdf(q: &Quadric, from: DVec3, wi: DVec3, p: DVec3, ng: DVec3) -> f32 {
    let pdf = match Seen::from(q, from) {
        Seen::Round(cone) => cone.pdf(),
        Seen::Elliptic(cone) => cone.pdf(wi),
        Seen::Far(m) => far_pdf(q, m, wi),
        Seen::Cap(m) => area_pdf(q, m, (p - from).length_squared(), wi, ng),
    };
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}

/// The cone that a sphere fills.
struct Cone {
    ball: Ball,
    /// Unit vector to the sphere's centre, and how far that is.
    axis: DVec3,
    distance: f64,
    /// 1 - cos of the cone's half angle.
    m: f64,
}

impl Cone {
    /// None from inside.
    fn of(ball: &Ball, from: DVec3) -> Option<Cone> {
        let (axis, distance) = (ball.center - from).normalize_and_length();
        let sin = ball.radius / distance;
        (distance > ball.radius).then(|| Cone { ball: *ball, axis, distance, m: cone_m(sin) })
    }

    fn pdf(&self) -> f64 {
        1.0 / (TAU * self.m)
    }

    /// The near crossing of a direction uniform in the cone.
    fn point(&self, from: DVec3, u: Vec2) -> DVec3 {
        let wi = around(self.axis, self.m, u);
        // The distance from the centre to the line of sight, squared: |c x wi|^2.
        let across = (self.axis * self.distance).cross(wi).length_squared();
        let half_chord = (self.ball.radius * self.ball.radius - across).max(0.0).sqrt();
        from + wi * (self.distance * self.axis.dot(wi) - half_chord)
    }
}

/// A direction uniform in the cone about `axis` with 1 - cos up to `m`, in (0, 2].
fn around(axis: DVec3, m: f64, u: Vec2) -> DVec3 {
    let d = warp::disk(u).as_dvec2();
    let h = m * d.length_squared().min(1.0);
    // sin^2 = h (2 - h), shared out along the point of the disc.
    let s = d * (m * (2.0 - h)).sqrt();
    let f = Frame::from_z(axis.as_vec3());
    // The f32 frame's rounding is taken out again by one step against the axis in double precision.
    let x = f.s.as_dvec3();
    let x = (x - axis * axis.dot(x)).normalize();
    x * s.x + axis.cross(x) * s.y + axis * (1.0 - h)
}

/// 1 - cos of the cap of the unit sphere that can be seen from `o`; the whole sphere from inside.
fn cap(o: DVec3) -> f64 {
    let r = o.length();
    if r > 1.0 { (r - 1.0) / r } else { 2.0 }
}

/// The density per solid angle of a point with this squared distance, direction and unit normal, uniform in the cap
/// `m` before the map: dist^2 / (cos |N| C). |N| = |det M| / |M^T n|, so that the point itself, which on a flat
/// quadric says little about w once it is rounded, does not enter.
fn area_pdf(q: &Quadric, m: f64, dist2: f64, wi: DVec3, ng: DVec3) -> f64 {
    let linear = &q.to_group.matrix3;
    let ratio = linear.determinant().abs() / (linear.transpose() * ng).length();
    dist2 / (wi.dot(ng).abs() * ratio * TAU * m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::aabb::DAabb;
    use crate::testing::TestRng;
    use glam::{DAffine3, DMat3};

    /// Needles and discs of aspect 1000, from far, near and inside: each sample knows its density, and 1 / pdf adds up to
    /// the solid angle that evenly spread rays measure.
    #[test]
    fn extreme_ellipsoids_are_sampled_by_what_is_seen_of_them() {
        let turn = DMat3::from_quat(glam::DQuat::from_scaled_axis(DVec3::new(0.3, -1.0, 0.7)));
        for axes in [[1.0, 1.0, 1e-3], [1e-3, 1e-3, 1.0], [1.0, 0.03, 1e-3], [2.0, 1.0, 0.5]] {
            let matrix3 = turn * DMat3::from_diagonal(DVec3::from(axes));
            let q = Quadric::new(DAffine3 { matrix3, translation: DVec3::ZERO }).expect("places");
            for o in
                [[0.2, -0.1, 0.3], [1.05, 0.3, 0.2], [0.1, 0.2, 3.0], [9.0, -4.0, 500.0], [1e6, 2e6, 1e5]]
            {
                let from = (matrix3 * DVec3::from(o)).as_vec3().as_dvec3();
                let mut rng = TestRng::new(5);
                let (mut sum, mut squares, n) = (0.0, 0.0, 20_000);
                for _ in 0..n {
                    let Some(s) = sample(&q, from, rng.vec2().to_array()) else { continue };
                    let weight = 1.0 / f64::from(s.pdf);
                    sum += weight;
                    squares += weight * weight;
                    let back = pdf(&q, from, s.wi.as_dvec3(), s.p.as_dvec3(), s.ng.as_dvec3());
                    // A direction in f32 as the map to the unit sphere, of aspect 1000, magnifies it; where it grazes,
                    // the normal that areas go by is off by as much over the cosine.
                    let cos = f64::from(s.wi.dot(s.ng).abs().max(1e-4));
                    let inside = DVec3::from(o).length() < 1.0;
                    let tolerance = if inside { 1e-4 + 1e-6 / cos } else { 5e-4 };
                    assert!(
                        (f64::from(back / s.pdf) - 1.0).abs() < tolerance,
                        "{axes:?} {o:?}: {back} {s:?}"
                    );
                }
                let (mean, count) = (sum / f64::from(n), f64::from(n));
                let sigma = ((squares / count - mean * mean).max(0.0) / count).sqrt();
                let measured = solid_angle(&q, from, &mut rng);
                let error = sigma.hypot(measured[1]);
                // By area from inside, a few samples carry most of the weight: the sum is no test there.
                let even = sigma < 0.05 * mean;
                assert!(
                    !even || (mean - measured[0]).abs() < 5.0 * error,
                    "{axes:?} {o:?}: {mean} {measured:?}"
                );
                assert!(even || DVec3::from(o).length() < 1.0, "{axes:?} {o:?}: {sigma} of {mean}");
            }
        }
    }

    /// Solid angle of a quadric and its standard error, by directions even on a box around it.
    fn solid_angle(q: &Quadric, from: DVec3, rng: &mut TestRng) -> [f64; 2] {
        if q.to_unit(from).length() < 1.0 {
            return [2.0 * TAU, 0.0];
        }
        let b = DAabb::from(q.bounds);
        let (axis, distance) = (b.center() - from).normalize_and_length();
        let sin = (b.size().length() / 2.0 / distance).min(1.0);
        let m = if sin < 1.0 { cone_m(sin) } else { 2.0 };
        let n = 200_000;
        let hit = |d: DVec3| {
            let (o, d) = (q.to_unit(from), (q.from_group * d).normalize());
            o.dot(d) < 0.0 && o.cross(d).length_squared() < 1.0
        };
        let hits = (0..n).filter(|_| hit(around(axis, m, rng.vec2()))).count() as f64;
        let share = hits / f64::from(n);
        // One hit more, so that none at all has an error too.
        let sigma = ((share * (1.0 - share)).max(1.0 / f64::from(n)) / f64::from(n)).sqrt();
        [TAU * m * share, TAU * m * sigma]
    }
}
