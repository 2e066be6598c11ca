//! What of a sky stands in world space: its turn about the upright axis, and its discs.

use crate::base::directions::Directions;
use crate::base::light::Receiver;
use crate::base::skybox::SkyDisc;
use crate::color::Rgb;
use crate::math::{Frame, simd};
use crate::sampling::warp;
use glam::{DVec3, Vec2, Vec3};

/// A rotation about +y.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    pub sin: f64,
    cos: f64,
}

impl Turn {
    /// None for whole turns.
    pub fn new(degrees: f64) -> Option<Self> {
        let d = degrees.rem_euclid(360.0);
        // Quarter turns are exact.
        let (sin, cos) = match d {
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            _ => d.to_radians().sin_cos(),
        };
        (d != 0.0).then_some(Turn { sin, cos })
    }

    #[inline(always)]
    pub fn to_world(self, d: DVec3) -> DVec3 {
        DVec3::new(d.x * self.cos + d.z * self.sin, d.y, d.z * self.cos - d.x * self.sin)
    }

    #[inline(always)]
    pub fn to_sky(self, d: DVec3) -> DVec3 {
        DVec3::new(d.x * self.cos - d.z * self.sin, d.y, d.z * self.cos + d.x * self.sin)
    }
}

/// A disc of the sky in world space.
pub(super) struct PlacedDisc {
    /// Its z points to the middle.
    pub frame: Frame,
    /// 1 - cos of its half angle.
    pub m: f32,
    /// Sine of its half angle.
    pub sin: f32,
    pub radiance: Rgb,
    /// Probability of sampling it where all discs are in sight.
    pub share: f64,
}

impl PlacedDisc {
    pub fn new(disc: &SkyDisc, turn: Option<Turn>, intensity: f32, share: f64) -> Self {
        let toward = turn.map_or(disc.toward, |t| t.to_world(disc.toward));
        PlacedDisc {
            frame: Frame::from_z(toward.as_vec3()),
            m: (2.0 * (0.5 * disc.half_angle).sin().powi(2)) as f32,
            sin: disc.half_angle.sin() as f32,
            radiance: disc.radiance * intensity,
            share,
        }
    }

    /// Whether a unit direction lies within, by the squared chord, which has digits where a cosine has none.
    #[inline(always)]
    pub fn contains(&self, w: Vec3) -> bool {
        (w - self.frame.n).length_squared() <= 2.0 * self.m
    }

    /// Adds it to the radiance of directions, one each.
    pub fn add_to(&self, w: Directions, out: &mut [Rgb]) {
        // Hardly ever does one of many directions meet it.
        if !simd::dispatch(AnyWithin { disc: self, w }) {
            return;
        }
        for (i, out) in out.iter_mut().enumerate() {
            if self.contains(w.get(i)) {
                *out += self.radiance;
            }
        }
    }

    /// Whether it reaches within `half_angle` of `axis`.
    pub fn meets(&self, axis: Vec3, half_angle: f32) -> bool {
        // Angles by half of the chord, which has digits where a cosine has none. Some roundings more rather than less.
        let angle = 2.0 * (0.5 * (axis - self.frame.n).length()).min(1.0).asin();
        let own = 2.0 * (0.5 * self.m).sqrt().min(1.0).asin();
        angle <= 1.001 * (half_angle + own)
    }

    /// Whether any of it is above the horizon of a receiver.
    #[inline(always)]
    pub fn in_sight(&self, at: &Receiver) -> bool {
        at.ng.dot(self.frame.n) >= -self.sin
    }

    pub fn sample(&self, u: Vec2) -> Vec3 {
        let w = self.frame.to_world(warp::uniform_cone(u, self.m)).normalize();
        if self.contains(w) {
            return w;
        }
        // Rounding carried it over the rim.
        w.lerp(self.frame.n, 1e-3).normalize()
    }
}

/// Whether a disc contains any of some directions: without branches, so that many are tested at once.
struct AnyWithin<'a> {
    disc: &'a PlacedDisc,
    w: Directions<'a>,
}

impl simd::Kernel for AnyWithin<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Directions { x, y, z } = self.w;
        let mut any = false;
        for ((&x, &y), &z) in x.iter().zip(y).zip(z) {
            any |= self.disc.contains(Vec3::new(x, y, z));
        }
        any
    }
}
