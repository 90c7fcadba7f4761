//! Approximate minimum degree (Amestoy, Davis and Duff 1996), by the crate `amd`.

use crate::BlockPattern;

pub(super) fn order(pattern: &BlockPattern) -> Vec<u32> {
    let count = pattern.node_count();
    let mut starts = vec![0_i32; count + 1];
    let mut rows = Vec::with_capacity(pattern.block_count());
    for col in 0..count {
        rows.extend(pattern.column(col).iter().map(|&row| row.cast_signed()));
        starts[col + 1] = rows.len() as i32;
    }
    let (order, ..) = amd::order(count as i32, &starts, &rows, &amd::Control::default())
        .expect("columns of ascending rows below the index range");
    order.into_iter().map(i32::cast_unsigned).collect()
}
