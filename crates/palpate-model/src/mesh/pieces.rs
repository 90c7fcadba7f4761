//! The pieces that a mesh consists of.

use std::collections::BTreeMap;

use super::Mesh;

impl Mesh {
    /// The tetrahedra that hang together, each piece sorted, by their first tetrahedra: those of two
    /// pieces have no node in common.
    pub fn pieces(&self) -> Vec<Vec<u32>> {
        let mut label: Vec<u32> = (0..self.nodes().len() as u32).collect();
        let root = |label: &mut Vec<u32>, mut node: u32| {
            while label[node as usize] != node {
                label[node as usize] = label[label[node as usize] as usize];
                node = label[node as usize];
            }
            node
        };
        for corners in self.tetrahedra() {
            let first = root(&mut label, corners[0]);
            for &corner in &corners[1..] {
                let other = root(&mut label, corner);
                label[other as usize] = first;
            }
        }
        let mut piece_of: BTreeMap<u32, usize> = BTreeMap::new();
        let mut pieces: Vec<Vec<u32>> = Vec::new();
        for (tetrahedron, corners) in self.tetrahedra().iter().enumerate() {
            let label = root(&mut label, corners[0]);
            let piece = *piece_of.entry(label).or_insert(pieces.len());
            if piece == pieces.len() {
                pieces.push(Vec::new());
            }
            pieces[piece].push(tetrahedron as u32);
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
