//! Scenes through every kernel: whatever differs is explained by rounding.

use crate::common::integrator;
use skylit::accel::KERNELS;
use skylit::base::intersectable::KernelOptions;
use skylit::crosscheck::compare::Contender;
use skylit::crosscheck::summary::Summary;
use skylit::crosscheck::{Plan, run};
use skylit::render::Silent;
use skylit::render::settings::RenderSettings;
use skylit::scene::build::{BuildOptions, build};
use std::path::Path;
use std::sync::Arc;

/// Small pictures of few samples: some ten thousand rays a scene.
#[test]
fn every_kernel_passes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // Groups within groups; a mesh under a picture of a sky; area lights. The others take long to generate.
    for name in ["scenes/nested.toml", "tests/reference/clay.toml", "tests/reference/lamps.toml"] {
        let mut desc = skylit::formats::load(&root.join(name)).unwrap();
        desc.film.size = [80, 45];
        let mut scene =
            build(desc, &BuildOptions { backend: "brute".into(), ..BuildOptions::default() }).unwrap();
        let others = KERNELS.iter().filter(|k| k.name != "brute");
        let contenders: Vec<Contender> = others
            .map(|k| Contender {
                name: k.name.into(),
                kernel: Arc::from((k.build)(scene.geometry.clone(), &KernelOptions::default()).unwrap()),
            })
            .collect();
        if contenders.is_empty() {
            return;
        }
        let settings = RenderSettings { spp: 2, threads: 2, ..RenderSettings::new([80, 45]) };
        let integrator = integrator("path", &[("max_depth", 4.0)]);
        let plan = Plan { contenders, integrator, settings, oracle_tests: 100_000_000 };
        let check = run(&mut scene, &plan, &Silent).unwrap();
        assert!(check.passed(), "{name}\n{}", Summary::new(&check, &scene, "skylit"));
        assert_eq!(check.rays.camera, 80 * 45 * 2);
    }
}
