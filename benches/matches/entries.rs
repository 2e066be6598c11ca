//! What is compared with what, and where each limit comes from.

use super::peers::agreement;
use super::picture::Encoding;
use super::tiles::Allowed;

/// A scene and the picture that others made of it.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Below the crate if it starts with `tests/`, else below the shared data.
    pub scene: &'static str,
    /// Below the shared data.
    pub reference: &'static str,
    /// How the reference holds radiance.
    pub encoding: Encoding,
    /// The kernels that render it.
    pub kernels: &'static [Kernel],
    /// Samples a pixel, where not the scene's.
    pub spp: Option<u32>,
    /// Longest path, where not the scene's.
    pub max_depth: Option<u32>,
    /// Points, where not the scene's: whoever clips or encodes noise must have the same noise.
    pub sampler: Option<&'static str>,
    /// What is looked at.
    pub checks: Vec<Check>,
}

/// A kernel, and the part of the film it renders (x0, x1, y0, y1 as fractions).
#[derive(Debug, Clone, Copy)]
pub struct Kernel {
    /// Its name.
    pub name: &'static str,
    /// None is all.
    pub crop: Option<[f64; 4]>,
}

/// One figure of an entry, with its limit.
#[derive(Debug, Clone)]
pub struct Check {
    /// Which figure.
    pub metric: Metric,
    /// It is to be no worse than this.
    pub limit: f64,
    /// Where the limit comes from.
    pub why: String,
}

/// Figures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Metric {
    /// Largest relative difference of a channel's mean.
    Mean,
    /// Decibels; the limit is the least.
    Psnr,
    /// Mean error.
    Flip,
    /// Root mean square of the scores of tiles.
    Tiles(Allowed),
    /// The largest score of a tile.
    WorstTile(Allowed),
    /// Share of pixels that stand out of the differences around them; the number is what is no difference.
    Outliers(f64),
}

const AUTO: &[Kernel] = &[Kernel { name: "auto", crop: None }];

/// Brute force tests every ray against all there is: a part in the middle has to do.
const EVERY: &[Kernel] = &[
    Kernel { name: "bvh", crop: None },
    Kernel { name: "embree", crop: None },
    Kernel { name: "brute", crop: Some([0.3, 0.7, 0.3, 0.7]) },
];

fn check(metric: Metric, limit: f64, why: impl Into<String>) -> Check {
    Check { metric, limit, why: why.into() }
}

/// All of them, in the order of the table.
pub fn all() -> Vec<Entry> {
    [course_exact(), course_sampled(), seed(), bitterli(), mitsuba()].concat()
}

/// Scene, picture.
const COURSE_EXACT: &[[&str; 2]] = &[
    ["hw1/scene4-ambient.test", "scene4-ambient.png"],
    ["hw1/scene4-diffuse.test", "scene4-diffuse.png"],
    ["hw1/scene4-emission.test", "scene4-emission.png"],
    ["hw1/scene4-specular.test", "scene4-specular.png"],
    ["hw1/scene5.test", "scene5.png"],
    ["hw1/scene6.test", "scene6.png"],
    ["hw1/scene7.test.zst", "scene7.png"],
    ["hw2/analytic.test", "analytic.png"],
];

/// Scene, picture; 8-bit values hold radiance, or where the scene has a `gamma` its root.
const COURSE_SAMPLED: &[([&str; 2], Encoding)] = &[
    (["hw2/cornell.test", "cornell.png"], Encoding::Course),
    (["hw2/direct3x3.test", "direct3x3.png"], Encoding::Course),
    (["hw2/direct9.test", "direct9.png"], Encoding::Course),
    (["hw2/dragon.test.zst", "dragon.png"], Encoding::Course),
    (["hw2/sphere.test", "sphere.png"], Encoding::Course),
    (["hw3/cornellNEE.test", "cornellNEE.png"], Encoding::Course),
    (["hw3/cornellRR.test", "cornellRR.png"], Encoding::Course),
    (["hw3/cornellSimple.test", "cornellSimple.png"], Encoding::Course),
    (["hw3/dragon.test.zst", "dragonRR.png"], Encoding::Course),
    (["hw4/cornellBRDF.test", "cornellBRDF.png"], Encoding::Course),
    (["hw4/cornellCosine.test", "cornellCosine.png"], Encoding::Course),
    (["hw4/dragon.test", "dragon_MIS.png"], Encoding::Gamma22),
    (["hw4/ggx.test", "ggx.png"], Encoding::Gamma22),
    (["hw4/mis.test", "mis.png"], Encoding::Gamma22),
];

fn course([scene, picture]: [&str; 2], encoding: Encoding, checks: Vec<Check>) -> Entry {
    Entry {
        scene: format!("scenes/cse168/{scene}").leak(),
        reference: format!("images/cse168-abhinandansharma1999/{picture}").leak(),
        encoding,
        kernels: AUTO,
        spp: None,
        max_depth: None,
        sampler: None,
        checks,
    }
}

fn course_exact() -> Vec<Entry> {
    let entry = |names: &[&'static str; 2]| {
        let peers = agreement(names[1]);
        let why = match peers.psnr < 45.0 {
            true => "that of the worst of the others",
            false => "no sampling: one step of 255 in a third of the values",
        };
        course(*names, Encoding::Course, vec![check(Metric::Psnr, peers.psnr.min(45.0), why)])
    };
    COURSE_EXACT.iter().map(entry).collect()
}

fn course_sampled() -> Vec<Entry> {
    let entry = |(names, encoding): &([&'static str; 2], Encoding)| {
        let peers = agreement(names[1]);
        let spread = 100.0 * peers.spread;
        let mean = match peers.peers {
            0 => check(Metric::Mean, 0.005, "no other's figures"),
            n if peers.spread <= 0.005 => {
                check(Metric::Mean, 0.005, format!("{n} others within {spread:.2} %"))
            }
            n => check(
                Metric::Mean,
                peers.spread,
                format!("{n} others differ by up to {spread:.2} %: no more than they"),
            ),
        };
        let flip = |worst: f64| {
            check(Metric::Flip, 1.05 * worst, format!("1.05 times the worst of {}", peers.peers))
        };
        let checks = std::iter::once(mean).chain((peers.peers > 0).then(|| flip(peers.flip))).collect();
        // Values are clipped at 255 and rounded down, which makes noise a part of the mean: points as good as the scene
        // asks for, independent ones but where it stratifies the light.
        let stratified = names[0].contains("hw2/") && !names[0].contains("direct9");
        let sampler = (!stratified).then_some("independent");
        Entry { sampler, ..course(*names, *encoding, checks) }
    };
    COURSE_SAMPLED.iter().map(entry).collect()
}

fn seed() -> Vec<Entry> {
    // Two threads drew from one sequence there, so neighbours are not quite independent.
    let allowed = Allowed { relative: 0.002, absolute: 1e-4, correlation: 1.5 };
    let entry = |[scene, reference]: [&'static str; 2]| Entry {
        scene,
        reference,
        encoding: Encoding::Linear,
        kernels: EVERY,
        spp: None,
        max_depth: None,
        sampler: None,
        checks: vec![
            check(Metric::Mean, 0.005, "half a percent was asked for"),
            check(Metric::Tiles(allowed), 1.3, "1 is noise"),
            check(Metric::WorstTile(allowed), 6.0, "noise: 4 of 1,500 values"),
        ],
    };
    vec![
        entry(["images/seed-float/scene1.scene", "images/seed-float/scene1.exr"]),
        entry(["images/seed-float/skyboxtest.scene", "images/seed-float/skyboxtest.exr"]),
        entry(["images/seed-float/enviornmentmaptest.scene", "images/seed-float/enviornmentmaptest.exr"]),
        entry(["images/seed-float/primitives.scene", "images/seed-float/primitives.exr"]),
    ]
}

fn bitterli() -> Vec<Entry> {
    // Halves: 11 digits, of which a mean over tiles loses nothing; lamps' edges are filtered by a tabulated tent.
    let allowed = Allowed { relative: 0.001, absolute: 1e-5, correlation: 1.0 };
    let entry = |scene, reference, mean, why: &str| Entry {
        scene,
        reference,
        encoding: Encoding::Linear,
        kernels: AUTO,
        spp: None,
        max_depth: None,
        sampler: None,
        checks: vec![
            check(Metric::Mean, mean, why),
            check(Metric::Tiles(allowed), 1.2, "1 is noise"),
            check(Metric::WorstTile(allowed), 6.0, "noise: 4.3 of 10,000 values, tails beyond the normal"),
            check(Metric::Outliers(1e-4), 0.02, "0.6 % if normal; edges and rare bright paths"),
        ],
    };
    let bitterli =
        |s: &'static str| -> &'static str { format!("scenes/bitterli/{s}/pbrt/TungstenRender.exr").leak() };
    vec![
        entry("tests/scenes/cornell-box.toml", bitterli("cornell-box"), 0.002, "noise of both"),
        entry("tests/scenes/veach-mis.toml", bitterli("veach-mis"), 0.005, "half a percent, as elsewhere"),
    ]
}

fn mitsuba() -> Vec<Entry> {
    let entry = |scene, reference, max_depth, allowed, mean, why: &str| Entry {
        scene,
        reference,
        encoding: Encoding::Srgb,
        kernels: AUTO,
        spp: None,
        max_depth,
        sampler: None,
        checks: vec![
            check(Metric::Mean, mean, why),
            check(Metric::Tiles(allowed), 1.2, "1 is noise, rounding and what paints in a row lose"),
            check(Metric::WorstTile(allowed), 6.0, "noise: 4 of 3,000 values"),
            check(Metric::Outliers(0.5), 0.02, "0.6 % if normal; edges"),
        ],
    };
    // JPEG of the finest steps: colours stand at half the resolution and are rounded twice.
    let exact = Allowed { relative: 0.001, absolute: 0.3, correlation: 1.0 };
    // White after white is 0.1 % off, red of red after white 0.4 %, and so half of it after encoding; what red paint sends
    // to red paint is off by 2 % of red in the other channels, a step or two of 255.
    let paints = Allowed { relative: 0.003, absolute: 0.5, correlation: 1.0 };
    let cbox = "tests/scenes/mitsuba-cbox.toml";
    vec![
        entry(
            "tests/scenes/mitsuba-cbox-lamp.toml",
            "scenes/mitsuba/reference/integrator_depth_1.jpg",
            None,
            exact,
            0.01,
            "edges of the lamp, all there is",
        ),
        entry(
            cbox,
            "scenes/mitsuba/reference/integrator_depth_2.jpg",
            Some(1),
            exact,
            0.005,
            "rounding to bytes, twice",
        ),
        entry(
            cbox,
            "scenes/mitsuba/reference/integrator_depth_3.jpg",
            Some(2),
            paints,
            0.01,
            "three channels for a spectrum: blue of white after red is 7 % off",
        ),
        entry(
            cbox,
            "scenes/mitsuba/reference/integrator_depth_inf.jpg",
            None,
            paints,
            0.01,
            "three channels for a spectrum: blue of white after red is 7 % off",
        ),
    ]
}
