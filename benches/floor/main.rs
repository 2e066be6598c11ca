//! How far a whole render is from its floor: the same camera and shadow rays through Embree's fastest robust calls.
//!
//!     cargo bench --bench floor [-- SCENE.toml [--spp N] [--threads N] [--runs N]]
//!
//! Without a scene, a generated knot of 300,000 triangles under the preset `midday`, 1920x1080, 50 samples a pixel,
//! direct light. The film is cut into bands. For each band the render is timed as `skylit render` does it; then its
//! rays are recorded, batch by batch; then they are replayed, first through bare Embree (a scene of the same mesh,
//! plain arrays, the coherent flag for camera rays), then through skylit's kernel, on as many threads. So the three
//! alternate many times within one run, and drift of the machine falls on all alike.

#![expect(unsafe_code, reason = "bare calls of Embree, to compare with")]

mod bare;
mod recorder;

use bare::Bare;
use rayon::prelude::*;
use recorder::{Kind, Recorder, Tape};
use skylit::base::hit::HitBatch;
use skylit::base::intersectable::KernelOptions;
use skylit::base::pixel_rect::PixelRect;
use skylit::base::ray::Coherence;
use skylit::base::registry::{Node, build};
use skylit::formats;
use skylit::integrators::{self, Integrator};
use skylit::render::dealing::Dealing;
use skylit::render::settings::RenderSettings;
use skylit::render::{Renderer, Silent};
use skylit::scene::Scene;
use skylit::scene::build::{BuildOptions, build as build_scene};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Rows of pixels in a band: four rows of tiles, so that no thread waits long at its end.
const BAND: u32 = 64;

struct Options {
    scene: PathBuf,
    spp: u32,
    threads: usize,
    runs: usize,
}

fn options() -> Options {
    let default = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/floor/knot.toml"));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let mut o = Options { scene: default, spp: 50, threads, runs: 5 };
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(a) = args.next() {
        let mut number =
            || args.next().and_then(|v| v.parse().ok()).unwrap_or_else(|| panic!("{a} takes a number"));
        match a.as_str() {
            "--spp" => o.spp = number(),
            "--threads" => o.threads = number() as usize,
            "--runs" => o.runs = number() as usize,
            _ => o.scene = PathBuf::from(a),
        }
    }
    o
}

/// Seconds of one run over the film.
#[derive(Default, Clone, Copy)]
struct Times {
    render: f64,
    kernel: f64,
    bare: [f64; 2],
}

fn main() {
    let o = options();
    let desc = formats::load(&o.scene).expect("the scene loads");
    let size = desc.film.size;
    let kernel = KernelOptions { threads: o.threads, ..KernelOptions::default() };
    let mut scene =
        build_scene(desc, &BuildOptions { backend: "embree".into(), kernel }).expect("the scene builds");
    let bare = Bare::new(&scene);
    let (recorder, tape) = Recorder::new();
    let node = Node { kind: "direct".into(), ..Node::default() };
    let integrator = build("integrator", integrators::REGISTRY, &node).expect("the integrator is there");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(o.threads).build().expect("threads");
    println!("{}, {}x{}, {} spp, {} threads, {}", o.scene.display(), size[0], size[1], o.spp, o.threads, {
        scene.kernel.describe()
    });
    let mut ratios = Vec::new();
    println!("   render s   floor s (camera + shadow)   kernel s   render / floor");
    for _ in 0..o.runs {
        let mut sum = Times::default();
        let mut rays = [0; 2];
        for y in (0..size[1]).step_by(BAND as usize) {
            let crop = PixelRect::new(0, y, size[0], size[1].min(y + BAND));
            let settings = RenderSettings {
                crop,
                spp: o.spp,
                threads: o.threads,
                dealing: Dealing::Even,
                ..RenderSettings::new(size)
            };
            let t = band(&mut scene, &integrator, settings, &recorder, &tape, &bare, &pool);
            sum.render += t.render;
            sum.kernel += t.kernel;
            (0..2).for_each(|k| sum.bare[k] += t.bare[k]);
            (0..2).for_each(|k| rays[k] += tape.count(k));
        }
        let floor = sum.bare[0] + sum.bare[1];
        ratios.push(sum.render / floor);
        println!(
            "   {:8.2}   {floor:7.2} ({:.2} + {:.2})          {:8.2}   {:8.3}    {:.1} + {:.1} Mrays/s, {:.1} Msamples/s",
            sum.render,
            sum.bare[0],
            sum.bare[1],
            sum.kernel,
            sum.render / floor,
            rays[0] as f64 * 1e-6 / sum.bare[0],
            rays[1] as f64 * 1e-6 / sum.bare[1],
            rays[0] as f64 * 1e-6 / sum.render,
        );
    }
    ratios.sort_by(f64::total_cmp);
    println!("median of render / floor: {:.3}", ratios[ratios.len() / 2]);
}

/// One band: rendered, recorded, replayed both ways.
fn band(
    scene: &mut Scene,
    integrator: &Arc<dyn Integrator>,
    settings: RenderSettings,
    recorder: &Arc<Recorder>,
    tape: &Tape,
    bare: &Bare,
    pool: &rayon::ThreadPool,
) -> Times {
    let renderer = Renderer { integrator: integrator.clone(), settings };
    let timed = |f: &mut dyn FnMut()| {
        let start = Instant::now();
        f();
        start.elapsed().as_secs_f64()
    };
    let render = timed(&mut || drop(renderer.render(scene, &Silent).expect("renders")));
    tape.clear();
    recorder.around(scene, |scene| drop(renderer.render(scene, &Silent).expect("renders")));
    let batches = tape.batches();
    let replay = |kind: Kind| {
        timed(&mut || {
            pool.install(|| {
                let of_kind = batches.par_iter().with_max_len(1).filter(|b| b.kind == kind);
                of_kind.for_each_init(bare::Room::default, |room, b| match kind {
                    Kind::Camera => bare.closest(&b.rays, room),
                    Kind::Shadow => bare.any(&b.rays, room),
                });
            });
        })
    };
    let bare = [replay(Kind::Camera), replay(Kind::Shadow)];
    let kernel = timed(&mut || {
        pool.install(|| {
            batches.par_iter().with_max_len(1).for_each_init(
                || (HitBatch::default(), Vec::new()),
                |(hits, blocked), b| match b.kind {
                    Kind::Camera => scene.kernel.intersect_batch(&b.rays, hits, Coherence::Coherent),
                    Kind::Shadow => scene.kernel.occluded_batch(&b.rays, blocked, Coherence::Incoherent),
                },
            );
        });
    });
    Times { render, kernel, bare }
}
