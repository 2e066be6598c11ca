use super::*;
use crate::testing::{TestRng, integrate_sphere};

fn sky(elevation: f64) -> Daylight {
    let p = Params::new().with("sun_elevation_deg", Value::Number(elevation));
    Daylight::new(&weather(&p).unwrap())
}

#[test]
fn phase_functions_integrate_to_one() {
    for phase in [air_phase, haze_phase] {
        let total = integrate_sphere(|w| f64::from(phase(w.z as f32)), 1e-6);
        assert!((total - 1.0).abs() < 1e-4, "{total}");
    }
}

#[test]
fn warp_is_monotone_and_inverted() {
    assert_eq!((warp(0.0), unwarp(0.0), unwarp(1.0)), (0.0, 0.0, FRAC_PI_2));
    let mut last = -1.0;
    for i in 0..=64 {
        let w = f64::from(i) / 64.0;
        let back = f64::from(warp(unwarp(w) as f32));
        // An angle, a product and a square root, each rounded to half of 1.2e-7.
        assert!((back - w).abs() <= 2e-7 * w, "{w} {back}");
        assert!(back > last && back <= 1.0);
        last = back;
    }
}

#[test]
fn nothing_shows_at_the_zenith() {
    // Rows of the table end there: however a direction is rounded, its neighbours get what it gets.
    let s = sky(30.0);
    let at = s.radiance(Vec3::Y);
    for k in 0..100 {
        let (sin, cos) = (0.7 * k as f32).sin_cos();
        let r = 1e-5 * k as f32;
        let l = s.radiance(Vec3::new(r * cos, 1.0, r * sin).normalize());
        // A milliradian of a sky that changes by its own size in about one radian.
        assert!((l - at).map(f32::abs).max_component() < 3e-3 * at.max_component(), "{l:?} {at:?}");
    }
}

#[test]
fn a_level_plate_gets_what_measurements_say() {
    // Clear sky, sun at 45 degrees: a direct beam of about 100 klx of the 128 klx above the atmosphere at normal
    // incidence (times sin 45), and 12 to 20 % of the global illuminance diffuse (CIE 85-1989, table 4, and any
    // textbook of daylighting); somewhat more over bright ground.
    let s = sky(45.0);
    let sun = &s.discs[0];
    let direct = f64::from(sun.radiance.luminance()) * sun.solid_angle() * 45f64.to_radians().sin() / PI;
    let diffuse =
        integrate_sphere(|w| f64::from(s.radiance(w.as_vec3()).luminance()) * w.y.max(0.0), 1e-4) / PI;
    assert!((0.45..0.62).contains(&direct), "{direct}");
    assert!((0.1..0.22).contains(&(diffuse / (direct + diffuse))), "{direct} {diffuse}");
}

#[test]
fn colours_are_those_of_the_sky() {
    let noon = sky(50.0);
    let zenith = noon.radiance(Vec3::Y);
    assert!(zenith.b > 1.8 * zenith.r, "{zenith:?}");
    let horizon = noon.radiance(Vec3::new(-1.0, 0.02, 0.0).normalize());
    assert!(horizon.luminance() > 1.5 * zenith.luminance() && horizon.b < 1.6 * horizon.r, "{horizon:?}");
    // A setting sun is red, and so is the sky beside it; opposite it is not.
    let evening = sky(1.0);
    let sun = evening.discs[0].radiance;
    assert!(sun.r > 3.0 * sun.b, "{sun:?}");
    let glow = evening.radiance(Vec3::new(1.0, 0.04, 0.1).normalize());
    assert!(glow.r > 1.2 * glow.b, "{glow:?}");
    // The blue hour: ozone keeps the zenith blue when the sun is down.
    let dusk = sky(-6.0);
    assert!(dusk.discs.is_empty());
    let zenith = dusk.radiance(Vec3::Y);
    assert!(zenith.b > 1.5 * zenith.r && zenith.luminance() < 1e-3 * noon.radiance(Vec3::Y).luminance());
}

#[test]
fn smooth_off_the_horizon_and_symmetric_about_the_sun() {
    let s = sky(20.0);
    let mut rng = TestRng::new(1);
    for _ in 0..5000 {
        let d = rng.direction();
        let mirrored = Vec3::new(d.x, d.y, -d.z);
        let (a, b) = (s.radiance(d), s.radiance(mirrored));
        assert!((a - b).map(f32::abs).max_component() <= 1e-5 * a.max_component(), "{a:?} {b:?}");
        let e = (d + 1e-4 * rng.direction()).normalize();
        if d.y.abs() > 2e-3 {
            // The steepest part is the haze about the sun: its phase function falls by 2 % a milliradian at most;
            // at the horizon the warp's slope is 1 / 2 w, under 12 rows of a table a milliradian.
            let jump = (a - s.radiance(e)).map(f32::abs).max_component();
            assert!(jump < 0.01 * a.max_component(), "{jump} of {a:?} at {d}");
        }
    }
}

#[test]
fn both_halves_meet_in_haze() {
    let s = sky(40.0);
    for x in [-1.0, 0.3, 1.0] {
        let d = Vec3::new(x, 1e-5, 0.5).normalize();
        let (a, b) = (s.radiance(d), s.radiance(d * Vec3::new(1.0, -1.0, 1.0)));
        // Through 60 km of air the ground shows a little.
        assert!((a - b).map(f32::abs).max_component() < 0.35 * a.max_component(), "{a:?} {b:?}");
    }
}
