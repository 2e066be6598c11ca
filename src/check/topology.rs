//! Is a mesh closed? Equal positions are one vertex here, whatever their numbers; a face that stands there twice is
//! counted once.

use crate::base::mesh::TriangleMesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

/// A triangle whose longest edge is more than so many times its height is a sliver.
const SLIVER: f64 = 1e3;

/// What is found in a mesh.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Topology {
    /// Triangles, duplicates among them.
    pub triangles: u64,
    /// Distinct positions that triangles use.
    pub vertices: u64,
    /// Parts that share no vertex.
    pub components: u64,
    /// Faces that repeat the three corners of another, in any order.
    pub duplicate_faces: u64,
    /// Triangles more than a thousand times as long as high.
    pub slivers: u64,
    /// Edges of an odd number of faces: they bound the holes.
    pub boundary_edges: u64,
    /// Edges of more than two faces.
    pub non_manifold_edges: u64,
    /// Edges whose two faces run along them the same way, so that one of them is inside out.
    pub inconsistent_edges: u64,
    /// Longest first.
    pub holes: Vec<Hole>,
}

/// A closed chain of boundary edges.
#[derive(Debug, Clone, Serialize)]
pub struct Hole {
    /// Length of the chain, in the space of the mesh.
    pub length: f64,
    /// Mean of its corners.
    pub place: [f64; 3],
    /// Its corners in order.
    #[serde(skip)]
    pub corners: Vec<DVec3>,
}

/// A mesh's vertices and edges, for who aims at them.
pub struct Connectivity {
    /// What is told of it.
    pub topology: Topology,
    /// One number for each position, by vertex of the mesh.
    pub weld: Vec<u32>,
    /// The triangles that count, where some are duplicates; empty where all do.
    pub kept: Vec<u32>,
    /// By welded vertex: whether all edges there have two faces that run opposite ways.
    pub regular: Vec<bool>,
    /// Where the faces of each welded vertex begin in `at_vertex`, and one entry for the end.
    first_at: Vec<u32>,
    /// Triangles by welded vertex.
    at_vertex: Vec<u32>,
}

impl Topology {
    /// Whether every edge has an even number of faces, so that inside and outside can be told.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }
}

impl Connectivity {
    /// Of a mesh in the space of its group. Takes some 70 bytes a triangle while it works.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let (weld, vertices) = weld(mesh);
        let kept = without_duplicates(mesh, &weld);
        let count = mesh.indices.len() as u32;
        let all = || (0..count).filter(|_| kept.is_empty());
        let faces: Vec<[u32; 3]> = all()
            .chain(kept.iter().copied())
            .map(|t| mesh.indices[t as usize].map(|i| weld[i as usize]))
            .collect();
        let mut topology = Topology {
            triangles: u64::from(count),
            duplicate_faces: u64::from(count) - faces.len() as u64,
            slivers: (0..count).into_par_iter().filter(|&t| is_sliver(mesh, t)).count() as u64,
            ..Topology::default()
        };
        let mut used = vec![false; vertices];
        faces.iter().flatten().for_each(|&v| used[v as usize] = true);
        topology.vertices = used.iter().filter(|u| **u).count() as u64;
        topology.components = components(&faces, &used);
        let mut regular = used;
        let boundary = edges(&faces, &mut topology, &mut regular);
        topology.boundary_edges = boundary.len() as u64;
        topology.holes = holes(boundary, &positions_of(mesh, &weld, vertices));
        let mut made =
            Connectivity { topology, weld, kept, regular, first_at: Vec::new(), at_vertex: Vec::new() };
        made.list_faces(mesh, vertices);
        made
    }

    /// The faces that count at each vertex, by counting twice.
    fn list_faces(&mut self, mesh: &TriangleMesh, vertices: usize) {
        let corners = |t: u32| mesh.indices[t as usize].map(|i| self.weld[i as usize] as usize);
        let mut first = vec![0u32; vertices + 1];
        self.faces(mesh).for_each(|t| corners(t).into_iter().for_each(|v| first[v + 1] += 1));
        (1..first.len()).for_each(|v| first[v] += first[v - 1]);
        let mut next = first.clone();
        let mut list = vec![0; first.last().map_or(0, |n| *n as usize)];
        for t in self.faces(mesh) {
            for v in corners(t) {
                list[next[v] as usize] = t;
                next[v] += 1;
            }
        }
        (self.first_at, self.at_vertex) = (first, list);
    }

    /// The faces that count at a welded vertex.
    pub fn faces_at(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.at_vertex[self.first_at[v] as usize..self.first_at[v + 1] as usize]
    }

    /// The triangles that count.
    pub fn faces(&self, mesh: &TriangleMesh) -> impl Iterator<Item = u32> + '_ {
        let all = if self.kept.is_empty() { mesh.indices.len() as u32 } else { 0 };
        (0..all).chain(self.kept.iter().copied())
    }
}

/// The position's bits, zeros of either sign the same.
fn key(p: [f32; 3]) -> [u32; 3] {
    p.map(|x| if x == 0.0 { 0 } else { x.to_bits() })
}

/// A number for each vertex, the same for equal positions, and how many numbers there are.
fn weld(mesh: &TriangleMesh) -> (Vec<u32>, usize) {
    let positions = mesh.positions();
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (key(positions[i as usize]), i));
    let mut weld = vec![0; positions.len()];
    let mut count = 0;
    for (k, &i) in order.iter().enumerate() {
        if k > 0 && key(positions[i as usize]) != key(positions[order[k - 1] as usize]) {
            count += 1;
        }
        weld[i as usize] = count;
    }
    (weld, if positions.is_empty() { 0 } else { count as usize + 1 })
}

fn positions_of(mesh: &TriangleMesh, weld: &[u32], count: usize) -> Vec<Vec3> {
    let mut out = vec![Vec3::ZERO; count];
    mesh.positions().iter().zip(weld).for_each(|(p, w)| out[*w as usize] = Vec3::from_array(*p));
    out
}

/// The first triangle of each set of three corners, in order; empty where there is no other.
fn without_duplicates(mesh: &TriangleMesh, weld: &[u32]) -> Vec<u32> {
    let corners = |t: u32| {
        let mut c = mesh.indices[t as usize].map(|i| weld[i as usize]);
        c.sort_unstable();
        c
    };
    let mut order: Vec<u32> = (0..mesh.indices.len() as u32).collect();
    order.par_sort_unstable_by_key(|&t| (corners(t), t));
    if order.windows(2).all(|w| corners(w[0]) != corners(w[1])) {
        return Vec::new();
    }
    order.dedup_by_key(|t| corners(*t));
    order.par_sort_unstable();
    order
}

fn is_sliver(mesh: &TriangleMesh, t: u32) -> bool {
    let [a, b, c] = mesh.corners(t).map(|p| p.as_dvec3());
    let longest2 = [b - a, c - b, a - c].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
    longest2 > SLIVER * (b - a).cross(c - a).length()
}

/// Union-find over vertices, by halving paths.
fn components(faces: &[[u32; 3]], used: &[bool]) -> u64 {
    let mut parent: Vec<u32> = (0..used.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for [a, b, c] in faces {
        for other in [b, c] {
            let (x, y) = (root(&mut parent, *a), root(&mut parent, *other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    parent.iter().enumerate().filter(|(i, p)| used[*i] && *i as u32 == **p).count() as u64
}

/// Counts kinds of edges, marks the vertices at irregular ones, and returns those of an odd number of faces.
fn edges(faces: &[[u32; 3]], topology: &mut Topology, regular: &mut [bool]) -> Vec<[u32; 2]> {
    let mut all: Vec<([u32; 2], bool)> = faces
        .par_iter()
        .flat_map_iter(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]])
        .map(|[a, b]| ([a.min(b), a.max(b)], a < b))
        .collect();
    all.par_sort_unstable();
    let mut boundary = Vec::new();
    for same in all.chunk_by(|x, y| x.0 == y.0) {
        let edge = same[0].0;
        let consistent = same.len() == 2 && same[0].1 != same[1].1;
        topology.non_manifold_edges += u64::from(same.len() > 2);
        topology.inconsistent_edges += u64::from(same.len() == 2 && !consistent);
        if same.len() % 2 == 1 {
            boundary.push(edge);
        }
        if !consistent {
            edge.iter().for_each(|v| regular[*v as usize] = false);
        }
    }
    boundary
}

/// Chains of boundary edges. Every vertex has an even number of them (what bounds a surface has no end), so each walk
/// comes back to where it began.
fn holes(boundary: Vec<[u32; 2]>, positions: &[Vec3]) -> Vec<Hole> {
    let mut ends: Vec<(u32, u32)> =
        (0u32..).zip(&boundary).flat_map(|(e, [a, b])| [(*a, e), (*b, e)]).collect();
    ends.sort_unstable();
    let mut taken = vec![false; boundary.len()];
    // Where to go on looking among the edges of a vertex, so that a vertex of many edges costs no more than few.
    let mut next: Vec<usize> = (0..ends.len()).collect();
    let mut found = Vec::new();
    for first in 0..boundary.len() {
        if taken[first] {
            continue;
        }
        let [start, mut at] = boundary[first];
        taken[first] = true;
        let mut corners = vec![start, at];
        while at != start {
            let begin = ends.partition_point(|e| e.0 < at);
            let mut k = next[begin];
            while k < ends.len() && ends[k].0 == at && taken[ends[k].1 as usize] {
                k += 1;
            }
            next[begin] = k;
            let Some(&(_, edge)) = ends.get(k).filter(|e| e.0 == at) else { break };
            taken[edge as usize] = true;
            let [a, b] = boundary[edge as usize];
            at = if a == at { b } else { a };
            corners.push(at);
        }
        corners.pop();
        let corners: Vec<DVec3> = corners.iter().map(|v| positions[*v as usize].as_dvec3()).collect();
        let n = corners.len();
        found.push(Hole {
            length: (0..n).map(|i| corners[i].distance(corners[(i + 1) % n])).sum(),
            place: (corners.iter().sum::<DVec3>() / n as f64).to_array(),
            corners,
        });
    }
    found.sort_by(|a, b| b.length.total_cmp(&a.length));
    found
}
