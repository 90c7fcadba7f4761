//! Approximate minimum degree, by faer.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use crate::BlockPattern;

pub(super) fn order(pattern: &BlockPattern) -> Vec<u32> {
    let count = pattern.node_count();
    let mut starts = vec![0_u32; count + 1];
    let mut rows = Vec::with_capacity(pattern.block_count());
    for col in 0..count {
        rows.extend_from_slice(pattern.column(col));
        starts[col + 1] = rows.len() as u32;
    }
    let matrix = SymbolicSparseColMatRef::new_checked(count, count, &starts, None, &rows);
    let mut memory = MemBuffer::new(amd::order_scratch::<u32>(count, rows.len()));
    let (mut forward, mut inverse) = (vec![0; count], vec![0; count]);
    let control = amd::Control::default();
    amd::order(&mut forward, &mut inverse, matrix, control, MemStack::new(&mut memory))
        .expect("the graph is far below the index range");
    forward
}
