//! What every material must satisfy, whatever it is.

use crate::base::directions::{DirectionLanes, LANES};
use crate::base::lanes::{Columns, LANES as MANY};
use crate::base::material::{BsdfEval, Material, Prepared};
use crate::base::registry::{Params, Row, Value, build};
use crate::base::shape::Needs;
use crate::base::texture::Texture;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::math::Frame;
use crate::sampling::warp::one_minus_cos;
use crate::testing::outside;
use crate::testing::rows::{built, check_rows, node};
use crate::testing::{Bins, ChiSquare, TestRng, chi_square_sphere, integrate_sphere};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// The crate's materials, and one from outside.
fn table() -> Vec<Row<dyn Material>> {
    outside::registry().materials
}

/// Above this density a lobe is too narrow for quadrature over the whole sphere.
const NARROW: f32 = 300.0;

/// A material as a path sees it: prepared at a vertex.
struct Member {
    label: String,
    it: Arc<dyn Material>,
    prepared: Prepared,
}

impl Member {
    fn new(label: String, it: Arc<dyn Material>) -> Self {
        let mut prepared = Prepared::default();
        it.prepare(&vertex(), &mut prepared);
        Member { label, it, prepared }
    }

    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.it.eval(&self.prepared, wo, wi)
    }

    fn sample(&self, wo: Vec3, u: [f32; 2], uc: f32) -> Option<crate::base::material::BsdfSample> {
        self.it.sample(&self.prepared, wo, u, uc)
    }

    fn draw(&self, wo: Vec3, rng: &mut TestRng) -> Option<Vec3> {
        self.sample(wo, rng.vec2().into(), rng.f32()).map(|s| s.wi)
    }

    /// See [`crate::base::material::Transmission::eta2`]: turns radiance carried from `wi` to `wo` into a share of power.
    fn eta2(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.it.transmission().map_or(1.0, |t| t.eta2(wo, wi))
    }

    /// Whether it has a density.
    fn scatters(&self) -> bool {
        !self.it.is_black() && !self.it.is_delta()
    }

    /// The densest of some sampled directions, if there are any.
    fn mode(&self, wo: Vec3) -> Option<(Vec3, f32)> {
        let mut rng = TestRng::new(7);
        let all = (0..2000).filter_map(|_| self.sample(wo, rng.vec2().into(), rng.f32()));
        all.map(|s| (s.wi, s.pdf)).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

fn vertex() -> Vertex {
    Vertex {
        p: Vec3::ZERO,
        error: Vec3::ZERO,
        ng: Vec3::Z,
        frame: Frame::from_z(Vec3::Z),
        wo: Vec3::Z,
        uv: Vec2::new(0.25, 0.75),
        footprint: 0.0,
        t: 1.0,
        lift: Vec3::ZERO,
        path: 0,
        prim: 0,
        object: 0,
        slot: 0,
    }
}

/// Stands in wherever a row takes a texture; one channel is brighter than any reflectance may be.
struct Ramp;

impl Texture for Ramp {
    fn eval(&self, uv: Vec2, _footprint: f32) -> Rgb {
        Rgb::new(uv.x, uv.y, 2.0)
    }

    fn mean(&self) -> Rgb {
        Rgb::new(0.5, 0.5, 2.0)
    }
}

/// Every sample of every row, and every row with each of its colours textured.
fn members() -> Vec<Member> {
    let mut all: Vec<Member> =
        built("material", &table()).into_iter().map(|b| Member::new(b.label, b.it)).collect();
    for row in table() {
        for spec in row.params.iter().filter(|s| s.kind == crate::base::registry::ParamKind::Texture) {
            let ramp: Arc<dyn Texture> = Arc::new(Ramp);
            let params = Params::new().with(spec.name, Value::Texture(ramp));
            let it = build("material", &table(), &node(row.kind, &params)).expect("takes a texture");
            assert!(it.needs().uv, "{}: a textured material reads uv", row.kind);
            all.push(Member::new(format!("{} with textured {}", row.kind, spec.name), it));
        }
    }
    all
}

/// At some angle (degrees) off the normal, above and below the surface.
fn views() -> Vec<Vec3> {
    let at = |theta: f32, phi: f32| {
        let ((st, ct), (sp, cp)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
        Vec3::new(st * cp, st * sp, ct).normalize()
    };
    [at(0.0, 0.0), at(35.0, 20.0), at(70.0, 130.0), at(88.0, -75.0), at(125.0, 10.0), at(179.0, 200.0)].into()
}

/// A few f32 roundings, and one of the half vector (1e-7) over the width of the lobe, which is the smaller the higher
/// the density: pdf = 1 / (4 pi alpha^2) at its peak. Four times for its slope.
fn tolerance(pdf: f32) -> f32 {
    1e-5 + 4e-7 * 4.0 * pdf.sqrt()
}

fn close(a: Rgb, b: Rgb, relative: f32) -> bool {
    let d = a - b;
    let size = a.max_component().max(b.max_component());
    d.r.abs().max(d.g.abs()).max(d.b.abs()) <= relative * size
}

#[test]
fn rows_are_sound_and_refuse_bad_parameters() {
    check_rows("material", &table());
}

#[test]
fn directions_follow_their_density() {
    let members: Vec<Member> = members().into_iter().filter(Member::scatters).collect();
    let tests = (members.len() * views().len()) as u32;
    for m in &members {
        for (i, wo) in views().into_iter().enumerate() {
            let Some((axis, peak)) = m.mode(wo) else { panic!("{} {wo}: no sample at all", m.label) };
            let (bins, samples) = match peak > NARROW {
                // Quadrature cannot resolve the rounding of a narrow lobe, so it must not try: fewer samples allow
                // it a larger error.
                true => (narrow_bins(m, wo, axis), 30_000),
                false => (Bins { rows: 12, columns: 24, ..Bins::default() }, 100_000),
            };
            let how = ChiSquare { bins, samples, seed: i as u64, tests };
            let label = format!("{}, wo {wo}", m.label);
            chi_square_sphere(&label, &how, |rng| m.draw(wo, rng), |wi| m.eval(wo, wi).pdf);
        }
    }
}

/// Bins around a narrow lobe, out to where nine in ten directions on its side of the surface are.
fn narrow_bins(m: &Member, wo: Vec3, axis: Vec3) -> Bins {
    let frame = Frame::from_z(axis);
    let mut rng = TestRng::new(3);
    // Across the surface there may be another lobe, as narrow: quadrature over both would find neither.
    let mut spread: Vec<f32> = (0..1000)
        .filter_map(|_| m.draw(wo, &mut rng))
        .filter(|w| w.z * axis.z > 0.0)
        .map(|w| one_minus_cos(frame.to_local(w)))
        .collect();
    spread.sort_by(f32::total_cmp);
    Bins { axis, cap: f64::from(spread[spread.len() * 9 / 10]).min(2.0), rows: 12, columns: 24 }
}

#[test]
fn densities_integrate_to_what_is_not_lost() {
    const N: usize = 1 << 16;
    // Side by side: this is most of what all of these tests take.
    members().par_iter().filter(|m| m.scatters()).for_each(|m| {
        for wo in views() {
            if m.mode(wo).is_none_or(|(_, peak)| peak > NARROW) {
                continue;
            }
            let total = integrate_sphere(|wi| f64::from(m.eval(wo, wi.as_vec3()).pdf), 5e-5);
            let mut rng = TestRng::new(11);
            let kept = (0..N).filter(|_| m.draw(wo, &mut rng).is_some()).count() as f64 / N as f64;
            // Five standard deviations of a count, and the quadrature's own error.
            let tolerance = 5.0 * (kept * (1.0 - kept) / N as f64).sqrt() + 1e-4;
            assert!((total - kept).abs() < tolerance, "{} {wo}: {total}, kept {kept}", m.label);
        }
    });
}

#[test]
fn samples_agree_with_eval() {
    for m in members() {
        let mut rng = TestRng::new(5);
        for wo in views() {
            for _ in 0..2000 {
                let Some(s) = m.sample(wo, rng.vec2().into(), rng.f32()) else { continue };
                assert!((s.wi.length() - 1.0).abs() < 1e-6, "{} {wo}: {s:?}", m.label);
                let e = m.eval(wo, s.wi);
                assert_eq!(s.delta, m.it.is_delta(), "{}: materials of one kind of lobe", m.label);
                if s.delta {
                    assert_eq!(e, BsdfEval::default(), "{}: no light sample meets a Dirac lobe", m.label);
                    continue;
                }
                let t = tolerance(s.pdf);
                assert!((e.pdf - s.pdf).abs() <= t * s.pdf, "{} {wo}: {s:?} {e:?}", m.label);
                assert!(close(e.f_cos / e.pdf, s.weight, t), "{} {wo}: {s:?} {e:?}", m.label);
            }
        }
    }
}

#[test]
fn directions_evaluated_together_are_as_each() {
    for m in members().iter().filter(|m| m.scatters()) {
        let mut rng = TestRng::new(12);
        for wo in views().into_iter().flat_map(|w| [w, -w]) {
            let mut wi = DirectionLanes::default();
            (1..LANES).for_each(|k| wi.set(k, rng.direction()));
            let all = m.it.eval_many(&m.prepared, wo, &wi);
            for k in 1..LANES {
                let e = m.eval(wo, wi.get(k));
                let got = all.f_cos.map(|channel| channel[k]);
                assert_eq!((got, all.pdf[k]), (e.f_cos.to_array(), e.pdf), "{}", m.label);
            }
        }
    }
}

#[test]
fn directions_sampled_together_are_as_each() {
    for m in members() {
        let mut rng = TestRng::new(14);
        for _ in 0..50 {
            let (mut wo, mut u, mut uc) = (Columns::<f32>::default(), [[0.0; MANY]; 2], [0.0; MANY]);
            for k in 0..MANY {
                wo.set(k, rng.direction());
                ([u[0][k], u[1][k]], uc[k]) = (rng.vec2().into(), rng.f32());
            }
            let n = MANY - 3;
            let all = m.it.sample_many(&m.prepared, &wo, &u, &uc, n);
            for k in 0..n {
                let weight: [f32; 3] = all.weight.get(k).into();
                match m.sample(wo.get(k), [u[0][k], u[1][k]], uc[k]) {
                    Some(s) => {
                        let got = (all.wi.get(k), weight, all.pdf[k], all.delta[k]);
                        assert_eq!(got, (s.wi, s.weight.to_array(), s.pdf, s.delta), "{}", m.label);
                    }
                    None => assert_eq!(weight, [0.0; 3], "{}", m.label),
                }
            }
        }
    }
}

#[test]
fn what_is_prepared_everywhere_is_so() {
    for m in members() {
        if let Some(prepared) = m.it.prepared_everywhere() {
            assert_eq!(prepared, m.prepared, "{}", m.label);
        }
    }
}

#[test]
fn light_may_travel_backwards() {
    for m in members().into_iter().filter(|m| m.it.is_physical()) {
        let mut rng = TestRng::new(13);
        let check = |wo: Vec3, wi: Vec3| {
            let (there, back) = (m.eval(wo, wi), m.eval(wi, wo));
            // Where the cosines are tiny, they are all rounding.
            if wo.z.abs() < 1e-3 || wi.z.abs() < 1e-3 {
                return;
            }
            // Radiance grows with the square of the index (see `Transmission::eta2`).
            let (f, g) = (there.f_cos / wi.z.abs() * m.eta2(wo, wi), back.f_cos / wo.z.abs());
            let t = 2.0 * tolerance(there.pdf.max(back.pdf));
            assert!(close(f, g, t), "{}: {wo} {wi}: {f:?} {g:?}", m.label);
        };
        for _ in 0..3000 {
            check(rng.direction(), rng.direction());
            let wo = rng.direction();
            if let Some(wi) = m.draw(wo, &mut rng) {
                check(wo, wi);
            }
        }
    }
}

#[test]
fn no_energy_is_made_and_albedo_says_how_much_is_kept() {
    const N: u32 = 128;
    for m in members() {
        for wo in views() {
            let mut rng = TestRng::new(17);
            let mut sum = [0f64; 3];
            // Stratified in u; with the lobe's choice in random order.
            for i in 0..N * N {
                let j = rng.vec2();
                let u = [(i % N) as f32 + j.x, (i / N) as f32 + j.y].map(|v| v / N as f32);
                if let Some(s) = m.sample(wo, u, rng.f32()) {
                    let power = s.weight * m.eta2(wo, s.wi);
                    sum.iter_mut().zip(power.to_array()).for_each(|(s, w)| *s += f64::from(w));
                }
            }
            let kept = sum.map(|s| s / f64::from(N * N));
            let claimed = m.it.albedo(&m.prepared, wo).to_array();
            for (kept, claimed) in kept.into_iter().zip(claimed.map(f64::from)) {
                // 16,384 weights, stratified, that vary by less than a half: at most 0.004 off.
                let physical = m.it.is_physical();
                assert!(kept < 1.005 || !physical, "{} {wo}: makes {kept} of 1", m.label);
                // A furnace must stay white: 1 %. Elsewhere the trait promises some percent.
                let tolerance = if claimed > 0.999 && physical { 0.01 } else { 0.04 * kept.max(1.0) };
                assert!((kept - claimed).abs() < tolerance, "{} {wo}: {kept}, says {claimed}", m.label);
            }
        }
    }
}

#[test]
fn nothing_is_ever_nan_or_infinite() {
    let tiny = [0.0, -0.0, 1e-38, -1e-38, 1e-20, 1e-7, -1e-7, 1e-4, -1e-4];
    let mut directions: Vec<Vec3> =
        tiny.iter().flat_map(|&z| [Vec3::new(1.0, 0.0, z), Vec3::new(-0.6, 0.8, z)]).collect();
    directions.extend([Vec3::Z, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8)]);
    directions.extend([1e-4, 1e-20].map(|x| Vec3::new(x, -x, 1.0)));
    let unit = [0.0, f32::MIN_POSITIVE, 1e-7, 0.5, 1.0 - f32::EPSILON / 2.0];
    for m in members() {
        let good = |c: Rgb| c.is_finite() && c.r >= 0.0 && c.g >= 0.0 && c.b >= 0.0;
        for &wo in &directions {
            for &wi in &directions {
                let e = m.eval(wo, wi);
                assert!(good(e.f_cos) && e.pdf.is_finite() && e.pdf >= 0.0, "{}: {wo} {wi} {e:?}", m.label);
            }
            for (u, v) in unit.into_iter().flat_map(|u| unit.map(|v| (u, v))) {
                for uc in unit {
                    let Some(s) = m.sample(wo, [u, v], uc) else { continue };
                    let whole = good(s.weight) && s.pdf.is_finite() && s.pdf > 0.0 && s.wi.is_finite();
                    assert!(whole && (s.wi.length() - 1.0).abs() < 1e-5, "{}: {wo} {s:?}", m.label);
                    // A path's throughput must not jump either.
                    let power = s.weight * m.eta2(wo, s.wi);
                    let bound = if m.it.is_physical() { 3.0 } else { 30.0 };
                    assert!(power.max_component() < bound, "{}: {wo} {s:?}", m.label);
                }
            }
            assert!(good(m.it.albedo(&m.prepared, wo)), "{}: {wo}", m.label);
        }
    }
}

#[test]
fn what_a_material_says_of_itself_is_so() {
    for m in members() {
        let mut rng = TestRng::new(19);
        for _ in 0..500 {
            let (wo, wi) = (rng.direction(), rng.direction());
            let s = m.sample(wo, rng.vec2().into(), rng.f32());
            if m.it.is_black() {
                assert!(m.eval(wo, wi).f_cos.is_black(), "{}", m.label);
                assert!(s.is_none_or(|s| s.weight.is_black()), "{}", m.label);
            }
            if m.it.transmission().is_none() && wo.z * wi.z < 0.0 {
                assert_eq!(m.eval(wo, wi), BsdfEval::default(), "{}: says that nothing passes", m.label);
                assert!(s.is_none_or(|s| s.wi.z * wo.z >= 0.0), "{}: says that nothing passes", m.label);
            }
            let (front, back) = (m.it.emission(Vec2::ZERO, 0.5), m.it.emission(Vec2::ZERO, -0.5));
            match m.it.emitter() {
                None => assert!(front.is_black() && back.is_black(), "{}", m.label),
                Some(e) => {
                    assert!(!e.mean.is_black() && close(e.mean, front, 0.1), "{}", m.label);
                    assert_eq!(!back.is_black(), e.two_sided, "{}", m.label);
                }
            }
        }
    }
}

#[test]
fn only_textures_make_a_material_read_the_surface() {
    for row in table() {
        let it = build("material", &table(), &node(row.kind, &Params::new()));
        if let Ok(it) = it {
            assert_eq!(it.needs(), Needs::default(), "{}", row.kind);
        }
    }
}
