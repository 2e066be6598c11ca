use super::*;
use crate::testing::TestRng;

fn noise(w: usize, h: usize) -> Sphere {
    let texels: Vec<[f32; 3]> = {
        let mut rng = TestRng::new(7);
        (0..w * h).map(|_| [rng.f32(), rng.f32(), rng.f32()]).collect()
    };
    Sphere::new(Arc::new(texel::picture(w, h, |i| texels[i])))
}

#[test]
fn texels_stand_where_the_mapping_says() {
    let (w, h) = (256, 128);
    let picture = texel::picture(w, h, |i| {
        let u = ((i % w) as f32 + 0.5) / w as f32;
        let elevation = (0.5 - ((i / w) as f32 + 0.5) / h as f32) * std::f32::consts::PI;
        let azimuth = (u - 0.5) * std::f32::consts::TAU;
        let d = Vec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin());
        (d * 0.5 + 0.5).to_array()
    });
    let sky = Sphere::new(Arc::new(picture));
    let mut rng = TestRng::new(1);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    for d in axes.into_iter().chain((0..20_000).map(|_| rng.direction())) {
        let c = sky.radiance(d);
        let got = Vec3::new(c.r, c.g, c.b) * 2.0 - 1.0;
        // A chord falls short of its arc by w^2 / 8 for texels of w = pi / 128; next to a pole by as much again.
        assert!((got - d).length() < 2e-4, "{got} for {d}");
    }
}

#[test]
fn no_seam_around_and_none_at_the_poles() {
    for (w, h) in [(1, 1), (2, 1), (16, 8), (33, 7)] {
        let sky = noise(w, h);
        let eps = 1e-4f32;
        let mut rng = TestRng::new(3);
        for i in 0..6000 {
            // Next to the cut at -x, next to a pole, anywhere.
            let near = 0.02 * rng.direction();
            let d = match i % 3 {
                0 => (Vec3::new(-1.0, 2.0 * rng.f32() - 1.0, 0.0) + near).normalize(),
                1 => (Vec3::Y * (0.5 - rng.f32()).signum() + near).normalize(),
                _ => rng.direction(),
            };
            let e = (d + eps * rng.direction()).normalize();
            let jump = (sky.radiance(d) - sky.radiance(e)).map(f32::abs).max_component();
            // Values in [0, 1]: at most h / pi per radian along a meridian (twice that next to a pole) and
            // w / (2 pi r) along a circle of latitude of radius r; next to a pole that slope fades with r / (half a
            // texel), so that r is never below pi / 2 h.
            let r = (d.x.hypot(d.z) - eps).max(1.6 / h as f32);
            let slope = (2.0 * h as f32 + w as f32 / (2.0 * r)) / std::f32::consts::PI;
            assert!(jump < eps * slope + 1e-5, "{w}x{h}: jump of {jump} at {d}");
        }
    }
}

#[test]
fn the_pole_itself_is_the_mean_of_its_row() {
    let sky = noise(16, 8);
    let mean = (0..16).map(|x| sky.image.texel(x, 0)).sum::<Rgb>() * (1.0 / 16.0);
    let diff = sky.radiance(Vec3::Y) - mean;
    assert!(diff.map(f32::abs).max_component() < 1e-6);
}
