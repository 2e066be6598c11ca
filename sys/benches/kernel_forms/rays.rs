//! A generated mesh, and rays against it in batches.

use embree_sys::*;
use std::ptr;

/// Rays in a batch.
pub const BATCH: usize = 1024;
/// Picture that the camera rays fill, in pixels; multiples of 32.
const SIZE: [usize; 2] = [1920, 1088];

/// Origins, directions and far ends by axis; tnear is 0.
#[derive(Default, Clone)]
pub struct Batch {
    pub columns: [Vec<f32>; 8],
}

impl Batch {
    fn push(&mut self, o: [f32; 3], d: [f32; 3]) {
        let [ox, oy, oz] = o;
        let [dx, dy, dz] = d;
        for (column, value) in self.columns.iter_mut().zip([ox, oy, oz, 0.0, dx, dy, dz, f32::INFINITY]) {
            column.push(value);
        }
    }

    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    pub fn ray(&self, i: usize) -> RTCRay {
        let [ox, oy, oz, tnear, dx, dy, dz, tfar] = [0, 1, 2, 3, 4, 5, 6, 7].map(|c| self.columns[c][i]);
        RTCRay {
            org_x: ox,
            org_y: oy,
            org_z: oz,
            tnear,
            dir_x: dx,
            dir_y: dy,
            dir_z: dz,
            time: 0.0,
            tfar,
            mask: u32::MAX,
            id: 0,
            flags: 0,
        }
    }

    pub fn packet(&self, first: usize) -> RTCRay16 {
        let mut to: RTCRay16 = zeroed();
        let rows = [
            &mut to.org_x,
            &mut to.org_y,
            &mut to.org_z,
            &mut to.tnear,
            &mut to.dir_x,
            &mut to.dir_y,
            &mut to.dir_z,
            &mut to.tfar,
        ];
        for (row, column) in rows.into_iter().zip(&self.columns) {
            row.copy_from_slice(&column[first..first + 16]);
        }
        to.mask = [u32::MAX; 16];
        to
    }
}

pub fn zeroed<T>() -> T {
    // SAFETY: used for Embree's records of numbers alone.
    unsafe { std::mem::zeroed() }
}

pub fn no_hit(ray: RTCRay) -> RTCRayHit {
    let mut rayhit = RTCRayHit { ray, hit: zeroed() };
    rayhit.hit.geomID = INVALID_ID;
    rayhit.hit.instID[0] = INVALID_ID;
    rayhit
}

pub fn no_hits(ray: RTCRay16) -> RTCRayHit16 {
    let mut rayhit = RTCRayHit16 { ray, hit: zeroed() };
    rayhit.hit.geomID = [INVALID_ID; 16];
    rayhit.hit.instID[0] = [INVALID_ID; 16];
    rayhit
}

/// A generator of Marsaglia's xorshift family, in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Point of a tube around a (2, 3) torus knot with bumps; `a`, `b` in [0, 1).
fn knot(a: f32, b: f32) -> [f32; 3] {
    use std::f32::consts::TAU;
    let center = |a: f32| {
        let (s, c) = (TAU * a).sin_cos();
        let (s2, c2) = ((2.0 * c * c - 1.0), (2.0 * s * c));
        let (s3, c3) = (TAU * 3.0 * a).sin_cos();
        [(2.0 + c3) * s2 * 0.6, (2.0 + c3) * c2 * 0.6, s3 * 0.6]
    };
    let (p, q) = (center(a), center(a + 1e-3));
    let t = normalize([q[0] - p[0], q[1] - p[1], q[2] - p[2]]);
    let (u, v) = basis(t);
    let (s, c) = (TAU * b).sin_cos();
    let r = 0.35 + 0.02 * (TAU * 60.0 * a).sin() * (TAU * 9.0 * b).sin();
    [0, 1, 2].map(|k| p[k] + r * (c * u[k] + s * v[k]))
}

fn normalize(v: [f32; 3]) -> [f32; 3] {
    let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|x| x / l)
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn basis(t: [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let u = normalize(cross(t, [0.3, 0.5, 0.81]));
    (u, cross(t, u))
}

/// About `triangles` triangles, with a vertex of padding.
fn mesh(triangles: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let m = ((triangles as f64 / 16.0).sqrt() as u32).max(3);
    let n = (triangles as u32 / (2 * m)).max(3);
    let mut vertices = Vec::new();
    let mut indices = Vec::new();
    for i in 0..n {
        for j in 0..m {
            vertices.push(knot(i as f32 / n as f32, j as f32 / m as f32));
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    vertices.push([0.0; 3]);
    (vertices, indices)
}

/// Commits the mesh into a robust scene. The arrays are leaked: they must outlive it, and the program is short.
pub fn scene(triangles: usize) -> (RTCScene, usize) {
    let (vertices, indices) = mesh(triangles);
    let (vertices, indices) = (vertices.leak(), indices.leak());
    // SAFETY: valid handles all along; the buffers live forever, the last vertex is padding.
    unsafe {
        let device = rtcNewDevice(ptr::null());
        let scene = rtcNewScene(device);
        rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
        rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
        let mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        let (v, i) = (vertices.as_ptr().cast(), indices.as_ptr().cast());
        let n = vertices.len() - 1;
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, v, 0, 12, n);
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, i, 0, 12, indices.len());
        rtcCommitGeometry(mesh);
        rtcAttachGeometryByID(scene, mesh, 0);
        rtcCommitScene(scene);
        (scene, indices.len())
    }
}

/// Camera rays by tiles of 32x32, and from every hit a bounce ray by the cosine law, in the same order.
pub fn rays(scene: RTCScene) -> [Vec<Batch>; 2] {
    let mut random = Random(1);
    let (mut camera, mut bounce) = (Vec::new(), vec![Batch::default()]);
    for tile in 0..SIZE[0] / 32 * (SIZE[1] / 32) {
        let (tx, ty) = (tile % (SIZE[0] / 32) * 32, tile / (SIZE[0] / 32) * 32);
        let mut batch = Batch::default();
        for i in 0..BATCH {
            let x = (tx + i % 32) as f32 + random.next() - SIZE[0] as f32 * 0.5;
            let y = (ty + i / 32) as f32 + random.next() - SIZE[1] as f32 * 0.5;
            let scale = 1.15 / SIZE[1] as f32;
            batch.push([0.2, 0.3, 6.0], normalize([x * scale, y * scale, -1.0]));
        }
        for i in 0..BATCH {
            let mut h = no_hit(batch.ray(i));
            // SAFETY: committed scene, finite ray.
            unsafe { em_intersect1(scene, &mut EmQuery::new(false, ptr::null_mut()), &mut h) };
            if h.hit.geomID == INVALID_ID {
                continue;
            }
            if bounce.last().is_some_and(|b: &Batch| b.len() == BATCH) {
                bounce.push(Batch::default());
            }
            let (o, d) = leave(&h, &mut random);
            bounce.last_mut().expect("never empty").push(o, d);
        }
        camera.push(batch);
    }
    bounce.pop_if(|b| b.len() < BATCH);
    [camera, bounce]
}

/// Rays from anywhere to anywhere, which have nothing in common: the worst that late bounces can be.
pub fn scattered() -> Vec<Batch> {
    let mut random = Random(2);
    let mut batches = vec![Batch::default(); 128];
    for batch in &mut batches {
        for _ in 0..BATCH {
            let mut point = || [(); 3].map(|()| 4.0 * random.next() - 2.0);
            let (from, to) = (point(), point());
            batch.push(from, normalize([0, 1, 2].map(|k| to[k] - from[k])));
        }
    }
    batches
}

/// A ray that leaves a hit on the camera's side.
fn leave(h: &RTCRayHit, random: &mut Random) -> ([f32; 3], [f32; 3]) {
    let (r, t) = (&h.ray, h.ray.tfar);
    let d = [r.dir_x, r.dir_y, r.dir_z];
    let mut n = normalize([h.hit.Ng_x, h.hit.Ng_y, h.hit.Ng_z]);
    if n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0 {
        n = n.map(|x| -x);
    }
    let o = [r.org_x, r.org_y, r.org_z];
    let (u, v) = basis(n);
    let (phi, s) = (std::f32::consts::TAU * random.next(), random.next());
    let (a, b, c) = (s.sqrt() * phi.cos(), s.sqrt() * phi.sin(), (1.0 - s).sqrt());
    let wi = [0, 1, 2].map(|k| a * u[k] + b * v[k] + c * n[k]);
    ([0, 1, 2].map(|k| o[k] + t * d[k] + 1e-4 * n[k]), wi)
}
