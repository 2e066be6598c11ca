//! A point that shines alike in all directions.

use crate::base::light::{EmitterBounds, Extent, Light, LightSample, LightSource, PathEnd, Receiver};
use crate::base::ray::MAX_COORDINATE;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::space::RenderSpace;
use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::math::aabb::Aabb;
use glam::{DVec3, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

pub(super) const ROW: Row<dyn LightSource> = Row {
    kind: "point",
    doc: "a point that shines alike in all directions",
    params: &[
        ParamSpec { name: "position", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "intensity",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "radiant intensity, W/sr: irradiance at one metre",
        },
        ParamSpec {
            name: "attenuation",
            kind: ParamKind::Vector,
            default: Some("[0, 0, 1]"),
            doc: "[c, l, q]: intensity / (c + l d + q d^2) arrives at d metres; light has [0, 0, 1]",
        },
    ],
    build: |p| {
        let attenuation = p.vector_or("attenuation", INVERSE_SQUARE)?;
        if attenuation.iter().any(|a| *a < 0.0) || attenuation == [0.0; 3] {
            return Err(p.error("attenuation", "takes numbers of at least 0, one of them more"));
        }
        Ok(Arc::new(PointSource {
            position: DVec3::from_array(p.vector_or("position", [0.0; 3])?),
            intensity: p.color_or("intensity", [1.0; 3])?,
            attenuation,
        }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("position", Value::Numbers(vec![3.0, 3.0, -1.0]))
                .with("intensity", Value::Numbers(vec![10.0, 0.0, 2.5])),
            Params::new()
                .with("position", Value::Numbers(vec![0.0, 2.0, 0.0]))
                .with("attenuation", Value::Numbers(vec![0.5, 0.25, 2.0])),
            Params::new().with("attenuation", Value::Numbers(vec![1.0, 0.0, 0.0])),
        ]
    },
};

/// How light falls off with distance: as [c, l, q] of the row.
const INVERSE_SQUARE: [f64; 3] = [0.0, 0.0, 1.0];

struct PointSource {
    position: DVec3,
    intensity: Rgb,
    attenuation: [f64; 3],
}

impl LightSource for PointSource {
    fn place(&self, space: &RenderSpace) -> Result<Arc<dyn Light>> {
        let position = space.point(self.position).as_vec3();
        let intensity = self.intensity.map(|i| space.intensity(f64::from(i)) as f32);
        if !position.abs().cmple(Vec3::splat(MAX_COORDINATE)).all() || !intensity.is_finite() {
            return Err(Error::Usage(format!(
                "the point light at {} lies too far from the scene, or is too bright, to be represented",
                self.position
            )));
        }
        // By distances in render units, and over an intensity in render units: both have the square of the scale.
        let [c, l, q] = self.attenuation;
        let attenuation = [c * space.scale * space.scale, l * space.scale, q];
        Ok(Arc::new(PointLight { position, intensity, attenuation }))
    }
}

/// In render space.
struct PointLight {
    position: Vec3,
    intensity: Rgb,
    attenuation: [f64; 3],
}

impl PointLight {
    /// What the intensity is divided by at this distance.
    #[inline]
    fn attenuation(&self, dist: f64) -> f64 {
        let [c, l, q] = self.attenuation;
        c + l * dist + q * (dist * dist)
    }
}

impl Light for PointLight {
    fn sample_li(&self, at: &Receiver, _u: [f32; 2]) -> Option<LightSample> {
        let (wi, dist) = (self.position.as_dvec3() - at.p.as_dvec3()).normalize_and_length();
        let li = self.intensity * (1.0 / self.attenuation(dist)) as f32;
        // At the light itself there is no direction to it.
        (dist > 0.0 && li.is_finite() && !li.is_black()).then(|| LightSample {
            wi: wi.as_vec3(),
            dist: dist as f32,
            li: Some(li),
            pdf: 1.0,
            delta: true,
        })
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn is_black(&self) -> bool {
        self.intensity.is_black()
    }

    fn pdf_li(&self, _at: &Receiver, _end: &PathEnd) -> f32 {
        0.0
    }

    fn le(&self, _end: &PathEnd) -> Rgb {
        Rgb::BLACK
    }

    fn power(&self, extent: &Extent) -> f32 {
        // Of the lamp with the inverse square that is as bright at the scene's radius: all there is for other laws.
        let r = f64::from(extent.radius);
        4.0 * PI * self.intensity.luminance() * (r * r / self.attenuation(r)) as f32
    }

    fn bounds(&self) -> Option<EmitterBounds> {
        Some(EmitterBounds {
            bounds: Aabb::new(self.position, self.position),
            axis: Vec3::Z,
            cos_spread: -1.0,
            cos_reach: 0.0,
            two_sided: false,
            // As if by the inverse square: of another law this is true at the distance 1, about the size of a scene in render space.
            power: 4.0 * PI * self.intensity.luminance() / self.attenuation(1.0) as f32,
        })
    }

    fn irradiance_closed_form(&self, p: Vec3, n: Vec3) -> Option<Rgb> {
        let to = self.position - p;
        let dist = to.length();
        Some(self.intensity * (n.dot(to).max(0.0) / dist / self.attenuation(f64::from(dist)) as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attenuation_goes_by_metres() {
        let space = RenderSpace { center: DVec3::new(5.0, 0.0, 0.0), scale: 0.05 };
        let p = Params::new()
            .with("intensity", Value::Number(12.0))
            .with("attenuation", Value::Numbers(vec![1.0, 0.5, 0.25]));
        let light = (ROW.build)(&p).expect("builds").place(&space).expect("places");
        let at = |d: f64| {
            let p = space.point(DVec3::new(0.0, 0.0, d)).as_vec3();
            let at = Receiver { p, ng: Vec3::ZERO, ns: Vec3::ZERO };
            light.sample_li(&at, [0.0; 2]).expect("arrives").li.expect("known").r
        };
        for d in [0.5, 4.0, 30.0] {
            let expected = 12.0 / (1.0 + 0.5 * d + 0.25 * d * d);
            // Coordinates of size 0.25 in f32 for distances of 0.025.
            assert!((f64::from(at(d)) / expected - 1.0).abs() < 1e-5, "{d}: {}", at(d));
        }
    }

    #[test]
    fn no_attenuation_and_negative_ones_are_refused() {
        for a in [[0.0; 3], [-0.1, 0.0, 1.0], [0.0, 0.0, -1.0]] {
            let p = Params::new().with("attenuation", Value::Numbers(a.to_vec()));
            let error = (ROW.build)(&p).err().expect("is refused").to_string();
            assert!(error.contains("`attenuation`"), "{error}");
        }
    }
}
