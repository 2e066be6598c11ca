//! Product sampling: directions by what the sky brings times what the surface makes of it.
//!
//! The sky is cut into about a thousand cells, small where its light varies ([`partition`]); discs are cells, too. For
//! each of about a thousand normals there is a table of what every cell brings to a surface that scatters evenly, its
//! cosine clipped by the horizon; for each of as many mirrored directions, and some widths of the lobe about them, one of
//! what facets make of it. A surface point takes the table of its normal, of its mirrored direction, or both, each as
//! often as it counts. Tables are made when they are first asked for, from their number alone, so that no picture depends
//! on when that was. Choices are by inversion, with what is left of both numbers handed on, so that stratified points stay
//! stratified.
//!
//! Conty Estevez and Lecocq ("Fast product importance sampling of environment maps", SIGGRAPH 2018 talks) weigh the cells
//! anew for every surface point, which takes longer than a ray; tables by normal were Lawrence et al.'s ("Adaptive
//! numerical cumulative distribution functions for efficient importance sampling", EGSR 2005).
//!
//! Light samples that compete with scattered rays leave to those what they find as well: of each cell they have what is
//! brighter than the mean of what the surface sees (Karlik et al., "MIS Compensation: Optimizing Sampling Techniques in
//! Multiple Importance Sampling", 2019, but for each table, not for the whole sky).
//!
//! Within a cell places are drawn by the sky alone ([`inner`]), where it varies there: stars are smaller than cells.
//!
//! Weights may be wrong by any factor and only cost variance, as long as none is zero where
//! light is scattered that nothing else finds.

mod choose;
mod inner;
mod octahedron;
mod partition;
mod place;
mod table;
mod weigh;

use super::placed::{PlacedDisc, Turn};
use super::plan::Level;
use crate::base::light::{Guide, Lobes, Receiver};
use crate::base::skybox::{ChartPoint, Skybox};
use crate::math::simd::dispatch;
pub(super) use choose::Chosen;
use glam::{DVec3, Vec3};
use partition::Partition;
use place::Places;
use std::sync::OnceLock;
use table::{MOST_CELLS, Table};
use weigh::{About, Columns, Even, Facets};

/// Widths of facets' lobes that have tables of their own, each sqrt(2) times the next.
const WIDTHS: usize = 12;
/// Kinds of surfaces.
const KINDS: usize = 1 + WIDTHS;
/// Sets of tables with all kinds, see [`Set`].
const SETS: usize = 4;
/// The kind of tables for those who know nothing of the surface: all of the light on an even one, its peaks whole.
const PLAIN: usize = SETS * KINDS;
/// What counts as a peak: a cell of so many times the mean radiance.
const PEAK: f64 = 32.0;
/// The cosine of the largest angle between peaks and their middle where all of them are seen or hidden together: 5 degrees.
const TOGETHER: f64 = 0.9962;
/// Light samples that have help find nothing where less than this part of the light is left for them.
const LEAST_LEFT: f64 = 1e-3;
/// A light sample that has help is taken so many times as often as the part of the light that is left for it: at a
/// hundredth, the one in 25 brings a noise of 4 % where a scattered ray brings all of its own.
const WORTH: f32 = 4.0;
/// More are left to BSDF sampling. (Skies have one or two.)
const MOST_DISCS: usize = 256;
/// Tables of one kind: by direction, and one for surfaces that scatter all round.
const ALL_ROUND: usize = octahedron::COUNT;
const OF_KIND: usize = ALL_ROUND + 1;

/// Tables of one kind, made on demand; None where all is black. Each takes up to 12 kB: a picture of one material some ten
/// megabytes at most, one with facets of all widths in all directions two hundred.
type Tables = OnceLock<Vec<OnceLock<Option<Box<Table>>>>>;

/// The tables, and the cells that they choose among.
pub(super) struct ProductTable {
    partition: Partition,
    /// The discs after the cells of the map.
    cells: Columns,
    /// Cells far brighter than the mean.
    peaks: Vec<usize>,
    /// Whether they are [`TOGETHER`].
    is_one_peak: bool,
    /// Set by set, of surfaces that scatter evenly, then of facets by width; then one more, [`PLAIN`].
    tables: [Tables; PLAIN + 1],
    /// See [`ProductTable::peak`].
    peak: f64,
    /// See [`ProductTable::map_flux`].
    map_flux: f64,
}

/// What was chosen.
pub(super) enum Choice {
    /// A place within a cell of the map.
    Map {
        /// On the charts.
        at: ChartPoint,
        /// Per u and v of the charts.
        density: f64,
    },
    /// A disc, and two numbers for a place in it.
    Disc {
        /// Which.
        disc: usize,
        /// In [0, 1].
        u: [f64; 2],
    },
}

/// What tells sets of tables apart.
///
/// Peaks may have no more than a part of the weight of tables for light samples alone. A sun that is hidden leaves all to the
/// other cells, which must not go without samples: half of the samples are for them, or all but one of several where there
/// is one peak. Parts are powers of two, at which stratified points are best: of n samples exactly one goes there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Set {
    /// Of so many samples at once one may be for peaks, as a power of two from 1 to 3.
    Alone(u32),
    /// Scattered rays compete.
    Helped,
}

impl Set {
    fn of(lobes: &Lobes) -> Self {
        if lobes.alone { Set::Alone(lobes.samples.clamp(2, 8).ilog2()) } else { Set::Helped }
    }

    fn number(self) -> usize {
        match self {
            Set::Alone(bits) => bits as usize - 1,
            Set::Helped => SETS - 1,
        }
    }

    fn numbered(number: usize) -> Self {
        if number < SETS - 1 { Set::Alone(number as u32 + 1) } else { Set::Helped }
    }
}

/// How often a sample is worth its ray that would find `total` of the `whole` light which scattered rays find anyway.
fn worth(total: f32, whole: f32) -> f32 {
    match whole > total * WORTH {
        true => WORTH * total / whole,
        false => 1.0,
    }
}

/// The width, of those that have tables, next to a lobe's.
fn width_of(alpha: f32) -> usize {
    (-2.0 * alpha.max(1e-4).log2() + 0.5).clamp(0.0, (WIDTHS - 1) as f32) as usize
}

impl ProductTable {
    /// Of a sky as it is turned; None if it is black. The discs are as bright as `intensity` makes them. `is_fine`: whether
    /// cells have halves, and a lone sun less than half of several samples.
    pub fn new(
        sky: &dyn Skybox,
        level: &Level,
        discs: &[PlacedDisc],
        (turn, intensity): (Option<Turn>, f32),
        is_fine: bool,
    ) -> Option<Self> {
        if discs.len() > MOST_DISCS {
            return None;
        }
        let partition = Partition::new(level, MOST_CELLS - discs.len(), is_fine);
        let lights = partition.lights(sky, level);
        // Integrals of the map are without the intensity.
        let flux_of = |d: &PlacedDisc| {
            let radiance = d.radiance.luminance() / intensity.max(f32::MIN_POSITIVE);
            f64::from(radiance) * std::f64::consts::TAU * f64::from(d.m)
        };
        let map_flux: f64 = lights.iter().map(|l| l.flux).sum();
        let total = map_flux + discs.iter().map(flux_of).sum::<f64>();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let part = |flux: f64| {
            // What is lit is never without weight.
            let least = if flux > 0.0 { f32::MIN_POSITIVE / f32::EPSILON } else { 0.0 };
            ((flux / total) as f32).max(least)
        };
        let mut cells = Columns::default();
        for l in &lights {
            let to_world = |v: DVec3| turn.map_or(v, |t| t.to_world(v)).as_vec3();
            let sides = l.sides.map(to_world);
            cells.push(to_world(l.middle), sides, l.reach, part(l.flux), l.angle as f32);
        }
        for disc in discs {
            let angle = std::f32::consts::TAU * disc.m;
            cells.push(disc.frame.n, [Vec3::ZERO; 2], disc.sin, part(flux_of(disc)), angle);
        }
        let places = lights.iter().map(|l| turn.map_or(l.middle, |t| t.to_world(l.middle)));
        let places: Vec<_> = places.chain(discs.iter().map(|d| d.frame.n.as_dvec3())).collect();
        let bright = |flux: f64, angle: f64| flux * (4.0 * std::f64::consts::PI) > PEAK * total * angle;
        let map = lights.iter().map(|l| bright(l.flux, l.angle));
        let all = map.chain(discs.iter().map(|d| bright(flux_of(d), std::f64::consts::TAU * f64::from(d.m))));
        let peaks: Vec<usize> = all.enumerate().filter(|(_, bright)| *bright).map(|(i, _)| i).collect();
        let middle =
            peaks.iter().map(|&i| places[i] * f64::from(cells.flux[i])).sum::<DVec3>().normalize_or_zero();
        let is_one_peak = is_fine && peaks.iter().all(|&i| places[i].dot(middle) > TOGETHER);
        let tables = std::array::from_fn(|_| Tables::new());
        Some(ProductTable { partition, cells, peaks, is_one_peak, tables, peak: level.peak(), map_flux })
    }

    /// As [`ProductTable::prepare`], for those who know nothing of the surface.
    pub fn prepare_plain(&self, at: &Receiver, guide: &mut Guide) -> bool {
        let which = if at.ns == Vec3::ZERO { ALL_ROUND } else { octahedron::find(at.ns) };
        guide.tables = [(PLAIN * OF_KIND + which) as u32; 2];
        guide.shares = [1.0, 0.0];
        guide.worth = 1.0;
        self.table(guide.tables[0]).is_some()
    }

    /// Numbers of the tables of a receiver, and how often each is asked; false if nothing can arrive.
    #[inline]
    pub fn prepare(&self, at: &Receiver, lobes: &Lobes, guide: &mut Guide) -> bool {
        let s = &lobes.scattering;
        let first = self.set_of(lobes).number() * KINDS;
        let number = |kind: usize, which: usize| ((first + kind) * OF_KIND + which) as u32;
        let even = number(0, if at.ns == Vec3::ZERO { ALL_ROUND } else { octahedron::find(at.ns) });
        if s.facets <= 0.0 || at.ns == Vec3::ZERO {
            guide.tables = [even; 2];
            guide.shares = [1.0, 0.0];
            let table = self.table(even);
            guide.worth = table.map_or(0.0, |t| worth(t.total, t.whole));
            return table.is_some();
        }
        let mirrored = (2.0 * at.ns.dot(lobes.wo) * at.ns - lobes.wo).normalize_or(at.ns);
        let facets = number(1 + width_of(s.alpha), octahedron::find(mirrored));
        let sums = |number: u32, part: f32| match self.table(number) {
            Some(t) if part > 0.0 => [part * t.total, part * t.whole],
            _ => [0.0; 2],
        };
        let (of_even, of_facets) = (sums(even, s.even), sums(facets, s.facets));
        let sum = of_even[0] + of_facets[0];
        guide.tables = [even, facets];
        guide.shares = [of_even[0] / sum, of_facets[0] / sum];
        guide.worth = worth(sum, of_even[1] + of_facets[1]);
        sum > 0.0 && sum.is_finite()
    }

    /// Sets that would have the same tables are one.
    #[inline]
    fn set_of(&self, lobes: &Lobes) -> Set {
        match Set::of(lobes) {
            Set::Alone(_) if self.peaks.is_empty() || !self.is_one_peak => Set::Alone(1),
            set => set,
        }
    }

    /// The table of a number; None if all is black there. After the first time, two loads.
    #[inline]
    fn table(&self, number: u32) -> Option<&Table> {
        let (kind, which) = (number as usize / OF_KIND, number as usize % OF_KIND);
        let of_kind = self.tables[kind].get_or_init(|| (0..OF_KIND).map(|_| OnceLock::new()).collect());
        of_kind[which].get_or_init(|| self.make(kind, which)).as_deref()
    }

    #[cold]
    fn make(&self, kind: usize, which: usize) -> Option<Box<Table>> {
        let cells = &self.cells;
        let (axis, spread) = if which == ALL_ROUND { (Vec3::Y, 0.0) } else { octahedron::middle(which) };
        let about = About { axis, spread };
        let mut weights = vec![1.0; cells.flux.len()];
        match kind % KINDS {
            _ if which == ALL_ROUND => {}
            0 => dispatch(Even { cells, normals: about, weights: &mut weights }),
            width => {
                let alpha = 0.5f32.powf(0.5 * (width - 1) as f32);
                dispatch(Facets { cells, mirrored: about, alpha, weights: &mut weights });
            }
        }
        let sum = |of: &[f32]| of.iter().zip(&weights).map(|(x, w)| f64::from(x * w)).sum::<f64>();
        let set = if kind == PLAIN { None } else { Some(Set::numbered(kind / KINDS)) };
        if set != Some(Set::Helped) {
            weights.iter_mut().zip(&cells.flux).for_each(|(w, flux)| *w *= flux);
            if let Some(Set::Alone(bits)) = set {
                self.limit_peaks(bits, &mut weights);
            }
        } else {
            let (flux, angle) = (sum(&cells.flux), sum(&cells.angle));
            let mean = if angle > 0.0 { (flux / angle) as f32 } else { 0.0 };
            let light = cells.flux.iter().zip(&cells.angle);
            weights.iter_mut().zip(light).for_each(|(w, (flux, angle))| *w *= (flux - mean * angle).max(0.0));
            // What rounding leaves of an even sky is nothing.
            let left: f64 = weights.iter().map(|w| f64::from(*w)).sum();
            if left < LEAST_LEFT * flux {
                return None;
            }
            let mut table = Table::new(&weights, &self.places(axis))?;
            table.whole = flux as f32;
            return Some(table);
        }
        Table::new(&weights, &self.places(axis))
    }

    /// Takes from the peaks what they have beyond their part, one over a power of two.
    fn limit_peaks(&self, bits: u32, weights: &mut [f32]) {
        let peaks: f32 = self.peaks.iter().map(|&i| weights[i]).sum();
        let rest = weights.iter().sum::<f32>() - peaks;
        let part = 0.5f32.powi(bits as i32);
        let most = rest * part / (1.0 - part);
        if rest > 0.0 && peaks > most {
            self.peaks.iter().for_each(|&i| weights[i] *= most / peaks);
        }
    }

    /// Peaks first: where they have a half, it is one half of the numbers.
    fn places(&self, axis: Vec3) -> Places {
        let mut places = Places::new(&self.cells, axis);
        self.peaks.iter().for_each(|&i| places.put_first(i));
        places
    }

    /// A cell and a place in it.
    #[inline]
    pub fn sample(&self, guide: &Guide, u: [f64; 2]) -> Option<Choice> {
        let (mut number, mut x) = (guide.tables[0], u[0]);
        if guide.worth < 1.0 {
            let worth = f64::from(guide.worth);
            if x >= worth {
                return None;
            }
            x /= worth;
        }
        if guide.shares[1] > 0.0 {
            let first = f64::from(guide.shares[0]);
            (number, x) = match x < first {
                true => (number, x / first),
                false => (guide.tables[1], (x - first) / (1.0 - first)),
            };
        }
        let found = self.table(number)?.find([x, u[1]]);
        let patches = self.partition.patches();
        Some(match patches.get(found.cell) {
            Some(_) => {
                let (patch, part) = self.partition.within(found.cell, found.u);
                let density = self.pmf(guide, found.cell) * patch.density;
                Choice::Map { at: self.partition.point(patch, part), density }
            }
            None => Choice::Disc { disc: found.cell - patches.len(), u: found.u },
        })
    }

    /// The probability that a sample is taken, and of a cell; discs come after those of the map.
    #[inline]
    pub fn pmf(&self, guide: &Guide, cell: usize) -> f64 {
        let one = |k: usize| match guide.shares[k] {
            s if s > 0.0 => f64::from(s) * self.table(guide.tables[k]).map_or(0.0, |t| t.pmf(cell)),
            _ => 0.0,
        };
        (one(0) + one(1)) * f64::from(guide.worth)
    }

    /// The density per u and v of the charts at a point.
    #[inline]
    pub fn density(&self, guide: &Guide, at: ChartPoint) -> f64 {
        let (cell, patch) = self.partition.find(at);
        self.pmf(guide, cell) * patch.density
    }

    /// The cell of the map that a point lies in.
    #[cfg(test)]
    pub fn cell_of(&self, at: ChartPoint) -> usize {
        self.partition.find(at).0
    }

    /// The probability of a disc.
    #[inline]
    pub fn disc_pmf(&self, guide: &Guide, disc: usize) -> f64 {
        self.pmf(guide, self.partition.patches().len() + disc)
    }

    /// Largest luminance of a cell of the finest grid, without the sky's intensity.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Flux of the map, without the sky's intensity.
    pub fn map_flux(&self) -> f64 {
        self.map_flux
    }

    /// Number of cells of the map.
    pub fn cells(&self) -> usize {
        self.partition.patches().len()
    }

    /// For people.
    pub fn describe(&self) -> String {
        format!("by {} cells and the surface", self.cells())
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let made = |t: &Tables| {
            let all = t.get().map_or(&[][..], |t| t);
            let tables = all.iter().filter_map(|t| t.get()?.as_deref());
            size_of_val(all) + tables.map(Table::memory).sum::<usize>()
        };
        let tables: usize = self.tables.iter().map(made).sum();
        self.partition.memory() + self.cells.memory() + tables as u64
    }
}
