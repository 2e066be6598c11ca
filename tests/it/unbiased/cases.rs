//! Ten scenes, and what is on trial in them.

use crate::common::{build_on, describe};
use crate::product::{LAMP, SUN, ground_and};
use skylit::base::image_data::{ImageData, Texels};
use skylit::base::registry::{self, Node, Params, Value};
use skylit::integrators::{self, Integrator};
use skylit::render::RenderStats;
use skylit::render::adaptive::{Part, Target};
use skylit::render::dealing::Dealing;
use skylit::render::settings::RenderSettings;
use skylit::sampler::Sampler;
use skylit::scene::Scene;
use skylit::scene::desc::SceneDesc;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Pixels a side: a tile and a half, so that there are tiles of three sizes.
pub const SIDE: u32 = 24;

/// A scene, built once for each way of sampling its sky.
pub struct Case {
    pub name: &'static str,
    pub desc: SceneDesc,
    built: [OnceLock<Scene>; 3],
    spp: u32,
    max_depth: u32,
    /// Whether scattered rays alone find all light, and often enough: no small sun, no light without a surface.
    is_tame: bool,
    /// Whether there is more than one light to choose from.
    has_choice: bool,
    /// Errors that the plain estimator, and all that is on by default, meet after some rounds.
    targets: [f64; 2],
}

/// How skies are sampled, as [`Plan::sampling`] counts.
pub const SAMPLINGS: [&str; 3] = ["table", "compensated", "product"];

impl Case {
    fn new(name: &'static str, text: &str, is_tame: bool, has_choice: bool, targets: [f64; 2]) -> Self {
        Case {
            name,
            desc: describe(text),
            built: Default::default(),
            spp: 8,
            max_depth: 5,
            is_tame,
            has_choice,
            targets,
        }
    }

    pub fn scene(&self, sampling: usize) -> &Scene {
        self.built[sampling].get_or_init(|| {
            let mut desc = self.desc.clone();
            if let Some(sky) = &mut desc.sky {
                sky.sampling = Some(SAMPLINGS[sampling].into());
            }
            build_on("auto", desc)
        })
    }
}

/// Faces of few large texels, among them some that are bright: contrast, and edges for filters.
fn cube() -> Node {
    let texel = |face: usize, i: usize| match (face, i) {
        (2, 18 | 19 | 26 | 27) => [8.0, 6.0, 4.0],
        _ => [0.2, 0.3, 0.5].map(|c| c * (1 + (face * 5 + i * 7) % 11) as f32 / 4.0),
    };
    let face =
        |f| ImageData { width: 8, height: 8, texels: Texels::F32((0..64).map(|i| texel(f, i)).collect()) };
    let params = Params::new().with("path", Value::faces(std::array::from_fn(face)));
    Node { kind: "cube".into(), params, ..Node::default() }
}

/// Balls in the air: a picture that is mostly outlines.
fn balls() -> String {
    let ball = |i: u32| {
        let [x, y] = [i % 4, i / 4].map(|k| f64::from(k) * 0.7);
        let at = format!("[{}, {}, {}]", x - 1.2, y + 0.4, 0.8 - 0.3 * y);
        format!(
            "[[objects]]\nshape = {{ type = \"sphere\", center = {at}, radius = 0.15 }}\nmaterial = \"m\"\n"
        )
    };
    (0..12).map(ball).collect()
}

/// A room with a window in its ceiling, a lamp, a red box and a ball of rough glass: light comes by many ways.
fn room() -> String {
    let wall = |center: &str, u: &str, v: &str, material: &str| {
        format!(
            "[[objects]]\nshape = {{ type = \"rectangle\", center = {center}, edge_u = {u}, edge_v = {v} }}\n\
             material = \"{material}\"\n"
        )
    };
    let walls = [
        wall("[0, 0, 0]", "[0, 0, 2]", "[2, 0, 0]", "clay"),
        wall("[0, 1, -1]", "[2, 0, 0]", "[0, 2, 0]", "clay"),
        wall("[-1, 1, 0]", "[0, 2, 0]", "[0, 0, 2]", "red"),
        wall("[1, 1, 0]", "[0, 0, 2]", "[0, 2, 0]", "clay"),
        wall("[-0.5, 2, 0]", "[1, 0, 0]", "[0, 0, 2]", "clay"),
        wall("[-0.5, 1.95, 0]", "[0.8, 0, 0]", "[0, 0, 1.2]", "lamp"),
    ];
    format!(
        r#"
[film]
size = [24, 24]
[camera]
type = "perspective"
eye = [0, 1, 4.2]
look_at = [0, 1, 0]
fov_deg = 42
[sky]
type = "dusk"
[materials.clay]
type = "diffuse"
albedo = 0.7
[materials.red]
type = "diffuse"
albedo = [0.6, 0.1, 0.1]
[materials.glass]
type = "dielectric"
roughness = 0.4
[materials.lamp]
type = "emissive"
radiance = 1
two_sided = true
[[objects]]
shape = {{ type = "box", min = [-0.7, 0, -0.7], max = [-0.1, 1.1, -0.1] }}
material = "red"
[[objects]]
shape = {{ type = "sphere", center = [0.4, 0.4, 0.2], radius = 0.35 }}
material = "glass"
{}"#,
        walls.concat()
    )
}

/// Skies flat, with suns, stars and texels; even, glossy, clear and rough surfaces; lamps; a lens; bare sky in all of them.
pub fn cases() -> Vec<Case> {
    let (diffuse, metal) = ("type = \"diffuse\"\nalbedo = 0.8", "type = \"metal\"\nroughness = 0.3");
    let glossy = "type = \"ggx\"\nalpha = 0.15\nspecular = 0.6\ndiffuse = 0.3";
    let sky = |kind: &str| format!("type = \"{kind}\"");
    let on_ground = |sky: &str, material: &str, more: &str| ground_and(sky, "table", material, more);
    // Out of the picture, which else would be little but the lamp.
    let bright = LAMP
        .replace("= 3\n", "= 60\n")
        .replace("[1.2, 1.5, 0.5], radius = 0.3", "[1.6, 2.6, 0.8], radius = 0.12");
    let rough = "type = \"metal\"\nroughness = 0.5";
    let lens =
        on_ground(&sky("dusk"), diffuse, "").replace("fov", "aperture = 0.1\nfocus_distance = 3.5\nfov");
    let night = "type = \"night\"\nsize = 64";
    let mut all = vec![
        Case::new("even", &on_ground(&sky("gradient"), diffuse, ""), true, false, [0.05, 0.03]),
        Case::new("sun", &on_ground(&sky("midday"), diffuse, ""), false, false, [0.06, 0.027]),
        Case::new("lens", &lens, true, false, [0.07, 0.036]),
        Case::new(
            "metal",
            &on_ground("type = \"gradient\"\nrotate_y_deg = 30", metal, ""),
            true,
            false,
            [0.05, 0.035],
        ),
        Case::new(
            "glass",
            &on_ground(&sky("gradient"), "type = \"dielectric\"", ""),
            true,
            false,
            [0.045, 0.027],
        ),
        Case::new("cube", &on_ground(&sky("gradient"), glossy, ""), true, false, [0.1, 0.06]),
        Case::new("lamp", &on_ground(&sky("gradient"), diffuse, &bright), false, true, [0.06, 0.036]),
        Case::new("suns", &on_ground(&sky("midday"), rough, SUN), false, true, [0.08, 0.05]),
        Case::new("night", &on_ground(night, diffuse, &balls()), false, false, [0.12, 0.06]),
        Case::new("room", &room(), true, true, [0.08, 0.06]),
        // Paths that end at the first surface have several samples there.
        Case::new("direct", &on_ground(&sky("midday"), diffuse, ""), false, false, [0.05, 0.025]),
        Case::new("direct metal", &on_ground(&sky("dusk"), metal, ""), false, false, [0.05, 0.03]),
    ];
    for case in &mut all {
        match case.name {
            "cube" => case.desc.sky.as_mut().unwrap().node = cube(),
            "glass" | "room" => case.max_depth = 8,
            "direct" | "direct metal" => case.max_depth = 1,
            _ => {}
        }
        // The noisier ones.
        if ["cube", "suns", "night", "room"].contains(&case.name) {
            case.spp = 16;
        }
    }
    all
}

/// One render but for its seed.
#[derive(Clone)]
pub struct Plan {
    pub settings: RenderSettings,
    /// Index into [`SAMPLINGS`].
    pub sampling: usize,
    strategy: &'static str,
    max_depth: u32,
    roulette_depth: u32,
    each_light: bool,
    light_sampling: bool,
    targets: [f64; 2],
}

impl Plan {
    /// Independent samples, as many in all pixels, each of one way through one table of the sky, and no path ends early.
    pub fn plain(case: &Case) -> Self {
        let usual = RenderSettings::new([SIDE; 2]);
        Plan {
            settings: RenderSettings {
                spp: case.spp,
                sampler: Sampler::Independent,
                skip_background: false,
                outlines: Some(1),
                dealing: Dealing::Even,
                moments: false,
                pilot: false,
                threads: 1,
                ..usual
            },
            sampling: 0,
            strategy: "both",
            max_depth: case.max_depth,
            roulette_depth: case.max_depth + 1,
            each_light: false,
            light_sampling: true,
            targets: case.targets,
        }
    }

    pub fn integrator(&self) -> Arc<dyn Integrator> {
        let params = Params::new()
            .with("max_depth", Value::Number(self.max_depth.into()))
            .with("roulette_depth", Value::Number(self.roulette_depth.into()))
            .with("strategy", Value::Text(self.strategy.into()))
            .with("each_light", Value::Bool(self.each_light))
            .with("light_sampling", Value::Bool(self.light_sampling));
        let node = Node { kind: "path".into(), params, ..Node::default() };
        registry::build("integrator", integrators::REGISTRY, &node).unwrap()
    }

    /// What a user gets who says nothing but the number of samples and the depth of paths.
    fn set_defaults(&mut self) {
        self.settings =
            RenderSettings { spp: self.settings.spp, threads: 1, ..RenderSettings::new([SIDE; 2]) };
        (self.sampling, self.strategy, self.roulette_depth) = (2, "auto", 4);
    }

    /// Rounds. The first look is soon, as little confidence is asked for: the more the samples decide, the more could they
    /// bias.
    fn set_target(&mut self, error: f64) {
        self.settings.target = Some(Target { error, confidence: 0.5, part: Part::Picture });
        self.settings.spp = LONG;
    }

    /// The first round of a render that may take long. A pilot spends a share of all that is planned, and so does what
    /// pays only beyond some number of samples; a clock that has run out sees to it that 8 are taken.
    fn set_first_of_many(&mut self) {
        (self.settings.spp, self.settings.time) = (LONG, Some(Duration::ZERO));
    }
}

/// Samples of a render that may take long: just enough for a pilot to try out materials.
const LONG: u32 = 17152;

/// Something that is to change no mean.
pub struct Technique {
    pub name: &'static str,
    pub change: fn(&mut Plan),
    /// Where it is tried.
    pub applies: fn(&Case) -> bool,
    /// Whether it had a say in a render.
    pub acts: fn(&RenderStats) -> bool,
    /// In how many scenes that is so, at least: a test of what does nothing says nothing.
    pub least: usize,
    /// Independent renders of each scene: fewer where each takes more samples.
    pub renders: u64,
}

fn everywhere(_: &Case) -> bool {
    true
}

fn always(_: &RenderStats) -> bool {
    true
}

pub fn techniques() -> Vec<Technique> {
    let usual = Technique { renders: 16, ..plain() };
    let by = |name, change: fn(&mut Plan)| Technique { name, change, ..usual };
    let seen = |t: Technique, acts, least| Technique { acts, least, ..t };
    let tried_out: fn(&RenderStats) -> bool = |s| s.pilot.scattered + s.pilot.shadow > 0;
    let by_need: fn(&RenderStats) -> bool = |s| s.spp_least < s.spp;
    vec![
        by("owen-sobol", |p| p.settings.sampler = Sampler::OwenSobol),
        by("zsobol", |p| p.settings.sampler = Sampler::ZSobol),
        // Two halves of different size, of which one has a number of points that fits no net.
        by("moments, 11 samples", |p| {
            (p.settings.sampler, p.settings.moments, p.settings.spp) = (Sampler::ZSobol, true, 11);
        }),
        by("sky-sampling compensated", |p| p.sampling = 1),
        by("sky-sampling product", |p| p.sampling = 2),
        Technique {
            applies: |c| c.is_tame,
            least: 6,
            // Noisy.
            renders: 24,
            ..by("light_sampling off", |p| p.light_sampling = false)
        },
        Technique { applies: |c| c.has_choice, least: 3, ..by("each_light", |p| p.each_light = true) },
        seen(
            by("strategy auto", |p| {
                (p.sampling, p.strategy, p.settings.pilot) = (2, "auto", true);
                p.set_first_of_many();
            }),
            tried_out,
            8,
        ),
        seen(by("roulette", |p| p.roulette_depth = 2), |s| s.avoided.roulette > 0, 10),
        seen(by("outlines", |p| p.settings.outlines = Some(4)), |s| s.outlines.pixels > 0, 8),
        seen(
            Technique {
                renders: 30,
                ..by("sky pixels", |p| {
                    p.settings.skip_background = true;
                    p.set_first_of_many();
                })
            },
            |s| s.spared > 0,
            8,
        ),
        seen(by("dealing by guess", |p| p.settings.dealing = Dealing::ByGuess), by_need, 10),
        // In the others what neighbours show foretells nothing.
        seen(by("dealing by need", |p| p.settings.dealing = Dealing::ByNeed), by_need, 7),
        seen(Technique { renders: 10, ..by("target", |p| p.set_target(p.targets[0])) }, by_need, 8),
        seen(by("all defaults", Plan::set_defaults), |s| s.rounds == 2, 10),
        seen(
            Technique {
                renders: 10,
                ..by("all defaults, target", |p| {
                    p.set_defaults();
                    p.set_target(p.targets[1]);
                })
            },
            by_need,
            8,
        ),
    ]
}

/// The plain estimator itself.
pub fn plain() -> Technique {
    Technique { name: "plain", change: |_| {}, applies: everywhere, acts: always, least: 10, renders: 56 }
}

/// A real bias: light that has met more than two surfaces is lost.
pub fn too_short() -> Technique {
    Technique { name: "two surfaces", change: |p| p.max_depth = 2, renders: 16, ..plain() }
}
