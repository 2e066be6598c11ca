//! Hits together give the bits that they give one by one.

use super::{closest, for_each_placed, ray_at};
use crate::base::hit::Hit;
use crate::base::lanes::{LANES, LocalRays, Surfaces};
use crate::base::shape::Needs;
use crate::testing::TestRng;

#[test]
fn surfaces_are_the_same_alone_and_together() {
    let mut rng = TestRng::new(7);
    for_each_placed(|name, shape| {
        let needs = [Needs::default(), Needs::ALL];
        for round in 0..24 {
            let (mut rays, mut hits) = (LocalRays::default(), Vec::new());
            let n = 1 + round % LANES;
            for _ in 0..40 * n {
                let ray = ray_at(&mut rng, &shape.bounds());
                let Some((prim, t)) = closest(shape, &ray) else { continue };
                rays.set(hits.len(), &ray);
                hits.push(Hit { t: t as f32, prim, path: 0 });
                if hits.len() == n {
                    break;
                }
            }
            let (needs, mut out) = (needs[round % 2], Surfaces::default());
            shape.refine_batch(&rays, &hits, needs, &mut out);
            for (lane, hit) in hits.iter().enumerate() {
                let alone = shape.refine(&rays.get(lane), hit.prim, hit.t, needs);
                assert_eq!(format!("{alone:?}"), format!("{:?}", out.get(lane)), "{name}");
            }
        }
    });
}
