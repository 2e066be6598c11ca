//! Several choices for one receiver at once: what [`ProductTable::sample`] makes of each pair of numbers, bit for bit. The
//! arithmetic runs along columns, and what waits for memory waits together.

use super::ProductTable;
use super::partition::{Partition, Patch, Scale};
use super::table::{self, Spot, Table};
use crate::base::directions::LANES;
use crate::base::light::Guide;
use crate::base::skybox::ChartLanes;
use crate::math::simd::{Kernel, dispatch};
use crate::sampler::hash::extend_unit;

/// What was chosen.
#[derive(Default)]
pub(in super::super) struct Chosen {
    /// Points on the charts, where it was a cell of the map.
    pub at: ChartLanes,
    /// Density per u and v of the charts within the cell; 0 where it was none of the map's.
    pub density: [f64; LANES],
    /// Which of them are discs, by bit.
    pub discs: u32,
    /// Whether anything was chosen.
    pub any: bool,
    /// The numbers of the cells; discs after those of the map.
    pub cell: [u32; LANES],
    /// Two numbers in [0, 1] for a place in each.
    pub part: [[f64; LANES]; 2],
}

struct Choose<'a> {
    partition: &'a Partition,
    patches: &'a [Patch],
    scale: &'a Scale,
    tables: [&'a Table; 2],
    guide: &'a Guide,
    u: &'a [[f32; LANES]; 2],
    n: usize,
}

/// Columns of what was read of each choice.
#[derive(Default)]
struct Read {
    from: [i32; LANES],
    width: [i32; LANES],
    lie: [u32; LANES],
    least: [[f32; LANES]; 2],
    span: [[f32; LANES]; 2],
    density: [f64; LANES],
    chart: [u32; LANES],
    units: [[u32; LANES]; 2],
}

impl Read {
    #[inline(always)]
    fn patch(&mut self, k: usize, patch: &Patch) {
        self.chart[k] = patch.chart;
        self.density[k] = patch.density;
        for axis in 0..2 {
            self.least[axis][k] = patch.from[axis];
            self.span[axis][k] = patch.span[axis];
        }
    }
}

impl ProductTable {
    /// A cell and a place in it for each of the first `n` pairs of numbers.
    pub fn choose(&self, guide: &Guide, u: &[[f32; LANES]; 2], n: usize) -> Chosen {
        let [first, second] = guide.tables.map(|number| self.table(number));
        // One that is never asked may not be there.
        let (Some(first), Some(second)) = (first.or(second), second.or(first)) else {
            return Chosen::default();
        };
        let (patches, scale) = (self.partition.patches(), self.partition.scale());
        dispatch(Choose { partition: &self.partition, patches, scale, tables: [first, second], guide, u, n })
    }
}

impl Kernel for Choose<'_> {
    type Output = Chosen;

    #[inline(always)]
    fn run(self) -> Chosen {
        let Choose { partition, patches, scale, tables, guide, u, n } = self;
        let mut out = Chosen::default();
        let [mut x, mut y] = [[0.0; LANES]; 2];
        for k in 0..LANES {
            [x[k], y[k]] = extend_unit([u[0][k], u[1][k]]);
        }
        // How often a sample of what was chosen is taken at all.
        let worth = f64::from(guide.worth);
        let mut taken = [worth; LANES];
        if guide.worth < 1.0 {
            for k in 0..LANES {
                taken[k] = if x[k] >= worth { 0.0 } else { worth };
                x[k] /= worth;
            }
            // Most, where scattered rays find almost all.
            if taken[..n.min(LANES)].iter().all(|taken| *taken == 0.0) {
                return out;
            }
        }
        out.any = true;
        let shares = guide.shares.map(f64::from);
        let mixed = guide.shares[1] > 0.0;
        let mut second = [false; LANES];
        if mixed {
            for k in 0..LANES {
                second[k] = x[k] >= shares[0];
                let (first, other) = (x[k] / shares[0], (x[k] - shares[0]) / (1.0 - shares[0]));
                x[k] = if second[k] { other } else { first };
            }
        }
        let (mut row, mut unit) = ([0; LANES], [0; LANES]);
        for k in 0..LANES {
            let spot = Spot::new([x[k], y[k]]);
            (row[k], unit[k], [x[k], y[k]]) = (spot.row, spot.unit, spot.at);
        }
        let mut divided = 0u32;
        let mut read = Read { width: [1; LANES], ..Read::default() };
        for k in (0..n.min(LANES)).filter(|&k| taken[k] > 0.0) {
            let entry = tables[usize::from(second[k])].entry(row[k], unit[k]);
            read.from[k] = i32::from(entry.from);
            read.width[k] = i32::from(entry.to) - i32::from(entry.from);
            read.lie[k] = entry.lie();
            let cell = entry.cell();
            out.cell[k] = cell as u32;
            if mixed {
                read.units[0][k] = tables[0].units(cell);
                read.units[1][k] = tables[1].units(cell);
            } else {
                read.units[0][k] = entry.units();
            }
            let Some(patch) = patches.get(cell) else {
                out.discs |= 1 << k;
                continue;
            };
            read.patch(k, patch);
            divided |= u32::from(patch.is_divided) << k;
        }
        for k in 0..LANES {
            let (from, width) = (f64::from(read.from[k]), f64::from(read.width[k]));
            [out.part[0][k], out.part[1][k]] = table::rest([x[k], y[k]], from, width, read.lie[k]);
        }
        for k in (0..LANES).filter(|k| divided >> k & 1 == 1) {
            let (patch, part) = partition.within(out.cell[k] as usize, out.part.map(|column| column[k]));
            read.patch(k, patch);
            [out.part[0][k], out.part[1][k]] = part;
        }
        out.at.chart = read.chart;
        for k in 0..LANES {
            let part = out.part.map(|column| column[k]);
            out.at.u[k] = scale.at(0, read.least[0][k], read.span[0][k], part[0]);
            out.at.v[k] = scale.at(1, read.least[1][k], read.span[1][k], part[1]);
            let pmf = [0, 1].map(|t| table::probability(read.units[t][k]));
            let pmf = shares[0] * pmf[0] + shares[1] * pmf[1];
            out.density[k] = pmf * taken[k] * read.density[k];
        }
        out
    }
}
