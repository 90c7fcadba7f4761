//! What tests, examples and the fuzzer of several crates need. Not published, and nothing that users run
//! may depend on it.

mod boxes;
mod counting_allocator;
mod random;

pub use boxes::{Fastest, box_of_cells, rectangle};
pub use counting_allocator::{Counting, allocations, bytes_in_use, peak_of};
pub use random::Random;
