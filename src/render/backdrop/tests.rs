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
    let same = self::scene("type = \"constant\"\nradiance = [0.1, 0.7, 0.3]\nintensity = 3.0", [32, 32]);
    for filter in [PixelFilter::Center, PixelFilter::Box, PixelFilter::default()] {
        backdrop.fill(&same, filter, rect);
        assert_eq!(backdrop.get(9, 2), Some(Rgb::new(0.1, 0.7, 0.3) * 3.0));
    }
    for (background, color) in
        [(Background::Transparent, Rgb::BLACK), (Background::Color([0.1, 0.2, 0.3]), Rgb::new(0.1, 0.2, 0.3))]
    {
        scene.background = background;
        backdrop.fill(&scene, PixelFilter::Center, rect);
        assert_eq!(backdrop.get(15, 15), Some(color));
    }
}

/// Many tiles of clear skies take a few points, and come out as by many; coarse pictures have hardly any such tile.
#[test]
fn a_few_points_a_tile_do_for_much_of_a_clear_sky() {
    let (mut fine, mut told) = (true, Vec::new());
    for (sky, size, least) in [
        ("gradient", [960, 540], 0.9),
        ("midday", [960, 540], 0.7),
        ("sunset", [960, 540], 0.45),
        ("dusk", [960, 540], 0.6),
        ("midday", [96, 54], 0.0),
        ("night", [960, 540], 0.0),
    ] {
        let scene = scene(&format!("type = \"{sky}\""), size);
        let (mut cheap, mut all, mut apart) = (0, 0, 0f32);
        let (mut backdrop, mut by_many) = (Backdrop::default(), Backdrop::default());
        let filter = PixelFilter::default();
        for rect in PixelRect::of_size(size[0], size[1]).tiles(TILE_SIDE) {
            backdrop.fill(&scene, filter, rect);
            all += 1;
            if !backdrop.is_cheap {
                continue;
            }
            cheap += 1;
            by_many.rect = rect;
            by_many.pixels.clear();
            by_many.pixels.resize(rect.area(), None);
            by_many.fill_sky(&scene, &taps(filter).unwrap(), rect);
            for (x, y) in rect.pixels() {
                let got = backdrop.get(x, y).unwrap();
                let Some(want) = by_many.get(x, y) else { panic!("{sky} {x} {y}: detail was overlooked") };
                apart = apart.max((got - want).map(f32::abs).max_component() / want.max_component());
            }
        }
        told.push(format!("{sky} {size:?}: {cheap} of {all}, apart {apart:.1e}"));
        fine &= apart <= 5e-4 && f64::from(cheap) >= least * f64::from(all) && (sky != "night" || cheap == 0);
    }
    assert!(fine, "{told:#?}");
}

#[test]
fn a_pixel_is_the_same_in_whatever_part_of_the_picture() {
    let scene = scene("type = \"sunset\"", [160, 90]);
    let filter = PixelFilter::default();
    let (mut whole, mut part) = (Backdrop::default(), Backdrop::default());
    whole.fill(&scene, filter, PixelRect::of_size(160, 90));
    for [x0, y0, x1, y1] in [[0, 0, 16, 16], [7, 33, 23, 49], [150, 80, 160, 90], [31, 64, 32, 90]] {
        let rect = PixelRect::new(x0, y0, x1, y1);
        part.fill(&scene, filter, rect);
        assert!(rect.pixels().all(|(x, y)| part.get(x, y) == whole.get(x, y)), "{rect:?}");
    }
}
