//! One step as several smaller ones.

use palpate_model::Model;

use super::{Dynamics, DynamicsOptions};
use crate::error::MechanicsError;

impl Dynamics {
    /// The same bodies in the same state with another time step, for [`Dynamics::begin_substep`]: it makes
    /// their matrices anew.
    ///
    /// # Errors
    /// As [`Dynamics::with_state`].
    pub fn with_time_step(&self, model: &Model, time_step: f64) -> Result<Self, MechanicsError> {
        let options = DynamicsOptions { time_step, ..self.options };
        Self::with_state(model, options, &self.state())
    }

    /// [`Dynamics::begin_step`] where `left` steps, this one included, are left in which driven nodes, tools
    /// and the ends of springs go to where they are told, straight and at a steady speed.
    ///
    /// # Panics
    /// If `left` is zero.
    pub fn begin_substep(&mut self, left: u32) {
        assert!(left > 0, "at least this step");
        self.begin_part(f64::from(left).recip());
    }

    /// Takes over the state of `finer`, the same bodies some smaller steps later, as the end of one step of
    /// its own.
    ///
    /// # Errors
    /// As [`Dynamics::set_state`].
    pub fn take_over(&mut self, finer: &Self) -> Result<(), MechanicsError> {
        let mut state = finer.state();
        state.step = self.step + 1;
        state.time = self.time_at(self.step + 1);
        state.clock_start = (self.start_time, self.start_step);
        self.set_state(&state)?;
        self.response.take_contacts(finer.contacts());
        Ok(())
    }

    /// Whether a step fails that blows tetrahedra up, or turns them over, to more than their volume at rest; it
    /// does not unless this is said. Such a step is worth another try in smaller ones.
    pub fn set_strict(&mut self, strict: bool) {
        self.strict = strict;
    }
}
