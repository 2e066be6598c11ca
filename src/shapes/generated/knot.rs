//! A rope tied into a torus knot.

use super::{Generated, Grid, GridVertex, TRIANGLES, integer, triangles};
use crate::base::mesh_data::MeshData;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use crate::math::trig::sin_cos_2pi_f64;
use glam::DVec3;
use std::f64::consts::TAU;

const TURNS: ParamSpec = ParamSpec {
    name: "turns",
    kind: ParamKind::Integer { min: 1, max: 40 },
    default: Some("2"),
    doc: "how often it runs around the torus",
};

const COILS: ParamSpec = ParamSpec {
    name: "coils",
    kind: ParamKind::Integer { min: 1, max: 40 },
    default: Some("3"),
    doc: "how often it winds through the hole meanwhile; without a factor in common with `turns`",
};

const STRANDS: ParamSpec = ParamSpec {
    name: "strands",
    kind: ParamKind::Integer { min: 0, max: 40 },
    default: Some("5"),
    doc: "of the rope; 0 is a smooth tube",
};

const TWIST: ParamSpec = ParamSpec {
    name: "twist",
    kind: ParamKind::Integer { min: -1000, max: 1000 },
    default: Some("9"),
    doc: "how often the strands turn about the rope over its whole length",
};

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "knot",
    doc: "a rope tied into a torus knot about +y, of radius 1 to its middle, made in code",
    params: &[
        TRIANGLES,
        TURNS,
        COILS,
        STRANDS,
        TWIST,
        ParamSpec {
            name: "radius",
            kind: ParamKind::Number { min: 0.001, max: 0.5 },
            default: Some("0.24"),
            doc: "of the rope",
        },
    ],
    build: |p| {
        let radius = p.number_or("radius", 0.24)?;
        let twist = p.number_or("twist", 9.0)?;
        if !(0.001..=0.5).contains(&radius) || twist.abs() > 1000.0 {
            return Err(p.error("radius", "or `twist` is out of range"));
        }
        let (turns, coils) = (integer(p, &TURNS, 2.0)?, integer(p, &COILS, 3.0)?);
        if (2..=turns.min(coils)).any(|k| turns % k == 0 && coils % k == 0) {
            return Err(p.error("coils", format!("{coils} has a factor in common with `turns` = {turns}")));
        }
        let triangles = f64::from(triangles(p)?);
        let rope = Rope {
            turns: f64::from(turns),
            coils: f64::from(coils),
            strands: f64::from(integer(p, &STRANDS, 5.0)?),
            twist: twist.round(),
            radius,
        };
        Ok(Generated::source("knot", move || rope.mesh(triangles)))
    },
    samples: || {
        vec![
            Params::new().with("triangles", Value::Number(600.0)),
            Params::new()
                .with("triangles", Value::Number(300.0))
                .with("turns", Value::Number(1.0))
                .with("coils", Value::Number(2.0))
                .with("strands", Value::Number(0.0)),
        ]
    },
};

struct Rope {
    turns: f64,
    coils: f64,
    strands: f64,
    twist: f64,
    radius: f64,
}

/// Radius of the torus' tube, that of its middle circle being 1.
const TORUS: f64 = 0.45;

impl Rope {
    /// A point of the surface: `s` runs along the rope and `t` around it, both in turns.
    fn at(&self, s: f64, t: f64) -> DVec3 {
        let (p, q) = (sin_cos_2pi_f64(self.turns * s), sin_cos_2pi_f64(self.coils * s));
        let ring = 1.0 + TORUS * q.cos;
        let middle = DVec3::new(ring * p.cos, TORUS * q.sin, ring * p.sin);
        // Across the rope: the torus' normal, and what is perpendicular to it and to the way on.
        let normal = DVec3::new(q.cos * p.cos, q.sin, q.cos * p.sin);
        let around = DVec3::new(-p.sin, 0.0, p.cos) * (self.turns * ring);
        let through = DVec3::new(-q.sin * p.cos, q.cos, -q.sin * p.sin) * (self.coils * TORUS);
        let side = (around + through).normalize().cross(normal);
        let turn = sin_cos_2pi_f64(t);
        middle + (normal * turn.cos + side * turn.sin) * (self.radius * self.profile(s, t))
    }

    /// Distance of the surface from the rope's middle, in radii: strands are arcs with grooves between them, and
    /// fibres run along the strands.
    fn profile(&self, s: f64, t: f64) -> f64 {
        if self.strands == 0.0 {
            return 1.0;
        }
        let phase = self.strands * t + self.twist * s;
        // |cos| has corners in the grooves; rounded a little, so that the surface has a normal there.
        let c = sin_cos_2pi_f64(0.5 * phase).cos;
        let arc = (c * c + 0.015).sqrt();
        let fibre = sin_cos_2pi_f64(6.0 * phase - 8.0 * self.twist * s).cos;
        0.72 + 0.28 * arc.min(1.0) + 0.012 * fibre * arc
    }

    fn mesh(&self, triangles: f64) -> MeshData {
        // Cells about as long as they are wide.
        let steps = 512;
        let point = |k: usize| self.at(k as f64 / steps as f64, 0.0);
        let length: f64 = (0..steps).map(|k| (point(k + 1) - point(k)).length()).sum();
        let ratio = length / (TAU * self.radius);
        let across = ((triangles / 2.0 / ratio).sqrt().round() as usize).max(6);
        let along = ((triangles / 2.0 / across as f64).round() as usize).max(6);
        let grid = Grid { patches: 1, across, along, closed: true };
        grid.mesh(|_, i, j| {
            let (t, s) = (i as f64 / across as f64, j as f64 / along as f64);
            // Differences over a small part of a turn: of a smooth function in double precision, good to 1e-8.
            const H: f64 = 1e-5;
            let ds = self.at(s + H, t) - self.at(s - H, t);
            let dt = self.at(s, t + H) - self.at(s, t - H);
            GridVertex { p: self.at(s, t), n: dt.cross(ds) }
        })
    }
}
