//! Mechanics: tetrahedra of soft tissue, implicit Euler, contact by penalty.
//!
//! Each step [`Dynamics::begin_step`] computes where every body goes as things are, the caller finds
//! close pairs and penetrating nodes within [`Dynamics::search_distance`], and
//! [`Dynamics::finish_step`] solves for the contact forces and moves the bodies.

mod body;
mod contact;
mod dynamics;
mod energy;
mod error;
mod materials;
mod state;
mod ties;
mod tissue;

pub use body::BodyBasis;
pub use contact::{Contact, Patch, PatchMemory, Touch};
pub use dynamics::{
    Cause, ChangedBody, Drive, Dynamics, DynamicsOptions, Failure, StageTimes, StepStats,
};
pub use energy::{Energy, Momentum};
pub use error::MechanicsError;
pub use state::{BodyState, ContactForce, State};
pub use ties::Pull;
pub use tissue::von_mises;
