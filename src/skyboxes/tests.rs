//! What every kind of sky must keep, run on the sample parameters of its row.

use super::REGISTRY;
use crate::base::directions::{DirectionBatch, LANES};
use crate::base::skybox::{ChartGrid, ChartLanes, ChartPoint, Skybox};
use crate::testing::rows::{Built, built, check_rows};
use crate::testing::{TestRng, integrate_rect};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

fn each(mut f: impl FnMut(&str, &dyn Skybox)) {
    for Built { label, it } in built::<dyn Skybox>("sky", REGISTRY) {
        f(&label, &*it);
    }
}

#[test]
fn rows_are_sound() {
    check_rows("sky", REGISTRY);
}

fn random_point(sky: &dyn Skybox, rng: &mut TestRng) -> ChartPoint {
    let chart = (rng.bits() % u64::from(sky.grid().count)) as u32;
    ChartPoint { chart, u: rng.f64(), v: rng.f64() }
}

#[test]
fn charts_map_points_to_directions_and_back() {
    each(|what, sky| {
        let mut rng = TestRng::new(1);
        for _ in 0..200 {
            let c = random_point(sky, &mut rng);
            let d = sky.direction(c);
            assert!((d.length() - 1.0).abs() < 1e-14, "{what}: {d} is not of unit length");
            let back = sky.locate(d);
            // u has few digits where a chart's row is short, next to a pole.
            let near = (back.u - c.u).abs() * sky.solid_angle_density(c) + (back.v - c.v).abs();
            assert!(back.chart == c.chart && near < 1e-12, "{what}: {c:?} came back as {back:?}");
        }
    });
}

#[test]
fn solid_angle_density_is_the_jacobian_and_covers_the_sphere() {
    each(|what, sky| {
        let mut rng = TestRng::new(2);
        let h = 1e-5;
        for _ in 0..50 {
            let c = random_point(sky, &mut rng);
            let c = ChartPoint { u: h + c.u * (1.0 - 2.0 * h), v: 0.01 + 0.98 * c.v, ..c };
            let along = |du, dv| sky.direction(ChartPoint { u: c.u + du, v: c.v + dv, ..c });
            let (du, dv) = (along(h, 0.0) - along(-h, 0.0), along(0.0, h) - along(0.0, -h));
            let area = du.cross(dv).length() / (4.0 * h * h);
            let density = sky.solid_angle_density(c);
            // Central differences err by h^2 times third derivatives, which grow to 1e4 next to a pole.
            assert!((area / density - 1.0).abs() < 1e-5, "{what}: {area} for {density} at {c:?}");
        }
        let total: f64 = (0..sky.grid().count)
            .map(|chart| {
                let f = |u, v| sky.solid_angle_density(ChartPoint { chart, u, v });
                integrate_rect(f, [0.0, 1.0], [0.0, 1.0], 1e-9)
            })
            .sum();
        assert!((total - 4.0 * PI).abs() < 1e-7, "{what}: charts cover {total} sr");
    });
}

fn luminance(sky: &dyn Skybox, d: DVec3) -> f64 {
    f64::from(sky.radiance(d.as_vec3()).luminance())
}

#[test]
fn cell_integrals_are_those_of_the_radiance() {
    each(|what, sky| {
        let grid = sky.grid();
        let (w, h) = (grid.width as usize, grid.height as usize);
        let cells = sky.cell_integrals(grid);
        assert_eq!(cells.len(), grid.cells(), "{what}");
        assert!(cells.iter().all(|c| c.is_finite() && *c >= 0.0), "{what}");
        let scale = cells.iter().sum::<f64>() / cells.len() as f64;
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by(|&a, &b| cells[b].total_cmp(&cells[a]));
        let mut rng = TestRng::new(3);
        let random: Vec<usize> = (0..20).map(|_| (rng.bits() % cells.len() as u64) as usize).collect();
        for i in order.into_iter().take(5).chain(random) {
            let (chart, x, y) = ((i / (w * h)) as u32, i % w, i / w % h);
            let f = |u, v| {
                let c = ChartPoint { chart, u, v };
                luminance(sky, sky.direction(c)) * sky.solid_angle_density(c)
            };
            // Quarter cells: bilinear filters bend in the middle of a cell.
            let at = |i: usize, half: usize, n: usize| (i as f64 + 0.5 * half as f64) / n as f64;
            let want: f64 = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(a, b)| {
                    let (u, v) = ([at(x, a, w), at(x, a + 1, w)], [at(y, b, h), at(y, b + 1, h)]);
                    integrate_rect(f, u, v, 1e-6 * (scale + cells[i]))
                })
                .iter()
                .sum();
            // Cube maps take the solid angle as constant over a texel: off by its slope across it, at most about
            // 1 / 32 of a cell that the filter alone lights.
            let tolerance = 1e-12 + 2e-5 * scale + 0.02 * want;
            assert!((cells[i] - want).abs() < tolerance, "{what}: cell {i}: {} for {want}", cells[i]);
            assert!(cells[i] > 0.0 || want == 0.0, "{what}: cell {i} is lost");
        }
    });
}

#[test]
fn coarser_grids_have_the_same_sum() {
    each(|what, sky| {
        let fine = sky.grid();
        let sum = |grid| sky.cell_integrals(grid).iter().sum::<f64>();
        let want = sum(fine);
        for n in [2, 3, 5] {
            let grid = ChartGrid { width: fine.width.div_ceil(n), height: fine.height.div_ceil(n), ..fine };
            let got = sum(grid);
            // Quadrature over fewer points for skies made of formulas, with the glow at the horizon in one row of
            // cells; and few texels, whose solid angles are taken as constant on coarser grids: second order.
            let tolerance = 2e-3 + 6.0 / f64::from(grid.width * grid.height);
            assert!((got - want).abs() <= tolerance * want, "{what}: {got} for {want} at 1/{n}");
        }
    });
}

#[test]
fn batches_and_constants_agree_with_single_lookups() {
    each(|what, sky| {
        let mut rng = TestRng::new(4);
        // Corners of cubes and poles among them, and more than any batch is cut into.
        let mut d: Vec<_> = (0..1000).map(|_| rng.direction()).collect();
        for i in 0..8 {
            let end = |bit| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
            d.push((Vec3::new(end(0), end(1), end(2)) + 1e-3 * rng.direction()).normalize());
        }
        d.extend([Vec3::Y, Vec3::NEG_Y, Vec3::NEG_X]);
        let mut out = vec![crate::color::Rgb::BLACK; d.len()];
        sky.radiance_batch(d.iter().copied().collect::<DirectionBatch>().view(), &mut out);
        for (&d, &l) in d.iter().zip(&out) {
            assert_eq!(sky.radiance(d), l, "{what}");
            assert!(l.is_finite() && l.r >= 0.0 && l.g >= 0.0 && l.b >= 0.0, "{what}: {l:?} towards {d}");
            assert!(sky.constant().is_none_or(|c| c == l), "{what}");
        }
    });
}

#[test]
fn points_of_charts_worked_on_together_are_those_of_each() {
    each(|what, sky| {
        let mut rng = TestRng::new(6);
        for n in [1, 3, LANES] {
            let points: [ChartPoint; LANES] = std::array::from_fn(|_| random_point(sky, &mut rng));
            let lanes =
                ChartLanes { u: points.map(|c| c.u), v: points.map(|c| c.v), chart: points.map(|c| c.chart) };
            let all = sky.directions_and_densities(&lanes, n);
            for (k, &c) in points[..n].iter().enumerate() {
                let (d, density) = sky.direction_and_density(c);
                assert_eq!(
                    [d.x, d.y, d.z, density],
                    [all.x[k], all.y[k], all.z[k], all.density[k]],
                    "{what}"
                );
                // A few roundings of numbers up to 1, and of 2 pi^2.
                assert!((d - sky.direction(c)).length() < 2e-15, "{what}: {d} at {c:?}");
                assert!((density - sky.solid_angle_density(c)).abs() < 4e-14, "{what}: {density} at {c:?}");
            }
        }
    });
}

#[test]
fn closed_forms_of_irradiance_match_quadrature() {
    each(|what, sky| {
        let mut rng = TestRng::new(5);
        for n in [DVec3::Y, DVec3::NEG_Y, DVec3::X, rng.direction().as_dvec3(), rng.direction().as_dvec3()] {
            let Some(e) = sky.irradiance_closed_form(n) else { return };
            let want = crate::testing::integrate_sphere(|w| luminance(sky, w) * w.dot(n).max(0.0), 1e-6);
            // The quadrature's tolerance across the kink at the receiver's horizon, and f32 radiances.
            assert!(
                (f64::from(e.luminance()) - want).abs() < 1e-4 * (1.0 + want),
                "{what}: {e:?} for {want}"
            );
        }
    });
}
