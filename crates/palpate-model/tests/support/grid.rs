//! A box cut into cells of six tetrahedra each.

use palpate_model::MeshData;

/// A box of `cells` cells along each axis and of edge lengths `size`, one corner at the origin.
pub(crate) fn box_data(cells: [usize; 3], size: [f64; 3]) -> MeshData {
    let index = |[i, j, k]: [usize; 3]| (i + (cells[0] + 1) * (j + (cells[1] + 1) * k)) as u32;
    let mut nodes = Vec::new();
    for k in 0..=cells[2] {
        for j in 0..=cells[1] {
            for i in 0..=cells[0] {
                let at = [i, j, k];
                nodes.push(std::array::from_fn(|axis| {
                    size[axis] * at[axis] as f64 / cells[axis] as f64
                }));
            }
        }
    }
    // One tetrahedron for each order of walking along the axes; odd orders are inverted.
    let walks = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]];
    let mut tetrahedra = Vec::new();
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                for (number, walk) in walks.iter().enumerate() {
                    let mut at = [i, j, k];
                    let mut nodes = [index(at); 4];
                    for (step, &axis) in walk.iter().enumerate() {
                        at[axis] += 1;
                        nodes[step + 1] = index(at);
                    }
                    if number >= 3 {
                        nodes.swap(2, 3);
                    }
                    tetrahedra.push(nodes);
                }
            }
        }
    }
    MeshData { nodes, tetrahedra, ..MeshData::default() }
}
