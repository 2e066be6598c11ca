//! Direct light in closed form: what each surface scatters evenly, times the irradiance that lights know in closed
//! form. No shadows and no noise, so it is the oracle for integrators that sample the same lights.

use super::escapes::Escapes;
use super::{CameraBatch, FirstHit, Integrator, PathResults, Workspace};
use crate::base::light::PathEnd;
use crate::base::material::Prepared;
use crate::base::ray::Coherence;
use crate::base::registry::{Params, Row};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::scene::Scene;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "analytic",
    doc: "diffuse light straight from lights with a closed form (polygons, points, parallel light), without shadows",
    params: &[],
    build: |_| Ok(Arc::new(Analytic)),
    samples: || vec![Params::new()],
};

struct Analytic;

impl Integrator for Analytic {
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults) {
        let n = batch.rays.len();
        out.reset(n, batch.want_first);
        work.counts.camera += n as u64;
        scene.kernel.intersect_batch(&batch.rays, &mut work.hits, Coherence::Coherent);
        let mut escapes = Escapes::default();
        for i in 0..n {
            let Some(hit) = work.hits.get(i) else {
                escapes.push(i as u32, batch.rays.direction(i));
                continue;
            };
            let v = scene.vertex(&batch.rays.get(i), hit, batch.spread);
            out.alpha[i] = 1.0;
            out.li[i] = shade(scene, &v);
            if batch.want_first {
                out.first[i] = Some(FirstHit::new(scene, v));
            }
        }
        escapes.add_background(scene, &mut out.li);
    }

    fn describe(&self) -> String {
        "direct light in closed form".into()
    }
}

/// Radiance towards the viewer.
fn shade(scene: &Scene, v: &Vertex) -> Rgb {
    let material = scene.material(v);
    let mut prepared = Prepared::default();
    material.prepare(v, &mut prepared);
    let mut sum = material.ambient(&prepared);
    let own = scene.lights.of_vertex(v);
    if let Some(light) = own {
        sum += scene.lights.list[light as usize].le(&PathEnd { wi: -v.wo, vertex: Some(v) });
    }
    let diffuse = material.diffuse(&prepared) * FRAC_1_PI;
    if diffuse.is_black() {
        return sum;
    }
    let at = v.receiver();
    for light in &scene.lights.list {
        if let Some(irradiance) = light.irradiance_closed_form(at.p, at.ns) {
            sum += diffuse * irradiance;
        }
    }
    sum
}
