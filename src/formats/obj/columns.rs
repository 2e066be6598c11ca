//! What the corners of all faces refer to, in as little memory as the file allows: most files give each corner one
//! number, thrice the same number, or no third one.

/// The numbers of one attribute, corner by corner.
#[derive(Debug, Default, PartialEq)]
pub enum Column {
    /// No corner has one.
    #[default]
    Absent,
    /// Each corner's is that of its position.
    AsPositions,
    /// As listed; 0 where absent.
    Own(Vec<u32>),
}

impl Column {
    /// One more corner; `before` are the positions of those before it.
    #[inline(always)]
    fn push(&mut self, index: u32, position: u32, before: &[u32]) {
        match self {
            Column::Own(list) => list.push(index),
            Column::Absent if index == 0 => {}
            Column::AsPositions if index == position => {}
            _ => self.push_different(index, position, before),
        }
    }

    #[cold]
    fn push_different(&mut self, index: u32, position: u32, before: &[u32]) {
        if !before.is_empty() {
            self.list(before).push(index);
        } else if index == 0 || index == position {
            *self = if index == 0 { Column::Absent } else { Column::AsPositions };
        } else {
            *self = Column::Own(vec![index]);
        }
    }

    /// The numbers as a list of their own; `positions` are those of the corners there are.
    fn list(&mut self, positions: &[u32]) -> &mut Vec<u32> {
        match self {
            Column::Own(_) => {}
            Column::Absent => *self = Column::Own(vec![0; positions.len()]),
            Column::AsPositions => *self = Column::Own(positions.to_vec()),
        }
        let Column::Own(list) = self else { unreachable!("just made") };
        list
    }

    /// Adds the corners of `other`, whose positions are `added`, after those of `positions`.
    fn append(&mut self, other: Column, positions: &[u32], added: &[u32]) {
        if positions.is_empty() {
            *self = other;
            return;
        }
        match (&mut *self, other) {
            (Column::Absent, Column::Absent) | (Column::AsPositions, Column::AsPositions) => {}
            (this, Column::Own(other)) => this.list(positions).extend_from_slice(&other),
            (this, Column::AsPositions) => this.list(positions).extend_from_slice(added),
            (this, Column::Absent) => {
                let list = this.list(positions);
                list.resize(list.len() + added.len(), 0);
            }
        }
    }

    /// Corners that have one.
    fn given(&self, corners: usize) -> usize {
        match self {
            Column::Absent => 0,
            Column::AsPositions => corners,
            Column::Own(list) => list.iter().filter(|&&i| i != 0).count(),
        }
    }
}

/// The corners of faces in file order; numbers count from 1.
#[derive(Debug, Default)]
pub struct Corners {
    /// Of their positions.
    pub positions: Vec<u32>,
    /// Of texture coordinates and normals.
    pub attributes: [Column; 2],
}

impl Corners {
    /// How many.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// One more.
    #[inline(always)]
    pub fn push(&mut self, corner: [u32; 3]) {
        let [position, uv, normal] = corner;
        self.attributes[0].push(uv, position, &self.positions);
        self.attributes[1].push(normal, position, &self.positions);
        self.positions.push(position);
    }

    /// One more whose numbers may still change by [`Corners::set`]: nothing can be told from their being equal.
    pub fn push_unsettled(&mut self, corner: [u32; 3]) {
        for (column, &index) in self.attributes.iter_mut().zip(&corner[1..]) {
            if index != 0 || !matches!(column, Column::Absent) {
                column.list(&self.positions).push(index);
            }
        }
        self.positions.push(corner[0]);
    }

    /// Changes the number of kind 0 (position), 1 (texture coordinate) or 2 (normal) of a corner that was
    /// [unsettled](Corners::push_unsettled) and has that kind.
    pub fn set(&mut self, corner: usize, kind: usize, index: u32) {
        match kind {
            0 => self.positions[corner] = index,
            _ => self.attributes[kind - 1].list(&self.positions)[corner] = index,
        }
    }

    /// Forgets all corners from number `count` on.
    pub fn truncate(&mut self, count: usize) {
        self.positions.truncate(count);
        for column in &mut self.attributes {
            if let Column::Own(list) = column {
                list.truncate(count);
            }
        }
    }

    /// Adds those of `other`.
    pub fn append(&mut self, other: Corners) {
        for (column, more) in self.attributes.iter_mut().zip(other.attributes) {
            column.append(more, &self.positions, &other.positions);
        }
        self.positions.extend_from_slice(&other.positions);
    }

    /// How many have a texture coordinate, or a normal.
    pub fn given(&self, attribute: usize) -> usize {
        self.attributes[attribute].given(self.len())
    }

    /// Gives up lists that say nothing new.
    pub fn compact(&mut self) {
        for column in &mut self.attributes {
            if let Column::Own(list) = column
                && *list == self.positions
            {
                *column = Column::AsPositions;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    fn plain(corners: &Corners) -> Vec<[u32; 3]> {
        let read = |column: &Column, i: usize| match column {
            Column::Absent => 0,
            Column::AsPositions => corners.positions[i],
            Column::Own(list) => list[i],
        };
        let [uvs, normals] = &corners.attributes;
        (0..corners.len()).map(|i| [corners.positions[i], read(uvs, i), read(normals, i)]).collect()
    }

    #[test]
    fn whatever_is_pushed_cut_and_joined_reads_back() {
        let mut rng = TestRng::new(3);
        for case in 0..3000 {
            let mut below = |n: usize| (rng.f64() * n as f64) as usize;
            // Few numbers, so that equal and absent ones are common; some cases have nothing else.
            let odd = case % 3;
            let (mut corners, mut want) = (Corners::default(), Vec::new());
            for _ in 0..1 + below(4) {
                let (mut part, mut part_want) = (Corners::default(), Vec::new());
                for _ in 0..below(6) {
                    let position = 1 + below(4) as u32;
                    let mut other = || match below(2 + odd) {
                        0 => 0,
                        1 => position,
                        _ => 1 + below(4) as u32,
                    };
                    let corner = [position, other(), other()];
                    if below(4) == 0 {
                        part.push_unsettled(corner);
                    } else {
                        part.push(corner);
                    }
                    part_want.push(corner);
                    if below(5) == 0 {
                        part.truncate(part_want.len() - 1);
                        part_want.pop();
                    }
                }
                corners.append(part);
                want.extend(part_want);
            }
            assert_eq!(plain(&corners), want);
            corners.compact();
            assert_eq!(plain(&corners), want);
            for kind in 0..2 {
                assert_eq!(corners.given(kind), want.iter().filter(|c| c[kind + 1] != 0).count());
            }
        }
    }
}
