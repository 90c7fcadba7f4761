//! The crate against slow twins in exact integers, on input made to be nasty.

mod distance;
mod integers;
mod intersection;
mod neighbours;
mod oracle;
mod predicates;
mod strategies;
