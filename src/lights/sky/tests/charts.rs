//! The chi-square test of tables of cells, counted on the sky's own charts.

use super::*;

/// Where to count what a table of cells draws: on the sky's own charts.
pub(super) struct Charts<'a> {
    pub sky: &'a dyn Skybox,
    pub light: &'a SkyLight,
    pub at: &'a Receiver,
}

impl Charts<'_> {
    fn direction(&self, c: ChartPoint) -> Vec3 {
        let d = self.sky.direction(c);
        self.light.turn.map_or(d, |t| t.to_world(d)).as_vec3()
    }

    /// Whether a border of the density other than those of cells, the receiver's horizon or a disc's rim, may cut a
    /// cell: by the distance of either from its centre, in chords.
    fn is_cut(&self, c: ChartPoint, size: [f64; 2]) -> bool {
        let middle = self.direction(c);
        let corner = |k: u32| {
            let half = |k: u32, size: f64| size * (f64::from(k) - 0.5);
            self.direction(ChartPoint { u: c.u + half(k % 2, size[0]), v: c.v + half(k / 2, size[1]), ..c })
        };
        // Cells next to a pole are wider between their corners than at them.
        let reach = 1.5 * (0..4).map(|k| (corner(k) - middle).length()).fold(0.0, f32::max);
        let rims = || self.light.discs.iter().map(|d| (d.frame.n - middle).length() - d.sin);
        (self.at.ng != Vec3::ZERO && middle.dot(self.at.ng).abs() < reach) || rims().any(|r| r < reach)
    }

    /// The integral of `pdf` over a cell. It is constant there per u and v, up to the rounding of directions, so that one
    /// point is enough, unless a border cuts the cell.
    fn integral(&self, c: ChartPoint, size: [f64; 2], pdf: &impl Fn(Vec3) -> f32) -> f64 {
        let f = |u, v| {
            let c = ChartPoint { u, v, ..c };
            f64::from(pdf(self.direction(c))) * self.sky.solid_angle_density(c)
        };
        if !self.is_cut(c, size) {
            return f(c.u, c.v) * size[0] * size[1];
        }
        let span = |x: f64, size: f64| [x - 0.5 * size, x + 0.5 * size];
        integrate_rect(f, span(c.u, size[0]), span(c.v, size[1]), 1e-6)
    }
}

/// As [`chi_square_sphere`], in blocks of the cells of the sky's grid. Bins by direction do not do here: a table's
/// density jumps from cell to cell by any factor, and quadrature that does not know the cells loses some of one bright
/// texel among zeros between its nodes, enough to reject a sampler that is right.
pub(super) fn chi_square_charts(
    what: &str,
    how: &ChiSquare,
    charts: &Charts,
    mut sample: impl FnMut(&mut TestRng) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) {
    let ChartGrid { count, width, height } = charts.sky.grid();
    let (columns, rows) = (width.min(how.bins.columns as u32), height.min(how.bins.rows as u32));
    let block = |chart: u32, x: u32, y: u32| {
        ((chart * rows + y * rows / height) * columns + x * columns / width) as usize
    };
    let rest = (count * rows * columns) as usize;
    let (mut counts, mut expected) = (vec![0.0; rest + 1], vec![0.0; rest + 1]);
    let mut rng = TestRng::new(how.seed);
    for _ in 0..how.samples {
        let bin = sample(&mut rng).map_or(rest, |w| {
            let c = charts.sky.locate(charts.light.to_sky(w).as_dvec3());
            let cell = |u: f64, n: u32| ((u * f64::from(n)) as u32).min(n - 1);
            block(c.chart, cell(c.u, width), cell(c.v, height))
        });
        counts[bin] += 1.0;
    }
    let n = f64::from(how.samples);
    let size = [1.0 / f64::from(width), 1.0 / f64::from(height)];
    for i in 0..count * width * height {
        let (chart, x, y) = (i / (width * height), i % width, i / width % height);
        let c = ChartPoint { chart, u: (f64::from(x) + 0.5) * size[0], v: (f64::from(y) + 0.5) * size[1] };
        expected[block(chart, x, y)] += n * charts.integral(c, size, &pdf);
    }
    let inside: f64 = expected.iter().sum();
    // What a probability may exceed 1 by: f32 densities, and the quadrature's tolerance in the cells that are cut.
    assert!(inside < n * (1.0 + 1e-3), "{what}: the density integrates to {}", inside / n);
    expected[rest] = (n - inside).max(0.0);
    chi_square_counts(what, how.tests, &counts, &expected);
}

#[test]
fn wrong_densities_are_found_on_charts() {
    let texel = |i| if i % 7 == 0 { 5.0 } else { 0.2 };
    let light = light(&sky("sphere", picture(32, 16, texel)), SkySampling::Table, 0.0);
    let at = facing(Vec3::Y);
    let charts = Charts { sky: &*light.sky, light: &light, at: &at };
    let found = |wrong: &dyn Fn(Vec3) -> f32| {
        let sample = |rng: &mut TestRng| light.sample_li(&at, rng.vec2().to_array()).map(|s| s.wi);
        let test = || chi_square_charts("sphere", &ChiSquare::default(), &charts, sample, wrong);
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(test)).is_err()
    };
    let pdf = |w: Vec3| light.pdf_li(&at, &away(w));
    assert!(!found(&pdf));
    // Half of the samples are lost below the horizon; what 200,000 tell from it in 512 blocks.
    assert!(found(&|w| 0.95 * pdf(w)));
    assert!(found(&|w| pdf(w) * (1.0 + 0.06 * w.x.signum())));
    // As if the whole were one column off, or the receiver's horizon a degree lower.
    assert!(found(&|w| if w.y > 0.0 {
        pdf(Vec3::new(w.x - 0.2 * w.z, w.y, w.z + 0.2 * w.x).normalize())
    } else {
        0.0
    }));
    assert!(found(&|w| light.pdf_li(&anywhere(), &away(w)) * f32::from(u8::from(w.y > -0.02))));
}
