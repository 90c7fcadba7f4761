//! Mechanics: linear-elastic tetrahedra in a rotating frame, implicit Euler, contact by penalty.
//!
//! Each step [`Dynamics::begin_step`] computes where every body would go alone, the caller finds
//! close pairs and penetrating nodes within [`Dynamics::search_distance`], and
//! [`Dynamics::finish_step`] solves for the contact forces and moves the bodies.

mod body;
mod contact;
mod dynamics;
mod energy;
mod error;
#[cfg_attr(not(test), expect(dead_code, reason = "the time step does not call the laws yet"))]
mod materials;
mod state;
#[cfg_attr(not(test), expect(dead_code, reason = "the time step does not call the laws yet"))]
mod tissue;

pub use contact::Contact;
pub use dynamics::{Dynamics, DynamicsOptions, StageTimes, StepStats};
pub use energy::{Energy, Momentum};
pub use error::MechanicsError;
pub use state::{BodyState, ContactForce, State};
