use super::*;
use crate::scene::build::{BuildOptions, build};
use glam::Vec2;

fn scene(sky: &str, size: [u32; 2]) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let [w, h] = size;
    let text = format!(
        "[film]\nsize = [{w}, {h}]\n[camera]\ntype = \"perspective\"\neye = [0, 0, 0]\nlook_at = [1, 0.35, 0.4]\n\
         fov_deg = 60\n[sky]\n{sky}\n"
    );
    std::fs::write(&path, text).unwrap();
    build(crate::formats::load(&path).unwrap(), &BuildOptions::default()).unwrap()
}

/// Mean of 64 x 64 lookups, drawn by the filter in strata.
fn lookups(scene: &Scene, filter: PixelFilter, x: u32, y: u32) -> Rgb {
    const SIDE: u32 = 64;
    let (mut xs, mut ys) = (Vec::new(), Vec::new());
    for i in 0..SIDE * SIDE {
        let u = Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5) / SIDE as f32;
        let offset = filter.sample(u);
        xs.push(x as f32 + 0.5 + offset.x);
        ys.push(y as f32 + 0.5 + offset.y);
    }
    let mut rays = RayBatch::default();
    rays.resize(xs.len());
    scene.camera.fill_rays(&FilmSamples { x: &xs, y: &ys, lens_u: &[], lens_v: &[] }, &mut rays);
    let mut li = vec![Rgb::BLACK; xs.len()];
    scene.lights.list[0].le_escaped(rays.directions(), &mut li);
    li.iter().fold(Rgb::BLACK, |sum, c| sum + *c) / li.len() as f32
}

/// What is taken is right to a thousandth, and smooth skies are taken: the promise of `--sky-pixels`.
#[test]
fn what_is_taken_is_the_filters_integral_to_a_thousandth() {
    let filters = [PixelFilter::default(), PixelFilter::Box, PixelFilter::Tent { radius: 1.0 }];
    for (sky, least) in
        [("gradient", 1.0), ("midday", 1.0), ("sunset", 1.0), ("dusk", 1.0), ("nebula", 0.9), ("night", 0.9)]
    {
        // At this size a pixel of the painted skies' pictures is about as large as one of the film.
        let size = [960, 540];
        let scene = scene(&format!("type = \"{sky}\""), size);
        for filter in filters {
            let (mut taken, mut seen) = (0, 0);
            let mut backdrop = Backdrop::default();
            for tile in [[0, 0], [480, 16], [640, 256], [336, 480], [944, 524], [100, 100], [700, 60]] {
                let rect = PixelRect::new(tile[0], tile[1], tile[0] + 16, tile[1] + 16);
                backdrop.fill(&scene, filter, rect);
                for (x, y) in rect.pixels().step_by(3) {
                    seen += 1;
                    let Some(got) = backdrop.get(x, y) else { continue };
                    taken += 1;
                    let want = lookups(&scene, filter, x, y);
                    let off = (got - want).map(f32::abs).max_component() / want.max_component();
                    assert!(off <= 1e-3, "{sky} {filter:?} {x} {y}: {got:?} {want:?}, {off}");
                }
            }
            assert!(f64::from(taken) >= least * f64::from(seen), "{sky} {filter:?}: {taken} of {seen}");
        }
    }
}

#[test]
fn backgrounds_of_one_colour_are_exact_and_a_centre_filter_is_sampled() {
    let mut scene = scene("type = \"midday\"", [32, 32]);
    let rect = PixelRect::new(0, 0, 16, 16);
    let mut backdrop = Backdrop::default();
    backdrop.fill(&scene, PixelFilter::Center, rect);
    assert_eq!(backdrop.get(3, 4), None);
    for (background, color) in
        [(Background::Transparent, Rgb::BLACK), (Background::Color([0.1, 0.2, 0.3]), Rgb::new(0.1, 0.2, 0.3))]
    {
        scene.background = background;
        backdrop.fill(&scene, PixelFilter::Center, rect);
        assert_eq!(backdrop.get(15, 15), Some(color));
    }
}
