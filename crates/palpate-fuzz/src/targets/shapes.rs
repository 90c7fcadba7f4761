//! Meshes to play with.

use palpate::{Mesh, MeshData};
use palpate_testing::{Fastest, box_of_cells, rectangle};

/// A box of cells (i, j, k) of edge `h`, six tetrahedra each; nodes of the lowest layer are the set
/// `base`, and layers along x regions 0 and 1 by turns.
pub(crate) fn box_of(cells: [usize; 3], h: f64, origin: [f64; 3]) -> Mesh {
    let place = |at: [f64; 3]| std::array::from_fn(|axis| origin[axis] + at[axis] * h);
    let (nodes, tetrahedra) = box_of_cells(cells, Fastest::Last, place);
    let [_, ny, nz] = cells;
    let mut data = MeshData { nodes, tetrahedra, ..MeshData::default() };
    data.regions = (0..data.tetrahedra.len()).map(|t| (t / (6 * ny * nz) % 2) as i32).collect();
    data.node_sets.insert("base".into(), (0..data.nodes.len() as u32).step_by(nz + 1).collect());
    Mesh::new(data).expect("a box is a mesh")
}

/// A square of two triangles.
pub(crate) fn plate(size: f64, height: f64) -> Mesh {
    let (nodes, triangles) = rectangle([-size; 2], [size; 2], height);
    Mesh::new(MeshData { nodes, triangles, ..MeshData::default() }).expect("a plate is a mesh")
}
