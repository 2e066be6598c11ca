//! Ambient occlusion: the cosine-weighted share of the hemisphere from which nothing near blocks.

use super::{CameraBatch, FirstHit, Integrator, PathResults, Workspace};
use crate::base::ray::{Coherence, Ray};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::color::Rgb;
use crate::sampler::ray_key;
use crate::sampler::{Dim, Slot};
use crate::sampling::warp::cosine_hemisphere;
use crate::scene::Scene;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "ao",
    doc: "ambient occlusion: the cosine-weighted share of open directions; misses are white",
    params: &[ParamSpec {
        name: "distance",
        kind: ParamKind::Number { min: 1e-30, max: 1e30 },
        default: Some("1e30"),
        doc: "how far away a blocker counts, metres",
    }],
    build: |p| Ok(Arc::new(AmbientOcclusion { distance: p.number_or("distance", 1e30)? })),
    samples: || vec![Params::new(), Params::new().with("distance", Value::Number(0.5))],
};

struct AmbientOcclusion {
    distance: f64,
}

impl Integrator for AmbientOcclusion {
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults) {
        let n = batch.rays.len();
        out.reset(n, batch.want_first);
        work.counts.camera += n as u64;
        scene.kernel.intersect_batch(&batch.rays, &mut work.hits, Coherence::Coherent);
        work.shadow.clear();
        work.indices.clear();
        let reach = (self.distance * scene.space.scale).min(f32::MAX as f64) as f32;
        for i in 0..n {
            let Some(hit) = work.hits.get(i) else {
                out.li[i] = Rgb::WHITE;
                continue;
            };
            let v = scene.vertex(&batch.rays.get(i), hit, batch.spread);
            out.alpha[i] = 1.0;
            if batch.want_first {
                out.first[i] = Some(FirstHit::new(scene, v));
            }
            let id = batch.ids.get(i);
            let u = id.sampler.get_2d(id.index, Dim::at(1, Slot::BsdfUv));
            let local = cosine_hemisphere(u.into());
            let side = if v.wo.dot(v.ng) >= 0.0 { 1.0 } else { -1.0 };
            let wi = v.frame.to_world(local * side);
            // A direction below the geometric surface is blocked by the surface itself.
            if v.is_consistent(wi) {
                let key = ray_key(id.key, id.index, 1);
                work.shadow.push(&Ray { tfar: reach, ..v.spawn(wi, key) });
                work.indices.push(i as u32);
            }
        }
        work.counts.shadow += work.shadow.len() as u64;
        scene.kernel.occluded_batch(&work.shadow, &mut work.blocked, Coherence::Incoherent);
        for (&i, blocked) in work.indices.iter().zip(&work.blocked) {
            if !blocked {
                out.li[i as usize] = Rgb::WHITE;
            }
        }
    }

    fn describe(&self) -> String {
        format!("ambient occlusion within {}", self.distance)
    }
}
