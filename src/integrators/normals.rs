//! Shading normals as colours, for looking at geometry.

use super::{CameraBatch, FirstHit, Integrator, PathResults, Workspace};
use crate::base::ray::Coherence;
use crate::base::registry::{Params, Row};
use crate::color::Rgb;
use crate::scene::Scene;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "normals",
    doc: "unit shading normals n towards the viewer's side, shown as (n + 1) / 2; misses are black",
    params: &[],
    build: |_| Ok(Arc::new(Normals)),
    samples: || vec![Params::new()],
};

struct Normals;

impl Integrator for Normals {
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults) {
        let n = batch.rays.len();
        out.reset(n, batch.want_first);
        work.counts.camera += n as u64;
        scene.kernel.intersect_batch(&batch.rays, &mut work.hits, Coherence::Coherent);
        for i in 0..n {
            let Some(hit) = work.hits.get(i) else { continue };
            let v = scene.vertex(&batch.rays.get(i), hit, batch.spread);
            let c = v.receiver().ns * 0.5 + 0.5;
            out.li[i] = Rgb::new(c.x, c.y, c.z);
            out.alpha[i] = 1.0;
            if batch.want_first {
                out.first[i] = Some(FirstHit::new(scene, v));
            }
        }
    }

    fn describe(&self) -> String {
        "normals".into()
    }
}
