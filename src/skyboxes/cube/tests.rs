use super::*;
use crate::testing::TestRng;

/// Faces whose texels hold the direction of their own centre, halved and moved into [0, 1]; from the table of the
/// OpenGL specification written out once more.
fn direction_coded(n: usize) -> Cube {
    let faces = std::array::from_fn(|f| {
        texel::picture(n, n, |i| {
            let s = (2.0 * (i % n) as f32 + 1.0) / n as f32 - 1.0;
            let t = 1.0 - (2.0 * (i / n) as f32 + 1.0) / n as f32;
            let d = match f {
                0 => Vec3::new(1.0, t, -s),
                1 => Vec3::new(-1.0, t, s),
                2 => Vec3::new(s, 1.0, -t),
                3 => Vec3::new(s, -1.0, t),
                4 => Vec3::new(s, t, 1.0),
                _ => Vec3::new(-s, t, -1.0),
            };
            (d.normalize() * 0.5 + 0.5).to_array()
        })
    });
    Cube::new(&faces).unwrap()
}

fn noise(n: usize, seed: u64) -> Cube {
    let mut rng = TestRng::new(seed);
    let face = |_| {
        let texels: Vec<[f32; 3]> = (0..n * n).map(|_| [rng.f32(), rng.f32(), rng.f32()]).collect();
        ImageData { width: n, height: n, texels: Texels::F32(texels) }
    };
    Cube::new(&[0; 6].map(face)).unwrap()
}

#[test]
fn faces_stand_as_opengl_says() {
    let n = 64;
    let cube = direction_coded(n);
    let mut rng = TestRng::new(1);
    for _ in 0..20_000 {
        let d = rng.direction();
        let c = cube.radiance(d);
        let got = Vec3::new(c.r, c.g, c.b) * 2.0 - 1.0;
        // A chord falls short of its arc by w^2 / 8 for texels of w <= 2 / 64 radians. Rows run on across an edge,
        // but lines to the origin do not: texels of one row on both sides differ by up to half of 1 / n in direction.
        // At a corner the missing texel is replaced by an average, with an error of up to half a texel.
        let a = d.abs() / d.abs().max_element();
        let edges = [a.x, a.y, a.z].iter().filter(|&&c| c > 1.0 - 1.0 / n as f32).count();
        let tolerance = [3e-4, 3e-4, 0.25 / n as f32, 1.0 / n as f32][edges];
        assert!((got - d).length() < tolerance, "{got} for {d}");
    }
}

#[test]
fn no_seam_at_edges_and_corners() {
    for n in [1, 2, 7, 16] {
        let cube = noise(n, n as u64);
        let mut rng = TestRng::new(2);
        let eps = 1e-4;
        for i in 0..6000 {
            let mut p = rng.cube();
            // Onto an edge of the cube, and every third time next to a corner.
            let axes = [[0, 1], [1, 2], [2, 0]][i % 3];
            for a in axes {
                p[a] = 1f64.copysign(p[a]);
            }
            if i % 9 < 3 {
                let a = 3 - axes[0] - axes[1];
                p[a] = 1f64.copysign(p[a]) * (1.0 - 2.0 * rng.f64() / n as f64).max(0.0);
            }
            let d = p.normalize().as_vec3();
            let e = (d + eps * rng.direction()).normalize();
            let (a, b) = (cube.radiance(d), cube.radiance(e));
            // Values in [0, 1], texels 2 / n wide on a face that leans away by up to 1 / cos^2 = 3: the slope is at
            // most 2 * 3 n / 2 per axis.
            let bound = eps * 6.0 * n as f32;
            let diff = (a - b).map(f32::abs).max_component();
            assert!(diff < bound + 1e-6, "{n}: jump of {diff} at {d}");
        }
    }
}

#[test]
fn texel_centres_are_exact() {
    let n = 16;
    let cube = noise(n, 9);
    for chart in 0..6usize {
        for i in 0..n * n {
            let at = |i: usize| (i as f64 + 0.5) / n as f64;
            let d = cube.direction(ChartPoint { chart: chart as u32, u: at(i % n), v: at(i / n) }).as_vec3();
            let diff = cube.radiance(d) - cube.tiles.texel(chart, i % n + 1, i / n + 1);
            // Four roundings of positions up to 16.
            assert!(diff.map(f32::abs).max_component() < 1e-5);
        }
    }
}

#[test]
fn unequal_faces_are_refused() {
    let face = |w, h| texel::picture(w, h, |_| [0.0; 3]);
    let error = |faces: [ImageData; 6]| Cube::new(&faces).err().unwrap_or_default();
    assert!(error([0; 6].map(|_| face(4, 3))).contains("square"));
    let mut faces = [0; 6].map(|_| face(4, 4));
    faces[3] = face(8, 8);
    assert!(error(faces).contains("4 and 8"));
    let mut faces = [0; 6].map(|_| face(1, 1));
    faces[5].texels = Texels::Srgb8(vec![[0; 4]]);
    assert!(error(faces).contains("pixel format"));
}
