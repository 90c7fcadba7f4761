//! What tests, examples and the fuzzer of several crates need. Not published, and nothing that users run
//! may depend on it.

mod boxes;
mod counting_allocator;

pub use boxes::{Fastest, box_of_cells};
pub use counting_allocator::{Counting, allocations, bytes_in_use, peak_of};
