//! What is promised, what was found, and the verdict.

use super::RayKind;
use super::quadrics::MAX_ULP;
use super::spawn::MAX_OFFSET;
use super::tally::Tally;
use super::topology::Topology;
use serde::Serialize;

/// Everything that is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Check {
    /// Rays from inside in random directions.
    LeaksAtRandom,
    /// Rays from inside at vertices.
    LeaksAtVertices,
    /// Rays from inside at edges.
    LeaksAtEdges,
    /// Rays from inside just beside vertices and edges.
    LeaksBeside,
    /// Spawned rays that meet what they left.
    SelfHits,
    /// Spawned rays that meet a neighbour which they move away from.
    Neighbours,
    /// Spawned rays that pass a sheet four bounds away.
    Tunnelling,
    /// The same, started where smooth shading lifts them to.
    LiftedTunnelling,
    /// How far origins are moved.
    Offset,
    /// How far points lie from their triangle.
    Point,
    /// How far a kernel's distance is off.
    Distance,
    /// Whether a quadric is hit or missed.
    QuadricDecision,
    /// How far points lie from their sphere, in units in the last place of its radius.
    SphereUlp,
    /// How far points lie from their quadric.
    QuadricPoint,
    /// Rays that leave a quadric outwards and meet it again.
    QuadricSelfHits,
}

/// Kernels that promise to be strictly watertight (ARCHITECTURE.md, and the design's "numbers we do not compromise").
/// Embree's robust mode is known to leak at vertices and promises nothing there: what it does is reported.
const WATERTIGHT: &[&str] = &["bvh", "brute"];

impl Check {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Check::LeaksAtRandom => "leaks, random rays",
            Check::LeaksAtVertices => "leaks, at vertices",
            Check::LeaksAtEdges => "leaks, at edges",
            Check::LeaksBeside => "leaks, just beside",
            Check::SelfHits => "self-hits",
            Check::Neighbours => "neighbours met that the ray moves away from",
            Check::Tunnelling => "tunnelling, sheet 4 bounds away",
            Check::LiftedTunnelling => "the same, lifted by smooth shading",
            Check::Offset => "offset / (bound + one f32 spacing)",
            Check::Point => "point off its triangle / bound",
            Check::Distance => "kernel's t off the refined / due",
            Check::QuadricDecision => "wrong hit or miss",
            Check::SphereUlp => "point off the sphere, ulp of its radius",
            Check::QuadricPoint => "point off the quadric / bound",
            Check::QuadricSelfHits => "self-hits",
        }
    }

    /// The largest value that keeps the promise, where a value is measured.
    pub fn limit(self) -> Option<f64> {
        match self {
            Check::Offset => Some(MAX_OFFSET),
            Check::SphereUlp => Some(MAX_ULP),
            Check::Point | Check::Distance | Check::QuadricPoint => Some(1.0),
            _ => None,
        }
    }

    /// Whether the kernel of this name promises that no ray fails.
    pub fn is_promised(self, kernel: &str) -> bool {
        match self {
            Check::LeaksAtRandom | Check::LeaksAtVertices | Check::LeaksAtEdges | Check::LeaksBeside => {
                WATERTIGHT.contains(&kernel)
            }
            // The bound is that of the primitive that was left; a large neighbour is known less well than that. And
            // smooth shading moves origins on purpose.
            Check::Neighbours | Check::LiftedTunnelling => false,
            _ => true,
        }
    }
}

/// What a count means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Standing {
    /// A promise, and no ray broke it.
    Kept,
    /// A promise that rays broke.
    Broken,
    /// No promise; the count is what it is.
    Reported,
    /// No ray could be tried.
    Untried,
}

/// One check on one kernel.
#[derive(Debug, Clone, Serialize)]
pub struct Entry {
    /// Name of the kernel.
    pub kernel: String,
    /// What came of its rays.
    #[serde(flatten)]
    pub tally: Tally,
    /// What that means.
    pub standing: Standing,
}

/// One check of one body in one placement, on all kernels.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// What is checked.
    pub check: Check,
    /// The shape.
    pub body: String,
    /// Where it is put, or from where it is seen.
    pub placement: String,
    /// One for each kernel that could be built.
    pub entries: Vec<Entry>,
}

/// A kernel that was checked.
#[derive(Debug, Clone, Serialize)]
pub struct KernelFacts {
    /// Name.
    pub name: String,
    /// Name and version in full.
    pub version: String,
}

/// What is known of a mesh, as it is.
#[derive(Debug, Clone, Serialize)]
pub struct MeshFacts {
    /// The shape.
    pub body: String,
    /// Whether inside and outside can be told.
    pub closed: bool,
    /// Its edges and holes.
    pub topology: Topology,
    /// Triangles left out for having no area, indices out of range, or corners that are not finite.
    pub dropped: u64,
    /// Points inside from which rays were sent.
    pub points_inside: usize,
}

/// The whole.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Certificate {
    /// What was read.
    pub input: String,
    /// Rays of each kind that were asked for.
    pub rays: u64,
    /// Seed of every random choice.
    pub seed: u64,
    /// The kinds that were asked for; all where empty.
    pub kinds: Vec<RayKind>,
    /// The kernels.
    pub kernels: Vec<KernelFacts>,
    /// The meshes.
    pub meshes: Vec<MeshFacts>,
    /// Every check.
    pub rows: Vec<Row>,
    /// What could not be checked, and why.
    pub notes: Vec<String>,
}

impl Certificate {
    /// Adds what one kernel did in one check of a body in a placement.
    pub fn add(&mut self, check: Check, [body, placement]: [&str; 2], kernel: &str, tally: Tally) {
        let standing = match tally {
            t if t.tried == 0 => Standing::Untried,
            _ if !check.is_promised(kernel) => Standing::Reported,
            t if t.failed > 0 => Standing::Broken,
            _ => Standing::Kept,
        };
        let entry = Entry { kernel: kernel.to_owned(), tally, standing };
        let at = |r: &&mut Row| r.check == check && r.body == body && r.placement == placement;
        match self.rows.iter_mut().rev().find(at) {
            Some(row) => row.entries.push(entry),
            None => {
                let (body, placement) = (body.to_owned(), placement.to_owned());
                self.rows.push(Row { check, body, placement, entries: vec![entry] });
            }
        }
    }

    /// Every promise that was broken: the row and the entry.
    pub fn broken(&self) -> impl Iterator<Item = (&Row, &Entry)> {
        let entries = self.rows.iter().flat_map(|r| r.entries.iter().map(move |e| (r, e)));
        entries.filter(|(_, e)| e.standing == Standing::Broken)
    }

    /// One sentence.
    pub fn verdict(&self) -> String {
        let kept = self.rows.iter().flat_map(|r| &r.entries).filter(|e| e.standing == Standing::Kept).count();
        match self.broken().next() {
            None => format!("all {kept} promises that could be tried are kept"),
            Some((row, entry)) => format!(
                "{} promises are broken; the first: {}, {}, {} ({}): {} of {} rays",
                self.broken().count(),
                entry.kernel,
                row.check.name(),
                row.body,
                row.placement,
                entry.tally.failed,
                entry.tally.tried
            ),
        }
    }
}
