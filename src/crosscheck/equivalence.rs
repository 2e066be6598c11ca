//! Do all kernels give the same light? Pictures by each, with more samples until two one-sided tests know.
//!
//! A picture by one kernel differs from that of another only in the paths on which the kernels do, as all random choices are
//! the same: common random numbers. So it is differences of half-buffers that vary ([`Design::Paired`]), and these are
//! zero but for few pixels: far fewer samples tell a margin than independent pictures would need. With `independent` every
//! kernel has choices of its own: for those who trust nothing that is shared.
//!
//! Rounds double the samples; each has a seed of its own. A question that is asked in every round would be answered wrongly
//! in one of them by chance, so round k = 1, 2, ... has 6 / (pi k)^2 of the level: these add up to 1. Pictures that differ in
//! few paths, or none, may have missed those that matter: of paths that n samples did not meet, there is less than a share of
//! ln(1 / level) / n. No answer is *equivalent* before that share, of light as bright as the brightest pixel, is below
//! the margin. Which rounds there are depends on the scene, the settings and, with a limit of time, on how many the clock
//! allowed to begin; what a round brings does not depend on it.

use super::compare::{Contender, Shared};
use super::pictures::plain;
use crate::compare::statistics::equivalence::{Answer, Equivalence, Levels, ask};
use crate::compare::statistics::pair::{Design, LUMINANCE, Pair};
use crate::compare::statistics::replicates::{Origin, Replicates};
use crate::error::{Error, Result};
use crate::integrators::Integrator;
use crate::render::film::Film;
use crate::render::settings::RenderSettings;
use crate::render::{Progress, Renderer};
use crate::sampler::Sampler;
use crate::sampler::hash::mix64;
use crate::scene::Scene;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What is asked.
#[derive(Clone)]
pub struct Plan {
    /// At least two kernels over the scene's geometry; the first is the reference.
    pub contenders: Vec<Contender>,
    /// What is rendered with them.
    pub integrator: Arc<dyn Integrator>,
    /// How; `spp` is that of the first round.
    pub settings: RenderSettings,
    /// As a share of the mean, above 0 and below 1.
    pub margin: f64,
    /// How often *different* may be wrong.
    pub alpha: f64,
    /// Whether each kernel has a seed of its own.
    pub independent: bool,
    /// No round begins that would bring a pixel more samples than this.
    pub most_spp: u32,
    /// No round but the first begins later than this.
    pub time: Option<Duration>,
}

/// How often *equivalent* may be wrong.
const EQUIVALENT: f64 = 0.05;

/// One kernel against the first.
#[derive(Debug, Clone, Serialize)]
pub struct Against {
    /// The kernel.
    pub kernel: String,
    /// Pixels whose halves have other bits.
    pub differing: usize,
    /// The last round's answer.
    pub equivalence: Equivalence,
}

/// What came out.
#[derive(Debug, Clone, Serialize)]
pub struct Equal {
    /// Of all kernels together.
    pub answer: Answer,
    /// One line.
    pub sentence: String,
    /// The kernel that others are held against.
    pub reference: String,
    /// paired or independent.
    pub design: Design,
    /// Rounds that were rendered.
    pub rounds: u32,
    /// Samples a pixel in all of them.
    pub spp: u64,
    /// The seeds of the rounds follow from this one.
    pub seed: u64,
    /// Every kernel but the first.
    pub against: Vec<Against>,
}

/// Renders and asks. The scene's kernel stands in its place again afterwards.
///
/// # Errors
/// Less than two kernels; a bad margin; what a render fails with.
pub fn run(scene: &mut Scene, plan: &Plan, progress: &dyn Progress) -> Result<Equal> {
    if plan.contenders.len() < 2 {
        return Err(Error::Usage("--equivalent compares kernels: at least two are needed".into()));
    }
    if !(plan.margin > 0.0 && plan.margin < 1.0) {
        return Err(Error::Usage("a margin (--equivalent) lies above 0 and below 100 %".into()));
    }
    let start = Instant::now();
    let mut films: Vec<Option<Film>> = vec![None; plan.contenders.len()];
    let (mut rounds, mut spp) = (0, 0);
    let mut of_round = plan.settings.spp.max(2);
    loop {
        for (k, film) in films.iter_mut().enumerate() {
            let more = render(scene, plan, k, rounds, of_round, progress)?;
            match film {
                Some(film) => film.merge(&more),
                None => *film = Some(more),
            }
        }
        rounds += 1;
        spp += u64::from(of_round);
        let done: Vec<&Film> = films.iter().flatten().collect();
        let equal = judge(plan, &done, rounds, spp)?;
        of_round = spp.min(1 << 20) as u32;
        let late = plan.time.is_some_and(|t| start.elapsed() >= t);
        let out_of_budget = late || spp + u64::from(of_round) > u64::from(plan.most_spp);
        if equal.answer != Answer::NotEnoughSamples || out_of_budget || progress.should_stop() {
            return Ok(equal);
        }
    }
}

fn render(
    scene: &mut Scene,
    plan: &Plan,
    kernel: usize,
    round: u32,
    spp: u32,
    progress: &dyn Progress,
) -> Result<Film> {
    let own = if plan.independent { (kernel as u64) << 32 } else { 0 };
    let settings = RenderSettings {
        spp,
        seed: if round == 0 && own == 0 {
            plan.settings.seed
        } else {
            mix64(plan.settings.seed ^ mix64(u64::from(round) | own))
        },
        // Pixels are independent of their neighbours, so that the error of the mean is known.
        moments: true,
        sampler: match plan.settings.sampler {
            Sampler::ZSobol => Sampler::OwenSobol,
            sampler => sampler,
        },
        ..plain(&plan.settings)
    };
    let shared = Box::new(Shared(plan.contenders[kernel].kernel.clone()));
    let usual = std::mem::replace(&mut scene.kernel, shared);
    let rendered = Renderer { integrator: Arc::clone(&plan.integrator), settings }.render(scene, progress);
    scene.kernel = usual;
    Ok(rendered?.film)
}

fn judge(plan: &Plan, films: &[&Film], rounds: u32, spp: u64) -> Result<Equal> {
    let replicates: Vec<Replicates> =
        films.iter().map(|f| Replicates::of_film(f, Origin::default())).collect();
    let design = if plan.independent { Design::Independent } else { Design::Paired };
    let share = 6.0 / (std::f64::consts::PI * f64::from(rounds)).powi(2);
    let others = plan.contenders.len() - 1;
    let levels = Levels { equivalent: EQUIVALENT * share, different: plan.alpha * share / others as f64 };
    let seen_enough = unseen(&replicates[0], levels.equivalent) <= plan.margin;
    let pixels: Vec<u32> = (0..films[0].window().area() as u32).collect();
    let mut against = Vec::new();
    for (contender, test) in plan.contenders.iter().zip(&replicates).skip(1) {
        let pair = Pair::new(&replicates[0], test, Some(design))?;
        let mut equivalence = ask(&pair, &pixels, plan.margin, levels)?;
        if equivalence.answer == Answer::Equivalent && !seen_enough {
            equivalence.answer = Answer::NotEnoughSamples;
            equivalence.sentence = "not enough samples to have met what is rare".into();
        }
        let differing = (0..pixels.len())
            .filter(|p| (0..2).any(|h| replicates[0].value(h, *p) != test.value(h, *p)))
            .count();
        against.push(Against { kernel: contender.name.clone(), differing, equivalence });
    }
    let has = |answer: Answer| against.iter().find(|a| a.equivalence.answer == answer);
    let (answer, of) = match (has(Answer::Different), has(Answer::NotEnoughSamples)) {
        (Some(of), _) => (Answer::Different, of),
        (_, Some(of)) => (Answer::NotEnoughSamples, of),
        _ => (Answer::Equivalent, &against[0]),
    };
    let reference = plan.contenders[0].name.clone();
    let names = match answer {
        Answer::Equivalent => against.iter().map(|a| a.kernel.as_str()).collect::<Vec<_>>().join(", "),
        _ => of.kernel.clone(),
    };
    let choices = if plan.independent { "seeds of their own" } else { "common random numbers" };
    let sentence = format!(
        "{names} against {reference}: {} ({spp} samples a pixel in {rounds} rounds, {choices})",
        of.equivalence.sentence
    );
    Ok(Equal { answer, sentence, reference, design, rounds, spp, seed: plan.settings.seed, against })
}

/// The largest share of light that paths may have which none of the samples took, with confidence 1 - `level`: that of
/// paths, times the brightest pixel over the mean.
fn unseen(picture: &Replicates, level: f64) -> f64 {
    let pixels = picture.size[0] * picture.size[1];
    let luminance = |pixel: usize| {
        let all: [f64; 2] = [0, 1].map(|half| {
            let (mean, _) = picture.value(half, pixel);
            mean.iter().zip(LUMINANCE).map(|(v, w)| v * w).sum()
        });
        (all[0] + all[1]) / 2.0
    };
    let (sum, most) = (0..pixels).map(luminance).fold((0.0, 0.0), |(s, m): (f64, f64), l| (s + l, m.max(l)));
    let samples = picture.samples().unwrap_or(0.0);
    if sum <= 0.0 || samples <= 0.0 {
        return 0.0;
    }
    -level.ln() / samples * most / (sum / pixels as f64)
}
