//! Collecting the faces of a file, checked, as triangles and as polygons to be cut later.

use crate::base::mesh_data::Repairs;
use crate::formats::triangulate::Triangulator;
use glam::DVec3;

/// Faces as they come. Positions need not be known yet: polygons are cut by [`Faces::triangulate`].
#[derive(Debug, Default)]
pub struct Faces {
    /// All indices are below this.
    vertices: u32,
    triangles: Vec<[u32; 3]>,
    /// Corners of polygons with more than three, one polygon after another.
    polygon_corners: Vec<u32>,
    polygons: Vec<Polygon>,
    bad_faces: u64,
}

/// Where a polygon stands among the triangles.
#[derive(Debug)]
struct Polygon {
    corners: u32,
    /// Triangles collected before it.
    before: usize,
}

/// An index that points at no vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BadIndex(pub f64);

impl Faces {
    /// For faces of a file with so many vertices, probably about `count` of them.
    pub fn new(vertices: u32, count: usize) -> Self {
        Faces { vertices, triangles: Vec::with_capacity(count), ..Faces::default() }
    }

    /// Adds a triangle.
    #[inline]
    pub fn push_triangle(&mut self, triangle: [u32; 3]) -> Result<(), BadIndex> {
        if let Some(&bad) = triangle.iter().find(|&&i| i >= self.vertices) {
            return Err(BadIndex(f64::from(bad)));
        }
        self.triangles.push(triangle);
        Ok(())
    }

    /// Adds a face of any number of corners; one of fewer than three is counted and left out.
    pub fn push(&mut self, corners: &[u32]) -> Result<(), BadIndex> {
        if let &[a, b, c] = corners {
            return self.push_triangle([a, b, c]);
        }
        if let Some(&bad) = corners.iter().find(|&&i| i >= self.vertices) {
            return Err(BadIndex(f64::from(bad)));
        }
        if corners.len() < 3 {
            self.bad_faces += 1;
        } else {
            self.polygons.push(Polygon { corners: corners.len() as u32, before: self.triangles.len() });
            self.polygon_corners.extend_from_slice(corners);
        }
        Ok(())
    }

    /// Adds triangle strips: each corner forms a triangle with the two before it, every second one turned round, and
    /// an index of -1 starts anew. Triangles with a repeated corner only stitch parts of a strip together and are
    /// left out.
    pub fn push_strips(&mut self, indices: &[i64]) -> Result<(), BadIndex> {
        for strip in indices.split(|&i| i == -1) {
            if let Some(&bad) = strip.iter().find(|&&i| i < 0 || i >= i64::from(self.vertices)) {
                return Err(BadIndex(bad as f64));
            }
            for (k, corner) in strip.windows(3).enumerate() {
                let [a, b, c] = [0, 1, 2].map(|j| corner[j] as u32);
                if a != b && b != c && a != c {
                    self.triangles.push(if k % 2 == 0 { [a, b, c] } else { [b, a, c] });
                }
            }
        }
        Ok(())
    }

    /// Adds the faces of `other` after those of `self`.
    pub fn append(&mut self, mut other: Faces) {
        let before = self.triangles.len();
        self.triangles.append(&mut other.triangles);
        self.polygon_corners.append(&mut other.polygon_corners);
        self.polygons.extend(other.polygons.into_iter().map(|p| Polygon { before: p.before + before, ..p }));
        self.bad_faces += other.bad_faces;
    }

    /// Whether there is no face with at least three corners.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.polygons.is_empty()
    }

    /// Bytes that [`Faces::triangulate`] takes beside what is there.
    pub fn bytes_of_triangles(&self) -> u64 {
        if self.polygons.is_empty() {
            return 0;
        }
        let added = self.polygon_corners.len() - 2 * self.polygons.len();
        ((self.triangles.len() + added) * size_of::<[u32; 3]>()) as u64
    }

    /// All faces as triangles, in the order in which they came; counts are added to `repairs`.
    pub fn triangulate(self, position: impl Fn(u32) -> DVec3, repairs: &mut Repairs) -> Vec<[u32; 3]> {
        repairs.bad_faces += self.bad_faces;
        repairs.triangulated += self.polygons.len() as u64;
        if self.polygons.is_empty() {
            return self.triangles;
        }
        let added = self.polygon_corners.len() - 2 * self.polygons.len();
        let mut all = Vec::with_capacity(self.triangles.len() + added);
        let mut cutter = Triangulator::default();
        let mut corners = &self.polygon_corners[..];
        let mut done = 0;
        for polygon in &self.polygons {
            all.extend_from_slice(&self.triangles[done..polygon.before]);
            done = polygon.before;
            let (these, rest) = corners.split_at(polygon.corners as usize);
            cutter.cut(these, &position, &mut all);
            corners = rest;
        }
        all.extend_from_slice(&self.triangles[done..]);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(i: u32) -> DVec3 {
        let a = f64::from(i);
        DVec3::new(a.cos(), a.sin(), 0.0)
    }

    #[test]
    fn faces_keep_their_order_and_bad_ones_are_counted() {
        let mut faces = Faces::new(6, 0);
        faces.push(&[0, 1, 2]).unwrap();
        faces.push(&[0, 1, 2, 3]).unwrap();
        faces.push(&[4, 5]).unwrap();
        let mut more = Faces::new(6, 0);
        more.push(&[3, 4, 5]).unwrap();
        more.push(&[1, 2, 3, 4, 5]).unwrap();
        more.push(&[]).unwrap();
        faces.append(more);
        assert_eq!(faces.push(&[0, 6, 1, 2]), Err(BadIndex(6.0)));
        let mut repairs = Repairs::default();
        let all = faces.triangulate(corner, &mut repairs);
        assert_eq!(all, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 4, 5], [1, 2, 3], [1, 3, 4], [1, 4, 5]]);
        assert_eq!((repairs.triangulated, repairs.bad_faces), (2, 2));
    }

    #[test]
    fn strips_alternate_restart_and_skip_stitches() {
        let mut faces = Faces::new(9, 0);
        faces.push_strips(&[0, 1, 2, 3, 3, 4, -1, 5, 6, -1, -1, 6, 7, 8]).unwrap();
        assert_eq!(faces.triangles, [[0, 1, 2], [2, 1, 3], [6, 7, 8]]);
        assert_eq!(faces.push_strips(&[0, 1, 9]), Err(BadIndex(9.0)));
        assert_eq!(faces.push_strips(&[0, 1, -2]), Err(BadIndex(-2.0)));
    }
}
