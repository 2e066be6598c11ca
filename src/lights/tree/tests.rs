use super::*;
use crate::testing::TestRng;

/// Small lamps in a cube, each facing somewhere.
fn lamps(count: usize, rng: &mut TestRng) -> Vec<EmitterBounds> {
    let one = |rng: &mut TestRng| {
        let p = rng.cube().as_vec3();
        EmitterBounds {
            bounds: Aabb::new(p, p + rng.cube().as_vec3().abs() * 0.02),
            axis: rng.direction(),
            cos_spread: 1.0,
            cos_reach: 0.0,
            two_sided: rng.f32() < 0.1,
            power: 0.1 + rng.f32(),
        }
    };
    (0..count).map(|_| one(rng)).collect()
}

fn receivers(rng: &mut TestRng) -> Vec<Receiver> {
    let mut all = Vec::new();
    for scale in [0.3, 1.0, 20.0] {
        for _ in 0..10 {
            let (p, n) = ((rng.cube() * scale).as_vec3(), rng.direction());
            all.push(Receiver { p, ng: n, ns: (n + 0.2 * rng.direction()).normalize() });
            all.push(Receiver { p, ng: Vec3::ZERO, ns: Vec3::ZERO });
        }
    }
    all
}

/// Whether light can get from some point of the lamp to the receiver: by its middle, with room for its size.
fn can_contribute(b: &EmitterBounds, at: &Receiver) -> bool {
    b.bounds.corners().into_iter().all(|q| {
        let w = at.p - q;
        let leaves = b.axis.dot(w) > 0.0 || b.two_sided;
        leaves && (at.ng == Vec3::ZERO || (at.ng.dot(w) < 0.0 && at.ns.dot(w) < 0.0))
    })
}

#[test]
fn choices_follow_their_pmf_and_leave_nobody_out() {
    let mut rng = TestRng::new(1);
    for count in [1, 2, 3, 10, 1000] {
        let all = lamps(count, &mut rng);
        let tree = LightTree::new(&all).expect("there are lamps");
        for at in receivers(&mut rng) {
            let pmfs: Vec<f64> = (0..count as u32).map(|i| tree.pmf(&at, i)).collect();
            let total: f64 = pmfs.iter().sum();
            // Where a node says it may bring something and both of its children say they cannot, the choice is lost.
            assert!(total < 1.0 + 1e-9, "{count}: {total}");
            for (b, p) in all.iter().zip(&pmfs) {
                assert!(*p > 0.0 || !can_contribute(b, &at), "{count} {at:?}: {b:?}");
            }
            let (mut counts, n) = (vec![0u32; count], 20_000);
            for k in 0..n {
                let Some(c) = tree.sample(&at, (f64::from(k) + 0.5) / f64::from(n)) else { continue };
                assert_eq!(c.pmf, pmfs[c.emitter as usize], "the same products in the same order");
                assert!((0.0..1.0).contains(&c.du));
                counts[c.emitter as usize] += 1;
            }
            // Evenly spaced numbers, monotone: off by one at each end of an interval.
            for (c, p) in counts.iter().zip(&pmfs) {
                assert!((f64::from(*c) - p * f64::from(n)).abs() < 2.5, "{count}: {c} {p}");
            }
        }
    }
}

#[test]
fn bounds_hold_what_they_join() {
    let mut rng = TestRng::new(2);
    for _ in 0..500 {
        let all = lamps(6, &mut rng);
        let joined = all.iter().skip(1).fold(all[0], |a, b| union(&a, b));
        for b in &all {
            assert!(joined.bounds.contains_box(&b.bounds));
            let angle = joined.axis.dot(b.axis);
            assert!(angle >= joined.cos_spread - 1e-5, "{joined:?} {b:?}");
        }
        assert!((joined.power - all.iter().map(|b| b.power).sum::<f32>()).abs() < 1e-5);
    }
}

#[test]
fn lamps_in_one_place_and_lamps_without_power_do_no_harm() {
    let mut rng = TestRng::new(3);
    let one = lamps(1, &mut rng)[0];
    let mut all = vec![one; 5000];
    all[7].power = 0.0;
    all[9].power = f32::NAN;
    let tree = LightTree::new(&all).expect("there are lamps");
    let at = Receiver { p: one.bounds.center() + one.axis, ng: Vec3::ZERO, ns: Vec3::ZERO };
    assert_eq!((tree.pmf(&at, 7), tree.pmf(&at, 9), tree.pmf(&at, 5000)), (0.0, 0.0, 0.0));
    // 4,998 alike.
    assert!((0..100).filter(|i| *i != 7 && *i != 9).all(|i| (tree.pmf(&at, i) * 4998.0 - 1.0).abs() < 1.0));
    assert!(tree.trails.iter().all(|t| *t < 1 << 50));
    all.iter_mut().for_each(|b| b.power = 0.0);
    assert!(LightTree::new(&all).is_none() && LightTree::new(&[]).is_none());
    // On a lamp that is a point.
    let point = EmitterBounds { bounds: Aabb::new(Vec3::ONE, Vec3::ONE), ..one };
    let tree = LightTree::new(&[point, one]).expect("there are lamps");
    let at = Receiver { p: Vec3::ONE, ng: Vec3::ZERO, ns: Vec3::ZERO };
    assert!(tree.sample(&at, 0.1).is_some_and(|c| c.pmf.is_finite() && c.pmf > 0.0));
}
