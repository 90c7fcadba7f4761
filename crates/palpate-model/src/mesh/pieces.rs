//! The pieces that a mesh consists of.

use super::{Mesh, NONE};
use crate::disjoint_sets::DisjointSets;

impl Mesh {
    /// The tetrahedra that hang together, each piece sorted, by their first tetrahedra: those of two
    /// pieces have no node in common.
    pub fn pieces(&self) -> Vec<Vec<u32>> {
        let mut parts = DisjointSets::new(self.nodes().len());
        for &[first, ref others @ ..] in self.tetrahedra() {
            for &node in others {
                parts.join(first, node);
            }
        }
        let mut piece_of = vec![NONE; self.nodes().len()];
        let mut pieces: Vec<Vec<u32>> = Vec::new();
        for (tetrahedron, corners) in (0..).zip(self.tetrahedra()) {
            let piece = &mut piece_of[parts.root(corners[0]) as usize];
            if *piece == NONE {
                *piece = pieces.len() as u32;
                pieces.push(Vec::new());
            }
            pieces[*piece as usize].push(tetrahedron);
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::super::row::row;

    #[test]
    fn pieces_have_no_node_in_common() {
        // Tetrahedra k and k + 3 still share a node, k and k + 4 do not.
        let two = row(9).remove(&[3, 4, 5]).unwrap().mesh;
        assert_eq!(two.pieces(), [vec![0, 1, 2], vec![3, 4, 5]]);
        assert_eq!(row(9).remove(&[3, 4]).unwrap().mesh.pieces(), [vec![0, 1, 2, 3, 4, 5, 6]]);
    }
}
