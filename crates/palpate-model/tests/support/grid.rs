//! A box cut into cells of six tetrahedra each.

use palpate_model::MeshData;
use palpate_testing::{Fastest, box_of_cells};

/// A box of `cells` cells along each axis and of edge lengths `size`, one corner at the origin.
pub(crate) fn box_data(cells: [usize; 3], size: [f64; 3]) -> MeshData {
    let place =
        |at: [f64; 3]| std::array::from_fn(|axis| size[axis] * at[axis] / cells[axis] as f64);
    let (nodes, tetrahedra) = box_of_cells(cells, Fastest::First, place);
    MeshData { nodes, tetrahedra, ..MeshData::default() }
}
