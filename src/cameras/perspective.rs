//! A pinhole or thin-lens camera.

use crate::base::camera::{Camera, CameraSource, FilmSamples, FilmSize, Projection};
use crate::base::ray::{MAX_COORDINATE, RayBatch};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::space::RenderSpace;
use crate::error::{Error, Result};
use crate::math::simd::{Kernel, dispatch};
use crate::sampling::warp;
use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn CameraSource> = Row {
    kind: "perspective",
    doc: "a pinhole, or a thin lens if `aperture` is not 0",
    params: &[
        ParamSpec { name: "eye", kind: ParamKind::Vector, default: None, doc: "where it stands, metres" },
        ParamSpec {
            name: "look_at",
            kind: ParamKind::Vector,
            default: Some("[0, 0, 0]"),
            doc: "the point in the middle of the picture",
        },
        ParamSpec {
            name: "up",
            kind: ParamKind::Vector,
            default: Some("[0, 1, 0]"),
            doc: "a direction that is upright in the picture",
        },
        ParamSpec {
            name: "fov_deg",
            kind: ParamKind::Number { min: 0.001, max: 179.0 },
            default: Some("60"),
            doc: "vertical angle of view",
        },
        ParamSpec {
            name: "aperture",
            kind: ParamKind::Number { min: 0.0, max: 1e12 },
            default: Some("0"),
            doc: "radius of the lens, metres; 0 is a pinhole",
        },
        ParamSpec {
            name: "focus_distance",
            kind: ParamKind::Number { min: 0.0, max: 1e30 },
            default: Some("0"),
            doc: "distance along the line of sight that is sharp, metres; 0 takes that of `look_at`",
        },
    ],
    build: |p| Ok(Arc::new(PerspectiveSource::from_params(p)?)),
    samples: || {
        let v = |x: f64, y: f64, z: f64| Value::Numbers(vec![x, y, z]);
        let near = Params::new().with("eye", v(5.0, 0.0, 0.0)).with("fov_deg", Value::Number(40.0));
        let far = Params::new().with("eye", v(4e6, 2.0, -1.0)).with("look_at", v(4e6, 0.5, 3.0));
        let lens = near.clone().with("aperture", Value::Number(0.1));
        vec![near, far, lens.clone().with("focus_distance", Value::Number(3.0)), lens]
    },
};

/// A perspective camera in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerspectiveSource {
    eye: DVec3,
    /// Unit vectors: to the right, upwards, forwards.
    axes: [DVec3; 3],
    /// Tangent of half of the vertical angle of view.
    tan_half: f64,
    lens_radius: f64,
    focus_distance: f64,
}

impl PerspectiveSource {
    fn from_params(p: &Params) -> Result<Self> {
        let eye = DVec3::from_array(p.vector("eye")?);
        let look_at = DVec3::from_array(p.vector_or("look_at", [0.0; 3])?);
        let up = DVec3::from_array(p.vector_or("up", [0.0, 1.0, 0.0])?);
        let fov = p.number_or("fov_deg", 60.0)?;
        if !(fov > 0.0 && fov < 180.0) {
            return Err(p.error("fov_deg", format!("{fov} is outside (0, 180)")));
        }
        let Some(forward) = (look_at - eye).try_normalize() else {
            return Err(p.error("look_at", "is the same point as `eye`: there is no direction to look in"));
        };
        let Some(up) = up.try_normalize() else {
            return Err(p.error("up", "must not be zero"));
        };
        let right = forward.cross(up);
        // Below this the picture's roll is decided by rounding.
        if right.length() < 1e-7 {
            return Err(p.error("up", "is parallel to the line of sight; choose another direction"));
        }
        let right = right.normalize();
        let focus_distance = match p.number_or("focus_distance", 0.0)? {
            0.0 => (look_at - eye).length(),
            d => d,
        };
        let lens_radius = p.number_or("aperture", 0.0)?;
        if lens_radius < 0.0 || focus_distance < 0.0 {
            return Err(p.error("aperture", "and `focus_distance` must not be negative"));
        }
        Ok(PerspectiveSource {
            eye,
            axes: [right, right.cross(forward), forward],
            tan_half: (0.5 * fov).to_radians().tan(),
            lens_radius,
            focus_distance,
        })
    }
}

impl CameraSource for PerspectiveSource {
    fn place(&self, space: &RenderSpace, film: FilmSize) -> Result<Arc<dyn Camera>> {
        let eye = space.point(self.eye).as_vec3();
        if !eye.abs().cmple(Vec3::splat(MAX_COORDINATE)).all() {
            return Err(Error::Usage(format!(
                "the camera's eye {} lies too far from the scene to be represented",
                self.eye
            )));
        }
        let [right, up, forward] = self.axes;
        let pixel = 2.0 * self.tan_half / f64::from(film.height);
        // An ideal thin lens: all rays through a point of the plane in focus meet there, so the lens offset is taken
        // off the direction in proportion to 1 / focus distance.
        let radius = space.length(self.lens_radius);
        let shear = -self.lens_radius / self.focus_distance;
        Ok(Arc::new(Perspective {
            eye,
            middle: Vec2::new(film.width as f32, film.height as f32) * 0.5,
            dx: (right * pixel).as_vec3(),
            dy: (-up * pixel).as_vec3(),
            forward: forward.as_vec3(),
            lens: (self.lens_radius > 0.0).then(|| Lens {
                u: (right * radius).as_vec3(),
                v: (up * radius).as_vec3(),
                shear_u: (right * shear).as_vec3(),
                shear_v: (up * shear).as_vec3(),
            }),
            pixel_spread: pixel as f32,
        }))
    }
}

/// A perspective camera in render space.
#[derive(Debug, Clone, Copy)]
struct Perspective {
    eye: Vec3,
    /// Middle of the film, pixels.
    middle: Vec2,
    /// Change of the direction by pixel to the right and down, where its part along `forward` is 1.
    dx: Vec3,
    dy: Vec3,
    forward: Vec3,
    lens: Option<Lens>,
    pixel_spread: f32,
}

#[derive(Debug, Clone, Copy)]
struct Lens {
    /// Radius times the axes.
    u: Vec3,
    v: Vec3,
    /// What a unit of lens coordinates adds to a direction whose part along `forward` is 1.
    shear_u: Vec3,
    shear_v: Vec3,
}

impl Camera for Perspective {
    fn fill_rays(&self, samples: &FilmSamples, rays: &mut RayBatch) {
        let n = samples.x.len();
        rays.resize(n);
        rays.tnear.fill(0.0);
        rays.tfar.fill(f32::INFINITY);
        match &self.lens {
            None => {
                rays.ox.fill(self.eye.x);
                rays.oy.fill(self.eye.y);
                rays.oz.fill(self.eye.z);
                dispatch(Pinhole { camera: self, samples, rays });
            }
            Some(lens) => dispatch(ThinLens { camera: self, lens, samples, rays }),
        }
    }

    fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    fn projection(&self) -> Option<Projection> {
        // Of what rays are made of: rounded to f32.
        let [eye, forward, dx, dy] = [self.eye, self.forward, self.dx, self.dy].map(Vec3::as_dvec3);
        let middle = self.middle.to_array().map(f64::from);
        self.lens.is_none().then_some(Projection { eye, forward, steps: [dx, dy], middle })
    }

    fn pixel_spread(&self) -> f32 {
        self.pixel_spread
    }
}

struct Pinhole<'a> {
    camera: &'a Perspective,
    samples: &'a FilmSamples<'a>,
    rays: &'a mut RayBatch,
}

impl Kernel for Pinhole<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let c = *self.camera;
        // Slices of one length need no further checks in the loop.
        let n = self.samples.x.len();
        let (x, y) = (&self.samples.x[..n], &self.samples.y[..n]);
        let r = self.rays;
        let (dx, dy, dz) = (&mut r.dx[..n], &mut r.dy[..n], &mut r.dz[..n]);
        for i in 0..n {
            let (px, py) = (x[i] - c.middle.x, y[i] - c.middle.y);
            let d = c.forward + px * c.dx + py * c.dy;
            let inv = 1.0 / d.length_squared().sqrt();
            (dx[i], dy[i], dz[i]) = (d.x * inv, d.y * inv, d.z * inv);
        }
    }
}

struct ThinLens<'a> {
    camera: &'a Perspective,
    lens: &'a Lens,
    samples: &'a FilmSamples<'a>,
    rays: &'a mut RayBatch,
}

impl Kernel for ThinLens<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (c, lens) = (*self.camera, *self.lens);
        let n = self.samples.x.len();
        let (x, y) = (&self.samples.x[..n], &self.samples.y[..n]);
        let (lu, lv) = (&self.samples.lens_u[..n], &self.samples.lens_v[..n]);
        let r = self.rays;
        let (ox, oy, oz) = (&mut r.ox[..n], &mut r.oy[..n], &mut r.oz[..n]);
        let (dx, dy, dz) = (&mut r.dx[..n], &mut r.dy[..n], &mut r.dz[..n]);
        for i in 0..n {
            let (px, py) = (x[i] - c.middle.x, y[i] - c.middle.y);
            let l = warp::disk(Vec2::new(lu[i], lv[i]));
            let d = c.forward + px * c.dx + py * c.dy + l.x * lens.shear_u + l.y * lens.shear_v;
            let o = c.eye + l.x * lens.u + l.y * lens.v;
            let inv = 1.0 / d.length_squared().sqrt();
            (ox[i], oy[i], oz[i]) = (o.x, o.y, o.z);
            (dx[i], dy[i], dz[i]) = (d.x * inv, d.y * inv, d.z * inv);
        }
    }
}
