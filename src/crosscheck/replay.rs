//! One ray again: how it is written on a command line, and what every kernel and the oracle say of it.

use super::compare::{Contender, Style};
use super::crossing::Crossing;
use super::judge::{Answer, Judgement};
use super::leaf_ray::Descent;
use super::oracle::Possible;
use super::triangle::TriangleTest;
use crate::base::hit::HitBatch;
use crate::base::intersectable::QueryKind;
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::scene::Scene;
use glam::Vec3;
use std::fmt::{self, Write};

/// `ox,oy,oz,dx,dy,dz,tnear,tfar[,key]` in render space: every number with as many digits as it takes to read the same
/// f32 again. The key matters where hit filters decide by it alone, and is 0 if it is left out.
pub fn write_ray(r: &Ray, with_key: bool) -> String {
    let numbers = [r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.tnear, r.tfar];
    let list: Vec<String> = numbers.iter().map(|v| short(*v)).collect();
    list.join(",") + &if with_key { format!(",{}", r.key) } else { String::new() }
}

/// The shorter of the two ways to write a number.
fn short(v: f32) -> String {
    let (plain, scientific) = (format!("{v}"), format!("{v:e}"));
    if scientific.len() < plain.len() { scientific } else { plain }
}

/// Reads what [`write_ray`] writes.
///
/// # Errors
/// Another count of numbers, something that is no number, a ray that no kernel may be given.
pub fn read_ray(s: &str) -> Result<Ray, String> {
    const FORM: &str = "takes ox,oy,oz,dx,dy,dz,tnear,tfar[,key] in render space, as a crosscheck prints it";
    let words: Vec<&str> = s.split(',').map(str::trim).collect();
    if !(8..=9).contains(&words.len()) {
        return Err(FORM.into());
    }
    let read = |w: &&str| w.parse::<f32>().map_err(|_| format!("\"{w}\" is not a number; {FORM}"));
    let n: Vec<f32> = words[..8].iter().map(read).collect::<Result<_, _>>()?;
    let key = words.get(8).map_or(Ok(0), |w| w.parse().map_err(|_| format!("\"{w}\" is not a key")))?;
    let ray =
        Ray { o: Vec3::new(n[0], n[1], n[2]), d: Vec3::new(n[3], n[4], n[5]), tnear: n[6], tfar: n[7], key };
    if !ray.is_valid() {
        return Err(
            "no kernel may be given this ray: it needs a finite origin, a finite direction other than \
            zero, and 0 <= tnear <= tfar"
                .into(),
        );
    }
    Ok(ray)
}

/// All answers of all kernels to one ray, in the order of [`super::compare::Case::answers`]. Batches are 16 copies of
/// the ray, so that kernels use the form for packets.
pub fn ask(contenders: &[Contender], ray: &Ray, query: QueryKind) -> Vec<Answer> {
    const COPIES: usize = 16;
    let mut batch = RayBatch::default();
    (0..COPIES).for_each(|_| batch.push(ray));
    let mut answers = Vec::new();
    for c in contenders {
        match query {
            QueryKind::Closest => {
                let mut hits = HitBatch::default();
                c.kernel.intersect_batch(&batch, &mut hits, Coherence::Coherent);
                answers.extend([c.kernel.intersect(ray), hits.get(0)].map(Answer::Closest));
            }
            QueryKind::Any => {
                let mut blocked = Vec::new();
                c.kernel.occluded_batch(&batch, &mut blocked, Coherence::Coherent);
                answers.extend([c.kernel.occluded(ray), blocked[0]].map(Answer::Any));
            }
        }
    }
    answers
}

/// One ray, asked of everyone.
pub struct Replay<'a> {
    scene: &'a Scene,
    ray: Ray,
    names: Vec<String>,
    possible: Possible,
    asked: Vec<(QueryKind, Vec<Answer>, Judgement)>,
}

impl<'a> Replay<'a> {
    /// Asks kernels over the scene's geometry, and the oracle about every primitive if so many tests are enough.
    pub fn new(scene: &'a Scene, contenders: &[Contender], ray: Ray, oracle_tests: u64) -> Self {
        let both = [QueryKind::Closest, QueryKind::Any].map(|q| (q, ask(contenders, &ray, q)));
        let mut tests = oracle_tests;
        let possible = Possible::of_all(&scene.geometry, &ray, &mut tests).unwrap_or_else(|| {
            let named = both[0].1.iter().filter_map(|a| if let Answer::Closest(h) = a { *h } else { None });
            Possible::of_named(&scene.geometry, &ray, named)
        });
        let asked = both.map(|(q, answers)| {
            let judgement = Judgement::new(&answers, &possible);
            (q, answers, judgement)
        });
        let names = contenders.iter().map(|c| c.name.clone()).collect();
        Replay { scene, ray, names, possible, asked: asked.into() }
    }

    /// Whether rounding explains every answer.
    pub fn passed(&self) -> bool {
        self.asked.iter().all(|(_, _, j)| j.is_explained())
    }

    /// Edge functions with their bounds, of triangles.
    fn edges(&self, path: u64, prim: u32) -> Option<TriangleTest> {
        let (leaf, local) = Descent::new(&self.ray).to_leaf(&self.scene.geometry, path)?;
        TriangleTest::new(&local, leaf.shape.triangles()?.corners(prim))
    }
}

/// `dragon, triangle 12 (path 0)`: the object's name, the primitive as its source numbers it, the path of the leaf.
pub fn name_of(scene: &Scene, path: u64, prim: u32) -> String {
    let leaf = scene.geometry.resolve(path).leaf;
    let object = scene.objects.get(leaf.object as usize).map_or("?", |o| o.name.as_str());
    match leaf.shape.triangles() {
        Some(mesh) => {
            let source = mesh.source_ids.get(prim as usize).copied().unwrap_or(prim);
            let own = if source == prim { String::new() } else { format!(", {source} in its file") };
            format!("{object}, triangle {prim}{own} (path {path})")
        }
        None => format!("{object}, primitive {prim} (path {path})"),
    }
}

/// What an answer says, in words.
pub fn say(scene: &Scene, answer: &Answer) -> String {
    match answer {
        Answer::Closest(Some(h)) => format!("t {} {}", short(h.t), name_of(scene, h.path, h.prim)),
        Answer::Closest(None) => "nothing".into(),
        Answer::Any(true) => "blocked".into(),
        Answer::Any(false) => "open".into(),
    }
}

/// Candidates that are printed, the nearest first.
const LISTED: usize = 12;

fn say_crossing(c: &Crossing) -> String {
    let met = if c.met { "met" } else { "not met" };
    let doubt = c.doubt.map_or(String::from("surely"), |d| d.text().to_owned());
    format!("t {} +- {:.2e}, {met}, {doubt}", c.t, c.reach)
}

impl fmt::Display for Replay<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "ray      {}", write_ray(&self.ray, self.ray.key != 0))?;
        for (query, answers, judgement) in &self.asked {
            writeln!(f, "{}", if *query == QueryKind::Closest { "closest hit" } else { "any hit" })?;
            for (i, (answer, ruling)) in answers.iter().zip(&judgement.rulings).enumerate() {
                let (name, style) = (&self.names[i / 2], Style::ALL[i % 2].text());
                writeln!(f, "  {name:8} {style:6}  {}: {}", say(self.scene, answer), ruling.text())?;
            }
        }
        let scope = if self.possible.complete { "of all primitives" } else { "of those that kernels name" };
        writeln!(f, "oracle, {scope}")?;
        match self.possible.truth() {
            Some(t) => writeln!(f, "  meets    {}", name_of(self.scene, t.path, t.prim))?,
            None => writeln!(f, "  meets    nothing")?,
        }
        let mut text = String::new();
        let mut nearest: Vec<_> = self.possible.candidates.iter().collect();
        nearest.sort_by(|a, b| a.crossing.t.total_cmp(&b.crossing.t));
        for c in nearest.iter().take(LISTED) {
            let name = name_of(self.scene, c.path, c.prim);
            writeln!(text, "  may meet {name}: {}", say_crossing(&c.crossing))?;
            if let Some(e) = self.edges(c.path, c.prim) {
                let pairs = e.edges.iter().zip(e.edge_bounds);
                let pairs: Vec<String> = pairs.map(|(e, b)| format!("{e:.3e} +- {b:.1e}")).collect();
                writeln!(text, "           edge functions {}", pairs.join(", "))?;
            }
        }
        if nearest.len() > LISTED {
            writeln!(text, "  and {} more beyond", nearest.len() - LISTED)?;
        }
        f.write_str(&text)?;
        let verdict = match self.passed() {
            true if self.asked.iter().all(|(_, _, j)| j.reason() == super::judge::Ruling::Right) => {
                "all agree"
            }
            true => "explained by rounding",
            false => "NOT explained",
        };
        writeln!(f, "verdict  {verdict}")
    }
}
