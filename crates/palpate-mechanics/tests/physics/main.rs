//! Physics that the mechanics must get right, body by body and in contact.

mod attachment;
mod change;
mod contact;
mod determinism;
mod elasticity;
mod errors;
mod free_motion;
mod friction;
mod hands;
mod impact;
mod nonlinear;
mod patch;
mod world;
