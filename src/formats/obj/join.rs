//! Corners that share position, texture coordinate and normal become one vertex.

use super::columns::{Column, Corners};
use std::collections::HashMap;

/// The vertices of a mesh, in the order in which faces first use them.
pub struct Joined {
    /// Of each vertex the number of its position, from 0.
    pub positions: Vec<u32>,
    /// Of each vertex the numbers of its texture coordinate and normal, from 1, 0 where absent; empty if no corner
    /// has one that differs from its position's.
    pub attributes: Vec<[u32; 2]>,
    /// Vertex of each corner.
    pub indices: Vec<u32>,
}

/// No vertex, or none further.
const NONE: u32 = u32::MAX;

/// Vertices of one position that are looked through one by one; a mesh has one or two, four at most where seams meet.
const MOST_STEPS: usize = 16;

/// Joins the corners of a file with so many positions; all indices are in range.
pub fn join(corners: Corners, positions: usize) -> Joined {
    let Corners { positions: indices, attributes } = corners;
    match attributes {
        [Column::Absent | Column::AsPositions, Column::Absent | Column::AsPositions] => {
            renumber(indices, positions)
        }
        [uvs, normals] => Joiner::new(positions).join(indices, &uvs, &normals),
    }
}

/// Each position is one vertex.
fn renumber(mut indices: Vec<u32>, positions: usize) -> Joined {
    let mut vertex_of = vec![NONE; positions];
    let mut used = Vec::new();
    for index in &mut indices {
        let position = *index - 1;
        let vertex = &mut vertex_of[position as usize];
        if *vertex == NONE {
            *vertex = used.len() as u32;
            used.push(position);
        }
        *index = *vertex;
    }
    Joined { positions: used, attributes: Vec::new(), indices }
}

/// Vertices by position: each position has a chain of those that were made of it.
struct Joiner {
    /// By position.
    first: Vec<u32>,
    /// By vertex.
    next: Vec<u32>,
    positions: Vec<u32>,
    attributes: Vec<[u32; 2]>,
    /// Vertices of positions whose chains grew too long: some files hang a million normals on one position.
    others: HashMap<[u32; 3], u32>,
}

impl Joiner {
    fn new(positions: usize) -> Self {
        Joiner {
            first: vec![NONE; positions],
            next: Vec::new(),
            positions: Vec::new(),
            attributes: Vec::new(),
            others: HashMap::new(),
        }
    }

    fn join(mut self, mut indices: Vec<u32>, uvs: &Column, normals: &Column) -> Joined {
        let number = |column: &Column, corner: usize, position: u32| match column {
            Column::Absent => 0,
            Column::AsPositions => position,
            Column::Own(list) => list[corner],
        };
        for (corner, index) in indices.iter_mut().enumerate() {
            let attributes = [number(uvs, corner, *index), number(normals, corner, *index)];
            *index = self.vertex(*index - 1, attributes);
        }
        Joined { positions: self.positions, attributes: self.attributes, indices }
    }

    #[inline(always)]
    fn vertex(&mut self, position: u32, attributes: [u32; 2]) -> u32 {
        let mut last = NONE;
        let mut at = self.first[position as usize];
        let mut steps = 0;
        while at != NONE {
            if self.attributes[at as usize] == attributes {
                return at;
            }
            steps += 1;
            (last, at) = (at, self.next[at as usize]);
        }
        if steps >= MOST_STEPS {
            return self.other_vertex(position, attributes);
        }
        let new = self.add(position, attributes);
        match last {
            NONE => self.first[position as usize] = new,
            last => self.next[last as usize] = new,
        }
        new
    }

    #[cold]
    fn other_vertex(&mut self, position: u32, attributes: [u32; 2]) -> u32 {
        let key = [position, attributes[0], attributes[1]];
        if let Some(&known) = self.others.get(&key) {
            return known;
        }
        let new = self.add(position, attributes);
        self.others.insert(key, new);
        new
    }

    fn add(&mut self, position: u32, attributes: [u32; 2]) -> u32 {
        let new = self.positions.len() as u32;
        self.positions.push(position);
        self.attributes.push(attributes);
        self.next.push(NONE);
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    /// The plain way to say it.
    fn by_hash(corners: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<u32>) {
        let mut known = HashMap::new();
        let mut vertices = Vec::new();
        let indices = corners.iter().map(|&corner| {
            *known.entry(corner).or_insert_with(|| {
                vertices.push(corner);
                vertices.len() as u32 - 1
            })
        });
        let indices = indices.collect();
        (vertices, indices)
    }

    #[test]
    fn vertices_are_as_a_hash_table_finds_them() {
        let mut rng = TestRng::new(5);
        // Positions, attributes, corners: few of all, one value of each, and chains far longer than are walked.
        for (p, a, n) in [(9, 3, 100), (50, 1, 300), (1, 500, 3000), (3, 40, 2000), (400, 2, 900)] {
            let mut below = |n: u32| (rng.f64() * f64::from(n)) as u32;
            let list: Vec<[u32; 3]> = (0..n).map(|_| [1 + below(p), below(a), below(a)]).collect();
            let mut corners = Corners::default();
            list.iter().for_each(|&c| corners.push(c));
            let joined = join(corners, p as usize);
            let (vertices, indices) = by_hash(&list);
            assert_eq!(joined.indices, indices);
            assert_eq!(joined.positions, vertices.iter().map(|v| v[0] - 1).collect::<Vec<_>>());
            if !joined.attributes.is_empty() {
                assert_eq!(joined.attributes, vertices.iter().map(|v| [v[1], v[2]]).collect::<Vec<_>>());
            }
        }
    }
}
