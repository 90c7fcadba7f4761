//! Boxes of cells.

use palpate::MeshData;
use palpate_testing::{Fastest, box_of_cells};

/// A box of `cells` cubic cells with edge `h` [m].
pub(crate) fn box_data(cells: [usize; 3], h: f64, origin: [f64; 3]) -> MeshData {
    let place = |at: [f64; 3]| std::array::from_fn(|axis| origin[axis] + at[axis] * h);
    let (nodes, tetrahedra) = box_of_cells(cells, Fastest::Last, place);
    MeshData { nodes, tetrahedra, ..MeshData::default() }
}
