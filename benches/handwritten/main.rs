//! How much a whole render of the plainest scene takes over a program that was written for that scene alone.
//!
//!     cargo bench --bench handwritten [-- --runs N] [--spp N] [--threads N] [--backend NAME] [--side NAME]
//!
//! `plain.toml`: 300,000 triangles, one diffuse material, the same sky from everywhere, a pinhole, direct light,
//! 1920x1080, 16 samples a pixel. The hand-written side (`kernel.rs`, `scatter.rs`) traces the same samples through bare
//! Embree; skylit renders as `skylit render` does, with Embree as its kernel unless `--backend` says otherwise, so that
//! what differs is what stands around the kernel. The scene's filter is a box, the plainest, too.
//!
//! Both sides run in turn (A B, then B A), N times each (5), in two ways: with a ray for every sample, and without rays for
//! pixels that no triangle projects into. First, the two pictures must be the same but for rounding. Asked: a ratio of
//! at most 1.10; the medians are printed with the least and the largest. Ratios of processor time come beside those of
//! the clock: other programs on the machine disturb them less. `--side skylit` and `--side hand` run one side alone,
//! without rays for bare pixels: for `perf record`.

#![expect(unsafe_code, reason = "bare calls of Embree, to compare with")]

mod embree;
mod kernel;
mod scatter;

use embree::{CALL, Mesh};
use kernel::{Film, Kernel};
use skylit::base::intersectable::KernelOptions;
use skylit::base::registry::build;
use skylit::formats;
use skylit::integrators::{self, Integrator};
use skylit::render::dealing::Dealing;
use skylit::render::settings::RenderSettings;
use skylit::render::{Rendered, Renderer, Silent};
use skylit::scene::Scene;
use skylit::scene::build::{BuildOptions, build as build_scene};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Largest relative difference of the means over all pixels that show nothing but surface, and over the whole picture. Four
/// million samples of their own on either side would differ by 3.4e-4 (one standard deviation of 0.32 over the mean of
/// 0.64, over the root of their number, times the root of two). Both sides take the same samples, so that what is left is
/// rounding: a ray here and there that passes an edge or does not.
const SAME: f64 = 1e-4;

/// What is asked of skylit's time over that of the hand-written kernel.
const ASKED: f64 = 1.10;

struct Options {
    spp: Option<u32>,
    threads: usize,
    runs: usize,
    backend: String,
    side: Option<String>,
}

fn options() -> Options {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let mut o = Options { spp: None, threads, runs: 5, backend: "embree".into(), side: None };
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(a) = args.next() {
        let value = args.next().unwrap_or_else(|| panic!("{a} takes a value"));
        let number = || value.parse::<u32>().unwrap_or_else(|_| panic!("{a} takes a number, not {value}"));
        match a.as_str() {
            "--spp" => o.spp = Some(number()),
            "--threads" => o.threads = number().max(1) as usize,
            "--runs" => o.runs = number().max(1) as usize,
            "--backend" => o.backend = value,
            "--side" => o.side = Some(value),
            _ => panic!("unknown flag {a}; known: --spp --threads --runs --backend --side"),
        }
    }
    o
}

/// Both sides of the comparison.
struct Sides {
    scene: Scene,
    integrator: Arc<dyn Integrator>,
    settings: RenderSettings,
    kernel: Kernel,
    pool: rayon::ThreadPool,
}

impl Sides {
    fn new(o: &Options) -> Self {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/handwritten/plain.toml"));
        let desc = formats::load(path).expect("the scene loads");
        let mut settings = RenderSettings::of_scene(&desc).expect("the scene's settings are known");
        settings.threads = o.threads;
        settings.spp = o.spp.unwrap_or(settings.spp);
        // Samples for samples: the other side knows of no pixels that take more of them.
        (settings.outlines, settings.dealing) = (Some(1), Dealing::Even);
        assert!(settings.spp > 1 && settings.spp as usize <= CALL, "from 2 to {CALL} samples a pixel");
        let node = desc.render.integrator.clone().expect("the scene names its integrator");
        let integrator = build("integrator", integrators::REGISTRY, &node).expect("the integrator is there");
        let expected_rays = settings.crop.area() as u64 * u64::from(settings.spp) * 2;
        let kernel = KernelOptions { threads: o.threads, expected_rays, ..KernelOptions::default() };
        let scene = build_scene(desc, &BuildOptions { backend: o.backend.clone(), kernel });
        let scene = scene.expect("the scene builds");
        let [leaf] = &scene.geometry.root().leaves[..] else { panic!("the scene is one mesh") };
        let kernel = Kernel {
            mesh: Mesh::new(leaf.shape.triangles().expect("the scene is one mesh")),
            camera: scene.camera.projection().expect("the camera is a pinhole"),
            size: settings.size,
            points: settings.points(),
            spp: settings.spp,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(o.threads).build().expect("threads");
        Sides { scene, integrator, settings, kernel, pool }
    }

    fn skylit(&self, skip: bool) -> Rendered {
        let settings = RenderSettings { skip_background: skip, ..self.settings.clone() };
        let renderer = Renderer { integrator: self.integrator.clone(), settings };
        renderer.render(&self.scene, &Silent).expect("renders")
    }

    fn by_hand(&self, skip: bool) -> Film {
        self.pool.install(|| self.kernel.render(skip))
    }

    /// Holds the pictures against each other.
    fn compare(&self, skip: bool) {
        let (ours, theirs) = (self.skylit(skip), self.by_hand(skip));
        let [w, h] = self.settings.size;
        let (mut surface, mut all, mut apart) = ([0.0; 2], [0.0; 2], 0.0);
        let mut pixels = 0u32;
        for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
            let a = f64::from(ours.film.mean(x, y).luminance());
            let [r, g, b] = theirs[(y * w + x) as usize];
            let b = f64::from(skylit::color::Rgb::new(r, g, b).luminance());
            all = [all[0] + a, all[1] + b];
            if ours.film.alpha(x, y) == 1.0 {
                surface = [surface[0] + a, surface[1] + b];
                apart += (a - b).abs();
                pixels += 1;
            }
        }
        let difference = |[a, b]: [f64; 2]| a / b - 1.0;
        println!(
            "{}: {pixels} pixels of surface, mean {:.5}; skylit / hand-written - 1 = {:+.1e} (whole picture {:+.1e}), \
             pixel by pixel {:.1e}",
            way(skip),
            surface[1] / f64::from(pixels),
            difference(surface),
            difference(all),
            apart / surface[1],
        );
        let (rays, spp) = (ours.stats.rays, u64::from(self.settings.spp));
        let marked = self.kernel.covered().iter().filter(|c| **c || !skip).count() as u64;
        let others = rays.total() - rays.camera;
        println!(
            "   camera rays: skylit {} (and {others} others), hand-written {}",
            rays.camera,
            marked * spp
        );
        assert!(pixels > 0, "no pixel shows nothing but surface");
        assert!(difference(surface).abs() <= SAME, "the surfaces differ by more than {SAME:.0e}");
        assert!(difference(all).abs() <= SAME, "the pictures differ by more than {SAME:.0e}");
    }
}

fn way(skip: bool) -> &'static str {
    if skip { "bare pixels without rays" } else { "a ray for every sample" }
}

/// Seconds by the clock, and of the processor.
#[derive(Clone, Copy)]
struct Seconds {
    clock: f64,
    processor: f64,
}

fn timed(f: impl FnOnce()) -> Seconds {
    let (start, before) = (Instant::now(), processor_seconds());
    f();
    Seconds { clock: start.elapsed().as_secs_f64(), processor: processor_seconds() - before }
}

/// Processor time of this process so far, in steps of a hundredth of a second; not a number where there is no /proc.
fn processor_seconds() -> f64 {
    let read = || {
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        // Fields 14 and 15 of proc(5); the second, which may hold spaces, ends with the last parenthesis.
        let fields = text.rsplit_once(')')?.1.split_whitespace().skip(11).take(2);
        Some(fields.filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() / 100.0)
    };
    read().unwrap_or(f64::NAN)
}

/// Median, least and largest.
fn spread(mut v: Vec<f64>) -> String {
    v.sort_by(f64::total_cmp);
    format!("{:.3} ({:.3} to {:.3})", v[v.len() / 2], v[0], v[v.len() - 1])
}

fn main() {
    let o = options();
    let sides = Sides::new(&o);
    let [w, h] = sides.settings.size;
    println!(
        "{w}x{h}, {} spp, {} filter, {} threads, {}",
        sides.settings.spp,
        sides.settings.filter.name(),
        o.threads,
        sides.scene.kernel.describe()
    );
    match o.side.as_deref() {
        Some("skylit") => return (0..o.runs).for_each(|_| drop(sides.skylit(true))),
        Some("hand") => return (0..o.runs).for_each(|_| drop(sides.by_hand(true))),
        Some(other) => panic!("unknown side {other}; known: skylit hand"),
        None => {}
    }
    let ways = [false, true];
    ways.iter().for_each(|&skip| sides.compare(skip));
    let mut ratios = [(); 2].map(|()| (Vec::new(), Vec::new()));
    println!("   skylit s   hand-written s   ratio   of processor time");
    for run in 0..o.runs {
        for (&skip, (clock, processor)) in ways.iter().zip(&mut ratios) {
            let skylit = || timed(|| drop(sides.skylit(skip)));
            let by_hand = || timed(|| drop(sides.by_hand(skip)));
            let (ours, theirs) = if run % 2 == 0 {
                let ours = skylit();
                (ours, by_hand())
            } else {
                let theirs = by_hand();
                (skylit(), theirs)
            };
            clock.push(ours.clock / theirs.clock);
            processor.push(ours.processor / theirs.processor);
            println!(
                "   {:8.3}   {:14.3}   {:5.3}   {:5.3}   {}",
                ours.clock,
                theirs.clock,
                ours.clock / theirs.clock,
                ours.processor / theirs.processor,
                way(skip)
            );
        }
    }
    for (&skip, (clock, processor)) in ways.iter().zip(ratios) {
        println!(
            "{}: skylit / hand-written, median (least to largest) {}, of processor time {}; asked: at most {ASKED:.2}",
            way(skip),
            spread(clock),
            spread(processor)
        );
    }
}
