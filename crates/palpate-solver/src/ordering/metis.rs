//! Nested dissection, by METIS (Karypis and Kumar 1998).

use std::sync::Mutex;

use metis_sys as sys;

use super::Graph;

/// METIS draws from the C library's global generator: one call at a time, so that an order depends
/// on its graph only.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// `order[new]` = old node; `None` where METIS cannot work (an empty graph, no edge, no memory).
#[allow(unsafe_code)]
pub(super) fn order(graph: &Graph) -> Option<Vec<u32>> {
    let count = graph.node_count();
    if graph.neighbours.is_empty() || i32::try_from(graph.neighbours.len()).is_err() {
        return None;
    }
    let mut node_count = count as sys::idx_t;
    let mut starts: Vec<sys::idx_t> = graph.starts.iter().map(|&i| i as sys::idx_t).collect();
    let mut neighbours: Vec<sys::idx_t> =
        graph.neighbours.iter().map(|&i| i as sys::idx_t).collect();
    let mut options: [sys::idx_t; sys::METIS_NOPTIONS as usize] = [0; _];
    let mut order: Vec<sys::idx_t> = vec![0; count];
    let mut place: Vec<sys::idx_t> = vec![0; count];
    let guard = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    // SAFETY: every pointer is to a live, exclusively borrowed array of the length that METIS
    // documents (options NOPTIONS, starts n + 1, neighbours starts[n], order and place n); the
    // adjacency is symmetric, without loops and in range, as `Graph` makes it.
    let status = unsafe {
        sys::METIS_SetDefaultOptions(options.as_mut_ptr());
        options[sys::moptions_et_METIS_OPTION_SEED as usize] = 1;
        sys::METIS_NodeND(
            &raw mut node_count,
            starts.as_mut_ptr(),
            neighbours.as_mut_ptr(),
            std::ptr::null_mut(),
            options.as_mut_ptr(),
            order.as_mut_ptr(),
            place.as_mut_ptr(),
        )
    };
    drop(guard);
    let mut seen = vec![false; count];
    let is_permutation =
        order.iter().all(|&node| !std::mem::replace(&mut seen[node as usize], true));
    (status == sys::rstatus_et_METIS_OK && is_permutation)
        .then(|| order.into_iter().map(|node| node as u32).collect())
}
