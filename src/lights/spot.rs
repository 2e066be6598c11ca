//! A point that shines into a cone.

use crate::base::light::{EmitterBounds, Extent, Light, LightSample, LightSource, PathEnd, Receiver};
use crate::base::ray::MAX_COORDINATE;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::space::RenderSpace;
use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::math::aabb::Aabb;
use glam::{DVec3, Vec3};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const ROW: Row<dyn LightSource> = Row {
    kind: "spot",
    doc: "a point that shines into a cone, with a soft rim",
    params: &[
        ParamSpec { name: "position", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "direction",
            kind: ParamKind::Vector,
            default: Some("[0, -1, 0]"),
            doc: "the middle of the cone, away from the light, any length but 0",
        },
        ParamSpec {
            name: "look_at",
            kind: ParamKind::Vector,
            default: Some("[0, -1, 0]"),
            doc: "a point in the middle of the cone, metres; in place of `direction`",
        },
        ParamSpec {
            name: "intensity",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "radiant intensity in the middle, W/sr: irradiance at one metre",
        },
        ParamSpec {
            name: "cone_deg",
            kind: ParamKind::Number { min: 1e-3, max: 360.0 },
            default: Some("45"),
            doc: "angle from rim to rim; outside it is dark",
        },
        ParamSpec {
            name: "blend",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0.15"),
            doc: "width of the soft rim: 0 is hard, 1 falls off from the middle on",
        },
    ],
    build: |p| Ok(Arc::new(SpotSource::from_params(p)?)),
    samples: || {
        vec![
            Params::new().with("cone_deg", Value::Number(300.0)),
            Params::new()
                .with("position", Value::Numbers(vec![3.0, 3.0, -1.0]))
                .with("look_at", Value::Numbers(vec![0.0, 0.0, 0.0]))
                .with("intensity", Value::Numbers(vec![10.0, 0.0, 2.5]))
                .with("cone_deg", Value::Number(120.0))
                .with("blend", Value::Number(1.0)),
            Params::new()
                .with("position", Value::Numbers(vec![0.0, 9.0, 0.0]))
                .with("direction", Value::Numbers(vec![0.0, -0.1, 0.0]))
                .with("cone_deg", Value::Number(70.0))
                .with("blend", Value::Number(0.0)),
        ]
    },
};

/// The fall-off: with c the cosine to the axis and c0 that of the rim, intensity is scaled by smoothstep(t), t =
/// (c - c0) / (blend (1 - c0)): Blender's spot (Cycles, `spot_light_attenuation`), and pbrt-v4's with its fall-off
/// starting at the cosine c0 + blend (1 - c0). Kept as 1 - cosine, which loses no digits in narrow cones.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cone {
    /// Unit vector along the middle.
    axis: DVec3,
    /// 1 - cos of the rim, in (0, 2].
    m: f64,
    /// Share of `m` over which it falls off.
    blend: f64,
}

impl Cone {
    /// Share of the full intensity in the unit direction `w` away from the light, in [0, 1].
    #[inline]
    fn falloff(&self, w: DVec3) -> f64 {
        let inside = self.m - 0.5 * (w - self.axis).length_squared();
        let soft = self.blend * self.m;
        if inside >= soft {
            // Also the hard rim itself.
            return 1.0;
        }
        let t = (inside / soft).max(0.0);
        t * t * (3.0 - 2.0 * t)
    }

    /// The integral of [`Cone::falloff`] over all directions: the smooth step covers half of its width in cosine.
    fn solid_angle(&self) -> f64 {
        TAU * self.m * (1.0 - 0.5 * self.blend)
    }
}

struct SpotSource {
    position: DVec3,
    cone: Cone,
    intensity: Rgb,
}

impl SpotSource {
    fn from_params(p: &Params) -> Result<Self> {
        let vector = |name: &str, default| Ok::<_, Error>(DVec3::from_array(p.vector_or(name, default)?));
        let position = vector("position", [0.0; 3])?;
        let (name, direction) = match (p.get("look_at"), p.get("direction")) {
            (Some(_), Some(_)) => {
                return Err(p.error("look_at", "and `direction` say the same: give one of the two"));
            }
            (Some(_), None) => ("look_at", vector("look_at", [0.0; 3])? - position),
            _ => ("direction", vector("direction", [0.0, -1.0, 0.0])?),
        };
        // Scaled first: the length of a very long or short vector over- or underflows.
        let Some(axis) = (direction / direction.abs().max_element()).try_normalize() else {
            return Err(p.error(name, "gives no direction: it lies at the light itself, or too far away"));
        };
        let half = (0.5 * p.number_or("cone_deg", 45.0)?).clamp(0.0, 180.0).to_radians();
        let m = 2.0 * (0.5 * half).sin().powi(2);
        let blend = p.number_or("blend", 0.15)?.clamp(0.0, 1.0);
        let cone = Cone { axis, m, blend };
        Ok(SpotSource { position, cone, intensity: p.color_or("intensity", [1.0; 3])? })
    }
}

impl LightSource for SpotSource {
    fn place(&self, space: &RenderSpace) -> Result<Arc<dyn Light>> {
        let position = space.point(self.position).as_vec3();
        let intensity = self.intensity.map(|i| space.intensity(f64::from(i)) as f32);
        if !position.abs().cmple(Vec3::splat(MAX_COORDINATE)).all() || !intensity.is_finite() {
            return Err(Error::Usage(format!(
                "the spot light at {} lies too far from the scene, or is too bright, to be represented",
                self.position
            )));
        }
        Ok(Arc::new(SpotLight { position, cone: self.cone, intensity }))
    }
}

/// In render space.
struct SpotLight {
    position: Vec3,
    cone: Cone,
    intensity: Rgb,
}

impl SpotLight {
    /// Unit direction from `p` to the light, distance, and irradiance at normal incidence.
    #[inline]
    fn arriving_at(&self, p: Vec3) -> (DVec3, f64, Rgb) {
        let (wi, dist) = (self.position.as_dvec3() - p.as_dvec3()).normalize_and_length();
        let scale = self.cone.falloff(-wi) / (dist * dist);
        (wi, dist, self.intensity * scale as f32)
    }
}

impl Light for SpotLight {
    fn sample_li(&self, at: &Receiver, _u: [f32; 2]) -> Option<LightSample> {
        let (wi, dist, li) = self.arriving_at(at.p);
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

    fn power(&self, _extent: &Extent) -> f32 {
        self.cone.solid_angle() as f32 * self.intensity.luminance()
    }

    fn bounds(&self) -> Option<EmitterBounds> {
        Some(EmitterBounds {
            bounds: Aabb::new(self.position, self.position),
            axis: self.cone.axis.as_vec3(),
            cos_spread: (1.0 - self.cone.m) as f32,
            cos_reach: 1.0,
            two_sided: false,
            // Inside of its cone it is as bright as a lamp of this power that shines everywhere.
            power: 2.0 * TAU as f32 * self.intensity.luminance(),
        })
    }

    fn irradiance_closed_form(&self, p: Vec3, n: Vec3) -> Option<Rgb> {
        let (wi, _, li) = self.arriving_at(p);
        Some(li * n.as_dvec3().dot(wi).max(0.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::integrate_sphere;

    fn spot(cone_deg: f64, blend: f64) -> SpotSource {
        let p = Params::new()
            .with("position", Value::Numbers(vec![1.0, 2.0, 3.0]))
            .with("look_at", Value::Numbers(vec![0.0, 0.5, 2.0]))
            .with("intensity", Value::Number(3.0))
            .with("cone_deg", Value::Number(cone_deg))
            .with("blend", Value::Number(blend));
        SpotSource::from_params(&p).expect("is sound")
    }

    #[test]
    fn power_is_the_integral_of_what_leaves() {
        for (cone, blend) in
            [(20.0, 0.0), (45.0, 0.15), (120.0, 1.0), (180.0, 0.5), (360.0, 0.0), (360.0, 1.0)]
        {
            let s = spot(cone, blend);
            let light = s.place(&RenderSpace::IDENTITY).expect("places");
            let extent = Extent { center: Vec3::ZERO, radius: 1.0 };
            let integral = 3.0 * integrate_sphere(|w| s.cone.falloff(w), 1e-5);
            // Ten times the quadrature's tolerance across the hard rim, three times as bright.
            assert!((integral - f64::from(light.power(&extent))).abs() < 3e-4, "{cone} {blend}: {integral}");
        }
    }

    #[test]
    fn the_rim_is_where_it_was_asked_for() {
        let s = spot(40.0, 0.3);
        let across = s.cone.axis.any_orthonormal_vector();
        let at = |deg: f64| {
            let (sin, cos) = deg.to_radians().sin_cos();
            s.cone.falloff(s.cone.axis * cos + across * sin)
        };
        let rim = 20f64.to_radians().cos();
        let start = (rim + 0.3 * (1.0 - rim)).acos().to_degrees();
        let middle = (rim + 0.15 * (1.0 - rim)).acos().to_degrees();
        assert_eq!((at(0.0), at(start - 1e-6), at(20.0 + 1e-6)), (1.0, 1.0, 0.0));
        // f64 cosines of angles that an arc cosine gave.
        assert!((at(middle) - 0.5).abs() < 1e-9 && at(19.9) > 0.0 && at(19.9) < 0.01);
    }

    #[test]
    fn one_of_two_ways_to_aim_it_must_be_chosen() {
        let v = |x: [f64; 3]| Value::Numbers(x.to_vec());
        let error = |p: Params| SpotSource::from_params(&p).err().expect("is refused").to_string();
        let both = Params::new().with("look_at", v([1.0; 3])).with("direction", v([1.0; 3]));
        assert!(error(both).contains("one of the two"));
        let itself = Params::new().with("look_at", v([1.0; 3])).with("position", v([1.0; 3]));
        assert!(error(itself).contains("`look_at`: gives no direction"));
        assert!(error(Params::new().with("direction", v([0.0; 3]))).contains("`direction`"));
    }
}
