//! A camera that sees in all directions: the picture is a sphere map.

use crate::base::camera::{Camera, CameraSource, FilmSamples, FilmSize};
use crate::base::ray::{MAX_COORDINATE, RayBatch};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::space::RenderSpace;
use crate::error::{Error, Result};
use crate::math::simd::{Kernel, dispatch};
use crate::math::trig::sin_cos_2pi;
use glam::{DVec3, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn CameraSource> = Row {
    kind: "equirectangular",
    doc: "all directions around a point, as the sky `sphere` reads them: the middle column looks along +x",
    params: &[ParamSpec {
        name: "eye",
        kind: ParamKind::Vector,
        default: Some("[0, 0, 0]"),
        doc: "where it stands, metres",
    }],
    build: |p| Ok(Arc::new(EquirectangularSource { eye: DVec3::from_array(p.vector_or("eye", [0.0; 3])?) })),
    samples: || {
        let far = Params::new().with("eye", Value::Numbers(vec![4e6, 1.0, -2.0]));
        vec![Params::new(), far]
    },
};

/// The camera in world space.
struct EquirectangularSource {
    eye: DVec3,
}

impl CameraSource for EquirectangularSource {
    fn place(&self, space: &RenderSpace, film: FilmSize) -> Result<Arc<dyn Camera>> {
        let eye = space.point(self.eye).as_vec3();
        if !eye.abs().cmple(Vec3::splat(MAX_COORDINATE)).all() {
            let message =
                format!("the camera's eye {} lies too far from the scene to be represented", self.eye);
            return Err(Error::Usage(message));
        }
        Ok(Arc::new(Equirectangular {
            eye,
            turns: 1.0 / film.width as f32,
            half_turns: 0.5 / film.height as f32,
        }))
    }
}

/// The camera in render space, whose axes are those of the world.
#[derive(Debug, Clone, Copy)]
struct Equirectangular {
    eye: Vec3,
    /// Turns by pixel across.
    turns: f32,
    /// Turns by pixel down.
    half_turns: f32,
}

impl Camera for Equirectangular {
    fn fill_rays(&self, samples: &FilmSamples, rays: &mut RayBatch) {
        rays.resize(samples.x.len());
        rays.tnear.fill(0.0);
        rays.tfar.fill(f32::INFINITY);
        rays.ox.fill(self.eye.x);
        rays.oy.fill(self.eye.y);
        rays.oz.fill(self.eye.z);
        dispatch(Fill { camera: self, samples, rays });
    }

    fn pixel_spread(&self) -> f32 {
        2.0 * PI * self.half_turns
    }
}

struct Fill<'a> {
    camera: &'a Equirectangular,
    samples: &'a FilmSamples<'a>,
    rays: &'a mut RayBatch,
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let c = *self.camera;
        let n = self.samples.x.len();
        let (x, y) = (&self.samples.x[..n], &self.samples.y[..n]);
        let r = self.rays;
        let (dx, dy, dz) = (&mut r.dx[..n], &mut r.dy[..n], &mut r.dz[..n]);
        for i in 0..n {
            // u = 0.5 + atan2(z, x) / 2 pi; a filter may reach past the poles, where the other side is seen.
            let azimuth = sin_cos_2pi(x[i] * c.turns - 0.5);
            let polar = sin_cos_2pi(y[i] * c.half_turns);
            let d = Vec3::new(polar.sin * azimuth.cos, polar.cos, polar.sin * azimuth.sin);
            // Sine and cosine are good to 1.2e-7, squares and sums less.
            let inv = 1.0 / d.length_squared().sqrt();
            (dx[i], dy[i], dz[i]) = (d.x * inv, d.y * inv, d.z * inv);
        }
    }
}
