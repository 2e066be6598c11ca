//! Product sampling as integrators use it: prepared for a surface that scatters in some way.

use super::*;
use crate::base::material::Scattering;

const SCATTERINGS: [Scattering; 4] = [
    Scattering::EVEN,
    Scattering { even: 0.0, facets: 0.9, alpha: 0.3 },
    Scattering { even: 0.0, facets: 0.9, alpha: 0.02 },
    Scattering { even: 0.1, facets: 0.3, alpha: 0.1 },
];

/// A viewer above the horizon.
fn viewer(rng: &mut TestRng, n: Vec3) -> Vec3 {
    let w = rng.direction();
    if w.dot(n) < 0.0 { -w } else { w }
}

/// Every scattering, alone or not, for a sample and for several at once.
fn ways() -> impl Iterator<Item = (Scattering, bool, u32)> {
    let alone = SCATTERINGS.into_iter().flat_map(|s| [(s, true), (s, false)]);
    alone.flat_map(|(s, alone)| [1, 4, 8].map(|samples| (s, alone, samples)))
}

#[test]
fn probabilities_of_all_cells_and_discs_sum_to_one() {
    each_sky(|what, sky| {
        let light = light(sky, SkySampling::Product, 30.0);
        let MapSampler::Product(table) = &light.map else { return };
        let mut rng = TestRng::new(1);
        for (scattering, alone, samples) in ways() {
            let at = facing(rng.direction());
            let mut guide = Guide::default();
            let lobes = Lobes { wo: viewer(&mut rng, at.ns), scattering, alone, samples };
            if !light.prepare(&at, &lobes, &mut guide) {
                continue;
            }
            let grid = light.sky.grid();
            let (w, h) = (grid.width as usize, grid.height as usize);
            let map = (0..grid.cells()).map(|i| {
                let u = ((i % w) as f64 + 0.5) / w as f64;
                let v = ((i / w % h) as f64 + 0.5) / h as f64;
                let c = ChartPoint { chart: (i / (w * h)) as u32, u, v };
                table.density(&guide, c) / (w * h) as f64
            });
            let discs = (0..light.discs.len()).map(|d| table.disc_pmf(&guide, d));
            let sum = map.sum::<f64>() + discs.sum::<f64>();
            assert!(guide.worth <= 1.0 && !(alone && guide.worth < 1.0), "{guide:?}");
            // Two shares in f32, and a thousand probabilities.
            let want = f64::from(guide.worth);
            assert!((sum - want).abs() < 1e-6 * want, "{what} {scattering:?}: {sum} {want}");
        }
    });
}

#[test]
fn what_a_surface_makes_of_it_is_drawn_as_the_density_says() {
    // Counts in the cells and discs against their probabilities: what the tests of the light alone, which know an
    // even surface only, do not reach.
    let mut light_of = Vec::new();
    each_sky(|what, sky| light_of.push((what.to_owned(), light(sky, SkySampling::Product, 77.0))));
    let tests = (light_of.len() * ways().count()) as u32;
    let mut rng = TestRng::new(9);
    for (what, light) in &light_of {
        let MapSampler::Product(table) = &light.map else { continue };
        for (scattering, alone, samples) in ways() {
            let at = facing(rng.direction());
            let mut guide = Guide::default();
            let lobes = Lobes { wo: viewer(&mut rng, at.ns), scattering, alone, samples };
            if !light.prepare(&at, &lobes, &mut guide) {
                continue;
            }
            let n = 20_000;
            let map = table.cells();
            // The last counts what was not worth a ray.
            let none = map + light.discs.len();
            let mut counts = vec![0.0; none + 1];
            for _ in 0..n {
                let cell = match table.sample(&guide, extend_unit(rng.vec2().to_array())) {
                    Some(Choice::Map { at, density }) => {
                        assert_eq!(density, table.density(&guide, at));
                        table.cell_of(at)
                    }
                    Some(Choice::Disc { disc, .. }) => map + disc,
                    None => none,
                };
                counts[cell] += 1.0;
            }
            // That of a disc is the probability of a cell after those of the map.
            let left = 1.0 - f64::from(guide.worth);
            let cells = (0..none).map(|i| table.pmf(&guide, i));
            let expected: Vec<f64> = cells.chain([left]).map(|p| f64::from(n) * p).collect();
            chi_square_counts(&format!("{what} {scattering:?}"), tests, &counts, &expected);
            for _ in 0..200 {
                let u = rng.vec2().to_array();
                let Some(s) = GuidedLight::sample(light, &at, &guide, u) else { continue };
                let pdf = light.pdf(&at, &guide, s.wi);
                assert!((pdf - s.pdf).abs() <= 1e-5 * s.pdf, "{what}: {pdf} {}", s.pdf);
            }
        }
    }
}

#[test]
fn samples_drawn_together_are_those_drawn_one_by_one() {
    each_sky(|what, sky| {
        let light = light(sky, SkySampling::Product, 77.0);
        let Some(guided) = light.guided() else { return };
        let mut rng = TestRng::new(11);
        let mut found = 0;
        for (scattering, alone, samples) in ways() {
            for n in (1..=LANES).chain([LANES; 20]) {
                let at = facing(rng.direction());
                let mut guide = Guide::default();
                let lobes = Lobes { wo: viewer(&mut rng, at.ns), scattering, alone, samples };
                if !guided.prepare(&at, &lobes, &mut guide) {
                    continue;
                }
                let u: [[f32; LANES]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| rng.f32()));
                let all = guided.sample_many(&at, &guide, &u, n);
                for (k, (&x, &y)) in u[0].iter().zip(&u[1]).enumerate() {
                    let one = guided.sample(&at, &guide, [x, y]).filter(|_| k < n);
                    assert_eq!(all.pdf[k], one.map_or(0.0, |l| l.pdf), "{what}: {k} of {n}, {guide:?}");
                    if let Some(one) = one {
                        assert_eq!(all.wi.get(k), one.wi, "{what}: {k} of {n}, {guide:?}");
                        found += 1;
                    }
                }
            }
        }
        assert!(found > 50, "{what}: {found}");
    });
}

/// Relative variance of one sample of the light a surface sends to its viewer, all directions open.
fn variance(light: &SkyLight, at: &Receiver, wo: Vec3, material: &dyn Fn(Vec3) -> f32) -> f64 {
    let mut rng = TestRng::new(4);
    let (mut sum, mut sum2) = (0.0, 0.0);
    let n = 20_000;
    let mut guide = Guide::default();
    let scattering = Scattering { even: 0.3, facets: 0.0, alpha: 1.0 };
    let guided = light.guided();
    for _ in 0..n {
        let u = rng.vec2().to_array();
        let s = match guided {
            Some(g) => {
                g.prepare(at, &Lobes { wo, scattering, alone: true, samples: 1 }, &mut guide);
                g.sample(at, &guide, u)
            }
            None => light.sample_li(at, u),
        };
        let x = s.map_or(0.0, |s| f64::from(light.arriving(&s).luminance() * material(s.wi) / s.pdf));
        sum += x;
        sum2 += x * x;
    }
    let mean = sum / f64::from(n);
    sum2 / f64::from(n) / (mean * mean) - 1.0
}

#[test]
fn an_open_diffuse_surface_hardly_varies() {
    // A bright spot, wide next to the cells of the table: bilinear filters are smooth within them.
    let spot = |i: usize| {
        let (x, y) = ((i % 256) as f32 - 90.0, (i / 256) as f32 - 80.0);
        1.0 + 60.0 * (-(x * x + y * y) / 200.0).exp()
    };
    let sky = sky("sphere", picture(256, 128, spot));
    let n = Vec3::new(0.6, 0.64, -0.48);
    let (at, f) = (facing(n), |w: Vec3| 0.3 * w.dot(n).max(0.0));
    let of = |sampling| variance(&light(&sky, sampling, 0.0), &at, n, &f);
    let (product, table) = (of(SkySampling::Product), of(SkySampling::Table));
    // What is left is the cosine within cells of 11 degrees or less.
    assert!(product < 0.12 && product < 0.2 * table, "{product} {table}");
}

#[test]
fn stars_are_found_within_cells() {
    // More stars than there are cells, 300 times as bright as the night between them; half of the light is theirs.
    let star = |i: usize| if i * 2_654_435_761 % 4096 < 14 { 30.0 } else { 0.1 };
    let sky = sky("sphere", picture(1024, 512, star));
    let n = Vec3::new(0.6, 0.64, -0.48);
    let (at, f) = (facing(n), |w: Vec3| 0.3 * w.dot(n).max(0.0));
    let product = variance(&light(&sky, SkySampling::Product, 0.0), &at, n, &f);
    // Evenly within cells it would be 0.5 * (30 / 0.2) = 75 and more. A star's bilinear filter alone, of twice its texel's
    // width, leaves about 0.5 * (1.78 - 1) + 0.5 * (2 - 1).
    assert!(product < 3.0, "{product}");
}

#[test]
fn strata_of_the_square_stay_strata() {
    // The mean over a stratified set of n^2 points against that of random ones: inversion keeps most of the gain.
    let sky = sky("gradient", Params::new());
    let light = light(&sky, SkySampling::Product, 0.0);
    let n = Vec3::Y;
    let at = facing(n);
    let value = |u: [f32; 2]| {
        let s = light.sample_li(&at, u);
        s.map_or(0.0, |s| f64::from(light.arriving(&s).luminance() * s.wi.dot(n).max(0.0) / s.pdf))
    };
    let (side, runs) = (16, 100);
    let mut rng = TestRng::new(8);
    let mut spread = [0.0; 2];
    for (k, spread) in spread.iter_mut().enumerate() {
        let means: Vec<f64> = (0..runs)
            .map(|_| {
                let points = (0..side * side).map(|i| {
                    let u = rng.vec2().to_array();
                    let cell = [(i % side) as f32, (i / side) as f32];
                    if k == 0 { u } else { [0, 1].map(|a| (cell[a] + u[a]) / side as f32) }
                });
                points.map(value).sum::<f64>() / f64::from(side * side)
            })
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        *spread = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
    }
    assert!(spread[1] < 0.2 * spread[0], "{spread:?}");
}

#[test]
fn awkward_skies_are_sampled_or_left_alone() {
    let one = sky("sphere", picture(1, 1, |_| 2.0));
    let black = sky("sphere", picture(8, 4, |_| 0.0));
    let spike = sky("sphere", picture(64, 32, |i| if i == 700 { 1e8 } else { 0.0 }));
    let at = facing(Vec3::Y);
    for sky in [&one, &black, &spike] {
        let light = light(sky, SkySampling::Product, 10.0);
        let mut rng = TestRng::new(3);
        let mut sum = 0.0;
        for _ in 0..2000 {
            let u = rng.vec2().to_array();
            let Some(s) = light.sample_li(&at, u) else { continue };
            assert!(s.pdf > 0.0 && s.wi.is_finite());
            sum += f64::from(light.arriving(&s).luminance() * s.wi.dot(Vec3::Y).max(0.0) / s.pdf) / 2000.0;
        }
        assert!(sum.is_finite() && (sum > 0.0) == light.guided().is_some());
    }
}
